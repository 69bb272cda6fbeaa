//! Calibrations that are neither COLMAP's nor OpenCV's.
//!
//! Each file here reads one format into a [`Reconstruction`] in our
//! conventions (camera x right, y down, z forward; the first pixel's centre at
//! (0.5, 0.5)), and its first lines say which conventions the format has. What a format
//! says and we cannot represent is an error, never an approximation.
//!
//! Every pose that comes back is a rotation, every number finite, every camera has a lens,
//! and no two images share a name. Matrices that are rotations to within 1e-4 become the
//! nearest rotation.

mod beside;
mod build;
mod bundler;
mod detect;
mod error;
mod json;
mod llff;
mod meshroom;
mod nvm;
mod openmvg;
mod transforms;
mod words;

pub use beside::{FilesBeside, parse_files_beside, read_files_beside};
pub use build::SizeOf;
pub use bundler::{parse_bundler, read_bundler};
pub use detect::{Format, by_name, detect, detect_content, meant};
pub use error::FormatError;
pub use json::{WITHOUT_NUMBER, no_number};
pub use llff::{parse_llff, read_llff, read_llff_bounds};
pub use meshroom::{parse_meshroom, read_meshroom};
pub use nvm::{parse_nvm, read_nvm};
pub use openmvg::{parse_openmvg, read_openmvg};
pub use transforms::{parse_transforms, read_transforms};

use crate::Reconstruction;
use std::path::Path;

/// Reads a calibration of a known format. `size_of` gives the size in pixels of the photo
/// that a name in the file stands for, where the format leaves it to the photos;
/// `photo_names` are the photos in their order, for a format that names none. What had to be
/// guessed is added to `notes`, for people.
///
/// # Errors
/// As the format's own reader.
pub fn read(
    format: Format,
    path: &Path,
    size_of: SizeOf<'_>,
    photo_names: &[String],
    notes: &mut Vec<String>,
) -> Result<Reconstruction, FormatError> {
    match format {
        Format::Transforms => read_transforms(path, size_of),
        Format::Bundler => read_bundler(path, size_of),
        Format::Nvm => read_nvm(path, size_of, notes),
        Format::Llff => read_llff(path, photo_names, size_of),
        Format::Meshroom => read_meshroom(path),
        Format::OpenMvg => read_openmvg(path),
    }
}
