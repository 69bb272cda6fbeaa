//! Listing, decoding and writing photos.

#[cfg(unix)]
use capture::{Beside, check_beside, decode_mask};
use capture::{
    CaptureError, PhotoSet, decode, decode_reduced, find_photos_folder, find_photos_within,
    photo_size, read_exif, resize, unread_photos, write_png,
};
use image::codecs::jpeg::JpegEncoder;
use image::{DynamicImage, GrayImage, ImageBuffer, ImageFormat, Luma, Rgba, RgbaImage};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

/// A picture whose every pixel is its own.
fn picture(width: u32, height: u32) -> RgbaImage {
    RgbaImage::from_fn(width, height, |x, y| {
        Rgba([(x * 7) as u8, (y * 5) as u8, (x + y) as u8, 255])
    })
}

fn jpeg_bytes(width: u32, height: u32) -> Vec<u8> {
    let rgb = DynamicImage::ImageRgba8(picture(width, height)).into_rgb8();
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, 95)
        .encode_image(&rgb)
        .unwrap();
    bytes
}

/// The bytes with another segment after the JPEG's start.
fn with_segment(jpeg: &[u8], marker: u8, payload: &[u8]) -> Vec<u8> {
    let length = u16::try_from(payload.len() + 2).unwrap().to_be_bytes();
    let head = [&jpeg[..2], &[0xFF, marker], &length, payload];
    [&head.concat(), &jpeg[2..]].concat()
}

fn put(folder: &TempDir, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(&path, bytes).unwrap();
    path
}

/// The error's text, the file's path shortened to its name.
fn text(error: &CaptureError, path: &Path) -> String {
    let name = path.file_name().unwrap().to_string_lossy();
    error.to_string().replace(&*path.to_string_lossy(), &name)
}

fn refusal(path: &Path) -> String {
    text(&decode(path, None).unwrap_err(), path)
}

#[test]
fn photos_are_listed_by_name_through_all_folders() {
    let folder = folder();
    for name in [
        "b.JPG",
        "a.jpeg",
        "deep/er/c.Png",
        "deep-1.png",
        "notes.txt",
        "._a.jpg",
        ".hidden/d.jpg",
        "jpg",
        // A scene of these photos.
        "scene/scene.json",
        "scene/images/e.png",
        "e.HEIC",
        "deep/f.tiff",
    ] {
        put(&folder, name, b"anything");
    }
    let set = PhotoSet::open(folder.path()).unwrap();
    let names: Vec<_> = set.photos.iter().map(|photo| &photo.name).collect();
    assert_eq!(names, ["a.jpeg", "b.JPG", "deep-1.png", "deep/er/c.Png"]);
    let found = set.find("deep/er/c.Png").unwrap();
    assert_eq!(found.path, folder.path().join("deep/er/c.Png"));
    assert!(set.find("c.Png").is_none());
    assert_eq!(set.root, folder.path());
    assert_eq!(unread_photos(folder.path()), ["deep/f.tiff", "e.HEIC"]);
}

#[cfg(unix)]
#[test]
fn links_are_followed_but_not_in_circles() {
    let folder = folder();
    put(&folder, "set/a.jpg", b"anything");
    put(&folder, "elsewhere/b.jpg", b"anything");
    let set = folder.path().join("set");
    std::os::unix::fs::symlink(&set, set.join("round")).unwrap();
    std::os::unix::fs::symlink(folder.path().join("elsewhere"), set.join("there")).unwrap();
    let set = PhotoSet::open(&set).unwrap();
    let names: Vec<_> = set.photos.iter().map(|photo| &photo.name).collect();
    assert_eq!(names, ["a.jpg", "there/b.jpg"]);
}

/// As one that is a pipe, which nobody may ever write to.
#[cfg(unix)]
#[test]
fn what_is_no_regular_file_is_not_opened() {
    let folder = folder();
    let path = folder.path().join("a.png");
    std::os::unix::fs::symlink("/dev/null", &path).unwrap();
    let expected = "a.png: cannot read the picture: it is no regular file; check that it is there and \
                    may be read";
    let kind = Beside::IgnoreMask;
    let errors = [
        photo_size(&path).unwrap_err(),
        decode(&path, None).unwrap_err(),
        read_exif(&path).unwrap_err(),
        check_beside(kind, &path, "a.jpg", (1, 1)).unwrap_err(),
        decode_mask(kind, &path, "a.jpg", (1, 1)).unwrap_err(),
    ];
    for error in errors {
        assert_eq!(text(&error, &path), expected);
    }
}

