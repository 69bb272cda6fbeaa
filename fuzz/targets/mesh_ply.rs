#![no_main]
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    lumigraph_fuzz::mesh("absent/mesh.ply", data);
    lumigraph_fuzz::solid("absent/mesh.ply", data);
});
