//! Which files of a folder are OpenCV's calibrations, and which look like one.

use calibrate::opencv::{Keys, find_calibrations};
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::Write;

const HEAD: &str = "%YAML:1.0\n---\n";
const POSES: &str = "rvecs: [[0, 0, 0]]\ntvecs: [[0, 0, 1]]\n";

fn camera(matrix: &str, distortion: &str) -> String {
    let of = |name: &str, shape: (u32, u32), data: &str| {
        let (rows, cols) = shape;
        format!(
            "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   \
             data: [ {data} ]\n"
        )
    };
    of(matrix, (3, 3), "500, 0, 319.5, 0, 510, 239.5, 0, 0, 1")
        + &of(distortion, (1, 5), "0.1, 0, 0, 0, 0")
}

/// What is usable among files, and what is said of those that are not.
fn found(files: &[(&str, &[u8])], keys: &Keys) -> (Vec<String>, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        std::fs::write(folder.path().join(name), content).unwrap();
    }
    let found = find_calibrations(folder.path(), keys);
    let root = format!("{}/", folder.path().display());
    let usable = found.usable.iter().map(|file| file.display().to_string());
    let unusable = found.unusable.iter().map(|error| {
        let error_text = error.to_string();
        assert!(error_text.contains(&error.path().display().to_string()));
        error_text
    });
    let short = |text: String| text.replace(&root, "");
    (usable.map(short).collect(), unusable.map(short).collect())
}

#[test]
fn matrices_under_unusual_names_are_chosen_or_listed() {
    // With OpenCV's mark, and as others write matrices.
    let marked = HEAD.to_owned() + &camera("myK", "myD") + POSES;
    let plain = r#"{"myK": [[500, 0, 319.5], [0, 510, 239.5], [0, 0, 1]], "myD": [0.1, 0, 0, 0, 0],
        "rvecs": [[0, 0, 0]], "tvecs": [[0, 0, 1]]}"#;
    for (name, text) in [("a.yml", marked.as_str()), ("b.json", plain)] {
        let files = [(name, text.as_bytes())];
        let (usable, unusable) = found(&files, &Keys::default());
        assert!(usable.is_empty(), "{usable:?}");
        let [error] = &unusable[..] else {
            panic!("{unusable:?}")
        };
        assert!(error.starts_with(&format!("{name}: no camera matrix under a name known here")));
        let listed = "the file holds myK (3 × 3), myD (1 × 5), rvecs (1 × 3), tvecs (1 × 3); choose \
                      with --camera-matrix KEY --distortion KEY";
        assert!(error.ends_with(listed), "{error}");

        let keys = Keys {
            camera_matrix: Some("myK".to_owned()),
            distortion: Some("myD".to_owned()),
            fisheye: false,
        };
        let (usable, unusable) = found(&files, &keys);
        assert_eq!(usable, [name]);
        assert!(unusable.is_empty(), "{unusable:?}");
    }
}

#[test]
fn files_that_look_like_a_calibration_say_what_they_lack() {
    let camera = HEAD.to_owned() + &camera("camera_matrix", "distortion_coefficients");
    let whole = camera.clone() + POSES;
    let mut packed = GzEncoder::new(Vec::new(), Compression::default());
    packed.write_all(whole.as_bytes()).unwrap();
    let packed = packed.finish().unwrap();
    let rig = HEAD.to_owned() + &self::camera("P1", "Q");
    let (usable, unusable) = found(
        &[
            ("1.yml", rig.as_bytes()),
            ("2.yml", camera.as_bytes()),
            ("3.yml", &camera.as_bytes()[..120]),
            ("4.yml.gz", &packed[..packed.len() - 12]),
            ("5.yml", whole.as_bytes()),
        ],
        &Keys::default(),
    );
    assert_eq!(usable, ["5.yml"]);
    // What lacks nothing but names comes last: it may be another file's second part.
    let starts = [
        "2.yml: the file holds cameras, but no poses; expected extrinsic_parameters",
        "3.yml, line ",
        "4.yml.gz: the gzip data is damaged",
        "1.yml: no camera matrix under a name known here",
    ];
    assert_eq!(unusable.len(), starts.len(), "{unusable:?}");
    for (error, start) in unusable.iter().zip(starts) {
        assert!(error.starts_with(start), "{error}");
    }
}

#[test]
fn other_files_are_no_calibrations() {
    let files: [(&str, &[u8]); 7] = [
        ("images.yml", b"%YAML:1.0\n---\nimages:\n   - a.jpg\n"),
        ("package.json", br#"{"name": "a", "version": "1.0.0"}"#),
        ("split.json", br#"{"test": ["a.jpg"]}"#),
        ("broken.json", b"{"),
        (
            "numbers.json",
            br#"{"a": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}"#,
        ),
        (
            "transforms.json",
            br#"{"fl_x": 9, "w": 9, "h": 9, "cx": 4, "cy": 4, "frames": []}"#,
        ),
        ("._a.yml", b"\0\x05\x16\x07"),
    ];
    let (usable, unusable) = found(&files, &Keys::default());
    assert!(
        usable.is_empty() && unusable.is_empty(),
        "{usable:?} {unusable:?}"
    );
}
