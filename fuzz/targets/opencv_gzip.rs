#![no_main]
use libfuzzer_sys::fuzz_target;

/// How much larger than its gzip file a text may be: see `opencv/storage.rs`.
const MAX_UNPACKED: usize = 100;

fuzz_target!(|data: &[u8]| {
    lumigraph_fuzz::opencv(&[0x1f, 0x8b], data, MAX_UNPACKED);
});
