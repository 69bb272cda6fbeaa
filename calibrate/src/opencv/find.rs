//! Which files of a folder are OpenCV's calibrations, and which look like one.

use super::calibration::{calibration, calibration_and_beside, files, is_storage_name};
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
            Err(error) if has_poses || is_read_so(&file, holds_matrices) => {
                found.unusable.push(error)
            }
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
    let is_json = extension.eq_ignore_ascii_case("json");
    is_storage_name(file) && (!is_json || is_small(file) && is_read_so(file, is_calibration))
}

/// Whether a file's content looks like a calibration of OpenCV's, whatever its name: it holds cameras or poses under
/// names known here, or matrices the way OpenCV writes them, whole or damaged.
pub fn is_calibration(content: &[u8]) -> bool {
    // Named in errors alone.
    let file = Path::new("");
    let is_one = |storage: FileStorage| {
        holds_poses(file, &storage) || calibration(file, &storage, &Keys::default()).is_ok()
    };
    content.len() as u64 <= LARGEST
        && (holds_matrices(content) || FileStorage::parse(file, content).is_ok_and(is_one))
}

/// Whether a file can be read, and what is in it is so.
fn is_read_so(file: &Path, is_so: fn(&[u8]) -> bool) -> bool {
    fs::read(file).is_ok_and(|content| is_so(&content))
}

fn is_small(file: &Path) -> bool {
    fs::metadata(file).is_ok_and(|m| m.len() <= LARGEST)
}

/// Whether a file's content has the mark of OpenCV's matrices, as far as it can be unpacked.
fn holds_matrices(content: &[u8]) -> bool {
    let mut unpacked = Vec::new();
    let text = if content.starts_with(&[0x1f, 0x8b]) {
        // What is read before an error stays, and a whole file was refused for what it holds.
        let reader = flate2::read::MultiGzDecoder::new(content);
        let _ = reader.take(LARGEST).read_to_end(&mut unpacked);
        unpacked.as_slice()
    } else {
        content
    };
    let holds = |mark: &&str| {
        let mut places = text.windows(mark.len());
        places.any(|bytes| bytes == mark.as_bytes())
    };
    matrix::TYPES.iter().any(holds)
}

/// Whether a file has the poses of views under a name known here.
fn holds_poses(file: &Path, storage: &FileStorage) -> bool {
    let poses = poses::of_views(&Values::of(file, storage));
    poses.is_ok_and(|poses| !poses.is_empty())
}
