//! Calibrations for other programs, as text; COLMAP's own writers are in
//! [`colmap`](crate::colmap).
//!
//! What a format cannot express is an error that says which camera it is and what to do,
//! never an approximation. Numbers are written with as many digits as make them read back
//! to the last bit.

mod error;
mod lens;
mod opencv;
mod transforms;

pub use error::ExportError;
pub use lens::{check_colmap, check_colmap_text};
pub use opencv::{has_board, opencv_yaml};
pub use transforms::{FrameFiles, transforms_json};
