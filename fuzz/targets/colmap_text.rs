//! The three files together; or one of them, the first byte says which, with the other
//! two of a model that is whole.
#![no_main]
use calibrate::colmap::parse_text;
use libfuzzer_sys::fuzz_target;
use lumigraph_fuzz::{model, reconstruction, three};
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let Some((&which, data)) = data.split_first() else {
        return;
    };
    let mut files = model::TEXT.map(str::as_bytes);
    match files.get_mut(usize::from(which)) {
        Some(file) => *file = data,
        None => files = three(data),
    }
    reconstruction(data.len(), || parse_text(Path::new("model"), files));
});
