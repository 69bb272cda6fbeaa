//! COLMAP models: `cameras`, `images` and `points3D`, binary or text.
//!
//! The formats are described in COLMAP's `doc/format.rst`. A pose is stored as
//! `camera_from_world`, its quaternion scalar first; a keypoint's coordinates and the
//! principal point put the first pixel's centre at (0.5, 0.5), as we do. Further files
//! beside the three (`rigs`, `frames`, `project.ini`) are left alone: `images` carries
//! every pose, in COLMAP's newest layout too. Beside another model's rigs and frames none is
//! written.
//!
//! ```no_run
//! use calibrate::colmap;
//! use std::path::Path;
//!
//! let model = colmap::find_model(Path::new("my-capture"))?;
//! let reconstruction = colmap::read_model(&model)?;
//! println!("{} photos", reconstruction.images.len());
//! # Ok::<(), colmap::ColmapError>(())
//! ```

mod binary;
mod check;
mod error;
mod find;
pub mod run;
mod text;
mod write;

pub use error::{ColmapError, Incomplete, Place};
pub use find::{SubModel, find_model, find_models, side_by_side};
pub use write::{fits_text, write_binary, write_text};

use crate::{Camera, CameraId, Reconstruction};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// What one of the three files is called without its extension.
const STEMS: [&str; 3] = ["cameras", "images", "points3D"];

/// The two ways in which COLMAP writes a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Binary,
    Text,
}

impl Format {
    fn extension(self) -> &'static str {
        match self {
            Format::Binary => "bin",
            Format::Text => "txt",
        }
    }

    /// The paths of `cameras`, `images` and `points3D` in a folder.
    fn files(self, folder: &Path) -> [PathBuf; 3] {
        STEMS.map(|stem| folder.join(format!("{stem}.{}", self.extension())))
    }
}

/// Reads the model in `folder`, the folder that itself holds the files; the binary one
/// where both formats are complete.
///
/// Everything the files refer to exists in what comes back: each image's camera, each
/// keypoint's point, each track's images and keypoints. Every number is finite, every
/// camera has a lens, and no two images share a name. Backslashes in names become `/`.
/// A point whose error is not a number gets −1: never computed.
///
/// # Errors
/// A missing or unreadable file, a file that is not what COLMAP writes, a camera model
/// this version does not read, or records that contradict each other.
pub fn read_model(folder: &Path) -> Result<Reconstruction, ColmapError> {
    let format = find::format_in(folder)?.ok_or_else(|| find::no_model(folder, &[folder]))?;
    parse(format, folder, |path| read_file(path).map(Cow::Owned))
}

/// Reads the contents of `cameras.bin`, `images.bin` and `points3D.bin`; `folder` is only
/// named in errors.
///
/// # Errors
/// As for [`read_model`].
pub fn parse_binary(folder: &Path, contents: [&[u8]; 3]) -> Result<Reconstruction, ColmapError> {
    let mut contents = contents.into_iter();
    parse(Format::Binary, folder, |_| {
        Ok(Cow::Borrowed(contents.next().unwrap_or_default()))
    })
}

/// Reads the contents of `cameras.txt`, `images.txt` and `points3D.txt`; `folder` is only
/// named in errors.
///
/// # Errors
/// As for [`read_model`].
pub fn parse_text(folder: &Path, contents: [&[u8]; 3]) -> Result<Reconstruction, ColmapError> {
    let mut contents = contents.into_iter();
    parse(Format::Text, folder, |_| {
        Ok(Cow::Borrowed(contents.next().unwrap_or_default()))
    })
}

/// Asks for the three files one after the other, so that only one is held at a time.
fn parse<'a>(
    format: Format,
    folder: &Path,
    mut content_of: impl FnMut(&Path) -> Result<Cow<'a, [u8]>, ColmapError>,
) -> Result<Reconstruction, ColmapError> {
    let mut read = |path: &Path| {
        let bytes = content_of(path)?;
        check_content(path, &bytes)?;
        Ok(bytes)
    };
    let files = format.files(folder);
    let [cameras, images, points] = &files;
    let reconstruction = match format {
        Format::Binary => Reconstruction {
            cameras: binary::read_cameras(cameras, &read(cameras)?)?,
            images: binary::read_images(images, &read(images)?)?,
            points: binary::read_points(points, &read(points)?)?,
        },
        Format::Text => Reconstruction {
            cameras: text::read_cameras(cameras, &read(cameras)?)?,
            images: text::read_images(images, &read(images)?)?,
            points: text::read_points(points, &read(points)?)?,
        },
    };
    check::references(&reconstruction, &files)?;
    Ok(reconstruction)
}

/// Reads `cameras.bin` or `cameras.txt` alone: a binary file by its extension, else text.
///
/// # Errors
/// As for [`read_model`].
pub fn read_cameras(path: &Path) -> Result<BTreeMap<CameraId, Camera>, ColmapError> {
    let bytes = read_file(path)?;
    check_content(path, &bytes)?;
    let cameras = if path.extension() == Some("bin".as_ref()) {
        binary::read_cameras(path, &bytes)?
    } else {
        text::read_cameras(path, &bytes)?
    };
    check::lenses(&cameras, path)?;
    Ok(cameras)
}

/// Whether a file is called like one of a COLMAP model.
pub fn is_part(path: &Path) -> bool {
    [Format::Binary, Format::Text].iter().any(|format| {
        format
            .files(Path::new(""))
            .iter()
            .any(|name| path.ends_with(name))
    })
}

fn read_file(path: &Path) -> Result<Vec<u8>, ColmapError> {
    fs::read(path).map_err(|source| ColmapError::Read {
        path: path.to_owned(),
        source,
    })
}

/// Having no bytes is an error, except that COLMAP's own instructions for known poses ask
/// for an empty `points3D.txt`.
fn check_content(path: &Path, bytes: &[u8]) -> Result<(), ColmapError> {
    if bytes.is_empty() && !path.ends_with("points3D.txt") {
        return Err(ColmapError::Empty {
            path: path.to_owned(),
        });
    }
    Ok(())
}
