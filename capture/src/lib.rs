//! Photo sets: finding, ordering and decoding photos, and taking them out of videos.
//!
//! A photo is its **stored pixel grid**: EXIF orientation is not applied, because
//! calibrations speak about the pixels as stored. The first pixel's centre is at
//! (0.5, 0.5), and reducing a photo keeps its corners where they are, so intrinsics
//! follow by the ratio of the sizes alone.

mod decode;
mod error;
mod exif;
mod jpeg;
mod photo_set;
mod resize;
mod sequence;
mod tool;
pub mod video;
mod write;

pub use decode::{decode, decode_reduced, photo_size};
pub use error::CaptureError;
pub use exif::{Exif, read_exif};
pub use photo_set::{PhotoFile, PhotoSet, find_photos_folder};
pub use resize::{reduced_size, resize};
pub use sequence::is_sequence;
pub use tool::{Tool, ToolError, fingerprint};
pub use write::write_png;
