//! Numbers known to lie between two others (Moore 1966), which grow by what f32 may round.

use crate::cpu::lanes::LARGEST_CUBIC_TERM;
use crate::cpu::scalar::Scalar;
use std::f64::consts::PI;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Sub};

/// All that a formula may give, computed exactly or in f32: each operation takes in what it gives
/// of any numbers within, and errors up to `HALF_ULPS` times that of rounding to the nearest.
///
/// Endpoints are f64, whose own rounding is drowned in that. Where anything may come out, NaN
/// among it, an interval is the whole line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Interval<const HALF_ULPS: u32> {
    pub lo: f64,
    pub hi: f64,
}

/// What rounding to the nearest changes at most, relatively; a little more, for f64's own rounding.
const UNIT: f64 = (1.0 + 1e-6) / (1_u32 << 24) as f64;
/// Below the smallest normal number.
const TINY: f64 = f32::MIN_POSITIVE as f64;
/// Of f32's angles, relatively, and of its logarithms: as tests in `lanes.rs` have them.
const ANGLE_ERROR: f64 = 4e-7;
const LOG2_ERROR: f64 = 3e-6;

impl<const HALF_ULPS: u32> Interval<HALF_ULPS> {
    pub(crate) const WHOLE: Self = Self::new(f64::NEG_INFINITY, f64::INFINITY);

    /// What relative error an operation may have.
    pub(crate) const ERROR: f64 = UNIT * HALF_ULPS as f64;

    /// Everything between two numbers.
    pub(crate) const fn new(lo: f64, hi: f64) -> Self {
        Self { lo, hi }
    }

    /// Takes in what another has.
    pub(crate) fn with(self, other: Self) -> Self {
        Self::new(self.lo.min(other.lo), self.hi.max(other.hi))
    }

    /// What lies between two numbers, too.
    pub(crate) fn within(self, lo: f64, hi: f64) -> Self {
        Self::new(self.lo.clamp(lo, hi), self.hi.clamp(lo, hi))
    }

    /// Grown by a distance.
    pub(crate) fn wider(self, by: f64) -> Self {
        Self::new(self.lo - by, self.hi + by)
    }

    /// What an operation on f32 makes of exact bounds.
    pub(crate) fn after_rounding(self) -> Self {
        self.after_error(Self::ERROR, TINY)
    }

    fn after_error(self, relative: f64, absolute: f64) -> Self {
        if self.lo.is_nan() || self.hi.is_nan() {
            return Self::WHOLE;
        }
        let reach = |v: f64| {
            if v.is_finite() {
                v.abs() * relative + absolute
            } else {
                0.0
            }
        };
        let (lo, hi) = (self.lo - reach(self.lo), self.hi + reach(self.hi));
        // A number too large for f32 becomes infinite.
        let most = f64::from(f32::MAX);
        Self::new(
            if lo < -most { f64::NEG_INFINITY } else { lo },
            if hi > most { f64::INFINITY } else { hi },
        )
    }

    fn has_zero(self) -> bool {
        self.lo <= 0.0 && self.hi >= 0.0
    }
}

impl<const N: u32> Add for Interval<N> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::new(self.lo + other.lo, self.hi + other.hi).after_rounding()
    }
}

impl<const N: u32> Sub for Interval<N> {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self::new(self.lo - other.hi, self.hi - other.lo).after_rounding()
    }
}

impl<const N: u32> Neg for Interval<N> {
    type Output = Self;

    fn neg(self) -> Self {
        Self::new(-self.hi, -self.lo)
    }
}

/// The bounds of an operation that is monotone in each of two numbers.
fn over_corners<const N: u32>(
    a: Interval<N>,
    b: Interval<N>,
    f: impl Fn(f64, f64) -> f64,
) -> Interval<N> {
    let corners = [f(a.lo, b.lo), f(a.lo, b.hi), f(a.hi, b.lo), f(a.hi, b.hi)];
    // `min` and `max` pass NaN over.
    if corners.iter().any(|corner| corner.is_nan()) {
        return Interval::WHOLE;
    }
    let lo = corners.into_iter().fold(f64::INFINITY, f64::min);
    let hi = corners.into_iter().fold(f64::NEG_INFINITY, f64::max);
    Interval::new(lo, hi).after_rounding()
}

