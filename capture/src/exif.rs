//! What a camera writes beside the picture: EXIF 2.3 in a JPEG file's APP1 segment, a TIFF
//! directory (TIFF 6.0, section 2).

use crate::{CaptureError, decode, jpeg};
use std::path::Path;

const APP1: u8 = 0xE1;
const EXIF_DIRECTORY: u16 = 0x8769;
const DATE_TIME_ORIGINAL: u16 = 0x9003;
const FOCAL_LENGTH: u16 = 0x920A;
const SUB_SECONDS_ORIGINAL: u16 = 0x9291;
const ASCII: u16 = 2;
const RATIONAL: u16 = 5;

/// What is known of how a photo was taken; what is not there, or not readable, is `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exif {
    /// The lens's focal length.
    pub focal_length_mm: Option<f64>,
    /// When the photo was taken, in seconds since the year 1970 by the camera's clock,
    /// which knows no time zone.
    pub taken_s: Option<f64>,
}

/// Reads a photo's EXIF data. A photo without, a PNG for one, has none of them.
///
/// # Errors
/// The file cannot be read.
pub fn read_exif(path: &Path) -> Result<Exif, CaptureError> {
    let head = decode::head(path)?;
    let segment = jpeg::markers(&head).find_map(|(marker, segment)| {
        (marker == APP1)
            .then_some(segment)?
            .strip_prefix(b"Exif\0\0")
    });
    Ok(segment.and_then(read_tiff).unwrap_or_default())
}

fn read_tiff(bytes: &[u8]) -> Option<Exif> {
    let big_endian = match bytes.get(..4)? {
        b"MM\0*" => true,
        b"II*\0" => false,
        _ => return None,
    };
    let tiff = Tiff { bytes, big_endian };
    let main = tiff.u32(4)?;
    let exif = tiff.u32(tiff.entry(main, EXIF_DIRECTORY)? + 8)?;
    let seconds = tiff.text(exif, DATE_TIME_ORIGINAL).and_then(seconds);
    let fraction = tiff.text(exif, SUB_SECONDS_ORIGINAL);
    let fraction = fraction.and_then(|digits| format!("0.{}", digits.trim()).parse::<f64>().ok());
    Some(Exif {
        focal_length_mm: tiff.rational(exif, FOCAL_LENGTH).filter(|&mm| mm > 0.0),
        taken_s: seconds.map(|s| s + fraction.unwrap_or(0.0)),
    })
}

struct Tiff<'a> {
    bytes: &'a [u8],
    big_endian: bool,
}

impl<'a> Tiff<'a> {
    fn u16(&self, at: usize) -> Option<u16> {
        let bytes = *self.bytes.get(at..)?.first_chunk()?;
        Some(match self.big_endian {
            true => u16::from_be_bytes(bytes),
            false => u16::from_le_bytes(bytes),
        })
    }

    fn u32(&self, at: usize) -> Option<usize> {
        let bytes = *self.bytes.get(at..)?.first_chunk()?;
        let value = match self.big_endian {
            true => u32::from_be_bytes(bytes),
            false => u32::from_le_bytes(bytes),
        };
        usize::try_from(value).ok()
    }

    /// Where a tag's entry of twelve bytes lies: tag, type, count, value or its place.
    fn entry(&self, directory: usize, tag: u16) -> Option<usize> {
        let entries = usize::from(self.u16(directory)?);
        let mut places = (0..entries).map(|i| directory + 2 + 12 * i);
        places.find(|&at| self.u16(at) == Some(tag))
    }

    fn text(&self, directory: usize, tag: u16) -> Option<&'a str> {
        let entry = self.entry(directory, tag)?;
        if self.u16(entry + 2)? != ASCII {
            return None;
        }
        let length = self.u32(entry + 4)?;
        // Up to four bytes stand in the entry itself.
        let at = if length <= 4 {
            entry + 8
        } else {
            self.u32(entry + 8)?
        };
        let bytes = self.bytes.get(at..)?.get(..length)?;
        let text = std::str::from_utf8(bytes).ok()?;
        Some(text.trim_end_matches('\0'))
    }

    fn rational(&self, directory: usize, tag: u16) -> Option<f64> {
        let entry = self.entry(directory, tag)?;
        if self.u16(entry + 2)? != RATIONAL {
            return None;
        }
        let at = self.u32(entry + 8)?;
        let (above, below) = (self.u32(at)? as f64, self.u32(at + 4)? as f64);
        (below > 0.0).then_some(above / below)
    }
}

