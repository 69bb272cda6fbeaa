//! What the LDIs in an interior's folder were made of, and whether that is what there is now.

use super::captured::Photos;
use super::output::{make_parent, write_file};
use super::stamp::{Stamp, changes, stamps};
use anyhow::{Context, anyhow};
use capture::hold::{Taken, hold_now};
use capture::is_left_of;
use lumigraph::scene::relative_lossy;
use render::interior::{LdiSource, LibraryOptions, Painter};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::ffi::OsStr;
use std::fs::{File, read_dir};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The folder beside an interior's file.
pub(super) const FOLDER: &str = "ldi";
/// In it, what they were made of.
const FILE: &str = "made.json";
/// Of that file, and of how LDIs are made: raised when either changes, as those of before are not those of now.
const VERSION: u32 = 7;
/// The option that is a number of what calibrations say.
const CALIBRATION: &str = "calibration";

/// What decides the samples of all LDIs of an interior.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Made {
    version: u32,
    /// The program's.
    program: String,
    options: Map<String, Value>,
    /// By path from the interior's folder.
    inputs: Vec<Stamp>,
}

/// What an interior's folder has of LDIs.
enum Found {
    /// No LDIs.
    None,
    /// Those that would be made now, or some of them.
    Same,
    /// Others; how they differ, for people.
    Other(String),
}

impl Made {
    /// Of the interior with that file, which the other files decide; `options` are those that its painter's walk
    /// has ([`LibraryOptions::with_photos`]), and `photos` what it draws from, if anything.
    pub(super) fn new(
        file: &Path,
        files: &[PathBuf],
        options: &LibraryOptions,
        painter: &Painter,
        photos: Option<&Photos>,
    ) -> anyhow::Result<Self> {
        let mut all = Map::new();
        let mut put = |name: &str, value: Value| all.insert(name.to_owned(), value);
        let options = options.with_photos(painter.captured());
        put("size", json!(options.size));
        put("views", json!(options.semicircles.views));
        put("span", json!(options.semicircles.span));
        put("ldi_views", json!(options.ldi_views));
        put("range", json!(options.ldi.range));
        put("conflict", json!(format!("{:?}", options.ldi.conflict)));
        put("center_in_front", json!(options.ldi.center_in_front));
        put("margin", json!(options.ldi.margin));
        if let Some(photos) = photos {
            let of = match options.ldi_of {
                LdiSource::Views => "views",
                LdiSource::Photos => "photos",
            };
            put("ldi_from", json!(of));
            put("device", json!(painter.description()));
            put("exposure", photos.exposure.json()["how"].take());
            put(CALIBRATION, json!(photos.fingerprint()));
            // Photos that have no room are drawn coarser.
            put("cpu_memory", json!(options.budget));
        }
        let folder = folder_of(file);
        let name = |file: &Path| PathBuf::from(relative_lossy(folder, file));
        Ok(Self {
            version: VERSION,
            program: env!("CARGO_PKG_VERSION").to_owned(),
            options: all,
            inputs: stamps(files, name),
        })
    }

    /// What a folder has.
    fn find(&self, folder: &Path) -> anyhow::Result<Found> {
        let file = folder.join(FILE);
        let bytes = match std::fs::read(&file) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == ErrorKind::NotFound => return unnamed(folder),
            Err(error) => {
                return Err(error).with_context(|| format!("{}: cannot read", file.display()));
            }
        };
        let Ok(before) = serde_json::from_slice::<Self>(&bytes) else {
            let text = format!("has a {FILE} that this program does not know");
            return Ok(Found::Other(text));
        };
        let others = before.others(self);
        let changes = changes(&before.inputs, &self.inputs);
        // What is known of photos changes with their files, which say more than a number does.
        let is_told_by_files =
            !changes.is_empty() && others.iter().all(|(name, _)| name == CALIBRATION);
        if !others.is_empty() && !is_told_by_files {
            let texts: Vec<String> = others.into_iter().map(|(_, text)| text).collect();
            let others = texts.join(", ");
            return Ok(Found::Other(format!(
                "was made with other options: {others}"
            )));
        }
        Ok(match changes.is_empty() {
            true => Found::Same,
            false => Found::Other(format!("was made of other files: {changes}")),
        })
    }

    /// Options that are not those of before: the name of each, and how it differs, for people.
    fn others(&self, now: &Self) -> Vec<(String, String)> {
        let named = |made: &Self| {
            let mut all = made.options.clone();
            all.insert("program".to_owned(), json!(made.program));
            all.insert("version".to_owned(), json!(made.version));
            all
        };
        let (was, is) = (named(self), named(now));
        let none = Value::Null;
        let of = |all: &Map<String, Value>, name: &str| match all.get(name).unwrap_or(&none) {
            Value::Null => "none".to_owned(),
            Value::String(text) => text.clone(),
            value => value.to_string(),
        };
        let gone = was.keys().filter(|name| !is.contains_key(*name));
        let names = is.keys().chain(gone).map(String::as_str);
        let pairs = names.map(|name| (name, of(&was, name), of(&is, name)));
        let others = pairs.filter(|(_, was, is)| was != is);
        let told = |(name, was, is): (&str, String, String)| {
            let text = format!("{name} was {was}, is {is}");
            (name.to_owned(), text)
        };
        others.map(told).collect()
    }

    /// Begins a folder, or goes on with it: what is there of other LDIs is removed, and `say` told so. What comes back
    /// is to be kept until the last of them is written: of another run's no file says what it was made with.
    ///
    /// # Errors
    /// Another run has begun and not ended; files that cannot be read, removed or written.
    pub(super) fn begin(
        &self,
        folder: &Path,
        say: impl FnOnce(String),
    ) -> anyhow::Result<Option<File>> {
        make_parent(&folder.join(FILE))?;
        let held = hold_now(folder).map_err(|Taken| {
            anyhow!(
                "{}: another `lumigraph ldis` is at work here; wait until it has ended, and try again",
                folder.display()
            )
        })?;
        let there = entries(folder)?;
        // Of a run that was killed as it wrote what it makes them of.
        remove(there.iter().filter(|file| is_unfinished(file)))?;
        let why = match self.find(folder)? {
            Found::Same => return Ok(held),
            Found::Other(how) => Some(how),
            Found::None => None,
        };
        let old: Vec<&PathBuf> = there.iter().filter(|file| is_ldi(file)).collect();
        if let Some(why) = why.filter(|_| !old.is_empty()) {
            say(format!("{} {why}; it is made anew", folder.display()));
        }
        remove(old)?;
        // Before any LDI: what lies there without it is of something else.
        write_file(
            &folder.join(FILE),
            &serde_json::to_vec_pretty(self).context(FILE)?,
        )?;
        Ok(held)
    }
}

