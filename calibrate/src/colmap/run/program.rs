//! COLMAP's programs and their options, old and new.

use super::error::{LOCKED, OVERLAP, io_error};
use super::{Event, Matching, Options, RunError, Step, log, outcome};
use crate::colmap::find::most_images;
use capture::{PhotoSet, Tool, ToolError};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

pub(super) const LIST: &str = "photos.txt";
/// Beside it SQLite keeps its own, `database.db-wal` and others.
pub(super) const DATABASE: &str = "database.db";
/// Where models are once the mapper is through, a folder each.
pub(super) const MODELS: &str = "sparse";
/// And until then.
pub(super) const PARTIAL_MODELS: &str = "sparse.partial";
/// Where the mapper has its models and what it says at a second try, until it is known which
/// try is kept.
pub(super) const SECOND_MODELS: &str = "sparse.second";
pub(super) const SECOND_LOG: &str = "mapping.second.log";

/// Models of fewer photos COLMAP itself takes for failures.
const USUAL_MODEL: usize = 10;

/// Photos that make a model: COLMAP would throw away further ones of less than ten, and
/// nobody would learn why their photos are in none.
const SMALLEST_MODEL: &str = "3";

/// The least angle, in degrees, at which the first two photos see the scene where no pair
/// reaches COLMAP's own 16: it goes down to half of it by itself, so to 2. Photos taken side
/// by side for a lumigraph are often that close.
const CLOSE_PAIR: &str = "4";
const CLOSER: &[&str] = &["--Mapper.init_min_tri_angle"];

/// COLMAP, about to be run on a photo set.
pub(super) struct Program<'a> {
    colmap: &'a Tool,
    version: String,
    photos: &'a PhotoSet,
    work: PathBuf,
    options: Options,
}

impl Step {
    /// The file that keeps what COLMAP said.
    pub(super) fn log(self) -> &'static str {
        match self {
            Self::Features => "features.log",
            Self::Matching => "matching.log",
            Self::Mapping => "mapping.log",
        }
    }

    fn remedy(self) -> &'static str {
        match self {
            Self::Features => "check that the photos can be read, and that the disk is not full",
            Self::Matching => "check that memory and disk suffice; start again to go on",
            Self::Mapping => OVERLAP,
        }
    }
}

impl<'a> Program<'a> {
    pub(super) fn open(
        colmap: &'a Tool,
        photos: &'a PhotoSet,
        work: &Path,
        options: Options,
    ) -> Result<Self, RunError> {
        let help = colmap.text(&["help"])?;
        let version = log::messages(&help).find(|line| line.starts_with("COLMAP"));
        Ok(Self {
            colmap,
            version: version.unwrap_or("COLMAP").to_owned(),
            photos,
            work: work.to_owned(),
            options,
        })
    }

    /// As in "COLMAP 3.8 -- Structure-from-Motion and Multi-View Stereo".
    pub(super) fn version(&self) -> &str {
        &self.version
    }

    /// Writes the list of photos: COLMAP would take every file in their folder for one.
    pub(super) fn write_list(&self) -> Result<(), RunError> {
        let names = self.photos.photos.iter().map(|p| p.name.as_str());
        let unfit = |name: &&str| name.contains(['\n', '\r']) || name.trim() != *name;
        if let Some(name) = names.clone().find(unfit) {
            let name = name.to_owned();
            return Err(RunError::Name { name });
        }
        let list = names.fold(String::new(), |list, name| list + name + "\n");
        let path = self.work.join(LIST);
        fs::write(&path, list).map_err(io_error(path, "write"))
    }

    /// Removes what an interrupted run left of a step. Matching goes on where it was; the
    /// other two begin anew: a second run of the first would give the rest of the photos
    /// another camera, and the mapper goes on from whole models only.
    fn remove_unfinished(&self, step: Step) -> Result<(), RunError> {
        let left: &[&str] = match step {
            Step::Features => &[DATABASE, "database.db-shm", "database.db-wal"],
            Step::Matching => return Ok(()),
            Step::Mapping => &[MODELS, PARTIAL_MODELS, SECOND_MODELS, SECOND_LOG],
        };
        for name in left.iter().chain([&step.log()]) {
            self.remove(name)?;
        }
        Ok(())
    }

