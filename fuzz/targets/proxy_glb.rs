#![no_main]
use libfuzzer_sys::fuzz_target;
use lumigraph_fuzz::within_memory;
use proxy::Proxy;
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let read = within_memory(
        data.len(),
        || proxy::parse(Path::new("proxy.glb"), data),
        |_| 0,
    );
    if let Ok(Proxy::Plane(plane)) = read {
        assert!(plane.point().is_finite() && (plane.normal().length() - 1.0).abs() < 1e-12);
    }
});
