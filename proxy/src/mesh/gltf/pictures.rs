//! A glTF file's pictures, decoded.

use crate::mesh::{MeshFileError, Texture};
use image::{ImageReader, Limits, RgbaImage};
use rayon::prelude::*;
use std::io::Cursor;
use std::path::Path;

/// A picture of the file.
pub(super) struct Picture {
    /// Among the file's.
    pub(super) number: usize,
    /// PNG or JPEG, if it is to be read.
    pub(super) bytes: Vec<u8>,
}

/// What is had of one.
pub(super) struct Decoded {
    pub(super) texture: Texture,
    /// 0 to 1; nothing of it is more transparent.
    pub(super) least_alpha: f64,
    /// What people should know of it.
    pub(super) warning: Option<String>,
}

/// Bytes that a picture may take, decoded.
const MAX_PICTURE: u64 = 1 << 30;
/// Bytes that all of a model's may take.
const MAX_PICTURES: u64 = 4 << 30;

/// Decodes pictures on all threads; they come back in order. What cannot be decoded is white, with a warning.
///
/// # Errors
/// They take more memory together than they may.
pub(super) fn decode(path: &Path, pictures: &[Picture]) -> Result<Vec<Decoded>, MeshFileError> {
    let mut together = 0;
    for picture in pictures {
        together += decoded_size(&picture.bytes);
        if together > MAX_PICTURES {
            return Err(MeshFileError::Record {
                path: path.to_owned(),
                record: format!("image {}", picture.number),
                problem: format!(
                    "with those before it, it takes {} MiB of memory, more than {} MiB; make the \
                     model's pictures smaller",
                    together >> 20,
                    MAX_PICTURES >> 20
                ),
            });
        }
    }
    Ok(pictures.par_iter().map(decode_one).collect())
}

/// Bytes that a picture takes as RGBA, with the smaller ones of it, by what it says of itself; none where
/// it does not.
fn decoded_size(bytes: &[u8]) -> u64 {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let size = reader.ok().and_then(|r| r.into_dimensions().ok());
    size.map_or(0, |(width, height)| {
        16 * u64::from(width) * u64::from(height) / 3
    })
}

/// A picture; white, and a warning, where it cannot be had.
fn decode_one(picture: &Picture) -> Decoded {
    match pixels(&picture.bytes) {
        Ok(pixels) => {
            let least_alpha = pixels.pixels().map(|pixel| pixel.0[3]).min();
            Decoded {
                texture: Texture::new(pixels),
                least_alpha: f64::from(least_alpha.unwrap_or(255)) / 255.0,
                warning: None,
            }
        }
        Err(problem) => {
            let white = RgbaImage::from_pixel(1, 1, image::Rgba([255; 4]));
            let number = picture.number;
            Decoded {
                texture: Texture::new(white),
                least_alpha: 1.0,
                warning: Some(format!("image {number} {problem}: a plain colour instead")),
            }
        }
    }
}

/// A picture's pixels, or what is wrong with it: it is of a kind that is not read, or damaged.
fn pixels(bytes: &[u8]) -> Result<RgbaImage, String> {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let mut reader = reader.map_err(|error| format!("cannot be read ({error})"))?;
    let is_read = |f| matches!(f, image::ImageFormat::Png | image::ImageFormat::Jpeg);
    match reader.format() {
        Some(format) if is_read(format) => {}
        Some(format) => {
            return Err(format!(
                "is {format:?}, not PNG or JPEG (export the model again with those)"
            ));
        }
        None => return Err("is neither PNG nor JPEG".to_owned()),
    }
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_PICTURE);
    reader.limits(limits);
    match reader.decode() {
        Ok(decoded) => Ok(decoded.into_rgba8()),
        Err(error) => Err(format!("cannot be decoded ({error})")),
    }
}
