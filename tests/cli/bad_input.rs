//! Bad data: one clear error, exit code 1, no panic, nothing half-written.

use crate::run::{files, lumigraph, with_wall};
use image::{GrayImage, Luma};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Runs every command on the capture; all must fail alike and leave nothing. Returns the
/// error.
#[track_caller]
fn all_fail(folder: &TempDir) -> String {
    let before = files(folder.path());
    let errors: Vec<String> = [
        "import wall -o out",
        "info wall --json",
        "render wall --proxy plane --path orbit --frames 2 -o out",
        "evaluate wall --proxy plane --json -o out",
        "field wall --proxy plane --view 0001.png -o out/f.png --weights out/w.npz",
        "proxy wall plane -o out/p.json",
    ]
    .map(|line| {
        let ran = lumigraph(folder.path(), line);
        assert_eq!(ran.stdout, "", "{line}");
        ran.error(1)
    })
    .to_vec();
    assert!(errors.iter().all(|e| *e == errors[0]), "{errors:#?}");
    assert!(files(folder.path()) == before, "something was left behind");
    assert!(!folder.path().join("out").exists());
    errors[0].clone()
}

fn model_file(folder: &TempDir, stem: &str) -> std::path::PathBuf {
    folder.path().join(format!("wall/sparse/0/{stem}.bin"))
}

#[test]
fn truncated_empty_and_garbled_models() {
    for stem in ["cameras", "images", "points3D"] {
        let folder = with_wall();
        let path = model_file(&folder, stem);
        let whole = fs::read(&path).unwrap();
        let named = format!("{stem}.bin");

        for keep in [whole.len() - 1, whole.len() / 2, 9, 1] {
            fs::write(&path, &whole[..keep]).unwrap();
            let error = all_fail(&folder);
            assert!(error.contains(&named), "{error}");
        }
        fs::write(&path, b"").unwrap();
        let error = all_fail(&folder);
        assert!(error.contains(&named) && error.contains("empty"), "{error}");
        // A count of records that no memory could hold, and noise.
        fs::write(&path, [0xff; 64]).unwrap();
        assert!(all_fail(&folder).contains(&named));
        let noise: Vec<u8> = (0..whole.len()).map(|i| (i * i * 31 + i) as u8).collect();
        fs::write(&path, noise).unwrap();
        assert!(all_fail(&folder).contains(&named));
    }
}

#[test]
fn no_model_and_no_photos() {
    let folder = with_wall();
    fs::remove_dir_all(folder.path().join("wall/sparse")).unwrap();
    // Importing would run COLMAP.
    let error = lumigraph(folder.path(), "info wall --json").error(1);
    assert!(
        error.contains("wall") && error.contains("no COLMAP model"),
        "{error}"
    );
    assert!(
        error.contains("`lumigraph import wall -o SCENE` runs COLMAP"),
        "{error}"
    );
    fs::write(folder.path().join("wall/cameras.txt"), "").unwrap();
    let error = all_fail(&folder);
    assert!(
        error.contains("lacks images.txt and points3D.txt"),
        "{error}"
    );

    let folder = with_wall();
    fs::remove_dir_all(folder.path().join("wall/images")).unwrap();
    let error = all_fail(&folder);
    assert!(error.contains("no photos"), "{error}");

    let folder = with_wall();
    fs::remove_dir_all(folder.path().join("wall")).unwrap();
    assert_eq!(
        all_fail(&folder),
        "wall: there is no such folder; check the path"
    );
}

#[test]
fn a_file_in_place_of_a_folder() {
    let folder = with_wall();
    let here = folder.path();
    fs::write(here.join("house.glb"), b"glTF\x02\0\0\0").unwrap();
    let takes_models = "; `lumigraph interior house.glb -o INTERIOR` takes models";
    for (file, remedy) in [("house.glb", takes_models), ("wall/images/0000.png", "")] {
        let line = format!("render {file} --path orbit -o out");
        let expected = "a folder is expected: a scene's, or that of photos and their calibration";
        assert_eq!(
            lumigraph(here, &line).error(1),
            format!("{file}: a file, and {expected}{remedy}")
        );
        let error = lumigraph(here, &format!("info {file}")).error(1);
        let said = "no calibration that is known here: the file is binary; expected a file of a COLMAP model, ";
        assert!(error.starts_with(&format!("{file}: {said}")), "{error}");
        assert!(error.ends_with(&format!("OpenMVG's{remedy}")), "{error}");
        let error = lumigraph(here, &format!("import {file} -o scene")).error(1);
        assert!(error.ends_with(remedy), "{error}");
    }
}

