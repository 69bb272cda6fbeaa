#![no_main]
use libfuzzer_sys::fuzz_target;
use lumigraph_fuzz::within_memory;
use render::path;
use std::path::Path;

/// A short file may ask for many frames between two keyframes: what one of them takes.
const BYTES_A_FRAME: usize = 4096;

fuzz_target!(|data: &[u8]| {
    let frames = |read: &Result<path::CameraPath, _>| read.as_ref().map_or(0, |p| p.frames.len());
    let read = within_memory(
        data.len(),
        || path::parse(Path::new("path.json"), data),
        |read| frames(read) * BYTES_A_FRAME,
    );
    for frame in read.iter().flat_map(|path| &path.frames) {
        assert!(frame.view.camera_from_world.is_finite());
    }
});
