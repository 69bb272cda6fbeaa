#![no_main]
use libfuzzer_sys::fuzz_target;
use lumigraph::scene::SplitFile;
use lumigraph_fuzz::within_memory;
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let _ = within_memory(
        data.len(),
        || SplitFile::parse(Path::new("split.json"), data),
        |_| 0,
    );
});
