use crate::synthetic::small;
use calibrate::colmap::{ColmapError, read_model, write_binary, write_text};
use calibrate::{
    Camera, CameraId, Image, ImageId, Keypoint, ModelKind, Point3D, Point3DId, Reconstruction,
    Rigid3,
};
use glam::{DQuat, DVec3};
use proptest::collection::{btree_set, vec};
use proptest::prelude::*;
use std::fs;

/// Numbers of every size, but finite.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        -1e3..1e3,
        any::<f64>().prop_filter("finite", |value| value.is_finite()),
        Just(0.1 + 0.2),
        Just(-0.0),
    ]
}

fn camera() -> impl Strategy<Value = Camera> {
    (
        prop::sample::select(ModelKind::ALL),
        1_u32..5000,
        1_u32..5000,
        vec(0.001..2000.0, 18),
    )
        .prop_map(|(model, width, height, mut params)| {
            params.truncate(model.parameter_names().len());
            for (value, name) in params.iter_mut().zip(model.parameter_names()) {
                // These have bounds.
                if ["omega", "alpha", "tauX", "tauY"].contains(name) {
                    *value /= 2000.0;
                }
            }
            Camera {
                model,
                width,
                height,
                params,
            }
        })
}

fn pose() -> impl Strategy<Value = Rigid3> {
    (
        [-1.0..1.0, -1.0..1.0, -1.0..1.0, 0.1..1.0],
        [number(), number(), number()],
    )
        .prop_map(|(q, t): ([f64; 4], [f64; 3])| {
            Rigid3::new(DQuat::from_array(q), DVec3::from_array(t))
        })
}

prop_compose! {
    /// Consistent models with sparse ids.
    fn reconstruction()(
        camera_ids in btree_set(any::<u32>(), 1..4),
        image_ids in btree_set(any::<u32>(), 1..6),
        point_ids in btree_set(0..u64::MAX, 0..8),
    )(
        cameras in vec(camera(), camera_ids.len()),
        poses in vec(pose(), image_ids.len()),
        chosen in vec(any::<prop::sample::Index>(), image_ids.len()),
        keypoints in vec(vec((number(), number(), any::<Option<prop::sample::Index>>()), 0..9),
            image_ids.len()),
        positions in vec([number(), number(), number()], point_ids.len()),
        looks in vec((any::<[u8; 3]>(), number()), point_ids.len()),
        (camera_ids, image_ids, point_ids) in
            (Just(camera_ids), Just(image_ids), Just(point_ids)),
    ) -> Reconstruction {
        let camera_ids: Vec<_> = camera_ids.into_iter().map(CameraId).collect();
        let image_ids: Vec<_> = image_ids.into_iter().map(ImageId).collect();
        let point_ids: Vec<_> = point_ids.into_iter().map(Point3DId).collect();
        let mut model = Reconstruction {
            cameras: camera_ids.iter().copied().zip(cameras).collect(),
            ..Default::default()
        };
        for (index, &id) in point_ids.iter().enumerate() {
            model.points.insert(id, Point3D {
                position: DVec3::from_array(positions[index]),
                color: looks[index].0,
                error_px: looks[index].1,
                track: Vec::new(),
            });
        }
        for (index, &id) in image_ids.iter().enumerate() {
            let keypoints = keypoints[index].iter().enumerate().map(|(at, &(x, y, point))| {
                let point = point.filter(|_| !point_ids.is_empty()).map(|i| *i.get(&point_ids));
                if let Some(point) = point {
                    model.points.get_mut(&point).unwrap().track.push((id, at as u32));
                }
                Keypoint { x, y, point }
            }).collect();
            model.images.insert(id, Image {
                name: format!("folder {index}/photo  of day {index}.jpg"),
                camera_id: *chosen[index].get(&camera_ids),
                camera_from_world: poses[index],
                keypoints,
            });
        }
        model
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn what_is_written_reads_back_bit_for_bit(model in reconstruction()) {
        let folder = tempfile::tempdir().unwrap();
        let (binary, text) = (folder.path().join("binary"), folder.path().join("text"));
        write_text(&model, &text).unwrap();
        prop_assert_eq!(&read_model(&text).unwrap(), &model);
        // COLMAP reads binary models, and not all of ours.
        let is_colmaps = |camera: &Camera| camera.model.colmap_id().is_some();
        let written = write_binary(&model, &binary);
        if model.cameras.values().all(is_colmaps) {
            written.unwrap();
            prop_assert_eq!(&read_model(&binary).unwrap(), &model);
        } else {
            let refused = matches!(written, Err(ColmapError::NotColmaps { .. }));
            prop_assert!(refused);
            prop_assert!(!binary.exists());
        }
    }
}

#[test]
fn a_binary_model_holds_only_colmaps_cameras() {
    let folder = tempfile::tempdir().unwrap();
    let mut model = small();
    let (id, camera) = model.cameras.iter_mut().next().unwrap();
    let id = id.0;
    camera.model = ModelKind::OpenCvTilted;
    camera.params = [500.0, 500.0, 320.0, 240.0]
        .into_iter()
        .chain((1..15).map(|i| 0.01 * f64::from(i)))
        .collect();
    let error = write_binary(&model, folder.path()).unwrap_err().to_string();
    let expected = format!(
        "{}: camera {id} has the model OPENCV_TILTED, which COLMAP does not have; undistort the \
         photos and write the pinhole cameras of the result, or write a text model, which is \
         read here",
        folder.path().display()
    );
    assert_eq!(error, expected);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    write_text(&model, folder.path()).unwrap();
    let text = fs::read_to_string(folder.path().join("cameras.txt")).unwrap();
    let line = format!(
        "{id} OPENCV_TILTED {} {} 500 500 320 240 0.01 0.02 0.03",
        model.cameras[&CameraId(id)].width,
        model.cameras[&CameraId(id)].height
    );
    assert!(text.contains(&line), "{text}");
    assert_eq!(read_model(folder.path()).unwrap(), model);
}

#[test]
fn writing_leaves_three_files_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    write_text(&small(), folder.path()).unwrap();
    let mut names: Vec<_> = fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["cameras.txt", "images.txt", "points3D.txt"]);
}

