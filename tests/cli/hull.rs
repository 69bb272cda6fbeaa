//! Hulls of all kinds of masks, good and bad.

use crate::run::{Ran, files, lumigraph};
use datasets::{Options, by_name};
use image::{DynamicImage, GrayImage, ImageBuffer, Luma};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const SIZE: (u32, u32) = (96, 72);
const PHOTOS: u32 = 8;

/// A folder with the capture `car`: opaque photos, their silhouettes in `masks`.
fn with_car() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let options = Options {
        size: Some(SIZE),
        views: Some(PHOTOS as usize),
        samples_per_side: Some(2),
    };
    let car = by_name("car", &options).unwrap();
    let capture = folder.path().join("car");
    datasets::write(&car, &capture).unwrap();
    fs::remove_dir_all(capture.join("depth")).unwrap();
    fs::create_dir(capture.join("masks")).unwrap();
    for i in 0..PHOTOS {
        let file = capture.join(format!("images/{i:04}.png"));
        let photo = image::open(&file).unwrap().into_rgba8();
        let mask = GrayImage::from_fn(SIZE.0, SIZE.1, |x, y| Luma([photo.get_pixel(x, y).0[3]]));
        mask.save(mask_file(&folder, i)).unwrap();
        // What is left has no plain background either.
        let mut rgb = DynamicImage::from(photo).into_rgb8();
        for (x, y, pixel) in rgb.enumerate_pixels_mut() {
            if mask.get_pixel(x, y).0[0] == 0 {
                pixel.0 = [
                    (x * 37 % 251) as u8,
                    (y * 91 % 241) as u8,
                    (x * y % 239) as u8,
                ];
            }
        }
        rgb.save(file).unwrap();
    }
    folder
}

fn mask_file(folder: &TempDir, i: u32) -> PathBuf {
    folder.path().join(format!("car/masks/{i:04}.png"))
}

fn all(value: u8) -> GrayImage {
    ImageBuffer::from_pixel(SIZE.0, SIZE.1, Luma([value]))
}

fn hull(folder: &Path, scene: &str) -> Ran {
    lumigraph(folder, &format!("proxy {scene} hull -o hull.ply"))
}

/// The share of the silhouettes that the hull covers, in percent.
fn coverage(ran: &Ran) -> f64 {
    let text = ran.stdout.split("covers ").nth(1).unwrap();
    text.split(' ').next().unwrap().parse().unwrap()
}

