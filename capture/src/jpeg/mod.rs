//! The markers of a JPEG file and the codes between them: enough to know its size, its EXIF data,
//! whether it is complete, and whether it is damaged on the way.
//!
//! Decoders fill up what is missing at the end of a file with grey. A photo half grey is
//! worse than none, so we look for the end ourselves: walking from marker to marker, as
//! the embedded preview in an EXIF segment has an end of its own. They also make something
//! of whatever lies before the end: [`damage`] finds what was no picture's.

mod coding;
mod huffman;
mod scan;
#[cfg(test)]
mod tests;
mod unread;

pub(crate) use scan::damage;
pub(crate) use unread::unread;

const FRAMES: std::ops::RangeInclusive<u8> = 0xC0..=0xCF;
/// Huffman coded frames of one size: baseline, extended and progressive.
const BASELINE: u8 = 0xC0;
const EXTENDED: u8 = 0xC1;
const PROGRESSIVE: u8 = 0xC2;
const HUFFMAN_TABLE: u8 = 0xC4;
const EXTENSION: u8 = 0xC8;
const ARITHMETIC_TABLE: u8 = 0xCC;
const RESTARTS: std::ops::RangeInclusive<u8> = 0xD0..=0xD7;
const START_OF_IMAGE: u8 = 0xD8;
const END_OF_IMAGE: u8 = 0xD9;
const START_OF_SCAN: u8 = 0xDA;
const NUMBER_OF_LINES: u8 = 0xDC;
const RESTART_INTERVAL: u8 = 0xDD;
const APPLICATION_1: u8 = 0xE1;
const TEMPORARY: u8 = 0x01;

/// Whether the picture's end is there. What follows it does not matter: some cameras
/// append a second picture.
pub(crate) fn is_complete(bytes: &[u8]) -> bool {
    markers(bytes).any(|(marker, _)| marker == END_OF_IMAGE)
}

/// Width and height, if the part of the file in `bytes` states them.
pub(crate) fn size(bytes: &[u8]) -> Option<(u32, u32)> {
    let (_, frame) = markers(bytes).find(|&(marker, _)| is_frame(marker))?;
    // Bits per sample, height, width, components.
    let &[_, h1, h0, w1, w0] = frame.first_chunk()?;
    let (width, height) = (u16::from_be_bytes([w1, w0]), u16::from_be_bytes([h1, h0]));
    // A height of zero is stated later, by rare files.
    (width > 0 && height > 0).then_some((width.into(), height.into()))
}

/// What the EXIF segment holds behind its name, nothing where the picture begins without one; `None` if the part of the
/// file in `bytes` ends before that is known.
pub(crate) fn exif(bytes: &[u8]) -> Option<&[u8]> {
    markers(bytes).find_map(|(marker, segment)| match marker {
        APPLICATION_1 => segment.strip_prefix(b"Exif\0\0"),
        START_OF_SCAN | END_OF_IMAGE => Some(&segment[..0]),
        _ => None,
    })
}

/// Whether a marker begins a frame, of whatever coding.
fn is_frame(marker: u8) -> bool {
    FRAMES.contains(&marker) && ![HUFFMAN_TABLE, EXTENSION, ARITHMETIC_TABLE].contains(&marker)
}

/// The markers in their order, each with what its segment holds. Ends where the bytes do,
/// be it amid a segment.
fn markers(bytes: &[u8]) -> Markers<'_> {
    Markers { rest: bytes }
}

/// See [`markers`].
struct Markers<'a> {
    /// What comes after the marker and the segment that were told last.
    rest: &'a [u8],
}

impl<'a> Iterator for Markers<'a> {
    type Item = (u8, &'a [u8]);

    fn next(&mut self) -> Option<(u8, &'a [u8])> {
        loop {
            // Between segments lies compressed data, in which FF 00 means the byte FF and
            // restarts occur. FF may be repeated before a marker.
            let start = self.rest.iter().position(|&byte| byte == 0xFF)?;
            self.rest = &self.rest[start + 1..];
            let &marker = self.rest.first()?;
            if marker == 0xFF {
                continue;
            }
            self.rest = &self.rest[1..];
            if marker == 0 || marker == TEMPORARY || RESTARTS.contains(&marker) {
                continue;
            }
            if marker == START_OF_IMAGE || marker == END_OF_IMAGE {
                return Some((marker, &self.rest[..0]));
            }
            // The length counts its own two bytes.
            let length = usize::from(u16::from_be_bytes(*self.rest.first_chunk()?)).max(2);
            let segment = self.rest.get(2..length)?;
            self.rest = &self.rest[length..];
            return Some((marker, segment));
        }
    }
}
