use std::io;
use std::path::{Path, PathBuf};

/// Why an OpenCV calibration could not be read.
#[derive(Debug, thiserror::Error)]
pub enum OpenCvError {
    /// The file could not be read.
    #[error("{}: cannot read the file: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The bytes are no storage file at all.
    #[error(
        "{}: {problem}; expected a file that OpenCV's FileStorage writes (YAML, XML or JSON, \
         gzip or not)",
        path.display()
    )]
    NotStorage {
        /// The file.
        path: PathBuf,
        /// What was found.
        problem: String,
    },
    /// Text that is cut short or garbled, or a matrix that contradicts itself.
    #[error(
        "{}, line {line}: {problem}; copy the file again, or write it again with OpenCV",
        path.display()
    )]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where in it, the first line being 1; of the unpacked text for gzip.
        line: usize,
        /// What was found and what was expected.
        problem: String,
    },
    /// A value that makes no camera.
    #[error("{}, line {line}: {key}: {problem}", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// Where in it.
        line: usize,
        /// The value's name.
        key: String,
        /// What was found, what was expected, and what to do.
        problem: String,
    },
    /// No camera under a name known here.
    #[error(
        "{}: no camera matrix under a name known here (camera_matrix, cameraMatrix, K, M1, \
         intrinsic, Camera.fx and their like); the file holds {}; choose with --camera-matrix \
         KEY --distortion KEY",
        path.display(), list(found)
    )]
    NoCamera {
        /// The file.
        path: PathBuf,
        /// The matrices it holds: name and shape.
        found: Vec<String>,
    },
    /// Cameras alone.
    #[error(
        "{}: the file holds cameras, but no poses; expected extrinsic_parameters, rvecs and tvecs, \
         or the R and T of two cameras; have OpenCV write the extrinsic parameters, or give a \
         COLMAP model; without this file beside the photos `import` has COLMAP find cameras and \
         poses",
        path.display()
    )]
    NoPoses {
        /// The file.
        path: PathBuf,
    },
    /// A name was asked for that the file does not have.
    #[error(
        "{}: no matrix is called {key}; the file holds {}", path.display(), list(found)
    )]
    NoSuchKey {
        /// The file.
        path: PathBuf,
        /// The name asked for.
        key: String,
        /// The matrices it holds: name and shape.
        found: Vec<String>,
    },
    /// A camera model that is none of OpenCV's two.
    #[error(
        "{}: the camera model is {model}, which is not read here; calibrate with OpenCV's \
         pinhole or fisheye model instead",
        path.display()
    )]
    Model {
        /// The file.
        path: PathBuf,
        /// What the file calls it.
        model: String,
    },
}

impl OpenCvError {
    /// The file that it is about.
    pub fn path(&self) -> &Path {
        match self {
            Self::Read { path, .. }
            | Self::NotStorage { path, .. }
            | Self::Malformed { path, .. }
            | Self::Value { path, .. }
            | Self::NoCamera { path, .. }
            | Self::NoPoses { path }
            | Self::NoSuchKey { path, .. }
            | Self::Model { path, .. } => path,
        }
    }
}

fn list(found: &[String]) -> String {
    match found {
        [] => "no matrices".to_owned(),
        found => found.join(", "),
    }
}

/// What is wrong and on which line, before anyone knows the file's name.
#[derive(Debug, PartialEq)]
pub(super) struct Problem {
    pub(super) line: usize,
    pub(super) problem: String,
}

impl Problem {
    pub(super) fn new(line: usize, problem: impl Into<String>) -> Self {
        Self {
            line,
            problem: problem.into(),
        }
    }
}

/// A piece of the input for a message: its first few characters.
pub(super) fn excerpt(text: &str) -> String {
    const SHOWN: usize = 40;
    crate::excerpt::excerpt(text.lines().next().unwrap_or_default().trim(), SHOWN)
}