impl<const N: u32> Mul for Interval<N> {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        over_corners(self, other, |a, b| a * b)
    }
}

impl<const N: u32> Div for Interval<N> {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        match other.has_zero() {
            true => Self::WHOLE,
            false => over_corners(self, other, |a, b| a / b),
        }
    }
}

/// What a comparison of intervals says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Truth {
    No,
    Maybe,
    Yes,
}

impl BitAnd for Truth {
    type Output = Self;

    fn bitand(self, other: Self) -> Self {
        match (self, other) {
            (Self::No, _) | (_, Self::No) => Self::No,
            (Self::Yes, Self::Yes) => Self::Yes,
            _ => Self::Maybe,
        }
    }
}

impl BitOr for Truth {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        match (self, other) {
            (Self::Yes, _) | (_, Self::Yes) => Self::Yes,
            (Self::No, Self::No) => Self::No,
            _ => Self::Maybe,
        }
    }
}

impl<const N: u32> Scalar for Interval<N> {
    type Truth = Truth;

    fn of(value: f32) -> Self {
        Self::new(value.into(), value.into())
    }

    fn rounded(value: f64) -> Self {
        Self::new(value, value).after_rounding()
    }

    fn squared(self) -> Self {
        let (a, b) = (self.lo * self.lo, self.hi * self.hi);
        let least = if self.has_zero() { 0.0 } else { a.min(b) };
        let Self { lo, hi } = Self::new(least, a.max(b)).after_rounding();
        Self::new(lo.max(0.0), hi)
    }

    fn sqrt(self) -> Self {
        let root = Self::new(self.lo.max(0.0).sqrt(), self.hi.max(0.0).sqrt()).after_rounding();
        Self::new(root.lo.max(0.0), root.hi)
    }

    fn abs(self) -> Self {
        let (a, b) = (self.lo.abs(), self.hi.abs());
        Self::new(if self.has_zero() { 0.0 } else { a.min(b) }, a.max(b))
    }

    fn min(self, other: Self) -> Self {
        Self::new(self.lo.min(other.lo), self.hi.min(other.hi))
    }

    fn max(self, other: Self) -> Self {
        Self::new(self.lo.max(other.lo), self.hi.max(other.hi))
    }

    fn with_sign_of(self, other: Self) -> Self {
        let both = Self::new(-self.hi, self.hi);
        match (other.lo > 0.0, other.hi < 0.0) {
            (true, _) => self,
            (_, true) => -self,
            _ => both,
        }
    }

    fn angle(y: Self, x: Self) -> Self {
        let (near, far) = (y.lo.max(0.0), y.hi.max(0.0));
        // It falls along x; in y it grows before, and falls behind.
        let lo = if x.hi > 0.0 { near } else { far }.atan2(x.hi);
        let hi = if x.lo > 0.0 { far } else { near }.atan2(x.lo);
        let error = ANGLE_ERROR * f64::from(N);
        let angle = Self::new(lo, hi).after_error(error, TINY);
        Self::new(angle.lo.max(0.0), angle.hi.min(PI * (1.0 + error)))
    }

    fn log2(self) -> Self {
        let log = Self::new(self.lo.max(TINY).log2(), self.hi.max(TINY).log2());
        log.wider(LOG2_ERROR * f64::from(N)).after_rounding()
    }