#[test]
fn silhouettes_in_masks_carve_without_being_asked_for() {
    let folder = with_car();
    let here = folder.path();
    lumigraph(here, "import car -o scene").ok();
    let json = fs::read_to_string(here.join("scene/scene.json")).unwrap();
    assert!(
        json.contains("\"silhouette\": \"../car/masks/0003.png\""),
        "{json}"
    );
    assert!(!json.contains("ignore_mask"), "{json}");
    // The capture itself, the scene, and the mattes asked for: one hull.
    let found = coverage(&hull(here, "car").ok());
    assert!(found > 99.0, "{found}");
    assert_eq!(coverage(&hull(here, "scene").ok()), found);
    let info = lumigraph(here, "info scene --json").ok().json();
    assert_eq!(info["silhouettes"], PHOTOS);
    lumigraph(here, "import car --mattes masks -o mattes").ok();
    assert_eq!(coverage(&hull(here, "mattes").ok()), found);
    // Where photos are cut out, the hull bounds what is made of points.
    let scores = |line: &str| lumigraph(here, line).ok().json()["mean"].clone();
    lumigraph(here, "proxy mattes points -o points.json").ok();
    let bounded = fs::read_to_string(here.join("points.json")).unwrap();
    fs::write(
        here.join("free.json"),
        r#"{"version": 1, "kind": "points"}"#,
    )
    .unwrap();
    let within = scores("evaluate mattes --every 4 --proxy points --json");
    let free = scores("evaluate mattes --every 4 --proxy free.json --json");
    let share = |scores: &serde_json::Value, key: &str| scores[key].as_f64().unwrap();
    let gain = |key: &str| share(&within, key) - share(&free, key);
    assert!(gain("psnr") > 0.5 && gain("ssim") > 0.1, "{within}, {free}");
    assert!(
        gain("covered_background") < 0.0 && gain("coverage_background") < 0.0,
        "{within}, {free}"
    );
    // No half a per cent less than free points cover if all photos count alike, transparent or not: 99.62 %.
    assert!(share(&within, "covered_matte") > 0.9912, "{within}");
    // A file's hull has to be one.
    let broken = bounded.replacen("\"triangles\":[[", "\"triangles\":[[999999,0,1],[", 1);
    fs::write(here.join("broken.json"), broken).unwrap();
    let error = lumigraph(here, "evaluate mattes --proxy broken.json").error(1);
    assert!(
        error.contains("broken.json: the hull around it has"),
        "{error}"
    );
    // Pictures stay whole.
    let of = |scene: &str| {
        let line = format!("evaluate {scene} --every 4 --proxy plane --json");
        lumigraph(here, &line).ok().json()["mean"]["psnr"].clone()
    };
    lumigraph(here, "import car --no-masks -o without").ok();
    assert_eq!(of("scene"), of("without"));
    // Masks that ignore all else are no silhouettes.
    lumigraph(here, "import car --masks masks -o masked").ok();
    let error = hull(here, "masked").error(1);
    assert!(error.contains("--mattes"), "{error}");
    // Undistorting keeps them.
    lumigraph(here, "import car --undistort -o flat").ok();
    assert!(here.join("flat/silhouettes/0003.png.png").exists());
    assert_eq!(coverage(&hull(here, "flat").ok()), found);
}

#[test]
fn masks_that_show_nothing_or_everything_are_told() {
    let folder = with_car();
    let here = folder.path();
    let good = fs::read(mask_file(&folder, 3)).unwrap();

    // One or two are left out, with a note.
    all(0).save(mask_file(&folder, 3)).unwrap();
    let ran = hull(here, "car").ok();
    assert!(
        ran.stderr
            .contains("1 of 8 masks are all object or all background"),
        "{}",
        ran.stderr
    );
    assert!(ran.stderr.contains("0003.png"), "{}", ran.stderr);
    fs::remove_file(here.join("hull.ply")).unwrap();

    let before = files(here);
    for i in 0..PHOTOS {
        all(0).save(mask_file(&folder, i)).unwrap();
    }
    let error = hull(here, "car").error(1);
    assert!(
        error.contains("of 8 masks 8 show no object and 0 nothing else"),
        "{error}"
    );
    lumigraph(here, "import car --mattes masks -o black").ok();
    assert_eq!(hull(here, "black").error(1), error);
    for i in 0..PHOTOS {
        all(255).save(mask_file(&folder, i)).unwrap();
    }
    // In `masks` these ignore nothing, and there is nothing else to go by.
    let error = hull(here, "car").error(1);
    assert!(
        error.contains("photo 0000.png has no matte") && error.contains("--mattes"),
        "{error}"
    );
    lumigraph(here, "import car --mattes masks -o white").ok();
    let error = hull(here, "white").error(1);
    assert!(
        error.contains("of 8 masks 0 show no object and 8 nothing else"),
        "{error}"
    );

    // Of another size, or no picture: named before anything is made.
    ImageBuffer::from_pixel(48, 36, Luma([0_u8]))
        .save(mask_file(&folder, 3))
        .unwrap();
    let error = hull(here, "car").error(1);
    assert!(
        error.starts_with("car/masks/0003.png: ") && error.contains("48 × 36"),
        "{error}"
    );
    fs::write(mask_file(&folder, 3), &good[..good.len() / 2]).unwrap();
    let error = hull(here, "white").error(1);
    assert!(error.contains("masks/0003.png"), "{error}");
    assert!(!files(here).contains_key(Path::new("hull.ply")));
    assert!(!before.contains_key(Path::new("hull.ply")));
}

