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

/// Decodes pictures on all threads; they come back in order.
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
    // All of them, so that the first that is corrupt is the one that is named.
    let decoded: Vec<Result<_, MeshFileError>> =
        pictures.par_iter().map(|p| decode_one(path, p)).collect();
    decoded.into_iter().collect()
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

/// A picture; white, and a warning, where it is of a kind that is not read.
fn decode_one(path: &Path, picture: &Picture) -> Result<Decoded, MeshFileError> {
    let record = format!("image {}", picture.number);
    let failed = |problem: String| MeshFileError::Record {
        path: path.to_owned(),
        record: record.clone(),
        problem,
    };
    let reader = ImageReader::new(Cursor::new(&picture.bytes)).with_guessed_format();
    let mut reader = reader.map_err(|e| failed(e.to_string()))?;
    let is_read = |f| matches!(f, image::ImageFormat::Png | image::ImageFormat::Jpeg);
    if !reader.format().is_some_and(is_read) {
        let white = RgbaImage::from_pixel(1, 1, image::Rgba([255; 4]));
        let warning = format!("{record} is neither PNG nor JPEG: a plain colour instead");
        return Ok(Decoded {
            texture: Texture::new(white),
            least_alpha: 1.0,
            warning: Some(warning),
        });
    }
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_PICTURE);
    reader.limits(limits);
    let decoded = reader.decode().map_err(|error| {
        failed(format!(
            "it cannot be decoded ({error}); export the model again"
        ))
    })?;
    let picture = decoded.into_rgba8();
    let least_alpha = picture.pixels().map(|pixel| pixel.0[3]).min();
    Ok(Decoded {
        texture: Texture::new(picture),
        least_alpha: f64::from(least_alpha.unwrap_or(255)) / 255.0,
        warning: None,
    })
}
