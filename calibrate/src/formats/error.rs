use crate::CameraError;
use std::io;
use std::path::{Path, PathBuf};

/// Why a calibration could not be read.
#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    /// The file could not be read.
    #[error("{}: cannot read the file: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A record is cut short, unreadable, impossible, or says what cannot be represented.
    #[error("{}, {record}: {problem}; {remedy}", path.display())]
    Record {
        /// The file.
        path: PathBuf,
        /// Which record: a path through a JSON file, a line of a text file, a byte range.
        record: String,
        /// What was found and what was expected.
        problem: String,
        /// What to try.
        remedy: String,
    },
    /// A camera's parameters describe no lens.
    #[error(
        "{}, {record}: {source}; calibrate it again, or leave its images out",
        path.display()
    )]
    Camera {
        /// The file.
        path: PathBuf,
        /// Which record.
        record: String,
        /// What is wrong with it.
        source: CameraError,
    },
}

/// What to try when a file is not what its program writes.
const EXPORT_AGAIN: &str = "copy the file again, or export it again from the program it is from";

/// What is wrong with a record, before it is known where the record is.
#[derive(Debug)]
pub(super) struct Problem {
    problem: String,
    remedy: String,
}

impl Problem {
    /// A problem of a file that is broken.
    pub(super) fn broken(problem: impl Into<String>) -> Self {
        Self::new(problem, EXPORT_AGAIN)
    }

    /// A problem with a remedy of its own.
    pub(super) fn new(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self {
            problem: problem.into(),
            remedy: remedy.into(),
        }
    }

    /// The error that says where.
    pub(super) fn at(self, path: &Path, record: impl Into<String>) -> FormatError {
        FormatError::Record {
            path: path.to_owned(),
            record: record.into(),
            problem: self.problem,
            remedy: self.remedy,
        }
    }
}
