//! When the photos were taken: from a list, a frame rate, the cameras or the names.

use super::meant::Meant;
use super::{Photo, SceneError, Warning};
use capture::{PhotoSet, Times, from_earliest, number_in_name, read_exif, read_times};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Where photos' times come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum TimeSource {
    /// The capture's `times.csv`; without one what cameras wrote into the photos, or the
    /// photos' names if these tell more times.
    #[default]
    Found,
    /// A list, `name,seconds` a line.
    List(PathBuf),
    /// Frames a second: the last number in a photo's name counts them.
    FrameRate(f64),
}

/// The list that is looked for in a capture's folder.
const TIMES_FILE: &str = "times.csv";

/// Where a capture's times may be.
pub(super) struct Clues<'a> {
    pub(super) capture: &'a Path,
    /// All photos there are, calibrated or not: a list may name those as well.
    pub(super) found: &'a PhotoSet,
    /// Those that the calibration calls otherwise: a list may have either name.
    pub(super) meant: &'a Meant,
}

/// Gives the photos their times. Where a list lacks some, a note says so: at a moment they take no part.
pub(super) fn set_times(
    photos: &mut [Photo],
    source: &TimeSource,
    clues: &Clues<'_>,
    warnings: &mut Vec<Warning>,
) -> Result<(), SceneError> {
    let own = clues.capture.join(TIMES_FILE);
    let times: Times = match source {
        TimeSource::List(file) => from_list(photos, file, clues, warnings)?,
        TimeSource::Found if own.is_file() => from_list(photos, &own, clues, warnings)?,
        TimeSource::FrameRate(per_second) => from_numbers(photos, *per_second)?,
        TimeSource::Found => {
            let names: Vec<&str> = photos.iter().map(|p| p.name.as_str()).collect();
            let by_name = capture::times_of_names(&names);
            let by_camera = photos
                .iter()
                .map(|p| read_exif(&p.path).ok()?.taken_s)
                .collect();
            let by_camera = from_earliest(by_camera);
            let count = |times: &Times| times.iter().flatten().count();
            if count(&by_name) > count(&by_camera) {
                by_name
            } else {
                by_camera
            }
        }
    };
    for (photo, time_s) in photos.iter_mut().zip(times) {
        photo.time_s = time_s;
    }
    Ok(())
}

fn from_list(
    photos: &[Photo],
    file: &Path,
    clues: &Clues<'_>,
    warnings: &mut Vec<Warning>,
) -> Result<Times, SceneError> {
    let names: BTreeSet<&str> = photos.iter().map(|p| p.name.as_str()).collect();
    let is_photo = |name: &str| clues.found.find(name).is_some() || names.contains(name);
    let listed = read_times(file, is_photo)?;
    let time_of = |photo: &Photo| {
        let by_name = listed.get(&photo.name);
        let by_file = || listed.get(&clues.meant.photos.get(&photo.name)?.name);
        by_name.or_else(by_file).copied()
    };
    let lacks = |photo: &&Photo| time_of(photo).is_none();
    if let Some(example) = photos.iter().find(lacks) {
        warnings.push(Warning::Note(format!(
            "{}: no time for {} of {} photos ({}, for one): in views at a moment they take no part",
            file.display(),
            photos.iter().filter(lacks).count(),
            photos.len(),
            example.name
        )));
    }
    Ok(photos.iter().map(time_of).collect())
}

/// Frames by the last number in their names, which must be all that differs between them.
fn from_numbers(photos: &[Photo], per_second: f64) -> Result<Times, SceneError> {
    let refuse = |problem: String| SceneError::FrameNumbers(problem);
    let mut around = None;
    let mut times = Vec::new();
    for Photo { name, .. } in photos {
        let Some((number, rest)) = number_in_name(name) else {
            return Err(refuse(format!("photo {name} has no number in its name")));
        };
        let first: &(_, &String) = around.get_or_insert((rest, name));
        if first.0 != rest {
            return Err(refuse(format!(
                "the names {} and {name} differ in more than their last number",
                first.1
            )));
        }
        times.push(Some(number as f64 / per_second));
    }
    Ok(times)
}
