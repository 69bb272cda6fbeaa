#![no_main]
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    lumigraph_fuzz::opencv(b"<?xml version=\"1.0\"?>\n<opencv_storage>\n", data, 1);
});
