use crate::{CameraError, ModelKind};
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Why a COLMAP model could not be found, read or written.
#[derive(Debug, thiserror::Error)]
pub enum ColmapError {
    /// The folder to look in does not exist.
    #[error("{}: there is no such folder; check the path", folder.display())]
    NoFolder {
        /// The folder that was given.
        folder: PathBuf,
    },
    /// No place where a model usually lies holds one.
    #[error(
        "{}: no COLMAP model here; looked for cameras, images and points3D (all three as .bin \
         or all three as .txt) in {}{}; give the folder that holds the three files, or make them \
         with `colmap mapper` or `colmap model_converter`",
        folder.display(), list(looked_in), lacks(incomplete)
    )]
    NoModel {
        /// The folder that was given.
        folder: PathBuf,
        /// Where we looked, in this order.
        looked_in: Vec<PathBuf>,
        /// The places that hold part of a model.
        incomplete: Vec<Incomplete>,
    },
    /// A place where a model usually lies cannot be looked into.
    #[error(
        "{}: a COLMAP model may be here, but it cannot be looked into: {source}; see that it can be \
         read and that its disk is mounted, or move it away",
        path.display()
    )]
    Closed {
        /// The file, folder or link.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file could not be read.
    #[error("{}: cannot read the file: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file or folder could not be written.
    #[error("{}: cannot write: {source}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file has no bytes.
    #[error(
        "{}: the file is empty (0 bytes); copy it again, or re-export the model with \
         `colmap model_converter`",
        path.display()
    )]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// A record is cut short, unreadable or impossible.
    #[error(
        "{}, {place}: {problem}; copy the file again, or re-export the model with \
         `colmap model_converter`",
        path.display()
    )]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where in it.
        place: Place,
        /// What was found and what was expected.
        problem: String,
    },
    /// A camera model that this version does not read.
    #[error(
        "{}, {place}: camera {camera_id} has the camera model {model}, which is not among those \
         read here: {}; undistort the photos with `colmap image_undistorter` and use the model \
         it writes",
        path.display(), models_read()
    )]
    UnknownModel {
        /// The file.
        path: PathBuf,
        /// Where in it.
        place: Place,
        /// The camera.
        camera_id: u32,
        /// The model's id or name.
        model: String,
    },
    /// A camera's parameters describe no lens.
    #[error(
        "{}: camera {camera_id}: {source}; calibrate it again, or leave its images out",
        path.display()
    )]
    Camera {
        /// The file.
        path: PathBuf,
        /// The camera.
        camera_id: u32,
        /// What is wrong with it.
        source: CameraError,
    },
    /// Records contradict each other.
    #[error(
        "{}: {problem}; use three files of one and the same model, or re-export it with \
         `colmap model_converter`",
        path.display()
    )]
    Inconsistent {
        /// The file that refers to something absent, or repeats something.
        path: PathBuf,
        /// What does not fit.
        problem: String,
    },
    /// A model without images.
    #[error(
        "{}: the model holds no images; give one in which COLMAP registered some",
        path.display()
    )]
    NoImages {
        /// The file.
        path: PathBuf,
    },
    /// An image's name cannot be stored in the format.
    #[error(
        "{}: image {image_id} is named {name:?}, which this format cannot hold; rename the photo",
        path.display()
    )]
    Name {
        /// The file that was to be written.
        path: PathBuf,
        /// The image.
        image_id: u32,
        /// Its name.
        name: String,
    },
    /// A camera was to be written for COLMAP that COLMAP has no model for.
    #[error(
        "{}: camera {camera_id} has the model {}, which COLMAP does not have; undistort the \
         photos and write the pinhole cameras of the result, or write a text model, which is \
         read here",
        folder.display(), model.name()
    )]
    NotColmaps {
        /// The folder that was to be written.
        folder: PathBuf,
        /// The camera.
        camera_id: u32,
        /// Its model.
        model: ModelKind,
    },
    /// A model was to be written beside the rigs or frames of another one.
    #[error(
        "{}: the file is of a model that COLMAP 4 wrote, which would read it with the one to be written \
         and fail; choose another folder, or remove rigs and frames there first",
        path.display()
    )]
    Rigs {
        /// The file with them.
        path: PathBuf,
    },
    /// A text model was to be written where a binary one would be read in its stead.
    #[error(
        "{}: the folder already holds a binary model, which would be read instead of the text \
         model to be written; choose another folder, or remove the .bin files first",
        folder.display()
    )]
    Hidden {
        /// The folder.
        folder: PathBuf,
    },
}

/// Where in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// In a binary file.
    Byte {
        /// Which record, as in "image 7 of 20".
        record: String,
        /// From the file's start, the first byte being 0.
        offset: u64,
    },
    /// In a text file, the first line being 1.
    Line(usize),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Byte { record, offset } => write!(f, "{record}, byte {offset}"),
            Place::Line(line) => write!(f, "line {line}"),
        }
    }
}

/// A folder that holds one or two of a model's three files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Incomplete {
    /// The folder.
    pub folder: PathBuf,
    /// The files it lacks.
    pub missing: Vec<String>,
}

/// The models this version reads, as a list for people.
fn models_read() -> String {
    let names: Vec<_> = ModelKind::ALL.iter().map(|model| model.name()).collect();
    names.join(", ")
}

fn list(folders: &[PathBuf]) -> String {
    let names: Vec<_> = folders
        .iter()
        .map(|folder| folder.display().to_string())
        .collect();
    names.join(", ")
}

fn lacks(incomplete: &[Incomplete]) -> String {
    incomplete
        .iter()
        .map(|Incomplete { folder, missing }| {
            format!("; {} lacks {}", folder.display(), missing.join(" and "))
        })
        .collect()
}

pub(super) fn malformed(path: &Path, place: Place, problem: impl Into<String>) -> ColmapError {
    ColmapError::Malformed {
        path: path.to_owned(),
        place,
        problem: problem.into(),
    }
}
