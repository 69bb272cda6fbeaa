//! Which calibration of a capture is used, and what is said of the others.

use crate::run::{lumigraph, with_wall};
use calibrate::colmap;
use std::collections::BTreeSet;
use std::fs;
use tempfile::TempDir;

/// The wall with OpenCV's file `cal.yml`, changed, beside its model.
fn with_opencv(change: impl Fn(&str) -> String) -> TempDir {
    let folder = with_wall();
    lumigraph(folder.path(), "export wall --format opencv -o wall/cal.yml").ok();
    let path = folder.path().join("wall/cal.yml");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, change(&text)).unwrap();
    folder
}

fn remove_model(folder: &TempDir) {
    fs::remove_dir_all(folder.path().join("wall/sparse")).unwrap();
}

#[test]
fn matrices_under_unusual_names_are_chosen_in_a_capture() {
    let folder = with_opencv(|text| {
        let text = text.replace("camera_matrix:", "Kamera:");
        text.replace("distortion_coefficients:", "Poly:")
    });
    remove_model(&folder);
    let here = folder.path();
    let of_import =
        "; --camera-matrix and --distortion are options of `lumigraph import wall -o SCENE`";
    for (line, whose) in [
        ("info wall", ""),
        ("import wall -o scene", ""),
        ("import wall --calibration wall -o scene", ""),
        ("render wall --path orbit -o out", of_import),
    ] {
        let error = lumigraph(here, line).error(1);
        let start = "wall/cal.yml: no camera matrix under a name known here";
        let end = "the file holds Kamera (3 × 3), Poly (5 × 1), extrinsic_parameters (9 × 6); choose \
                   with --camera-matrix KEY --distortion KEY";
        assert!(
            error.starts_with(start) && error.ends_with(&format!("{end}{whose}")),
            "{line}: {error}"
        );
    }
    assert!(!here.join("scene").exists());

    let keys = "--camera-matrix Kamera --distortion Poly";
    let info = lumigraph(here, &format!("info wall {keys} --json")).ok();
    assert_eq!(info.json()["photos"], 9);
    let ran = lumigraph(here, &format!("import wall {keys} -o scene")).ok();
    assert!(ran.stdout.starts_with("scene: 9 photos"), "{}", ran.stdout);
    // What is made of the file does not write over it.
    let error = lumigraph(here, "export scene --format opencv -o wall/cal.yml").error(1);
    assert!(error.contains("made of this very file"), "{error}");
}

#[test]
fn names_of_matrices_change_nothing_of_other_calibrations_aloud() {
    let folder = with_wall();
    let here = folder.path();
    lumigraph(here, "import wall -o scene").ok();
    lumigraph(here, "export wall --format transforms -o transforms.json").ok();
    for (what, calibration) in [
        ("wall", "the COLMAP model in wall/sparse/0"),
        ("wall/sparse/0", "the COLMAP model in wall/sparse/0"),
        ("wall/sparse/0/cameras.bin", "wall/sparse/0/cameras.bin"),
        ("transforms.json", "transforms.json"),
        ("scene", "the COLMAP model of the scene scene"),
    ] {
        let said = |options: &str| {
            let ran = lumigraph(here, &format!("info {what} {options}--json")).ok();
            ran.stderr
        };
        let note = format!("changes nothing: the calibration is {calibration}, none of OpenCV's\n");
        let with = said("--camera-matrix K ");
        let expected = format!("note: --camera-matrix {note}");
        assert!(with.contains(&expected), "{what}: {with}");
        let without = said("");
        assert!(!without.contains(&note), "{what}: {without}");
    }
}

#[test]
fn opencvs_files_that_cannot_be_used_are_told() {
    // Before the poses, and amid them.
    let cut = [
        (
            0,
            "wall/cal.yml: the file holds cameras, but no poses; expected extrinsic_parameters",
        ),
        (200, "wall/cal.yml, line "),
    ];
    for (more, said) in cut {
        let folder = with_opencv(|text| {
            let poses = text.find("extrinsic_parameters").unwrap();
            text[..poses + more].to_owned()
        });
        let here = folder.path();
        // Beside a model that is a note, else the error.
        let ran = lumigraph(here, "info wall").ok();
        let note =
            format!("note: the calibration is the COLMAP model in wall/sparse/0; not used: {said}");
        assert!(ran.stderr.contains(&note), "{}", ran.stderr);
        remove_model(&folder);
        for line in ["info wall", "import wall -o scene"] {
            let error = lumigraph(here, line).error(1);
            assert!(error.starts_with(said), "{line}: {error}");
        }
        assert!(!here.join("scene").exists());
    }
}

