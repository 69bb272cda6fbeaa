//! The period of a scene that repeats, from photos of it that carry times: the temporal
//! calibration of Buehler et al. 2001, §5, Helicopter, without measuring anything.
//!
//! Photos a whole number of periods apart look alike, others do not. Two photos are
//! compared at the same places of the surface, and only with others taken from nearby, so
//! that what differs is time rather than viewpoint. For each candidate the pairs' differences,
//! less their mean over a period of lags around, are folded by their lags (phase dispersion
//! minimisation, Stellingwerf 1978, with lags in the place of times).

use glam::DVec3;

/// What one photo shows of places common to all.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// When it was taken, in seconds.
    pub time_s: f64,
    /// Where from, in the world.
    pub center: DVec3,
    /// The colour of each place (any unit); `None` where this photo does not see it.
    pub colors: Vec<Option<[f32; 3]>>,
}

/// A period that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Period {
    /// Seconds.
    pub period_s: f64,
    /// The part of the differences between photos that it explains, 0 to 1.
    pub explained: f64,
}

/// Why no period was found.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PeriodError {
    /// Too little to compare.
    #[error(
        "no period can be found among {photos} photos with different times; at least \
         {MIN_PHOTOS} are needed: give the period in seconds"
    )]
    TooFew {
        /// How many different times there are.
        photos: usize,
    },
    /// Nothing repeats, or not clearly.
    #[error(
        "the photos show no clear period: the best, {best_s:.4} s, explains {:.0} % of how they \
         differ, and times dealt at random up to {:.0} %; give the period in seconds, or check \
         the photos' times", 100.0 * explained, 100.0 * chance
    )]
    Unclear {
        /// The best candidate, in seconds.
        best_s: f64,
        /// What it explains.
        explained: f64,
        /// The most that any period explained of times dealt at random.
        chance: f64,
    },
}

/// Different times needed.
pub const MIN_PHOTOS: usize = 12;
/// Pairs of photos compared, at most, and as a part of all there are: the nearest.
const MAX_PAIRS: usize = 8000;
const NEAR_PART: f64 = 0.25;
/// Bins of half a period's lags.
const BINS: usize = 8;
/// Pairs that each bin must hold.
const MIN_IN_BIN: usize = 4;
/// Candidates for each step in which lags over the whole capture shift by a period.
const OVERSAMPLING: f64 = 8.0;
/// How often times are dealt at random: one chance in 20 of finding a period in nothing.
const DEALS: u64 = 19;
/// A period explains at least this much.
const MIN_EXPLAINED: f64 = 0.15;

/// Two photos.
struct Pair {
    photos: [usize; 2],
    /// How much they differ.
    difference: f64,
}

