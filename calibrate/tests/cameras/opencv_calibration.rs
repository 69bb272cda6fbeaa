//! Cameras and poses out of OpenCV's files, as they are met in the wild.

use calibrate::opencv::{
    Keys, OpenCvCalibration, OpenCvError, find_calibrations, read_calibration,
};
use calibrate::{Camera, Distortion, ModelKind, Rigid3, colmap};
use glam::{DVec2, DVec3};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

pub(crate) fn captures() -> Option<PathBuf> {
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

pub(crate) fn read(text: &str) -> Result<OpenCvCalibration, OpenCvError> {
    read_with(text, &Keys::default())
}

pub(crate) fn read_with(text: &str, keys: &Keys) -> Result<OpenCvCalibration, OpenCvError> {
    let (_folder, path) = with_file("c.yml", text);
    read_calibration(&path, keys)
}

/// What is said behind the file's name.
#[track_caller]
pub(crate) fn error(text: &str) -> String {
    let error = read(text).unwrap_err().to_string();
    error.split_once("c.yml").unwrap().1.to_owned()
}

pub(crate) fn matrix(key: &str, rows: usize, cols: usize, data: &str) -> String {
    format!(
        "{key}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: [ {data} ]\n"
    )
}

pub(crate) const K: &str = "500, 0, 319.5, 0, 510, 239.5, 0, 0, 1";

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