#[test]
fn damaged_calibrations_are_errors_and_nothing_is_calibrated_in_their_place() {
    let folder = with_wall();
    let here = folder.path();
    let at = |path: &str| here.join(path);
    let line = "export wall --format transforms -o transforms.json";
    lumigraph(here, line).ok();
    let whole = fs::read_to_string(at("transforms.json")).unwrap();
    let half = &whole[..whole.len() / 2];
    let nan = whole.replacen("\"fl_x\": ", "\"fl_x\": NaN, \"was\": ", 1);
    assert_ne!(nan, whole);

    // Beside a model that is a note.
    fs::write(at("wall/transforms.json"), half).unwrap();
    let ran = lumigraph(here, "info wall").ok();
    let note = "note: the calibration is the COLMAP model in wall/sparse/0; not used: \
                wall/transforms.json, line ";
    assert!(ran.stderr.contains(note), "{}", ran.stderr);
    fs::remove_file(at("wall/transforms.json")).unwrap();

    remove_model(&folder);
    fs::write(at("wall/list.txt"), "0000.png\n").unwrap();
    for (name, content, place) in [
        ("transforms.json", half, "line "),
        ("transforms.json", nan.as_str(), "line "),
        ("transforms.json", "{\"frames\": []}", "frames: "),
        ("transforms_train.json", half, "line "),
        ("bundle.out", "# Bund", "line 1 "),
        ("model.nvm", "", "line 1 "),
        ("poses_bounds.npy", "NUMPY", "header: "),
        ("cameras.sfm", "{\"version\": [\"1\",", "line 1 "),
        ("sfm_data.json", "{\"sfm_data_version\"", "line 1 "),
    ] {
        let file = format!("wall/{name}");
        fs::write(at(&file), content).unwrap();
        let given = format!("import wall/images --calibration {file} -o scene");
        for line in ["import wall -o scene", &given, &format!("info {file}")] {
            let error = lumigraph(here, line).error(1);
            let start = format!("{file}, {place}");
            assert!(error.starts_with(&start), "{line}: {error}");
            assert!(!error.contains("OpenCV"), "{line}: {error}");
        }
        fs::remove_file(at(&file)).unwrap();
    }
    // Of any other name, as long as it is given.
    fs::write(at("cut.json"), half).unwrap();
    let line = "import wall/images --calibration cut.json -o scene";
    let error = lumigraph(here, line).error(1);
    assert!(error.starts_with("cut.json, line "), "{error}");
    assert!(
        error.ends_with("or export it again from the program it is from"),
        "{error}"
    );
    assert!(!at("scene").exists());
}

#[test]
fn of_models_that_colmap_could_not_join_the_largest_is_used_aloud() {
    let folder = with_wall();
    let here = folder.path();
    let sparse = here.join("wall/sparse");
    let whole = colmap::read_model(&sparse.join("0")).unwrap();
    let names = whole.images.values().map(|image| image.name.clone());
    let most: BTreeSet<String> = names.skip(3).collect();

    // Alone it needs no word, whatever its number.
    fs::rename(sparse.join("0"), sparse.join("1")).unwrap();
    let ran = lumigraph(here, "info wall --json").ok();
    assert_eq!(ran.json()["photos"], 9);
    assert!(!ran.stderr.contains("--calibration"), "{}", ran.stderr);

    colmap::write_binary(&whole.without_images(&most), &sparse.join("0")).unwrap();
    let said = |takes: &str| {
        format!(
            "note: the calibration is the COLMAP model in wall/sparse/1 (9 photos); {takes} another: \
             wall/sparse/0 (3 photos)\n"
        )
    };
    let of_capture = said("`lumigraph import wall --calibration PATH -o SCENE` takes");
    let ran = lumigraph(here, "info wall --json").ok();
    assert_eq!(ran.json()["photos"], 9);
    assert!(ran.stderr.contains(&of_capture), "{}", ran.stderr);
    // The folder of models is no capture.
    let ran = lumigraph(here, "info wall/sparse --json").ok();
    assert_eq!(ran.json()["poses"], 9);
    let of_models = said("`lumigraph info PATH` shows");
    assert!(ran.stderr.contains(&of_models), "{}", ran.stderr);

    // One that was asked for needs no word.
    let line = "import wall --calibration wall/sparse/0 -o scene";
    let ran = lumigraph(here, line).ok();
    assert!(ran.stdout.starts_with("scene: 3 photos"), "{}", ran.stdout);
    assert!(!ran.stderr.contains("takes another"), "{}", ran.stderr);
}

/// The disk that it is on may not be mounted: COLMAP would make another world of the photos.
#[cfg(unix)]
#[test]
fn a_calibration_whose_link_leads_nowhere_is_an_error() {
    use std::os::unix::fs::symlink;
    let folder = with_wall();
    let here = folder.path();
    let model = here.join("wall/sparse/0");
    fs::rename(&model, here.join("model")).unwrap();
    symlink("/nonexistent/model", &model).unwrap();
    let said = "wall/sparse/0: a COLMAP model may be here, but it cannot be looked into: \
                it is a link to /nonexistent/model, which is not there; see that";
    for line in [
        "import wall -o scene",
        "info wall",
        "render wall --path orbit -o out",
    ] {
        let error = lumigraph(here, line).error(1);
        assert!(error.starts_with(said), "{line}: {error}");
    }
    // Beside another it is noted.
    lumigraph(here, "import wall --calibration model -o whole").ok();
    lumigraph(here, "export whole --format opencv -o wall/cal.yml").ok();
    let ran = lumigraph(here, "import wall -o scene").ok();
    let note = format!("the calibration is wall/cal.yml; not used: {said}");
    assert!(ran.stderr.contains(&note), "{}", ran.stderr);

    // The same of a file.
    fs::remove_file(here.join("wall/cal.yml")).unwrap();
    fs::remove_dir_all(here.join("wall/sparse")).unwrap();
    symlink("/nonexistent", here.join("wall/transforms.json")).unwrap();
    let error = lumigraph(here, "import wall -o other").error(1);
    let said = "wall/transforms.json: cannot read the file: No such file";
    assert!(error.starts_with(said), "{error}");
    assert!(!here.join("other").exists());
}
