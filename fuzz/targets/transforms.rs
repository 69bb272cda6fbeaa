#![no_main]
use calibrate::formats::{parse_files_beside, parse_transforms};
use libfuzzer_sys::fuzz_target;
use lumigraph_fuzz::{reconstruction, size_of, within_memory};
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let path = Path::new("file");
    reconstruction(data.len(), || parse_transforms(path, data, &size_of));
    let _ = within_memory(data.len(), || parse_files_beside(path, data), |_| 0);
});
