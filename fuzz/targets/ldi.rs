#![no_main]
use libfuzzer_sys::fuzz_target;
use lumigraph_fuzz::within_memory;
use render::ldi::{ClipTree, layers, parse};
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let path = Path::new("0-1.ldi");
    match within_memory(data.len(), || parse(path, data), |_| 0) {
        Err(error) => assert!(!error.to_string().is_empty()),
        Ok(ldi) => {
            assert_eq!(layers(&ldi).total(), ldi.len());
            let [width, height] = ldi.size();
            for y in 0..height {
                for x in 0..width {
                    assert!(ldi.pixel(x, y).all(|sample| sample.inverse_depth > 0.0));
                }
            }
            ClipTree::new(&ldi);
        }
    }
});
