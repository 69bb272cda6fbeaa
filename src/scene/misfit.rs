//! Whether a calibration fits its photos at all, and each of them.

use super::Warning;
use calibrate::{Image, Point3DId, Reconstruction, Reprojection, TRUSTED_TIE};
use std::collections::BTreeSet;
use std::ops::RangeInclusive;

/// Structure from motion misses what it measured by a pixel or less. What misses it by so many belongs to other
/// photos, or counts pixels another way than was read.
pub const DOUBTFUL_PX: f64 = 10.0;

/// Says so where sparse points are seen far from where the cameras have them: nothing else tells of poses whose
/// pixels, axes or lenses were taken for what they are not.
pub(super) fn of(whole: &Reconstruction) -> Option<Warning> {
    let median_px = whole.median_error_px()?;
    if median_px <= DOUBTFUL_PX {
        return None;
    }
    let (problem, doubtful) = if median_px.is_finite() {
        let problem = format!(
            "photos see the sparse points {median_px:.0} pixels (the median) from where the calibration has them"
        );
        (problem, "that the calibration belongs to these photos")
    } else {
        let (problem, doubtful) = nowhere(whole);
        (problem.to_owned(), doubtful)
    };
    Some(Warning::Note(format!(
        "{problem}: pictures will be wrong; check {doubtful}, or export it again in another format"
    )))
}

/// Where sparse points lie of which most project nowhere, and what to check then.
fn nowhere(whole: &Reconstruction) -> (&'static str, &'static str) {
    let has = |what: Reprojection| {
        let mut all = whole.cameras.keys().map(|id| whole.reprojections(*id));
        all.any(|camera| camera.is_ok_and(|camera| camera.contains(&what)))
    };
    match [Reprojection::Behind, Reprojection::BeyondLens].map(has) {
        [_, false] => (
            "most sparse points lie behind the cameras that see them",
            "that the calibration belongs to these photos",
        ),
        [false, true] => (
            "most sparse points lie beyond what the lenses of the cameras that see them map one to one",
            "the distortion coefficients",
        ),
        [true, true] => (
            "most sparse points lie behind the cameras that see them, or beyond what their lenses map one to one",
            "that the calibration belongs to these photos, and its distortion coefficients",
        ),
    }
}

/// The names of photos that see most of their own sparse points behind them, beyond what their lens sees, or so far
/// from where the calibration has them, while most photos do not; sorted. They are misplaced: an unaligned photo of a
/// model far from the world's origin has no pose, for one, and lies there. They are fewer than the others.
pub(super) fn misplaced(whole: &Reconstruction) -> Vec<String> {
    // 1. What photos usually miss, by the upper of two: nothing says which of two photos is the wrong one.
    let errors_px = whole.median_errors_px(TRUSTED_TIE);
    let mut sorted: Vec<f64> = errors_px.values().copied().collect();
    sorted.sort_by(f64::total_cmp);
    let Some(usual_px) = sorted.get(sorted.len() / 2) else {
        return Vec::new();
    };
    // 2. Where all are a little off, some are by more.
    let limit_px = DOUBTFUL_PX * usual_px.max(1.0);
    let wrong = errors_px.iter().filter(|(_, px)| **px > limit_px);
    let mut names: Vec<String> = wrong.map(|(id, _)| whole.images[id].name.clone()).collect();
    names.sort();
    names
}

/// The sparse points that all photos observing them see behind them, beyond what their lens sees, or so far from where
/// the calibration has them, while photos usually do not: they are wrong, whatever observes them.
pub(super) fn contradicted(whole: &Reconstruction) -> BTreeSet<Point3DId> {
    match whole.median_error_px() {
        // Where all are a little off, some are by more.
        Some(usual_px) => whole.contradicted_points(DOUBTFUL_PX * usual_px.max(1.0)),
        None => BTreeSet::new(),
    }
}

/// Lengths that numbers of 32 bits, which pictures are drawn with, hold with room for squares' roots and quotients.
const HELD: RangeInclusive<f64> = 1e-30..=1e30;

/// Says so where photos were taken so far apart, or so near one another, that nothing can be drawn of them.
pub(super) fn of_extent(whole: &Reconstruction) -> Option<Warning> {
    let mut images = whole.images.values();
    let first = images.next()?;
    let center = first.camera_from_world.center();
    let away = images.map(|image| (image.camera_from_world.center().distance(center), image));
    let (farthest, image) = away.max_by(|a, b| a.0.total_cmp(&b.0))?;
    if farthest == 0.0 || HELD.contains(&farthest) {
        return None;
    }
    let (name, first) = (&image.name, &first.name);
    let problem = if farthest < 1.0 {
        format!("no photo is farther than {farthest:.0e} from {first}, {name} being the farthest")
    } else {
        format!("photo {name} is {farthest:.0e} from {first}")
    };
    Some(Warning::Note(format!(
        "{problem}, in the calibration's units: pictures are drawn in 32 bits, which hold {:e} to {:e}; scale the \
         calibration, or leave out what strays",
        HELD.start(),
        HELD.end()
    )))
}

