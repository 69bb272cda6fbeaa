#![no_main]
use calibrate::formats::parse_nvm;
use libfuzzer_sys::fuzz_target;
use lumigraph_fuzz::{reconstruction, size_of};
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let path = Path::new("file");
    reconstruction(data.len(), || {
        parse_nvm(path, data, &size_of, &mut Vec::new())
    });
});
