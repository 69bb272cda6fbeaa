#![no_main]
use calibrate::formats::parse_transforms;
use libfuzzer_sys::fuzz_target;
use lumigraph_fuzz::{reconstruction, size_of};
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    reconstruction(data.len(), || {
        parse_transforms(Path::new("file"), data, &size_of)
    });
});
