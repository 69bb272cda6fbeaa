//! Which files of a folder are OpenCV's calibrations, and which look like one.

use super::calibration::{calibration_and_beside, files, is_storage_name};
use super::storage::FileStorage;
use super::values::Values;
use super::{Keys, OpenCvError, matrix, poses};
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Larger files are something else.
const LARGEST: u64 = 64 << 20;

/// The calibrations in a folder.
#[derive(Debug, Default)]
pub struct FoundCalibrations {
    /// Files with cameras and poses, by name.
    pub usable: Vec<PathBuf>,
    /// What is wrong with those that look like a calibration and cannot be used, by name; last
    /// those that lack nothing but a name known here.
    pub unusable: Vec<OpenCvError>,
}

/// Looks for files with cameras, as `keys` choose them, and poses in a folder, not in those
/// within.
///
/// What looks like a calibration, too, is a file with cameras alone, one with poses alone, and
/// one that holds matrices the way OpenCV writes them, whole or damaged.
pub fn find_calibrations(folder: &Path, keys: &Keys) -> FoundCalibrations {
    let mut found = FoundCalibrations::default();
    for file in files(folder) {
        if !(is_storage_name(&file) && is_small(&file)) {
            continue;
        }
        // Read once: it may be another program's, with many thousands of poses.
        let (calibration, has_poses) = match FileStorage::read(&file) {
            Ok(storage) => {
                let calibration = calibration_and_beside(&file, &storage, keys);
                let has_poses = calibration.is_err() && holds_poses(&file, &storage);
                (calibration, has_poses)
            }
            Err(error) => (Err(error), false),
        };
        match calibration {
            Ok(calibration) if calibration.photo_poses().is_empty() => {
                found.unusable.push(OpenCvError::NoPoses { path: file });
            }
            Ok(_) => found.usable.push(file),
            Err(error) if has_poses || holds_matrices(&file) => found.unusable.push(error),
            Err(_) => {}
        }
    }
    let lacks_a_name = |error: &OpenCvError| {
        matches!(
            error,
            OpenCvError::NoCamera { .. } | OpenCvError::NoSuchKey { .. }
        )
    };
    found.unusable.sort_by_key(lacks_a_name);
    found
}

/// Whether a file may be meant for a calibration: by its name, and, as many programs write JSON for all kinds of
/// things, one of that also by what it holds.
pub fn may_be_calibration(file: &Path) -> bool {
    let extension = file.extension().unwrap_or_default();
    let looks_like_one = || {
        let is_one = |storage: FileStorage| {
            holds_poses(file, &storage)
                || calibration_and_beside(file, &storage, &Keys::default()).is_ok()
        };
        is_small(file) && (holds_matrices(file) || FileStorage::read(file).is_ok_and(is_one))
    };
    is_storage_name(file) && (!extension.eq_ignore_ascii_case("json") || looks_like_one())
}

fn is_small(file: &Path) -> bool {
    fs::metadata(file).is_ok_and(|m| m.len() <= LARGEST)
}

/// Whether a file has the mark of OpenCV's matrices, as far as it can be unpacked.
fn holds_matrices(file: &Path) -> bool {
    let Ok(packed) = fs::read(file) else {
        return false;
    };
    let mut unpacked = Vec::new();
    if packed.starts_with(&[0x1f, 0x8b]) {
        // What is read before an error stays, and a whole file was refused for what it holds.
        let reader = flate2::read::MultiGzDecoder::new(packed.as_slice());
        let _ = reader.take(LARGEST).read_to_end(&mut unpacked);
    } else {
        unpacked = packed;
    }
    let holds = |mark: &&str| {
        let mut places = unpacked.windows(mark.len());
        places.any(|bytes| bytes == mark.as_bytes())
    };
    matrix::TYPES.iter().any(holds)
}

/// Whether a file has the poses of views under a name known here.
fn holds_poses(file: &Path, storage: &FileStorage) -> bool {
    let poses = poses::of_views(&Values::of(file, storage));
    poses.is_ok_and(|poses| !poses.is_empty())
}
