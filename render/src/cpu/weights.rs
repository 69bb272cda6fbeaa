//! The weights of [`crate::blend::blend`], for a tile of pixels at once.

use super::lanes::{LANES, Lane, each, vectorised};
use crate::blend::SAME_RAY;
use crate::options::{Blend, FieldOptions, MAX_CONTRIBUTORS};

/// One source view's terms over a tile.
pub(crate) struct Term {
    /// See [`Self::differ`].
    diff: Lane,
    pub a: Lane,
    /// The weight, not yet normalised; what this module computes.
    pub weight: Lane,
}

impl Term {
    /// Room for one.
    pub(crate) fn nothing() -> Self {
        Self {
            diff: [0.0; LANES],
            a: [0.0; LANES],
            weight: [0.0; LANES],
        }
    }

    /// Sets by how much the view differs, where that is more than noise; else by nothing.
    #[inline(always)]
    pub(crate) fn differ(&mut self, diff: &Lane) {
        for k in 0..LANES {
            self.diff[k] = if diff[k] > SMALLEST { diff[k] } else { 0.0 };
        }
    }
}

/// Up to this, differences are noise: they count as none, and such views share all the weight.
const SMALLEST: f32 = SAME_RAY as f32;
/// Far more than what rounding does to a sum of relevances.
const ROUNDING: f32 = 1e-4;
/// Keeps diff/t defined where every diff is zero.
const SMALLEST_THRESHOLD: f32 = 1e-30;

/// Fills in the weights of those terms that are in `order`. For each pixel the difference beyond which no
/// further view could change them; infinite while any could.
pub(crate) fn weigh(terms: &mut [Term], order: &[usize], options: &FieldOptions) -> Lane {
    vectorised(
        #[inline(always)]
        || weigh_by_lanes(terms, order, options),
    )
}

/// Whether, in the pixels that are `wanted`, further views that differ by `least` or more could not change the
/// weights of those terms that are in `order`. (It may say no where they could not.)
pub(crate) fn is_enough(
    terms: &[Term],
    order: &[usize],
    options: &FieldOptions,
    least: f32,
    wanted: &[bool; LANES],
) -> bool {
    if !(least > SMALLEST) {
        return false;
    }
    // The threshold is where this sum is so much, and the sum grows with it. Or so many candidates are nearer.
    let enough = match options.blend {
        Blend::Consistent => options.full_weight() as f32 * (1.0 + ROUNDING),
        Blend::Paper => options.k as f32,
    };
    let by_least = 1.0 / least;
    vectorised(
        #[inline(always)]
        || {
            let mut sum = [0.0; LANES];
            for term in order.iter().map(|&i| &terms[i]) {
                for k in 0..LANES {
                    let (a, diff) = (term.a[k], term.diff[k]);
                    sum[k] += match options.blend {
                        Blend::Consistent => a * (1.0 - diff * by_least).max(0.0),
                        Blend::Paper if a > 0.0 && diff <= least => 1.0,
                        Blend::Paper => 0.0,
                    };
                }
            }
            let mut is_enough = true;
            for k in 0..LANES {
                is_enough &= !wanted[k] | (sum[k] >= enough);
            }
            is_enough
        },
    )
}