#[test]
fn the_binary_model_is_preferred_where_both_are_complete() {
    let folder = tempfile::tempdir().unwrap();
    let mut other = small();
    other.points.clear();
    for image in other.images.values_mut() {
        image.keypoints.clear();
    }
    write_text(&other, folder.path()).unwrap();
    write_binary(&small(), folder.path()).unwrap();
    assert_eq!(read_model(folder.path()).unwrap(), small());
}

#[test]
fn further_files_do_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    write_binary(&small(), folder.path()).unwrap();
    for name in ["rigs.bin", "frames.bin", "project.ini"] {
        fs::write(folder.path().join(name), b"anything").unwrap();
    }
    assert_eq!(read_model(folder.path()).unwrap(), small());
}

/// What people and other programs write by hand.
#[test]
fn handwritten_text_reads() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    // A byte order mark, Windows line ends, comments, an integer as a focal length.
    write(
        "cameras.txt",
        "\u{feff}# cameras\r\n\r\n 1\tPINHOLE 640 480 500 500 320 240\r\n",
    );
    // A quaternion of three digits; empty keypoint lines, the last one missing.
    write(
        "images.txt",
        "1 0.707 0 0.707 0 0 0 0 1 my photos\\one 1.jpg\r\n\r\n2 1 0 0 0 0 0 0 1 b.jpg",
    );
    // COLMAP's instructions for known poses ask for an empty file.
    write("points3D.txt", "");
    let model = read_model(folder.path()).unwrap();
    let image = &model.images[&ImageId(1)];
    assert_eq!(image.name, "my photos/one 1.jpg");
    assert!(image.keypoints.is_empty());
    assert!((image.camera_from_world.rotation.length() - 1.0).abs() < 1e-15);
    assert_eq!(model.images[&ImageId(2)].name, "b.jpg");
    assert!(model.points.is_empty());
}

#[test]
fn an_error_that_is_not_a_number_was_never_computed() {
    let folder = tempfile::tempdir().unwrap();
    let mut model = small();
    model.points.get_mut(&Point3DId(9)).unwrap().error_px = f64::NAN;
    write_binary(&model, folder.path()).unwrap();
    let read = read_model(folder.path()).unwrap();
    assert_eq!(read.points[&Point3DId(9)].error_px, -1.0);
}
