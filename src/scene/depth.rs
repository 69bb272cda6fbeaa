//! Which depth maps found in a capture cannot be used, whether they are in the units of the
//! scene, and whether their largest value may be none.

use super::beside::{DEPTH_FOLDER, DEPTH_UNITS_PER_STEP};
use super::{ImportOptions, Photo, Scene, Warning};
use calibrate::{DepthAlong, Image, Lens};
use capture::{Beside, CaptureError, DepthMap, check_beside};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// So many depth maps, spread over the photos, tell for all.
const JUDGED: usize = 4;
/// Fewer sparse points tell nothing.
const ENOUGH: usize = 20;
/// Depths that are so many times another's are in other units. Maps and points may both be far off here and
/// there, but not half of them.
const OTHER_UNITS: f64 = 1.5;
/// Where more per cent of a map's pixels have the largest value, it may stand for an unknown depth: some sensors
/// write it so, and of depths that reach farther it is where they end.
const LARGEST_PERCENT: usize = 3;
/// Within this factor of a power of ten, that is meant.
const NEARLY: f64 = 1.1;

impl Scene {
    /// Takes from the photos the depth maps that cannot be used (of another size, of another kind, unreadable),
    /// and says so, where the photos' `home` has them by its folder's name alone: what nobody asked for ends
    /// nothing that does without. Those taken, by their photos' names.
    pub(super) fn pass_over_depth(
        &mut self,
        home: &Path,
        options: &ImportOptions,
        warnings: &mut Vec<Warning>,
    ) -> BTreeMap<String, PathBuf> {
        let mut passed_over = BTreeMap::new();
        if options.depth.is_some() {
            return passed_over;
        }
        let images = self.images_by_name();
        let reason = |photo: &Photo| {
            let map = photo.depth_map.as_ref()?;
            let camera = &self.reconstruction.cameras[&images[photo.name.as_str()].camera_id];
            let size = (camera.width, camera.height);
            check_beside(Beside::DepthMap, map, &photo.name, size).err()
        };
        let reasons: Vec<Option<CaptureError>> = self.photos.iter().map(reason).collect();
        let found = self.photos.iter().filter(|p| p.depth_map.is_some()).count();
        for (photo, reason) in self.photos.iter_mut().zip(&reasons) {
            if reason.is_some() {
                photo.depth_scale = None;
                let map = photo.depth_map.take();
                passed_over.extend(map.map(|map| (photo.name.clone(), map)));
            }
        }
        if let Some(reason) = reasons.iter().flatten().next() {
            warnings.push(Warning::Note(format!(
                "{}: {} of {found} depth maps are not used, for one: {reason}; --no-depth leaves all of them out",
                home.join(DEPTH_FOLDER).display(),
                passed_over.len(),
            )));
        }
        passed_over
    }

    /// Says so where depth maps are in other units than the sparse points that are seen in their photos: a
    /// scale that is wrong moves all surfaces made of them, and nothing else tells. Says, too, where maps have
    /// the largest value so often that it may be no depth.
    pub(super) fn judge_depth(&self, warnings: &mut Vec<Warning>) {
        let with_maps: Vec<&Photo> = self
            .photos
            .iter()
            .filter(|p| p.depth_map.is_some())
            .collect();
        let images = self.images_by_name();
        let step = with_maps.len().div_ceil(JUDGED).max(1);
        let mut ratios: Vec<f64> = Vec::new();
        let mut judged = 0;
        let mut at_largest: Vec<&Photo> = Vec::new();
        for photo in with_maps.iter().copied().step_by(step) {
            let image = images[photo.name.as_str()];
            let camera = &self.reconstruction.cameras[&image.camera_id];
            // What is wrong with a map is said when it is needed.
            let Ok(Some(map)) = photo.decode_depth((camera.width, camera.height)) else {
                continue;
            };
            let Ok(lens) = camera.lens() else {
                continue;
            };
            judged += 1;
            if is_often_largest(&map, scale_of(photo)) {
                at_largest.push(photo);
            }
            ratios.extend(self.depths_over_points(&map, image, &lens));
        }
        warnings.extend(note_of_largest(&at_largest, judged, with_maps.len()));
        if ratios.len() < ENOUGH {
            return;
        }
        let middle = ratios.len() / 2;
        let (_, ratio, _) = ratios.select_nth_unstable_by(middle, f64::total_cmp);
        let ratio = *ratio;
        if (1.0 / OTHER_UNITS..=OTHER_UNITS).contains(&ratio) {
            return;
        }
        let meant = rounded(scale_of(with_maps[0]) / ratio);
        warnings.push(Warning::Note(format!(
            "the depth maps' depths are {} times those of the sparse points in their photos (median of {} points): \
             were they not meant, --depth-scale {meant} makes them agree",
            rounded(ratio),
            ratios.len(),
        )));
    }

