//! Finding a capture's calibration and reading it, whichever program made it.

use super::{ImportOptions, SceneError, Warning};
use calibrate::formats::{self, Format};
use calibrate::opencv::{self, Keys, OpenCvCalibration};
use calibrate::{Reconstruction, colmap, colmap::ColmapError};
use capture::{PhotoFile, PhotoSet, find_photos_folder, photo_size};
use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
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
    /// For messages.
    pub(super) fn text(&self) -> String {
        match self {
            Self::Colmap(model) => format!("the COLMAP model in {}", model.display()),
            Self::OpenCv(file) | Self::Other(_, file) => file.display().to_string(),
        }
    }
}

/// The calibration of a capture: the file or folder given, else what the capture's folder
/// holds. A COLMAP model comes before an OpenCV file; what is passed over is noted.
pub(super) fn find(
    capture: &Path,
    options: &ImportOptions,
    warnings: &mut Vec<Warning>,
) -> Result<Source, SceneError> {
    let source = search(capture, options, warnings)?;
    warnings.extend(unused_keys(&options.keys, &source));
    Ok(source)
}

/// What to say of options for OpenCV's files that were given with another calibration, if any.
fn unused_keys(keys: &Keys, source: &Source) -> Option<Warning> {
    if matches!(source, Source::OpenCv(_)) {
        return None;
    }
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
    Some(Warning::Note(format!(
        "{} {change} nothing: the calibration is {}, none of OpenCV's",
        given.join(" and "),
        source.text()
    )))
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
        return Ok(match formats::detect(file) {
            _ if is_colmap => Source::Colmap(folder.to_owned()),
            Some(format) => Source::Other(format, file.to_owned()),
            None => Source::OpenCv(file.to_owned()),
        });
    }
    let folder = given.unwrap_or(capture);
    let model = colmap::find_model(folder);
    let model_found = model.as_ref().ok().cloned().map(Source::Colmap);
    let opencv_found = opencv::find_calibrations(folder)
        .into_iter()
        .map(Source::OpenCv);
    let mut found = model_found
        .into_iter()
        .chain(opencv_found)
        .chain(others(folder));
    let source = match (found.next(), model) {
        (Some(source), _) => source,
        (None, Err(source)) if given.is_none() && is_nothing_there(&source) => {
            return Err(SceneError::Uncalibrated {
                folder: folder.to_owned(),
                source,
            });
        }
        (None, Err(error)) => return Err(error.into()),
        (None, Ok(model)) => Source::Colmap(model),
    };
    if let Some(Source::OpenCv(other) | Source::Other(_, other)) = found.next() {
        warnings.push(Warning::Note(format!(
            "the calibration is {}; for that in {} say --calibration {1}",
            source.text(),
            other.display()
        )));
    }
    Ok(source)
}

/// Whether not even a part of a model was found.
fn is_nothing_there(error: &ColmapError) -> bool {
    matches!(error, ColmapError::NoModel { incomplete, .. } if incomplete.is_empty())
}

/// The other programs' calibrations in a folder, by name.
fn others(folder: &Path) -> impl Iterator<Item = Source> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|e| e.path()).filter(|p| p.is_file()).collect();
    files.sort();
    files
        .into_iter()
        .filter_map(|file| Some(Source::Other(formats::detect(&file)?, file)))
}

/// Reads another program's calibration. Its photos are found by the ends of their paths.
pub(super) fn read_other(
    format: Format,
    path: &Path,
    photos: &PhotoSet,
) -> Result<Reconstruction, SceneError> {
    let size_of = |listed: &str| {
        let photo = photos.find(&photo_of(listed, photos))?;
        photo_size(&photo.path).ok()
    };
    let names: Vec<String> = photos.photos.iter().map(|p| p.name.clone()).collect();
    let mut whole = formats::read(format, path, &size_of, &names)?;
    let mut named = BTreeSet::new();
    for image in whole.images.values_mut() {
        image.name = photo_of(&image.name, photos);
        if !named.insert(image.name.clone()) {
            return Err(SceneError::Poses {
                path: path.to_owned(),
                problem: format!(
                    "two poses whose paths both end in that of the photo {}",
                    image.name
                ),
            });
        }
    }
    Ok(whole)
}

/// Whether the cameras' image sizes are those of the photos.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sizes {
    /// As the file or the photos say.
    Known,
    /// Nobody says: they are 1 × 1, and lengths that depend on them in parts of it.
    Unknown,
}

/// Reads another program's calibration without a capture around it. Photos are looked for
/// beside it, only for their sizes and names.
///
/// # Errors
/// As [`calibrate::formats::read`].
pub fn read_bare(format: Format, path: &Path) -> Result<(Reconstruction, Sizes), SceneError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let photos = find_photos_folder(folder).and_then(|photos| PhotoSet::open(&photos).ok());
    let sizes = Cell::new(Sizes::Known);
    let size_of = |listed: &str| {
        let size = photos.as_ref().and_then(|photos| {
            let photo = photos.find(&photo_of(listed, photos))?;
            photo_size(&photo.path).ok()
        });
        // LLFF's file has a size of its own.
        if size.is_none() && format != Format::Llff {
            sizes.set(Sizes::Unknown);
            return Some((1, 1));
        }
        size
    };
    let whole = formats::read(format, path, &size_of, &[])?;
    Ok((whole, sizes.get()))
}

