//! Where a capture's calibration is, whichever program made it.

use super::{ImportOptions, SceneError, Warning};
use calibrate::colmap::{self, ColmapError, SubModel};
use calibrate::formats::{self, Format, FormatError};
use calibrate::opencv::{self, Keys};
use capture::as_argument;
use std::path::{Path, PathBuf};

/// Where a calibration is, and whose.
#[derive(Debug)]
pub(super) enum Source {
    /// The folder of a COLMAP model.
    Colmap(PathBuf),
    /// A file by OpenCV.
    OpenCv(PathBuf),
    /// A file of another program.
    Other(Format, PathBuf),
}

impl Source {
    /// The file, or a COLMAP model's folder.
    pub(super) fn path(&self) -> &Path {
        match self {
            Self::Colmap(path) | Self::OpenCv(path) | Self::Other(_, path) => path,
        }
    }

    /// For messages.
    pub(super) fn text(&self) -> String {
        match self {
            Self::Colmap(model) => format!("the COLMAP model in {}", model.display()),
            Self::OpenCv(file) | Self::Other(_, file) => file.display().to_string(),
        }
    }
}

/// The calibration of a capture: the file or folder given, else what the capture's folder
/// holds. A COLMAP model comes before an OpenCV file and others, but for one in `colmap`, which
/// comes last; what is passed over is noted, and where nothing else is there, a calibration that
/// cannot be used is the error.
pub(super) fn find(
    capture: &Path,
    options: &ImportOptions,
    warnings: &mut Vec<Warning>,
) -> Result<Source, SceneError> {
    let source = search(capture, options, warnings)?;
    if !matches!(source, Source::OpenCv(_)) {
        warnings.extend(unused_keys(&options.keys, &source.text()).map(Warning::Note));
    }
    Ok(source)
}

/// What to say of options for OpenCV's files that were given with another calibration, called so for people, if
/// any.
pub fn unused_keys(keys: &Keys, calibration: &str) -> Option<String> {
    let options = [
        ("--camera-matrix", keys.camera_matrix.is_some()),
        ("--distortion", keys.distortion.is_some()),
        ("--fisheye", keys.fisheye),
    ];
    let given = options.into_iter().filter(|(_, is_given)| *is_given);
    let given: Vec<&str> = given.map(|(name, _)| name).collect();
    let change = match given.len() {
        0 => return None,
        1 => "changes",
        _ => "change",
    };
    Some(format!(
        "{} {change} nothing: the calibration is {calibration}, none of OpenCV's",
        given.join(" and ")
    ))
}

/// As [`find`], whatever other options there are.
fn search(
    capture: &Path,
    options: &ImportOptions,
    warnings: &mut Vec<Warning>,
) -> Result<Source, SceneError> {
    let given = options.calibration.as_deref();
    if let Some(file) = given.filter(|path| path.is_file()) {
        // One of a COLMAP model's files stands for all.
        let folder = file.parent().unwrap_or(Path::new(""));
        let is_colmap = ["bin", "txt"]
            .iter()
            .any(|e| file.extension() == Some(e.as_ref()))
            && colmap::find_model(folder).is_ok_and(|model| model == folder);
        let format = formats::detect(file).or_else(|| formats::meant(file));
        return Ok(match format {
            _ if is_colmap => Source::Colmap(folder.to_owned()),
            Some(format) => Source::Other(format, file.to_owned()),
            None => Source::OpenCv(file.to_owned()),
        });
    }

    // 1. What is there.
    let folder = given.unwrap_or(capture);
    let Candidates {
        model,
        usable,
        unusable,
    } = Candidates::within(folder, &options.keys);
    let mut found = usable.into_iter();

    // 2. The first of it.
    let (source, closed) = match (found.next(), model) {
        (Some(source), model) => (source, model.err().filter(is_closed)),
        (None, Ok(model)) => (Source::Colmap(model), None),
        (None, Err(error)) => {
            let is_nothing = is_nothing_there(&error);
            return Err(match unusable.into_iter().next() {
                Some(reason) if is_nothing => reason,
                _ if is_nothing && given.is_none() => SceneError::Uncalibrated {
                    folder: folder.to_owned(),
                    source: error,
                },
                _ => error.into(),
            });
        }
    };

    // 3. The rest.
    if let Source::Colmap(model) = &source
        && model != folder
    {
        let others = other_models(model, &takes(capture, "PATH"));
        warnings.extend(others.map(Warning::Note));
    }
    let others: Vec<Source> = found.collect();
    warnings.extend(others_text(capture, &source, &others).map(Warning::Note));
    // OpenCV's calibrations may be in several files, of which one alone can be read.
    let is_part = |error: &SceneError| {
        matches!(source, Source::OpenCv(_)) && matches!(error, SceneError::OpenCv(_))
    };
    let unusable = unusable.into_iter().filter(|error| !is_part(error));
    for reason in unusable.chain(closed.map(SceneError::from)) {
        warnings.push(Warning::Note(format!(
            "the calibration is {}; not used: {reason}",
            source.text()
        )));
    }
    Ok(source)
}

