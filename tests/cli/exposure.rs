//! Photos of different exposures.

use crate::run::{files, lumigraph, with_wall};
use calibrate::colmap;
use image::{GrayImage, Luma};
use serde_json::Value;
use std::path::Path;

/// A gain of each channel for the photo of an index, within ±30 %.
fn gain(i: usize) -> [f64; 3] {
    let at = |salt: usize| 1.0 + 0.3 * (((7 * i + salt) % 9) as f64 / 4.0 - 1.0);
    [at(0), at(3), at(5)]
}

/// How much darker the wall is than usual: so much that hardly a value reaches the shoulder.
const DIM: f64 = 0.3;

/// Multiplies the photos of `wall` by their gains, clipped to bytes.
fn expose(folder: &Path, gain: impl Fn(usize) -> [f64; 3]) {
    for i in 0..9 {
        let path = folder.join(format!("wall/images/{i:04}.png"));
        let mut photo = image::open(&path).unwrap().into_rgb8();
        for pixel in photo.pixels_mut() {
            for (v, g) in pixel.0.iter_mut().zip(gain(i)) {
                *v = (f64::from(*v) * g).round().min(255.0) as u8;
            }
        }
        photo.save(&path).unwrap();
    }
}

fn evaluate(folder: &Path, options: &str) -> Value {
    lumigraph(folder, &format!("evaluate {options} --proxy plane --json"))
        .ok()
        .json()
}

fn gains(folder: &Path) -> Vec<Option<[f64; 3]>> {
    let text = std::fs::read(folder.join("scene/scene.json")).unwrap();
    let scene: Value = serde_json::from_slice(&text).unwrap();
    let of = |photo: &Value| serde_json::from_value(photo["gain"].clone()).unwrap();
    scene["photos"].as_array().unwrap().iter().map(of).collect()
}

#[test]
fn known_gains_are_found_and_seams_go() {
    let folder = with_wall();
    expose(folder.path(), |_| [DIM; 3]);
    let equal = evaluate(folder.path(), "wall -o equal");
    expose(folder.path(), gain);
    let ran = lumigraph(folder.path(), "import wall -o scene").ok();
    assert!(ran.stderr.contains("exposure: gains 0."), "{}", ran.stderr);

    // 1. In the scene's file, relative to each other.
    let found: Vec<[f64; 3]> = gains(folder.path())
        .into_iter()
        .map(Option::unwrap)
        .collect();
    for c in 0..3 {
        let error = |i: usize| found[i][c].ln() - gain(i)[c].ln();
        let mean = (0..9).map(error).sum::<f64>() / 9.0;
        for i in 0..9 {
            assert!(
                (error(i) - mean).abs() < 0.01,
                "{i}: {:?}, {:?}",
                found[i],
                gain(i)
            );
        }
    }

    // 2. In what is drawn: the same from the capture as from the scene.
    let matched = evaluate(folder.path(), "wall -o matched");
    evaluate(folder.path(), "scene -o again");
    assert!(files(&folder.path().join("matched")) == files(&folder.path().join("again")));
    let unmatched = evaluate(folder.path(), "wall --no-exposure -o unmatched");
    let mean = |result: &Value, score: &str| result["mean"][score].as_f64().unwrap();
    let seams = [&equal, &matched, &unmatched].map(|r| mean(r, "seams"));
    assert!(
        seams[1] < seams[0] + 0.5 && seams[2] > 5.0 * seams[1],
        "{seams:?}"
    );
    let exposed = [&equal, &matched, &unmatched].map(|r| mean(r, "psnr_exposed"));
    assert!(exposed[1] > exposed[0] - 1.0, "{exposed:?}");
    assert!(exposed[1] > exposed[2] + 3.0, "{exposed:?}");
    assert_eq!(matched["exposure"]["how"], "matched");
    assert_eq!(unmatched["exposure"]["how"], "off");
    assert_eq!(unmatched["exposure"]["used"], false);

    // 3. A path from photo to photo ends at the photos as they were exposed.
    let drawn = |options: &str| {
        let line = format!("render scene --proxy plane --views wall/sparse/0 {options}");
        lumigraph(folder.path(), &line).ok();
    };
    drawn("-o all");
    drawn("--no-exposure -o all-unmatched");
    assert!(files(&folder.path().join("all")) == files(&folder.path().join("all-unmatched")));
}

