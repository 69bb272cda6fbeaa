//! Damages files in every way, to see readers refuse and never panic.

use calibrate::Reconstruction;
use calibrate::formats::FormatError;
use std::path::Path;

/// A pseudo-random sequence (SplitMix64), the same every time.
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Cuts a file at every byte and flips bytes at random. `needed` is how many of its
/// bytes it takes to be whole: every shorter cut must be an error.
pub(crate) fn damage(
    bytes: &[u8],
    needed: usize,
    read: impl Fn(&Path) -> Result<Reconstruction, FormatError>,
) {
    let folder = tempfile::tempdir().unwrap();
    // A new file each time: some file systems flush one that is truncated and rewritten.
    let mut count = 0;
    let mut read_bytes = |bytes: &[u8]| {
        let path = folder.path().join(format!("damaged-{count}"));
        count += 1;
        std::fs::write(&path, bytes).unwrap();
        let result = read(&path);
        std::fs::remove_file(&path).unwrap();
        result
    };
    for length in 0..bytes.len() {
        let result = read_bytes(&bytes[..length]);
        if length < needed {
            let error = result.unwrap_err().to_string();
            assert!(error.contains("damaged"), "cut to {length} bytes: {error}");
        }
    }
    let mut state = 1;
    for _ in 0..2000 {
        let mut flipped = bytes.to_vec();
        for _ in 0..1 + random(&mut state) % 3 {
            let at = random(&mut state) as usize % bytes.len();
            flipped[at] = match random(&mut state) % 3 {
                0 => random(&mut state) as u8,
                1 => b'0' + (random(&mut state) % 10) as u8,
                _ => flipped[at] ^ (1 << (random(&mut state) % 8)),
            };
        }
        if let Ok(whole) = read_bytes(&flipped) {
            assert!(!whole.images.is_empty());
            for image in whole.images.values() {
                assert!(image.camera_from_world.is_finite());
                whole.cameras[&image.camera_id].lens().unwrap();
            }
        }
    }
}
