use crate::broken::damage;
use crate::captures::{angle_between, capture};
use calibrate::colmap::{find_model, read_model};
use calibrate::formats::{FormatError, parse_files_beside, read_transforms};
use calibrate::{Camera, ModelKind, Pixel, Reconstruction};
use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

fn no_photo(_: &str) -> Option<(u32, u32)> {
    None
}

const FRAME: &str = r#"{"file_path": ".\\a\\b c.jpg", "transform_matrix":
    [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]}"#;

/// Reads one frame with these intrinsics.
fn parse(intrinsics: &str, frames: &str) -> Result<Reconstruction, FormatError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transforms.json");
    std::fs::write(&path, format!("{{{intrinsics}, \"frames\": [{frames}]}}")).unwrap();
    read_transforms(&path, &no_photo)
}

fn camera(intrinsics: &str) -> Camera {
    let whole = parse(intrinsics, FRAME).unwrap();
    assert_eq!(whole.cameras.len(), 1);
    whole.cameras.into_values().next().unwrap()
}

fn error(intrinsics: &str, frames: &str) -> String {
    let error = parse(intrinsics, frames).unwrap_err().to_string();
    let (_, rest) = error.split_once("transforms.json, ").unwrap();
    rest.to_owned()
}

#[test]
fn lego_gives_the_cameras_of_its_model() {
    let Some(path) = capture("lego/transforms_train.json") else {
        return;
    };
    let whole = read_transforms(&path, &|_| Some((400, 400))).unwrap();
    let model = read_model(&find_model(path.parent().unwrap()).unwrap()).unwrap();
    assert_eq!(whole.images.len(), model.images.len());
    let (mut worst_turn, mut worst_shift) = (0.0_f64, 0.0_f64);
    for image in whole.images.values() {
        let stem = image.name.strip_prefix("images/").unwrap();
        let twin = model
            .images
            .values()
            .find(|twin| twin.name == format!("{stem}.png"))
            .unwrap();
        let (pose, expected) = (image.camera_from_world, twin.camera_from_world);
        worst_turn = worst_turn.max(angle_between(pose, expected));
        worst_shift = worst_shift.max(pose.center().distance(expected.center()));
        let camera = &whole.cameras[&image.camera_id];
        let stored = &model.cameras[&twin.camera_id];
        assert_eq!((camera.model, camera.width), (stored.model, stored.width));
        for (found, expected) in camera.params.iter().zip(&stored.params) {
            assert!((found - expected).abs() < 1e-9, "{found} is not {expected}");
        }
    }
    println!("worst rotation {worst_turn:.2e} rad, centre {worst_shift:.2e}");
    assert!(worst_turn < 1e-9, "{worst_turn}");
    assert!(worst_shift < 1e-9, "{worst_shift}");
}

#[test]
fn fox_reads_with_its_distortion() {
    let Some(path) = capture("other-formats/instant-ngp-fox/transforms.json") else {
        return;
    };
    let whole = read_transforms(&path, &no_photo).unwrap();
    assert_eq!(whole.images.len(), 25);
    assert_eq!(whole.cameras.len(), 1);
    let camera = whole.cameras.values().next().unwrap();
    assert_eq!(camera.model, ModelKind::OpenCv);
    assert_eq!((camera.width, camera.height), (480, 853));
    assert_eq!(
        camera.params[2..],
        [
            246.47022222222222,
            428.84041875,
            0.0578421,
            -0.0805099,
            -0.000980296,
            0.00015575
        ]
    );
    for image in whole.images.values() {
        assert!(path.parent().unwrap().join(&image.name).is_file());
    }
}

