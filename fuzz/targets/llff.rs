//! The number of photos, and the array.
#![no_main]
use calibrate::formats::parse_llff;
use libfuzzer_sys::fuzz_target;
use lumigraph_fuzz::{reconstruction, size_of};
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let Some((&photos, array)) = data.split_first() else {
        return;
    };
    let names: Vec<String> = (0..photos).map(|i| format!("{i}.jpg")).collect();
    reconstruction(data.len(), || {
        parse_llff(Path::new("poses_bounds.npy"), array, &names, &size_of)
    });
});
