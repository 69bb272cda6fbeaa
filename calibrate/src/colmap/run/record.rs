//! `run.json`: what a work folder is of, and how far it is.

use super::error::io_error;
use super::program::{DATABASE, LIST, MODELS, PARTIAL_MODELS, SECOND_LOG, SECOND_MODELS};
use super::{Event, Options, RunError, Step};
use capture::{PhotoSet, fingerprint};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

const FILE: &str = "run.json";
/// Until it is whole.
const TEMPORARY: &str = "run.tmp";

/// What the results depend on.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Inputs {
    colmap: String,
    options: String,
    /// Sizes and times of modification, by name.
    photos: BTreeMap<String, String>,
}

pub(super) fn inputs(
    photos: &PhotoSet,
    options: &Options,
    version: &str,
) -> Result<Inputs, RunError> {
    let mut by_name = BTreeMap::new();
    for photo in &photos.photos {
        let now = fingerprint(&photo.path).map_err(io_error(&photo.path, "read the photo"))?;
        by_name.insert(photo.name.clone(), now);
    }
    Ok(Inputs {
        colmap: version.to_owned(),
        options: format!("{options:?}"),
        photos: by_name,
    })
}

#[derive(Serialize, Deserialize)]
struct File {
    inputs: Inputs,
    finished: Vec<Step>,
}

/// Whether a folder is one that runs work in.
pub(super) fn is_kept_in(folder: &Path) -> bool {
    folder.join(FILE).is_file()
}

/// Whether all that a folder holds is called as what runs leave there.
fn holds_only_a_runs(work: &Path) -> io::Result<bool> {
    let logs = Step::ALL.map(Step::log);
    let own = [FILE, TEMPORARY, LIST, MODELS];
    let own_while_placing = [PARTIAL_MODELS, SECOND_MODELS, SECOND_LOG];
    let is_own = |name: &OsStr| {
        let name = name.to_str().unwrap_or_default();
        let of_database = name.strip_prefix(DATABASE);
        own.contains(&name)
            || own_while_placing.contains(&name)
            || logs.contains(&name)
            || of_database.is_some_and(|rest| rest.is_empty() || rest.starts_with('-'))
    };
    for entry in fs::read_dir(work)? {
        if !is_own(&entry?.file_name()) {
            return Ok(false);
        }
    }
    Ok(true)
}

pub(super) struct Record {
    path: PathBuf,
    file: File,
}

impl Record {
    /// What an earlier run with the same inputs left in the folder; else a beginning, in
    /// an empty folder. It is emptied only of what runs leave.
    pub(super) fn open(
        work: &Path,
        inputs: Inputs,
        report: &mut dyn FnMut(Event),
    ) -> Result<Self, RunError> {
        let path = work.join(FILE);
        let earlier = fs::read(&path).ok();
        let earlier: Option<File> = earlier.and_then(|b| serde_json::from_slice(&b).ok());
        let is_record = earlier.is_some();
        if let Some(file) = earlier.filter(|file| file.inputs == inputs) {
            return Ok(Self { path, file });
        }
        let is_empty = |work: &Path| Ok(fs::read_dir(work)?.next().is_none());
        if work.exists() && !is_empty(work).map_err(io_error(work, "list the folder"))? {
            // The record alone does not say whose the rest is.
            let is_ours =
                is_record && holds_only_a_runs(work).map_err(io_error(work, "list the folder"))?;
            if !is_ours {
                return Err(RunError::Occupied {
                    folder: work.to_owned(),
                });
            }
            report(Event::StartingOver);
            fs::remove_dir_all(work).map_err(io_error(work, "empty the folder"))?;
        }
        fs::create_dir_all(work).map_err(io_error(work, "make the folder"))?;
        let finished = Vec::new();
        let file = File { inputs, finished };
        let record = Self { path, file };
        record.write()?;
        Ok(record)
    }

    pub(super) fn is_finished(&self, step: Step) -> bool {
        self.file.finished.contains(&step)
    }

    pub(super) fn finish(&mut self, step: Step) -> Result<(), RunError> {
        self.file.finished.push(step);
        self.write()
    }

    /// A step is to be done again.
    pub(super) fn forget(&mut self, step: Step) -> Result<(), RunError> {
        self.file.finished.retain(|finished| *finished != step);
        self.write()
    }

    fn write(&self) -> Result<(), RunError> {
        let temporary = self.path.with_file_name(TEMPORARY);
        let bytes = serde_json::to_vec_pretty(&self.file).unwrap_or_default();
        fs::write(&temporary, bytes).map_err(io_error(&temporary, "write"))?;
        fs::rename(&temporary, &self.path).map_err(io_error(&self.path, "write"))
    }
}
