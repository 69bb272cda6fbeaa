#![no_main]
use libfuzzer_sys::fuzz_target;
use lumigraph::scene::file::SceneFile;
use lumigraph_fuzz::within_memory;
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let _ = within_memory(
        data.len(),
        || SceneFile::parse(Path::new("scene.json"), data),
        |_| 0,
    );
});