#[test]
fn a_folder_without_photos_says_what_is_read() {
    let folder = folder();
    put(&folder, "a.tif", b"anything");
    let error = PhotoSet::open(folder.path()).unwrap_err();
    let root = folder.path().display();
    assert_eq!(
        error.to_string(),
        format!(
            "{root}: no photos here or in the folders within; files ending in .jpg, .jpeg or \
             .png are read: give another folder, or convert the photos"
        )
    );
    let error = PhotoSet::open(&folder.path().join("absent")).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with(&format!("{root}/absent: cannot list the folder: ")),
        "{error}"
    );
}

#[test]
fn the_photos_of_a_capture_are_in_images_or_beside() {
    let folder = folder();
    assert_eq!(find_photos_folder(folder.path()), None);
    put(&folder, "sub/a.jpg", b"anything");
    assert_eq!(find_photos_folder(folder.path()), None);
    put(&folder, "a.jpg", b"anything");
    assert_eq!(
        find_photos_folder(folder.path()).as_deref(),
        Some(folder.path())
    );
    put(&folder, "images/a.jpg", b"anything");
    assert_eq!(
        find_photos_folder(folder.path()),
        Some(folder.path().join("images"))
    );
}

#[test]
fn photos_may_lie_in_folders_within_a_capture_alone() {
    let folder = folder();
    let within = || find_photos_within(folder.path(), &["masks", "depth"]);
    for name in [
        "masks/a.jpg",
        "depth/cam0/a.png",
        ".thumbnails/a.jpg",
        "other-capture/images/a.jpg",
        "cam0/notes.txt",
    ] {
        put(&folder, name, b"anything");
        assert_eq!(within(), None, "{name}");
    }
    put(&folder, "cam0/day 1/a.jpg", b"anything");
    assert_eq!(within().as_deref(), Some(folder.path()));
    assert_eq!(find_photos_folder(folder.path()), None);
    put(&folder, "images/a.jpg", b"anything");
    assert_eq!(within(), Some(folder.path().join("images")));
}

#[cfg(unix)]
#[test]
fn links_lead_in_no_circle_where_photos_are_looked_for() {
    let folder = folder();
    put(&folder, "cam0/notes.txt", b"anything");
    let link = folder.path().join("cam0/round");
    std::os::unix::fs::symlink(folder.path().join("cam0"), link).unwrap();
    assert_eq!(find_photos_within(folder.path(), &[]), None);
}

#[test]
fn what_is_written_decodes_to_the_same_pixels_and_bytes() {
    let folder = folder();
    let mut image = picture(31, 17);
    image.put_pixel(3, 4, Rgba([200, 100, 50, 0]));
    image.put_pixel(4, 4, Rgba([200, 100, 50, 1]));
    let path = folder.path().join("new/deep/a.png");
    write_png(&path, &image).unwrap();
    assert_eq!(decode(&path, Some((31, 17))).unwrap(), image);
    assert_eq!(photo_size(&path).unwrap(), (31, 17));

    let again = folder.path().join("new/deep/b.png");
    write_png(&again, &image).unwrap();
    assert_eq!(fs::read(&path).unwrap(), fs::read(&again).unwrap());
    let left = fs::read_dir(path.parent().unwrap()).unwrap().count();
    assert_eq!(left, 2, "no temporary file stays");
}

