//! Of which JPEGs the decoder makes no picture, or a wrong one.

use super::{BASELINE, EXTENDED, PROGRESSIVE, START_OF_SCAN, is_frame, markers};

/// What a JPEG is that the decoder cannot read, or would make stripes of; `None` where it can, and where the header says
/// too little.
///
/// The stripes: it takes a sequential picture's scans of one component each for such of whole rows of MCUs, and chroma
/// that is finer than luma for such that is not.
pub(crate) fn unread(bytes: &[u8]) -> Option<&'static str> {
    let mut markers = markers(bytes);
    let (marker, frame) = markers.find(|&(marker, _)| is_frame(marker))?;
    match marker {
        BASELINE | EXTENDED | PROGRESSIVE => {}
        0xC3 => return Some("lossless coding"),
        0xC5..=0xC7 => return Some("hierarchical coding"),
        _ => return Some("arithmetic coding"),
    }
    let (&[bits, _, _, _, _, count], components) = frame.split_first_chunk()?;
    if bits != 8 {
        return Some("more than 8 bits a value");
    }
    let components = components.get(..3 * usize::from(count))?.chunks_exact(3);
    let sampling: Vec<[u8; 2]> = components.map(|c| [c[1] >> 4, c[1] & 15]).collect();
    let &first = sampling.first()?;
    if sampling.iter().flatten().any(|&factor| factor == 3) {
        return Some("samples in threes");
    }
    if sampling
        .iter()
        .any(|it| it[0] > first[0] || it[1] > first[1])
    {
        return Some("chroma finer than luma");
    }
    let (_, scan) = markers.find(|&(marker, _)| marker == START_OF_SCAN)?;
    let is_apart = *scan.first()? < count && marker != PROGRESSIVE;
    let is_coarser = sampling.iter().any(|it| it[1] < first[1]);
    (is_apart && is_coarser).then_some("each colour in a scan of its own")
}