#[test]
fn a_photo_of_the_wrong_size() {
    let folder = with_wall();
    let path = folder.path().join("wall/images/0003.png");
    image::RgbImage::new(95, 72).save(&path).unwrap();
    let error = all_fail(&folder);
    assert!(error.contains("0003.png"), "{error}");
    assert!(
        error.contains("95 × 72") && error.contains("96 × 72"),
        "{error}"
    );
}

#[test]
fn a_missing_or_headless_photo_is_left_out_unless_strict() {
    type Spoil = fn(&Path);
    let spoils: [Spoil; 3] = [
        |path| fs::remove_file(path).unwrap(),
        |path| fs::write(path, b"").unwrap(),
        |path| fs::write(path, b"not a picture at all, whatever its name").unwrap(),
    ];
    for spoil in spoils {
        let folder = with_wall();
        spoil(&folder.path().join("wall/images/0003.png"));
        let ran = lumigraph(folder.path(), "info wall --json").ok();
        assert!(
            ran.stderr.contains("warning: photo 0003.png is left out"),
            "{}",
            ran.stderr
        );
        assert_eq!(ran.json()["photos"], 8);
        assert_eq!(ran.json()["left_out"][0], "0003.png");

        let error = lumigraph(folder.path(), "info wall --strict").error(1);
        assert!(error.starts_with("photo 0003.png: "), "{error}");
        assert!(error.contains("--strict"), "{error}");
    }
}

#[test]
fn too_few_photos_left() {
    let folder = with_wall();
    for i in 1..9 {
        fs::remove_file(folder.path().join(format!("wall/images/000{i}.png"))).unwrap();
    }
    let error = all_fail(&folder);
    assert!(
        error.starts_with("8 of 9 calibrated photos cannot be used"),
        "{error}"
    );
    assert!(error.contains("0001.png"), "{error}");
}

#[test]
fn a_photo_with_a_good_header_and_a_corrupt_body() {
    let folder = with_wall();
    let path = folder.path().join("wall/images/0004.png");
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() / 2]).unwrap();

    // Found out only when drawn: reported, left out, and the frame drawn again.
    let ran = lumigraph(
        folder.path(),
        "render wall --proxy plane --no-exposure --views wall --json -o left",
    )
    .ok();
    assert_eq!(
        ran.stderr
            .matches("warning: photo 0004.png is left out")
            .count(),
        1,
        "{}",
        ran.stderr
    );
    let report = ran.json()["report"].clone();
    assert_eq!(report["photos_total"], 8);
    let note = report["notes"][0].as_str().unwrap();
    assert!(note.starts_with("photo 0004.png is left out: "), "{report}");
    // No photo is decoded again for it, and what came before counts.
    let decoded = report["photos_decoded"].as_u64().unwrap();
    assert_eq!(report["cpu_memory"]["loads"], decoded + 1, "{report}");
    let left = files(&folder.path().join("left"));
    assert_eq!(left.len(), 9);

    // Decoding everything at once finds it too, and the frames are the same.
    let line = "render wall --proxy plane --no-exposure --views wall --no-skip -o all";
    let ran = lumigraph(folder.path(), line).ok();
    assert!(
        ran.stderr.contains("0004.png is left out"),
        "{}",
        ran.stderr
    );
    assert!(left == files(&folder.path().join("all")));

    for exposure in ["", " --no-exposure"] {
        let line = format!("render wall --proxy plane{exposure} --views wall --strict -o strict");
        let error = lumigraph(folder.path(), &line).error(1);
        assert!(error.contains("0004.png"), "{error}");
    }
}

