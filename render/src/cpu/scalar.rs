//! What the engine's formulas are computed in: numbers of f32, or all that f32 may make of them
//! (`crate::rounding`). They are written once, for both.

use super::lanes;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Sub};

/// A number.
pub(crate) trait Scalar:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// What a comparison says.
    type Truth: Copy + BitAnd<Output = Self::Truth> + BitOr<Output = Self::Truth>;

    /// A number that f32 has.
    fn of(value: f32) -> Self;
    /// The nearest that f32 has.
    fn rounded(value: f64) -> Self;

    /// x·x.
    fn squared(self) -> Self;
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    /// With the other's sign; of a number that is not negative.
    fn with_sign_of(self, other: Self) -> Self;
    /// [`lanes::angle`].
    fn angle(y: Self, x: Self) -> Self;
    /// [`lanes::log2`].
    fn log2(self) -> Self;
    /// [`lanes::cubic_root`].
    fn cubic_root(self) -> Self;

    /// Whether self > other.
    fn above(self, other: Self) -> Self::Truth;
    /// Whether self ≥ other.
    fn at_least(self, other: Self) -> Self::Truth;
    fn either(truth: Self::Truth, yes: Self, no: Self) -> Self;
    /// Whether it may be.
    fn may(truth: Self::Truth) -> bool;

    #[inline(always)]
    fn clamp01(self) -> Self {
        self.max(Self::of(0.0)).min(Self::of(1.0))
    }
}

impl Scalar for f32 {
    type Truth = bool;

    #[inline(always)]
    fn of(value: f32) -> Self {
        value
    }

    #[inline(always)]
    fn rounded(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn squared(self) -> Self {
        self * self
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.min(other)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.max(other)
    }

    #[inline(always)]
    fn with_sign_of(self, other: Self) -> Self {
        self.copysign(other)
    }

    #[inline(always)]
    fn angle(y: Self, x: Self) -> Self {
        lanes::angle(y, x)
    }

    #[inline(always)]
    fn log2(self) -> Self {
        lanes::log2(self)
    }

    #[inline(always)]
    fn cubic_root(self) -> Self {
        lanes::cubic_root(self)
    }

    #[inline(always)]
    fn above(self, other: Self) -> bool {
        self > other
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> bool {
        self >= other
    }

    #[inline(always)]
    fn either(truth: bool, yes: Self, no: Self) -> Self {
        if truth { yes } else { no }
    }

    #[inline(always)]
    fn may(truth: bool) -> bool {
        truth
    }

    #[inline(always)]
    fn clamp01(self) -> Self {
        self.clamp(0.0, 1.0)
    }
}
