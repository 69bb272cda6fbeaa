use super::{ColmapError, Format, Incomplete, binary, run, text};
use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};

/// One of several models side by side: COLMAP makes them of photos that it cannot join.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SubModel {
    /// Its folder.
    pub folder: PathBuf,
    /// How many images it has; `None` where the file with them is damaged.
    pub images: Option<u64>,
}

/// The folder that holds a capture's COLMAP model: the first of `sparse/0`, `sparse`,
/// `dense/sparse`, `dense/0/sparse`, `model`, `folder` itself, its `0`, `colmap/sparse/0` and
/// `colmap/sparse` with all three files, binary or text. Where `folder` is such a `dense`, its
/// `0/sparse` comes after its `0`. A `colmap` that [`run`](super::run::run) works in is passed
/// over: it may not be finished there.
///
/// Where beside `0` there are further models (`1`, `2`, …), the one with the most images is
/// taken, of equals the first; see [`side_by_side`].
///
/// # Errors
/// No such folder, or no model in any of those places; one of them, before any model or beside it, cannot be
/// looked into.
pub fn find_model(folder: &Path) -> Result<PathBuf, ColmapError> {
    if !is_there(folder, Metadata::is_dir)? {
        return Err(ColmapError::NoFolder {
            folder: folder.to_owned(),
        });
    }
    let mut looked_in = Vec::new();
    for Together { places, are_all } in places(folder) {
        if let Some(model) = largest(&places)? {
            return Ok(model);
        }
        are_all?;
        looked_in.extend(places);
    }
    Err(no_model(folder, &looked_in))
}

/// Of each of the places where [`find_model`] looks the largest model, in its order, each once: the first is that which it
/// takes. Places that cannot be looked into have none.
pub fn find_models(folder: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = Vec::new();
    let mut known = Vec::new();
    for Together { places, .. } in places(folder) {
        let Ok(Some(model)) = largest(&places) else {
            continue;
        };
        // Links may lead to one that is there already.
        let is = fs::canonicalize(&model).unwrap_or_else(|_| model.clone());
        if !known.contains(&is) {
            known.push(is);
            found.push(model);
        }
    }
    found
}

/// Places of which that with the largest model is taken.
struct Together {
    places: Vec<PathBuf>,
    /// Why there may be others, if it cannot be known.
    are_all: Result<(), ColmapError>,
}

impl Together {
    fn one(place: PathBuf) -> Self {
        Self {
            places: vec![place],
            are_all: Ok(()),
        }
    }

    /// Those that were found, or where there are none the usual one.
    fn or_usual(found: Result<Vec<PathBuf>, ColmapError>, usual: PathBuf) -> Self {
        match found {
            Ok(places) if !places.is_empty() => Self {
                places,
                are_all: Ok(()),
            },
            found => Self {
                places: vec![usual],
                are_all: found.map(|_| ()),
            },
        }
    }
}

/// Where a capture's model may be, in order.
fn places(folder: &Path) -> Vec<Together> {
    let dense = folder.join("dense");
    let colmap = folder.join("colmap");
    let models = |within: &Path| Together::or_usual(numbered(within), within.join("0"));
    let undistorted_models = |within: &Path| {
        let usual = within.join("0").join("sparse");
        Together::or_usual(undistorted(within), usual)
    };
    let mut places = vec![
        models(&folder.join("sparse")),
        Together::one(folder.join("sparse")),
        Together::one(dense.join("sparse")),
        undistorted_models(&dense),
        Together::one(folder.join("model")),
        Together::one(folder.to_owned()),
        models(folder),
    ];
    // In any other folder numbered ones may be captures that have nothing to do with each other.
    if std::path::absolute(folder).is_ok_and(|folder| folder.ends_with("dense")) {
        places.push(undistorted_models(folder));
    }
    if !run::is_work(&colmap) {
        let sparse = colmap.join("sparse");
        places.extend([models(&sparse), Together::one(sparse)]);
    }
    places
}

/// The models in the numbered folders of which `model` is in one, or is one, by their numbers,
/// itself among them; none where `model` is in no such folder.
pub fn side_by_side(model: &Path) -> Vec<SubModel> {
    let above = model.parent();
    let families = [
        above.map(numbered),
        above.and_then(Path::parent).map(undistorted),
    ];
    // Those that cannot be looked into are told where one is chosen.
    let complete = |models: Result<Vec<PathBuf>, ColmapError>| {
        let mut models = models.unwrap_or_default();
        models.retain(|place| matches!(format_in(place), Ok(Some(_))));
        models
    };
    let mut families = families.into_iter().flatten().map(complete);
    let all = families.find(|all| all.iter().any(|other| other == model));
    let counted = |folder: PathBuf| SubModel {
        images: count_images(&folder),
        folder,
    };
    all.into_iter().flatten().map(counted).collect()
}

/// How many images the largest has of the models in the numbered folders within one, as far as their files tell.
pub(super) fn most_images(folder: &Path) -> usize {
    let counts = numbered(folder).unwrap_or_default().into_iter();
    let counts = counts.filter_map(|model| count_images(&model));
    counts.max().unwrap_or(0) as usize
}

