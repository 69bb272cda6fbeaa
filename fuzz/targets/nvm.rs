#![no_main]
use calibrate::formats::parse_nvm;
use libfuzzer_sys::fuzz_target;
use lumigraph_fuzz::{reconstruction, size_of};
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    reconstruction(data.len(), || parse_nvm(Path::new("file"), data, &size_of));
});
