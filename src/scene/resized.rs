//! Photos that were reduced or enlarged after they were calibrated, as `images_4` beside `images`: their cameras follow.

use super::{Scene, SceneError, Warning};
use calibrate::ImageId;
use capture::photo_size;
use std::collections::BTreeMap;

/// Sides are rounded to whole pixels, by whatever rule.
const ROUNDED_PX: f64 = 1.0;
/// What differs by a smaller share may have been cut off as well.
const LEAST: f64 = 0.02;
/// Of smaller pictures nothing tells that they are the same.
const SMALLEST_PX: u32 = 16;

/// Scales the cameras of photos whose sides all have another length than was calibrated, by the same ratio.
pub(super) fn follow(scene: &mut Scene) -> Result<Warning, SceneError> {
    // 1. Which they are.
    let photos = scene.photos.iter();
    let paths: BTreeMap<&str, _> = photos.map(|p| (p.name.as_str(), &p.path)).collect();
    let whole = &scene.reconstruction;
    let mut sizes: BTreeMap<ImageId, (u32, u32)> = BTreeMap::new();
    let mut example: Option<(&str, [(u32, u32); 2])> = None;
    for (id, image) in &whole.images {
        let camera = &whole.cameras[&image.camera_id];
        let calibrated = (camera.width, camera.height);
        // What is wrong with a photo is told when it is left out.
        let path = paths.get(image.name.as_str());
        let Some(found) = path.and_then(|path| photo_size(path).ok()) else {
            continue;
        };
        if is_resized(found, calibrated) {
            sizes.insert(*id, found);
            if example.is_none_or(|(name, _)| image.name.as_str() < name) {
                example = Some((&image.name, [found, calibrated]));
            }
        }
    }
    let Some((name, [found, calibrated])) = example else {
        let note =
            "no photo was reduced or enlarged since it was calibrated: --resized changes nothing";
        return Ok(Warning::Note(note.to_owned()));
    };
    let note = format!(
        "{} of {} photos were reduced or enlarged since they were calibrated ({name} has {} × {} pixels for {} × {}, for \
         one): their cameras are scaled to them",
        sizes.len(),
        scene.photos.len(),
        found.0,
        found.1,
        calibrated.0,
        calibrated.1
    );

    // 2. Their cameras.
    let resized = scene.reconstruction.resize_images(&sizes);
    resized.map_err(|(id, source)| SceneError::Camera {
        name: scene.reconstruction.images[&id].name.clone(),
        source,
    })?;
    Ok(Warning::Note(note))
}

/// Whether pictures of one size are those of another, stretched alike in both directions.
pub(super) fn is_resized(found: (u32, u32), calibrated: (u32, u32)) -> bool {
    let sides = [(found.0, calibrated.0), (found.1, calibrated.1)];
    let sides = sides.map(|(found, calibrated)| [found, calibrated].map(f64::from));
    // Ratios that either side may have been multiplied by.
    let [across, down] = sides.map(|[found, calibrated]| {
        [found - ROUNDED_PX, found + ROUNDED_PX].map(|found| found / calibrated)
    });
    let differs = |[found, calibrated]: [f64; 2]| (found / calibrated - 1.0).abs() > LEAST;
    found.0.min(found.1) >= SMALLEST_PX
        && sides.into_iter().all(differs)
        && across[0].max(down[0]) <= across[1].min(down[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_stretched_alike_is_told_from_what_is_cut_or_turned() {
        // Halves and quarters, rounded down, up or to the nearest; enlarged.
        for (found, calibrated) in [
            ((160, 120), (320, 240)),
            ((1297, 840), (5187, 3361)),
            ((1296, 840), (5187, 3361)),
            ((1297, 841), (5187, 3361)),
            ((648, 420), (5187, 3361)),
            ((2000, 1500), (1000, 750)),
            ((1000, 751), (1920, 1442)),
        ] {
            assert!(is_resized(found, calibrated), "{found:?} {calibrated:?}");
        }
        for (found, calibrated) in [
            ((160, 120), (160, 120)),
            ((160, 120), (161, 120)),
            ((159, 119), (160, 120)),
            ((240, 320), (320, 240)),
            ((160, 240), (320, 240)),
            ((300, 200), (320, 240)),
            ((1280, 720), (1280, 960)),
            ((4, 3), (320, 240)),
            ((1, 1), (320, 240)),
        ] {
            assert!(!is_resized(found, calibrated), "{found:?} {calibrated:?}");
        }
    }
}