/// The nearest and farthest depth that LLFF's file says of each photo.
pub(super) fn depth_bounds(
    path: &Path,
    photos: &PhotoSet,
) -> Result<BTreeMap<String, [f64; 2]>, SceneError> {
    // A row a photo, in the order of their names.
    let names = photos.photos.iter().map(|photo| photo.name.clone());
    Ok(names.zip(formats::read_llff_bounds(path)?).collect())
}

/// Reads an OpenCV calibration and finds which of the photos each pose is of.
pub(super) fn read_opencv(
    path: &Path,
    options: &ImportOptions,
    photos: &PhotoSet,
    warnings: &mut Vec<Warning>,
) -> Result<Reconstruction, SceneError> {
    let calibration = opencv::read_calibration(path, &options.keys)?;
    let refuse = |problem: String| SceneError::Poses {
        path: path.to_owned(),
        problem,
    };
    let notes = calibration.notes.iter().cloned();
    warnings.extend(notes.map(Warning::Note));

    // 1. One pose a photo.
    let count = calibration.photo_poses().len();
    if count == 0 {
        return Err(refuse(
            "cameras, but no poses; expected extrinsic_parameters, rvecs and tvecs, or the R and \
             T of two cameras; have OpenCV write the extrinsic parameters, or give a COLMAP model"
                .to_owned(),
        ));
    }
    if calibration.cameras.len() > 1 && !calibration.poses.is_empty() {
        let names: Vec<&str> = calibration
            .cameras
            .iter()
            .map(|c| c.name.as_str())
            .collect();
        return Err(refuse(format!(
            "the poses of one camera, but {} cameras ({}); choose with --camera-matrix KEY",
            names.len(),
            names.join(", ")
        )));
    }

    // 2. Their photos.
    let names = photo_names(&calibration, count, path, photos, warnings).map_err(refuse)?;
    let named: BTreeSet<&String> = names.iter().collect();
    if named.len() < names.len() {
        let twice = names
            .iter()
            .enumerate()
            .find(|(i, name)| names[..*i].contains(name));
        let twice = twice.map_or("", |(_, name)| name);
        return Err(refuse(format!(
            "poses, but the list of photos names {twice} twice; expected a photo for each of {count} poses"
        )));
    }

    // 3. Where the file does not say, the image size is the photos'.
    let known = names.iter().find_map(|name| photos.find(name));
    let size = match known {
        Some(photo) if calibration.cameras.iter().any(|c| c.size.is_none()) => {
            photo_size(&photo.path)?
        }
        _ => (1, 1),
    };
    let whole = calibration.reconstruction(&names, size);
    for (id, camera) in &whole.cameras {
        camera.lens().map_err(|source| SceneError::Camera {
            name: format!("{}, camera {}", path.display(), id.0),
            source,
        })?;
    }
    Ok(whole)
}

/// The photo of each pose: by the list that came with the calibration, else in the order
/// of their names; or what is wrong.
fn photo_names(
    calibration: &OpenCvCalibration,
    count: usize,
    path: &Path,
    photos: &PhotoSet,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<String>, String> {
    if calibration.image_names.len() == count {
        let names = calibration.image_names.iter();
        return Ok(names.map(|listed| photo_of(listed, photos)).collect());
    }
    if photos.photos.len() != count {
        return Err(format!(
            "{count} poses, but {} has {} photos, and no list says which are meant; put the list \
             that OpenCV calibrated from beside it as images.yml, or give a folder with only the \
             calibrated photos",
            photos.root.display(),
            photos.photos.len()
        ));
    }
    warnings.push(Warning::Note(format!(
        "the {count} poses in {} are taken to be of the photos in the order of their names; if \
         that is wrong, put the list of photos beside it as images.yml",
        path.display()
    )));
    Ok(photos
        .photos
        .iter()
        .map(|photo| photo.name.clone())
        .collect())
}

/// The photo that a list calls by a path of whoever calibrated: the one whose name, with
/// or without its extension, is the longest end of that path. Where there is none, the
/// path's own end.
fn photo_of(listed: &str, photos: &PhotoSet) -> String {
    let listed = listed.replace('\\', "/");
    let mut rest = listed.as_str();
    loop {
        let stem_is = |photo: &&PhotoFile| {
            let stem = photo.name.rsplit_once('.').map_or("", |(stem, _)| stem);
            stem == rest
        };
        if let Some(photo) = photos
            .find(rest)
            .or_else(|| photos.photos.iter().find(stem_is))
        {
            return photo.name.clone();
        }
        match rest.split_once('/') {
            Some((_, shorter)) => rest = shorter,
            None => return rest.to_owned(),
        }
    }
}
