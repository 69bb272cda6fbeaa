#![no_main]
use libfuzzer_sys::fuzz_target;
use lumigraph_fuzz::within_memory;
use proxy::interior::{parse_interior, parse_rooms};
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let path = Path::new("interior.json");
    let interior = within_memory(data.len(), || parse_interior(path, data), |_| 0);
    let rooms = within_memory(data.len(), || parse_rooms(path, data, "house.glb"), |_| 0);
    for (interior, _) in [interior, rooms].into_iter().flatten() {
        assert!(interior.check().is_ok() && !interior.cells.is_empty());
        for portal in &interior.portals {
            let normal = portal.polygon.normal();
            assert!((normal.length() - 1.0).abs() < 1e-9);
            assert!(!portal.polygon.convex_pieces().is_empty());
        }
    }
});
