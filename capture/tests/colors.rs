//! Photos whose numbers mean other colours than sRGB's.

use capture::{Beside, decode, decode_mask};
use image::codecs::{jpeg::JpegEncoder, png::PngEncoder};
use image::{DynamicImage, ImageEncoder, Rgb, RgbImage, Rgba, RgbaImage};
use moxcms::ColorProfile;
use std::fs;
use std::path::{Path, PathBuf};

/// Linear sRGB from linear Display P3, and from linear Adobe RGB; both are of D65, as sRGB is.
const FROM_P3: [[f64; 3]; 3] = [
    [1.22494, -0.22494, 0.0],
    [-0.04206, 1.04206, 0.0],
    [-0.01964, -0.07864, 1.09827],
];
const FROM_ADOBE: [[f64; 3]; 3] = [
    [1.39836, -0.39836, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, -0.04293, 1.04293],
];

fn srgb_to_linear(value: u8) -> f64 {
    let value = f64::from(value) / 255.0;
    match value {
        ..=0.04045 => value / 12.92,
        _ => ((value + 0.055) / 1.055).powf(2.4),
    }
}

fn srgb_from_linear(value: f64) -> f64 {
    let value = value.clamp(0.0, 1.0);
    let code = match value {
        ..=0.0031308 => 12.92 * value,
        _ => 1.055 * value.powf(1.0 / 2.4) - 0.055,
    };
    255.0 * code
}

fn adobe_to_linear(value: u8) -> f64 {
    (f64::from(value) / 255.0).powf(563.0 / 256.0)
}

/// What a pixel shows, in sRGB's numbers.
fn shown(stored: [u8; 3], to_linear: fn(u8) -> f64, matrix: [[f64; 3]; 3]) -> [f64; 3] {
    let linear = stored.map(to_linear);
    let dot = |row: [f64; 3]| row.iter().zip(linear).map(|(a, b)| a * b).sum();
    matrix.map(|row| srgb_from_linear(dot(row)))
}

/// Colours of all hues, dark and bright, dull and vivid, with alpha of their own.
fn picture() -> RgbaImage {
    RgbaImage::from_fn(64, 64, |x, y| {
        let [x, y] = [x, y].map(|value| value as u8);
        Rgba([
            4 * (x % 8) + 32 * (y % 8),
            4 * x + 3,
            4 * y,
            255 - x.min(y) / 4,
        ])
    })
}

fn at(folder: &tempfile::TempDir, name: &str) -> PathBuf {
    folder.path().join(name)
}

fn png(path: &Path, profile: &ColorProfile) {
    let mut bytes = Vec::new();
    let mut encoder = PngEncoder::new(&mut bytes);
    encoder.set_icc_profile(profile.encode().unwrap()).unwrap();
    DynamicImage::ImageRgba8(picture())
        .write_with_encoder(encoder)
        .unwrap();
    fs::write(path, bytes).unwrap();
}

fn jpeg(path: &Path, picture: &RgbImage, icc: Option<Vec<u8>>) {
    let mut bytes = Vec::new();
    let mut encoder = JpegEncoder::new_with_quality(&mut bytes, 100);
    if let Some(icc) = icc {
        encoder.set_icc_profile(icc).unwrap();
    }
    encoder.encode_image(picture).unwrap();
    fs::write(path, bytes).unwrap();
}

/// Checks that each pixel of `decoded` is what `expected` says of that of `stored`, to so many steps.
fn check(
    decoded: &RgbaImage,
    stored: &RgbaImage,
    expected: impl Fn([u8; 3]) -> [f64; 3],
    steps: f64,
) {
    let mut most = 0.0f64;
    for (found, stored) in decoded.pixels().zip(stored.pixels()) {
        let [r, g, b, alpha] = stored.0;
        assert_eq!(found[3], alpha);
        let expected = expected([r, g, b]);
        for channel in 0..3 {
            let error = (f64::from(found[channel]) - expected[channel]).abs();
            assert!(error <= steps, "{stored:?}: {found:?}, not {expected:?}");
            let change = found[channel].abs_diff(stored[channel]);
            most = most.max(f64::from(change));
        }
    }
    assert!(most > 20.0, "hardly any colour was converted");
}

