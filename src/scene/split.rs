//! Held-out photos: `split.json`, `{"test": ["a.jpg", …]}`.

use super::{Scene, SceneError};
use capture::without_byte_order_mark;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The photos held out where nobody says which.
const EVERY: usize = 8;

/// The file.
#[derive(Clone, Debug, Deserialize)]
pub struct SplitFile {
    /// The names of the photos that are held out.
    pub test: Vec<String>,
}

impl SplitFile {
    /// Reads the content of a file; `path` is only named in errors.
    ///
    /// # Errors
    /// It is not the JSON that was expected, or names no photo.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, SceneError> {
        let text = without_byte_order_mark(bytes);
        let split: Self = serde_json::from_slice(text).map_err(|source| SceneError::Json {
            path: path.to_owned(),
            expected: "a split, {\"test\": [\"a.jpg\", …]}",
            source,
        })?;
        if split.test.is_empty() {
            return Err(SceneError::EmptySplit(path.to_owned()));
        }
        Ok(split)
    }
}

fn read(split: &Path) -> Result<SplitFile, SceneError> {
    let bytes = std::fs::read(split).map_err(|source| SceneError::Io {
        path: split.to_owned(),
        doing: "read the split",
        source,
    })?;
    SplitFile::parse(split, &bytes)
}

/// What a split says of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Split {
    /// The photos that it holds out.
    pub held_out: BTreeSet<String>,
    /// Those that it names and the scene had to leave out anyway.
    pub left_out: Vec<String>,
}

impl Scene {
    /// The photos that a split file holds out. Those that this scene had to leave out
    /// anyway are passed over.
    ///
    /// # Errors
    /// The file cannot be read, names no photo, or names one the scene does not have.
    pub fn held_out(&self, split: &Path) -> Result<BTreeSet<String>, SceneError> {
        Ok(self.split(split)?.held_out)
    }

    /// What a split file says of this scene.
    fn split(&self, split: &Path) -> Result<Split, SceneError> {
        let read = read(split)?;
        // Splits speak of the photos as the capture calls them.
        let renamed = self.renamed();
        let known: BTreeSet<&str> = self.photos.iter().map(|p| p.name.as_str()).collect();
        let (here, not_here): (BTreeSet<String>, BTreeSet<String>) = read
            .test
            .into_iter()
            .map(|name| match renamed.get(name.as_str()) {
                Some(here) => (*here).to_owned(),
                None => name,
            })
            .partition(|name| known.contains(name.as_str()));
        let (left_out, unknown): (Vec<String>, Vec<String>) = not_here
            .into_iter()
            .partition(|name| self.left_out.contains(name));
        if !unknown.is_empty() {
            return Err(SceneError::UnknownHeldOut {
                path: split.to_owned(),
                names: unknown,
                known: self.names(),
            });
        }
        Ok(Split {
            held_out: here,
            left_out,
        })
    }

    /// The split file that came with the photos: in the scene's own folder, else in the
    /// capture's.
    pub fn own_split(&self) -> Option<PathBuf> {
        [&self.folder, &self.capture]
            .into_iter()
            .flatten()
            .map(|folder| folder.join("split.json"))
            .find(|path| path.is_file())
    }

    /// The capture's folder where it is not there any more, nor a split in the scene's own: that the capture may have had
    /// one nobody knows.
    pub fn lost_capture(&self) -> Option<&Path> {
        let capture = self.capture.as_deref().filter(|capture| !capture.exists());
        capture.filter(|_| self.own_split().is_none())
    }

    /// The photos to score where nobody says which: those of its own split, else every 8th by
    /// name.
    ///
    /// # Errors
    /// As [`Self::held_out`]; the split's photos are all missing or corrupt.
    pub fn held_out_by_default(&self) -> Result<BTreeSet<String>, SceneError> {
        match self.own_split() {
            Some(split) => Ok(self.held_out_some(&split)?.held_out),
            None => Ok(self.every(EVERY)),
        }
    }

    /// What a split file says that holds out one photo at least.
    ///
    /// # Errors
    /// As [`Self::held_out`]; its photos are all missing or corrupt.
    pub fn held_out_some(&self, split: &Path) -> Result<Split, SceneError> {
        let found = self.split(split)?;
        if found.held_out.is_empty() {
            return Err(SceneError::UnusableSplit(split.to_owned()));
        }
        Ok(found)
    }

    /// Every `step`-th photo by name, the first included.
    pub fn every(&self, step: usize) -> BTreeSet<String> {
        self.names().into_iter().step_by(step.max(1)).collect()
    }

    /// What this scene calls the photos that undistorting gave other names, by the capture's names.
    fn renamed(&self) -> BTreeMap<&str, &str> {
        let photos = self.photos.iter();
        let renamed = photos.filter_map(|p| Some((p.original.as_deref()?, p.name.as_str())));
        renamed.collect()
    }

    /// What this scene calls a photo that may be named as the capture calls it; the name as it is where no
    /// photo was renamed from it.
    pub fn name_here(&self, name: &str) -> String {
        let renamed = self.renamed();
        renamed.get(name).copied().unwrap_or(name).to_owned()
    }

    /// The photos' names, sorted.
    pub fn names(&self) -> Vec<String> {
        self.photos.iter().map(|p| p.name.clone()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::file::SceneFile;

    #[test]
    fn what_editors_put_before_text_is_passed_over() {
        let path = Path::new("a.json");
        let split = "\u{feff}{\"test\": [\"a.jpg\"]}";
        let split = SplitFile::parse(path, split.as_bytes()).unwrap();
        assert_eq!(split.test, ["a.jpg"]);
        let scene = "\u{feff}{\"version\": 1, \"photos\": [], \"model\": \"model\"}";
        let scene = SceneFile::parse(path, scene.as_bytes()).unwrap();
        assert_eq!(scene.model, "model");
    }
}