#[test]
fn the_axes_are_opengl_s() {
    let whole = parse(r#""w": 100, "h": 80, "fl_x": 90"#, FRAME).unwrap();
    let image = whole.images.values().next().unwrap();
    assert_eq!(image.name, "a/b c.jpg");
    let in_camera = |x, y, z| image.camera_from_world * DVec3::new(x, y, z);
    assert_eq!(in_camera(1.0, 2.0, 3.0), DVec3::ZERO);
    // An OpenGL camera looks along −z with y up.
    assert_eq!(in_camera(1.0, 2.0, -7.0), DVec3::new(0.0, 0.0, 10.0));
    assert_eq!(in_camera(1.0, 5.0, 3.0), DVec3::new(0.0, -3.0, 0.0));
    assert_eq!(in_camera(2.0, 2.0, 3.0), DVec3::new(1.0, 0.0, 0.0));
}

#[test]
fn the_applied_transform_leaves_the_poses_as_they_are() {
    let shared = r#""w": 100, "h": 80, "fl_x": 90"#;
    let applied = format!(
        "{shared}, \"applied_transform\": [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0]], \
         \"applied_scale\": 0.5"
    );
    assert_eq!(
        parse(&applied, FRAME).unwrap(),
        parse(shared, FRAME).unwrap()
    );
}

#[test]
fn intrinsics_come_in_many_ways() {
    let square = camera(r#""w": 100.0, "h": 80, "fl_x": 90"#);
    assert_eq!(square.model, ModelKind::Pinhole);
    assert_eq!(square.params, [90.0, 90.0, 50.0, 40.0]);
    let angles = camera(
        r#""w": 100, "h": 80, "camera_angle_x": 1.5707963267948966, "y_fov": 53.13010235415598"#,
    );
    assert!((angles.params[0] - 50.0).abs() < 1e-12, "{angles:?}");
    assert!((angles.params[1] - 80.0).abs() < 1e-12, "{angles:?}");
    let fisheye = camera(
        r#""w": 100, "h": 80, "fl_x": 90, "camera_model": "OPENCV_FISHEYE", "k1": 0.1, "k2": 0.2,
           "k3": 0.3, "k4": 0.4"#,
    );
    assert_eq!(fisheye.model, ModelKind::OpenCvFisheye);
    assert_eq!(fisheye.params[4..], [0.1, 0.2, 0.3, 0.4]);
    let sixth = camera(r#""w": 100, "h": 80, "fl_x": 90, "k1": 0.1, "k3": 0.3, "p2": 0.01"#);
    assert_eq!(sixth.model, ModelKind::FullOpenCv);
    assert_eq!(sixth.params[4..], [0.1, 0.0, 0.0, 0.01, 0.3, 0.0, 0.0, 0.0]);
}

#[test]
fn a_frame_s_own_intrinsics_go_first() {
    let own = FRAME
        .replace("b c.jpg", "d.jpg")
        .replacen('{', r#"{"fl_x": 70, "k1": 0.5,"#, 1);
    let shared = r#""w": 100, "h": 80, "fl_x": 90, "fl_y": 91"#;
    let whole = parse(
        shared,
        &format!("{FRAME}, {own}, {}", own.replace("d.j", "e.j")),
    )
    .unwrap();
    let cameras: Vec<_> = whole
        .cameras
        .values()
        .map(|c| (c.model, c.params.clone()))
        .collect();
    assert_eq!(
        cameras,
        [
            (ModelKind::Pinhole, vec![90.0, 91.0, 50.0, 40.0]),
            (
                ModelKind::OpenCv,
                vec![70.0, 70.0, 50.0, 40.0, 0.5, 0.0, 0.0, 0.0]
            ),
        ]
    );
    let used: Vec<u32> = whole
        .images
        .values()
        .map(|image| image.camera_id.0)
        .collect();
    assert_eq!(used, [1, 2, 2], "equal cameras are one");
}

/// nerfstudio looks for each key on its own, in the frame or for all.
#[test]
fn one_axis_of_a_frame_joins_the_other_of_all_frames() {
    let own = |key: &str| FRAME.replacen('{', &format!("{{{key},"), 1);
    for (shared, own) in [
        (r#""fl_y": 146"#, own(r#""fl_x": 123"#)),
        (r#""fl_x": 123"#, own(r#""fl_y": 146"#)),
    ] {
        let whole = parse(&format!(r#""w": 200, "h": 136, {shared}"#), &own).unwrap();
        let camera = whole.cameras.values().next().unwrap();
        assert_eq!(camera.params[..2], [123.0, 146.0], "{shared}");
    }
}

/// nerfstudio's order: k1 k2 k3 k4 p1 p2.
#[test]
fn distortion_comes_as_a_list_too() {
    let shared = r#""w": 100, "h": 80, "fl_x": 90"#;
    let list = |numbers: &str| format!("{shared}, \"distortion_params\": {numbers}");
    let plain = camera(&list("[0.1, 0.2, 0, 0, 0.01, 0.02]"));
    assert_eq!(plain.model, ModelKind::OpenCv);
    assert_eq!(plain.params[4..], [0.1, 0.2, 0.01, 0.02]);
    let fisheye = list("[0.1, 0.2, 0.3, 0.4, 0, 0]") + r#", "camera_model": "OPENCV_FISHEYE""#;
    assert_eq!(camera(&fisheye).params[4..], [0.1, 0.2, 0.3, 0.4]);
    // Of one and the same level the list counts, as it does for nerfstudio.
    let both = list("[0.1, 0.2, 0, 0, 0, 0]") + r#", "k1": 0.5, "k3": 0.5"#;
    assert_eq!(camera(&both).params[4..], [0.1, 0.2, 0.0, 0.0]);

    // What a frame says goes first, whichever way.
    let own = |key: &str, name: &str| {
        let frame = FRAME.replace("b c.jpg", name);
        frame.replacen('{', &format!("{{{key},"), 1)
    };
    let with_list = own(r#""distortion_params": [0.3, 0, 0, 0, 0, 0]"#, "d.jpg");
    let with_k1 = own(r#""k1": 0.4"#, "e.jpg");
    let frames = format!("{FRAME}, {with_list}, {with_k1}");
    let whole = parse(&list("[0.1, 0.2, 0, 0, 0, 0]"), &frames).unwrap();
    let first: Vec<_> = whole.cameras.values().map(|c| &c.params[4..6]).collect();
    assert_eq!(first, [[0.1, 0.2], [0.3, 0.0], [0.4, 0.0]]);

    let short = error(&list("[0.1, 0.2, 0, 0]"), FRAME);
    let expected = "distortion_params: found an array of 4, expected an array of 6";
    assert!(short.starts_with(expected), "{short}");
    let eighth = error(&list("[0.1, 0.2, 0, 0.4, 0, 0]"), FRAME);
    assert!(eighth.contains("k4 is 0.4, an r⁸ term"), "{eighth}");
}

#[test]
fn coefficients_that_a_model_lacks_are_refused() {
    let with = |model: &str, terms: &str| {
        format!(r#""w": 100, "h": 80, "fl_x": 90, "camera_model": "{model}", "k1": 0.1, {terms}"#)
    };
    let full = camera(&with("FULL_OPENCV", r#""k5": 0.5, "k6": 0.2"#));
    assert_eq!(full.params[4..], [0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.2]);
    let zero = camera(&with("OPENCV", r#""k5": 0, "k6": 0.0"#));
    assert_eq!(zero.model, ModelKind::OpenCv);
    for model in ["OPENCV", "RADIAL", "SIMPLE_RADIAL"] {
        assert_eq!(
            error(&with(model, r#""k4": 0.3, "k5": 0.5"#), FRAME),
            "camera_model: k5 is 0.5 and k6 is 0, which FULL_OPENCV alone has; set camera_model \
             to FULL_OPENCV if it is one, or undistort the photos"
        );
    }
    assert_eq!(
        error(&with("OPENCV_FISHEYE", r#""k6": 0.2"#), FRAME),
        "camera_model: found a fisheye with k5 = 0 and k6 = 0.2, expected none; undistort the \
         photos and export them as PINHOLE"
    );
}

#[test]
fn intrinsics_that_are_no_pixels_are_refused() {
    let remedy = "if these are shares of the photo's sides, multiply cx and fl_x by the width and cy and fl_y by the \
                  height";
    let with = |more: &str| format!(r#""w": 160, "h": 120, {more}"#);
    assert_eq!(
        error(&with(r#""fl_x": 297.6, "cx": 0.5, "cy": 0.51"#), FRAME),
        format!("cx: cx is 0.5 and cy is 0.51, expected pixels of 160 × 120; {remedy}")
    );
    assert_eq!(
        error(&with(r#""fl_x": 1.2, "fl_y": 1.6"#), FRAME),
        format!("fl_x: found 1.2, expected pixels of 160; {remedy}")
    );
    // Corners of larger photos, and tiny photos.
    for (cx, cy) in [(0.0, 0.0), (0.5, 60.0), (-0.5, 0.5)] {
        let camera = camera(&with(&format!(r#""fl_x": 90, "cx": {cx}, "cy": {cy}"#)));
        assert_eq!(camera.params[2..], [cx, cy]);
    }
    camera(r#""w": 2, "h": 2, "fl_x": 1.2, "cx": 1, "cy": 1"#);
    camera(&with(r#""camera_angle_x": 3.1"#));
}

#[test]
fn panoramas_are_nerfstudios() {
    let size = r#""w": 400, "h": 200, "camera_model": "EQUIRECTANGULAR""#;
    let camera = camera(size);
    assert_eq!(camera.model, ModelKind::Equirectangular);
    assert_eq!(camera.params, [400.0, 200.0]);
    let lens = camera.lens().unwrap();
    for (x, y) in [(200.0, 100.0), (10.5, 20.5), (301.0, 44.0), (399.0, 199.0)] {
        // As its `Camera` has rays: in OpenGL's axes, from shares of the focal lengths (fx = w/2, fy = h).
        let (theta, phi) = (-PI * (x - 200.0) / 200.0, PI * (0.5 + (y - 100.0) / 200.0));
        let ray = DVec3::new(
            -theta.sin() * phi.sin(),
            phi.cos(),
            -theta.cos() * phi.sin(),
        );
        let found = lens.unproject(Pixel::new(x, y)).unwrap();
        let expected = DVec3::new(ray.x, -ray.y, -ray.z);
        assert!((found - expected).length() < 1e-12, "{x} {y}: {found}");
    }
    let whole = r#""fl_x": 200, "fl_y": 200, "cx": 200, "cy": 100, "k1": 0"#;
    assert_eq!(self::camera(&format!("{size}, {whole}")), camera);
    assert_eq!(
        error(&format!("{size}, \"fl_x\": 120"), FRAME),
        "fl_x: found 120, expected 200: a panorama of 400 × 200 pixels that goes all round; remove the key if it \
         does, or cut it into views and export these as PINHOLE"
    );
    assert_eq!(
        error(&format!("{size}, \"k1\": 0.5"), FRAME),
        "frames[0] (a/b c.jpg): found EQUIRECTANGULAR with k1 = 0.5, which a panorama lacks; remove the coefficients"
    );
}

#[test]
fn errors_name_the_frame_and_a_remedy() {
    let shared = r#""w": 100, "h": 80, "fl_x": 90"#;
    let again = "copy the file again, or export it again from the program it is from";
    assert_eq!(
        error(r#""fl_x": 90"#, FRAME),
        "frames[0] (a/b c.jpg): the format does not say the size of \"a/b c.jpg\", and no such \
         photo was found; give the folder that holds the photos"
    );
    assert_eq!(
        error(r#""w": 100, "h": 80"#, FRAME),
        "frames[0] (a/b c.jpg): there is no focal length, neither here nor for all frames; add \
         fl_x and fl_y in pixels, or camera_angle_x in radians"
    );
    assert_eq!(
        error(r#""w": 100, "h": 80, "fl_x": -90"#, FRAME),
        "frames[0] (a/b c.jpg): focal length fx of PINHOLE is -90; it must be positive; \
         calibrate it again, or leave its images out"
    );
    assert_eq!(
        error(shared, &format!("{FRAME}, {FRAME}")),
        "frames[1] (a/b c.jpg): the image is named \"a/b c.jpg\", as frames[0] (a/b c.jpg) \
         already is; remove one of the two, or give each photo a name of its own"
    );
    assert_eq!(
        error(shared, &FRAME.replace("[1, 0, 0, 1]", "[2, 0, 0, 1]")),
        "frames[0] (a/b c.jpg).transform_matrix: the rotation's columns have the lengths 2, 1 \
         and 1 and RᵀR differs from the identity by up to 3.000e0, expected a rotation matrix; \
         take the scale or shear out of the matrix, or export it again with more digits"
    );
    assert_eq!(
        error(shared, &FRAME.replace("[1, 0, 0, 1]", "[-1, 0, 0, 1]")),
        "frames[0] (a/b c.jpg).transform_matrix: the rotation mirrors (its determinant is −1), \
         expected a rotation matrix; check that no axis was negated on the way"
    );
    assert_eq!(
        error(shared, &FRAME.replace("[1, 0, 0, 1]", "[1, 0, 0]")),
        format!(
            "frames[0] (a/b c.jpg).transform_matrix[0]: found an array of 3, expected an array \
             of 4; {again}"
        )
    );
    assert_eq!(
        error(
            &format!("{shared}, \"camera_model\": \"ORTHOGRAPHIC\""),
            FRAME
        ),
        "camera_model: found the camera model \"ORTHOGRAPHIC\", expected PINHOLE, OPENCV, \
         OPENCV_FISHEYE or EQUIRECTANGULAR; undistort the photos and export them as PINHOLE"
    );
    assert_eq!(
        error(
            &format!("{shared}, \"camera_model\": \"PINHOLE\", \"k1\": 0.5"),
            FRAME
        ),
        "camera_model: found PINHOLE with k1 = 0.5, which a pinhole lacks; set camera_model to \
         OPENCV, or remove the coefficients"
    );
    let nan = error(shared, &FRAME.replace("[1, 0, 0, 1]", "[NaN, 0, 0, 1]"));
    assert!(nan.starts_with("line 2 column 7: not JSON"), "{nan}");
    let place = ": not JSON: frames[0].transform_matrix[0][0] (a/b c.jpg) is NaN, expected a finite \
                 number; remove what has it, as a frame without a pose, or export it again from the \
                 program it is from";
    assert!(nan.ends_with(place), "{nan}");
    // A name may be called so; and what is wrong besides comes first.
    let infinite = format!("\"note\": \"not \\\" NaN\", {shared}, \"k1\": -Infinity");
    let infinite = error(&infinite, FRAME);
    let expected = ": not JSON: k1 is -Infinity, expected";
    assert!(infinite.contains(expected), "{infinite}");
    let broken = error(&format!("{shared}, \"k1\": NaN, k2"), FRAME);
    assert!(
        broken.contains(": not JSON: expected value; copy"),
        "{broken}"
    );
    assert!(error(shared, "").starts_with("frames: the file holds no image with a pose"));
}

#[test]
fn small_deviations_become_the_nearest_rotation() {
    let rounded = FRAME.replace("[1, 0, 0, 1]", "[1.00003, 0.00002, 0, 1]");
    let whole = parse(r#""w": 100, "h": 80, "fl_x": 90"#, &rounded).unwrap();
    let rotation = whole
        .images
        .values()
        .next()
        .unwrap()
        .camera_from_world
        .rotation;
    assert!((rotation.length() - 1.0).abs() < 1e-15);
}

#[test]
fn times_are_those_of_the_frames() {
    let read = |text: &str| parse_files_beside(Path::new("a/transforms.json"), text.as_bytes());
    let text = r#"{"frames": [{"file_path": "./train/1", "time": 0},
        {"file_path": "train/2", "time": 0.25}, {"file_path": "train/3", "time": null}]}"#;
    let expected = [("train/1".to_owned(), 0.0), ("train/2".to_owned(), 0.25)];
    assert_eq!(read(text).unwrap().times, BTreeMap::from(expected));
    let error = read(&text.replace("0.25", "\"noon\""))
        .unwrap_err()
        .to_string();
    let said = "a/transforms.json, frames[1].time: found \"noon\", expected a finite number";
    assert!(error.starts_with(said), "{error}");
}

#[test]
fn masks_depth_maps_and_points_are_named_from_the_file_s_folder() {
    let named = |text: &str| parse_files_beside(Path::new("a/transforms.json"), text.as_bytes());
    let beside = named(
        r#"{"ply_file_path": "sparse_pc.ply", "applied_scale": 0.5, "frames": [
            {"file_path": "./images\\1.jpg", "mask_path": ".\\masks\\1.png"},
            {"file_path": "images/2.jpg", "mask_path": null, "depth_file_path": "/d/2.png"},
            {"file_path": "images/3.jpg", "mask_path": "", "depth_file_path": "../d/3.png"}]}"#,
    )
    .unwrap();
    let list = |files: &BTreeMap<String, PathBuf>| -> Vec<String> {
        let files = files.iter();
        let text = |(image, file): (&String, &PathBuf)| format!("{image}: {}", file.display());
        files.map(text).collect()
    };
    assert_eq!(list(&beside.masks), ["images/1.jpg: a/masks/1.png"]);
    assert_eq!(
        list(&beside.depth_maps),
        ["images/2.jpg: /d/2.png", "images/3.jpg: a/../d/3.png"]
    );
    assert_eq!(beside.points, Some(PathBuf::from("a/sparse_pc.ply")));
    assert_eq!(beside.applied_scale, 0.5);

    let bare = named(&format!("{{\"frames\": [{FRAME}]}}")).unwrap();
    assert!(bare.masks.is_empty() && bare.depth_maps.is_empty());
    assert_eq!((bare.points, bare.applied_scale), (None, 1.0));
    for (text, expected) in [
        (
            r#"{"frames": [{"file_path": "a", "mask_path": 7}]}"#,
            "a/transforms.json, frames[0].mask_path: found 7, expected a string",
        ),
        (
            r#"{"applied_scale": 0, "frames": []}"#,
            "a/transforms.json, applied_scale: found 0, expected more than 0",
        ),
    ] {
        let error = named(text).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
    }
}

#[test]
fn damaged_files_are_refused() {
    let text = format!(
        "{{\"w\": 100, \"h\": 80, \"fl_x\": 90, \"k1\": 0.1, \"frames\": [{FRAME}, {}]}}",
        FRAME.replace("b c", "d")
    );
    let read = |path: &Path| read_transforms(path, &no_photo);
    damage(text.as_bytes(), text.len(), read);
}
