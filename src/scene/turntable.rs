//! Photos of an object on a turntable, or from a circle around it: cameras from silhouettes
//! alone.

use super::meant::Meant;
use super::times::{Clues, set_times, taken};
use super::turned;
use super::{ImportOptions, Photo, Scene, SceneError, Warning, calibration};
use calibrate::{Camera, CameraId, Image, ImageId, ModelKind, Reconstruction, Rigid3};
use capture::{CaptureError, PhotoSet, number_in_name, photo_size};
use proxy::hull::{Silhouette, turntable};
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::path::Path;

/// Photos that cannot be decoded, and why.
type Unusable = Vec<(String, CaptureError)>;

const CAMERA: CameraId = CameraId(1);

impl Scene {
    /// Imports photos from a perfect circle around an object, so many degrees apart in the
    /// order of their names (numbers in them count as numbers), without a calibration: the
    /// cameras are those that fit the silhouettes best (see [`turntable`]). There are no
    /// points, and the unit of length is the cameras' distance from what they look at.
    ///
    /// Silhouettes are mattes, alpha, masks that keep little, or what stands before a plain
    /// background. A photo that is corrupt is left out and keeps its place on the circle.
    ///
    /// # Errors
    /// No photos, or not all of one size; a photo without a silhouette; silhouettes that fit
    /// no circle; as [`Scene::import`].
    pub fn import_turntable(
        capture: &Path,
        step_degrees: f64,
        options: &ImportOptions,
    ) -> Result<(Self, Vec<Warning>), SceneError> {
        let mut warnings = Vec::new();
        let found = Self::photos_of(capture)?;
        if let Ok(source) = calibration::find(capture, options, &mut Vec::new()) {
            warnings.push(Warning::Note(format!(
                "{} is not used: the cameras are a turntable's",
                source.text()
            )));
        }

        // 1. The photos, and what lies beside them, with cameras that only have a size yet.
        let names = in_order(&found);
        let size = common_size(&found, &names)?;
        let unposed = reconstruction(&names, |_| Rigid3::IDENTITY, size, 1.0);
        let mut scene = Self::of(unposed, capture, &found, &BTreeMap::new(), options);
        scene.settings.turntable_degrees = Some(step_degrees);
        let meant = Meant::default();
        let clues = Clues {
            capture,
            found: &found,
            meant: &meant,
            named: None,
        };
        let taken = taken(&scene.photos);
        let times = &options.times;
        set_times(&mut scene.photos, times, &taken, &clues, &mut warnings)?;
        turned::set(&mut scene.photos, &taken);
        let turned = turned::text(&scene.photos);
        warnings.extend(turned::note(&scene.photos));
        let gap = gap(&names);
        warnings.extend(gap.clone().map(Warning::Note));
        warnings.extend(scene.leave_out_unusable(options.strict, &BTreeMap::new())?);
        scene.find_beside(capture, &meant, options, &mut warnings)?;
        scene.forget_depth(&mut warnings);
        scene.check_beside()?;
        scene.judge_masks(options.masks.is_some(), &mut warnings);

        // 2. Their silhouettes; of photos that cannot be decoded, none.
        let (silhouettes, unusable) = scene.silhouettes(&names, size)?;
        warnings.extend(scene.leave_out(unusable, options.strict)?);

        // 3. The circle.
        let failed = |source| SceneError::Turntable {
            folder: found.root.clone(),
            source,
            turned,
            gap,
        };
        let circle = turntable(&silhouettes, step_degrees).map_err(failed)?;
        warnings.push(Warning::Note(format!(
            "the cameras are a turntable's: focal length {:.1} px, {:.1}° above what they look \
             at; silhouettes fit them within {:.2} px",
            circle.focal_px,
            circle.elevation.to_degrees(),
            circle.error_px
        )));
        let pose = |i: usize| circle.views[i].camera_from_world;
        let left_out = scene.left_out.iter().cloned().collect();
        scene.reconstruction = reconstruction(&names, pose, size, circle.focal_px);
        scene.reconstruction.remove_images(&left_out);
        Ok((scene, warnings))
    }

    /// Depth maps tell lengths in units that a turntable's world does not have.
    fn forget_depth(&mut self, warnings: &mut Vec<Warning>) {
        if self.photos.iter().any(|p| p.depth_map.is_some()) {
            warnings.push(Warning::Note(
                "the depth maps are not used: their units are not those of a turntable's \
                 cameras"
                    .to_owned(),
            ));
        }
        for photo in &mut self.photos {
            photo.depth_map = None;
            photo.depth_scale = None;
        }
    }

    /// The silhouettes of the photos of these names, empty for those that are left out or
    /// cannot be decoded; the latter with what is wrong.
    fn silhouettes(
        &self,
        names: &[String],
        size: (u32, u32),
    ) -> Result<(Vec<Silhouette>, Unusable), SceneError> {
        let photos: BTreeMap<&str, &Photo> =
            self.photos.iter().map(|p| (p.name.as_str(), p)).collect();
        let decoded: Vec<Option<Result<Silhouette, SceneError>>> = names
            .par_iter()
            .map(|name| Some(photos.get(name.as_str())?.decode_silhouette(size)))
            .collect();
        let pixels = size.0 as usize * size.1 as usize;
        let empty = Silhouette::new(size.0, size.1, vec![false; pixels]).expect("a value a pixel");
        let mut unusable = Vec::new();
        let mut silhouettes = Vec::new();
        for (name, decoded) in names.iter().zip(decoded) {
            silhouettes.push(match decoded {
                Some(Ok(silhouette)) => silhouette,
                Some(Err(SceneError::Capture(error))) => {
                    unusable.push((name.clone(), error));
                    empty.clone()
                }
                Some(Err(error)) => return Err(error),
                None => empty.clone(),
            });
        }
        Ok((silhouettes, unusable))
    }
}

