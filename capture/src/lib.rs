//! Photo sets: finding, ordering, decoding and dating photos, and the masks, mattes and depth
//! maps beside them.
//!
//! A photo is its **stored pixel grid**: EXIF orientation is not applied, because
//! calibrations speak about the pixels as stored. The first pixel's centre is at
//! (0.5, 0.5), and reducing a photo keeps its corners where they are, so intrinsics
//! follow by the ratio of the sizes alone.

mod beside;
mod decode;
mod error;
mod jpeg;
mod photo_set;
mod resize;
mod times;
mod warp;
mod write;

pub use beside::{
    Beside, DepthMap, Matched, apply_matte, check_beside, decode_depth, decode_mask, match_by_name,
};
pub use decode::{decode, decode_reduced, photo_size};
pub use error::CaptureError;
pub use photo_set::{PhotoFile, PhotoSet, find_photos_folder};
pub use resize::{reduced_size, resize};
pub use times::{
    NameTime, TimeListError, Times, exif_time_s, from_earliest, number_in_name, read_times,
    time_in_name, times_of_names,
};
pub use warp::{Footprint, Kernel, warp};
pub use write::{copy_photo, write_mask, write_png};
