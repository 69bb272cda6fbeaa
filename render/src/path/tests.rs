use super::*;
use glam::{DMat3, DVec3};
use proptest::prelude::*;

fn pinhole(f: f64) -> Camera {
    Camera {
        model: ModelKind::Pinhole,
        width: 64,
        height: 48,
        params: vec![f, f, 32.0, 24.0],
    }
}

fn key(t_s: f64, center: DVec3, yaw: f64) -> Keyframe {
    let rotation = DQuat::from_rotation_y(yaw);
    Keyframe {
        t_s,
        camera_from_world: Rigid3::new(rotation, -(rotation * center)),
        camera: pinhole(50.0 + t_s),
        time_s: None,
    }
}

/// The message for a file with this text, the folder written as DIR.
fn message(text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.json");
    std::fs::write(&path, text).unwrap();
    let error = read(&path).unwrap_err().to_string();
    error.replace(&folder.path().display().to_string(), "DIR")
}

fn read_text(text: &str) -> CameraPath {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.json");
    std::fs::write(&path, text).unwrap();
    read(&path).unwrap()
}

const EYE: &str = "1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1";

/// A file of version 1 with these frames.
fn frames(frames: &str) -> String {
    format!(r#"{{"version": 1, "fps": 24, "frames": [{frames}]}}"#)
}

fn frame(matrix: &str, model: &str, params: &str, rest: &str) -> String {
    format!(
        r#"{{"camera_from_world": [{matrix}], "width": 64, "height": 48,
            "model": "{model}", "params": [{params}]{rest}}}"#
    )
}

fn good_frame(rest: &str) -> String {
    frame(EYE, "PINHOLE", "50, 50, 32, 24", rest)
}

