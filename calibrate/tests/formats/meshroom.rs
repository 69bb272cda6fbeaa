use crate::broken::damage;
use crate::captures::{capture, reprojection_errors_px};
use calibrate::formats::{FormatError, read_meshroom};
use calibrate::{ModelKind, Reconstruction};
use glam::{DMat3, DVec3};
use std::path::Path;

/// A camera at (1, 2, 3) that looks along the world's x; one view without a pose; a point
/// 10 ahead, 1 to the camera's right.
const SFM: &str = r#"{"version": ["1", "2", "6"],
"views": [
 {"viewId": "5", "poseId": "6", "intrinsicId": "9", "path": "images\\a.jpg", "width": "100"},
 {"viewId": "7", "poseId": "7", "intrinsicId": "9", "path": "images/b.jpg"}],
"intrinsics": [{"intrinsicId": "9", "width": "100", "height": "80", "sensorWidth": "10",
 "type": "radial3", "focalLength": "9", "pixelRatio": "1", "principalPoint": ["1.5", "-2"],
 "distortionParams": ["0", "0", "0"], "undistortionOffset": ["0", "0"],
 "undistortionParams": ""}],
"poses": [{"poseId": "6", "pose": {"transform": {"rotation":
 ["0", "0", "1", "-1", "0", "0", "0", "-1", "0"], "center": ["1", "2", "3"]}}}],
"structure": [{"landmarkId": "3", "color": ["1", "2", "3"], "X": ["11", "1", "3"],
 "observations": [{"observationId": "5", "featureId": "0", "x": ["60.5", "38"]},
 {"observationId": "7", "featureId": "0", "x": ["1", "1"]}]}]}"#;

fn parse(text: &str) -> Result<Reconstruction, FormatError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cameras.sfm");
    std::fs::write(&path, text).unwrap();
    read_meshroom(&path)
}

fn edited(from: &str, to: &str) -> Result<Reconstruction, FormatError> {
    assert!(SFM.contains(from), "{from}");
    parse(&SFM.replacen(from, to, 1))
}

fn error(from: &str, to: &str) -> String {
    let error = edited(from, to).unwrap_err().to_string();
    let (_, rest) = error.split_once("cameras.sfm, ").unwrap();
    rest.to_owned()
}

fn params(whole: &Reconstruction) -> Vec<f64> {
    whole.cameras.values().next().unwrap().params.clone()
}

#[test]
fn the_example_s_cameras_look_at_one_building() {
    let Some(path) = capture("other-formats/meshroom-sfm/cameras.sfm") else {
        return;
    };
    let whole = read_meshroom(&path).unwrap();
    assert_eq!((whole.images.len(), whole.cameras.len()), (34, 1));
    let camera = whole.cameras.values().next().unwrap();
    assert_eq!(camera.model, ModelKind::FullOpenCv);
    let focal = 5.678361290663454 / 8.126_599_048_697_967 * 4000.0;
    assert!((camera.params[0] - focal).abs() < 1e-9 && (camera.params[1] - focal).abs() < 1e-9);
    assert_eq!(camera.params[2], 2000.5 - 32.291769408137576);
    assert_eq!(camera.params[3], 1500.5 - 65.688_458_120_059_8);

    // The point nearest to all optical axes lies ahead of every camera that circles it;
    // with the rotations by rows (the wrong way) it does not.
    let ahead = |by_rows: bool| {
        let axes: Vec<(DVec3, DVec3)> = whole
            .images
            .values()
            .map(|image| {
                let pose = image.camera_from_world;
                let m = pose.matrix();
                let z = if by_rows {
                    m.z_axis
                } else {
                    m.transpose().z_axis
                };
                (pose.center(), z)
            })
            .collect();
        let (mut sum, mut right) = (DMat3::ZERO, DVec3::ZERO);
        for &(center, z) in &axes {
            let across = DMat3::IDENTITY - DMat3::from_cols(z * z.x, z * z.y, z * z.z);
            sum += across;
            right += across * center;
        }
        let target = sum.inverse() * right;
        let seen = axes
            .iter()
            .filter(|(c, z)| (target - *c).normalize().dot(*z) > 0.8);
        seen.count()
    };
    println!(
        "meshroom: {} of 34 face the middle, {} by rows",
        ahead(false),
        ahead(true)
    );
    assert!(ahead(false) >= 30, "{}", ahead(false));
    assert!(ahead(true) < 30, "{}", ahead(true));
}

