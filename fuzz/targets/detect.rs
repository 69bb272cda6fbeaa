#![no_main]
use calibrate::formats::detect_content;
use libfuzzer_sys::fuzz_target;
use lumigraph_fuzz::within_memory;
use std::io::Cursor;

fuzz_target!(|data: &[u8]| {
    within_memory(data.len(), || detect_content(Cursor::new(data)), |_| 0);
});
