//! From the candidates for one ray to their weights: Buehler et al. 2001, §4.1, and what
//! measurement taught.

use crate::options::{Blend, FieldOptions, MAX_CONTRIBUTORS};

/// A source view that sees the proxy point inside its image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Which source view.
    pub source_idx: usize,
    /// angDiff + β·resDiff.
    pub diff: f64,
    /// fovBlend, 0…1.
    pub fov: f64,
    /// What its ignore mask leaves of it, and what hides the point from it, 0…1; 1 without
    /// either.
    pub mask: f64,
}

/// A source view and its share of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contributor {
    /// Which source view.
    pub source_idx: usize,
    /// Positive; the shares of one ray sum to one.
    pub weight: f64,
}

/// A difference this small is none: such views share all the weight.
pub const SAME_RAY: f64 = 1e-12;

/// The weights of the candidates for one ray, in the order of their indices.
///
/// Consistent form: wᵢ ∝ aᵢ·max(0, 1 − diffᵢ/t)/diffᵢ, with aᵢ = fovBlendᵢ·maskᵢ and t from
/// [`threshold`]. Paper: wᵢ ∝ aᵢ·max(0, 1 − diffᵢ/t) with t the k-th smallest diff ("k-th
/// largest" is a misprint). Where that is undefined:
///
/// - fewer than k candidates (paper): t is the largest diff;
/// - candidates that their masks ignore: as if they were none;
/// - all others on the very edge of their images (every fovBlend zero): as if each were one;
/// - candidates with diff ≤ [`SAME_RAY`] (consistent form): they share all weight in
///   proportion to aᵢ;
/// - all weights zero because the candidates are tied: those with the smallest diff share
///   in proportion to aᵢ, the [`MAX_CONTRIBUTORS`] of lowest index;
/// - no candidate: no contributor.
///
/// Every weight is finite and positive, and they sum to one unless there are none.
pub fn blend(candidates: &[Candidate], options: &FieldOptions) -> Vec<Contributor> {
    // 1. Relevance: mask and feather, unless there is nothing but feather.
    let candidates = candidates.iter().filter(|c| c.mask > 0.0);
    let feathered_out = candidates.clone().all(|c| c.fov <= 0.0);
    let mut relevant: Vec<(usize, f64, f64)> = candidates
        .map(|c| {
            let fov = if feathered_out { 1.0 } else { c.fov };
            (c.source_idx, c.diff, fov * c.mask)
        })
        .filter(|(_, _, a)| *a > 0.0)
        .collect();
    relevant.sort_by(|x, y| x.1.total_cmp(&y.1).then(x.0.cmp(&y.0)));
    let Some(&(_, smallest, _)) = relevant.first() else {
        return Vec::new();
    };

    // 2. The weights by the formula.
    let sorted = |i: usize| relevant.get(i).map(|&(_, diff, a)| (diff, a));
    let mut weighted: Vec<Contributor> = match options.blend {
        Blend::Consistent if smallest <= SAME_RAY => Vec::new(),
        Blend::Consistent => {
            let t = threshold_of(sorted, options.full_weight());
            let weight = |diff: f64, a: f64| a * (1.0 - diff / t).max(0.0) / diff;
            contributors(&relevant, weight)
        }
        Blend::Paper => {
            let t = relevant[options.k.min(relevant.len()) - 1].1;
            let weight = |diff: f64, a: f64| {
                if t > 0.0 {
                    a * (1.0 - diff / t).max(0.0)
                } else {
                    0.0
                }
            };
            contributors(&relevant, weight)
        }
    };

    // 3. Where it gives nothing, the tied candidates share.
    if weighted.is_empty() {
        let limit = match options.blend {
            Blend::Consistent => smallest.max(SAME_RAY),
            Blend::Paper => smallest,
        };
        relevant.retain(|&(_, diff, _)| diff <= limit);
        relevant.sort_by_key(|&(source_idx, _, _)| source_idx);
        relevant.truncate(MAX_CONTRIBUTORS);
        weighted = contributors(&relevant, |_, a| a);
    }

    // 4. Shares, in the order of the views.
    let sum: f64 = weighted.iter().map(|c| c.weight).sum();
    weighted.iter_mut().for_each(|c| c.weight /= sum);
    weighted.sort_by_key(|c| c.source_idx);
    weighted
}

