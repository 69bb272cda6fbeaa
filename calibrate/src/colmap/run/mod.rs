//! Calibrating photos with COLMAP itself: features, matches, then the model, each a run of
//! one of its programs.
//!
//! All of it lies in a work folder that outlives an interruption: the database, a log for
//! each step, the models in `sparse/`, and `run.json`, which says of what inputs they are
//! and which steps are finished. COLMAP numbers photos as its threads come by, so two runs
//! agree closely, but not to the last digit.
//!
//! ```no_run
//! use calibrate::colmap::run::{self, Options};
//! use capture::PhotoSet;
//! use std::path::Path;
//!
//! let photos = PhotoSet::open(Path::new("photos"))?;
//! let options = Options::for_photos(&photos, false)?;
//! let made = run::run(&run::colmap(), &photos, Path::new("work"), &options, &mut |_| {})?;
//! println!("{} of {} photos", made.reconstruction.images.len(), photos.photos.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod log;
mod options;
mod outcome;
mod program;
mod record;

pub use error::RunError;
pub use options::{Matching, Options};
pub use outcome::{Outcome, Unplaced, Why};

use capture::{PhotoSet, Tool};
use program::Program;
use record::Record;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::{Path, PathBuf};

/// One of COLMAP's programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Step {
    /// Finding features in every photo.
    Features,
    /// Matching the features of pairs of photos.
    Matching,
    /// Placing the photos one after the other.
    Mapping,
}

impl Step {
    /// In their order.
    pub const ALL: [Self; 3] = [Self::Features, Self::Matching, Self::Mapping];
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Features => "finding features",
            Self::Matching => "matching",
            Self::Mapping => "placing photos",
        })
    }
}

/// What is going on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The work folder is of other photos or options: it is emptied.
    StartingOver,
    /// An earlier run finished this step.
    Finished(Step),
    /// No two photos that lie far enough apart by COLMAP's measure did to begin with, or few of the
    /// others could be placed from them: photos are placed once more, from a pair that may be closer.
    PhotosAreClose,
    /// A step is so far.
    Progress {
        /// Which.
        step: Step,
        /// Parts done.
        done: u64,
        /// Of so many.
        total: u64,
    },
}

/// The program.
pub fn colmap() -> Tool {
    Tool {
        program: PathBuf::from("colmap"),
        install: "install COLMAP: `apt-get install colmap` on Debian and Ubuntu, `brew install \
                  colmap` on macOS, elsewhere from https://colmap.github.io/install.html; or give \
                  a calibration",
    }
}

/// Calibrates photos in the folder `work`, which is made where it is missing. What an
/// earlier run with the same photos and options finished there is not done again. Two runs at once would take each
/// other's work away: whoever starts them keeps them apart ([`capture::hold::hold_now`]).
///
/// # Errors
/// Less than two photos; COLMAP is missing, fails or finds no model; files that cannot be
/// read or written.
pub fn run(
    colmap: &Tool,
    photos: &PhotoSet,
    work: &Path,
    options: &Options,
    report: &mut dyn FnMut(Event),
) -> Result<Outcome, RunError> {
    if photos.photos.len() < 2 {
        return Err(RunError::TooFewPhotos {
            folder: photos.root.clone(),
        });
    }
    let program = Program::open(colmap, photos, work, *options)?;
    let inputs = record::inputs(photos, options, program.version())?;
    let mut record = Record::open(work, inputs, report)?;
    program.write_list()?;
    let mut made = None;
    for step in Step::ALL {
        if record.is_finished(step) {
            report(Event::Finished(step));
            continue;
        }
        program.run(step, report)?;
        if step == Step::Mapping {
            // Of a full disk COLMAP says nothing. What cannot be read is placed anew the next time.
            let read = outcome::read(photos, work);
            if !matches!(read, Ok(_) | Err(RunError::NoModel { .. })) {
                return read;
            }
            made = Some(read);
        }
        record.finish(step)?;
    }
    let made = made.unwrap_or_else(|| outcome::read(photos, work));
    if let Err(RunError::Model(_)) = made {
        record.forget(Step::Mapping)?;
    }
    made
}

/// Whether a folder is one that [`run`] works in, finished or not.
pub(super) fn is_work(folder: &Path) -> bool {
    record::is_kept_in(folder)
}