/// The names of photos, numbers in them counting as numbers.
fn in_order(found: &PhotoSet) -> Vec<String> {
    let mut names: Vec<String> = found.photos.iter().map(|p| p.name.clone()).collect();
    names.sort_by(|a, b| by_numbers(a, b));
    names
}

/// The order of names in which the numbers within count as numbers: `2.jpg` before `10.jpg`.
pub(super) fn by_numbers(a: &str, b: &str) -> Ordering {
    let key = |name: &str| -> Vec<(String, usize, String)> {
        let is_digit = |c: char| c.is_ascii_digit();
        let mut parts = Vec::new();
        let mut rest = name;
        while !rest.is_empty() {
            let (text, after) = rest.split_at(rest.find(is_digit).unwrap_or(rest.len()));
            let end = after.find(|c| !is_digit(c)).unwrap_or(after.len());
            let (digits, after) = after.split_at(end);
            // Against other text a number counts as a digit.
            let text = format!("{text}{}", if digits.is_empty() { "" } else { "0" });
            let digits = digits.trim_start_matches('0');
            // Numbers of any length: the longer, then by digits.
            parts.push((text, digits.len(), digits.to_owned()));
            rest = after;
        }
        parts
    };
    key(a).cmp(&key(b)).then_with(|| a.cmp(b))
}

/// What to say where the numbers of photos tell that some are missing: most follow one another, and some do not.
fn gap(names: &[String]) -> Option<String> {
    let numbers = names.iter().map(|name| number_in_name(name));
    let numbers: Vec<(u64, (&str, &str))> = numbers.collect::<Option<_>>()?;
    let (_, around) = numbers.first()?;
    if numbers.iter().any(|(_, other)| other != around) {
        return None;
    }
    let step = |pair: &[(u64, (&str, &str))]| pair[1].0.saturating_sub(pair[0].0);
    let steps: Vec<u64> = numbers.windows(2).map(step).collect();
    let least = *steps.iter().min()?;
    let is_gap = |step: &u64| *step > least;
    let first = steps.iter().position(is_gap)?;
    let gaps = steps.iter().filter(|step| is_gap(step)).count();
    let is_rare = 2 * gaps < steps.len();
    is_rare.then(|| {
        format!(
            "{} is followed by {}: each photo counts as one step from the one before; an empty file called as each photo \
             that is missing keeps its place",
            names[first],
            names[first + 1]
        )
    })
}

/// The size that all photos have. Those that cannot be read have no say.
fn common_size(found: &PhotoSet, names: &[String]) -> Result<(u32, u32), SceneError> {
    let mut first: Option<(&String, (u32, u32))> = None;
    let mut failed = None;
    for name in names {
        let Some(photo) = found.find(name) else {
            continue;
        };
        match (photo_size(&photo.path), first) {
            (Ok(size), None) => first = Some((name, size)),
            (Ok(size), Some((other, expected))) if size != expected => {
                return Err(SceneError::TurntableSizes {
                    path: photo.path.clone(),
                    found: size,
                    other: other.clone(),
                    expected,
                });
            }
            (Ok(_), Some(_)) => {}
            (Err(error), _) => failed = failed.or(Some(error)),
        }
    }
    match (first, failed) {
        (Some((_, size)), _) => Ok(size),
        (None, Some(error)) => Err(error.into()),
        (None, None) => Err(SceneError::no_photos(&found.root)),
    }
}

/// Images of these names through one lens without distortion, its middle the photos'.
fn reconstruction(
    names: &[String],
    pose: impl Fn(usize) -> Rigid3,
    (width, height): (u32, u32),
    focal_px: f64,
) -> Reconstruction {
    let camera = Camera {
        model: ModelKind::SimplePinhole,
        width,
        height,
        params: vec![focal_px, 0.5 * f64::from(width), 0.5 * f64::from(height)],
    };
    let image = |(i, name): (usize, &String)| {
        let image = Image {
            name: name.clone(),
            camera_id: CAMERA,
            camera_from_world: pose(i),
            keypoints: Vec::new(),
        };
        (ImageId(i as u32 + 1), image)
    };
    Reconstruction {
        cameras: [(CAMERA, camera)].into(),
        images: names.iter().enumerate().map(image).collect(),
        points: BTreeMap::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_count_as_numbers() {
        let mut names = [
            "b2.png",
            "a10.png",
            "a9.png",
            "a09b1.png",
            "a.png",
            "a010.png",
        ];
        names.sort_by(|a, b| by_numbers(a, b));
        assert_eq!(
            names,
            [
                "a.png",
                "a9.png",
                "a09b1.png",
                "a010.png",
                "a10.png",
                "b2.png"
            ]
        );
    }
}