    fn cubic_root(self) -> Self {
        // It falls. Where it is no root f32's is not asked for.
        let fold = -4.0 / 27.0;
        if self.lo <= fold || self.hi >= f64::from(LARGEST_CUBIC_TERM) {
            return Self::WHOLE;
        }
        let at = |t: f64| {
            // Newton's steps come from one side: what eight leave, and none.
            let mut g = 1.0_f64;
            let mut eight = g;
            for step in 0..200 {
                g = (1.0 + 2.0 * t * g.powi(3)) / (1.0 + 3.0 * t * g * g);
                if step == 7 {
                    eight = g;
                }
            }
            let slope = (1.0 + 3.0 * t * g * g).abs();
            // A step's roundings, and those before it through its slope.
            let error = 16.0 * Self::ERROR * (1.0 + (t * g * g).abs()) / slope;
            let (least, most) = (g.min(eight), g.max(eight));
            (least * (1.0 - error), most * (1.0 + error))
        };
        let bounds = Self::new(at(self.hi).0, at(self.lo).1);
        bounds.after_rounding()
    }

    fn above(self, other: Self) -> Truth {
        match (self.lo > other.hi, self.hi > other.lo) {
            (true, _) => Truth::Yes,
            (_, true) => Truth::Maybe,
            _ => Truth::No,
        }
    }

    fn at_least(self, other: Self) -> Truth {
        match (self.lo >= other.hi, self.hi >= other.lo) {
            (true, _) => Truth::Yes,
            (_, true) => Truth::Maybe,
            _ => Truth::No,
        }
    }

    fn either(truth: Truth, yes: Self, no: Self) -> Self {
        match truth {
            Truth::Yes => yes,
            Truth::Maybe => yes.with(no),
            Truth::No => no,
        }
    }

    fn may(truth: Truth) -> bool {
        truth != Truth::No
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Rounded = Interval<1>;

    #[test]
    fn what_f32_computes_lies_within() {
        // Numbers of all sizes and both signs, by a generator as simple as can be.
        let mut state = 1_u64;
        let mut number = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            let share = (state >> 40) as f32 / (1 << 24) as f32 - 0.5;
            share * 10.0_f32.powi((state >> 36 & 15) as i32 - 8)
        };
        for _ in 0..20_000 {
            let (a, b) = (number(), number());
            let (of_a, of_b) = (Rounded::of(a), Rounded::of(b));
            let t = a.abs().min(1e5);
            for (what, exact, rounded, within) in [
                ("+", f64::from(a) + f64::from(b), a + b, of_a + of_b),
                ("-", f64::from(a) - f64::from(b), a - b, of_a - of_b),
                ("*", f64::from(a) * f64::from(b), a * b, of_a * of_b),
                ("/", f64::from(a) / f64::from(b), a / b, of_a / of_b),
                ("sqrt", f64::from(t).sqrt(), t.sqrt(), Rounded::of(t).sqrt()),
                ("²", f64::from(a).powi(2), a * a, of_a.squared()),
                (
                    "angle",
                    f64::from(a.abs()).atan2(f64::from(b)),
                    Scalar::angle(a.abs(), b),
                    Scalar::angle(Rounded::of(a.abs()), of_b),
                ),
                (
                    "log2",
                    f64::from(t + 1.0).log2(),
                    Scalar::log2(t + 1.0),
                    Rounded::of(t + 1.0).log2(),
                ),
            ] {
                for value in [exact, rounded.into()] {
                    let inside = within.lo <= value && value <= within.hi;
                    assert!(inside, "{a} {what} {b}: {value} {within:?}");
                }
            }
            // Its steps, of whichever sign.
            for t in [t, -t.min(0.14)] {
                let (found, within) = (t.cubic_root(), Rounded::of(t).cubic_root());
                let inside = within.lo <= found.into() && f64::from(found) <= within.hi;
                assert!(inside, "{t}: {found} {within:?}");
            }
        }
    }

    #[test]
    fn what_may_be_anything_is_the_whole_line() {
        let across = Rounded::new(-1.0, 1.0);
        assert_eq!(Rounded::of(1.0) / across, Rounded::WHOLE);
        assert_eq!(Rounded::of(0.0) * Rounded::WHOLE, Rounded::WHOLE);
        assert_eq!(across.above(Rounded::of(0.0)), Truth::Maybe);
        let Interval { lo, hi } = Rounded::angle(Rounded::new(0.0, 1.0), across);
        assert!(lo == 0.0 && hi >= PI, "{lo} {hi}");
    }
}
