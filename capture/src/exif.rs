//! What a camera writes beside the picture.

use crate::times::seconds_since_1970;
use crate::{CaptureError, decode, jpeg};
use exif::{In, Reader, Tag, Value};
use image::ImageFormat;
use std::io::{self, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

/// Length of a PNG's signature, before its first chunk.
const PNG_SIGNATURE_BYTES: u64 = 8;
/// How much of a PNG is read at once: little, as only the beginnings of its chunks are looked at.
const PNG_BUFFER_BYTES: usize = 1 << 10;

/// What is known of how a photo was taken; what is not there, or not readable, is `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exif {
    /// The lens's focal length.
    pub focal_length_mm: Option<f64>,
    /// When the photo was taken, in seconds since the year 1970 by the camera's clock,
    /// which knows no time zone: DateTimeOriginal and SubSecTimeOriginal.
    pub taken_s: Option<f64>,
    /// How what is stored is to be shown, 1 to 8: 1 as it is, 3 turned by a half, 6 by a quarter clockwise, 8 by one
    /// counter-clockwise; 2, 4, 5 and 7 are mirrored. It is not applied.
    pub orientation: Option<u8>,
}

/// Reads a photo's EXIF data, wherever in the file they lie. A photo without has none of them.
///
/// # Errors
/// The file cannot be read.
pub fn read_exif(path: &Path) -> Result<Exif, CaptureError> {
    let failed = decode::read_failed(path);
    let mut file = decode::open(path).map_err(&failed)?;
    let data = exif_data(&mut file).map_err(&failed)?;
    let Ok(tags) = Reader::new().read_raw(data) else {
        return Ok(Exif::default());
    };
    let value = |tag: Tag| tags.get_field(tag, In::PRIMARY).map(|field| &field.value);
    let text = |tag: Tag| match value(tag)? {
        Value::Ascii(parts) => Some(String::from_utf8_lossy(parts.first()?).into_owned()),
        _ => None,
    };
    let focal_length_mm = match value(Tag::FocalLength) {
        Some(Value::Rational(mm)) => mm.first().map(exif::Rational::to_f64),
        _ => None,
    };
    let whole = text(Tag::DateTimeOriginal).and_then(|text| seconds(&text));
    let digits = text(Tag::SubSecTimeOriginal).unwrap_or_default();
    Ok(Exif {
        focal_length_mm: focal_length_mm.filter(|mm| mm.is_finite() && *mm > 0.0),
        taken_s: whole.map(|whole| whole + fraction(digits.trim())),
        orientation: value(Tag::Orientation)
            .and_then(|value| u8::try_from(value.get_uint(0)?).ok())
            .filter(|orientation| (1..=8).contains(orientation)),
    })
}

/// A picture's EXIF data as they are stored, empty where it has none. Profiles, previews and, in a PNG, all of the picture
/// may come before them.
fn exif_data(file: &mut (impl Read + Seek)) -> io::Result<Vec<u8>> {
    let start = decode::start(file)?;
    match image::guess_format(&start) {
        Ok(ImageFormat::Jpeg) => {
            let find = |head: &[u8]| jpeg::exif(head).map(<[u8]>::to_vec);
            Ok(decode::find_in_head(file, find)?.unwrap_or_default())
        }
        Ok(ImageFormat::Png) => exif_chunk(BufReader::with_capacity(PNG_BUFFER_BYTES, file)),
        _ => Ok(Vec::new()),
    }
}

/// What a PNG's eXIf chunk holds; nothing where the file ends, or is cut off, before one.
fn exif_chunk(mut file: impl Read + Seek) -> io::Result<Vec<u8>> {
    file.seek(SeekFrom::Start(PNG_SIGNATURE_BYTES))?;
    loop {
        let mut beginning = [0; 8];
        match file.read_exact(&mut beginning) {
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(Vec::new()),
            read => read?,
        }
        let [l3, l2, l1, l0, kind @ ..] = beginning;
        let length = u32::from_be_bytes([l3, l2, l1, l0]);
        match &kind {
            b"eXIf" => {
                let mut data = Vec::new();
                file.take(length.into()).read_to_end(&mut data)?;
                return Ok(data);
            }
            b"IEND" => return Ok(Vec::new()),
            // A checksum follows what a chunk holds.
            _ => file.seek_relative(i64::from(length) + 4)?,
        }
    }
}

