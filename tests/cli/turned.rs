//! Photos that are to be shown turned, as their EXIF data say.

use crate::run::{lumigraph, with_wall};
use calibrate::{Reconstruction, colmap};
use glam::DVec3;
use image::imageops::{rotate90, rotate180, rotate270};
use image::{ImageFormat, RgbImage};
use std::fs;
use std::io::Cursor;
use std::path::Path;

/// Stores a photo as a JPEG that is to be shown turned by a quarter, under its own name.
pub(crate) fn turn(photo: &Path) {
    store(photo, 6);
}

/// Stores a photo as a JPEG of an orientation, under its own name.
fn store(photo: &Path, orientation: u8) {
    let bytes = std::fs::read(photo).unwrap();
    let picture = image::load_from_memory(&bytes).unwrap().into_rgb8();
    let mut jpeg = Cursor::new(Vec::new());
    picture.write_to(&mut jpeg, ImageFormat::Jpeg).unwrap();
    // TIFF, little endian, one entry: orientation (0x0112), short, one.
    let mut exif = *b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
    exif[24] = orientation;
    let mut segment = vec![0xFF, 0xE1, 0, exif.len() as u8 + 2];
    segment.extend(exif);
    let jpeg = jpeg.into_inner();
    // Behind the start of the image.
    let bytes = [&jpeg[..2], &segment[..], &jpeg[2..]].concat();
    std::fs::write(photo, bytes).unwrap();
}

#[test]
fn photos_that_are_stored_turned_are_told() {
    let folder = with_wall();
    let here = folder.path();
    let said = |line: &str| lumigraph(here, line).ok().stderr;
    assert!(!said("import wall -o plain").contains("EXIF"));
    turn(&here.join("wall/images/0003.png"));
    let note = "note: 1 of 9 photos are stored turned or mirrored (EXIF orientation; 6 in 0003.png, for one): their \
                pixels are used as stored, of which calibrations speak; paths derived from them and the window stand \
                upright as they do when they are shown turned\n";
    for line in ["import wall -o scene", "info wall"] {
        let said = said(line);
        assert_eq!(said.matches(note).count(), 1, "{line}: {said}");
    }
    // Once is enough.
    assert!(!said("info scene").contains("EXIF"));
}

#[test]
fn derived_paths_stand_as_photos_do_when_they_are_shown_turned() {
    let folder = with_wall();
    let here = folder.path();
    let drawn = |scene: &str, orientation: u8| {
        for photo in std::fs::read_dir(here.join("wall/images")).unwrap() {
            store(&photo.unwrap().path(), orientation);
        }
        lumigraph(here, &format!("import wall -o {scene}")).ok();
        let line = format!("render {scene} --proxy plane --path sweep --frames 2 -o {scene}-film");
        lumigraph(here, &line).ok();
        let frames = ["frame_0000.png", "frame_0001.png"];
        frames.map(|name| {
            let file = here.join(format!("{scene}-film")).join(name);
            image::open(file).unwrap().into_rgb8()
        })
    };
    let stored = drawn("upright", 1);
    // The vertical is fitted to what is level in the photos, which are other axes of theirs: a pixel or two off.
    let off = |a: &image::RgbImage, b: &image::RgbImage| {
        assert_eq!(a.dimensions(), b.dimensions());
        let pairs = a.as_raw().iter().zip(b.as_raw());
        pairs.map(|(a, b)| u64::from(a.abs_diff(*b))).sum::<u64>()
    };
    for (stored, shown) in stored.iter().zip(drawn("turned", 6)) {
        let [clockwise, other] =
            [rotate90(stored), rotate270(stored)].map(|turned| off(&turned, &shown));
        assert!(2 * clockwise < other, "{clockwise} {other}");
    }
}

