//! Photos that are to be shown turned, as cameras that were held upright or upside down write beside them: their
//! pixels are used as stored. COLMAP and the other programs calibrate those; OpenCV turns photos as it reads them, and
//! cameras that it calibrated are turned back.

use super::{Photo, Scene, SceneError, Warning};
use calibrate::{Camera, CameraId, Pixel, Reconstruction, Rigid3};
use capture::{Exif, photo_size, quarters_of};
use glam::{DQuat, DVec2, DVec3};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::FRAC_PI_2;
use std::path::Path;

/// Of which pixels of a photo a calibration speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pixels {
    /// As they are stored.
    Stored,
    /// As they are shown, by the photo's EXIF data.
    Shown {
        /// Whether the calibration says how large its pictures are.
        is_sized: bool,
    },
}

/// Says which photos are stored turned or mirrored, for people; `None` where none is known to be.
pub(super) fn text(photos: &[Photo]) -> Option<String> {
    let of = |photo: &Photo| Some((photo.name.clone(), photo.orientation?));
    let mut turned = photos.iter().filter_map(of);
    let (name, orientation) = turned.next()?;
    let count = 1 + turned.count();
    Some(format!(
        "{count} of {} photos are stored turned or mirrored (EXIF orientation; {orientation} in {name}, for one)",
        photos.len()
    ))
}

/// The same, with what comes of it.
pub(super) fn note(photos: &[Photo]) -> Option<Warning> {
    let text = text(photos)?;
    Some(Warning::Note(format!(
        "{text}: their pixels are used as stored, of which calibrations speak; paths derived from them and the \
         window stand upright as they do when they are shown turned"
    )))
}

/// Turns the cameras of photos that a calibration by OpenCV speaks of as they are shown, so that they see the pixels as
/// stored. Where its pictures have the size of the stored ones and not of the shown, or, without a size, a principal
/// point that is nearer to the stored ones' middle, it speaks of those already.
///
/// # Errors
/// A photo that is mirrored, or a lens that cannot be turned.
pub(super) fn undo(
    scene: &mut Scene,
    file: &Path,
    is_sized: bool,
) -> Result<Option<Warning>, SceneError> {
    let Some(text) = text(&scene.photos) else {
        return Ok(None);
    };
    let photos = scene.photos.iter();
    let photos: BTreeMap<&str, &Photo> = photos.map(|photo| (photo.name.as_str(), photo)).collect();
    let Reconstruction {
        cameras, images, ..
    } = &mut scene.reconstruction;
    let mut made: BTreeMap<(CameraId, u8, (u32, u32)), CameraId> = BTreeMap::new();
    for image in images.values_mut() {
        let Some(&photo) = photos.get(image.name.as_str()) else {
            continue;
        };
        // What is wrong with a photo is told when it is left out.
        let (Some(orientation), Ok(stored)) = (photo.orientation, photo_size(&photo.path)) else {
            continue;
        };
        let quarters = quarters_of(orientation);
        let shown = match quarters % 2 {
            0 => stored,
            _ => (stored.1, stored.0),
        };
        let camera = &cameras[&image.camera_id];
        let lens = camera.lens().map_err(|source| SceneError::Camera {
            name: photo.name.clone(),
            source,
        })?;
        let off = |(width, height): (u32, u32)| {
            let middle = DVec2::new(f64::from(width), f64::from(height)) / 2.0;
            lens.principal.distance(middle)
        };
        let is_of_shown = if is_sized {
            (camera.width, camera.height) == shown
        } else {
            off(shown) <= off(stored)
        };
        if !is_of_shown {
            continue;
        }

        let refuse = |problem: &'static str| SceneError::Turned {
            photo: photo.path.clone(),
            orientation,
            problem,
            file: file.to_owned(),
        };
        if [2, 4, 5, 7].contains(&orientation) {
            return Err(refuse("no camera here is mirrored"));
        }
        let back = (4 - quarters) % 4;
        let turned = lens.turned(back, shown);
        let turned = turned.ok_or_else(|| refuse("its lens cannot be turned by a quarter"))?;
        let next = cameras.keys().next_back().map_or(1, |id| id.0 + 1);
        let key = (image.camera_id, back, stored);
        let id = *made.entry(key).or_insert_with(|| {
            let id = CameraId(next);
            cameras.insert(id, Camera::of(&turned, stored.0, stored.1));
            id
        });
        image.camera_id = id;
        let turn = Rigid3 {
            rotation: DQuat::from_rotation_z(FRAC_PI_2 * f64::from(back)),
            translation: DVec3::ZERO,
        };
        image.camera_from_world = turn * image.camera_from_world;
        for keypoint in &mut image.keypoints {
            let pixel = Pixel::new(keypoint.x, keypoint.y).turned(back, shown);
            (keypoint.x, keypoint.y) = (pixel.x, pixel.y);
        }
    }
    if made.is_empty() {
        return Ok(note(&scene.photos));
    }
    let used: BTreeSet<CameraId> = images.values().map(|image| image.camera_id).collect();
    cameras.retain(|id, _| used.contains(id));
    Ok(Some(Warning::Note(format!(
        "{text}: OpenCV reads them as they are shown, so {} is taken to speak of them so, and their cameras are turned \
         to see the pixels as stored; if it speaks of those, write `ignore_orientation: 1` into it",
        file.display()
    ))))
}

/// Lets photos know how they are stored, as cameras wrote into them.
pub(super) fn set(photos: &mut [Photo], taken: &[Exif]) {
    for (photo, exif) in photos.iter_mut().zip(taken) {
        photo.orientation = exif.orientation.filter(|orientation| *orientation != 1);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::wall;
    use super::*;

    #[test]
    fn photos_that_are_stored_turned_are_counted_and_one_is_named() {
        let (_folder, capture) = wall(3, 1);
        let (scene, _) = Scene::open(&capture, false).unwrap();
        let said = |orientations: &[Option<u8>]| {
            let of = |orientation: &Option<u8>| Exif {
                orientation: *orientation,
                ..Exif::default()
            };
            let taken: Vec<Exif> = orientations.iter().map(of).collect();
            let mut photos = scene.photos.clone();
            set(&mut photos, &taken);
            text(&photos)
        };
        assert_eq!(said(&[]), None);
        assert_eq!(said(&[None, Some(1), None]), None);
        assert_eq!(
            said(&[Some(1), Some(8), Some(6)]).unwrap(),
            "2 of 3 photos are stored turned or mirrored (EXIF orientation; 8 in 0001.png, for one)"
        );
    }
}