#[test]
fn a_picture_that_cannot_be_written_leaves_nothing() {
    let folder = folder();
    let path = folder.path().join("a.png");
    fs::create_dir(&path).unwrap();
    let error = write_png(&path, &picture(2, 2)).unwrap_err();
    assert!(
        text(&error, &path).starts_with("a.png: cannot write the picture: "),
        "{error}"
    );
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_jpeg_has_its_size_before_any_of_its_pixels() {
    let folder = folder();
    let bytes = jpeg_bytes(40, 24);
    // More segments than the part that is read first.
    let mut long = bytes.clone();
    for _ in 0..3 {
        long = with_segment(&long, 0xED, &[0; 60_000]);
    }
    let path = put(&folder, "a.jpg", &long);
    assert_eq!(photo_size(&path).unwrap(), (40, 24));
    let head = put(&folder, "head.jpg", &bytes[..bytes.len() / 2]);
    assert_eq!(photo_size(&head).unwrap(), (40, 24));
    let path = put(&folder, "short.jpg", &bytes[..20]);
    assert_eq!(
        text(&photo_size(&path).unwrap_err(), &path),
        "cannot decode short.jpg: the JPEG data do not state a size; the file may be truncated: \
         copy it again or leave it out"
    );
    let decoded = decode(&put(&folder, "b.jpg", &bytes), Some((40, 24))).unwrap();
    for (a, b) in decoded.pixels().zip(picture(40, 24).pixels()) {
        assert_eq!(a[3], 255);
        for channel in 0..3 {
            assert!(a[channel].abs_diff(b[channel]) < 40);
        }
    }
}

#[test]
fn the_extension_may_be_wrong() {
    let folder = folder();
    let path = folder.path().join("a.png");
    write_png(&path, &picture(5, 4)).unwrap();
    let path = put(&folder, "a.jpg", &fs::read(path).unwrap());
    assert_eq!(photo_size(&path).unwrap(), (5, 4));
    assert_eq!(decode(&path, None).unwrap(), picture(5, 4));
}

#[test]
fn every_truncation_of_a_jpeg_is_an_error() {
    let folder = folder();
    let bytes = jpeg_bytes(40, 24);
    // A preview in the EXIF segment has an end of its own.
    let bytes = with_segment(&bytes, 0xE1, &jpeg_bytes(8, 8));
    let whole = put(&folder, "whole.jpg", &bytes);
    assert_eq!(decode(&whole, None).unwrap().dimensions(), (40, 24));
    for length in 0..bytes.len() {
        let path = put(&folder, "cut.jpg", &bytes[..length]);
        assert!(decode(&path, None).is_err(), "cut to {length}");
    }
    // A copy that was interrupted may have its size but only zeros at its end.
    let mut zeros = bytes.clone();
    let from = bytes.len() - 100;
    zeros[from..].fill(0);
    assert_eq!(
        refusal(&put(&folder, "zeros.jpg", &zeros)),
        "cannot decode zeros.jpg: the JPEG data have no end; the file may be truncated: copy it \
         again or leave it out"
    );
    // Cameras append further pictures.
    let appended = [&bytes[..], b"more", &[0; 1000], &[0xFF]].concat();
    let path = put(&folder, "appended.jpg", &appended);
    assert_eq!(decode(&path, None).unwrap(), decode(&whole, None).unwrap());
}

/// They are whole, and the decoder would fail of them or make stripes of them.
#[test]
fn a_jpeg_of_a_rare_kind_is_said_to_be_one() {
    let folder = folder();
    let bytes = jpeg_bytes(40, 24);
    let find = |marker: u8| {
        bytes
            .windows(2)
            .position(|it| it == [0xFF, marker])
            .unwrap()
    };
    let (frame, scan) = (find(0xC0), find(0xDA));
    // Behind the marker: two bytes of length, one of bits, four of size, one of how many components there are, and of
    // each its number, its sampling and its table.
    let (bits, sampling) = (frame + 4, frame + 11);
    assert_eq!(
        [bytes[bits], bytes[sampling], bytes[scan + 4]],
        [8, 0x11, 3]
    );
    let refused = |name: &str, changes: &[(usize, u8)], kind: &str| {
        let mut changed = bytes.clone();
        for &(at, value) in changes {
            changed[at] = value;
        }
        let expected = format!(
            "{name}: found a JPEG of {kind}, which is not read; save it as an ordinary JPEG or as a \
             PNG, or leave it out"
        );
        assert_eq!(refusal(&put(&folder, name, &changed)), expected);
    };
    let kind = frame + 1;
    refused("a.jpg", &[(kind, 0xC3)], "lossless coding");
    refused("b.jpg", &[(kind, 0xC5)], "hierarchical coding");
    refused("c.jpg", &[(kind, 0xC9)], "arithmetic coding");
    refused("d.jpg", &[(bits, 12)], "more than 8 bits a value");
    refused("e.jpg", &[(sampling, 0x31)], "samples in threes");
    for (luma, chroma) in [(0x11, 0x21), (0x12, 0x21), (0x21, 0x12)] {
        let changes = [(sampling, luma), (sampling + 3, chroma)];
        refused("f.jpg", &changes, "chroma finer than luma");
    }
    for luma in [0x12, 0x22, 0x14] {
        let changes = [(sampling, luma), (scan + 4, 1)];
        refused("g.jpg", &changes, "each colour in a scan of its own");
    }
}

/// What a card or a disk lost of a photo reads as zeros. The decoder makes something of it.
#[test]
fn a_jpeg_that_is_damaged_in_the_middle_is_an_error() {
    let folder = folder();
    let bytes = jpeg_bytes(400, 300);
    let whole = put(&folder, "whole.jpg", &bytes);
    assert_eq!(decode(&whole, None).unwrap().dimensions(), (400, 300));
    let (half, last) = (bytes.len() / 2, bytes.len() - 2);
    let mut lost = bytes.clone();
    lost[half..half + 4096].fill(0);
    let error = refusal(&put(&folder, "lost.jpg", &lost));
    let problem = error.strip_prefix("cannot decode lost.jpg: the JPEG data are damaged, ");
    let remedy = "; the file may be truncated: copy it again or leave it out";
    assert!(problem.is_some_and(|p| p.ends_with(remedy)), "{error}");
    // Cut short, and given an end.
    let ended = [&bytes[..half], &bytes[last..]].concat();
    let error = refusal(&put(&folder, "ended.jpg", &ended));
    let share = error
        .strip_prefix("cannot decode ended.jpg: the JPEG data are damaged, at most the first ")
        .and_then(|rest| rest.split_once(" % of the picture are whole; "));
    let percent: u32 = share.expect(&error).0.parse().unwrap();
    assert!((20..80).contains(&percent), "{error}");
}

#[test]
fn a_truncated_png_is_an_error_unless_its_pixels_are_complete() {
    let folder = folder();
    let whole = folder.path().join("whole.png");
    write_png(&whole, &picture(40, 24)).unwrap();
    let bytes = fs::read(&whole).unwrap();
    for length in 0..bytes.len() {
        let path = put(&folder, "cut.png", &bytes[..length]);
        match decode(&path, None) {
            Ok(image) => assert_eq!(image, picture(40, 24), "cut to {length}"),
            Err(_) => assert!(length < bytes.len()),
        }
    }
    let path = put(&folder, "cut.png", &bytes[..bytes.len() / 2]);
    let error = refusal(&path);
    assert!(
        error.starts_with("cannot decode cut.png: ")
            && error.ends_with("; the file may be truncated: copy it again or leave it out"),
        "{error}"
    );
}

#[test]
fn exif_orientation_is_not_applied() {
    let folder = folder();
    // TIFF, little endian, one entry: orientation (0x0112), short, one, 6 (turn right).
    let exif = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
    let turned = with_segment(&jpeg_bytes(40, 24), 0xE1, exif);
    let turned = put(&folder, "turned.jpg", &turned);
    let plain = put(&folder, "plain.jpg", &jpeg_bytes(40, 24));
    assert_eq!(photo_size(&turned).unwrap(), (40, 24));
    let orientations = [&turned, &plain].map(|photo| read_exif(photo).unwrap().orientation);
    assert_eq!(orientations, [Some(6), None]);
    assert_eq!(
        decode(&turned, None).unwrap(),
        decode(&plain, None).unwrap()
    );
    assert_eq!(
        text(&decode(&turned, Some((24, 40))).unwrap_err(), &turned),
        "turned.jpg: the photo has 40 × 24 pixels, expected 24 × 40 as calibrated; width and \
         height are exchanged: EXIF orientation is not applied here, but a program may have \
         turned the photos by it before or after they were calibrated; use the photos that were \
         calibrated"
    );
    assert_eq!(
        text(&decode(&turned, Some((80, 48))).unwrap_err(), &turned),
        "turned.jpg: the photo has 40 × 24 pixels, expected 80 × 48 as calibrated; use the \
         photos that were calibrated, or calibrate these"
    );
}

#[test]
fn other_kinds_of_pixel_become_rgba() {
    let folder = folder();
    let save = |name: &str, image: DynamicImage| {
        let path = folder.path().join(name);
        image.save_with_format(&path, ImageFormat::Png).unwrap();
        decode(&path, None).unwrap()
    };
    let gray = GrayImage::from_pixel(2, 1, Luma([77]));
    assert_eq!(
        save("gray.png", gray.into()).get_pixel(1, 0).0,
        [77, 77, 77, 255]
    );
    let deep = ImageBuffer::from_pixel(2, 1, Rgba([0_u16, 0x8080, 0xFFFF, 0x4040]));
    assert_eq!(
        save("deep.png", DynamicImage::ImageRgba16(deep))
            .get_pixel(1, 0)
            .0,
        [0, 0x80, 0xFF, 0x40]
    );
    let mut bytes = Vec::new();
    JpegEncoder::new(&mut bytes)
        .encode_image(&GrayImage::from_pixel(16, 16, Luma([90])))
        .unwrap();
    let path = put(&folder, "gray.jpg", &bytes);
    assert_eq!(
        decode(&path, None).unwrap().get_pixel(3, 3).0,
        [90, 90, 90, 255]
    );
    // A palette of two colours, one of them transparent.
    let path = put(&folder, "palette.png", &palette_png());
    let palette = decode(&path, None).unwrap();
    assert_eq!(palette.get_pixel(0, 0).0, [255, 0, 0, 255]);
    assert_eq!(palette.get_pixel(1, 0).0, [0, 0, 255, 64]);
}

/// A PNG of two pixels made by hand: colours 0 and 1 of a palette, stored uncompressed.
fn palette_png() -> Vec<u8> {
    let crc = |bytes: &[u8]| {
        !bytes.iter().fold(!0_u32, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| {
                (crc >> 1) ^ (0xEDB8_8320 * (crc & 1))
            })
        })
    };
    let chunk = |name: &[u8], data: &[u8]| {
        let body = [name, data].concat();
        let length = (data.len() as u32).to_be_bytes();
        [&length[..], &body, &crc(&body).to_be_bytes()].concat()
    };
    // Filter 0, then the pixels 0 and 1; Adler-32 of 00 00 01.
    let data = [0x78, 1, 1, 3, 0, 0xFC, 0xFF, 0, 0, 1, 0, 4, 0, 2];
    [
        b"\x89PNG\r\n\x1a\n".to_vec(),
        chunk(b"IHDR", &[0, 0, 0, 2, 0, 0, 0, 1, 8, 3, 0, 0, 0]),
        chunk(b"PLTE", &[255, 0, 0, 0, 0, 255]),
        chunk(b"tRNS", &[255, 64]),
        chunk(b"IDAT", &data),
        chunk(b"IEND", &[]),
    ]
    .concat()
}

