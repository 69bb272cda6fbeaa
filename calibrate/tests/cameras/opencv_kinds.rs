//! Kinds of OpenCV's files: fisheyes, ROS, camodocal, and Kalibr's chains.

use crate::opencv_calibration::{K, error, matrix, read, read_with};
use calibrate::opencv::Keys;
use calibrate::{Camera, Distortion};
use glam::DVec2;

#[test]
fn a_fisheye_is_known_by_what_the_file_says() {
    let skewed = "500, 5, 319.5, 0, 510, 239.5, 0, 0, 1";
    let fisheye = Distortion::SkewedFisheye {
        k: [1.0, 2.0, 3.0, 4.0],
        alpha: 0.01,
    };
    let text = |head: &str, prefix: &str| {
        format!("{head}\n")
            + &matrix(&format!("{prefix}K"), 3, 3, skewed)
            + &matrix(&format!("{prefix}D"), 4, 1, "1, 2, 3, 4")
    };
    for (head, prefix) in [
        ("fisheye_model: 1", ""),
        ("distortion_model: equidistant", ""),
        ("a: 1", "fisheye_"),
    ] {
        let found = read(&text(head, prefix)).unwrap();
        assert_eq!(
            found.cameras[0].lens.distortion(),
            fisheye,
            "{head} {prefix}"
        );
        assert!(found.notes.is_empty());
    }
    let keys = Keys {
        fisheye: true,
        ..Keys::default()
    };
    let found = read_with(&text("a: 1", ""), &keys).unwrap();
    assert_eq!(found.cameras[0].lens.distortion(), fisheye);
    assert!(error(&text("fisheye_model: 0", "")).contains("skew 5, which OpenCV's pinhole"));
    let five = matrix("K", 3, 3, K) + &matrix("D", 5, 1, "1, 2, 3, 4, 5") + "fisheye_model: 1\n";
    assert!(
        error(&five)
            .ends_with(": D: a fisheye's distortion has 5 coefficients, expected 4 (k1 k2 k3 k4)")
    );
}

/// As `rostopic echo` prints it, of ROS 1 and 2.
#[test]
fn camera_infos_of_ros_have_their_matrices_as_lists() {
    let text = |k: &str, d: &str| {
        format!(
            "header:\n  seq: 1\n  frame_id: camera\nheight: 480\nwidth: 640\n\
             distortion_model: \"plumb_bob\"\n{d}: [0.1, 0.02, 0.003, 0.004, 0.05]\n\
             {k}: [{K}]\nR: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n\
             P: [400, 0, 320, 0, 0, 400, 240, 0, 0, 0, 1, 0]\n\
             roi:\n  x_offset: 0\n  height: 0\n  width: 0\n  do_rectify: False\n"
        )
    };
    let asked = Keys {
        camera_matrix: Some("K".to_owned()),
        distortion: Some("D".to_owned()),
        ..Keys::default()
    };
    let all = Keys::default();
    for (text, keys) in [
        (text("K", "D"), &all),
        (text("k", "d"), &all),
        (text("K", "D"), &asked),
    ] {
        let found = read_with(&text, keys).unwrap();
        let [camera] = &found.cameras[..] else {
            panic!("{:?}", found.cameras);
        };
        assert_eq!(camera.size, Some((640, 480)));
        assert_eq!(camera.lens.focal, DVec2::new(500.0, 510.0));
        assert_eq!(camera.lens.principal, DVec2::new(320.0, 240.0));
        let five = Distortion::of_opencv(&[0.1, 0.02, 0.003, 0.004, 0.05]);
        assert_eq!(Some(camera.lens.distortion()), five);
        assert!(found.notes.is_empty(), "{:?}", found.notes);
    }
    // Nine numbers that are no camera matrix stay what they are.
    let other = "camera_matrix: [1, 2, 3, 4, 5, 6, 7, 8, 9]\n";
    let refused = error(other);
    assert!(
        refused.contains("the camera matrix is 1 × 9, expected 3 × 3"),
        "{refused}"
    );
}

#[test]
fn a_fisheye_of_camodocals_has_its_terms_among_its_projection_parameters() {
    let text = "model_type: KANNALA_BRANDT\nprojection_parameters:\n   k2: 0.1\n   k3: 0.02\n   \
                k4: 0.003\n   k5: 0.0004\n   mu: 500\n   mv: 510\n   u0: 319.5\n   v0: 239.5\n";
    let lens = read(text).unwrap().cameras[0].lens;
    let k = [0.1, 0.02, 0.003, 0.0004];
    assert_eq!(lens.distortion(), Distortion::Fisheye { k });
    assert_eq!(lens.focal, DVec2::new(500.0, 510.0));
    assert_eq!(lens.principal, DVec2::new(320.0, 240.0));
}

#[test]
fn every_camera_of_kalibrs_chain_has_its_own_model() {
    let chain = |models: [&str; 2]| -> String {
        let cameras = models.iter().enumerate().map(|(i, model)| {
            format!(
                "cam{i}:\n  cam_overlaps: [{}]\n  camera_model: pinhole\n  \
                 distortion_coeffs: [0.1, 0.02, 0.003, 0.004]\n  distortion_model: {model}\n  \
                 intrinsics: [500, 510, 319.5, 239.5]\n  resolution: [{}, 480]\n  \
                 rostopic: /cam{i}/image_raw\n",
                1 - i,
                640 + i
            )
        });
        cameras.collect()
    };
    let names = |text: &str, keys: &Keys| -> Vec<String> {
        let found = read_with(text, keys).unwrap();
        let name = |lens| Camera::of(lens, 1, 1).model.name().to_owned();
        found.cameras.iter().map(|c| name(&c.lens)).collect()
    };
    let all = Keys::default();
    for (models, expected) in [
        (["radtan", "equidistant"], ["OPENCV", "OPENCV_FISHEYE"]),
        (["equidistant", "radtan"], ["OPENCV_FISHEYE", "OPENCV"]),
        (
            ["equidistant", "equidistant"],
            ["OPENCV_FISHEYE", "OPENCV_FISHEYE"],
        ),
    ] {
        let text = chain(models);
        assert_eq!(names(&text, &all), expected, "{models:?}");
        let found = read(&text).unwrap();
        assert_eq!(found.cameras[0].size, Some((640, 480)));
        assert_eq!(found.cameras[1].size, Some((641, 480)));
        assert_eq!(found.notes, Vec::<String>::new());
        let second = Keys {
            camera_matrix: Some("cam1.intrinsics".to_owned()),
            ..Keys::default()
        };
        assert_eq!(names(&text, &second), expected[1..], "{models:?}");
    }
    // What the first says is not said of the second.
    let text = chain(["equidistant", "radtan"]);
    let silent = text.replace("  distortion_model: radtan\n", "");
    assert_eq!(names(&silent, &all), ["OPENCV_FISHEYE", "OPENCV"]);
    // Nor is one refused for what another is.
    let omni = text + "cam2:\n  camera_model: omni\n  intrinsics: [1, 500, 510, 319.5, 239.5]\n";
    assert!(error(&omni).contains("the camera model is omni"));
    let first = Keys {
        camera_matrix: Some("cam0.intrinsics".to_owned()),
        ..Keys::default()
    };
    assert_eq!(names(&omni, &first), ["OPENCV_FISHEYE"]);
}