    fn remove(&self, name: &str) -> Result<(), RunError> {
        let path = self.work.join(name);
        let removed = match path.is_dir() {
            true => fs::remove_dir_all(&path),
            false if path.exists() => fs::remove_file(&path),
            false => Ok(()),
        };
        removed.map_err(io_error(&path, "remove what an earlier try left"))
    }

    /// Runs a step to its end.
    pub(super) fn run(&self, step: Step, report: &mut dyn FnMut(Event)) -> Result<(), RunError> {
        let command = match (step, self.options.matching) {
            (Step::Features, _) => "feature_extractor",
            (Step::Matching, Matching::Sequential) => "sequential_matcher",
            (Step::Matching, Matching::Exhaustive) => "exhaustive_matcher",
            (Step::Mapping, _) => "mapper",
        };
        let help = self.colmap.text(&[command, "-h"])?;
        self.remove_unfinished(step)?;
        if step == Step::Mapping {
            return self.place(command, &help, report);
        }
        let mut arguments = Arguments::new(command, &help);
        arguments.give("--database_path", self.work.join(DATABASE));
        if step == Step::Features {
            arguments.give("--image_path", &self.photos.root);
            arguments.give("--image_list_path", self.work.join(LIST));
            arguments.give("--ImageReader.camera_model", self.options.lens.name());
            if self.options.shared_camera {
                arguments.give("--ImageReader.single_camera", "1");
            }
            let names = ["--SiftExtraction.use_gpu", "--FeatureExtraction.use_gpu"];
            arguments.give_known(&names, "0");
        } else {
            let names = ["--SiftMatching.use_gpu", "--FeatureMatching.use_gpu"];
            arguments.give_known(&names, "0");
            // Smaller blocks than usual, as progress is told a block at a time.
            arguments.give_known(&["--ExhaustiveMatching.block_size"], "10");
        }
        self.run_once(step, &arguments.words, step.log(), report)
            .map_err(failed(step))
    }

    /// Has the mapper place photos: a second time where the first placed none, for want of two
    /// photos far enough apart to begin with, or few. (It has been seen to give up, or to place three of,
    /// ten photos all of which it places mostly.)
    fn place(
        &self,
        command: &str,
        help: &str,
        report: &mut dyn FnMut(Event),
    ) -> Result<(), RunError> {
        let step = Step::Mapping;
        let told = |folder: &Path| -> Result<Arguments<'_>, RunError> {
            fs::create_dir(folder).map_err(io_error(folder, "make the folder"))?;
            let mut arguments = Arguments::new(command, help);
            arguments.give("--database_path", self.work.join(DATABASE));
            arguments.give("--image_path", &self.photos.root);
            arguments.give("--output_path", folder);
            arguments.give_known(&["--Mapper.min_model_size"], SMALLEST_MODEL);
            Ok(arguments)
        };
        let can_be_closer = known(help, CLOSER).is_some();

        // 1. As COLMAP is used to, or from closer photos where it finds none to begin with.
        let partial = self.work.join(PARTIAL_MODELS);
        let mut arguments = told(&partial)?;
        let mut ran = self.run_once(step, &arguments.words, step.log(), report);
        let is_first = ran.is_ok();
        if ran.as_ref().is_err_and(Stopped::is_failure) && can_be_closer && self.found_no_pair()? {
            report(Event::PhotosAreClose);
            arguments.give_known(CLOSER, CLOSE_PAIR);
            ran = self.run_once(step, &arguments.words, step.log(), report);
        }
        ran.map_err(failed(step))?;

