//! Bounds of the blend (`blend.rs`, `cpu/weights.rs`) from bounds of what it is made of.
//!
//! In intervals its formulas say little, as a threshold depends on all views. But each is monotone in
//! what it is made of, so extremes are at corners, and what rounding does to the threshold is known:
//! it solves Σ a·max(0, 1 − diff/t) = m, and what f32 finds solves the same for another m, as much
//! beside as sums of so many terms may round, however it is found.

use super::interval::Interval;
use crate::blend::{SAME_RAY, threshold};
use crate::cpu::source::EDGE;
use crate::frame::trust;
use crate::options::{FieldOptions, MAX_CONTRIBUTORS};

/// A source view that may see a point.
pub(super) struct Candidate<const N: u32> {
    pub diff: Interval<N>,
    pub a: Interval<N>,
    /// Premultiplied, 0…255.
    pub color: [Interval<N>; 4],
}

/// What the candidates' blend may be; zero where there may be none.
pub(super) fn blended<const N: u32>(
    candidates: &[Candidate<N>],
    options: &FieldOptions,
) -> [Interval<N>; 4] {
    let is_sure = candidates.iter().any(|c| c.a.lo > 0.0);
    let mut weights = weights(candidates, options);
    for (weight, candidate) in weights.iter_mut().zip(candidates) {
        *weight = trusted(*weight, candidate.color[3]);
    }
    std::array::from_fn(|channel| {
        let bounds = candidates.iter().map(|c| c.color[channel]);
        let of = |end: fn(Interval<N>) -> f64, sign: f64| {
            let colors = bounds.clone().map(|color| sign * end(color));
            sign * largest_mean(colors.zip(&weights).collect())
        };
        // Nothing weighed: no candidate.
        let (lo, hi) = (of(|c| c.lo, -1.0), of(|c| c.hi, 1.0));
        let mean = match lo.is_finite() && hi.is_finite() {
            true => Interval::new(lo, hi),
            false => Interval::new(0.0, 0.0),
        };
        // Products, their sum, that of the weights, and a quotient; what mattes take off.
        let error = (2 * candidates.len() + 8) as f64 * Interval::<N>::ERROR;
        let mean = mean.wider(error * mean.hi);
        match is_sure {
            true => mean,
            false => mean.with(Interval::new(0.0, 0.0)),
        }
    })
}

/// What is left of a weight where a photo's alpha, 0…255, is so much: see [`trust`].
fn trusted<const N: u32>(weight: Interval<N>, alpha: Interval<N>) -> Interval<N> {
    let of = |weight: f64, alpha: f64| weight * trust((alpha / 255.0).clamp(0.0, 1.0));
    Interval::new(of(weight.lo, alpha.lo), of(weight.hi, alpha.hi))
}

/// What each candidate may weigh, not normalised.
fn weights<const N: u32>(candidates: &[Candidate<N>], options: &FieldOptions) -> Vec<Interval<N>> {
    // On its image's edge f64 gives a view less than `EDGE`, or nothing.
    let a_lo = |c: &Candidate<N>| {
        let counts = c.a.lo > 2.0 * f64::from(EDGE);
        if counts { c.a.lo } else { 0.0 }
    };
    // 1. The threshold.
    let sum_a: f64 = candidates.iter().map(|c| c.a.hi).sum();
    let error = (2 * candidates.len() + 16) as f64 * Interval::<N>::ERROR * sum_a;
    let m = options.full_weight();
    let solved = |of: &dyn Fn(&Candidate<N>) -> (f64, f64), m: f64| {
        let mut sorted: Vec<(f64, f64)> = candidates.iter().map(of).collect();
        sorted.retain(|(_, a)| *a > 0.0);
        sorted.sort_by(|x, y| x.0.total_cmp(&y.0));
        threshold(&sorted, m)
    };
    let least = solved(&|c| (c.diff.lo, c.a.hi), m - error);
    let most = solved(&|c| (c.diff.hi, a_lo(c)), m + error);
    let t = Interval::<N>::new(least.max(0.0), most).after_rounding();

    // 2. The weights: the farther the less.
    let rounding = 8.0 * Interval::<N>::ERROR;
    let noise = SAME_RAY * (1.0 + 1e-6);
    let may_be_none = candidates.iter().any(|c| c.diff.lo <= noise);
    let of_candidate = |c: &Candidate<N>| {
        let weight = |diff: f64, a: f64, t: f64, error: f64| {
            let ratio = if t > 0.0 { diff / t } else { 1.0 };
            a * (1.0 - ratio + error).max(0.0) / diff.max(SAME_RAY) * (1.0 + error)
        };
        let hi = weight(c.diff.lo.max(0.0), c.a.hi, t.hi, rounding);
        // Differences that count as none leave nothing to others, in f64.
        let left_out = may_be_none && c.diff.hi > noise || t.lo <= 1e-29;
        let lo = match left_out {
            true => 0.0,
            false => weight(c.diff.hi, a_lo(c), t.lo, -rounding),
        };
        Interval::new(lo, if hi.is_nan() { f64::INFINITY } else { hi })
    };
    let mut weights: Vec<Interval<N>> = candidates.iter().map(of_candidate).collect();

    // 3. Ties: where none surely weighs anything the nearest share.
    let are_none = candidates
        .iter()
        .all(|c| c.diff.hi <= noise && a_lo(c) > 0.0);
    if are_none {
        // The first in order share by relevance, as they say.
        for (i, (weight, c)) in weights.iter_mut().zip(candidates).enumerate() {
            *weight = match i < MAX_CONTRIBUTORS {
                true => c.a,
                false => Interval::new(0.0, 0.0),
            };
        }
    } else if weights.iter().all(|w| w.lo <= 0.0) {
        let nearest = candidates.iter().map(|c| c.diff.hi);
        let nearest = nearest.fold(f64::INFINITY, f64::min).max(noise);
        for (weight, candidate) in weights.iter_mut().zip(candidates) {
            if candidate.diff.lo <= nearest && candidate.a.hi > 0.0 {
                *weight = Interval::new(0.0, f64::INFINITY);
            }
        }
    }
    weights
}

/// The largest mean of values over weights within bounds: those above a value have their most, all
/// others their least. Negative infinity where nothing weighs anything.
fn largest_mean<const N: u32>(mut values: Vec<(f64, &Interval<N>)>) -> f64 {
    const MOST: f64 = 1e290;
    values.sort_by(|x, y| y.0.total_cmp(&x.0));
    let mut sum: f64 = values.iter().map(|(_, w)| w.lo).sum();
    let mut sum_of_values: f64 = values.iter().map(|(value, w)| w.lo * value).sum();
    let mut largest = match sum > 0.0 {
        true => sum_of_values / sum,
        false => f64::NEG_INFINITY,
    };
    for (value, weight) in values {
        let more = weight.hi.min(MOST) - weight.lo;
        sum += more;
        sum_of_values += more * value;
        if sum > 0.0 {
            largest = largest.max(sum_of_values / sum);
        }
    }
    largest
}