#[test]
fn a_photo_that_cannot_be_decoded_takes_no_part_in_the_hull() {
    let folder = with_car();
    let here = folder.path();
    lumigraph(here, "import car --mattes masks -o scene").ok();
    let photo = here.join("car/images/0003.png");
    let whole = fs::read(&photo).unwrap();
    fs::write(&photo, &whole[..whole.len() / 2]).unwrap();
    let line = "render scene --proxy hull --path orbit --frames 1 --size 48x36 --json -o out";
    let ran = lumigraph(here, line).ok();
    // Drawing does not ask for it again.
    let warning = "warning: photo 0003.png is left out: cannot decode ";
    assert_eq!(ran.stderr.matches(warning).count(), 1, "{}", ran.stderr);
    let report = ran.json()["report"].clone();
    assert_eq!(report["photos_total"], PHOTOS - 1);
    let note = report["notes"][0].as_str().unwrap();
    assert!(note.starts_with("photo 0003.png is left out: "), "{note}");
    let error = lumigraph(here, "proxy scene hull --strict -o hull.ply").error(1);
    assert!(
        error.starts_with("photo 0003.png: cannot decode ") && error.contains("--strict"),
        "{error}"
    );
    assert!(!here.join("hull.ply").exists());
}

#[test]
fn inverted_masks_are_told() {
    let folder = with_car();
    for i in 0..PHOTOS {
        let mut mask = image::open(mask_file(&folder, i)).unwrap().into_luma8();
        mask.pixels_mut().for_each(|p| p.0[0] = 255 - p.0[0]);
        mask.save(mask_file(&folder, i)).unwrap();
    }
    lumigraph(folder.path(), "import car --mattes masks -o scene").ok();
    let error = hull(folder.path(), "scene").error(1);
    assert!(error.contains("silhouettes of 8 photos"), "{error}");
}

/// Rewrites the capture's model, images after the first by `change` of their line's words.
fn with_model(folder: &TempDir, change: impl Fn(usize, &mut Vec<String>) -> bool) {
    let here = folder.path();
    lumigraph(here, "import car -o calibrated").ok();
    fs::remove_dir_all(here.join("car/sparse")).unwrap();
    let sparse = here.join("car/sparse/0");
    fs::create_dir_all(&sparse).unwrap();
    let model = here.join("calibrated/model");
    fs::copy(model.join("cameras.txt"), sparse.join("cameras.txt")).unwrap();
    fs::write(sparse.join("points3D.txt"), "").unwrap();
    let images = fs::read_to_string(model.join("images.txt")).unwrap();
    let posed = images.lines().filter(|l| l.ends_with(".png"));
    let mut text = String::new();
    for (i, line) in posed.enumerate() {
        let mut words: Vec<String> = line.split(' ').map(str::to_owned).collect();
        if change(i, &mut words) {
            text += &format!("{}\n\n", words.join(" "));
        }
    }
    fs::write(sparse.join("images.txt"), text).unwrap();
}

#[test]
fn two_photos_bound_a_hull() {
    let folder = with_car();
    with_model(&folder, |i, _| i == 0 || i == 2);
    let ran = hull(folder.path(), "car").ok();
    assert!(coverage(&ran) > 99.0, "{}", ran.stdout);
}

#[test]
fn cameras_on_top_of_each_other_bound_none() {
    let folder = with_car();
    let pose: std::cell::RefCell<Vec<String>> = Vec::new().into();
    with_model(&folder, |i, words| {
        if i == 0 {
            pose.replace(words[1..8].to_vec());
        }
        words[1..8].clone_from_slice(&pose.borrow());
        true
    });
    let error = hull(folder.path(), "car").error(1);
    assert!(error.contains("taken from one place"), "{error}");
    assert!(!folder.path().join("hull.ply").exists());
}