#[test]
fn rotations_are_by_columns_and_pixels_shift_by_half() {
    let whole = parse(SFM).unwrap();
    let (id, image) = whole.images.iter().next().unwrap();
    assert_eq!(
        (id.0, &*image.name, whole.images.len()),
        (5, "images/a.jpg", 1)
    );
    let ahead = image.camera_from_world * DVec3::new(11.0, 1.0, 3.0);
    assert!(
        ahead.distance(DVec3::new(1.0, 0.0, 10.0)) < 1e-12,
        "{ahead}"
    );
    assert_eq!(params(&whole)[..4], [90.0, 90.0, 52.0, 38.5]);
    assert!(reprojection_errors_px(&whole)[0] < 1e-12);
}

#[test]
fn older_versions_and_other_lenses() {
    let old = SFM
        .replace(r#""2", "6""#, r#""1", "0""#)
        .replace(r#""focalLength": "9""#, r#""pxFocalLength": "91""#)
        .replace(r#"["1.5", "-2"]"#, r#"["51.5", "38"]"#);
    assert_eq!(params(&parse(&old).unwrap())[..4], [91.0, 91.0, 52.0, 38.5]);
    let wide = edited(r#""pixelRatio": "1""#, r#""pixelRatio": "2""#).unwrap();
    assert_eq!(params(&wide)[..2], [90.0, 180.0]);
    let brown = SFM
        .replace("radial3", "brown")
        .replace(r#"["0", "0", "0"]"#, r#"["1", "2", "3", "4", "5"]"#);
    let brown = parse(&brown).unwrap();
    assert_eq!(
        params(&brown)[4..],
        [1.0, 2.0, 4.0, 5.0, 3.0, 0.0, 0.0, 0.0]
    );
}

#[test]
fn errors_name_the_record_and_a_remedy() {
    let again = "copy the file again, or export it again from the program it is from";
    assert_eq!(
        error("radial3", "3deanamorphic4"),
        "intrinsics[0].type: found the lens \"3deanamorphic4\" with 3 distortion parameters, \
         expected pinhole, radial1 (1 parameter), radial3 (3), brown (5) or fisheye4 (4); \
         undistort the photos with Meshroom's PrepareDenseScene or ExportImages node"
    );
    assert_eq!(
        error(r#"["0", "0", "1", "#, r#"["0", "0", "nan", "#),
        format!(
            "poses[0].pose.transform.rotation[2]: found \"nan\", expected a finite number; {again}"
        )
    );
    assert_eq!(
        error(
            r#""intrinsicId": "9", "path""#,
            r#""intrinsicId": "8", "path""#
        ),
        format!(
            "views[0] (images/a.jpg).intrinsicId: there are no intrinsics of that id in the \
             file; {again}"
        )
    );
    assert!(error(r#""focalLength": "9""#, r#""focalLength": "-9""#).contains("must be positive"));
    let mirrored = error(r#"["0", "0", "1", "#, r#"["0", "0", "-1", "#);
    assert!(mirrored.contains("mirrors"), "{mirrored}");
    let twice = SFM
        .replace(r#""7", "poseId": "7""#, r#""7", "poseId": "6""#)
        .replace("images/b", "images/a");
    let twice = parse(&twice).unwrap_err().to_string();
    assert!(
        twice.contains("the image is named \"images/a.jpg\", as views[0]"),
        "{twice}"
    );
}

#[test]
fn damaged_files_are_refused() {
    damage(SFM.as_bytes(), SFM.len(), |path: &Path| read_meshroom(path));
}
