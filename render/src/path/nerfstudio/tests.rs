use super::*;
use crate::path::{
    CameraPath, Interpolation, Keyframe, KeyframeFile, PathFrame, read_in, read_keyframes,
};
use calibrate::{Camera, Lens};
use glam::{DQuat, DVec2};
use proptest::prelude::*;
use serde_json::{Value, json};

const SIZE: (u32, u32) = (64, 48);

fn camera(focal: f64) -> Camera {
    let middle = 0.5 * DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1));
    Camera::of(&Lens::pinhole(DVec2::splat(focal), middle), SIZE.0, SIZE.1)
}

/// A pose that files give back to the last bit.
fn pose(turn: DVec3, center: DVec3) -> Rigid3 {
    let rotation = DQuat::from_scaled_axis(turn);
    let pose = Rigid3::new(rotation, -(rotation * center));
    let frame = PathFrame::new("a".to_owned(), camera(50.0), pose, None).unwrap();
    frame.view.camera_from_world
}

fn keyframes(count: usize) -> KeyframeFile {
    let keyframe = |i: usize| {
        let x = i as f64;
        Keyframe {
            t_s: 0.3 * x * x,
            camera_from_world: pose(DVec3::new(0.1 * x, 0.4, x), DVec3::new(x, 2.0, -x * x)),
            camera: camera(40.0 + x),
            time_s: None,
        }
    };
    KeyframeFile {
        fps: 10.0,
        keyframes: (0..count).map(keyframe).collect(),
        interpolation: Interpolation::Spline,
    }
}

fn sampled(file: &KeyframeFile) -> CameraPath {
    CameraPath::from_keyframes(&file.keyframes, file.interpolation, file.fps).unwrap()
}

fn is_near(a: &Rigid3, b: &Rigid3, tolerance: f64) -> bool {
    let turn = (a.rotation * b.rotation.conjugate()).xyz().length();
    turn < tolerance && a.center().distance(b.center()) < tolerance
}

/// What is said of a file with this content, the folder written as DIR.
fn message(content: &Value) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.json");
    std::fs::write(&path, content.to_string()).unwrap();
    let error = read_in(&path, &NerfstudioFrame::default()).unwrap_err();
    let text = error.to_string();
    text.replace(&folder.path().display().to_string(), "DIR")
}

const IDENTITY: [f64; 16] = [
    1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 2.0, 0.0, 0.0, 1.0, 3.0, 0.0, 0.0, 0.0, 1.0,
];

fn file(camera_path: Value, keyframes: Value) -> Value {
    json!({
        "keyframes": keyframes,
        "camera_type": "perspective",
        "render_height": 48,
        "render_width": 64,
        "camera_path": camera_path,
        "fps": 24,
        "seconds": 4,
        "smoothness_value": 0.5,
        "is_cycle": true,
        "crop": null,
    })
}

fn frame(fov: f64) -> Value {
    json!({"camera_to_world": IDENTITY, "fov": fov, "aspect": 1.5})
}

#[test]
fn what_editors_put_before_text_is_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.json");
    let read = |content: String| {
        std::fs::write(&path, content).unwrap();
        read_in(&path, &NerfstudioFrame::default()).unwrap()
    };
    let text = file(json!([frame(50.0)]), json!([])).to_string();
    assert_eq!(read(format!("\u{feff}{text}")), read(text));
    let turn = r#"{"transform": [[1, 0, 0, 2], [0, 1, 0, 0], [0, 0, 1, 0]], "scale": 3}"#;
    std::fs::write(&path, format!("\u{feff}{turn}")).unwrap();
    assert_eq!(NerfstudioFrame::read(&path).unwrap().scale, 3.0);
}

#[test]
fn cameras_look_back_along_z_and_the_field_of_view_is_vertical() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.json");
    std::fs::write(&path, file(json!([frame(90.0)]), json!([])).to_string()).unwrap();
    let read = read_in(&path, &NerfstudioFrame::default()).unwrap();
    let view = &read.frames[0].view;
    assert_eq!((read.fps, view.width, view.height), (24.0, 64, 48));
    assert!((view.lens.mean_focal() - 24.0).abs() < 1e-12);
    assert_eq!(view.center(), DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(view.forward(), DVec3::NEG_Z);
    assert_eq!(view.up(), DVec3::Y);
    assert_eq!(
        read_keyframes(&path, &NerfstudioFrame::default()).unwrap(),
        None
    );
}

