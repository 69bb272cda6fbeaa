//! Exposure: how much brighter one photo of a set is than another.
//!
//! Photos from a hand-held camera differ in exposure and white balance. Where they see the
//! same sparse points they tell by how much: the stored value of channel c at point p in
//! photo i is taken to be gainᵢ꜀ · albedoₚ꜀, which is linear in the logarithms. Stored sRGB
//! values are used as they are, because it is they that are blended; a change of exposure,
//! a factor in linear light, is nearly one there too, as sRGB is nearly a power.
//!
//! 1. [`patches`] says where in which photo to look, [`sample`] looks;
//! 2. [`estimate`] solves for the gains, robustly, and says whether they can be told from
//!    none at all.

mod completed;
mod estimate;
mod halves;
mod sample;
mod solve;
mod ties;

pub use completed::completed;
pub use estimate::{Evidence, Exposure, MIN_SPREAD, Verdict, estimate};
pub use sample::{Patch, Patches, patches, sample, sample_all};

/// What one photo shows of one sparse point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Which photo, by the caller's index.
    pub photo_idx: usize,
    /// Which point, by index into [`Patches::points_in_world`].
    pub point_idx: usize,
    /// Mean stored sRGB value, 0…255, of red, green and blue; `None` where it is too dark
    /// or too bright to be in proportion to the light.
    pub rgb: [Option<f64>; 3],
}
