//! Photo sets: finding, ordering, decoding and dating photos, the masks, mattes and depth maps
//! beside them, and taking photos out of videos.
//!
//! A photo is its **stored pixel grid**: EXIF orientation is not applied, because
//! calibrations speak about the pixels as stored. The first pixel's centre is at
//! (0.5, 0.5), and reducing a photo keeps its corners where they are, so intrinsics
//! follow by the ratio of the sizes alone. Its colours are sRGB: those of another profile are
//! converted.

mod alike;
mod argument;
mod beside;
mod decode;
mod error;
mod exif;
pub mod folder;
pub mod hold;
mod jpeg;
mod photo_set;
mod profile;
mod resize;
mod sequence;
mod text;
mod times;
mod tool;
pub mod video;
mod warp;
mod write;

pub use alike::{name_key, stem_key};
pub use argument::as_argument;
pub use beside::{
    Beside, DepthMap, Matched, apply_matte, check_beside, decode_depth, decode_depth_steps,
    decode_mask, is_black_and_white, is_in_alpha, match_by_name, match_jpegs_by_name,
    match_others_by_name, take_usable_colors,
};
pub use decode::{content_size, decode, decode_content, decode_reduced, photo_size};
pub use error::CaptureError;
pub use exif::{Exif, quarters_of, read_exif};
pub use photo_set::{
    PhotoFile, PhotoSet, find_photos_folder, find_photos_within, has_photo_extension, unread_photos,
};
pub use resize::{reduced_size, resize, resize_mask, resize_used};
pub use sequence::is_sequence;
pub use text::{Lines, byte_lines, lines, without_byte_order_mark};
pub use times::{
    NameTime, TimeListError, Times, from_earliest, number_in_name, read_times, time_in_name,
    times_of_names,
};
pub use tool::{Tool, ToolError, fingerprint};
pub use warp::{Footprint, Kernel, warp, warp_depth_steps};
pub use write::{copy_photo, is_left_of, write_depth_steps, write_mask, write_png, write_whole};
