//! What is exported reads back the same.

use calibrate::export::{
    ExportError, FrameFiles, check_colmap, check_colmap_text, opencv_yaml, transforms_json,
};
use calibrate::formats::read_transforms;
use calibrate::opencv::{Keys, read_calibration};
use calibrate::{
    Camera, CameraId, Image, ImageId, Keypoint, ModelKind, Point3D, Point3DId, Reconstruction,
    Rigid3, colmap,
};
use glam::{DQuat, DVec3};
use proptest::prelude::*;
use std::fs;
use std::path::Path;

fn camera(model: ModelKind, distortion: &[f64]) -> Camera {
    let one_focal = model.parameter_names()[0] == "f";
    let mut params = vec![517.300_000_000_1, 318.6 + 0.1, 1.0 / 3.0 + 255.0];
    if !one_focal {
        params.insert(1, 516.5);
    }
    params.extend(distortion);
    Camera {
        model,
        width: 640,
        height: 480,
        params,
    }
}

/// What both formats can express.
fn expressible() -> Vec<Camera> {
    use ModelKind::*;
    vec![
        camera(SimplePinhole, &[]),
        camera(Pinhole, &[]),
        camera(SimpleRadial, &[-0.1]),
        camera(Radial, &[-0.1, 0.01]),
        camera(OpenCv, &[0.1, -0.2, 1e-3, -2e-4]),
        camera(FullOpenCv, &[0.1, -0.2, 1e-3, -2e-4, 0.03, 0.0, 0.0, 0.0]),
    ]
}

fn fisheyes() -> Vec<Camera> {
    use ModelKind::*;
    vec![
        camera(SimpleFisheye, &[]),
        camera(Fisheye, &[]),
        camera(SimpleRadialFisheye, &[0.02]),
        camera(RadialFisheye, &[0.02, -0.003]),
        camera(OpenCvFisheye, &[0.02, -0.003, 1e-4, -1e-5]),
    ]
}

/// Photos that go all round, of a size.
fn panorama(width: u32, height: u32) -> Camera {
    Camera {
        model: ModelKind::Equirectangular,
        width,
        height,
        params: vec![width.into(), height.into()],
    }
}

/// What OpenCV alone has: 12 coefficients, 14, a skewed fisheye.
fn opencvs_own() -> Vec<Camera> {
    use ModelKind::*;
    let rational = [0.1, -0.2, 1e-3, -2e-4, 0.03, 0.0, 0.0, 0.0];
    let prisms = [1e-3, -2e-3, 3e-4, 1e-4];
    vec![
        camera(OpenCvTilted, &[&rational[..], &prisms, &[0.0; 2]].concat()),
        camera(
            OpenCvTilted,
            &[&rational[..], &[0.0; 4], &[0.05, -0.02]].concat(),
        ),
        camera(OpenCvSkewedFisheye, &[0.02, -0.003, 1e-4, -1e-5, 0.01]),
    ]
}

/// An image for each camera and pose.
fn reconstruction(cameras: &[Camera], poses: &[Rigid3]) -> Reconstruction {
    let mut whole = Reconstruction::default();
    for (i, camera) in cameras.iter().enumerate() {
        whole.cameras.insert(CameraId(i as u32 + 3), camera.clone());
    }
    for (i, &camera_from_world) in poses.iter().enumerate() {
        let image = Image {
            name: format!("left \"{i}\"/photo {i}.jpg"),
            camera_id: CameraId((i % cameras.len()) as u32 + 3),
            camera_from_world,
            keypoints: vec![],
        };
        whole.images.insert(ImageId(10 + i as u32), image);
    }
    whole
}

fn through_transforms(whole: &Reconstruction) -> Reconstruction {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transforms.json");
    let files = |image: &Image| FrameFiles {
        photo: image.name.clone(),
        mask: None,
        depth: None,
        time_s: None,
    };
    fs::write(&path, transforms_json(whole, &files).unwrap()).unwrap();
    read_transforms(&path, &|name| panic!("{name}: the size is in the file")).unwrap()
}

