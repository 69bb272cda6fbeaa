use super::error::io_error;
use super::log::{self, Found};
use super::program::MODELS;
use super::{RunError, Step};
use crate::Reconstruction;
use crate::colmap::read_model;
use capture::PhotoSet;
use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

/// Features that a photo needs: COLMAP takes no notice of pairs with fewer matches.
const FEWEST_FEATURES: usize = 15;

/// What COLMAP made of the photos.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The folder of the largest model: the one with the most photos.
    pub model: PathBuf,
    /// That model.
    pub reconstruction: Reconstruction,
    /// The photos that are not in it, by name.
    pub unplaced: Vec<Unplaced>,
}

/// A photo without a pose.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unplaced {
    /// The photo.
    pub name: String,
    /// Why it has none.
    pub why: Why,
}

/// Why a photo was not placed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Why {
    /// COLMAP cannot read it, and says so.
    Unreadable(String),
    /// It has only so many features.
    FewFeatures(usize),
    /// It is in another model, of so many photos, that nothing ties to the largest.
    OtherModel(usize),
    /// The mapper never saw enough matches to try.
    FewMatches,
    /// The mapper tried, but no place agrees with its matches.
    NoPlace,
    /// One of the last two: the logs do not tell which.
    Unknown,
}

impl fmt::Display for Why {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unreadable(problem) => write!(f, "COLMAP cannot use it: {problem}"),
            Self::FewFeatures(count) => write!(f, "only {count} features found in it"),
            Self::OtherModel(photos) => write!(
                f,
                "it is one of {photos} photos that match each other, but not the others"
            ),
            Self::FewMatches => f.write_str("too few matches with the photos that were placed"),
            Self::NoPlace => f.write_str("its matches agree on no place"),
            Self::Unknown => f.write_str("too few matches with the others, or none that agree"),
        }
    }
}

/// Reads the models and the logs of a finished run.
pub(super) fn read(photos: &PhotoSet, work: &Path) -> Result<Outcome, RunError> {
    let folder = work.join(MODELS);
    let mut models = models(&folder)?;
    if models.is_empty() {
        return Err(RunError::NoModel { folder });
    }
    let (reconstruction, model) = models.remove(0);
    let rest: Vec<Reconstruction> = models.into_iter().map(|(model, _)| model).collect();

    let said = |step: Step| fs::read_to_string(work.join(step.log())).unwrap_or_default();
    let reasons = Reasons::new(&said(Step::Features), &said(Step::Mapping), &reconstruction);
    let placed = |name: &str| reconstruction.images.values().any(|i| i.name == name);
    let names = photos.photos.iter().map(|photo| &photo.name);
    let unplaced = names.filter(|name| !placed(name)).map(|name| Unplaced {
        name: name.clone(),
        why: reasons.of(name, &rest),
    });
    Ok(Outcome {
        unplaced: unplaced.collect(),
        model,
        reconstruction,
    })
}

/// The models in a folder, each in one of its own: the largest first, of equal ones by name.
fn models(folder: &Path) -> Result<Vec<(Reconstruction, PathBuf)>, RunError> {
    let mut folders = Vec::new();
    for entry in fs::read_dir(folder).map_err(io_error(folder, "list the folder"))? {
        let path = entry.map_err(io_error(folder, "list the folder"))?.path();
        if path.is_dir() {
            folders.push(path);
        }
    }
    folders.sort();
    let mut models = Vec::new();
    for path in folders {
        models.push((read_model(&path)?, path));
    }
    models.sort_by_key(|(model, _)| Reverse(size_of(model)));
    Ok(models)
}

/// Photos and points of the largest model in a folder; none where there is none.
pub(super) fn size(folder: &Path) -> Result<(usize, usize), RunError> {
    Ok(models(folder)?.first().map_or((0, 0), |(m, _)| size_of(m)))
}

fn size_of(model: &Reconstruction) -> (usize, usize) {
    (model.images.len(), model.points.len())
}

/// What the logs say.
struct Reasons {
    found: BTreeMap<String, Found>,
    /// Whether the mapper tried to place a photo; `None` where ids and names do not fit.
    tried: Option<BTreeMap<String, bool>>,
}

impl Reasons {
    fn new(features_log: &str, mapping_log: &str, model: &Reconstruction) -> Self {
        let features = log::features(features_log);
        let is_stored = |(_, found): &&(String, Found)| matches!(found, Found::Features(_));
        let names: Vec<&String> = features.iter().filter(is_stored).map(|(n, _)| n).collect();
        // The log has names and the mapper ids. We know how COLMAP counts; the model tells
        // whether this one did so.
        let fits = model
            .images
            .iter()
            .all(|(id, image)| names.get((id.0 as usize).wrapping_sub(1)) == Some(&&image.name));
        let tried = log::tried(mapping_log);
        let is_tried = |(i, name): (usize, &&String)| {
            let id = i as u32 + 1;
            ((*name).clone(), tried.contains(&id))
        };
        Self {
            tried: fits.then(|| names.iter().enumerate().map(is_tried).collect()),
            found: features.into_iter().collect(),
        }
    }

    fn of(&self, name: &str, other_models: &[Reconstruction]) -> Why {
        match self.found.get(name) {
            Some(Found::Error(problem)) => return Why::Unreadable(problem.clone()),
            Some(&Found::Features(count)) if count < FEWEST_FEATURES => {
                return Why::FewFeatures(count);
            }
            _ => {}
        }
        let holds = |model: &&Reconstruction| model.images.values().any(|i| i.name == name);
        if let Some(other) = other_models.iter().find(holds) {
            return Why::OtherModel(other.images.len());
        }
        match self.tried.as_ref().and_then(|tried| tried.get(name)) {
            Some(true) => Why::NoPlace,
            Some(false) => Why::FewMatches,
            None => Why::Unknown,
        }
    }
}
