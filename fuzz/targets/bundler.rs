//! The list, a zero byte, and the model.
#![no_main]
use calibrate::formats::parse_bundler;
use libfuzzer_sys::fuzz_target;
use lumigraph_fuzz::{reconstruction, size_of};
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let mut parts = data.splitn(2, |&byte| byte == 0);
    let list = parts.next().unwrap_or_default();
    let bundle = parts.next().unwrap_or_default();
    reconstruction(data.len(), || {
        let list = (Path::new("list.txt"), list);
        parse_bundler(Path::new("bundle.out"), bundle, list, &size_of)
    });
});
