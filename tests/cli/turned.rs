//! Photos that are to be shown turned, as their EXIF data say.

use crate::run::{lumigraph, with_wall};
use image::ImageFormat;
use image::imageops::{rotate90, rotate270};
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
