//! Calibrations that are neither COLMAP's nor OpenCV's.
//!
//! Each file here reads one format into a [`Reconstruction`](crate::Reconstruction) in our
//! conventions (camera x right, y down, z forward; the first pixel's centre at
//! (0.5, 0.5)), and its first lines say which conventions the format has. What a format
//! says and we cannot represent is an error, never an approximation.
//!
//! Every pose that comes back is a rotation, every number finite, every camera has a lens,
//! and no two images share a name. Matrices that are rotations to within 1e-4 become the
//! nearest rotation.

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

pub use build::SizeOf;
pub use bundler::read_bundler;
pub use detect::{Format, detect};
pub use error::FormatError;
pub use llff::read_llff;
pub use meshroom::read_meshroom;
pub use nvm::read_nvm;
pub use openmvg::read_openmvg;
pub use transforms::read_transforms;
