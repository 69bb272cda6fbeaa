use crate::CaptureError;
use crate::folder::beside;
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

/// Has a file filled under a temporary name beside its own, and renames it: it appears complete
/// or not at all, and no other file is touched.
///
/// # Errors
/// A path that does not end in a file's name; what `fill` fails with; a file that cannot be
/// renamed.
pub fn write_whole(path: &Path, fill: impl FnOnce(&Path) -> io::Result<()>) -> io::Result<()> {
    if path.file_name().is_none() {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "the path does not end in a file's name",
        ));
    }
    let temporary = beside(path, &format!("{}.tmp", std::process::id()));
    let written = fill(&temporary).and_then(|()| fs::rename(&temporary, path));
    if written.is_err() {
        // The error at hand is the one to report.
        let _ = fs::remove_file(&temporary);
    }
    written
}

/// Whether a file of this name is what [`write_whole`] leaves beside that called `whole` if it is killed.
pub fn is_left_of(name: &str, whole: &str) -> bool {
    let number = name.strip_prefix('.').and_then(|rest| {
        rest.strip_prefix(whole)?
            .strip_prefix('.')?
            .strip_suffix(".tmp")
    });
    number.is_some_and(|number| number.parse::<u32>().is_ok())
}

/// [`write_whole`] in folders that are made where they are missing.
fn write(path: &Path, fill: impl FnOnce(&Path) -> io::Result<()>) -> Result<(), CaptureError> {
    let written = write_whole(path, |temporary| {
        let folder = path.parent().unwrap_or(Path::new(""));
        if !folder.as_os_str().is_empty() {
            fs::create_dir_all(folder)?;
        }
        fill(temporary)
    });
    written.map_err(|source| CaptureError::Write {
        path: path.to_owned(),
        source,
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