#[test]
fn mattes_and_masks_that_are_nearly_whole_change_no_gain() {
    let folder = with_wall();
    let here = folder.path();
    expose(here, |_| [DIM; 3]);
    expose(here, gain);
    let found = |options: &str| {
        let line = format!("import wall{options} -o scene --force");
        lumigraph(here, &line).ok();
        gains(here)
    };
    let opaque = found("");
    assert!(opaque.iter().all(Option::is_some), "{opaque:?}");
    std::fs::create_dir(here.join("254")).unwrap();
    for i in 0..9 {
        let mask = GrayImage::from_pixel(96, 72, Luma([254]));
        mask.save(here.join(format!("254/{i:04}.png"))).unwrap();
    }
    let masks = here.join("254");
    assert_eq!(found(&format!(" --masks {}", masks.display())), opaque);
    for i in 0..9 {
        let path = here.join(format!("wall/images/{i:04}.png"));
        let mut photo = image::open(&path).unwrap().into_rgba8();
        photo.pixels_mut().for_each(|pixel| pixel.0[3] = 250);
        photo.save(&path).unwrap();
    }
    assert_eq!(found(""), opaque);
    // Where nothing is whole, that is why.
    for i in 0..9 {
        let mask = GrayImage::from_pixel(96, 72, Luma([100]));
        mask.save(here.join(format!("254/{i:04}.png"))).unwrap();
    }
    let line = format!("import wall --masks {} -o faint", masks.display());
    let said = lumigraph(here, &line).ok().stderr;
    assert!(
        said.contains("too few sparse points to match them by that they show whole"),
        "{said}"
    );
}

/// What draws leaves it out, so it has no say in the others' gains; but it has one.
#[test]
fn a_misplaced_photo_has_no_say_in_the_gains_of_a_scene_either() {
    let folder = with_wall();
    let here = folder.path();
    expose(here, |_| [DIM; 3]);
    expose(here, gain);
    let model_folder = here.join("wall/sparse/0");
    let mut model = colmap::read_model(&model_folder).unwrap();
    let mut images = model.images.values_mut();
    let stray = images.find(|image| image.name == "0003.png").unwrap();
    stray.camera_from_world.translation.x += 3.0;
    std::fs::remove_dir_all(&model_folder).unwrap();
    colmap::write_text(&model, &model_folder).unwrap();
    lumigraph(here, "import wall -o scene").ok();
    let drawn = |scene: &str| {
        let line = format!(
            "render {scene} --proxy plane --path orbit --frames 2 --size 48x36 --json -o {scene}-drawn"
        );
        let ran = lumigraph(here, &line).ok();
        let left_out = "left out, as misplaced: photo 0003.png";
        assert!(ran.stderr.contains(left_out), "{}", ran.stderr);
        let range = ran.json()["exposure"]["range"].clone();
        serde_json::from_value::<[f64; 2]>(range).unwrap()
    };
    let (capture, scene) = (drawn("wall"), drawn("scene"));
    let off = [0, 1].map(|k| (capture[k] - scene[k]).abs());
    assert!(off[0].max(off[1]) < 1e-9, "{capture:?} {scene:?}");
    assert!(files(&here.join("wall-drawn")) == files(&here.join("scene-drawn")));
    // Its own follows from the others'.
    let found = gains(here);
    let log = |i: usize, c: usize| (found[i].unwrap()[c] / gain(i)[c]).ln();
    for c in 0..3 {
        let others = (0..9).filter(|&i| i != 3).map(|i| log(i, c));
        let mean = others.sum::<f64>() / 8.0;
        assert!((log(3, c) - mean).abs() < 0.05, "{c}: {found:?}");
    }
}

