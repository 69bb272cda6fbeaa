//! What is said of bad values in OpenCV's files, and that damage never breaks the reader.

use crate::opencv_calibration::{K, captures, error, matrix, read, read_with};
use calibrate::Camera;
use calibrate::opencv::{Keys, read_calibration};

/// Names and what they mean are looked up, not searched for anew for each camera.
#[test]
fn thousands_of_cameras_take_time_by_their_number() {
    let count = 10_000;
    let size = "image_size: [640, 480]\n";
    let in_maps = (0..count).map(|i| {
        format!("c{i}:\n  camera_matrix: [[500, 0, 1], [0, 500, 1], [0, 0, 1]]\n  gain: 1\n")
    });
    let side_by_side =
        (0..count).map(|i| format!("camera_matrix{i}: [[500, 0, 1], [0, 500, 1], [0, 0, 1]]\n"));
    for text in [
        in_maps.collect::<String>() + "last:\n  " + size,
        side_by_side.collect::<String>() + size,
    ] {
        let started = cpu_time::ThreadTime::now();
        let cameras = read(&text).unwrap().cameras;
        let took = started.elapsed();
        assert_eq!(cameras.len(), count);
        assert!(cameras.iter().all(|c| c.size == Some((640, 480))));
        assert!(took.as_secs_f64() < 10.0, "{took:?}");
    }
}

/// Else one long name around many values, repeated in the path of each, would fill memory.
#[test]
fn values_of_endless_names_are_left_out() {
    let matrix = "[[500, 0, 1], [0, 500, 1], [0, 0, 1]]";
    let within = |name: &str| format!("{name}:\n  camera_matrix: {matrix}\n");
    assert!(read(&within(&"a".repeat(100))).is_ok());
    assert!(error(&within(&"a".repeat(1000))).contains("no camera matrix"));
}

#[test]
fn the_size_of_something_else_is_not_the_images() {
    let camera = matrix("K", 3, 3, K);
    let size = |text: &str| read(text).unwrap().cameras[0].size;
    for (beside, expected) in [
        ("board: { size: [9, 6] }", None),
        ("display: { resolution: [1920, 1080] }", None),
        ("size: [640, 480]", Some((640, 480))),
        ("size: [9, 6]\nimage_size: [640, 480]", Some((640, 480))),
        (
            "board: { size: [9, 6] }\nresolution: [640, 480]",
            Some((640, 480)),
        ),
        // Those that say what they are of may be anywhere.
        ("info: { image_size: [640, 480] }", Some((640, 480))),
        ("image: { size: [640, 480] }", Some((640, 480))),
    ] {
        assert_eq!(size(&format!("{beside}\n{camera}")), expected, "{beside}");
        assert_eq!(size(&format!("{camera}{beside}\n")), expected, "{beside}");
    }
    let k = "camera_matrix: [[500, 0, 1], [0, 500, 1], [0, 0, 1]]";
    let rig = format!(
        "size: [9, 6]\nrig:\n  resolution: [800, 600]\n  a:\n    size: [640, 480]\n    {k}\n  \
         b:\n    {k}\n"
    );
    let sizes: Vec<_> = read(&rig).unwrap().cameras.iter().map(|c| c.size).collect();
    assert_eq!(sizes, [Some((640, 480)), Some((800, 600))]);
}

#[test]
fn unknown_names_are_listed_and_can_be_chosen() {
    let text = matrix("Kamera", 3, 3, K)
        + "inner:\n"
        + "   x: 1\n"
        + &matrix("Verzeichnung", 1, 5, "0.1, 0, 0, 0, 0");
    assert_eq!(
        error(&text),
        ": no camera matrix under a name known here (camera_matrix, cameraMatrix, K, M1, \
         intrinsic, Camera.fx and their like); the file holds Kamera (3 × 3), Verzeichnung \
         (1 × 5); choose with --camera-matrix KEY --distortion KEY"
    );
    let mut keys = Keys {
        camera_matrix: Some("Kamera".to_owned()),
        ..Keys::default()
    };
    let said = read_with(&text, &keys).unwrap_err().to_string();
    assert!(
        said.ends_with(
            "line 8: Verzeichnung: these may be the distortion coefficients of Kamera, for which \
             none have a name known here; choose with --distortion KEY, or say --distortion none"
        ),
        "{said}"
    );
    keys.distortion = Some("none".to_owned());
    assert!(read_with(&text, &keys).is_ok());
    keys.distortion = Some("Verzeichnung".to_owned());
    let chosen = read_with(&text, &keys).unwrap().cameras[0].clone();
    assert_eq!(Camera::of(&chosen.lens, 640, 480).params[4], 0.1);
    keys.camera_matrix = Some("Camera".to_owned());
    let said = read_with(&text, &keys).unwrap_err().to_string();
    assert!(
        said.contains("no matrix is called Camera; the file holds Kamera"),
        "{said}"
    );
}

