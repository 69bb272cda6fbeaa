use crate::CaptureError;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{
    EncodableLayout, GrayImage, ImageBuffer, Luma, PixelWithColorType, Primitive, RgbaImage,
};
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Writes a picture as an RGBA PNG, in folders that are made where they are missing. The
/// same picture gives the same bytes. The file is written under a temporary name beside
/// its own and renamed once it is complete.
///
/// # Errors
/// A file or folder that cannot be written.
pub fn write_png(path: &Path, image: &RgbaImage) -> Result<(), CaptureError> {
    write(path, |temporary| encode(temporary, image))
}

/// [`write_png`] for a mask, which has one channel.
///
/// # Errors
/// As [`write_png`].
pub fn write_mask(path: &Path, mask: &GrayImage) -> Result<(), CaptureError> {
    write(path, |temporary| encode(temporary, mask))
}

/// [`write_png`] for a depth map's steps, which have 16 bits.
///
/// # Errors
/// As [`write_png`].
pub fn write_depth_steps(
    path: &Path,
    steps: &ImageBuffer<Luma<u16>, Vec<u16>>,
) -> Result<(), CaptureError> {
    write(path, |temporary| encode(temporary, steps))
}

/// Copies a file as it is, in the way of [`write_png`].
///
/// # Errors
/// A file that cannot be read or written.
pub fn copy_photo(from: &Path, to: &Path) -> Result<(), CaptureError> {
    write(to, |temporary| fs::copy(from, temporary).map(|_| ()))
}

/// Fills a file under a temporary name and renames it.
fn write(path: &Path, fill: impl FnOnce(&Path) -> io::Result<()>) -> Result<(), CaptureError> {
    let failed = |source| CaptureError::Write {
        path: path.to_owned(),
        source,
    };
    let name = path.file_name().ok_or_else(|| {
        failed(io::Error::new(
            io::ErrorKind::InvalidInput,
            "the path does not end in a file's name",
        ))
    })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    if !folder.as_os_str().is_empty() {
        fs::create_dir_all(folder).map_err(failed)?;
    }
    let temporary = folder.join(format!(
        ".{}.{}.tmp",
        name.to_string_lossy(),
        std::process::id()
    ));
    let written = fill(&temporary).and_then(|()| fs::rename(&temporary, path));
    written.map_err(|source| {
        // The error at hand is the one to report.
        let _ = fs::remove_file(&temporary);
        failed(source)
    })
}

fn encode<S: Primitive, P: PixelWithColorType<Subpixel = S>>(
    path: &Path,
    picture: &ImageBuffer<P, Vec<S>>,
) -> io::Result<()>
where
    [S]: EncodableLayout,
{
    let mut out = BufWriter::new(File::create(path)?);
    let encoder =
        PngEncoder::new_with_quality(&mut out, CompressionType::Fast, FilterType::Adaptive);
    picture
        .write_with_encoder(encoder)
        .map_err(|error| match error {
            image::ImageError::IoError(error) => error,
            other => io::Error::other(other),
        })?;
    out.flush()
}
