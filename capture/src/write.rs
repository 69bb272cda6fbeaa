use crate::CaptureError;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, RgbaImage};
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
    let written = encode(&temporary, image).and_then(|()| fs::rename(&temporary, path));
    written.map_err(|source| {
        // The error at hand is the one to report.
        let _ = fs::remove_file(&temporary);
        failed(source)
    })
}

fn encode(path: &Path, image: &RgbaImage) -> io::Result<()> {
    let mut out = BufWriter::new(File::create(path)?);
    let (width, height) = image.dimensions();
    PngEncoder::new_with_quality(&mut out, CompressionType::Fast, FilterType::Adaptive)
        .write_image(image.as_raw(), width, height, ExtendedColorType::Rgba8)
        .map_err(|error| match error {
            image::ImageError::IoError(error) => error,
            other => io::Error::other(other),
        })?;
    out.flush()
}