impl FieldOptions {
    /// The least difference of these that weights count from (zero where they count from none), and the one beyond which no
    /// further candidate could change the weights of these; infinite while any could.
    pub(crate) fn reach(&self, candidates: &[Candidate]) -> (f64, f64) {
        let shown = candidates.iter().filter(|c| c.mask > 0.0 && c.fov > 0.0);
        let mut sorted: Vec<(f64, f64)> = shown.map(|c| (c.diff, c.fov * c.mask)).collect();
        sorted.sort_by(|x, y| x.0.total_cmp(&y.0));
        let Some(&(smallest, _)) = sorted.first() else {
            return (0.0, f64::INFINITY);
        };
        match self.blend {
            Blend::Consistent if smallest <= SAME_RAY => (smallest, SAME_RAY),
            Blend::Consistent => (smallest, threshold(&sorted, self.full_weight())),
            Blend::Paper => {
                let nth = sorted.get(self.k - 1);
                (0.0, nth.map_or(f64::INFINITY, |s| s.0))
            }
        }
    }

    /// The threshold t among views that all see the whole of what matters (a = 1), from
    /// their differences, whose order it changes. More views can only lower it.
    pub(crate) fn threshold_of_seen(&self, diffs: &mut [f64]) -> f64 {
        if self.blend == Blend::Paper {
            return nth(diffs, self.k - 1);
        }
        // What [`threshold`] finds among those that are sorted: with all in play t is no less than it should
        // be, as those beyond it count against it; without them it is nearer, until there are none.
        let m = self.full_weight();
        let (mut t, mut in_play) = (f64::INFINITY, usize::MAX);
        loop {
            let (count, sum) = below(diffs, t);
            if !(count as f64 > m) || count >= in_play {
                break;
            }
            (t, in_play) = (sum / (count as f64 - m), count);
        }
        // The one after the last that may contribute caps it.
        match in_play > MAX_CONTRIBUTORS {
            true => t.min(nth(diffs, MAX_CONTRIBUTORS)),
            false => t,
        }
    }

    /// Whether [`Self::threshold_of_seen`] of these is `most` or less, and others that differ by as much or more
    /// could not even share where they tie. (It may say no where it is.)
    pub(crate) fn is_threshold_of_seen_within(
        &self,
        diffs: impl Iterator<Item = f64>,
        most: f64,
    ) -> bool {
        // What rounding may take.
        const MARGIN: f64 = 1e-12;
        if !(most > SAME_RAY) {
            return false;
        }
        let (mut sum, mut count, mut nearer) = (0.0, 0, 0);
        diffs.filter(|diff| *diff <= most).any(|diff| {
            sum += 1.0 - diff / most;
            count += 1;
            nearer += usize::from(diff < most);
            let suffice = match self.blend {
                Blend::Paper => nearer >= self.k,
                // The threshold is where the sum is so much, and the sum grows with it.
                Blend::Consistent => sum >= self.full_weight() * (1.0 + MARGIN),
            };
            suffice || count > MAX_CONTRIBUTORS
        })
    }
}

/// The n-th smallest, from zero on; infinite where there are not so many.
fn nth(diffs: &mut [f64], n: usize) -> f64 {
    match n < diffs.len() {
        true => *diffs.select_nth_unstable_by(n, f64::total_cmp).1,
        false => f64::INFINITY,
    }
}

/// How many are less than t, and their sum.
fn below(diffs: &[f64], t: f64) -> (usize, f64) {
    // Several at once, none of which waits for the one before.
    let (mut counts, mut sums) = ([0; 4], [0.0; 4]);
    let mut add = |lane: usize, diff: f64| {
        counts[lane] += usize::from(diff < t);
        sums[lane] += if diff < t { diff } else { 0.0 };
    };
    let (fours, rest) = diffs.as_chunks::<4>();
    for four in fours {
        (0..4).for_each(|lane| add(lane, four[lane]));
    }
    rest.iter()
        .zip(0..)
        .for_each(|(diff, lane)| add(lane, *diff));
    (counts.iter().sum(), sums.iter().sum())
}

fn contributors(
    relevant: &[(usize, f64, f64)],
    weight: impl Fn(f64, f64) -> f64,
) -> Vec<Contributor> {
    let weighted = relevant.iter().map(|&(source_idx, diff, a)| Contributor {
        source_idx,
        weight: weight(diff, a),
    });
    weighted.filter(|c| c.weight > 0.0).collect()
}