fn through_opencv(whole: &Reconstruction) -> Reconstruction {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("camera.yml");
    let text = opencv_yaml(whole, &|image| image.name.clone()).unwrap();
    fs::write(&path, text).unwrap();
    let read = read_calibration(&path, &Keys::default()).unwrap();
    assert!(read.notes.is_empty(), "{:?}", read.notes);
    read.reconstruction(&read.image_names, (0, 0))
}

/// The same photos through the same lenses from the same places: sizes and coefficients to
/// the last bit, the rest to 1e-12 of its size.
#[track_caller]
fn assert_same(found: &Reconstruction, expected: &Reconstruction) {
    assert_eq!(found.images.len(), expected.images.len());
    for (a, b) in found.images.values().zip(expected.images.values()) {
        assert_eq!(a.name, b.name);
        let (p, q) = (a.camera_from_world, b.camera_from_world);
        let turned = (p.rotation * q.rotation.conjugate()).xyz().length();
        assert!(2.0 * turned < 1e-12, "{}: {turned} radians", a.name);
        let scale = q.translation.length().max(1.0);
        let moved = p.translation.distance(q.translation);
        assert!(moved < 1e-12 * scale, "{}: {moved} of {scale}", a.name);

        let (c, d) = (
            &found.cameras[&a.camera_id],
            &expected.cameras[&b.camera_id],
        );
        assert_eq!((c.width, c.height), (d.width, d.height));
        let (c, d) = (c.lens().unwrap(), d.lens().unwrap());
        assert_eq!(c.focal, d.focal);
        assert_eq!(c.distortion(), d.distortion());
        assert!((c.principal - d.principal).length() < 1e-12 * d.principal.length());
    }
}

fn pose() -> impl Strategy<Value = Rigid3> {
    let axis = [-1.0..1.0, -1.0..1.0, -1.0..1.0];
    // Next to nothing, and next to half a turn, are where rotation vectors are delicate.
    let angle = prop_oneof![
        -10.0..10.0,
        (0.0..16.0).prop_map(|e: f64| 10.0_f64.powf(-e)),
        (0.0..16.0).prop_map(|e: f64| std::f64::consts::PI - 10.0_f64.powf(-e)),
        Just(0.0),
    ];
    let translation = prop_oneof![Just(1.0), Just(1e7)];
    (axis, angle, axis_of_translation(), translation).prop_map(|(axis, angle, t, scale)| {
        let axis = DVec3::from_array(axis).normalize_or(DVec3::Z);
        Rigid3::new(DQuat::from_axis_angle(axis, angle), t * scale)
    })
}

fn axis_of_translation() -> impl Strategy<Value = DVec3> {
    [-1.0..1.0, -1.0..1.0, -1.0..1.0].prop_map(DVec3::from_array)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn poses_and_intrinsics_read_back(
        poses in prop::collection::vec(pose(), 2..5),
        model in 0..expressible().len() + fisheyes().len(),
    ) {
        let cameras = [expressible(), fisheyes()].concat();
        let whole = reconstruction(&cameras[model..=model], &poses);
        assert_same(&through_transforms(&whole), &whole);
        assert_same(&through_opencv(&whole), &whole);
    }
}

#[test]
fn opencvs_own_lenses_read_back_from_its_files() {
    for (camera, rows, skew) in [
        (&opencvs_own()[0], 12, "0.0"),
        (&opencvs_own()[1], 14, "0.0"),
        (&opencvs_own()[2], 4, "5.173"),
    ] {
        let whole = reconstruction(std::slice::from_ref(camera), &[Rigid3::IDENTITY; 2]);
        assert_same(&through_opencv(&whole), &whole);
        let text = opencv_yaml(&whole, &|image| image.name.clone()).unwrap();
        let shape = format!("distortion_coefficients: !!opencv-matrix\n   rows: {rows}\n");
        assert!(text.contains(&shape), "{text}");
        assert!(
            text.contains(&format!("data: [ 517.3000000001, {skew}")),
            "{text}"
        );
    }
}