/// The folder of LDIs that a walk can read, if there is one; `say` is told why those that are there
/// cannot be. `made` tells what the walk would make, which takes a while, and is asked where some were made.
pub(super) fn usable(
    file: &Path,
    made: impl FnOnce() -> anyhow::Result<Made>,
    say: impl FnOnce(String),
) -> anyhow::Result<Option<PathBuf>> {
    let folder = folder_of(file).join(FOLDER);
    let there = std::fs::metadata(folder.join(FILE));
    let found = match there.is_err_and(|error| error.kind() == ErrorKind::NotFound) {
        true => unnamed(&folder)?,
        false => made()?.find(&folder)?,
    };
    Ok(match found {
        Found::None => None,
        Found::Same => Some(folder),
        Found::Other(how) => {
            let folder = folder.display();
            say(format!(
                "{folder} {how}; make it again with `lumigraph ldis`"
            ));
            None
        }
    })
}

/// What a folder has where nothing says what it was made of.
fn unnamed(folder: &Path) -> anyhow::Result<Found> {
    let has_ldis = folder.is_dir() && entries(folder)?.iter().any(|file| is_ldi(file));
    Ok(match has_ldis {
        true => Found::Other(format!("has LDIs and no {FILE}")),
        false => Found::None,
    })
}

/// The folder that an interior's file is in.
pub(super) fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

/// What a folder holds besides LDIs and what says of what they were made: the first by name, or the folder where that
/// cannot be listed.
pub(super) fn beside_ldis(folder: &Path) -> Option<PathBuf> {
    let Ok(files) = entries(folder) else {
        return Some(folder.to_owned());
    };
    let is_own = |file: &Path| is_ldi(file) || is_unfinished(file) || file.ends_with(FILE);
    files.into_iter().filter(|file| !is_own(file)).min()
}

/// Removes files.
fn remove<'a>(files: impl IntoIterator<Item = &'a PathBuf>) -> anyhow::Result<()> {
    for file in files {
        let failed = || format!("{}: cannot be removed", file.display());
        std::fs::remove_file(file).with_context(failed)?;
    }
    Ok(())
}

fn entries(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let all = read_dir(folder).and_then(|all| all.map(|e| e.map(|e| e.path())).collect());
    all.with_context(|| format!("{}: cannot read", folder.display()))
}

/// What was written in place of the file that says of what LDIs were made, and not to its end: by this version, or an
/// earlier one.
fn is_unfinished(file: &Path) -> bool {
    let name = file.file_name().and_then(OsStr::to_str).unwrap_or_default();
    is_left_of(name, FILE) || name.strip_suffix(".tmp") == Some(FILE)
}

/// An LDI's file, or one that was not written to its end.
fn is_ldi(file: &Path) -> bool {
    let name = file.file_name().and_then(OsStr::to_str).unwrap_or_default();
    name.ends_with(".ldi") || name.ends_with(".ldi.part")
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_one_runs_until_it_ends() {
        let of = |size: u32| Made {
            version: VERSION,
            program: "1".to_owned(),
            options: Map::from_iter([("size".to_owned(), json!([size, size]))]),
            inputs: Vec::new(),
        };
        let home = tempfile::tempdir().unwrap();
        let folder = home.path().join("house/ldi");
        let begin = |size: u32| of(size).begin(&folder, |_| ());
        let held = begin(64).unwrap();
        if held.is_none() {
            eprintln!("SKIPPED: no folder can be held here");
            return;
        }
        for size in [64, 128] {
            let error = begin(size).unwrap_err().to_string();
            let said = format!("{}: another `lumigraph ldis` is at work", folder.display());
            assert!(error.starts_with(&said), "{error}");
            assert!(matches!(of(64).find(&folder), Ok(Found::Same)));
        }
        drop(held);
        begin(128).unwrap();
        assert!(matches!(of(128).find(&folder), Ok(Found::Same)));
    }
}