/// t of the consistent blend, from (diff, a) sorted by diff.
///
/// It solves Σ aᵢ·max(0, 1 − diffᵢ/t) = m, which grows with t. With the first n terms in
/// play it reads A − B/t = m, A = Σ aᵢ and B = Σ aᵢ·diffᵢ, so t = B/(A − m); the right n
/// is the first whose t does not reach the next diff. Infinite where Σ aᵢ ≤ m. At most
/// [`MAX_CONTRIBUTORS`] stay below it.
pub fn threshold(sorted: &[(f64, f64)], m: f64) -> f64 {
    threshold_of(|i| sorted.get(i).copied(), m)
}

/// [`threshold`] of what a function has at each index from zero on.
fn threshold_of(sorted: impl Fn(usize) -> Option<(f64, f64)>, m: f64) -> f64 {
    let limit = sorted(MAX_CONTRIBUTORS).map_or(f64::INFINITY, |s| s.0);
    let (mut sum_a, mut sum_a_diff) = (0.0, 0.0);
    let mut n = 0;
    while let Some((diff, a)) = sorted(n) {
        n += 1;
        sum_a += a;
        sum_a_diff += a * diff;
        if sum_a > m {
            let t = sum_a_diff / (sum_a - m);
            if sorted(n).is_none_or(|next| t <= next.0) {
                return t.min(limit);
            }
        }
    }
    limit
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The threshold of views that see all is that of the same ones in order, each counting in full.
    #[test]
    fn thresholds_take_no_order() {
        let mut state = 7_u32;
        let mut random = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % below
        };
        let mut finite = 0;
        for round in 0..4_000 {
            // Many are alike, some zero, some infinite.
            let steps = 1 + random(60);
            let diffs: Vec<f64> = (0..random(60))
                .map(|_| match random(40) {
                    0 => f64::INFINITY,
                    _ => 0.01 * f64::from(random(steps)),
                })
                .collect();
            let options = FieldOptions {
                k: 1 + random(70) as usize,
                ..FieldOptions::default()
            };
            let mut sorted: Vec<(f64, f64)> = diffs.iter().map(|d| (*d, 1.0)).collect();
            sorted.sort_by(|x, y| x.0.total_cmp(&y.0));
            let expected = threshold(&sorted, options.full_weight());
            let found = options.threshold_of_seen(&mut diffs.clone());
            assert!(
                found == expected || (found - expected).abs() <= 1e-12 * expected,
                "{round}: {found} for {expected}, {options:?} {diffs:?}"
            );
            finite += u32::from(found.is_finite());
        }
        assert!(finite > 1_000, "{finite}");
    }

    /// Where those that differ least suffice, all others change no weight.
    #[test]
    fn views_that_suffice_have_the_weights_that_all_have() {
        let mut state = 1_u32;
        let mut random = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % below
        };
        let mut sufficed = [0; 2];
        for round in 0..4_000 {
            // Some share the ray, many differ alike.
            let steps = 1 + random(60);
            let mut all: Vec<Candidate> = (0..1 + random(60) as usize)
                .map(|source_idx| Candidate {
                    source_idx,
                    diff: f64::from(random(steps)) * 0.01 + 1e-13 * f64::from(random(2)),
                    fov: 1.0,
                    mask: 1.0,
                })
                .collect();
            all.sort_by_key(|c| (c.diff.to_bits(), c.source_idx));
            for (kind, blend_by) in [Blend::Consistent, Blend::Paper].into_iter().enumerate() {
                let options = FieldOptions {
                    blend: blend_by,
                    k: 1 + random(16) as usize,
                    ..FieldOptions::default()
                };
                let weights = blend(&all, &options);
                for n in 1..all.len() {
                    let (first, next) = (&all[..n], all[n].diff);
                    let diffs = || first.iter().map(|c| c.diff);
                    if options.is_threshold_of_seen_within(diffs(), next) {
                        sufficed[kind] += 1;
                        assert_eq!(blend(first, &options), weights, "{round} {n} {options:?}");
                        let mut diffs: Vec<f64> = diffs().collect();
                        assert!(options.threshold_of_seen(&mut diffs) <= next, "{round} {n}");
                    }
                }
            }
        }
        assert!(sufficed.iter().all(|count| *count > 1_000), "{sufficed:?}");
    }
}