/// Says so where a camera's principal point lies beside its photos by more than their size, as it does in no more
/// than tiles cut from far larger pictures.
pub(super) fn of_principal(whole: &Reconstruction) -> Option<Warning> {
    let is_far = |principal: f64, side: u32| {
        let side = f64::from(side);
        !(-side..=2.0 * side).contains(&principal)
    };
    let far = |image: &Image| {
        let camera = whole.cameras.get(&image.camera_id)?;
        let (principal, width, height) =
            (camera.lens().ok()?.principal, camera.width, camera.height);
        let beside = is_far(principal.x, width) || is_far(principal.y, height);
        beside.then_some((principal, width, height))
    };
    let mut images = whole.images.values();
    let (name, (principal, width, height)) =
        images.find_map(|image| Some((&image.name, far(image)?)))?;
    Some(Warning::Note(format!(
        "photo {name}: its principal point ({}, {}) is far beside its {width} × {height} pixels: unless it was cut \
         from a larger one, check the calibration's cx and cy",
        principal.x, principal.y
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Camera, CameraId, ImageId, Keypoint, ModelKind, Point3D, Rigid3};
    use glam::DVec3;

    /// A point in the middle of a photo, at a depth, seen by so many pixels to the right.
    fn seen(depth: f64, off_px: f64) -> Reconstruction {
        let mut whole = Reconstruction::default();
        let camera = Camera {
            model: ModelKind::SimplePinhole,
            width: 100,
            height: 100,
            params: vec![100.0, 50.0, 50.0],
        };
        let point = Point3D {
            position: DVec3::new(0.0, 0.0, depth),
            color: [0; 3],
            error_px: -1.0,
            track: vec![(ImageId(1), 0)],
        };
        let image = Image {
            name: "a.jpg".to_owned(),
            camera_id: CameraId(1),
            camera_from_world: Rigid3::IDENTITY,
            keypoints: vec![Keypoint {
                x: 50.0 + off_px,
                y: 50.0,
                point: Some(Point3DId(1)),
            }],
        };
        whole.cameras.insert(CameraId(1), camera);
        whole.points.insert(Point3DId(1), point);
        whole.images.insert(ImageId(1), image);
        whole
    }

    #[test]
    fn what_misses_by_tens_of_pixels_is_told() {
        assert_eq!(of(&seen(2.0, 9.0)), None);
        assert_eq!(of(&Reconstruction::default()), None);
        let note = of(&seen(2.0, 31.0)).unwrap().to_string();
        assert_eq!(
            note,
            "photos see the sparse points 31 pixels (the median) from where the calibration has \
             them: pictures will be wrong; check that the calibration belongs to these photos, or \
             export it again in another format"
        );
        let behind = of(&seen(-2.0, 0.0)).unwrap().to_string();
        assert!(
            behind.starts_with("most sparse points lie behind the cameras that see them: "),
            "{behind}"
        );
    }

    #[test]
    fn a_lens_that_folds_before_what_it_sees_is_told() {
        let mut folded = seen(2.0, 0.0);
        let camera = folded.cameras.get_mut(&CameraId(1)).unwrap();
        camera.model = ModelKind::SimpleRadial;
        camera.params.push(-30.0);
        let mut point = folded.points[&Point3DId(1)].clone();
        point.position.x = 1.0;
        folded.points.insert(Point3DId(1), point.clone());
        assert_eq!(
            of(&folded).unwrap().to_string(),
            "most sparse points lie beyond what the lenses of the cameras that see them map one to one: pictures \
             will be wrong; check the distortion coefficients, or export it again in another format"
        );
        // One of several is behind.
        point.position.z = -2.0;
        folded.points.insert(Point3DId(2), point);
        let image = folded.images.get_mut(&ImageId(1)).unwrap();
        let mut other = image.keypoints[0];
        other.point = Some(Point3DId(2));
        image.keypoints.push(other);
        let both = of(&folded).unwrap().to_string();
        assert!(
            both.starts_with(
                "most sparse points lie behind the cameras that see them, or beyond what"
            ),
            "{both}"
        );
    }

    /// Photos that each see the point in their middle so often, and miss it by so many pixels.
    fn photos(misses: &[(usize, f64)]) -> Reconstruction {
        let mut whole = seen(2.0, 0.0);
        let image = whole.images[&ImageId(1)].clone();
        whole.images.clear();
        for (i, (count, off_px)) in misses.iter().enumerate() {
            let mut one = image.clone();
            one.name = format!("{i}.jpg");
            one.keypoints = vec![image.keypoints[0]; *count];
            one.keypoints.iter_mut().for_each(|k| k.x += off_px);
            whole.images.insert(ImageId(i as u32), one);
        }
        whole
    }

    #[test]
    fn photos_that_miss_what_they_see_while_others_do_not_are_misplaced() {
        let mut whole = photos(&[0.5, 40.0, 1.0, 9.0, 0.1, 0.2, 0.3].map(|px| (20_usize, px)));
        assert_eq!(misplaced(&whole), ["1.jpg"]);
        // Turned away from it.
        let away = glam::DQuat::from_rotation_y(std::f64::consts::PI);
        let turned = whole.images.get_mut(&ImageId(4)).unwrap();
        turned.camera_from_world.rotation = away;
        assert_eq!(misplaced(&whole), ["1.jpg", "4.jpg"]);
        // Too few observations say nothing.
        assert!(misplaced(&photos(&[(20, 0.5), (5, 40.0), (20, 1.0)])).is_empty());
        // Nor do two photos say which is wrong, nor such as are all off.
        assert!(misplaced(&photos(&[(20, 0.5), (20, 40.0)])).is_empty());
        assert!(misplaced(&photos(&[(20, 30.0), (20, 40.0), (20, 25.0)])).is_empty());
        assert!(misplaced(&Reconstruction::default()).is_empty());
    }

    #[test]
    fn points_that_all_their_photos_miss_while_others_do_not_are_contradicted() {
        let mut whole = photos(&[(20, 0.5), (20, 0.1)]);
        assert!(contradicted(&whole).is_empty());
        let mut stray = whole.points[&Point3DId(1)].clone();
        stray.track = vec![(ImageId(0), 0)];
        whole.points.insert(Point3DId(2), stray);
        for (off_px, expected) in [(9.0, 0), (11.0, 1)] {
            let image = whole.images.get_mut(&ImageId(0)).unwrap();
            image.keypoints[0].x = 50.0 + off_px;
            image.keypoints[0].point = Some(Point3DId(2));
            assert_eq!(contradicted(&whole).len(), expected);
        }
        // Where most observations miss as much, that says nothing of a point.
        for all_off in [seen(2.0, 31.0), seen(-2.0, 0.0), Reconstruction::default()] {
            assert!(contradicted(&all_off).is_empty());
        }
    }

    #[test]
    fn a_principal_point_far_beside_the_photo_is_told() {
        let at = |x: f64, y: f64| {
            let mut whole = seen(2.0, 0.0);
            whole
                .cameras
                .values_mut()
                .for_each(|c| c.params[1..].copy_from_slice(&[x, y]));
            of_principal(&whole)
        };
        assert_eq!(at(50.0, 50.0), None);
        assert_eq!(at(-100.0, 200.0), None);
        let note = at(5000.0, -900.0).unwrap().to_string();
        assert_eq!(
            note,
            "photo a.jpg: its principal point (5000, -900) is far beside its 100 × 100 pixels: unless it was cut \
             from a larger one, check the calibration's cx and cy"
        );
    }

    #[test]
    fn photos_beyond_what_is_drawn_are_told() {
        let two = |apart: f64| {
            let mut whole = seen(2.0, 0.0);
            let mut image = whole.images[&ImageId(1)].clone();
            image.name = "b.jpg".to_owned();
            image.camera_from_world.translation = DVec3::new(-apart, 0.0, 0.0);
            whole.images.insert(ImageId(2), image);
            of_extent(&whole).map(|note| note.to_string())
        };
        assert_eq!(of_extent(&seen(2.0, 0.0)), None);
        for apart in [0.0, 1e-30, 1.0, 1e30] {
            assert_eq!(two(apart), None);
        }
        let far = two(1e39).unwrap();
        assert!(
            far.starts_with("photo b.jpg is 1e39 from a.jpg, in the"),
            "{far}"
        );
        assert!(far.contains("which hold 1e-30 to 1e30; scale"), "{far}");
        let near = two(1e-40).unwrap();
        assert!(
            near.starts_with("no photo is farther than 1e-40 from a.jpg, b.jpg being"),
            "{near}"
        );
    }
}
