//! A tile of pixels at a time: plain loops over fixed arrays, which the compiler turns into
//! vector instructions: the widest that the machine has, found when the program runs. No fused
//! multiply-adds, so every machine computes the same bytes.

use super::scalar::Scalar;
use pulp::{Arch, WithSimd};
use std::sync::LazyLock;

/// Neighbouring pixels worked on together.
pub(crate) const LANES: usize = 32;

/// One number a pixel.
pub(crate) type Lane<T = f32> = [T; LANES];

/// Runs a function, which and all it calls should be `inline(always)`, with the widest vector
/// instructions that there are.
#[inline]
pub(crate) fn vectorised<R>(f: impl FnOnce() -> R) -> R {
    in_vectors(f)
}

/// The same for what is written for vectors of any size: loops of few steps, which the compiler unrolls before it
/// looks for vectors, it makes halves and single numbers of.
#[inline]
pub(crate) fn in_vectors<F: WithSimd>(f: F) -> F::Output {
    static ARCH: LazyLock<Arch> = LazyLock::new(Arch::new);
    ARCH.dispatch(f)
}

/// One number a pixel, computed from its index.
#[inline(always)]
pub(crate) fn each<T: Scalar>(f: impl Fn(usize) -> T) -> Lane<T> {
    let mut lane = [T::of(0.0); LANES];
    for k in 0..LANES {
        lane[k] = f(k);
    }
    lane
}

/// Whether something holds of any pixel.
#[inline]
pub(crate) fn any(holds: impl Fn(usize) -> bool) -> bool {
    vectorised(
        #[inline(always)]
        || {
            let mut any = false;
            for k in 0..LANES {
                any |= holds(k);
            }
            any
        },
    )
}

/// atan2 for y ≥ 0, to 2e-7 relative; 0 at the origin.
///
/// The quotient is brought to [0, 1], then by atan q = π/4 + atan((q − 1)/(q + 1)) to
/// |q| ≤ tan(π/8), where the polynomial (Cephes, `atanf`) holds.
#[inline(always)]
pub(crate) fn angle(y: f32, x: f32) -> f32 {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    const TAN_PI_8: f32 = 0.414_213_56;
    let ax = x.abs();
    let larger = ax.max(y).max(f32::MIN_POSITIVE);
    let q = ax.min(y) / larger;
    let far = q > TAN_PI_8;
    // One division for both, as one that only some lanes need keeps the rest from being vectors.
    let (above, below) = if far { (q - 1.0, q + 1.0) } else { (q, 1.0) };
    let r = above / below;
    let z = r * r;
    let polynomial =
        (((8.053_744_5e-2 * z - 1.387_768_6e-1) * z + 1.997_771_1e-1) * z - 3.333_295e-1) * z * r
            + r;
    let first = polynomial + if far { FRAC_PI_4 } else { 0.0 };
    let steep = if y > ax { FRAC_PI_2 - first } else { first };
    if x < 0.0 { PI - steep } else { steep }
}

/// log₂ of a positive number, to 3e-6 absolute: the exponent, and a polynomial in the
/// mantissa (fitted to least maximum error) that meets it at both ends.
#[inline(always)]
pub(crate) fn log2(x: f32) -> f32 {
    let bits = x.to_bits();
    let exponent = ((bits >> 23) as i32 - 127) as f32;
    let m = f32::from_bits((bits & 0x007f_ffff) | 0x3f80_0000) - 1.0;
    let polynomial = 1.442_544_9
        + m * (-0.718_145_2
            + m * (0.457_548_9 + m * (-0.277_904_7 + m * (0.121_797_4 - m * 0.025_841_27))));
    exponent + m * polynomial
}

/// The whole part of 0 ≤ x < 2²², as both kinds of number; anything else gives any number. (A cast
/// to an integer says what becomes of those, too, and is done one by one.)
#[inline(always)]
pub(crate) fn whole(x: f32) -> (f32, i32) {
    // Beyond 2²³ numbers have no digits for fractions.
    const SHIFT: f32 = 8_388_608.0;
    let nearest = (x + SHIFT) - SHIFT;
    let floor = nearest - if nearest > x { 1.0 } else { 0.0 };
    let bits = (floor + SHIFT).to_bits() as i32;
    (floor, bits.wrapping_sub(SHIFT.to_bits() as i32))
}

/// [`whole`] of 0 ≤ x < 2³¹ in f64.
#[inline(always)]
pub(crate) fn whole_f64(x: f64) -> (f64, i32) {
    const SHIFT: f64 = (1_u64 << 52) as f64;
    let nearest = (x + SHIFT) - SHIFT;
    let floor = nearest - if nearest > x { 1.0 } else { 0.0 };
    (floor, (floor + SHIFT).to_bits() as i32)
}

/// Newton's steps for a cubic from 1, which approach its root from one side; beyond
/// [`LARGEST_CUBIC_TERM`] they stop outside every image.
const CUBIC_STEPS: usize = 8;
/// See [`cubic_root`].
pub(crate) const LARGEST_CUBIC_TERM: f32 = 1e6;

/// g with g + t·g³ = 1, for −4/27 < t < [`LARGEST_CUBIC_TERM`].
#[inline(always)]
pub(crate) fn cubic_root(t: f32) -> f32 {
    let mut g = 1.0;
    for _ in 0..CUBIC_STEPS {
        let term = t * g * g;
        g = (1.0 + 2.0 * term * g) / (1.0 + 3.0 * term);
    }
    g
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_parts_are_those_of_a_cast() {
        let near = |n: f32| [n.next_down(), n, n.next_up(), n + 0.5, (n + 0.5).next_up()];
        let numbers = (0..200).chain([1 << 15, (1 << 22) - 1]).map(|n| n as f32);
        for x in numbers.flat_map(near).filter(|x| *x >= 0.0) {
            assert_eq!(whole(x), (x.floor(), x as i32), "{x}");
        }
        let near = |n: f64| [n.next_down(), n, n.next_up(), n + 0.5, (n + 0.5).next_up()];
        let numbers = (0..200).chain([1 << 20, i32::MAX]).map(f64::from);
        for x in numbers
            .flat_map(near)
            .filter(|x| (0.0..2.0_f64.powi(31)).contains(x))
        {
            assert_eq!(whole_f64(x), (x.floor(), x as i32), "{x}");
        }
    }

    #[test]
    fn angles_are_right_all_round_and_when_tiny() {
        for i in 0..=20_000 {
            let truth = std::f64::consts::PI * f64::from(i) / 20_000.0;
            for radius in [1e-12, 1.0, 1e12] {
                let (sin, cos) = truth.sin_cos();
                let (y, x) = ((radius * sin) as f32, (radius * cos) as f32);
                let truth = f64::from(y).atan2(f64::from(x));
                let error = (f64::from(angle(y, x)) - truth).abs();
                assert!(error <= 4e-7 * truth, "{truth}: {error}");
            }
        }
        assert_eq!(angle(0.0, 0.0), 0.0);
        assert_eq!(angle(1e-20, 1.0), 1e-20);
    }

    #[test]
    fn logarithms_are_close() {
        let mut worst = 0.0_f64;
        for i in 1..100_000 {
            let x = i as f32 * 0.01;
            worst = worst.max((f64::from(log2(x)) - f64::from(x).log2()).abs());
        }
        assert!(worst < 3e-6, "{worst}");
        assert_eq!(log2(1.0), 0.0);
        assert!((log2(4.0) - 2.0).abs() < 1e-6);
    }
}