#[inline(always)]
fn weigh_by_lanes(terms: &mut [Term], order: &[usize], options: &FieldOptions) -> Lane {
    let t = match options.blend {
        Blend::Consistent => consistent_threshold(terms, order, options.full_weight() as f32),
        Blend::Paper => each(|k| nth_smallest(terms, order, k, options.k)),
    };
    let mut reach = each(|k| t[k].max(SMALLEST));
    if options.blend == Blend::Paper {
        let mut candidates = [0; LANES];
        for &i in order {
            (0..LANES).for_each(|k| candidates[k] += usize::from(terms[i].a[k] > 0.0));
        }
        (0..LANES)
            .filter(|&k| candidates[k] < options.k)
            .for_each(|k| reach[k] = f32::INFINITY);
    }
    let mut sum = [0.0; LANES];
    for &i in order {
        let term = &mut terms[i];
        for k in 0..LANES {
            // Where so many tie at zero that they are the threshold, none is nearer than it.
            let ratio = if t[k] > SMALLEST_THRESHOLD {
                term.diff[k] / t[k]
            } else {
                1.0
            };
            let near = (1.0 - ratio).max(0.0);
            let weight = match options.blend {
                Blend::Consistent => term.a[k] * near / term.diff[k].max(SMALLEST),
                Blend::Paper => term.a[k] * near,
            };
            term.weight[k] = weight;
            sum[k] += weight;
        }
    }
    // All candidates tied: the nearest share, lowest indices first.
    for k in 0..LANES {
        if sum[k] == 0.0 && order.iter().any(|&i| terms[i].a[k] > 0.0) {
            let nearest = nth_smallest(terms, order, k, 1);
            let tied = |i: &&usize| terms[**i].a[k] > 0.0 && terms[**i].diff[k] <= nearest;
            let tied: Vec<usize> = order
                .iter()
                .filter(tied)
                .take(MAX_CONTRIBUTORS)
                .copied()
                .collect();
            for i in tied {
                terms[i].weight[k] = terms[i].a[k];
            }
        }
    }
    reach
}

/// Solves Σ a·max(0, 1 − diff/t) = m for t in each pixel by Newton's method in 1/t.
///
/// The sum is convex and piecewise linear in 1/t, so from t = ∞ the steps come down on
/// the root from above and land on it exactly: no sorting.
#[inline(always)]
fn consistent_threshold(terms: &[Term], order: &[usize], m: f32) -> Lane {
    let mut t = [f32::INFINITY; LANES];
    for _ in 0..=order.len() {
        let mut sum_a = [0.0_f32; LANES];
        let mut sum_a_diff = [0.0_f32; LANES];
        for term in order.iter().map(|&i| &terms[i]) {
            for k in 0..LANES {
                let a = if term.diff[k] < t[k] { term.a[k] } else { 0.0 };
                sum_a[k] += a;
                sum_a_diff[k] += a * term.diff[k];
            }
        }
        let mut moved = false;
        for k in 0..LANES {
            let next = sum_a_diff[k] / (sum_a[k] - m);
            let next = if sum_a[k] > m {
                next.max(SMALLEST_THRESHOLD)
            } else {
                f32::INFINITY
            };
            moved |= next < t[k];
            t[k] = t[k].min(next);
        }
        if !moved {
            break;
        }
    }
    if order.len() > MAX_CONTRIBUTORS {
        for k in 0..LANES {
            let contributes = |i: &&usize| terms[**i].a[k] > 0.0 && terms[**i].diff[k] < t[k];
            if order.iter().filter(contributes).count() > MAX_CONTRIBUTORS {
                t[k] = t[k].min(nth_smallest(terms, order, k, MAX_CONTRIBUTORS + 1));
            }
        }
    }
    t
}

/// The n-th smallest diff among the candidates of one pixel, or the largest if there are
/// fewer; at least [`SMALLEST_THRESHOLD`].
fn nth_smallest(terms: &[Term], order: &[usize], k: usize, n: usize) -> f32 {
    /// Of so many at most they need no memory of their own: this is asked pixel by pixel.
    const FEW: usize = 128;
    let (mut few, mut many) = ([0.0; FEW], Vec::new());
    let diffs: &mut [f32] = match order.len() {
        ..=FEW => &mut few,
        count => {
            many.resize(count, 0.0);
            &mut many
        }
    };
    let mut count = 0;
    for term in order.iter().map(|&i| &terms[i]).filter(|t| t.a[k] > 0.0) {
        diffs[count] = term.diff[k];
        count += 1;
    }
    if count == 0 {
        return SMALLEST_THRESHOLD;
    }
    let nth = n.min(count) - 1;
    diffs[..count]
        .select_nth_unstable_by(nth, f32::total_cmp)
        .1
        .max(SMALLEST_THRESHOLD)
}