/// OpenCV reads `3d` without quotes as a number, and refuses the file.
#[test]
fn element_types_of_several_channels_are_in_quotes() {
    let mut whole = reconstruction(&expressible()[1..2], &[Rigid3::IDENTITY; 2]);
    for image in whole.images.values_mut() {
        image.keypoints = vec![Keypoint {
            x: 10.5,
            y: 20.0,
            point: Some(Point3DId(1)),
        }];
    }
    let point = Point3D {
        position: DVec3::new(0.25, 0.5, 2.0),
        color: [128; 3],
        error_px: -1.0,
        track: whole.images.keys().map(|id| (*id, 0)).collect(),
    };
    whole.points.insert(Point3DId(1), point);
    let text = opencv_yaml(&whole, &|image| image.name.clone()).unwrap();
    let board = "grid_points: !!opencv-matrix\n   rows: 1\n   cols: 1\n   dt: \"3d\"\n   \
                 data: [ 0.25, 0.5, 2.0 ]\n\
                 image_points: !!opencv-matrix\n   rows: 2\n   cols: 1\n   dt: \"2d\"\n   \
                 data: [ 10.0, 19.5, 10.0, 19.5 ]\n";
    assert!(text.ends_with(board), "{text}");
    assert!(text.contains("rows: 3\n   cols: 3\n   dt: d\n"), "{text}");
}

#[test]
fn colmap_lacks_some_models() {
    let check = |camera: &Camera| {
        let whole = reconstruction(std::slice::from_ref(camera), &[Rigid3::IDENTITY; 2]);
        check_colmap(&whole).map_err(|error| error.to_string())
    };
    for camera in [expressible(), fisheyes()].concat() {
        assert_eq!(check(&camera), Ok(()));
    }
    let refused = |model: &str, remedy: &str| {
        Err(format!(
            "camera 3 is {model}, which COLMAP cannot express; import the photos with \
             --undistort and export that scene{remedy}"
        ))
    };
    let [_, tilted, skewed] = &opencvs_own()[..] else {
        panic!("three cameras");
    };
    let as_opencv = ", or export as opencv";
    assert_eq!(check(tilted), refused("OPENCV_TILTED", as_opencv));
    assert_eq!(check(skewed), refused("OPENCV_SKEWED_FISHEYE", as_opencv));
    let inverse = camera(ModelKind::InverseRadial, &[-0.1]);
    assert_eq!(check(&inverse), refused("INVERSE_RADIAL", ""));
}

#[test]
fn colmap_reads_names_with_blanks_from_its_binary_format_alone() {
    let mut whole = reconstruction(&expressible(), &[Rigid3::IDENTITY; 2]);
    assert_eq!(check_colmap(&whole), Ok(()));
    for (image, name) in whole.images.values_mut().zip(["my_left.jpg", "right.jpg"]) {
        image.name = name.to_owned();
    }
    assert_eq!(check_colmap_text(&whole), Ok(()));
    for name in ["my right.jpg", "a\tb.jpg", "a\u{a0}b.jpg"] {
        let renamed = whole.images.values_mut().next_back().unwrap();
        renamed.name = name.to_owned();
        let error = check_colmap_text(&whole).unwrap_err().to_string();
        let said = "export with --format colmap, or rename the photo";
        assert!(error.starts_with(&format!("photo {name:?} has")), "{error}");
        assert!(error.contains(said), "{error}");
        assert_eq!(check_colmap(&whole), Ok(()));
    }
    let inverse = camera(ModelKind::InverseRadial, &[-0.1]);
    let lens = reconstruction(&[inverse], &[Rigid3::IDENTITY]);
    assert_eq!(check_colmap_text(&lens), check_colmap(&lens));
}

#[test]
fn a_transforms_file_holds_many_cameras() {
    let poses: Vec<Rigid3> = (0..7)
        .map(|i| Rigid3::new(DQuat::from_rotation_y(0.1 * f64::from(i)), DVec3::X))
        .collect();
    let panoramas = vec![panorama(4096, 2048), panorama(101, 50)];
    for cameras in [expressible(), fisheyes(), panoramas] {
        let whole = reconstruction(&cameras, &poses);
        assert_same(&through_transforms(&whole), &whole);
    }
}

