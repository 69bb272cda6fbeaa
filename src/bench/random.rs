use glam::{DQuat, DVec3};

/// Pseudo-random numbers, the same everywhere, from a seed: SplitMix64 (Steele et al. 2014).
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Evenly in low…high.
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Below `count`.
    pub fn below(&mut self, count: usize) -> usize {
        (self.next() % count as u64) as usize
    }

    /// Evenly in the cube of half side `reach`.
    pub fn vector(&mut self, reach: f64) -> DVec3 {
        let mut coordinate = || self.within(-reach, reach);
        DVec3::new(coordinate(), coordinate(), coordinate())
    }

    /// About any axis by any angle.
    pub fn rotation(&mut self) -> DQuat {
        let axis = self.vector(1.0).try_normalize().unwrap_or(DVec3::X);
        DQuat::from_axis_angle(axis, self.within(-3.1, 3.1))
    }
}
