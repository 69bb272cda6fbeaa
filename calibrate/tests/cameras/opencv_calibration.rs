//! Cameras and poses out of OpenCV's files, as they are met in the wild.

use calibrate::opencv::{
    Keys, OpenCvCalibration, OpenCvError, find_calibrations, read_calibration,
};
use calibrate::{Camera, Distortion, ModelKind, Rigid3, colmap};
use glam::{DVec2, DVec3};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

fn captures() -> Option<PathBuf> {
    let folder = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../shared/captures"
    ));
    if !folder.is_dir() {
        eprintln!("SKIPPED: {} is not there", folder.display());
        return None;
    }
    Some(folder.to_owned())
}

/// A folder with one file.
fn with_file(name: &str, text: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn read(text: &str) -> Result<OpenCvCalibration, OpenCvError> {
    read_with(text, &Keys::default())
}

fn read_with(text: &str, keys: &Keys) -> Result<OpenCvCalibration, OpenCvError> {
    let (_folder, path) = with_file("c.yml", text);
    read_calibration(&path, keys)
}

/// What is said behind the file's name.
#[track_caller]
fn error(text: &str) -> String {
    let error = read(text).unwrap_err().to_string();
    error.split_once("c.yml").unwrap().1.to_owned()
}

fn matrix(key: &str, rows: usize, cols: usize, data: &str) -> String {
    format!(
        "{key}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: [ {data} ]\n"
    )
}

const K: &str = "500, 0, 319.5, 0, 510, 239.5, 0, 0, 1";

#[test]
fn wild_files_give_cameras() {
    let Some(captures) = captures() else { return };
    let mut seen = Vec::new();
    for entry in std::fs::read_dir(captures.join("opencv-calibrations")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if name.contains(".extrinsics") || name == "README.md" || name == "expected.json" {
            continue;
        }
        seen.push(match read_calibration(&path, &Keys::default()) {
            Err(error) => {
                let error = error.to_string();
                format!("{name}: {}", error.split_once(": ").unwrap().1)
            }
            Ok(calibration) => {
                let mut line = format!("{name}:");
                for camera in &calibration.cameras {
                    let size = camera
                        .size
                        .map_or("?".to_owned(), |(w, h)| format!("{w}x{h}"));
                    let made = Camera::of(&camera.lens, 1, 1).model.name();
                    line += &format!(" {} {made} {size},", camera.name);
                }
                let board = calibration.board.map_or(0, |board| board.corners.len());
                line += &format!(
                    " {} poses, {} names, {board} corners{}",
                    calibration.poses.len(),
                    calibration.image_names.len(),
                    calibration.right_from_left.map_or("", |_| ", rig")
                );
                line
            }
        });
    }
    seen.sort();
    let random = "camera_matrix FULL_OPENCV 1280x720, 7 poses, 0 names, 0 corners";
    let stereo = "M1 FULL_OPENCV ?, M2 FULL_OPENCV ?, 0 poses, 0 names, 0 corners, rig";
    let expected = [
        "camodocal-mei.yaml: the camera model is MEI (omnidirectional, with a mirror), which is \
         not read here; calibrate with OpenCV's pinhole or fisheye model instead",
        "camodocal-pinhole.yaml: projection_parameters OPENCV 752x480, 0 poses, 0 names, 0 corners",
        &format!("crlf-nodashes.intrinsics.yml: {stereo}"),
        "fisheye-crlf.xml: camera_matrix FULL_OPENCV 640x480, 25 poses, 0 names, 48 corners",
        "fisheye-minimal.yml: cameraMatrix OPENCV_FISHEYE ?, 0 poses, 0 names, 0 corners",
        "minimal.xml: Camera_Matrix FULL_OPENCV ?, 0 poses, 0 names, 0 corners",
        &format!("opencv5-base64.json: {random}"),
        &format!("opencv5-base64.xml: {random}"),
        &format!("opencv5-base64.yml: {random}"),
        &format!("opencv5.json: {random}"),
        &format!("opencv5.xml: {random}"),
        &format!("opencv5.yml.gz: {random}"),
        &format!("opencv5.yml: {random}"),
        "orbslam2-rgbd-flat-keys.yaml: Camera FULL_OPENCV 640x480, 0 poses, 0 names, 0 corners",
        "orbslam2-stereo-flat-keys.yaml: LEFT.K OPENCV 752x480, RIGHT.K OPENCV 752x480, 0 poses, \
         0 names, 0 corners",
        "single-camera-long.xml: camera_matrix FULL_OPENCV 720x540, 13 poses, 13 names, 54 corners",
        "single-camera.yml: camera_matrix OPENCV 2448x2048, 0 poses, 0 names, 0 corners",
        &format!("stereo-rational14.intrinsics.yml: {stereo}"),
        "with-extrinsics.yml: Camera_Matrix FULL_OPENCV 640x480, 8 poses, 0 names, 54 corners",
        &format!("zed-nodashes.intrinsics.yml: {stereo}"),
    ];
    assert_eq!(seen, expected, "{seen:#?}");
}

#[test]
fn the_chessboard_is_what_colmap_says() {
    let Some(captures) = captures() else { return };
    let capture = captures.join("opencv-chessboard");
    let file = capture.join("out_camera_data.yml");
    let calibration = read_calibration(&file, &Keys::default()).unwrap();
    assert_eq!(
        calibration.notes,
        ["the order of the photos is from images.yml"]
    );
    let names = &calibration.image_names;
    assert_eq!((names.len(), names[9].as_str()), (13, "left11.jpg"));
    let found = calibration.reconstruction(names, (1, 1));

    let expected = colmap::read_model(&capture.join("sparse/0")).unwrap();
    let (ours, theirs) = (
        found.cameras.values().next().unwrap(),
        expected.cameras.values().next().unwrap(),
    );
    assert_eq!(ours.model, ModelKind::FullOpenCv);
    assert_eq!((ours.width, ours.height), (theirs.width, theirs.height));
    for (a, b) in ours.params.iter().zip(&theirs.params) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
    for image in expected.images.values() {
        let same = found
            .images
            .values()
            .find(|i| i.name == image.name)
            .unwrap();
        let motion = same.camera_from_world * image.camera_from_world.inverse();
        assert!(motion.rotation.angle_between(glam::DQuat::IDENTITY) < 1e-7);
        assert!(motion.translation.length() < 1e-9, "{}", image.name);
    }
    // Corners and poses belong together.
    let id = *found.cameras.keys().next().unwrap();
    let errors = found.reprojection_errors_px(id).unwrap();
    assert_eq!(errors.len(), 13 * 54);
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    assert!((mean - 0.175).abs() < 0.01, "{mean}");
    assert!(found.points.values().all(|p| p.position.z == 0.0));
    let in_folder = find_calibrations(&capture, &Keys::default());
    assert_eq!(in_folder.usable, [file]);
    assert!(in_folder.unusable.is_empty(), "{in_folder:?}");
}

/// Found by fuzzing: most corners in place, one of them no number.
#[test]
fn corners_that_are_no_numbers_are_left_out() {
    let text = format!(
        "%YAML:1.0\nimage_size: [ 640, 480 ]\nboard_width: 2\nboard_height: 2\nsquare_size: 1.\n{}{}\
         image_points: !!opencv-matrix\n   rows: 1\n   cols: 4\n   dt: \"2d\"\n   \
         data: [ .Nan, 239.5, 419.5, 239.5, 319.5, 341.5, 419.5, 341.5 ]\n",
        matrix("K", 3, 3, K),
        matrix("extrinsic_parameters", 1, 6, "0., 0., 0., 0., 0., 5.")
    );
    let calibration = read(&text).unwrap();
    assert_eq!(calibration.board, None);
    let said = calibration
        .notes
        .iter()
        .any(|note| note.contains("not all numbers"));
    assert!(said, "{:?}", calibration.notes);
    // With a number in its place the board is there.
    let calibration = read(&text.replace(".Nan", "319.5")).unwrap();
    assert!(calibration.board.is_some(), "{:?}", calibration.notes);
}

#[test]
fn the_principal_point_moves_by_half_a_pixel() {
    let text = format!(
        "%YAML:1.0\nimage_size: [ 640, 480 ]\n{}",
        matrix("K", 3, 3, K)
    );
    let calibration = read(&text).unwrap();
    let camera = &calibration.cameras[0];
    assert_eq!(camera.lens.principal, DVec2::new(320.0, 240.0));
    assert_eq!(camera.lens.focal, DVec2::new(500.0, 510.0));
    assert_eq!(camera.size, Some((640, 480)));
    assert_eq!(
        calibration.notes,
        ["K has no distortion coefficients: taken as a pinhole camera"]
    );
}

#[test]
fn coefficients_come_in_opencvs_order() {
    let text = matrix("M1", 3, 3, K) + &matrix("D1", 1, 8, "1, 2, 3, 4, 5, 6, 7, 8");
    assert_eq!(
        read(&text).unwrap().cameras[0].lens.distortion(),
        Distortion::Rational {
            k: [1.0, 2.0, 5.0, 6.0, 7.0, 8.0],
            p: [3.0, 4.0],
        }
    );
    let all = "1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0.13, 0.14";
    let text = matrix("M1", 3, 3, K) + &matrix("D1", 1, 14, all);
    assert_eq!(
        read(&text).unwrap().cameras[0].lens.distortion(),
        Distortion::Tilted {
            k: [1.0, 2.0, 5.0, 6.0, 7.0, 8.0],
            p: [3.0, 4.0],
            s: [9.0, 10.0, 11.0, 12.0],
            tau: [0.13, 0.14],
        }
    );
}

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
fn poses_are_read_in_each_form() {
    let camera = matrix("K", 3, 3, K) + &matrix("D", 1, 4, "0, 0, 0, 0");
    let expected = [
        Rigid3::new(glam::DQuat::from_rotation_z(0.5), DVec3::new(1.0, 2.0, 3.0)),
        Rigid3::new(
            glam::DQuat::from_rotation_x(-1.5),
            DVec3::new(4.0, 5.0, 6.0),
        ),
    ];
    let three = |key: &str, data: &str| matrix(key, 2, 1, data).replace("dt: d", "dt: \"3d\"");
    let one = |data: &str| {
        matrix("   -", 3, 1, data)
            .replace("-:", "-")
            .replace("\n   ", "\n      ")
    };
    for poses in [
        matrix(
            "extrinsic_parameters",
            2,
            6,
            "0, 0, 0.5, 1, 2, 3, -1.5, 0, 0, 4, 5, 6",
        ),
        matrix("rvecs", 2, 3, "0, 0, 0.5, -1.5, 0, 0") + &matrix("tvecs", 2, 3, "1, 2, 3, 4, 5, 6"),
        three("rvecs", "0, 0, 0.5, -1.5, 0, 0") + &three("tvecs", "1, 2, 3, 4, 5, 6"),
        format!(
            "rvecs:\n{}{}tvecs:\n{}{}",
            one("0, 0, 0.5"),
            one("-1.5, 0, 0"),
            one("1, 2, 3"),
            one("4, 5, 6")
        ),
        "rvecs: [[0, 0, 0.5], [-1.5, 0, 0]]\ntvecs: [[1, 2, 3], [4, 5, 6]]\n".to_owned(),
    ] {
        let found = read(&(camera.clone() + &poses)).unwrap().poses;
        assert_eq!(found.len(), 2, "{poses}");
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found.translation - expected.translation).length() == 0.0);
            assert!(
                found.rotation.angle_between(expected.rotation) < 1e-7,
                "{poses}"
            );
        }
    }
    let rig = format!(
        "{}{}{}{}",
        matrix("M1", 3, 3, K),
        matrix("M2", 3, 3, K),
        matrix("R", 3, 3, "0, -1, 0, 1, 0, 0, 0, 0, 1"),
        matrix("T", 3, 1, "-0.1, 0, 0")
    );
    let found = read(&rig).unwrap();
    let right = found.photo_poses()[1];
    assert!((right * DVec3::X - DVec3::new(-0.1, 1.0, 0.0)).length() < 1e-12);
    let whole = found.reconstruction(&["l".to_owned(), "r".to_owned()], (640, 480));
    assert_eq!((whole.cameras.len(), whole.images.len()), (2, 2));
}

#[test]
fn the_rigs_pose_is_found_beside_its_cameras() {
    let Some(captures) = captures() else { return };
    let file = captures.join("opencv-calibrations/zed-nodashes.intrinsics.yml");
    let rig = read_calibration(&file, &Keys::default())
        .unwrap()
        .right_from_left
        .unwrap();
    assert!((rig.translation.x + 4.7232494306).abs() < 1e-9);
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
