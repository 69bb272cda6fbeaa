//! When the photos were taken: from a list, a frame rate, the calibration, the cameras or the names.

use super::meant::Meant;
use super::named::Named;
use super::{Photo, SceneError, Warning};
use capture::{Exif, PhotoSet, Times, from_earliest, number_in_name, read_exif, read_times};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Where photos' times come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum TimeSource {
    /// The capture's `times.csv`; without one what a `transforms.json` says of its frames, else
    /// what cameras wrote into the photos, or the photos' names if these tell more times.
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
    /// What the calibration says.
    pub(super) named: Option<&'a Named>,
}

/// What cameras wrote into photos, in their order; nothing of those that cannot be read.
pub(super) fn taken(photos: &[Photo]) -> Vec<Exif> {
    let read = photos.iter();
    read.map(|p| read_exif(&p.path).unwrap_or_default())
        .collect()
}

/// Gives the photos their times. Where some have none, a note says so: at a moment they take no part.
pub(super) fn set_times(
    photos: &mut [Photo],
    source: &TimeSource,
    taken: &[Exif],
    clues: &Clues<'_>,
    warnings: &mut Vec<Warning>,
) -> Result<(), SceneError> {
    let own = clues.capture.join(TIMES_FILE);
    let times: Times = match source {
        TimeSource::List(file) => from_list(photos, file, clues, warnings)?,
        TimeSource::Found if own.is_file() => from_list(photos, &own, clues, warnings)?,
        TimeSource::FrameRate(per_second) => from_numbers(photos, *per_second)?,
        TimeSource::Found => match from_calibration(photos, clues, warnings) {
            Some(times) => times,
            None => from_photos(photos, taken, warnings),
        },
    };
    for (photo, time_s) in photos.iter_mut().zip(times) {
        photo.time_s = time_s;
    }
    Ok(())
}

/// Those that the calibration says, unless it has one time for all.
fn from_calibration(
    photos: &[Photo],
    clues: &Clues<'_>,
    warnings: &mut Vec<Warning>,
) -> Option<Times> {
    let Named { file, beside } = clues.named?;
    let times: Times = photos
        .iter()
        .map(|p| beside.times.get(&p.name).copied())
        .collect();
    let known = || times.iter().flatten().copied();
    let (first, last) = (known().reduce(f64::min)?, known().reduce(f64::max)?);
    if first == last {
        return None;
    }
    let file = file.display().to_string();
    warnings.push(Warning::Note(format!(
        "{file} names times of the photos, from {first} to {last}, which are taken as seconds"
    )));
    warnings.extend(note_of_lack(photos, &times, &file));
    Some(times)
}

/// Those that cameras wrote into the photos, or their names if these tell more: more times that differ, or else of more
/// photos.
fn from_photos(photos: &[Photo], taken: &[Exif], warnings: &mut Vec<Warning>) -> Times {
    let names: Vec<&str> = photos.iter().map(|p| p.name.as_str()).collect();
    let by_name = capture::times_of_names(&names);
    let by_camera = from_earliest(taken.iter().map(|exif| exif.taken_s).collect());
    let told = |times: &Times| {
        let mut times: Vec<f64> = times.iter().flatten().copied().collect();
        let count = times.len();
        times.sort_by(f64::total_cmp);
        times.dedup();
        (times.len(), count)
    };
    let (times, told_by) = if told(&by_name) > told(&by_camera) {
        (by_name, "the photos' names")
    } else {
        (by_camera, "what cameras wrote into the photos")
    };
    if times.iter().any(Option::is_some) {
        warnings.extend(note_of_lack(photos, &times, told_by));
    }
    times
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
    let times: Times = photos.iter().map(time_of).collect();
    warnings.extend(note_of_lack(photos, &times, &file.display().to_string()));
    Ok(times)
}

/// What to say of photos that have no time where others have, if there are any; `told_by` is what has the others'.
fn note_of_lack(photos: &[Photo], times: &[Option<f64>], told_by: &str) -> Option<Warning> {
    let lacking = photos.iter().zip(times).filter(|(_, time)| time.is_none());
    let lacking: Vec<&str> = lacking.map(|(photo, _)| photo.name.as_str()).collect();
    let example = lacking.first()?;
    Some(Warning::Note(format!(
        "{told_by}: no time for {} of {} photos ({example}, for one): in views at a moment they take no part",
        lacking.len(),
        photos.len()
    )))
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

#[cfg(test)]
mod tests {
    use super::super::Scene;
    use super::super::tests::wall;
    use super::*;

    #[test]
    fn names_count_where_cameras_tell_fewer_times_that_differ() {
        let (_folder, capture) = wall(6, 1);
        let (scene, _) = Scene::open(&capture, false).unwrap();
        const THEN_S: f64 = 1_706_715_900.0;
        let found = |name: fn(usize) -> String, taken_s: fn(usize) -> f64| {
            let mut photos = scene.photos.clone();
            for (i, photo) in photos.iter_mut().enumerate() {
                photo.name = name(i);
            }
            let exif = |i: usize| Exif {
                taken_s: Some(THEN_S + taken_s(i)),
                ..Exif::default()
            };
            let taken: Vec<Exif> = (0..photos.len()).map(exif).collect();
            from_photos(&photos, &taken, &mut Vec::new())
        };
        let fifths: Times = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0].map(Some).to_vec();
        // Of a phone: seconds and milliseconds.
        let phone = |i: usize| format!("PXL_20240131_1500{:05}.png", 200 * i);
        let film = |i: usize| format!("shot_t{:.3}s.png", 0.2 * i as f64);
        let plain = |i: usize| format!("{i:04}.png");
        // 1. Whole seconds alone, or those of whatever wrote the files.
        assert_eq!(found(phone, |i| (i / 5) as f64), fifths);
        assert_eq!(found(film, |_| 0.0), fifths);
        // 2. As many: the camera's.
        let steps: Times = (0..6).map(|i| Some(3.0 * i as f64)).collect();
        assert_eq!(found(film, |i| 3.0 * i as f64), steps);
        // 3. Fractions are those that were written.
        assert_eq!(found(plain, |i| 0.2 * i as f64), fifths);
        assert_eq!(found(plain, |_| 0.0), [Some(0.0); 6]);
    }
}