/// The folders within one that are called by numbers, in the order of these, and what else of such a name may be one.
fn numbered(folder: &Path) -> Result<Vec<PathBuf>, ColmapError> {
    let number = |path: &Path| -> Option<u32> {
        let name = path.file_name()?.to_str()?;
        // Signs are part of numbers, too.
        let is_plain = name.bytes().all(|byte| byte.is_ascii_digit());
        name.parse().ok().filter(|_| is_plain)
    };
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) => return nothing_at(folder, error).map(|()| Vec::new()),
    };
    let mut found = Vec::new();
    for entry in entries {
        let path = entry.map_err(|source| closed(folder, source))?.path();
        if let Some(number) = number(&path)
            && fs::metadata(&path).map_or(true, |entry| entry.is_dir())
        {
            found.push((number, path));
        }
    }
    found.sort();
    Ok(found.into_iter().map(|(_, path)| path).collect())
}

/// Where COLMAP's reconstructor leaves the models of photos that it undistorted, of each model's
/// in a numbered folder.
fn undistorted(folder: &Path) -> Result<Vec<PathBuf>, ColmapError> {
    let numbered = numbered(folder)?.into_iter();
    Ok(numbered.map(|folder| folder.join("sparse")).collect())
}

/// Of these places that with the model of the most images, of equals the first.
fn largest(together: &[PathBuf]) -> Result<Option<PathBuf>, ColmapError> {
    let mut found = Vec::new();
    for place in together {
        if format_in(place)?.is_some() {
            found.push(place);
        }
    }
    // One alone need not be read.
    if let [only] = found[..] {
        return Ok(Some(only.clone()));
    }
    // The last of equals is taken.
    let largest = found
        .into_iter()
        .rev()
        .max_by_key(|model| count_images(model));
    Ok(largest.cloned())
}

/// How many images the model in a folder has, from as little of it as tells.
fn count_images(folder: &Path) -> Option<u64> {
    let format = format_in(folder).ok()??;
    let [_, images, _] = format.files(folder);
    if format == Format::Text {
        return text::count_images(&images, &fs::read(&images).ok()?);
    }
    let mut file = File::open(images).ok()?;
    let mut count = [0; 8];
    file.read_exact(&mut count).ok()?;
    let count = u64::from_le_bytes(count);
    let room = file.metadata().ok()?.len() / binary::IMAGE_BYTES as u64;
    (count <= room).then_some(count)
}

/// The format of the complete model in a folder; binary where both are.
///
/// # Errors
/// Whether one is there cannot be known.
pub(super) fn format_in(folder: &Path) -> Result<Option<Format>, ColmapError> {
    if !is_there(folder, Metadata::is_dir)? {
        return Ok(None);
    }
    for format in [Format::Binary, Format::Text] {
        let mut are_there = true;
        for file in format.files(folder) {
            are_there &= is_there(&file, Metadata::is_file)?;
        }
        if are_there {
            return Ok(Some(format));
        }
    }
    Ok(None)
}

/// Whether there is a file or a folder, as `is_kind` asks for.
///
/// # Errors
/// It cannot be known, or a link there leads nowhere.
fn is_there(path: &Path, is_kind: fn(&Metadata) -> bool) -> Result<bool, ColmapError> {
    match fs::metadata(path) {
        Ok(found) => Ok(is_kind(&found)),
        Err(error) => nothing_at(path, error).map(|()| false),
    }
}

/// What it means that a path cannot be examined.
///
/// # Errors
/// It does not mean that nothing is there: a disk may not be mounted that a link leads to, or a folder may not be
/// searched by whoever asks.
fn nothing_at(path: &Path, error: io::Error) -> Result<(), ColmapError> {
    let leads_nowhere = |path: &&Path| path.is_symlink() && !path.exists();
    match error.kind() {
        ErrorKind::NotADirectory => Ok(()),
        // The folder that it would lie in may be such a link, too.
        ErrorKind::NotFound => match path.ancestors().take(2).find(leads_nowhere) {
            None => Ok(()),
            Some(link) => {
                let to = fs::read_link(link).unwrap_or_default();
                let text = format!("it is a link to {}, which is not there", to.display());
                Err(closed(link, io::Error::new(ErrorKind::NotFound, text)))
            }
        },
        _ => Err(closed(path, error)),
    }
}

fn closed(path: &Path, source: io::Error) -> ColmapError {
    ColmapError::Closed {
        path: path.to_owned(),
        source,
    }
}

/// The error that no model is in any of `places`, saying which come close.
pub(super) fn no_model(folder: &Path, places: &[impl AsRef<Path>]) -> ColmapError {
    let mut incomplete = Vec::new();
    for place in places {
        let place = place.as_ref();
        for format in [Format::Binary, Format::Text] {
            let missing: Vec<_> = format
                .files(place)
                .iter()
                .filter(|file| !file.is_file())
                .filter_map(|file| Some(file.file_name()?.to_string_lossy().into_owned()))
                .collect();
            if missing.len() < 3 {
                incomplete.push(Incomplete {
                    folder: place.to_owned(),
                    missing,
                });
            }
        }
    }
    ColmapError::NoModel {
        folder: folder.to_owned(),
        looked_in: places.iter().map(|p| p.as_ref().to_owned()).collect(),
        incomplete,
    }
}