#[test]
fn colours_of_another_profile_become_srgb() {
    let folder = tempfile::tempdir().unwrap();
    let path = at(&folder, "a.png");
    let of_p3 = |stored| shown(stored, srgb_to_linear, FROM_P3);
    png(&path, &ColorProfile::new_display_p3());
    check(&decode(&path, None).unwrap(), &picture(), of_p3, 2.0);
    png(&path, &ColorProfile::new_adobe_rgb());
    let of_adobe = |stored| shown(stored, adobe_to_linear, FROM_ADOBE);
    check(&decode(&path, None).unwrap(), &picture(), of_adobe, 2.0);

    // The same of a JPEG, beside what it stores.
    let rgb = DynamicImage::ImageRgba8(picture()).into_rgb8();
    let path = at(&folder, "a.jpg");
    jpeg(&path, &rgb, None);
    let stored = decode(&path, None).unwrap();
    jpeg(
        &path,
        &rgb,
        Some(ColorProfile::new_display_p3().encode().unwrap()),
    );
    check(&decode(&path, None).unwrap(), &stored, of_p3, 2.0);
}

/// A camera that is set to Adobe RGB embeds no profile: its EXIF data tell.
#[test]
fn adobe_rgb_by_a_camera_s_word_becomes_srgb() {
    // TIFF, little endian. At 8, a pointer to the EXIF tags at 26: the colour space (none of EXIF's own) and a pointer
    // to the index, at 56.
    let entry = |tag: u16, kind: u16, count: u32, value: [u8; 4]| {
        let head = [tag.to_le_bytes(), kind.to_le_bytes()].concat();
        [&head[..], &count.to_le_bytes(), &value].concat()
    };
    let exif = |index: &[u8; 4]| {
        [
            &b"Exif\0\0II*\0\x08\0\0\0\x01\0"[..],
            &entry(0x8769, 4, 1, [26, 0, 0, 0]),
            &[0; 4],
            b"\x02\0",
            &entry(0xA001, 3, 1, [0xFF, 0xFF, 0, 0]),
            &entry(0xA005, 4, 1, [56, 0, 0, 0]),
            &[0; 4],
            b"\x01\0",
            &entry(1, 2, 4, *index),
            &[0; 4],
        ]
        .concat()
    };
    let folder = tempfile::tempdir().unwrap();
    let path = at(&folder, "a.jpg");
    let rgb = DynamicImage::ImageRgba8(picture()).into_rgb8();
    jpeg(&path, &rgb, None);
    let stored = decode(&path, None).unwrap();
    let plain = fs::read(&path).unwrap();
    let with_exif = |index| {
        let data: Vec<u8> = exif(index);
        let length = (data.len() as u16 + 2).to_be_bytes();
        [&plain[..2], b"\xFF\xE1", &length, &data, &plain[2..]].concat()
    };
    fs::write(&path, with_exif(b"R03\0")).unwrap();
    let of_adobe = |stored| shown(stored, adobe_to_linear, FROM_ADOBE);
    check(&decode(&path, None).unwrap(), &stored, of_adobe, 2.0);
    fs::write(&path, with_exif(b"R98\0")).unwrap();
    assert_eq!(decode(&path, None).unwrap(), stored);
}

#[test]
fn what_means_srgb_or_nothing_stays_as_it_is_stored() {
    let folder = tempfile::tempdir().unwrap();
    let path = at(&folder, "a.png");
    png(&path, &ColorProfile::new_srgb());
    assert_eq!(decode(&path, None).unwrap(), picture());
    let rgb = DynamicImage::ImageRgba8(picture()).into_rgb8();
    let path = at(&folder, "a.jpg");
    jpeg(&path, &rgb, None);
    let stored = decode(&path, None).unwrap();
    let p3 = ColorProfile::new_display_p3().encode().unwrap();
    let gray = ColorProfile::new_gray_with_gamma(1.8).encode().unwrap();
    for icc in [p3[..200].to_vec(), b"no profile".to_vec(), gray] {
        jpeg(&path, &rgb, Some(icc));
        assert_eq!(decode(&path, None).unwrap(), stored);
    }
}

/// It holds no colours.
#[test]
fn masks_are_read_as_they_are_stored() {
    let folder = tempfile::tempdir().unwrap();
    let path = at(&folder, "a.png");
    let mut bytes = Vec::new();
    let mut encoder = PngEncoder::new(&mut bytes);
    let profile = ColorProfile::new_adobe_rgb().encode().unwrap();
    encoder.set_icc_profile(profile).unwrap();
    let mask = RgbImage::from_fn(16, 16, |x, _| Rgb([(x * 17) as u8; 3]));
    DynamicImage::ImageRgb8(mask.clone())
        .write_with_encoder(encoder)
        .unwrap();
    fs::write(&path, &bytes).unwrap();
    let kind = Beside::ObjectMatte;
    let found = decode_mask(kind, &path, "a.jpg", (16, 16)).unwrap();
    let values = found.pixels().map(|pixel| pixel.0[0]);
    assert!(values.eq(mask.pixels().map(|pixel| pixel.0[0])));
}
