//! Noise from a hash: the same numbers on every machine, for every seed.

use glam::{DVec2, DVec3};

/// Scrambles four integers into 32 bits.
pub(crate) fn hash(seed: u32, x: i32, y: i32, z: i32) -> u32 {
    let mut h = seed.wrapping_mul(0x9e37_79b9)
        ^ (x as u32).wrapping_mul(0x8da6_b343)
        ^ (y as u32).wrapping_mul(0xd816_3841)
        ^ (z as u32).wrapping_mul(0xcb1a_b31f);
    // The finaliser of MurmurHash3.
    h ^= h >> 16;
    h = h.wrapping_mul(0x85eb_ca6b);
    h ^= h >> 13;
    h = h.wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}

/// A number in [0, 1) from four integers.
pub(crate) fn unit(seed: u32, x: i32, y: i32, z: i32) -> f64 {
    f64::from(hash(seed, x, y, z)) / 4_294_967_296.0
}

/// A number in [−1, 1) from four integers.
pub(crate) fn signed(seed: u32, x: i32, y: i32, z: i32) -> f64 {
    2.0 * unit(seed, x, y, z) - 1.0
}

/// 6t⁵ − 15t⁴ + 10t³: between lattice values without a visible lattice.
fn fade(t: f64) -> f64 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

fn mix(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// Value noise in the plane, in [0, 1], with one random value at each integer point.
pub(crate) fn value2(seed: u32, at: DVec2) -> f64 {
    let cell = at.floor();
    let t = at - cell;
    let (x, y) = (cell.x as i32, cell.y as i32);
    let corner = |dx: i32, dy: i32| unit(seed, x + dx, y + dy, 0);
    let (tx, ty) = (fade(t.x), fade(t.y));
    mix(
        mix(corner(0, 0), corner(1, 0), tx),
        mix(corner(0, 1), corner(1, 1), tx),
        ty,
    )
}

/// Value noise in space, in [0, 1].
pub(crate) fn value3(seed: u32, at: DVec3) -> f64 {
    let cell = at.floor();
    let t = at - cell;
    let (x, y, z) = (cell.x as i32, cell.y as i32, cell.z as i32);
    let corner = |dx: i32, dy: i32, dz: i32| unit(seed, x + dx, y + dy, z + dz);
    let (tx, ty, tz) = (fade(t.x), fade(t.y), fade(t.z));
    let slice = |dz: i32| {
        mix(
            mix(corner(0, 0, dz), corner(1, 0, dz), tx),
            mix(corner(0, 1, dz), corner(1, 1, dz), tx),
            ty,
        )
    };
    mix(slice(0), slice(1), tz)
}

/// Sums octaves of `noise(octave seed, frequency)` from `longest` wavelength down to
/// `finest`, below which nothing is drawn: that keeps pictures free of aliasing.
/// In [0, 1], around 0.5.
fn octaves(seed: u32, longest: f64, finest: f64, noise: impl Fn(u32, f64) -> f64) -> f64 {
    let (mut wavelength, mut weight, mut octave) = (longest, 1.0, 0);
    let (mut sum, mut total) = (0.0, 0.0);
    while wavelength > finest && octave < 10 {
        // The last octave fades in, so a change of `finest` does not switch it.
        let presence = (wavelength / finest - 1.0).min(1.0);
        sum += weight * presence * (noise(seed + 101 * octave, 1.0 / wavelength) - 0.5);
        total += weight;
        wavelength *= 0.5;
        weight *= 0.62;
        octave += 1;
    }
    if total > 0.0 { 0.5 + sum / total } else { 0.5 }
}

/// Several octaves of noise in the plane.
pub(crate) fn fractal2(seed: u32, at: DVec2, longest: f64, finest: f64) -> f64 {
    octaves(seed, longest, finest, |seed, frequency| {
        value2(seed, at * frequency)
    })
}

/// Several octaves of noise in space.
pub(crate) fn fractal3(seed: u32, at: DVec3, longest: f64, finest: f64) -> f64 {
    octaves(seed, longest, finest, |seed, frequency| {
        value3(seed, at * frequency)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_smooth_bounded_and_the_same_every_time() {
        let mut previous = value3(7, DVec3::new(-3.0, 0.2, 0.7));
        for step in 1..=6000 {
            let at = DVec3::new(-3.0 + f64::from(step) * 1e-3, 0.2, 0.7);
            let value = value3(7, at);
            assert!((0.0..=1.0).contains(&value));
            assert!((value - previous).abs() < 5e-3, "jump at {at}");
            assert_eq!(value, value3(7, at));
            previous = value;
        }
    }

    #[test]
    fn wavelengths_below_the_finest_are_not_drawn() {
        let at = DVec2::new(0.3, 0.4);
        assert_eq!(fractal2(1, at, 0.1, 0.2), 0.5);
        assert_ne!(fractal2(1, at, 0.1, 0.01), 0.5);
    }
}