/// The period that best explains how the photos differ.
///
/// It lies between twice the typical time from photo to photo and half the whole time; the
/// order of the photos does not matter.
///
/// # Errors
/// Too few photos; no period explains more than chance would.
///
/// # Panics
/// If the photos do not all list the same number of places.
pub fn find_period(snapshots: &[Snapshot]) -> Result<Period, PeriodError> {
    // 1. In an order of their own: that of time.
    let mut sorted: Vec<&Snapshot> = snapshots.iter().collect();
    sorted.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    let times_s: Vec<f64> = sorted.iter().map(|s| s.time_s).collect();
    let mut steps: Vec<f64> = times_s.windows(2).map(|t| t[1] - t[0]).collect();
    steps.retain(|step| *step > 0.0);
    if steps.len() + 1 < MIN_PHOTOS {
        let photos = steps.len() + usize::from(!times_s.is_empty());
        return Err(PeriodError::TooFew { photos });
    }
    steps.sort_by(f64::total_cmp);
    let span_s = times_s[times_s.len() - 1] - times_s[0];
    let longest_s = 0.5 * span_s;
    let shortest_s = (2.0 * steps[steps.len() / 2]).min(longest_s);

    // 2. How photos from nearby differ.
    let pairs = near_pairs(&sorted);

    // 3. The best of all candidates, and of as many for times that mean nothing.
    let step_hz = 1.0 / (OVERSAMPLING * span_s);
    let count = ((1.0 / shortest_s - 1.0 / longest_s) / step_hz) as usize + 1;
    let candidates: Vec<f64> = (0..count)
        .map(|i| 1.0 / longest_s + step_hz * i as f64)
        .collect();
    let scores = |times_s: &[f64]| -> Vec<f64> {
        let lags = lags(&pairs, times_s);
        candidates.iter().map(|&hz| explained(&lags, hz)).collect()
    };
    let own = scores(&times_s);
    let largest = |scores: &[f64]| scores.iter().copied().fold(0.0, f64::max);
    let best = largest(&own);
    let chance = (1..=DEALS).map(|deal| {
        let mut dealt = times_s.clone();
        for i in (1..dealt.len()).rev() {
            dealt.swap(
                i,
                (scramble(deal << 32 | i as u64) % (i as u64 + 1)) as usize,
            );
        }
        largest(&scores(&dealt))
    });
    let chance = chance.fold(0.0, f64::max);
    let at = own.iter().position(|&score| score == best).unwrap_or(0);
    if best <= chance.max(MIN_EXPLAINED) {
        return Err(PeriodError::Unclear {
            best_s: 1.0 / candidates[at],
            explained: best,
            chance,
        });
    }

    // 4. Between the candidates around it.
    const FINE: i32 = 32;
    let lags = lags(&pairs, &times_s);
    let fine = (-FINE..=FINE).map(|i| {
        let hz = candidates[at] + step_hz * f64::from(i) / f64::from(FINE);
        (hz, explained(&lags, hz))
    });
    let fine: Vec<(f64, f64)> = fine.collect();
    let top = fine.iter().map(|(_, score)| *score).fold(0.0, f64::max);
    // The middle of the top, which is flat where no pair changes its bin.
    let flat = fine.iter().filter(|(_, score)| *score >= 0.995 * top);
    let (sum, count) = flat.fold((0.0, 0.0), |(sum, n), (hz, _)| (sum + hz, n + 1.0));
    Ok(Period {
        period_s: count / sum,
        explained: top,
    })
}

/// The pairs of photos taken from nearest each other, with how they differ.
fn near_pairs(snapshots: &[&Snapshot]) -> Vec<Pair> {
    let count = snapshots.len();
    let all = (0..count).flat_map(|i| (i + 1..count).map(move |j| [i, j]));
    let mut near: Vec<(f64, u64, [usize; 2])> = all
        .map(|[i, j]| {
            let apart = snapshots[i].center.distance_squared(snapshots[j].center);
            // A camera that stands still has ties: any of them, evenly.
            (apart, scramble((i * count + j) as u64), [i, j])
        })
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let kept = (NEAR_PART * near.len() as f64).ceil() as usize;
    near.truncate(kept.min(MAX_PAIRS));
    let pairs = near.into_iter().filter_map(|(_, _, [i, j])| {
        Some(Pair {
            photos: [i, j],
            difference: difference(snapshots[i], snapshots[j])?,
        })
    });
    pairs.collect()
}

/// The logarithm of the mean squared difference over the places that both see, what all have
/// in common (exposure) taken off. `None` where they share too few.
fn difference(a: &Snapshot, b: &Snapshot) -> Option<f64> {
    const MIN_PLACES: usize = 16;
    assert_eq!(a.colors.len(), b.colors.len());
    let shared = || a.colors.iter().zip(&b.colors);
    let (mut sum, mut squares, mut count) = ([0.0; 3], 0.0, 0);
    for (a, b) in shared().filter_map(|(a, b)| Some(((*a)?, (*b)?))) {
        for c in 0..3 {
            let off = f64::from(a[c]) - f64::from(b[c]);
            sum[c] += off;
            squares += off * off;
        }
        count += 1;
    }
    let common: f64 = sum.iter().map(|s| s * s / f64::from(count)).sum();
    let mean = ((squares - common) / f64::from(count)).max(0.0);
    (count as usize >= MIN_PLACES).then(|| mean.max(f64::MIN_POSITIVE).ln())
}