/// The calibrations in a folder.
struct Candidates {
    /// The COLMAP model.
    model: Result<PathBuf, ColmapError>,
    /// All of them, the one to take first.
    usable: Vec<Source>,
    /// What is wrong with others.
    unusable: Vec<SceneError>,
}

impl Candidates {
    fn within(folder: &Path, keys: &Keys) -> Self {
        let model = colmap::find_model(folder);
        let of_opencv = opencv::find_calibrations(folder, keys);
        let (others, damaged) = others(folder);
        let files = of_opencv.usable.into_iter().map(Source::OpenCv);
        let mut usable: Vec<Source> = files.chain(others).collect();
        if let Ok(model) = &model {
            // What another program made of COLMAP's own work is what its user goes by.
            let place = if is_own_work(folder, model) {
                usable.len()
            } else {
                0
            };
            usable.insert(place, Source::Colmap(model.clone()));
            let mut elsewhere = colmap::find_models(folder);
            elsewhere.retain(|other| other != model);
            usable.extend(elsewhere.into_iter().map(Source::Colmap));
        }
        let damaged = damaged.into_iter().map(SceneError::Format);
        let unusable = of_opencv.unusable.into_iter().map(SceneError::OpenCv);
        Self {
            model,
            usable,
            unusable: damaged.chain(unusable).collect(),
        }
    }
}

/// Whether a folder's model is in its `colmap`, where nerfstudio has COLMAP work.
fn is_own_work(folder: &Path, model: &Path) -> bool {
    model.starts_with(folder.join("colmap"))
}

/// The calibration that is taken of those in a folder, if there is one and nobody says which: a
/// COLMAP model's folder or a file. That may be one of OpenCV's that needs names of matrices.
pub fn calibration_in(folder: &Path) -> Option<PathBuf> {
    let model = colmap::find_model(folder).ok();
    if let Some(model) = model.filter(|model| !is_own_work(folder, model)) {
        return Some(model);
    }
    let found = Candidates::within(folder, &Keys::default());
    let by_keys = || {
        let mut unusable = found.unusable.iter();
        unusable.find_map(|error| match error {
            SceneError::OpenCv(error) => Some(error.path().to_owned()),
            _ => None,
        })
    };
    let usable = found.usable.first().map(|source| source.path().to_owned());
    usable.or_else(by_keys)
}

/// What takes a calibration of a capture that is not the first in its folder, for people, to go on with: the one
/// command that is told of one.
fn takes(capture: &Path, calibration: &str) -> String {
    let capture = as_argument(capture);
    format!("`lumigraph import {capture} --calibration {calibration} -o SCENE` takes")
}

