use super::{ColmapError, Format, Incomplete, binary, run, text};
use std::fs::{self, File};
use std::io::Read;
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
/// No such folder, or no model in any of those places.
pub fn find_model(folder: &Path) -> Result<PathBuf, ColmapError> {
    if !folder.is_dir() {
        return Err(ColmapError::NoFolder {
            folder: folder.to_owned(),
        });
    }
    let places = places(folder);
    let found = places.iter().find_map(|together| largest(together));
    found.ok_or_else(|| no_model(folder, &places.concat()))
}

/// Where a capture's model may be, in order; of several places together the largest is taken.
fn places(folder: &Path) -> Vec<Vec<PathBuf>> {
    let dense = folder.join("dense");
    let colmap = folder.join("colmap");
    let or_first = |models: Vec<PathBuf>, first: PathBuf| match models {
        models if models.is_empty() => vec![first],
        models => models,
    };
    let models = |within: &Path| or_first(numbered(within), within.join("0"));
    let undistorted_models =
        |within: &Path| or_first(undistorted(within), within.join("0").join("sparse"));
    let mut places = vec![
        models(&folder.join("sparse")),
        vec![folder.join("sparse")],
        vec![dense.join("sparse")],
        undistorted_models(&dense),
        vec![folder.join("model")],
        vec![folder.to_owned()],
        models(folder),
    ];
    // In any other folder numbered ones may be captures that have nothing to do with each other.
    if std::path::absolute(folder).is_ok_and(|folder| folder.ends_with("dense")) {
        places.push(undistorted_models(folder));
    }
    if !run::is_work(&colmap) {
        let sparse = colmap.join("sparse");
        places.extend([models(&sparse), vec![sparse]]);
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
    let complete = |mut models: Vec<PathBuf>| {
        models.retain(|place| format_in(place).is_some());
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
    let counts = numbered(folder).into_iter();
    let counts = counts.filter_map(|model| count_images(&model));
    counts.max().unwrap_or(0) as usize
}

/// The folders within one that are called by numbers, in the order of these.
fn numbered(folder: &Path) -> Vec<PathBuf> {
    let number = |path: PathBuf| {
        let name = path.file_name()?.to_str()?;
        // Signs are part of numbers, too.
        let is_plain = name.bytes().all(|byte| byte.is_ascii_digit());
        let number: u32 = name.parse().ok().filter(|_| is_plain)?;
        path.is_dir().then_some((number, path))
    };
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut found: Vec<_> = entries.filter_map(|e| number(e.path())).collect();
    found.sort();
    found.into_iter().map(|(_, path)| path).collect()
}

/// Where COLMAP's reconstructor leaves the models of photos that it undistorted, of each model's
/// in a numbered folder.
fn undistorted(folder: &Path) -> Vec<PathBuf> {
    let numbered = numbered(folder).into_iter();
    numbered.map(|folder| folder.join("sparse")).collect()
}

/// Of these places that with the model of the most images, of equals the first.
fn largest(together: &[PathBuf]) -> Option<PathBuf> {
    let is_model = |place: &&PathBuf| format_in(place).is_some();
    let found: Vec<&PathBuf> = together.iter().filter(is_model).collect();
    // One alone need not be read.
    if let [only] = found[..] {
        return Some(only.clone());
    }
    // The last of equals is taken.
    let largest = found
        .into_iter()
        .rev()
        .max_by_key(|model| count_images(model));
    largest.cloned()
}

/// How many images the model in a folder has, from as little of it as tells.
fn count_images(folder: &Path) -> Option<u64> {
    let format = format_in(folder)?;
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
pub(super) fn format_in(folder: &Path) -> Option<Format> {
    [Format::Binary, Format::Text]
        .into_iter()
        .find(|format| format.files(folder).iter().all(|file| file.is_file()))
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
