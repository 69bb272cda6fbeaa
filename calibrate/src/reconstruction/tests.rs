use super::*;
use crate::ModelKind;

/// Three images in a row that look along z; point 1 seen by all, 2 by a and b, 3 by a
/// and c; c sees point 1 half a pixel off.
fn three_images() -> Reconstruction {
    let camera = Camera {
        model: ModelKind::SimplePinhole,
        width: 100,
        height: 100,
        params: vec![100.0, 50.0, 50.0],
    };
    let mut whole = Reconstruction::default();
    whole.cameras.insert(CameraId(7), camera);
    let seen: [(&str, &[u64]); 3] = [("a", &[1, 2, 3]), ("b", &[1, 2]), ("c", &[1, 3])];
    for (i, (name, points)) in seen.into_iter().enumerate() {
        let image_id = ImageId(10 + i as u32);
        let camera_from_world =
            Rigid3::new(glam::DQuat::IDENTITY, DVec3::new(-(i as f64), 0.0, 0.0));
        let mut keypoints = Vec::new();
        for &id in points {
            let position = DVec3::new(id as f64, 0.0, 10.0);
            let in_camera = camera_from_world * position;
            let slip = if (name, id) == ("c", 1) { 0.5 } else { 0.0 };
            let point = whole.points.entry(Point3DId(id)).or_insert(Point3D {
                position,
                color: [0; 3],
                error_px: -1.0,
                track: Vec::new(),
            });
            point.track.push((image_id, keypoints.len() as u32));
            keypoints.push(Keypoint {
                x: 50.0 + 10.0 * in_camera.x,
                y: 50.0 + slip,
                point: Some(Point3DId(id)),
            });
        }
        let image = Image {
            name: name.to_owned(),
            camera_id: CameraId(7),
            camera_from_world,
            keypoints,
        };
        whole.images.insert(image_id, image);
    }
    whole
}

#[test]
fn tracks_that_nobody_wrote_are_those_of_the_keypoints() {
    let whole = three_images();
    let mut bare = whole.clone();
    bare.points.values_mut().for_each(|p| p.track.clear());
    assert_eq!(bare.take_tracks_from_keypoints(), 7);
    assert_eq!(bare, whole);
    // What is there is taken as it is.
    bare.points.get_mut(&Point3DId(2)).unwrap().track.clear();
    let before = bare.clone();
    assert_eq!(bare.take_tracks_from_keypoints(), 0);
    assert_eq!(bare, before);
}

fn named(names: &[&str]) -> BTreeSet<String> {
    names.iter().map(|&n| n.to_owned()).collect()
}

#[test]
fn points_stay_where_two_remaining_images_see_them() {
    let whole = three_images();
    let rest = whole.without_images(&named(&["b", "unknown"]));
    let ids: Vec<u64> = rest.points.keys().map(|id| id.0).collect();
    assert_eq!(ids, [1, 3], "point 2 is left to a alone");
    assert_eq!(rest.images.len(), 2);
    assert_eq!(
        rest.points[&Point3DId(1)].track,
        [(ImageId(10), 0), (ImageId(12), 0)]
    );
    let links: Vec<_> = rest.images[&ImageId(10)]
        .keypoints
        .iter()
        .map(|k| k.point.map(|id| id.0))
        .collect();
    assert_eq!(links, [Some(1), None, Some(3)]);
    // One image that sees a point twice is one.
    let mut twice = whole.clone();
    let track = &mut twice.points.get_mut(&Point3DId(1)).unwrap().track;
    track.retain(|(id, _)| *id != ImageId(12));
    track.push((ImageId(10), 1));
    twice.remove_images(&named(&["b"]));
    assert!(twice.points.keys().eq(&[Point3DId(3)]));
}

#[test]
fn leaving_nothing_out_changes_nothing() {
    let mut whole = three_images();
    // Given, not triangulated: a point that no image is known to see stays.
    whole.points.get_mut(&Point3DId(2)).unwrap().track.clear();
    for image in whole.images.values_mut() {
        image.keypoints.retain(|k| k.point != Some(Point3DId(2)));
    }
    // Nothing is copied for it.
    for names in [named(&[]), named(&["unknown"])] {
        let rest = whole.without_images(&names);
        assert!(matches!(rest, Cow::Borrowed(same) if std::ptr::eq(same, &whole)));
        let mut rest = whole.clone();
        rest.remove_images(&names);
        assert_eq!(rest, whole);
    }
}

#[test]
fn reprojection_errors_are_distances_in_pixels() {
    let mut errors = three_images().reprojection_errors_px(CameraId(7)).unwrap();
    errors.sort_by(f64::total_cmp);
    assert_eq!(errors.len(), 7);
    assert!(errors[5] < 1e-12);
    assert!((errors[6] - 0.5).abs() < 1e-12);
    let none = three_images().reprojection_errors_px(CameraId(8)).unwrap();
    assert!(none.is_empty());
}

