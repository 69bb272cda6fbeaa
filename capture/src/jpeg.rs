//! The markers of a JPEG file: enough to know its size and whether it is complete.
//!
//! Decoders fill up what is missing at the end of a file with grey. A photo half grey is
//! worse than none, so we look for the end ourselves: walking from marker to marker, as
//! the embedded preview in an EXIF segment has an end of its own.

const START_OF_SCAN_LINES: std::ops::RangeInclusive<u8> = 0xC0..=0xCF;
const HUFFMAN_TABLE: u8 = 0xC4;
const EXTENSION: u8 = 0xC8;
const ARITHMETIC_TABLE: u8 = 0xCC;
const RESTARTS: std::ops::RangeInclusive<u8> = 0xD0..=0xD7;
const START_OF_IMAGE: u8 = 0xD8;
const END_OF_IMAGE: u8 = 0xD9;
const TEMPORARY: u8 = 0x01;

/// Whether the picture's end is there. What follows it does not matter: some cameras
/// append a second picture.
pub(crate) fn is_complete(bytes: &[u8]) -> bool {
    markers(bytes).any(|(marker, _)| marker == END_OF_IMAGE)
}

/// Width and height, if the part of the file in `bytes` states them.
pub(crate) fn size(bytes: &[u8]) -> Option<(u32, u32)> {
    let (_, frame) = markers(bytes).find(|(marker, _)| {
        START_OF_SCAN_LINES.contains(marker)
            && ![HUFFMAN_TABLE, EXTENSION, ARITHMETIC_TABLE].contains(marker)
    })?;
    // Bits per sample, height, width, components.
    let &[_, h1, h0, w1, w0] = frame.first_chunk()?;
    let (width, height) = (u16::from_be_bytes([w1, w0]), u16::from_be_bytes([h1, h0]));
    // A height of zero is stated later, by rare files.
    (width > 0 && height > 0).then_some((width.into(), height.into()))
}

/// The markers in their order, each with what its segment holds. Ends where the bytes do,
/// be it amid a segment.
pub(crate) fn markers(bytes: &[u8]) -> impl Iterator<Item = (u8, &[u8])> {
    let mut rest = bytes;
    std::iter::from_fn(move || {
        loop {
            // Between segments lies compressed data, in which FF 00 means the byte FF and
            // restarts occur. FF may be repeated before a marker.
            let start = rest.iter().position(|&byte| byte == 0xFF)?;
            rest = &rest[start + 1..];
            let &marker = rest.first()?;
            if marker == 0xFF {
                continue;
            }
            rest = &rest[1..];
            if marker == 0 || marker == TEMPORARY || RESTARTS.contains(&marker) {
                continue;
            }
            if marker == START_OF_IMAGE || marker == END_OF_IMAGE {
                return Some((marker, &rest[..0]));
            }
            // The length counts its own two bytes.
            let length = usize::from(u16::from_be_bytes(*rest.first_chunk()?)).max(2);
            let segment = rest.get(2..length)?;
            rest = &rest[length..];
            return Some((marker, segment));
        }
    })
}
