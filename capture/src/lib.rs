//! Photo sets: finding, ordering and decoding photos.
//!
//! A photo is its **stored pixel grid**: EXIF orientation is not applied, because
//! calibrations speak about the pixels as stored. The first pixel's centre is at
//! (0.5, 0.5), and reducing a photo keeps its corners where they are, so intrinsics
//! follow by the ratio of the sizes alone.

mod decode;
mod error;
mod jpeg;
mod photo_set;
mod resize;
mod write;

pub use decode::{content_size, decode, decode_content, decode_reduced, photo_size};
pub use error::CaptureError;
pub use photo_set::{PhotoFile, PhotoSet, find_photos_folder};
pub use resize::{reduced_size, resize};
pub use write::write_png;