#[test]
fn strict_imports_decode_every_photo() {
    let folder = with_wall();
    let (here, wall) = (folder.path(), folder.path().join("wall"));
    let jpeg = wall.join("images/0005.jpg");
    let png = jpeg.with_extension("png");
    let photo = image::open(&png).unwrap().into_rgb8();
    photo.save(&jpeg).unwrap();
    fs::remove_file(&png).unwrap();
    let sparse = wall.join("sparse/0");
    let mut model = calibrate::colmap::read_model(&sparse).unwrap();
    for image in model.images.values_mut().filter(|i| i.name == "0005.png") {
        image.name = "0005.jpg".to_owned();
    }
    calibrate::colmap::write_binary(&model, &sparse).unwrap();
    lumigraph(here, "info wall --strict").ok();
    lumigraph(here, "import wall --strict -o whole").ok();

    // Its header says all that is asked of it otherwise.
    let whole = fs::read(&jpeg).unwrap();
    fs::write(&jpeg, &whole[..whole.len() / 2]).unwrap();
    for line in [
        "info wall --strict",
        "info whole --strict",
        "import wall --strict -o strict",
        "import wall --strict --no-exposure -o strict",
        "import wall --strict --undistort -o strict",
    ] {
        let error = lumigraph(here, line).error(1);
        assert!(error.starts_with("photo 0005.jpg: "), "{error}");
        assert!(error.contains("the JPEG data have no end"), "{error}");
    }
    assert!(!here.join("strict").exists());
    lumigraph(here, "info wall").ok();
    lumigraph(here, "import wall --no-exposure -o scene").ok();
}

#[test]
fn strict_imports_decode_what_lies_beside_the_photos() {
    let folder = with_wall();
    let here = folder.path();
    let check = |file: &str| {
        let path = here.join("wall").join(file);
        let whole = fs::read(&path).unwrap();
        lumigraph(here, "info wall --strict").ok();
        fs::write(&path, &whole[..whole.len() / 2]).unwrap();
        for line in [
            "info wall --strict",
            "import wall --strict -o strict",
            "import wall --strict --undistort -o strict",
        ] {
            let error = lumigraph(here, line).error(1);
            let is_told = error.starts_with("photo 0003.png: ") && error.contains(file);
            assert!(is_told, "{line}: {error}");
        }
        fs::write(&path, whole).unwrap();
    };
    // Ignoring so many tenths of each photo.
    let masks = |tenths: u32| {
        fs::create_dir_all(here.join("wall/masks")).unwrap();
        for i in 0..9 {
            let value = |x: u32, y: u32| {
                Luma([if (7 * x + 13 * y) % 10 < tenths {
                    0
                } else {
                    255
                }])
            };
            let mask = GrayImage::from_fn(96, 72, value);
            mask.save(here.join(format!("wall/masks/{i:04}.png")))
                .unwrap();
        }
    };
    check("depth/0003.png");
    masks(2);
    check("masks/0003.png");
    masks(8);
    let said = lumigraph(here, "info wall").ok().stderr;
    assert!(said.contains("serve the hull only"), "{said}");
    check("masks/0003.png");
}

#[test]
fn a_corrupt_held_out_photo_cannot_be_scored() {
    let folder = with_wall();
    let path = folder.path().join("wall/images/0008.png");
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    let ran = lumigraph(folder.path(), "evaluate wall --proxy plane --json").ok();
    assert_eq!(ran.json()["photos"].as_array().unwrap().len(), 1);
    assert!(
        ran.stderr.contains("0008.png is left out"),
        "{}",
        ran.stderr
    );
    let report = ran.json()["report"].clone();
    let note = report["notes"][0].as_str().unwrap();
    assert!(note.starts_with("photo 0008.png is left out: "), "{report}");
    let error = lumigraph(folder.path(), "evaluate wall --proxy plane --strict").error(1);
    assert!(error.contains("0008.png"), "{error}");
}