#[test]
fn photos_of_one_exposure_are_drawn_as_they_are() {
    let folder = with_wall();
    let with = evaluate(folder.path(), "wall -o with");
    assert_eq!(
        with["exposure"]["how"], "not measurable",
        "{}",
        with["exposure"]
    );
    evaluate(folder.path(), "wall --no-exposure -o without");
    assert!(files(&folder.path().join("with")) == files(&folder.path().join("without")));
    lumigraph(folder.path(), "import wall -o scene").ok();
    assert!(gains(folder.path()).iter().all(Option::is_none));
    let text = std::fs::read_to_string(folder.path().join("scene/scene.json")).unwrap();
    assert!(text.contains("matched_without"), "{text}");
}

#[test]
fn photos_without_a_gain_beside_others_count_as_one() {
    let folder = with_wall();
    let here = folder.path();
    lumigraph(here, "import wall --no-exposure -o scene").ok();
    let path = here.join("scene/scene.json");
    let mut scene: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    scene["photos"][3]["gain"] = serde_json::json!([0.5, 0.5, 0.5]);
    std::fs::write(&path, scene.to_string()).unwrap();
    let exposure = evaluate(here, "scene --size 24x18")["exposure"].clone();
    assert_eq!(exposure["how"], "the scene's own");
    assert_eq!(exposure["range"], serde_json::json!([0.5, 1.0]));
    let line = "evaluate scene --size 24x18 --proxy plane";
    let said = lumigraph(here, line).ok().stderr;
    let range = "exposure: gains 0.500 to 1.000 (the scene's own)";
    assert!(said.contains(range), "{said}");
    // One that is held out is not drawn from.
    let every = "scene --every 2 --size 24x18";
    scene["photos"][3]["gain"] = Value::Null;
    scene["photos"][4]["gain"] = serde_json::json!([0.5, 0.5, 0.5]);
    std::fs::write(&path, scene.to_string()).unwrap();
    let held_out = evaluate(here, every);
    let names = held_out["photos"].as_array().unwrap().iter();
    assert!(names.map(|p| &p["name"]).any(|name| name == "0004.png"));
    assert_eq!(held_out["exposure"]["used"], false);
}

#[test]
fn held_out_photos_have_no_say() {
    let folder = with_wall();
    expose(folder.path(), gain);
    lumigraph(folder.path(), "import wall -o scene").ok();
    for scene in ["wall", "scene"] {
        let render = |out: &str| {
            let line = format!(
                "render {scene} --proxy plane --hold-out wall/split.json --path orbit --frames 2 -o {out}"
            );
            lumigraph(folder.path(), &line).ok();
            files(&folder.path().join(out))
        };
        let honest = render(&format!("{scene}-a"));
        let saved = folder.path().join("wall/images/0000.png");
        let before = std::fs::read(&saved).unwrap();
        image::RgbImage::from_pixel(96, 72, image::Rgb([200, 90, 30]))
            .save(&saved)
            .unwrap();
        assert!(honest == render(&format!("{scene}-b")), "{scene}");
        std::fs::write(&saved, before).unwrap();
    }
}

#[test]
fn without_exposure_nothing_is_stored_or_used() {
    let folder = with_wall();
    expose(folder.path(), gain);
    let ran = lumigraph(folder.path(), "import wall --no-exposure -o scene").ok();
    assert!(ran.stderr.contains("--no-exposure"), "{}", ran.stderr);
    assert!(gains(folder.path()).iter().all(Option::is_none));
    let plain = evaluate(folder.path(), "scene -o plain");
    assert_eq!(plain["exposure"]["how"], "the scene has none");
    evaluate(folder.path(), "wall --no-exposure -o none");
    assert!(files(&folder.path().join("plain")) == files(&folder.path().join("none")));
    lumigraph(
        folder.path(),
        "field wall --proxy plane --no-exposure --view 0004.png -o f.png",
    )
    .ok();
}
