//! What photos may take in memory, and what they took.

use crate::pyramid::MAX_LEVELS;

/// What photos took of a memory so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Residency {
    /// What they may take, in bytes; `None` without a limit.
    pub budget: Option<u64>,
    /// Bytes that are held now.
    pub held: u64,
    /// The most bytes that ever were.
    pub peak: u64,
    /// How often a photo was brought in: decoded, or uploaded.
    pub loads: u64,
    /// How often one was let go to make room for another.
    pub evictions: u64,
    /// The coarsest mip level that any frame had to be content with; 0 where all photos were
    /// there in full.
    pub level_cap: usize,
    /// How many times a frame was drawn without its photos' finest levels.
    pub capped_frames: u64,
}

impl Residency {
    /// Counts bytes that come and bytes that go.
    pub(crate) fn change(&mut self, come: u64, go: u64) {
        self.held = (self.held + come).saturating_sub(go);
        self.peak = self.peak.max(self.held);
    }

    /// Counts a frame that is drawn from mip level `finest` on.
    pub(crate) fn note_frame(&mut self, finest: usize) {
        self.level_cap = self.level_cap.max(finest);
        self.capped_frames += u64::from(finest > 0);
    }

    /// Whether so many bytes are within the budget.
    pub(crate) fn allows(&self, bytes: u64) -> bool {
        self.budget.is_none_or(|budget| bytes <= budget)
    }
}

/// Bytes of a photo of width × height and its mip levels, without those finer than `finest`,
/// or than its coarsest.
pub fn photo_bytes([mut width, mut height]: [u32; 2], finest: usize) -> u64 {
    const RGBA: u64 = 4;
    let (mut bytes, mut level) = (0, 0);
    loop {
        let last = level + 1 == MAX_LEVELS || (width <= 1 && height <= 1);
        if level >= finest || last {
            bytes += u64::from(width) * u64::from(height) * RGBA;
        }
        if last {
            return bytes;
        }
        (width, height) = (width.div_ceil(2), height.div_ceil(2));
        level += 1;
    }
}

/// The finest mip level from which on photos of the given sizes fit a budget together; the
/// coarsest there is where none does.
///
/// It depends on nothing else, so that a frame looks the same whatever was drawn before.
pub(crate) fn finest_level(
    budget: Option<u64>,
    sizes: impl Iterator<Item = [u32; 2]> + Clone,
) -> usize {
    let Some(budget) = budget else { return 0 };
    let bytes = |level| -> u64 { sizes.clone().map(|size| photo_bytes(size, level)).sum() };
    let coarsest = MAX_LEVELS - 1;
    let fits = (0..coarsest).find(|&level| bytes(level) <= budget);
    fits.unwrap_or(coarsest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pyramid::Pyramid;
    use image::RgbaImage;

    #[test]
    fn bytes_are_those_of_pyramids() {
        for size in [[1, 1], [2, 1], [7, 5], [101, 77], [64, 64], [1, 300]] {
            let whole = Pyramid::new(RgbaImage::new(size[0], size[1]));
            for level in 0..MAX_LEVELS + 2 {
                let expected = whole.from_level(level).bytes() as u64;
                assert_eq!(photo_bytes(size, level), expected, "{size:?}, {level}");
            }
        }
    }

    #[test]
    fn levels_go_until_the_rest_fits() {
        let sizes = [[64, 64], [32, 128]];
        let of = |budget| finest_level(budget, sizes.into_iter());
        let bytes = |level| sizes.map(|size| photo_bytes(size, level)).iter().sum();
        assert_eq!(of(None), 0);
        for level in 0..MAX_LEVELS - 1 {
            assert_eq!(of(Some(bytes(level))), level);
            assert_eq!(of(Some(bytes(level) - 1)), level + 1);
        }
        assert_eq!(of(Some(0)), MAX_LEVELS - 1);
        assert_eq!(finest_level(Some(0), std::iter::empty()), 0);
    }
}