#[test]
fn bad_values_are_named() {
    let d = matrix("D", 1, 5, "0, 0, 0, 0, 0");
    let k = |data: &str| matrix("camera_matrix", 3, 3, data) + &d;
    let good = matrix("camera_matrix", 3, 3, K) + &d;
    for (text, said) in [
        (
            k("500, 0, 319.5, 0, -510, 239.5, 0, 0, 1"),
            ", line 1: camera_matrix: the focal length fy is -510, expected a positive number; \
             calibrate again",
        ),
        (
            k("500, 0, .Nan, 0, 510, 239.5, 0, 0, 1"),
            ", line 1: camera_matrix: the camera matrix holds NaN, expected finite numbers",
        ),
        (
            k("500, 0, 0, 0, 510, 0, 319.5, 239.5, 1"),
            ", line 1: camera_matrix: the camera matrix is [500 0 0; 0 510 0; 319.5 239.5 1], \
             expected [fx 0 cx; 0 fy cy; 0 0 1]; transpose it",
        ),
        (
            matrix("camera_matrix", 2, 3, "1, 2, 3, 4, 5, 6"),
            ", line 1: camera_matrix: the camera matrix is 2 × 3, expected 3 × 3; choose another \
             with --camera-matrix KEY",
        ),
        (
            matrix("K", 3, 3, K) + &matrix("D", 1, 7, "0, 0, 0, 0, 0, 0, 0"),
            ", line 6: D: distortion has 7 coefficients, expected 0, 4, 5, 8, 12 or 14; choose \
             others with --distortion KEY, or none with --distortion none",
        ),
        (
            matrix("K", 3, 3, K) + &matrix("D", 1, 4, "0, .Inf, 0, 0"),
            ", line 6: D: the distortion holds inf, expected finite numbers",
        ),
        (
            matrix("K", 3, 3, K) + &matrix("D", 1, 14, "0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0"),
            ", line 6: D: parameter tauX of OPENCV_TILTED is 2; it must be an angle in radians \
             between −π/2 and π/2; calibrate again",
        ),
        (
            "Camera.fx: 500\nCamera.fy: .Nan\nCamera.cx: 320\nCamera.cy: 240\n".to_owned(),
            ", line 1: Camera.fx: the focal lengths are 500 and NaN, expected positive numbers; \
             calibrate again",
        ),
        (
            "Camera.fx: 500\nCamera.fy: 500\nCamera.cx: 320\nCamera.cy: .Nan\n".to_owned(),
            ", line 4: Camera.cy: the principal point is NaN, expected a finite number; calibrate \
             again",
        ),
        (
            "Camera.fx: 500\nCamera.fy: 500\nCamera.cx: 320\nCamera.cy: 240\nCamera.p2: -.Inf\n"
                .to_owned(),
            ", line 5: Camera.p2: the distortion is -inf, expected a finite number; calibrate again",
        ),
        (
            "model_type: KANNALA_BRANDT\nprojection_parameters:\n   k2: 0.1\n   k3: .Inf\n   \
             mu: 500\n   mv: 500\n   u0: 320\n   v0: 240\n"
                .to_owned(),
            ", line 4: projection_parameters.k3: the distortion is inf, expected a finite number; \
             calibrate again",
        ),
        (
            good.clone() + &matrix("extrinsic_parameters", 6, 2, "1,2,3,4,5,6,7,8,9,10,11,12"),
            ", line 11: extrinsic_parameters: the poses are 6 × 2, expected N × 6, a rotation \
             vector and a translation in each row; transpose it",
        ),
        (
            good.clone() + &matrix("extrinsic_parameters", 1, 6, "1, 2, 3, 4, .Nan, 6"),
            ", line 11: extrinsic_parameters: view 1 is rotated by [1.0, 2.0, 3.0] and moved by \
             [4.0, NaN, 6.0], expected finite numbers",
        ),
        (
            good.clone() + "rvecs: [[0, 0, 1], [0, 0, 1]]\ntvecs: [[0, 0, 1]]\n",
            ", line 11: rvecs: 2 rotations, but tvecs holds 1 translations; expected as many",
        ),
        (
            good.clone() + &matrix("camera_matrix", 3, 3, "1, 0, 1, 0, 1, 1, 0, 0, 1"),
            ", line 11: camera_matrix: another camera matrix stands in line 1 (camera_matrix); \
             choose with --camera-matrix KEY, or remove one",
        ),
        (
            good.clone() + "image_width: -3\nimage_height: 5\n",
            ", line 11: image_width: the image size is -3, expected a whole number of pixels",
        ),
        (
            format!(
                "{}{}{}{}",
                matrix("M1", 3, 3, K),
                matrix("M2", 3, 3, K),
                matrix("R", 3, 3, "1, 0, 0, 0, 1, 0, 0, 0, -1"),
                matrix("T", 3, 1, "-0.1, 0, 0")
            ),
            ", line 11: R: no rotation (its columns are not unit vectors at right angles, it \
             mirrors, or the translation is not finite); calibrate again",
        ),
    ] {
        assert_eq!(error(&text), said);
    }
}

/// Whatever is damaged, the answer is a calibration or an error.
#[test]
fn damage_never_breaks_the_reader() {
    let Some(captures) = captures() else { return };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c");
    let whole = std::fs::read(captures.join("opencv-calibrations/opencv5.yml")).unwrap();
    for (i, at) in (0..whole.len()).step_by(3).enumerate() {
        let mut bytes = whole.clone();
        bytes[at] = b"0-:. \n[]"[i % 8];
        std::fs::write(&path, bytes).unwrap();
        let _ = read_calibration(&path, &Keys::default());
    }
}