/// By how many pixels the cameras of photos that are to be shown turned by quarters are off from those of the same
/// photos as they are shown.
fn worst_px(stored: &Reconstruction, shown: &Reconstruction, quarters: u8) -> f64 {
    assert_eq!(stored.images.len(), shown.images.len());
    let mut worst = 0.0_f64;
    for (stored_image, shown_image) in stored.images.values().zip(shown.images.values()) {
        assert_eq!(stored_image.name, shown_image.name);
        let camera = &shown.cameras[&shown_image.camera_id];
        let size = (camera.width, camera.height);
        let own = &stored.cameras[&stored_image.camera_id];
        for seen in [DVec3::new(0.2, 0.1, 1.0), DVec3::new(-0.1, 0.25, 1.0)] {
            let point = shown_image.camera_from_world.inverse() * seen;
            let expected = camera.lens().unwrap().project(seen).unwrap();
            let expected = expected.turned((4 - quarters) % 4, size);
            let found = own.lens().unwrap();
            let found = found.project(stored_image.camera_from_world * point);
            worst = worst.max(found.unwrap().distance(expected));
        }
    }
    worst
}

/// OpenCV turns photos as it reads them, so that its calibrations speak of what is shown.
#[test]
fn cameras_that_opencv_calibrated_see_photos_as_they_are_stored() {
    let folder = with_wall();
    let here = folder.path();
    let said = |line: &str| lumigraph(here, line).ok().stderr;
    said("import wall -o shown");
    said("export wall --format opencv -o stored.yml");
    let shown = colmap::read_model(&here.join("shown/model")).unwrap();
    let of_stored = fs::read_to_string(here.join("stored.yml")).unwrap();
    let of_shown = of_stored.replace("ignore_orientation: 1\n", "");
    assert_ne!(of_stored, of_shown);
    let lines = of_shown.lines().filter(|line| !line.starts_with("image_"));
    let without_size: String = lines.map(|line| format!("{line}\n")).collect();
    let photos: Vec<_> = fs::read_dir(here.join("wall/images")).unwrap().collect();
    let photos: Vec<_> = photos
        .into_iter()
        .map(|photo| photo.unwrap().path())
        .collect();
    let capture = |orientation: u8, stored: fn(&RgbImage) -> RgbImage, text: &str| {
        let images = here.join("cv/images");
        fs::create_dir_all(&images).unwrap();
        for photo in &photos {
            let to = images.join(photo.file_name().unwrap());
            let picture = image::open(photo).unwrap().into_rgb8();
            stored(&picture).save(&to).unwrap();
            store(&to, orientation);
        }
        fs::write(here.join("cv/calibration.yml"), text).unwrap();
    };
    let model = || colmap::read_model(&here.join("scene/model")).unwrap();
    let note = "cv/calibration.yml is taken to speak of them so, and their cameras are turned";

    type Turn = fn(&RgbImage) -> RgbImage;
    let turns: [(u8, u8, Turn); 3] = [(6, 1, rotate270), (3, 2, rotate180), (8, 3, rotate90)];
    for (orientation, quarters, stored) in turns {
        for text in [&of_shown, &without_size] {
            capture(orientation, stored, text);
            let said = said("import cv -o scene --force");
            assert!(said.contains(note), "{orientation}: {said}");
            let worst = worst_px(&model(), &shown, quarters);
            assert!(worst < 1e-6, "{orientation}: {worst}");
        }
    }

    // As stored: where the file says so, and where only that has its size.
    for (orientation, text) in [(3, &of_stored), (6, &of_shown)] {
        capture(orientation, RgbImage::clone, text);
        let said = said("import cv -o scene --force");
        assert!(said.contains("are used as stored"), "{said}");
        let worst = worst_px(&model(), &shown, 0);
        assert!(worst < 1e-6, "{orientation}: {worst}");
    }

    capture(4, RgbImage::clone, &of_shown);
    let error = lumigraph(here, "import cv -o scene --force").error(1);
    for part in [
        "no camera here is mirrored",
        "`ignore_orientation: 1` into cv/calibration.yml",
    ] {
        assert!(error.contains(part), "{error}");
    }
}