#[test]
fn panoramas_are_written_as_nerfstudio_has_them() {
    let files = |image: &Image| FrameFiles {
        photo: image.name.clone(),
        mask: None,
        depth: None,
        time_s: None,
    };
    let text = |cameras: &[Camera]| {
        transforms_json(&reconstruction(cameras, &[Rigid3::IDENTITY; 2]), &files)
    };
    let one: serde_json::Value =
        serde_json::from_str(&text(&[panorama(400, 200)]).unwrap()).unwrap();
    assert_eq!(one["camera_model"], "EQUIRECTANGULAR");
    let intrinsics = ["w", "h", "fl_x", "fl_y", "cx", "cy"].map(|key| one[key].as_f64().unwrap());
    assert_eq!(intrinsics, [400.0, 200.0, 200.0, 200.0, 200.0, 100.0]);
    // It has one model for all, and no panorama that is cropped.
    let message = |cameras: &[Camera]| text(cameras).unwrap_err().to_string();
    assert_eq!(
        message(&[expressible()[1].clone(), panorama(400, 200)]),
        "camera 4 (EQUIRECTANGULAR) is a panorama and camera 3 (PINHOLE) is not, and transforms.json has one \
         camera_model for all; export as colmap"
    );
    let mut cropped = panorama(400, 200);
    cropped.height = 150;
    assert_eq!(
        message(&[cropped]),
        "camera 3 is EQUIRECTANGULAR of another size than its photos, which transforms.json cannot express; export \
         as colmap, or cut the panoramas into views first"
    );
}

#[test]
fn the_keys_are_those_that_nerfstudio_reads() {
    let files = |image: &Image| FrameFiles {
        photo: image.name.clone(),
        mask: (image.name.contains('1')).then(|| "m.png".to_owned()),
        depth: (image.name.contains('1')).then(|| "d.png".to_owned()),
        time_s: (image.name.contains('1')).then_some(0.1),
    };
    let json = |cameras: &[Camera]| -> serde_json::Value {
        let whole = reconstruction(cameras, &[Rigid3::IDENTITY; 2]);
        serde_json::from_str(&transforms_json(&whole, &files).unwrap()).unwrap()
    };
    let shared = json(&expressible()[4..5]);
    let keys: Vec<&String> = shared.as_object().unwrap().keys().collect();
    assert_eq!(
        keys.iter()
            .map(|k| k.as_str())
            .collect::<Vec<_>>()
            .join(" "),
        "camera_model w h fl_x fl_y cx cy k1 k2 p1 p2 applied_transform frames"
    );
    assert_eq!(shared["camera_model"], "OPENCV");
    assert_eq!(
        shared["applied_transform"].to_string(),
        "[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0]]"
    );
    // y up, z back.
    assert_eq!(shared["frames"][0]["transform_matrix"][1][1], -1.0);
    assert_eq!(shared["frames"][0]["transform_matrix"][2][2], -1.0);
    assert!(shared["frames"][0].get("mask_path").is_none());
    assert_eq!(shared["frames"][1]["mask_path"], "m.png");
    assert!(shared["frames"][0].get("depth_file_path").is_none());
    assert_eq!(shared["frames"][1]["depth_file_path"], "d.png");
    assert!(shared["frames"][0].get("time").is_none());
    assert_eq!(shared["frames"][1]["time"], 0.1);

    let own = json(&expressible()[1..3]);
    assert_eq!(own["camera_model"], "OPENCV");
    assert!(own.get("fl_x").is_none());
    assert_eq!(own["frames"][1]["k1"], -0.1);
    assert_eq!(json(&expressible()[..1])["camera_model"], "PINHOLE");
    assert_eq!(json(&fisheyes()[..1])["camera_model"], "OPENCV_FISHEYE");
}