/// Pairs in the order of their lags.
struct Lags {
    /// (Lag in seconds, difference).
    pairs: Vec<(f64, f64)>,
    /// The sum of the differences before each pair, and of all.
    sums: Vec<f64>,
}

fn lags(pairs: &[Pair], times_s: &[f64]) -> Lags {
    let lag = |pair: &Pair| {
        let [i, j] = pair.photos;
        ((times_s[i] - times_s[j]).abs(), pair.difference)
    };
    let mut pairs: Vec<(f64, f64)> = pairs.iter().map(lag).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut sums = vec![0.0];
    sums.extend(pairs.iter().scan(0.0, |sum, (_, difference)| {
        *sum += difference;
        Some(*sum)
    }));
    Lags { pairs, sums }
}

/// Some differences: their sum and how many they are.
type Bin = (f64, usize);

fn mean((sum, count): Bin) -> f64 {
    sum / count as f64
}

/// The part of the differences' variance that lags folded by a period explain, where photos
/// differ the more the further they are from a whole number of periods apart.
///
/// Without that order, periods of several turns explain as much as one turn does, and of
/// photos at even steps so do the aliases that deal the same lags in another order. From
/// each difference its mean over the period around its lag is taken off, or what changes
/// slowly would repeat, too; lags within half a period of the ends have no such mean.
fn explained(lags: &Lags, hz: f64) -> f64 {
    let half_s = 0.5 / hz;
    let longest_s = lags.pairs.last().map_or(0.0, |pair| pair.0);
    let mut bins = [(0.0, 0_usize); BINS];
    let mut squares = 0.0;
    let mut sum = 0.0;
    let (mut from, mut to) = (0, 0);
    for &(lag_s, difference) in &lags.pairs {
        if lag_s < half_s || lag_s + half_s > longest_s {
            continue;
        }
        while lags.pairs[from].0 < lag_s - half_s {
            from += 1;
        }
        while to < lags.pairs.len() && lags.pairs[to].0 <= lag_s + half_s {
            to += 1;
        }
        let off = difference - mean((lags.sums[to] - lags.sums[from], to - from));
        let turns = lag_s * hz;
        let apart = (turns - turns.round()).abs();
        let bin = ((2.0 * BINS as f64 * apart) as usize).min(BINS - 1);
        bins[bin].0 += off;
        bins[bin].1 += 1;
        sum += difference;
        squares += difference * difference;
    }
    if bins.iter().any(|(_, count)| *count < MIN_IN_BIN) {
        return 0.0;
    }
    let of_bins = |bins: &[Bin]| -> f64 { bins.iter().map(|bin| bin.0 * mean(*bin)).sum() };
    let all = bins
        .iter()
        .fold((0.0, 0), |all, bin| (all.0 + bin.0, all.1 + bin.1));
    let between = of_bins(&ascending(&bins)) - of_bins(&[all]);
    (between / (squares - of_bins(&[(sum, all.1)]))).max(0.0)
}

/// Bins whose means ascend, of neighbours joined where they do not: isotonic regression by
/// pooling adjacent violators (Ayer et al. 1955).
fn ascending(bins: &[Bin]) -> Vec<Bin> {
    let mut joined: Vec<Bin> = Vec::new();
    for &next in bins {
        let mut next = next;
        while let Some(last) = joined.pop_if(|last| mean(*last) >= mean(next)) {
            next = (next.0 + last.0, next.1 + last.1);
        }
        joined.push(next);
    }
    joined
}

/// Pseudo-random numbers, the same everywhere: SplitMix64 (Steele et al. 2014).
fn scramble(index: u64) -> u64 {
    let z = index.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