#[test]
fn what_is_no_photo_is_said_to_be_none() {
    let folder = folder();
    assert_eq!(
        refusal(&put(&folder, "a.jpg", b"GIF89a and more")),
        "a.jpg: found a file that seems to be Gif, expected a JPEG or PNG picture; convert it, \
         or leave it out"
    );
    assert_eq!(
        refusal(&put(&folder, "a.png", b"<html>not found</html>")),
        "a.png: found no picture format known here, expected a JPEG or PNG picture; convert it, \
         or leave it out"
    );
    assert_eq!(
        refusal(&put(&folder, "b.jpg", b"")),
        "cannot decode b.jpg: the file is empty (0 bytes); the file may be truncated: copy it \
         again or leave it out"
    );
    let absent = folder.path().join("absent.jpg");
    assert!(refusal(&absent).starts_with("absent.jpg: cannot read the picture: "));
    assert!(matches!(
        photo_size(&absent),
        Err(CaptureError::Read { .. })
    ));
}

#[test]
fn a_picture_larger_than_memory_is_refused_before_it_is_decoded() {
    let folder = folder();
    let mut bytes = jpeg_bytes(16, 16);
    let frame = bytes.windows(2).position(|w| w == [0xFF, 0xC0]).unwrap();
    bytes[frame + 5..frame + 9].fill(0xFF);
    assert_eq!(
        refusal(&put(&folder, "bomb.jpg", &bytes)),
        "bomb.jpg: decoding 65535 × 65535 pixels takes more memory than the 512 MiB allowed for \
         one photo; reduce it, or leave it out"
    );
}

#[test]
fn photos_are_reduced_as_they_are_decoded() {
    let folder = folder();
    let path = folder.path().join("a.png");
    write_png(&path, &picture(60, 40)).unwrap();
    let small = decode_reduced(&path, Some((60, 40)), 30).unwrap();
    assert_eq!(small, resize(&picture(60, 40), 30, 20));
    assert_eq!(decode_reduced(&path, None, 60).unwrap(), picture(60, 40));
    assert!(decode_reduced(&path, Some((30, 20)), 30).is_err());
}

#[test]
fn real_photos_decode() {
    let captures = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../shared/captures"
    ));
    if !captures.is_dir() {
        eprintln!("SKIPPED: {} is absent", captures.display());
        return;
    }
    for entry in fs::read_dir(captures).unwrap() {
        let Some(photos) = find_photos_folder(&entry.unwrap().path()) else {
            continue;
        };
        let set = PhotoSet::open(&photos).unwrap();
        // Every size from its head; a few photos in full.
        for (index, photo) in set.photos.iter().enumerate() {
            let size = photo_size(&photo.path).unwrap();
            if index % 10 == 0 {
                decode(&photo.path, Some(size)).unwrap();
            }
        }
    }
}
