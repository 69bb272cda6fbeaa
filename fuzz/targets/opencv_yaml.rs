#![no_main]
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    lumigraph_fuzz::opencv(b"%YAML:1.0\n---\n", data, 1);
});