#[test]
fn keyframes_of_both_viewers_are_read() {
    let turned = pose(DVec3::new(0.2, 0.5, -0.4), DVec3::new(4.0, 5.0, 6.0));
    let rows = NerfstudioFrame::default().camera_to_world(&turned);
    let columns: Vec<f64> = (0..16).map(|i| rows[4 * (i % 4) + i / 4]).collect();
    let old = json!({"matrix": json!(columns).to_string(), "fov": 50, "aspect": 1.5,
        "properties": "[[\"FOV\",50],[\"NAME\",\"Camera 0\"],[\"TIME\",0]]"});
    let new = json!({"matrix": rows, "fov": 50.0, "aspect": 1.5,
        "override_transition_enabled": true, "override_transition_sec": 1.25});
    let first = json!({"matrix": IDENTITY, "fov": 50.0, "aspect": 1.5});
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.json");
    let same = NerfstudioFrame::default();
    for (second, t_s) in [(old, 2.0), (new, 1.25)] {
        let content = file(json!([frame(50.0)]), json!([first, second]));
        std::fs::write(&path, content.to_string()).unwrap();
        let read = read_keyframes(&path, &same).unwrap().unwrap();
        // Round and back to the first.
        assert_eq!(read.keyframes.len(), 3);
        assert!(is_near(
            &read.keyframes[1].camera_from_world,
            &turned,
            1e-12
        ));
        let times: Vec<f64> = read.keyframes.iter().map(|k| k.t_s).collect();
        assert_eq!(times, [0.0, t_s, t_s + 2.0]);
        let ends = [&read.keyframes[0], &read.keyframes[2]];
        assert_eq!(ends[0].camera_from_world, ends[1].camera_from_world);
    }
}

#[test]
fn a_cycle_closes_in_the_first_keyframes_own_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.json");
    let plain = json!({"matrix": IDENTITY, "fov": 50.0});
    let own = |is_enabled: bool| {
        json!({"matrix": IDENTITY, "fov": 50.0,
            "override_transition_enabled": is_enabled, "override_transition_sec": 0.5})
    };
    for (first, is_cycle, expected) in [
        (own(true), true, &[0.0, 2.0, 4.0, 4.5][..]),
        (own(false), true, &[0.0, 2.0, 4.0, 6.0]),
        (plain.clone(), true, &[0.0, 2.0, 4.0, 6.0]),
        (own(true), false, &[0.0, 2.0, 4.0]),
    ] {
        let mut content = file(json!([frame(50.0)]), json!([first, plain, plain]));
        content["default_transition_sec"] = json!(2);
        content["is_cycle"] = json!(is_cycle);
        std::fs::write(&path, content.to_string()).unwrap();
        let read = read_keyframes(&path, &NerfstudioFrame::default()).unwrap();
        let times: Vec<f64> = read.unwrap().keyframes.iter().map(|k| k.t_s).collect();
        assert_eq!(times, expected);
    }
}

#[test]
fn a_duration_without_frames_is_no_frame_rate() {
    let plain = json!({"matrix": IDENTITY, "fov": 50.0});
    let mut content = file(json!([]), json!([plain, plain]));
    content.as_object_mut().unwrap().remove("fps");
    assert_eq!(message(&content), "DIR/p.json: the path has no frames");
    // Its keyframes are there all the same.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.json");
    std::fs::write(&path, content.to_string()).unwrap();
    let read = read_keyframes(&path, &NerfstudioFrame::default()).unwrap();
    let read = read.unwrap();
    assert_eq!((read.fps, read.keyframes.len()), (30.0, 3));
}

#[test]
fn what_the_dataparser_did_is_undone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dataparser_transforms.json");
    // To the right is up, up is to the left; half as large.
    let text = r#"{"transform": [[0, -1, 0, 10], [1, 0, 0, 20], [0, 0, 1, 30]], "scale": 0.5}"#;
    std::fs::write(&path, text).unwrap();
    let frame = NerfstudioFrame::read(&path).unwrap();
    let pose = pose(DVec3::ZERO, DVec3::new(3.0, 4.0, 5.0));
    let m = frame.camera_to_world(&pose);
    let column = |c: usize| DVec3::new(m[c], m[4 + c], m[8 + c]);
    assert!(column(3).distance(DVec3::new(3.0, 11.5, 17.5)) < 1e-12);
    // The camera's x axis; z is back.
    assert!(column(0).distance(DVec3::Y) < 1e-12);
    assert!(column(2).distance(DVec3::NEG_Z) < 1e-12);
    for (text, said) in [
        ("{}", "missing field `transform`"),
        (
            r#"{"transform": [[1, 0, 0, 0]], "scale": 1}"#,
            "is not 3 × 4",
        ),
        (
            r#"{"transform": [[2,0,0,0],[0,1,0,0],[0,0,1,0]], "scale": 1}"#,
            "a rotation",
        ),
        (
            r#"{"transform": [[1,0,0,0],[0,1,0,0],[0,0,1,0]], "scale": 0}"#,
            "scale is 0",
        ),
    ] {
        std::fs::write(&path, text).unwrap();
        let error = NerfstudioFrame::read(&path).unwrap_err().to_string();
        assert!(
            error.contains(said) && error.contains("dataparser"),
            "{error}"
        );
    }
}

