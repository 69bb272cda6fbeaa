use crate::broken::damage;
use crate::captures::reprojection_errors_px;
use calibrate::formats::{FormatError, read_openmvg};
use calibrate::{ModelKind, Reconstruction};
use glam::DVec3;
use std::path::Path;

/// As OpenMVG's documentation shows it: a camera at (1, 2, 3) that looks along the
/// world's x, and a point 10 ahead of it, 1 to its right; view 1 has no pose.
pub(crate) const SFM_DATA: &str = r#"{"sfm_data_version": "0.3", "root_path": "/photos",
"views": [
 {"key": 0, "value": {"polymorphic_id": 1073741824, "ptr_wrapper": {"id": 2147483649, "data":
  {"local_path": "/", "filename": "a.jpg", "width": 100, "height": 80, "id_view": 0,
   "id_intrinsic": 0, "id_pose": 0}}}},
 {"key": 1, "value": {"polymorphic_id": 1073741824, "ptr_wrapper": {"id": 2147483650, "data":
  {"local_path": "day 2/", "filename": "b.jpg", "width": 100, "height": 80, "id_view": 1,
   "id_intrinsic": 1, "id_pose": 1}}}}],
"intrinsics": [
 {"key": 0, "value": {"polymorphic_id": 2147483649, "polymorphic_name": "pinhole_radial_k3",
  "ptr_wrapper": {"id": 2147483651, "data": {"width": 100, "height": 80, "focal_length": 90.0,
   "principal_point": [51.5, 38.0], "disto_k3": [0.0, 0.0, 0.0]}}}},
 {"key": 1, "value": {"polymorphic_id": 1,
  "ptr_wrapper": {"id": 2147483652, "data": {"width": 100, "height": 80, "focal_length": 91.0,
   "principal_point": [50.0, 40.0], "disto_k3": [0.1, 0.2, 0.3]}}}}],
"extrinsics": [{"key": 0, "value": {
 "rotation": [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]],
 "center": [1.0, 2.0, 3.0]}}],
"structure": [{"key": 4, "value": {"X": [11.0, 1.0, 3.0], "observations": [
 {"key": 0, "value": {"id_feat": 0, "x": [60.5, 38.0]}},
 {"key": 1, "value": {"id_feat": 0, "x": [1.0, 1.0]}}]}}],
"control_points": []}"#;

fn parse(text: &str) -> Result<Reconstruction, FormatError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sfm_data.json");
    std::fs::write(&path, text).unwrap();
    read_openmvg(&path)
}

fn error(from: &str, to: &str) -> String {
    assert!(SFM_DATA.contains(from), "{from}");
    let error = parse(&SFM_DATA.replacen(from, to, 1))
        .unwrap_err()
        .to_string();
    let (_, rest) = error.split_once("sfm_data.json, ").unwrap();
    rest.to_owned()
}

#[test]
fn rotations_are_by_rows_and_pixels_shift_by_half() {
    let whole = parse(SFM_DATA).unwrap();
    assert_eq!(whole.images.len(), 1, "view 1 has no pose");
    let image = whole.images.values().next().unwrap();
    assert_eq!(image.name, "a.jpg");
    let ahead = image.camera_from_world * DVec3::new(11.0, 1.0, 3.0);
    assert!(
        ahead.distance(DVec3::new(1.0, 0.0, 10.0)) < 1e-12,
        "{ahead}"
    );
    let camera = &whole.cameras[&image.camera_id];
    assert_eq!(camera.params[..4], [90.0, 90.0, 52.0, 38.5]);
    assert!(reprojection_errors_px(&whole)[0] < 1e-12);
    // The second camera's type is named by the first.
    let second = whole.cameras.values().last().unwrap();
    assert_eq!(second.params[4..], [0.1, 0.2, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0]);
}

#[test]
fn every_documented_lens_is_read() {
    let lens = |name: &str, data: &str| {
        let text = SFM_DATA.replacen("pinhole_radial_k3", name, 1);
        let text = text.replace(r#""disto_k3": [0.0, 0.0, 0.0]"#, data);
        let text = text.replace(r#""disto_k3": [0.1, 0.2, 0.3]"#, data);
        let camera = parse(&text).unwrap().cameras.into_values().next().unwrap();
        (camera.model, camera.params[4..].to_vec())
    };
    assert_eq!(lens("pinhole", r#""x": 0"#), (ModelKind::Pinhole, vec![]));
    assert_eq!(
        lens("pinhole_radial_k1", r#""disto_k1": [0.1]"#),
        (ModelKind::OpenCv, vec![0.1, 0.0, 0.0, 0.0])
    );
    assert_eq!(
        lens("pinhole_brown_t2", r#""disto_t2": [1, 2, 3, 4, 5]"#),
        (
            ModelKind::FullOpenCv,
            vec![1.0, 2.0, 4.0, 5.0, 3.0, 0.0, 0.0, 0.0]
        )
    );
    assert_eq!(
        lens("fisheye", r#""fisheye": [0.1, 0.2, 0.3, 0.4]"#),
        (ModelKind::OpenCvFisheye, vec![0.1, 0.2, 0.3, 0.4])
    );
}

#[test]
fn errors_name_the_record_and_a_remedy() {
    assert_eq!(
        error("pinhole_radial_k3", "spherical"),
        "intrinsics[0].value: found the lens \"spherical\", expected pinhole, pinhole_radial_k1, \
         pinhole_radial_k3, pinhole_brown_t2 or fisheye; undistort the photos with \
         openMVG_main_ExportUndistortedImages"
    );
    let unnamed = error("\"polymorphic_id\": 1,", "\"polymorphic_id\": 2,");
    assert!(
        unnamed.starts_with("intrinsics[1].value.polymorphic_id: found a type"),
        "{unnamed}"
    );
    assert!(error("[1.0, 0.0, 0.0]]", "[-1.0, 0.0, 0.0]]").contains("mirrors"));
    assert!(error("90.0", "-90.0").contains("must be positive"));
}

#[test]
fn damaged_files_are_refused() {
    damage(SFM_DATA.as_bytes(), SFM_DATA.len(), |path: &Path| {
        read_openmvg(path)
    });
}
