//! The time that a camera wrote into a photo.

use super::name::seconds_since_1970;
use exif::{In, Reader, Tag, Value};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// When a photo was taken by its camera's clock, in seconds since 1970: EXIF's
/// DateTimeOriginal and SubSecTimeOriginal. `None` where the file does not say, or cannot
/// be read.
pub fn exif_time_s(photo: &Path) -> Option<f64> {
    let mut file = BufReader::new(File::open(photo).ok()?);
    let tags = Reader::new().read_from_container(&mut file).ok()?;
    let text = |tag: Tag| match &tags.get_field(tag, In::PRIMARY)?.value {
        Value::Ascii(parts) => Some(String::from_utf8_lossy(parts.first()?).into_owned()),
        _ => None,
    };
    // "2024:01:31 15:45:02"; a clock that was never set says "0000:00:00 00:00:00".
    let taken = text(Tag::DateTimeOriginal)?;
    let numbers: Vec<u32> = taken
        .split([':', ' '])
        .map(|part| part.parse().ok())
        .collect::<Option<_>>()?;
    let [year, month, day, hour, minute, second] = numbers[..] else {
        return None;
    };
    let whole = seconds_since_1970(year, [month, day, hour, minute, second])?;
    // Digits behind the point; some cameras pad them with blanks.
    let digits = text(Tag::SubSecTimeOriginal).unwrap_or_default();
    let digits = digits.trim();
    let is_fraction = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
    let fraction = is_fraction.then(|| format!("0.{digits}").parse::<f64>().ok());
    Some(whole + fraction.flatten().unwrap_or(0.0))
}
