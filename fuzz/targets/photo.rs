//! The walk over a JPEG's markers, the size, and the decoders behind it.
#![no_main]
use libfuzzer_sys::fuzz_target;
use lumigraph_fuzz::within_memory;
use std::io::Cursor;
use std::path::Path;

/// Larger pictures are refused only by their size: decoding them would take the time.
const MAX_PIXELS: usize = 1 << 18;
/// A pixel of 16-bit RGBA, as decoded and as returned, with what the decoder needs beside.
const BYTES_A_PIXEL: usize = 64;

fuzz_target!(|data: &[u8]| {
    let path = Path::new("photo");
    let size = within_memory(
        data.len(),
        || capture::content_size(path, Cursor::new(data)),
        |_| 0,
    );
    let pixels = size
        .as_ref()
        .map_or(0, |&(width, height)| width as usize * height as usize);
    if pixels > MAX_PIXELS {
        return;
    }
    let decoded = within_memory(
        data.len(),
        || capture::decode_content(path, data, None),
        |_| pixels * BYTES_A_PIXEL,
    );
    if let (Ok(size), Ok(picture)) = (size, decoded) {
        assert_eq!(picture.dimensions(), size);
    }
});
