use super::{ColmapError, Format, Incomplete};
use std::path::{Path, PathBuf};

/// The folder that holds a capture's COLMAP model: the first of `sparse/0`, `sparse`,
/// `dense/sparse`, `model`, `folder` itself and its `0` with all three files, binary or text.
///
/// # Errors
/// No such folder, or no model in any of those places.
pub fn find_model(folder: &Path) -> Result<PathBuf, ColmapError> {
    if !folder.is_dir() {
        return Err(ColmapError::NoFolder {
            folder: folder.to_owned(),
        });
    }
    let places = [
        folder.join("sparse").join("0"),
        folder.join("sparse"),
        folder.join("dense").join("sparse"),
        folder.join("model"),
        folder.to_owned(),
        folder.join("0"),
    ];
    places
        .iter()
        .find(|place| format_in(place).is_some())
        .cloned()
        .ok_or_else(|| no_model(folder, &places))
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
