//! Photos that were reduced after they were calibrated.

use crate::run::{lumigraph, with_wall};
use image::imageops::{FilterType, crop_imm};
use serde_json::Value;
use std::fs;

#[test]
fn reduced_photos_are_used_with_cameras_that_follow_them() {
    let folder = with_wall();
    let here = folder.path();
    let halves = here.join("wall/images_2");
    fs::create_dir(&halves).unwrap();
    let photos = || {
        fs::read_dir(here.join("wall/images"))
            .unwrap()
            .map(|e| e.unwrap().path())
    };
    for photo in photos() {
        let picture = image::open(&photo).unwrap().into_rgb8();
        let half = image::imageops::resize(&picture, 48, 36, FilterType::Triangle);
        half.save(halves.join(photo.file_name().unwrap())).unwrap();
    }
    let imported = "import wall/images_2 --calibration wall/sparse/0 -o half";
    let error = lumigraph(here, imported).error(1);
    let said = "0000.png: the photo has 48 × 36 pixels, expected 96 × 72 as calibrated; use the photos that were \
                calibrated, or calibrate these; if it was reduced or enlarged since, both sides alike, `lumigraph import \
                --resized` scales its camera to it";
    assert!(error.ends_with(said), "{error}");
    let imported = &format!("{imported} --resized");
    let ran = lumigraph(here, imported).ok();
    let note = "note: 9 of 9 photos were reduced or enlarged since they were calibrated (0000.png has 48 × 36 pixels for \
                96 × 72, for one): their cameras are scaled to them\n";
    assert!(ran.stderr.contains(note), "{}", ran.stderr);

    // They show what the whole ones do, which have more to show.
    let ran = lumigraph(here, "import wall --resized -o whole").ok();
    let note = "note: no photo was reduced or enlarged since it was calibrated: --resized changes nothing\n";
    assert!(ran.stderr.contains(note), "{}", ran.stderr);
    let psnr = |scene: &str| {
        let line = format!("evaluate {scene} --every 4 --proxy plane --size 48x36 --json");
        let ran = lumigraph(here, &line).ok();
        let json: Value = serde_json::from_str(&ran.stdout).unwrap();
        json["mean"]["psnr"].as_f64().unwrap()
    };
    let [half, whole] = ["half", "whole"].map(psnr);
    assert!(half > 28.0 && whole > half, "{half} {whole}");

    // What is cut off is no copy.
    for photo in photos() {
        let picture = image::open(&photo).unwrap().into_rgb8();
        let cut = crop_imm(&picture, 4, 0, 80, 72).to_image();
        cut.save(halves.join(photo.file_name().unwrap())).unwrap();
    }
    let error = lumigraph(here, &imported.replace("half", "cut")).error(1);
    let said = "0000.png: the photo has 80 × 72 pixels, expected 96 × 72 as calibrated";
    assert!(error.contains(said), "{error}");
    assert!(!here.join("cut").exists());
    let error = lumigraph(
        here,
        "render half --path orbit --frames 1 --size 48x36 -o frames",
    )
    .error(1);
    let said = "0000.png: the photo has 80 × 72 pixels, expected 48 × 36 as calibrated";
    assert!(error.contains(said), "{error}");
}

/// Photos that lie in `images_2` alone, as some programs leave them.
#[test]
fn what_is_said_of_reduced_photos_in_another_folder_is_right() {
    let folder = with_wall();
    let here = folder.path();
    fs::rename(here.join("wall/images"), here.join("wall/images_2")).unwrap();
    let photos = fs::read_dir(here.join("wall/images_2")).unwrap();
    let photos: Vec<_> = photos.map(|entry| entry.unwrap().path()).collect();
    let said = |rename: &str, option: &str| {
        let advice = format!(
            "called so in another folder, as 9 of 9 are: {rename}`lumigraph import wall/images_2 --calibration \
             wall/sparse/0{option} -o SCENE`"
        );
        let error = lumigraph(here, "import wall -o scene").error(1);
        assert!(error.contains(&advice), "{advice}: {error}");
    };
    said("rename wall/images_2 to wall/images, or ", "");
    for photo in &photos {
        let picture = image::open(photo).unwrap().into_rgb8();
        let half = image::imageops::resize(&picture, 48, 36, FilterType::Triangle);
        half.save(photo).unwrap();
    }
    said("", " --resized");
    let line = "import wall/images_2 --calibration wall/sparse/0 --resized -o scene";
    let ran = lumigraph(here, line).ok();
    assert!(ran.stdout.contains("9 photos"), "{}", ran.stdout);
}
