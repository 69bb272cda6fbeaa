use crate::captures::capture;
use crate::openmvg::SFM_DATA;
use calibrate::formats::{Format, by_name, detect, meant};
use std::path::Path;

fn detected(content: &[u8]) -> Option<Format> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    std::fs::write(&path, content).unwrap();
    detect(&path)
}

#[test]
fn the_examples_are_told_apart() {
    for (file, format) in [
        ("lego/transforms_train.json", Format::Transforms),
        (
            "other-formats/instant-ngp-fox/transforms.json",
            Format::Transforms,
        ),
        ("other-formats/bundler-platypus/bundle.out", Format::Bundler),
        ("other-formats/visualsfm-nvm/model.nvm", Format::Nvm),
        ("other-formats/llff-fern/poses_bounds.npy", Format::Llff),
        ("other-formats/meshroom-sfm/cameras.sfm", Format::Meshroom),
    ] {
        if let Some(path) = capture(file) {
            assert_eq!(detect(&path), Some(format), "{file}");
        }
    }
    assert_eq!(detected(SFM_DATA.as_bytes()), Some(Format::OpenMvg));
}

#[test]
fn other_files_are_none_of_them() {
    for content in [
        "",
        "{}",
        "{",
        "[]",
        "null",
        r#"{"name": "a-package", "version": "1.0.0", "views": "src"}"#,
        r#"{"version": 1, "views": [], "cameras": {}}"#,
        r#"{"version": 1, "views": [], "poses": []}"#,
        r#"{"frames": []}"#,
        r#"{"frames": 7, "w": 1}"#,
        r#"{"frames": [{"file_path": "a.jpg"}]}"#,
        "%YAML:1.0\n---\nframes: 3\n",
        "# Camera list with one line of data per camera:\n",
        "\u{93}NUMPY",
    ] {
        assert_eq!(detected(content.as_bytes()), None, "{content}");
    }
    let mut array = b"\x93NUMPY\x01\x00\x46\x00".to_vec();
    array.extend(b"{'descr': '<f8', 'fortran_order': False, 'shape': (20, 3), }\n");
    assert_eq!(detected(&array), None);
    for length in 0..SFM_DATA.len() {
        assert_eq!(
            detected(&SFM_DATA.as_bytes()[..length]),
            None,
            "cut to {length}"
        );
    }
    assert_eq!(detect(std::path::Path::new("nowhere/at/all")), None);
    assert_eq!(detect(std::path::Path::new(".")), None, "a folder");
}

#[test]
fn damaged_files_are_known_by_their_names() {
    for (name, format) in [
        ("transforms.json", Some(Format::Transforms)),
        ("a/Transforms_Train.JSON", Some(Format::Transforms)),
        ("bundle.out", Some(Format::Bundler)),
        ("bundle_001.out", Some(Format::Bundler)),
        ("reconstruction.bundle.out", Some(Format::Bundler)),
        ("sparse.nvm", Some(Format::Nvm)),
        ("poses_bounds.npy", Some(Format::Llff)),
        ("cameras.sfm", Some(Format::Meshroom)),
        ("sfm_data.json", Some(Format::OpenMvg)),
        ("dataparser_transforms.json", None),
        ("._model.nvm", None),
        ("bundle.txt", None),
        ("depth.npy", None),
        ("..", None),
    ] {
        assert_eq!(by_name(Path::new(name)), format, "{name}");
    }
}

#[test]
fn damaged_files_of_other_names_are_known_by_their_keys() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.json");
    assert_eq!(meant(&path), None, "nothing is there");
    for (content, format) in [
        (
            "\u{feff} {\"frames\": [{\"transform_matrix\": [",
            Some(Format::Transforms),
        ),
        (&SFM_DATA[..SFM_DATA.len() / 2], Some(Format::OpenMvg)),
        (
            "{\"views\": [{\"intrinsicId\": \"1\",",
            Some(Format::Meshroom),
        ),
        ("{\"camera_matrix\": {", None),
        ("transform_matrix: \"transform_matrix\"", None),
        ("", None),
    ] {
        std::fs::write(&path, content).unwrap();
        assert_eq!(meant(&path), format, "{content}");
    }
}
