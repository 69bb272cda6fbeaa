#![no_main]
use calibrate::formats::parse_meshroom;
use libfuzzer_sys::fuzz_target;
use lumigraph_fuzz::reconstruction;
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    reconstruction(data.len(), || parse_meshroom(Path::new("file"), data));
});
