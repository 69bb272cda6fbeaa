//! Photos that are to be shown turned, as their EXIF data say.

use crate::run::{lumigraph, with_wall};
use image::ImageFormat;
use std::io::Cursor;
use std::path::Path;

/// Stores a photo as a JPEG that is to be shown turned by a quarter, under its own name.
pub(crate) fn turn(photo: &Path) {
    let picture = image::open(photo).unwrap().into_rgb8();
    let mut jpeg = Cursor::new(Vec::new());
    picture.write_to(&mut jpeg, ImageFormat::Jpeg).unwrap();
    // TIFF, little endian, one entry: orientation (0x0112), short, one, 6.
    let exif = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
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
                pixels are used as stored, so that what is upright may lie on its side; `mogrify -auto-orient`, before \
                they are calibrated, stands them upright\n";
    for line in ["import wall -o scene", "info wall"] {
        let said = said(line);
        assert_eq!(said.matches(note).count(), 1, "{line}: {said}");
    }
    // Once is enough.
    assert!(!said("info scene").contains("EXIF"));
}
