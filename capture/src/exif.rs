//! What a camera writes beside the picture.

use crate::times::seconds_since_1970;
use crate::{CaptureError, decode};
use exif::{In, Reader, Tag, Value};
use std::io::Cursor;
use std::path::Path;

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

/// Reads a photo's EXIF data. A photo without has none of them.
///
/// # Errors
/// The file cannot be read.
pub fn read_exif(path: &Path) -> Result<Exif, CaptureError> {
    let head = decode::head(path)?;
    let Ok(tags) = Reader::new().read_from_container(&mut Cursor::new(head)) else {
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
