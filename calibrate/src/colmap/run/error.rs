use crate::colmap::ColmapError;
use capture::{CaptureError, ToolError};
use std::io;
use std::path::PathBuf;

/// Why photos could not be calibrated.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Less than two photos.
    #[error("{}: one photo only; expected two or more, from different places", folder.display())]
    TooFewPhotos {
        /// The photos' folder.
        folder: PathBuf,
    },
    /// The work folder holds something else.
    #[error(
        "{}: holds something other than an earlier run's work; remove or rename it, or choose \
         another folder", folder.display()
    )]
    Occupied {
        /// The folder.
        folder: PathBuf,
    },
    /// A photo's name that COLMAP's list of photos cannot hold.
    #[error(
        "photo {name:?}: COLMAP cannot be told a name that has a line break or begins or ends \
         with white space; rename the file"
    )]
    Name {
        /// The photo.
        name: String,
    },
    /// COLMAP is missing or cannot be run.
    #[error(transparent)]
    Tool(#[from] ToolError),
    /// One of its programs fails.
    #[error("{source}\nno calibration was found: {remedy}")]
    Failed {
        /// What it said.
        source: ToolError,
        /// What may help.
        remedy: &'static str,
    },
    /// COLMAP ends well, but without a model.
    #[error("{}: COLMAP left no model here; {OVERLAP}", folder.display())]
    NoModel {
        /// Where models are expected.
        folder: PathBuf,
    },
    /// A model that COLMAP wrote cannot be read.
    #[error(
        "COLMAP wrote what cannot be read, as it does on a full disk: {0}; started again, it places photos anew"
    )]
    Model(#[from] ColmapError),
    /// A photo cannot be read.
    #[error(transparent)]
    Photo(#[from] CaptureError),
    /// A file of the work folder cannot be read or written.
    #[error("{}: cannot {doing}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// What was tried.
        doing: &'static str,
        /// Why not.
        source: io::Error,
    },
}

/// What helps most photo sets that COLMAP cannot place.
pub(super) const OVERLAP: &str = "photos need overlap (each shows most of what its neighbour \
    shows, from a step further on, not by turning on the spot), texture, and little blur; take \
    more of them, or match all pairs";

/// What helps where SQLite says that the database is locked. An import that is killed leaves its COLMAP at
/// work: that ends when it next has something to say, as nobody listens.
pub(super) const LOCKED: &str = "another COLMAP is at work on this database, such as one that an import \
    left behind when it was killed; wait until it has ended, or end it, then start again to go on";

pub(super) fn io_error(
    path: impl Into<PathBuf>,
    doing: &'static str,
) -> impl FnOnce(io::Error) -> RunError {
    let path = path.into();
    move |source| RunError::Io {
        path,
        doing,
        source,
    }
}
