//! Screenshots that know where they were taken from: PNG files with a text chunk that holds the
//! pose as a path of one frame, so that `render --path` can make the same picture again.

use super::{CameraPath, PathError, PathFileError, PathFrame, parse, text};
use calibrate::View;
use image::RgbaImage;

use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::{Path, PathBuf};

/// The text chunk's keyword.
pub const SHOT_KEYWORD: &str = "lumigraph path";

/// Why a screenshot cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum ShotError {
    /// The file.
    #[error("{path}: {error}", path = .0.display(), error = .1)]
    Io(PathBuf, std::io::Error),
    /// No PNG, or a damaged one.
    #[error("{path}: {error}; expected a PNG", path = .0.display(), error = .1)]
    Png(PathBuf, String),
    /// A PNG from elsewhere.
    #[error("{}: no pose is stored in it; expected a screenshot taken by `lumigraph view`", .0.display())]
    NoPose(PathBuf),
    /// The pose cannot be stored, or what is stored is none.
    #[error("{path}: {error}", path = .0.display(), error = .1)]
    Path(PathBuf, PathError),
    /// What is stored is no path.
    #[error(transparent)]
    File(#[from] PathFileError),
}

/// Writes a picture with the view that it was drawn for, and what of it is shown ("picture", or
/// another layer's name). The file appears complete or not at
/// all.
///
/// # Errors
/// A file that cannot be written; a view that no file can hold.
pub fn write_shot(
    file: &Path,
    picture: &RgbaImage,
    view: &View,
    layer: &str,
) -> Result<(), ShotError> {
    let io = |error| ShotError::Io(file.to_owned(), error);
    let png = |error: png::EncodingError| match error {
        png::EncodingError::IoError(error) => io(error),
        other => ShotError::Png(file.to_owned(), other.to_string()),
    };
    let of_path = |error| ShotError::Path(file.to_owned(), error);
    let frame = PathFrame::of_view("frame_0000".to_owned(), view).map_err(|error| {
        of_path(PathError::Camera {
            kind: "frame",
            index: 0,
            error,
        })
    })?;
    let one = CameraPath::new(30.0, vec![frame]).map_err(of_path)?;
    let text = text(&one)?;
    let mut temporary = file.as_os_str().to_owned();
    temporary.push(".tmp");
    let written = (|| {
        let out = BufWriter::new(File::create(&temporary).map_err(io)?);
        let mut encoder = png::Encoder::new(out, picture.width(), picture.height());
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder
            .add_text_chunk(SHOT_KEYWORD.to_owned(), text)
            .map_err(png)?;
        encoder
            .add_text_chunk("lumigraph layer".to_owned(), layer.to_owned())
            .map_err(png)?;
        let mut writer = encoder.write_header().map_err(png)?;
        writer.write_image_data(picture.as_raw()).map_err(png)?;
        writer.finish().map_err(png)?;
        std::fs::rename(&temporary, file).map_err(io)
    })();
    if written.is_err() {
        // The error at hand is the one to report.
        let _ = std::fs::remove_file(&temporary);
    }
    written
}

/// The view that a screenshot was drawn for, as a path of one frame that is called as the file.
///
/// # Errors
/// No PNG, or one without a pose.
pub fn read_shot(file: &Path) -> Result<CameraPath, ShotError> {
    let opened = File::open(file).map_err(|error| ShotError::Io(file.to_owned(), error))?;
    let decoder = png::Decoder::new(BufReader::new(opened));
    let reader = decoder.read_info();
    let reader = reader.map_err(|error| ShotError::Png(file.to_owned(), error.to_string()))?;
    let chunks = &reader.info().uncompressed_latin1_text;
    let chunk = chunks.iter().find(|chunk| chunk.keyword == SHOT_KEYWORD);
    let chunk = chunk.ok_or_else(|| ShotError::NoPose(file.to_owned()))?;
    let mut path = parse(file, chunk.text.as_bytes())?;
    if let ([frame], Some(stem)) = (path.frames.as_mut_slice(), file.file_stem()) {
        frame.name = stem.to_string_lossy().into_owned();
    }
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Lens, Rigid3};
    use glam::{DVec2, DVec3};
    use image::Rgba;

    fn view() -> View {
        let (center, target) = (DVec3::new(0.1, 1e6, -3.7), DVec3::new(0.3, 1e6, 5.0));
        let view = View {
            lens: Lens::pinhole(DVec2::splat(31.7), DVec2::new(16.0, 12.0)),
            width: 32,
            height: 24,
            camera_from_world: Rigid3::looking_at(center, target, DVec3::Y),
        };
        PathFrame::of_view("a".to_owned(), &view).unwrap().view
    }

    #[test]
    fn a_shot_gives_its_view_and_its_pixels_back() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("shot_0001.png");
        let picture = RgbaImage::from_fn(32, 24, |x, y| Rgba([x as u8, y as u8, 7, (x * y) as u8]));
        write_shot(&file, &picture, &view(), "picture").unwrap();
        assert_eq!(image::open(&file).unwrap().into_rgba8(), picture);
        let path = read_shot(&file).unwrap();
        assert_eq!(path.frames.len(), 1);
        assert_eq!(path.frames[0].view, view());
        assert_eq!(path.frames[0].name, "shot_0001");
    }

    #[test]
    fn other_files_are_said_to_be_others() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.png");
        RgbaImage::new(2, 2).save(&file).unwrap();
        assert!(matches!(read_shot(&file), Err(ShotError::NoPose(_))));
        std::fs::write(&file, "no picture").unwrap();
        assert!(matches!(read_shot(&file), Err(ShotError::Png(..))));
        let gone = folder.path().join("gone/b.png");
        assert!(matches!(read_shot(&gone), Err(ShotError::Io(..))));
        let failed = write_shot(&gone, &RgbaImage::new(32, 24), &view(), "picture");
        assert!(matches!(failed, Err(ShotError::Io(..))));
    }
}