/// `2012:07:01 12:34:56`, in seconds since the year 1970.
fn seconds(text: &str) -> Option<f64> {
    let mut numbers = text.split([':', ' ']).map(|n| n.parse::<i64>().ok());
    let mut next = || numbers.next().flatten();
    let (year, month, day) = (next()?, next()?, next()?);
    let (hour, minute, second) = (next()?, next()?, next()?);
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) || !(1900..=9999).contains(&year) {
        return None;
    }
    // Days before the month, in a year that begins in March, so that the leap day is last.
    let (year, month) = if month > 2 {
        (year, month - 3)
    } else {
        (year - 1, month + 9)
    };
    let days = 365 * year + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + day;
    const UNTIL_1970: i64 = 719_469;
    Some((((days - UNTIL_1970) * 24 + hour) * 3600 + minute * 60 + second) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A directory with the time, its fraction and a focal length of 4.25 mm.
    fn tiff(big_endian: bool) -> Vec<u8> {
        let mut bytes = Vec::new();
        let n16 = |bytes: &mut Vec<u8>, n: u16| {
            bytes.extend(if big_endian {
                n.to_be_bytes()
            } else {
                n.to_le_bytes()
            });
        };
        let n32 = |bytes: &mut Vec<u8>, n: u32| {
            bytes.extend(if big_endian {
                n.to_be_bytes()
            } else {
                n.to_le_bytes()
            });
        };
        bytes.extend(if big_endian { b"MM\0*" } else { b"II*\0" });
        n32(&mut bytes, 8);
        // At 8: the main directory, one entry, none after it.
        n16(&mut bytes, 1);
        n16(&mut bytes, EXIF_DIRECTORY);
        n16(&mut bytes, 4);
        n32(&mut bytes, 1);
        n32(&mut bytes, 26);
        n32(&mut bytes, 0);
        // At 26: three entries, and at 68 what does not fit into them.
        n16(&mut bytes, 3);
        for (tag, kind, count, value) in [
            (DATE_TIME_ORIGINAL, ASCII, 20, 68),
            (FOCAL_LENGTH, RATIONAL, 1, 88),
        ] {
            n16(&mut bytes, tag);
            n16(&mut bytes, kind);
            n32(&mut bytes, count);
            n32(&mut bytes, value);
        }
        n16(&mut bytes, SUB_SECONDS_ORIGINAL);
        n16(&mut bytes, ASCII);
        n32(&mut bytes, 3);
        bytes.extend(b"25\0\0");
        n32(&mut bytes, 0);
        bytes.extend(b"2012:07:01 12:34:56\0");
        n32(&mut bytes, 425);
        n32(&mut bytes, 100);
        bytes
    }

    #[test]
    fn both_byte_orders_are_read() {
        for big_endian in [false, true] {
            let exif = read_tiff(&tiff(big_endian)).unwrap();
            assert_eq!(exif.focal_length_mm, Some(4.25));
            // date -u -d '2012-07-01 12:34:56' +%s
            assert_eq!(exif.taken_s, Some(1_341_146_096.25));
        }
    }

    #[test]
    fn what_is_cut_short_or_loops_is_nothing() {
        let whole = tiff(true);
        for length in 0..whole.len() {
            let _ = read_tiff(&whole[..length]);
        }
        let mut far = whole.clone();
        far[4..8].copy_from_slice(&[0xFF; 4]);
        assert_eq!(read_tiff(&far), None);
    }

    #[test]
    fn times_are_counted_from_1970() {
        assert_eq!(seconds("1970:01:01 00:00:00"), Some(0.0));
        assert_eq!(seconds("2000:03:01 00:00:01"), Some(951_868_801.0));
        assert_eq!(seconds("0000:00:00 00:00:00"), None);
        assert_eq!(seconds("2012:07:01"), None);
    }
}