#[test]
fn errors_say_what_is_wrong() {
    let mut fisheye = file(json!([frame(90.0)]), json!([]));
    fisheye["camera_type"] = json!("fisheye");
    assert_eq!(
        message(&fisheye),
        "DIR/p.json: nerfstudio's: its camera_type is \"fisheye\"; only \"perspective\" is read, \
         which the viewer's render tab offers, too"
    );
    assert_eq!(
        message(&file(json!([frame(90.0), frame(180.0)]), json!([]))),
        "DIR/p.json: frame 1: fov is 180; expected degrees between 0 and 180"
    );
    assert_eq!(
        message(&file(json!([]), json!([]))),
        "DIR/p.json: the path has no frames"
    );
    let mut sized = file(json!([frame(90.0)]), json!([]));
    sized["render_width"] = json!(0);
    assert!(message(&sized).contains("render_width is 0"));
    for (matrix, said) in [
        (json!([1, 2, 3]), "has 3 numbers"),
        (
            json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]),
            "ends with",
        ),
        (
            json!([0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1]),
            "a rotation",
        ),
    ] {
        let bad = json!({"camera_to_world": matrix, "fov": 50});
        let text = message(&file(json!([bad]), json!([])));
        assert!(text.starts_with("DIR/p.json: frame 0: camera_to_world") && text.contains(said));
    }
    // What cannot be said in it is not written.
    let folder = tempfile::tempdir().unwrap();
    let (path, own) = (folder.path().join("p.json"), Path::new("own.json"));
    let mut sampled = sampled(&keyframes(2));
    sampled.frames[1].camera.params[2] += 1.0;
    let error = write_nerfstudio(&path, own, &sampled, None, &NerfstudioFrame::default());
    let text = error.unwrap_err().to_string();
    assert!(
        text.starts_with("own.json: frame 1: ") && text.contains("principal point"),
        "{text}"
    );
    sampled.frames.remove(1);
    sampled.frames[1].camera.width += 1;
    let error = write_nerfstudio(&path, own, &sampled, None, &NerfstudioFrame::default());
    assert!(error.unwrap_err().to_string().contains("have one size"));
    assert!(!path.exists());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn paths_come_back_from_whatever_world(
        turn in prop::array::uniform3(-3.0..3.0_f64),
        by in prop::array::uniform3(-100.0..100.0_f64),
        scale in 0.01..100.0_f64,
        count in 1_usize..5,
    ) {
        let turn = DQuat::from_scaled_axis(DVec3::from_array(turn));
        let frame = NerfstudioFrame {
            moved_from_world: Rigid3::new(turn, DVec3::from_array(by)),
            scale,
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("camera_path.json");
        let own = keyframes(count);
        let frames = sampled(&own);
        for frame in [frame, NerfstudioFrame::default()] {
            write_nerfstudio(&path, &path, &frames, Some(&own), &frame).unwrap();
            let again = read_in(&path, &frame).unwrap();
            prop_assert_eq!(again.fps, frames.fps);
            prop_assert_eq!(again.frames.len(), frames.frames.len());
            for (a, b) in again.frames.iter().zip(&frames.frames) {
                let (pose, own) = (&a.view.camera_from_world, &b.view.camera_from_world);
                prop_assert!(is_near(pose, own, 1e-11));
                let focals = [a, b].map(|f| f.view.lens.mean_focal());
                prop_assert!((focals[0] - focals[1]).abs() < 1e-10);
                prop_assert_eq!(&a.name, &b.name);
                prop_assert!((a.time_s.unwrap() - b.time_s.unwrap()).abs() < 1e-12);
            }
            let again = read_keyframes(&path, &frame).unwrap().unwrap();
            prop_assert_eq!(again.keyframes.len(), own.keyframes.len());
            for (a, b) in again.keyframes.iter().zip(&own.keyframes) {
                prop_assert!((a.t_s - b.t_s).abs() < 1e-12);
                prop_assert!(is_near(&a.camera_from_world, &b.camera_from_world, 1e-11));
            }
        }
    }
}