proptest! {
    #[test]
    fn files_give_back_every_bit(
        axis in prop::array::uniform3(-1.0..1.0_f64),
        angle in -7.0..7.0_f64,
        translation in prop::array::uniform3(-1e7..1e7_f64),
        quarter_turns in prop::option::of(0..4_u8),
        f in 1e-3..1e4_f64,
        time_s in prop::option::of(-1e9..1e9_f64),
    ) {
        let axis = DVec3::from_array(axis).normalize_or(DVec3::X);
        // Right angles are common, and have ties.
        let angle = quarter_turns.map_or(angle, |n| f64::from(n) * std::f64::consts::FRAC_PI_2);
        let axis = if quarter_turns == Some(3) { DVec3::ONE.normalize() } else { axis };
        let pose = Rigid3::new(
            DQuat::from_axis_angle(axis, angle),
            DVec3::from_array(translation),
        );
        let frame = PathFrame::new("a/b.jpg".to_owned(), pinhole(f), pose, time_s).unwrap();
        let turn = frame.view.camera_from_world.rotation.dot(pose.rotation).abs();
        prop_assert!((turn - 1.0).abs() < 1e-14);
        let shift = frame.view.center() - pose.center();
        prop_assert!(shift.length() < 1e-15 * pose.center().length() * 4.0);
        let path = CameraPath::new(30.0 / 1.001, vec![frame]).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("p.json");
        write(&file, &path).unwrap();
        prop_assert_eq!(read(&file).unwrap(), path);
        prop_assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}

#[test]
fn unknown_keys_are_kept() {
    let text = format!(
        r#"{{"version": 1, "author": {{"name": "x"}}, "fps": 24, "frames": [{}]}}"#,
        good_frame(r#", "iso": 0.1, "time_s": 2.5"#)
    );
    let path = read_text(&text);
    assert_eq!(path.frames[0].name, "frame_0000");
    assert_eq!(path.frames[0].time_s, Some(2.5));
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("again.json");
    write(&file, &path).unwrap();
    assert_eq!(read(&file).unwrap(), path);
    let again = std::fs::read_to_string(&file).unwrap();
    let again: Value = serde_json::from_str(&again).unwrap();
    assert_eq!(again["author"]["name"], "x");
    assert_eq!(again["frames"][0]["iso"], 0.1);
}

#[test]
fn what_editors_put_before_text_is_passed_over() {
    let text = frames(&good_frame(""));
    assert_eq!(read_text(&format!("\u{feff}{text}")), read_text(&text));
}

#[test]
fn poses_are_read_row_by_row() {
    let path = read_text(&frames(&frame(
        "0,-1,0,1, 1,0,0,2, 0,0,1,3, 0,0,0,1",
        "PINHOLE",
        "50, 50, 32, 24",
        "",
    )));
    let moved = path.frames[0].view.camera_from_world * DVec3::X;
    assert!((moved - DVec3::new(1.0, 3.0, 3.0)).length() < 1e-13);
}

/// Programs print six digits. The first of these matrices is 1.6e-6 from a rotation by that.
#[test]
fn rotations_of_six_digits_are_read_as_exact_ones() {
    let mut rows = vec![
        DMat3::from_cols_array(&[
            0.743556, -0.163107, -0.648475, //
            0.488352, -0.529997, 0.693264, //
            -0.456766, -0.832165, -0.314429,
        ])
        .transpose(),
    ];
    rows.extend((1..300).map(|i| {
        let turn = f64::from(i) * DVec3::new(0.37, 0.61, 0.83);
        DMat3::from_quat(DQuat::from_scaled_axis(turn))
    }));
    let written = |r: &DMat3| {
        let [x, y, z] = r.transpose().to_cols_array_2d();
        let row = |v: [f64; 3]| format!("{:.6},{:.6},{:.6}", v[0], v[1], v[2]);
        let matrix = format!("{},0, {},0, {},3, 0,0,0,1", row(x), row(y), row(z));
        frame(&matrix, "PINHOLE", "50, 50, 32, 24", "")
    };
    let texts: Vec<String> = rows.iter().map(written).collect();
    let path = read_text(&frames(&texts.join(",\n")));
    assert_eq!(path.frames.len(), rows.len());
    for (frame, expected) in path.frames.iter().zip(&rows) {
        let read = frame.view.camera_from_world.matrix();
        assert!(Rigid3::deviation(read) < 1e-14);
        assert!(
            (read - *expected)
                .to_cols_array()
                .iter()
                .all(|d| d.abs() < 5e-6)
        );
    }
}

#[test]
fn keyframes_in_files_are_sampled() {
    let at = |t: f64| good_frame(&format!(r#", "t_s": {t}"#));
    let text = |interpolation: &str| {
        format!(
            r#"{{"version": 1, "fps": 10, "keyframes": [{}, {}]{interpolation}}}"#,
            at(1.0),
            at(2.0)
        )
    };
    let path = read_text(&text(r#", "interpolation": "linear""#));
    assert_eq!(path.frames.len(), 11);
    assert_eq!(path.frames[10].name, "frame_0010");
    assert!((path.frames[3].time_s.unwrap() - 1.3).abs() < 1e-12);
    assert_eq!(read_text(&text("")), path, "standing still, either way");
    assert!(message(&text(r#", "interpolation": "cubic""#)).contains("`spline` or `linear`"));
}

#[test]
fn keyframes_come_back_as_they_were_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.json");
    let settled = |k: Keyframe| {
        let (camera, pose) = (k.camera.clone(), k.camera_from_world);
        let frame = PathFrame::new("a".to_owned(), camera, pose, None).unwrap();
        Keyframe {
            camera_from_world: frame.view.camera_from_world,
            ..k
        }
    };
    let centers = [DVec3::ZERO, DVec3::new(1e5, 0.1, -7.0), DVec3::ONE];
    let keys = centers.iter().zip(0..);
    let keyframes: Vec<Keyframe> = keys
        .map(|(c, i)| settled(key(f64::from(i) / 3.0, *c, 0.7 * f64::from(i))))
        .collect();
    for interpolation in [Interpolation::Spline, Interpolation::Linear] {
        let file = KeyframeFile {
            fps: 24.0,
            keyframes: keyframes.clone(),
            interpolation,
        };
        write_keyframes(&path, &file).unwrap();
        assert_eq!(
            read_keyframes(&path, &NerfstudioFrame::default()).unwrap(),
            Some(file)
        );
        let sampled = CameraPath::from_keyframes(&keyframes, interpolation, 24.0).unwrap();
        assert_eq!(read(&path).unwrap(), sampled);
    }
    // A path of frames has none, and none make no file.
    write(&path, &read_text(&frames(&good_frame("")))).unwrap();
    assert_eq!(
        read_keyframes(&path, &NerfstudioFrame::default()).unwrap(),
        None
    );
    let none = KeyframeFile {
        fps: 24.0,
        keyframes: Vec::new(),
        interpolation: Interpolation::Spline,
    };
    assert!(write_keyframes(&path, &none).is_err());
}

#[test]
fn bad_files_are_named() {
    let bad = |frame_text: String| message(&frames(&format!("{}, {frame_text}", good_frame(""))));
    assert_eq!(
        bad(frame("1, 2, 3", "PINHOLE", "50, 50, 32, 24", "")),
        "DIR/p.json: frame 1: camera_from_world has 3 numbers; 16 are expected, row by row"
    );
    assert_eq!(
        bad(frame(
            "1,0,0,0, 0,1,0,0, 0,0,1,0, 5,6,7,1",
            "PINHOLE",
            "50, 50, 32, 24",
            ""
        )),
        "DIR/p.json: frame 1: the last row of camera_from_world is [5.0, 6.0, 7.0, 1.0], not \
         [0, 0, 0, 1]; is the matrix written column by column?"
    );
    let more_digits = |deviation: &str| {
        format!(
            "RᵀR differs from the identity by up to {deviation}; take the scale or shear out of it, or write more \
             digits"
        )
    };
    let mirrors = "it mirrors (its determinant is −1); check that no axis was negated on the way";
    for (not_a_rotation, found) in [
        (
            "1.001,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1",
            more_digits("2.001e-3"),
        ),
        (
            "1,0.001,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1",
            more_digits("1.000e-3"),
        ),
        ("0,0,0,0, 0,0,0,0, 0,0,0,0, 0,0,0,1", more_digits("1.000e0")),
        ("-1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1", mirrors.to_owned()),
    ] {
        assert_eq!(
            bad(frame(not_a_rotation, "PINHOLE", "50, 50, 32, 24", "")),
            format!(
                "DIR/p.json: frame 1: camera_from_world does not begin with a rotation: its rows \
                 must be of length 1, at right angles and right-handed, but {found}"
            )
        );
    }
    assert_eq!(
        bad(frame(EYE, "PINHOLE", "50, 50, 32", "")),
        "DIR/p.json: frame 1: PINHOLE has 4 parameters (fx, fy, cx, cy), found 3"
    );
    assert_eq!(
        bad(frame(EYE, "THIN_PRISM", "50", "")),
        "DIR/p.json: frame 1: unknown camera model \"THIN_PRISM\"; known are SIMPLE_PINHOLE, \
         PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, OPENCV_FISHEYE, FULL_OPENCV, FOV, \
         SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, THIN_PRISM_FISHEYE, \
         RAD_TAN_THIN_PRISM_FISHEYE, SIMPLE_DIVISION, DIVISION, SIMPLE_FISHEYE, FISHEYE, \
         EUCM, EQUIRECTANGULAR, \
         OPENCV_TILTED, OPENCV_SKEWED_FISHEYE, INVERSE_RADIAL"
    );
    assert_eq!(
        bad(good_frame(r#", "name": "frame_0000""#)),
        "DIR/p.json: frames 0 and 1 are both called \"frame_0000\"; each needs a name of its own"
    );
    for name in ["../a", "/a", "", "a//b", "c:/a", "a/."] {
        assert_eq!(
            bad(good_frame(&format!(r#", "name": "{name}""#))),
            format!(
                "DIR/p.json: frame 1: the name {name:?} cannot name a picture; give a relative \
                 path without .."
            )
        );
    }
    assert_eq!(
        bad(r#"{"width": 3}"#.to_owned()),
        "DIR/p.json: frame 1: missing field `camera_from_world`"
    );
    assert_eq!(
        message(r#"{"version": 2, "shots": []}"#),
        "DIR/p.json: path file version 2; this program reads version 1"
    );
    assert_eq!(
        message(r#"{"version": 1, "fps": 0, "frames": []}"#),
        "DIR/p.json: fps is 0; it must be a positive number, such as 30"
    );
    assert_eq!(message(&frames("")), "DIR/p.json: the path has no frames");
    assert_eq!(
        message(r#"{"version": 1, "fps": 5}"#),
        "DIR/p.json: a path has either \"frames\" or \"keyframes\"; found neither"
    );
    assert_eq!(
        message(r#"{"version": 1, "fps": 5, "frames": [], "keyframes": []}"#),
        "DIR/p.json: a path has either \"frames\" or \"keyframes\"; found both"
    );
    assert_eq!(
        message(&format!(
            r#"{{"version": 1, "fps": 5, "keyframes": [{}]}}"#,
            good_frame("")
        )),
        "DIR/p.json: keyframe 0: missing field `t_s`, its time in seconds"
    );
    // Trajectories and transforms.json, among others.
    let other = message("0.5 1 2 3 0 0 0 1\n");
    assert!(
        other.starts_with("DIR/p.json: not a path file: "),
        "{other}"
    );
    assert!(
        other.contains("; read are paths of this program (JSON,")
            && other.contains(
                "; poses that are another text (TUM's, CSV) can be made frames of a transforms.json"
            ),
        "{other}"
    );
    assert_eq!(
        message(r#"{"camera_angle_x": 1, "frames": [{"file_path": "a", "transform_matrix": []}]}"#),
        "DIR/p.json: a calibration, not a path file; `lumigraph render SCENE --views DIR/p.json -o FRAMES` draws the \
         views of its frames"
    );
    // OpenCV's are YAML, XML or JSON; damaged ones, and such without poses, are some, too.
    let yaml = "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   \
                data: [ 500, 0, 320, 0, 500, 240, 0, 0, 1 ]\n";
    let json = r#"{"K": [[500, 0, 320], [0, 500, 240], [0, 0, 1]], "D": [0.1, 0, 0, 0, 0]}"#;
    for calibration in ["NVM_V3\n", yaml, &yaml[..70], json] {
        let calibration = message(calibration);
        assert!(
            calibration
                .starts_with("DIR/p.json: a calibration, not a path file; with its photos, ")
                && calibration.contains("--calibration DIR/p.json -o SCENE` and `lumigraph export"),
            "{calibration}"
        );
    }
    assert!(message("[").starts_with("DIR/p.json: not a path file: "));
    // What Python writes where a number is none, nerfstudio's paths included.
    let again = "; remove what has it, as a frame without a pose, or export it again from the program it is from";
    for (text, found) in [
        (
            r#"{"version": 1, "fps": 5, "frames": [{"name": "a"}, {"name": "b", "params": [1, NaN]}]}"#,
            "frames[1].params[1] (b) is NaN",
        ),
        (
            r#"{"version": 1, "fps": 5, "keyframes": [{"t_s": -Infinity}]}"#,
            "keyframes[0].t_s is -Infinity",
        ),
        (
            r#"{"camera_path": [{"camera_to_world": [NaN]}], "fps": 5}"#,
            "camera_path[0].camera_to_world[0] is NaN",
        ),
    ] {
        let expected = format!("DIR/p.json: not JSON: {found}, expected a finite number{again}");
        assert_eq!(message(text), expected);
    }
    assert!(message(r#"{"fps": 3}"#).starts_with("DIR/p.json: not a path file: missing field"));
}

#[test]
fn bad_keyframes_are_named() {
    let still = |t_s| key(t_s, DVec3::ZERO, 0.0);
    let error = |keys: &[Keyframe], fps| {
        let path = CameraPath::from_keyframes(keys, Interpolation::Spline, fps);
        path.unwrap_err().to_string()
    };
    assert_eq!(error(&[], 30.0), "the path has no frames");
    assert_eq!(
        error(&[still(1.0), still(1.0)], 30.0),
        "keyframe 1: t_s is 1, not after the 1 of the one before"
    );
    // Speeds are not finite there.
    assert_eq!(
        error(&[still(0.0), key(1e-310, DVec3::X, 0.1), still(1.0)], 30.0),
        "keyframe 1: t_s is 1e-310 s after that of the one before; keyframes are a nanosecond apart at least: \
         are the times in seconds?"
    );
    let mut wide = still(2.0);
    wide.camera.width = 65;
    assert_eq!(
        error(&[still(1.0), wide], 30.0),
        "keyframe 1: its camera is PINHOLE 65 × 48, that of keyframe 0 is PINHOLE 64 × 48; \
         model and size must agree"
    );
    assert_eq!(
        error(&[still(0.0), still(40_000.0)], 30.0),
        "keyframes 40000 s apart make 1200001 frames at 30 per second, more than 1000000; are \
         the times in seconds?"
    );
    assert_eq!(
        error(&[still(f64::NAN)], 30.0),
        "keyframe 0: parameter fx of PINHOLE is NaN, not a finite number"
    );
    assert!(error(&[still(0.0)], f64::NAN).starts_with("fps is NaN"));
    let timed = |t_s| Keyframe {
        time_s: Some(7.0),
        ..still(t_s)
    };
    for (keys, index, other) in [
        ([timed(0.0), still(1.0), still(2.0)], 1, 0),
        ([still(0.0), timed(1.0), timed(2.0)], 0, 1),
    ] {
        assert_eq!(
            error(&keys, 30.0),
            format!(
                "keyframe {index}: it has no time_s, though keyframe {other} has one; give one to all \
                 keyframes, or to none"
            )
        );
    }
    let all = CameraPath::from_keyframes(&[timed(0.0), timed(1.0)], Interpolation::Spline, 1.0);
    assert_eq!(all.unwrap().frames[1].time_s, Some(7.0));
}

#[test]
fn linear_goes_straight_and_turns_evenly() {
    let keys = [
        key(0.0, DVec3::new(1e6, 0.0, 0.0), 0.0),
        key(2.0, DVec3::new(1e6 + 4.0, 2.0, 0.0), 1.0),
    ];
    let path = CameraPath::from_keyframes(&keys, Interpolation::Linear, 4.0).unwrap();
    assert_eq!(path.frames.len(), 9);
    for (i, frame) in path.frames.iter().enumerate() {
        let share = i as f64 / 8.0;
        let center = DVec3::new(1e6 + 4.0 * share, 2.0 * share, 0.0);
        assert!((frame.view.center() - center).length() < 1e-8);
        let yaw = DQuat::from_rotation_y(share);
        let rotation = frame.view.camera_from_world.rotation;
        assert!((rotation.dot(yaw).abs() - 1.0).abs() < 1e-14);
        assert!((frame.camera.params[0] - (50.0 + 2.0 * share)).abs() < 1e-12);
    }
}

#[test]
fn a_spline_passes_its_keyframes_and_reproduces_an_even_motion() {
    // A constant velocity and turn, at uneven times.
    let even = |t: f64| key(t, DVec3::new(t, -2.0 * t, 0.5), 0.4 * t);
    let keys = [even(0.0), even(0.5), even(3.0), even(4.0)];
    let path = CameraPath::from_keyframes(&keys, Interpolation::Spline, 8.0).unwrap();
    assert_eq!(path.frames.len(), 33);
    for (i, frame) in path.frames.iter().enumerate() {
        let expected = even(i as f64 / 8.0).camera_from_world;
        assert!((frame.view.center() - expected.center()).length() < 1e-12);
        let rotation = frame.view.camera_from_world.rotation;
        assert!((rotation.dot(expected.rotation).abs() - 1.0).abs() < 1e-14);
    }

    // Any motion passes its keyframes.
    let keys = [
        key(0.0, DVec3::ZERO, 0.0),
        key(1.0, DVec3::X, 2.0),
        key(1.5, DVec3::Y, -1.0),
        key(4.0, DVec3::Z, 3.0),
    ];
    let path = CameraPath::from_keyframes(&keys, Interpolation::Spline, 2.0).unwrap();
    for (i, k) in [(0, 0), (2, 1), (3, 2), (8, 3)] {
        let (found, wanted) = (&path.frames[i].view, keys[k].camera_from_world);
        assert!((found.center() - wanted.center()).length() < 1e-14);
        assert!((found.camera_from_world.rotation.dot(wanted.rotation).abs() - 1.0).abs() < 1e-15);
    }
}

#[test]
fn frame_counts_are_not_at_the_mercy_of_rounding() {
    for (duration, fps, count) in [(0.1, 30.0, 4), (1.0, 30.0 / 1.001, 30), (0.7, 10.0, 8)] {
        let keys = [key(0.0, DVec3::ZERO, 0.0), key(duration, DVec3::X, 0.1)];
        let path = CameraPath::from_keyframes(&keys, Interpolation::Spline, fps).unwrap();
        assert_eq!(path.frames.len(), count, "{duration} s at {fps}");
    }
    let one = [key(5.0, DVec3::ZERO, 0.0)];
    let path = CameraPath::from_keyframes(&one, Interpolation::Spline, 30.0).unwrap();
    assert_eq!(path.frames.len(), 1);
}
