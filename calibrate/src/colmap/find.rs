use super::{ColmapError, Format, Incomplete, binary, text};
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
/// `dense/sparse`, `model`, `folder` itself and its `0` with all three files, binary or text.
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
    let sparse = folder.join("sparse");
    let places = [
        sparse.clone(),
        folder.join("dense").join("sparse"),
        folder.join("model"),
        folder.to_owned(),
    ];
    let found = largest(&sparse)
        .or_else(|| {
            let is_model = |place: &&PathBuf| format_in(place).is_some();
            places.iter().find(is_model).cloned()
        })
        .or_else(|| largest(folder));
    found.ok_or_else(|| {
        let [first, last] = [sparse.as_path(), folder].map(|within| match numbered(within) {
            models if models.is_empty() => vec![within.join("0")],
            models => models,
        });
        no_model(folder, &[first, places.to_vec(), last].concat())
    })
}

/// The models in the numbered folders of which `model` is one, by their numbers, itself among
/// them; none where `model` is in no such folder.
pub fn side_by_side(model: &Path) -> Vec<SubModel> {
    let all = model.parent().map(complete).unwrap_or_default();
    if !all.iter().any(|other| other == model) {
        return Vec::new();
    }
    let counted = |folder: PathBuf| SubModel {
        images: count_images(&folder),
        folder,
    };
    all.into_iter().map(counted).collect()
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

/// Those that hold a complete model.
fn complete(folder: &Path) -> Vec<PathBuf> {
    let mut found = numbered(folder);
    found.retain(|place| format_in(place).is_some());
    found
}

/// The one of them with the most images, of equals the first.
fn largest(folder: &Path) -> Option<PathBuf> {
    let found = complete(folder);
    // One alone need not be read.
    if let [only] = found.as_slice() {
        return Some(only.clone());
    }
    // The last of equals is taken.
    found
        .into_iter()
        .rev()
        .max_by_key(|model| count_images(model))
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