#[test]
fn points_behind_cameras_and_beyond_their_lenses_are_told_apart() {
    let mut whole = three_images();
    let nowhere = |whole: &Reconstruction| {
        let all = whole.reprojections(CameraId(7)).unwrap();
        [Reprojection::Behind, Reprojection::BeyondLens]
            .map(|what| all.iter().filter(|r| **r == what).count())
    };
    assert_eq!(nowhere(&whole), [0, 0]);
    // 1. A lens that folds at 0.13 of the distance; a sees points 2 and 3 beyond.
    let camera = whole.cameras.get_mut(&CameraId(7)).unwrap();
    camera.model = ModelKind::SimpleRadial;
    camera.params.push(-20.0);
    assert_eq!(nowhere(&whole), [0, 2]);
    // 2. Point 1, which all observe, behind.
    whole.points.get_mut(&Point3DId(1)).unwrap().position.z = -10.0;
    assert_eq!(nowhere(&whole), [3, 2]);
    let errors = whole.reprojection_errors_px(CameraId(7)).unwrap();
    assert_eq!(errors.iter().filter(|px| px.is_infinite()).count(), 5);
}

#[test]
fn points_are_contradicted_where_all_who_observe_them_have_them_elsewhere() {
    let mut whole = three_images();
    let contradicted = |whole: &Reconstruction| -> Vec<u64> {
        let ids = whole.contradicted_points(10.0).into_iter();
        ids.map(|id| id.0).collect()
    };
    assert!(contradicted(&whole).is_empty());
    // 1. Point 2 is behind all; point 3 is off, in both images that observe it.
    for (id, to) in [
        (2, DVec3::new(0.0, 0.0, -5.0)),
        (3, DVec3::new(3.0, 9.0, 10.0)),
    ] {
        whole.points.get_mut(&Point3DId(id)).unwrap().position = to;
    }
    assert_eq!(contradicted(&whole), [2, 3]);
    // 2. One that agrees is enough, and so is one of which nothing is known.
    let mut agreed = whole.clone();
    agreed.images.get_mut(&ImageId(12)).unwrap().keypoints[1].y = 140.0;
    assert_eq!(contradicted(&agreed), [2]);
    let unknown = agreed.images.get_mut(&ImageId(11)).unwrap();
    unknown.keypoints.truncate(1);
    assert!(contradicted(&agreed).is_empty());
    // 3. Those that nobody observes are given.
    let mut given = whole.clone();
    given.points.get_mut(&Point3DId(2)).unwrap().track.clear();
    assert_eq!(contradicted(&given), [3]);

    let gone = whole.contradicted_points(10.0);
    whole.remove_points(&gone);
    let ids: Vec<u64> = whole.points.keys().map(|id| id.0).collect();
    assert_eq!(ids, [1]);
    let keypoints = whole.images.values().flat_map(|image| &image.keypoints);
    let links: Vec<u64> = keypoints.filter_map(|k| Some(k.point?.0)).collect();
    assert_eq!(links, [1; 3]);
}

#[test]
fn the_median_error_is_that_of_all_images() {
    let mut whole = three_images();
    assert!(whole.median_error_px().unwrap() < 1e-12);
    let moved = whole.median_error_px_from(|camera| DVec2::new(0.0, -camera.params[0]));
    assert!((moved.unwrap() - 100.0).abs() < 1e-12, "{moved:?}");
    for point in whole.points.values_mut() {
        point.position.z = -1.0;
    }
    assert_eq!(whole.median_error_px(), Some(f64::INFINITY));
    whole.points.clear();
    assert_eq!(whole.median_error_px(), None);
}

#[test]
fn each_image_has_a_median_error_of_its_own() {
    let mut whole = three_images();
    for image in whole.images.values_mut().skip(2) {
        image.camera_from_world.translation.x += 5.0;
    }
    let errors = whole.median_errors_px(2);
    assert_eq!(errors.len(), 3);
    assert!(errors[&ImageId(10)] < 1e-12 && errors[&ImageId(11)] < 1e-12);
    assert!((errors[&ImageId(12)] - 50.0).abs() < 0.01, "{errors:?}");
    // A sees three points, the others two.
    assert_eq!(whole.median_errors_px(3).len(), 1);
    whole.points.clear();
    assert!(whole.median_errors_px(0).is_empty());
}

/// Where there are many, those that are judged are of all images.
#[test]
fn the_median_error_is_judged_by_observations_everywhere() {
    let mut whole = three_images();
    for (image, slip) in whole.images.values_mut().zip([0.0, 3.0, 7.0]) {
        let mut keypoint = image.keypoints[0];
        keypoint.y = 50.0 + slip;
        image.keypoints = vec![keypoint; 10 * JUDGED];
    }
    let median = whole.median_error_px().unwrap();
    assert!((median - 3.0).abs() < 1e-12, "{median}");
}