/// What to say of a capture's calibrations that are passed over, if there are any.
fn others_text(capture: &Path, source: &Source, others: &[Source]) -> Option<String> {
    let paths = others
        .iter()
        .map(|other| other.path().display().to_string());
    let paths: Vec<String> = paths.collect();
    let change = match &paths[..] {
        [] => return None,
        [path] => {
            let argument = as_argument(others[0].path());
            format!("{} that in {path}", takes(capture, &argument))
        }
        _ => format!("{} another: {}", takes(capture, "PATH"), some_of(paths)),
    };
    let lacks_points = matches!(
        source,
        Source::OpenCv(_) | Source::Other(Format::Transforms | Format::Llff, _)
    );
    let model = others
        .iter()
        .find(|other| matches!(other, Source::Colmap(_)));
    let gain = model
        .filter(|_| lacks_points)
        .map_or_else(String::new, |model| {
            let model = model.text();
            format!(" ({model} may have sparse points, which this has not)")
        });
    Some(format!(
        "the calibration is {}; {change}{gain}",
        source.text()
    ))
}

/// The first few of a list, for people.
fn some_of(mut listed: Vec<String>) -> String {
    // More are only counted.
    const SHOWN: usize = 3;
    if listed.len() > SHOWN {
        let more = listed.len() - SHOWN;
        listed.truncate(SHOWN);
        listed.push(format!("{more} more"));
    }
    listed.join(", ")
}

/// What to say of the models beside one of several that COLMAP could not join, if there are
/// others; `takes` is a command, and its verb, that another is for.
pub fn other_models(model: &Path, takes: &str) -> Option<String> {
    let text = |one: &SubModel| {
        let photos = match one.images {
            Some(photos) => format!("{photos} photos"),
            None => "damaged".to_owned(),
        };
        format!("{} ({photos})", one.folder.display())
    };
    let all = colmap::side_by_side(model);
    let taken = text(all.iter().find(|one| one.folder == model)?);
    let others = all.iter().filter(|one| one.folder != model);
    let listed: Vec<String> = others.map(text).collect();
    if listed.is_empty() {
        return None;
    }
    Some(format!(
        "the calibration is the COLMAP model in {taken}; {takes} another: {}",
        some_of(listed)
    ))
}

/// Whether not even a part of a model was found.
fn is_nothing_there(error: &ColmapError) -> bool {
    matches!(error, ColmapError::NoModel { incomplete, .. } if incomplete.is_empty())
}

/// Whether a model may be there and cannot be looked into.
fn is_closed(error: &ColmapError) -> bool {
    matches!(error, ColmapError::Closed { .. })
}

/// Where Bundler itself leaves its work, beside the list of photos.
const BUNDLER: &str = "bundle/bundle.out";

/// The other programs' calibrations in a folder, by name, but parts of a data set that are not to
/// be trained on last, and what Bundler left within; and what is wrong with files that are called like one.
fn others(folder: &Path) -> (Vec<Source>, Vec<FormatError>) {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    // Of a link that leads nowhere it is told that it cannot be read.
    let is_file = |path: &PathBuf| path.is_file() || (path.is_symlink() && !path.exists());
    let mut files: Vec<PathBuf> = entries.map(|e| e.path()).filter(is_file).collect();
    files.sort_by_cached_key(|file| (is_test_split(file), file.clone()));
    files.extend(Some(folder.join(BUNDLER)).filter(is_file));
    let (mut found, mut damaged) = (Vec::new(), Vec::new());
    for file in files {
        if let Some(format) = formats::detect(&file) {
            found.push(Source::Other(format, file));
        } else if let Some(format) = formats::by_name(&file) {
            let read = formats::read(format, &file, &|_| Some((1, 1)), &[], &mut Vec::new());
            damaged.extend(read.err());
        }
    }
    (found, damaged)
}

/// Whether a file is called like a part of a data set other than the one to train on, as
/// `transforms_test.json` beside `transforms_train.json`.
fn is_test_split(file: &Path) -> bool {
    let name = file.file_name().and_then(|name| name.to_str());
    let name = name.map(str::to_ascii_lowercase).unwrap_or_default();
    let part = name.strip_prefix("transforms_");
    let part = part.and_then(|part| part.strip_suffix(".json"));
    part.is_some_and(|part| part != "train")
}