#[test]
fn splits_must_name_photos() {
    let folder = with_wall();
    let split = folder.path().join("s.json");
    let error = |text: &str| {
        fs::write(&split, text).unwrap();
        lumigraph(
            folder.path(),
            "evaluate wall --proxy plane --hold-out s.json",
        )
        .error(1)
    };
    assert_eq!(
        error(r#"{"test": ["0001.png", "0010.png", "x.jpg"]}"#),
        "s.json: the scene has no 0010.png, x.jpg; it has 0000.png, 0001.png and 7 more; name those, \
         or choose others with --hold-out FILE (or, to `evaluate`, --every N)"
    );
    assert_eq!(
        error(r#"{"test": []}"#),
        "s.json: \"test\" names no photo; name some to hold out"
    );
    assert!(error("{").starts_with("s.json: not a split"));
    let all: Vec<String> = (0..9).map(|i| format!("\"000{i}.png\"")).collect();
    let none = error(&format!("{{\"test\": [{}]}}", all.join(",")));
    assert_eq!(
        none,
        "no photo is left to render from: all 9 are held out or corrupt"
    );
    let missing = lumigraph(
        folder.path(),
        "evaluate wall --proxy plane --hold-out none.json",
    )
    .error(1);
    assert!(
        missing.starts_with("none.json: cannot read the split"),
        "{missing}"
    );
}

#[test]
fn a_scene_without_points_says_how_to_go_on() {
    let folder = with_wall();
    let wall = folder.path().join("wall");
    let mut model = calibrate::colmap::read_model(&wall.join("sparse/0")).unwrap();
    model.points.clear();
    for image in model.images.values_mut() {
        image.keypoints.clear();
    }
    fs::remove_dir_all(wall.join("sparse")).unwrap();
    calibrate::colmap::write_text(&model, &wall.join("sparse/0")).unwrap();
    // The cameras look at something.
    let ran = lumigraph(folder.path(), "evaluate wall --proxy plane").ok();
    assert!(
        ran.stderr.contains("the optical axes of 7 photos"),
        "{}",
        ran.stderr
    );
    // Side by side they tell no distance.
    for image in model.images.values_mut() {
        image.camera_from_world.rotation = glam::DQuat::IDENTITY;
    }
    calibrate::colmap::write_text(&model, &wall.join("sparse/0")).unwrap();
    let error = lumigraph(folder.path(), "evaluate wall --proxy plane").error(1);
    assert!(error.contains("proxy SCENE plane --point"), "{error}");
    let by_hand = "proxy wall plane --point 0,0,2 --normal 0,0,1 -o p.json";
    lumigraph(folder.path(), by_hand).ok();
    lumigraph(folder.path(), "evaluate wall --proxy p.json").ok();
}

/// Choosing a proxy may take minutes: what cannot be drawn is said first.
#[test]
fn views_that_cannot_be_read_are_said_before_a_proxy_is_fitted() {
    let folder = with_wall();
    fs::write(folder.path().join("odd.json"), "{}").unwrap();
    fs::write(
        folder.path().join("huge.json"),
        r#"{"version": 1, "fps": 30, "frames": [{"name": "far", "width": 1000000, "height": 1000000,
            "model": "PINHOLE", "params": [9, 9, 5, 5],
            "camera_from_world": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}]}"#,
    )
    .unwrap();
    for (line, code, said) in [
        (
            "render wall --views nope -o out",
            2,
            "--views nope: there is no such file",
        ),
        ("render wall --path nope.json -o out", 1, "nope.json"),
        ("render wall --path odd.json -o out", 1, "odd.json"),
        (
            "render wall --path orbit --proxy nope.ply -o out",
            2,
            "nope.ply: there is no such file",
        ),
        (
            "field wall --view 0001.png --path nope.json -o out.png",
            1,
            "nope.json",
        ),
        ("field wall --view nope.png -o out.png", 1, "nope.png"),
    ] {
        let ran = lumigraph(folder.path(), line);
        let error = ran.error(code);
        assert!(error.contains(said), "{line}: {error}");
        assert!(!ran.stderr.contains("proxy: "), "{line}: {}", ran.stderr);
    }
    let ran = lumigraph(
        folder.path(),
        "render wall --proxy plane --path huge.json -o out",
    );
    let error = ran.error(1);
    assert!(
        error.contains("frame far has 1000000 x 1000000 pixels"),
        "{error}"
    );
    assert!(!folder.path().join("out").exists());
}