/// By how many quarters, clockwise, what is stored is turned to be shown as an orientation says; mirrored or not.
///
/// ```
/// # use capture::quarters_of;
/// assert_eq!([1, 6, 3, 8].map(quarters_of), [0, 1, 2, 3]);
/// // Mirrored across before: what is left above is where it is right above in those.
/// assert_eq!([2, 5, 4, 7].map(quarters_of), [0, 1, 2, 3]);
/// ```
pub fn quarters_of(orientation: u8) -> u8 {
    match orientation {
        5 | 6 => 1,
        3 | 4 => 2,
        7 | 8 => 3,
        _ => 0,
    }
}

/// `2012:07:01 12:34:56`; a clock that was never set says `0000:00:00 00:00:00`.
fn seconds(text: &str) -> Option<f64> {
    let numbers: Vec<u32> = text
        .split([':', ' '])
        .map(|part| part.parse().ok())
        .collect::<Option<_>>()?;
    let [year, month, day, hour, minute, second] = numbers[..] else {
        return None;
    };
    seconds_since_1970(year, [month, day, hour, minute, second])
}

/// Digits behind the point; some cameras pad them with blanks.
fn fraction(digits: &str) -> f64 {
    let is_number = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
    let fraction = is_number.then(|| format!("0.{digits}").parse().ok());
    fraction.flatten().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// TIFF, little endian, one entry: orientation (0x0112), short, 6.
    const QUARTER: &[u8] = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";

    fn orientation(bytes: &[u8]) -> Option<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo");
        std::fs::write(&path, bytes).unwrap();
        read_exif(&path).unwrap().orientation
    }

    fn chunk(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
        let length = (content.len() as u32).to_be_bytes();
        // Nobody looks at the checksum.
        [&length[..], &kind[..], content, &[0; 4][..]].concat()
    }

    fn segment(marker: u8, content: &[u8]) -> Vec<u8> {
        let length = (content.len() as u16 + 2).to_be_bytes();
        [&[0xFF, marker][..], &length[..], content].concat()
    }

    #[test]
    fn what_comes_after_a_png_s_pixels_is_read() {
        let [header, pixels] = [chunk(b"IHDR", &[0; 13]), chunk(b"IDAT", &[0; 200_000])];
        let [exif, end] = [chunk(b"eXIf", QUARTER), chunk(b"IEND", &[])];
        let png = |chunks: &[&[u8]]| [&b"\x89PNG\r\n\x1a\n"[..], &chunks.concat()[..]].concat();
        let whole = png(&[&header, &pixels, &exif, &end]);
        assert_eq!(orientation(&whole), Some(6));
        assert_eq!(orientation(&png(&[&header, &exif, &pixels, &end])), Some(6));
        // None, and cut off on the way.
        assert_eq!(orientation(&png(&[&header, &pixels, &end, &exif])), None);
        assert_eq!(orientation(&whole[..100_000]), None);
    }

    #[test]
    fn what_comes_after_a_jpeg_s_profile_is_read() {
        let profile = segment(0xE2, &[&b"ICC_PROFILE\0"[..], &[0; 60_000][..]].concat());
        let exif = segment(0xE1, &[&b"Exif\0\0"[..], QUARTER].concat());
        let scan = segment(0xDA, &[0; 10]);
        for profiles in 0..5 {
            let before = profile.repeat(profiles);
            let jpeg =
                |rest: &[&[u8]]| [&b"\xFF\xD8"[..], &before[..], &rest.concat()[..]].concat();
            let whole = jpeg(&[&exif, &scan, b"\xFF\xD9"]);
            assert_eq!(orientation(&whole), Some(6), "{profiles}");
            assert_eq!(orientation(&jpeg(&[&scan, &exif, b"\xFF\xD9"])), None);
            assert_eq!(orientation(&jpeg(&[])), None);
        }
    }

    #[test]
    fn times_are_counted_from_1970() {
        assert_eq!(seconds("1970:01:01 00:00:00"), Some(0.0));
        assert_eq!(seconds("2000:03:01 00:00:01"), Some(951_868_801.0));
        assert_eq!(seconds("0000:00:00 00:00:00"), None);
        assert_eq!(seconds("2012:07:01"), None);
        assert_eq!(fraction("25"), 0.25);
        assert_eq!(fraction(""), 0.0);
        assert_eq!(fraction("?"), 0.0);
    }
}