        // 2. Where it placed few, once more from closer photos: the larger model is kept.
        let placed = most_images(&partial);
        let is_few = placed < USUAL_MODEL && 2 * placed < self.photos.photos.len();
        if is_first && is_few && can_be_closer {
            report(Event::PhotosAreClose);
            let second = self.work.join(SECOND_MODELS);
            let mut arguments = told(&second)?;
            arguments.give_known(CLOSER, CLOSE_PAIR);
            match self.run_once(step, &arguments.words, SECOND_LOG, report) {
                Ok(()) if outcome::size(&second)? > outcome::size(&partial)? => {
                    self.remove(PARTIAL_MODELS)?;
                    self.rename(SECOND_MODELS, PARTIAL_MODELS)?;
                    self.rename(SECOND_LOG, step.log())?;
                }
                Err(stopped) if !stopped.is_failure() => return Err(stopped.source.into()),
                Ok(()) | Err(_) => {}
            }
            self.remove(SECOND_MODELS)?;
            self.remove(SECOND_LOG)?;
        }
        self.rename(PARTIAL_MODELS, MODELS)
    }

    fn rename(&self, from: &str, to: &str) -> Result<(), RunError> {
        let to = self.work.join(to);
        fs::rename(self.work.join(from), &to).map_err(io_error(to, "rename what was made to this"))
    }

    fn run_once(
        &self,
        step: Step,
        words: &[OsString],
        log: &str,
        report: &mut dyn FnMut(Event),
    ) -> Result<(), Stopped> {
        let photos = self.photos.photos.len() as u64;
        report(Event::Progress {
            step,
            done: 0,
            total: photos,
        });
        let mut is_locked = false;
        let mut on_line = |line: &str| {
            is_locked |= log::is_of_lock(line);
            if let Some((done, total)) = log::progress(step, line, photos) {
                report(Event::Progress { step, done, total });
            }
        };
        let ran = self.colmap.run(words, &self.work.join(log), &mut on_line);
        ran.map_err(|source| Stopped { source, is_locked })
    }

    /// Whether the mapper gave up as no two photos, or no two more, suit it to begin with.
    fn found_no_pair(&self) -> Result<bool, RunError> {
        let path = self.work.join(Step::Mapping.log());
        let said = fs::read(&path).map_err(io_error(path, "read"))?;
        Ok(log::found_no_pair(&String::from_utf8_lossy(&said)))
    }
}

/// Why a program did not come to a good end.
struct Stopped {
    source: ToolError,
    /// Whether it said that another writes to the database, anywhere: stacks may follow.
    is_locked: bool,
}

impl Stopped {
    /// Whether it ran, and failed.
    fn is_failure(&self) -> bool {
        matches!(self.source, ToolError::Failed { .. })
    }
}

/// What a step's error becomes.
fn failed(step: Step) -> impl FnOnce(Stopped) -> RunError {
    move |stopped| match (stopped.is_failure(), stopped.source) {
        (true, source) => RunError::Failed {
            source,
            remedy: if stopped.is_locked {
                LOCKED
            } else {
                step.remedy()
            },
        },
        (false, other) => other.into(),
    }
}

/// A command line.
struct Arguments<'a> {
    help: &'a str,
    words: Vec<OsString>,
}

impl<'a> Arguments<'a> {
    fn new(command: &str, help: &'a str) -> Self {
        Self {
            help,
            words: vec![command.into()],
        }
    }

    fn give(&mut self, name: &str, value: impl Into<OsString>) {
        self.words.extend([name.into(), value.into()]);
    }

    /// Gives an option that has had several names by the one that this COLMAP's help
    /// knows; not at all where it knows none.
    fn give_known(&mut self, names: &[&str], value: &str) {
        if let Some(name) = known(self.help, names) {
            self.give(name, value);
        }
    }
}

/// The first of an option's names that a help knows.
fn known<'n>(help: &str, names: &[&'n str]) -> Option<&'n str> {
    let is_known = |name: &&str| help.split_whitespace().any(|word| word == *name);
    names.iter().copied().find(is_known)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_option_goes_by_the_name_in_the_help() {
        let given = |help: &str| {
            let mut arguments = Arguments::new("feature_extractor", help);
            arguments.give_known(&["--Sift.use_gpu", "--Feature.use_gpu"], "0");
            arguments.words[1..].to_vec()
        };
        assert_eq!(given("  --Sift.use_gpu arg (=1)"), ["--Sift.use_gpu", "0"]);
        assert_eq!(
            given("I1 x] --Feature.use_gpu arg"),
            ["--Feature.use_gpu", "0"]
        );
        assert!(given("  --Sift.use_gpu_index arg (=-1)").is_empty());
    }
}