#[test]
fn what_cannot_be_expressed_is_named() {
    let one = |cameras: &[Camera]| reconstruction(cameras, &[Rigid3::IDENTITY; 2]);
    let transforms = |cameras: &[Camera]| {
        let files = |image: &Image| FrameFiles {
            photo: image.name.clone(),
            mask: None,
            depth: None,
            time_s: None,
        };
        transforms_json(&one(cameras), &files)
            .unwrap_err()
            .to_string()
    };
    let opencv = |cameras: &[Camera]| {
        let text = opencv_yaml(&one(cameras), &|image| image.name.clone());
        text.unwrap_err().to_string()
    };
    let remedy = "import the photos with --undistort and export that scene, or export as colmap";
    let fov = camera(ModelKind::Fov, &[0.9]);
    assert_eq!(
        transforms(std::slice::from_ref(&fov)),
        format!("camera 3 is FOV, which transforms.json cannot express; {remedy}")
    );
    assert_eq!(
        opencv(std::slice::from_ref(&fov)),
        format!("camera 3 is FOV, which OpenCV's calibration file cannot express; {remedy}")
    );
    let rational = camera(
        ModelKind::FullOpenCv,
        &[0.1, 0.0, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0],
    );
    assert_eq!(
        transforms(std::slice::from_ref(&rational)),
        format!(
            "camera 3 is FULL_OPENCV with a denominator (k4, k5, k6), which transforms.json \
             cannot express; {remedy}"
        )
    );
    let only_opencv = "import the photos with --undistort and export that scene, or export as \
                       opencv";
    for (camera, what) in [
        (
            &opencvs_own()[0],
            "OPENCV_TILTED with thin prisms or a tilted sensor",
        ),
        (
            &opencvs_own()[1],
            "OPENCV_TILTED with thin prisms or a tilted sensor",
        ),
        (&opencvs_own()[2], "OPENCV_SKEWED_FISHEYE with skew"),
    ] {
        assert_eq!(
            transforms(std::slice::from_ref(camera)),
            format!("camera 3 is {what}, which transforms.json cannot express; {only_opencv}")
        );
    }
    let whole = one(std::slice::from_ref(&rational));
    assert_same(&through_opencv(&whole), &whole);

    let mixed = [fisheyes()[1].clone(), expressible()[1].clone()];
    assert_eq!(
        transforms(&mixed),
        "camera 3 (FISHEYE) is a fisheye and camera 4 (PINHOLE) is not, and transforms.json has \
         one camera_model for all; import the photos with --undistort and export that scene, or \
         export as colmap"
    );
    assert_eq!(
        opencv(&expressible()[..2]),
        "the photos were taken with 2 cameras, but the poses in an OpenCV file are those of one; \
         export as colmap or transforms"
    );
    let none = opencv_yaml(&Reconstruction::default(), &|_| String::new());
    assert_eq!(none, Err(ExportError::NoImages));
}

#[test]
fn captures_read_back() {
    let captures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/captures");
    if !captures.is_dir() {
        eprintln!("SKIPPED: {} is absent", captures.display());
        return;
    }
    let (mut transforms, mut opencv) = (0, 0);
    for entry in fs::read_dir(captures).unwrap() {
        let Ok(model) = colmap::find_model(&entry.unwrap().path()) else {
            continue;
        };
        let whole = colmap::read_model(&model).unwrap();
        let camera = whole.cameras.values().next().unwrap();
        if camera.model != ModelKind::FullOpenCv {
            assert_same(&through_transforms(&whole), &whole);
            transforms += 1;
        }
        if whole.cameras.len() == 1 {
            let read = through_opencv(&whole);
            assert_same(&read, &whole);
            opencv += 1;
            // A board that every photo sees keeps its corners.
            if model.ends_with("opencv-chessboard/sparse/0") {
                assert_eq!(read.points.len(), 54);
                let positions = |r: &Reconstruction| -> Vec<DVec3> {
                    r.points.values().map(|p| p.position).collect()
                };
                assert_eq!(positions(&read), positions(&whole));
                let keypoints = |r: &Reconstruction| -> Vec<Keypoint> {
                    let image = r.images.values().nth(5).unwrap();
                    let seen = image.keypoints.iter().filter(|k| k.point.is_some());
                    seen.copied().collect()
                };
                for (a, b) in keypoints(&read).iter().zip(keypoints(&whole)) {
                    assert!((a.x - b.x).hypot(a.y - b.y) < 1e-12);
                }
            }
        }
    }
    assert!(transforms >= 10 && opencv >= 10, "{transforms}, {opencv}");
}
