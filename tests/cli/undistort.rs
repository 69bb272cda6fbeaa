//! A capture through a fisheye, undistorted, against what a pinhole would have taken.

use crate::run::{lumigraph, with_wall};
use calibrate::{Camera, CameraId, ModelKind, colmap};
use datasets::{DEPTH_STEPS_PER_UNIT, Dataset, Options, by_name, render_depth, render_view};
use image::{DynamicImage, GrayImage, Rgba};
use std::fs;
use std::path::Path;

/// The shelf's photos as a fisheye of 137° from corner to corner takes them.
fn through_a_fisheye() -> Dataset {
    let options = Options {
        size: Some((200, 150)),
        views: Some(9),
        samples_per_side: Some(3),
    };
    let mut shelf = by_name("shelf", &options).unwrap();
    let camera = Camera {
        model: ModelKind::OpenCvFisheye,
        width: 200,
        height: 150,
        params: vec![105.0, 104.0, 99.0, 76.0, 0.02, -0.01, 0.0, 0.0],
    };
    let lens = camera.lens().unwrap();
    for photo in &mut shelf.photos {
        photo.camera = camera.clone();
        photo.view.lens = lens;
    }
    let whole = &mut shelf.reconstruction;
    whole.cameras.insert(CameraId(1), camera);
    for image in whole.images.values_mut() {
        for keypoint in &mut image.keypoints {
            let point = whole.points[&keypoint.point.unwrap()].position;
            let pixel = lens.project(image.camera_from_world * point).unwrap();
            (keypoint.x, keypoint.y) = (pixel.x, pixel.y);
        }
    }
    shelf
}

/// Of views of held-out photos, where their photos show something.
fn psnr(folder: &Path, scene: &str, key: &str) -> f64 {
    let line = format!("evaluate {scene} --proxy plane --json");
    let result = lumigraph(folder, &line).ok().json();
    result["mean"][key].as_f64().unwrap()
}

#[test]
fn a_fisheyes_photos_masks_and_depth_become_a_pinholes() {
    let shelf = through_a_fisheye();
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("shelf");
    datasets::write(&shelf, &capture).unwrap();
    // The left third of one photo is to be ignored, said in zeros and ones.
    let mask = GrayImage::from_fn(200, 150, |x, _| image::Luma([u8::from(x >= 66)]));
    fs::create_dir(capture.join("masks")).unwrap();
    mask.save(capture.join("masks/0003.png")).unwrap();
    lumigraph(folder.path(), "import shelf --undistort -o flat").ok();

    let flat = folder.path().join("flat");
    let bytes = fs::read(flat.join("scene.json")).unwrap();
    let scene: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
    let model = colmap::read_model(&flat.join("model")).unwrap();
    let pinhole = &model.cameras[&CameraId(1)];
    assert_eq!(pinhole.model, ModelKind::Pinhole);
    let open = |entry: &serde_json::Value| -> DynamicImage {
        image::open(flat.join(entry.as_str().unwrap())).unwrap()
    };
    for (photo, entry) in shelf.photos.iter().zip(scene["photos"].as_array().unwrap()) {
        assert_eq!(entry["name"], photo.name);
        let mut view = photo.view.clone();
        view.lens = pinhole.lens().unwrap();
        (view.width, view.height) = (pinhole.width, pinhole.height);

        // 1. The photo, where it is not ignored.
        let mask = open(&entry["ignore_mask"]).into_luma8();
        let mut picture = open(&entry["path"]).into_rgba8();
        let mut truth = render_view(&shelf.scene, &view, 3);
        for (x, y, value) in mask.enumerate_pixels() {
            if value.0[0] < 255 {
                picture.put_pixel(x, y, Rgba([0, 0, 0, 255]));
                truth.put_pixel(x, y, Rgba([0, 0, 0, 255]));
            }
        }
        let ignored = mask.iter().filter(|value| **value == 0).count();
        let share = ignored as f64 / mask.len() as f64;
        let psnr = render::score::score(&picture, &truth).unwrap().psnr;
        println!("{}: {psnr:.2} dB, {share:.3} ignored", photo.name);
        // Measured 34.5 to 34.8 dB, and 37.4 where a third is ignored.
        assert!(psnr > 33.5, "{}: {psnr} dB", photo.name);
        let expected = if photo.name == "0003.png" { 0.63 } else { 0.39 };
        assert!((share - expected).abs() < 0.02, "{}: {share}", photo.name);

        // 2. Its depth, but where a step is nearer than half a pixel.
        let depth = open(&entry["depth_map"]).into_luma16();
        let truth = render_depth(&shelf.scene, &view);
        let scale = entry["depth_scale"].as_f64().unwrap();
        assert_eq!(scale, 1.0 / DEPTH_STEPS_PER_UNIT);
        let (mut known, mut close) = (0, 0);
        for ((depth, truth), used) in depth.iter().zip(&truth).zip(mask.iter()) {
            if *used == 255 && *depth > 0 {
                known += 1;
                close += usize::from((f64::from(*depth) * scale / truth - 1.0).abs() < 0.02);
            }
        }
        let (known, close) = (known as f64, close as f64);
        // All that is used is known, and 99.3 % or more right.
        assert!(known / depth.len() as f64 > 0.98 * (1.0 - share));
        assert!(close / known > 0.985, "{}: {close} of {known}", photo.name);
    }

    // 3. Views are as good, though of less.
    let original = psnr(folder.path(), "shelf", "psnr_covered");
    let undistorted = psnr(folder.path(), "flat", "psnr_masked");
    println!("views: {original:.2} dB, undistorted {undistorted:.2} dB");
}

#[test]
fn renamed_photos_are_found_by_the_captures_names_too() {
    let folder = with_wall();
    lumigraph(folder.path(), "import wall -o scene").ok();
    // As of photos that were JPEG files before they were undistorted.
    let file = folder.path().join("scene/scene.json");
    let mut scene: serde_json::Value = serde_json::from_slice(&fs::read(&file).unwrap()).unwrap();
    assert_eq!(scene["photos"][0]["name"], "0000.png");
    scene["photos"][0]["original"] = "0000.jpg".into();
    fs::write(&file, scene.to_string()).unwrap();
    let made = |line: &str, file: &str| {
        lumigraph(folder.path(), &format!("{line} -o {file}")).ok();
        fs::read(folder.path().join(file)).unwrap()
    };
    let field = |name: &str, file: &str| {
        let line = format!("field scene --proxy plane --without-view --size 48x36 --view {name}");
        made(&line, file)
    };
    assert!(field("0000.jpg", "was.png") == field("0000.png", "is.png"));
    let focused =
        |name: &str, file: &str| made(&format!("proxy scene plane --focus {name}:48,36"), file);
    assert!(focused("0000.jpg", "was.json") == focused("0000.png", "is.json"));
    // Of no photo it is no name here either.
    let line = "field scene --proxy plane --view 0001.jpg -o none.png";
    let error = lumigraph(folder.path(), line).error(1);
    assert!(error.contains("no photo is called 0001.jpg"), "{error}");
}