    /// What a photo's map says, over how deep the sparse points are that were observed there.
    fn depths_over_points(&self, map: &DepthMap, image: &Image, lens: &Lens) -> Vec<f64> {
        let along = DepthAlong::of(lens, map.width, map.height);
        let ratio = |keypoint: &calibrate::Keypoint| {
            let point = self.reconstruction.points.get(&keypoint.point?)?;
            let depth = along.depth(image.camera_from_world * point.position);
            let is_within = |at: f64, side: u32| at >= 0.0 && at < f64::from(side);
            let is_seen = is_within(keypoint.x, map.width) && is_within(keypoint.y, map.height);
            let measured = is_seen.then(|| map.at(keypoint.x as u32, keypoint.y as u32))??;
            let ratio = f64::from(measured) / depth;
            (ratio > 0.0 && ratio.is_finite()).then_some(ratio)
        };
        image.keypoints.iter().filter_map(ratio).collect()
    }
}

/// World units a step of a photo's depth map.
fn scale_of(photo: &Photo) -> f64 {
    photo.depth_scale.unwrap_or(DEPTH_UNITS_PER_STEP)
}

/// The largest depth that a map in steps of so many world units can say, in world units.
fn largest(units_per_step: f64) -> f32 {
    (f64::from(u16::MAX) * units_per_step) as f32
}

/// Whether a map has the largest value in more than [`LARGEST_PERCENT`] of its pixels.
fn is_often_largest(map: &DepthMap, units_per_step: f64) -> bool {
    let largest = largest(units_per_step);
    let is_it = |depth: &&f32| **depth > 0.0 && **depth >= largest;
    let count = map.depths.iter().filter(is_it).count();
    100 * count > LARGEST_PERCENT * map.depths.len()
}

/// What to say of photos whose maps often have the largest value, if there are any among those `judged`, of all
/// that there are.
fn note_of_largest(photos: &[&Photo], judged: usize, total: usize) -> Option<Warning> {
    let first = photos.first()?;
    let file = first.depth_map.as_ref()?;
    Some(Warning::Note(format!(
        "{}: more than {LARGEST_PERCENT} % of the depth map's pixels are {}, the largest value of 16 bits, as in {} \
         of {judged} depth maps looked at, of {total}: it counts as a depth of {} world units; where the depth is \
         unknown write 0",
        file.display(),
        u16::MAX,
        photos.len(),
        largest(scale_of(first)),
    )))
}

/// The power of ten that is nearly as much, else two digits.
fn rounded(value: f64) -> f64 {
    let digits = |value: f64, decimals: usize| -> f64 {
        let text = format!("{value:.decimals$e}");
        text.parse().expect("a number as it was written")
    };
    let power = digits(10_f64.powf(value.log10().round()), 0);
    match (value / power).max(power / value) <= NEARLY {
        true => power,
        false => digits(value, 1),
    }
}

#[cfg(test)]
mod tests {
    use super::rounded;

    #[test]
    fn scales_are_told_as_they_are_meant() {
        let told = [0.001_03, 980.0, 0.000_254, 39.4, 1e-300].map(rounded);
        assert_eq!(told, [0.001, 1000.0, 0.000_25, 39.0, 1e-300]);
    }
}
