//! The period of a scene that repeats, from photos of it that carry times: the temporal
//! calibration of Buehler et al. 2001, §5, Helicopter, without measuring anything.
//!
//! Photos a whole number of periods apart look alike, others do not. Two photos are
//! compared at the same places of the surface, and only with others taken from nearby, so
//! that what differs is time rather than viewpoint. For each candidate the pairs' differences,
//! less their mean over a period of lags around, are folded by their lags (phase dispersion
//! minimisation, Stellingwerf 1978, with lags in the place of times).

use glam::DVec3;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::ops::RangeInclusive;

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
    /// A multiple of the best explains clearly more, but of too few photos.
    #[error(
        "the photos show no clear period: the best, {best_s:.4} s, explains {:.0} % of how they \
         differ, and {longer_s:.4} s {:.0} %, but too few photos tell; give the period in seconds, \
         or take photos of more turns", 100.0 * explained, 100.0 * of_longer
    )]
    Multiple {
        /// The best candidate, in seconds.
        best_s: f64,
        /// What it explains.
        explained: f64,
        /// The multiple, in seconds.
        longer_s: f64,
        /// What that explains.
        of_longer: f64,
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
/// Candidates at most: as many as 5,000 photos at even steps have.
const MAX_CANDIDATES: usize = 20_000;
/// Times nearer than this part of the mean time from photo to photo are nearly the same: those of a rig's
/// cameras, or of a burst.
const NEARLY_AT_ONCE: f64 = 0.1;
/// Lags that differ by less than this part of the whole time are the same. Those of photos at even steps lie on borders
/// of bins, or half a period from others: rounding, which goes by when times are counted from, would deal them.
const SAME: f64 = 1.0 / (1 << 20) as f64;
/// Lags are rounded to this part of that, so that the same ones are in one order.
const ROUNDED: f64 = 1.0 / 16.0;
/// How often times are dealt at random: one chance in 20 of finding a period in nothing.
const DEALS: u64 = 19;
/// A period explains at least this much.
const MIN_EXPLAINED: f64 = 0.15;
/// Multiples of the best period that are asked, too: of what looks alike several times a turn, as a rotor's blades do,
/// a part of the turn explains something, and more pairs of photos are that far apart.
const MULTIPLES: RangeInclusive<u32> = 2..=4;
/// One explains clearly more that leaves less than this part of what the best leaves unexplained.
const CLEARER: f64 = 0.5;

/// Two photos.
struct Pair {
    photos: [usize; 2],
    /// How much they differ.
    difference: f64,
}

/// The period that best explains how the photos differ.
///
/// It lies between twice the typical time from photo to photo and half the whole time; the
/// order of the photos does not matter, nor when times are counted from. Photos taken nearly at
/// once count as one for what is typical. No more than 20,000 periods are tried, from the longest on at even steps of frequency:
/// of photos that follow each other very much more quickly than the whole time is long, the
/// shortest periods are left out.
///
/// # Errors
/// Too few photos; no period explains more than chance would; a multiple of the best would explain clearly more, if
/// more photos told of it.
///
/// # Panics
/// If the photos do not all list the same number of places.
pub fn find_period(snapshots: &[Snapshot]) -> Result<Period, PeriodError> {
    // 1. In an order of their own: that of time, and of what was taken at once, of colours and places.
    let mut sorted: Vec<&Snapshot> = snapshots.iter().collect();
    sorted.sort_by(|a, b| in_own_order(a, b));
    let times_s: Vec<f64> = sorted.iter().map(|s| s.time_s).collect();
    let Candidates {
        frequencies_hz: candidates,
        step_hz,
    } = candidates(&times_s)?;
    let same_s = SAME * (times_s[times_s.len() - 1] - times_s[0]);

    // 2. How photos from nearby differ.
    let pairs = near_pairs(&sorted);

    // 3. The best of all candidates, and of as many for times that mean nothing.
    let scores = |times_s: &[f64]| -> Vec<f64> {
        let lags = lags(&pairs, times_s, same_s);
        let explained = |&hz: &f64| explained(&lags, hz, MIN_IN_BIN);
        candidates.iter().map(explained).collect()
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
    let lags = lags(&pairs, &times_s, same_s);
    let found = refined(&lags, candidates[at], step_hz, MIN_IN_BIN);

    // 5. A multiple of it may not have filled all bins, and so have had no score.
    let is_clearer = |other: &Period| 1.0 - other.explained < CLEARER * (1.0 - found.explained);
    let longer = MULTIPLES
        .map(|times| 1.0 / (f64::from(times) * found.period_s))
        .filter(|hz| *hz >= candidates[0])
        .map(|hz| refined(&lags, hz, step_hz, 0))
        .max_by(|a, b| a.explained.total_cmp(&b.explained));
    let Some(longer) = longer.filter(is_clearer) else {
        return Ok(found);
    };
    let sure = refined(&lags, 1.0 / longer.period_s, step_hz, MIN_IN_BIN);
    if is_clearer(&sure) {
        return Ok(sure);
    }
    Err(PeriodError::Multiple {
        best_s: found.period_s,
        explained: found.explained,
        longer_s: longer.period_s,
        of_longer: longer.explained,
    })
}

/// By time, then by what else there is to tell them apart; what they show first, as that is the same in any world.
fn in_own_order(a: &Snapshot, b: &Snapshot) -> Ordering {
    let color = |color: &Option<[f32; 3]>| color.map(|c| c.map(|x| in_total_order(f64::from(x))));
    let by_color = || a.colors.iter().map(color).cmp(b.colors.iter().map(color));
    let along = |k: usize| a.center[k].total_cmp(&b.center[k]);
    let by_time = a.time_s.total_cmp(&b.time_s);
    let by_look = by_time.then_with(by_color);
    (0..3).fold(by_look, |order, k| order.then_with(|| along(k)))
}

/// The best of the periods around one over a frequency, to a step between candidates either way.
fn refined(lags: &Lags, hz: f64, step_hz: f64, least_in_bin: usize) -> Period {
    const FINE: i32 = 32;
    let fine = (-FINE..=FINE).map(|i| {
        let hz = hz + step_hz * f64::from(i) / f64::from(FINE);
        (hz, explained(lags, hz, least_in_bin))
    });
    let fine: Vec<(f64, f64)> = fine.collect();
    let top = fine.iter().map(|(_, score)| *score).fold(0.0, f64::max);
    // The middle of the top, which is flat where no pair changes its bin.
    let flat = fine.iter().filter(|(_, score)| *score >= 0.995 * top);
    let (sum, count) = flat.fold((0.0, 0.0), |(sum, n), (hz, _)| (sum + hz, n + 1.0));
    Period {
        period_s: count / sum,
        explained: top,
    }
}

/// One over the periods to try.
struct Candidates {
    /// From that of half the whole time on, rising.
    frequencies_hz: Vec<f64>,
    /// From one to the next.
    step_hz: f64,
}

/// Those for photos of these times, which rise.
fn candidates(times_s: &[f64]) -> Result<Candidates, PeriodError> {
    // 1. How long the photos took.
    let mut different_s = times_s.to_vec();
    different_s.dedup();
    let photos = different_s.len();
    if photos < MIN_PHOTOS {
        return Err(PeriodError::TooFew { photos });
    }
    let span_s = different_s[photos - 1] - different_s[0];
    let longest_s = 0.5 * span_s;

    // 2. From one to the next: the median says nothing where most come nearly at once with another.
    let apart_s = NEARLY_AT_ONCE * span_s / (photos - 1) as f64;
    different_s.dedup_by(|later, kept| *later - *kept < apart_s);
    let mut steps: Vec<f64> = different_s.windows(2).map(|t| t[1] - t[0]).collect();
    steps.sort_by(f64::total_cmp);
    let shortest_s = (2.0 * steps[steps.len() / 2]).min(longest_s);

    // 3. At even steps of frequency, the longest periods first.
    let step_hz = 1.0 / (OVERSAMPLING * span_s);
    // Of even steps a whole number, whatever rounding makes of it.
    let count = ((1.0 / shortest_s - 1.0 / longest_s) / step_hz * (1.0 + SAME)) as usize + 1;
    let frequency_hz = |i: usize| 1.0 / longest_s + step_hz * i as f64;
    Ok(Candidates {
        frequencies_hz: (0..count.min(MAX_CANDIDATES)).map(frequency_hz).collect(),
        step_hz,
    })
}

/// The pairs of photos taken from nearest each other, with how they differ.
fn near_pairs(snapshots: &[&Snapshot]) -> Vec<Pair> {
    let centers: Vec<DVec3> = snapshots.iter().map(|s| s.center).collect();
    let pairs = nearest(&centers).into_iter().filter_map(|[i, j]| {
        Some(Pair {
            photos: [i, j],
            difference: difference(snapshots[i], snapshots[j])?,
        })
    });
    pairs.collect()
}

/// The pairs of places nearest each other, the nearest first. No more than these are held at once: of
/// 10,000 photos all pairs would take gigabytes.
fn nearest(centers: &[DVec3]) -> Vec<[usize; 2]> {
    let count = centers.len();
    let all = count * count.saturating_sub(1) / 2;
    let kept = ((NEAR_PART * all as f64).ceil() as usize).min(MAX_PAIRS);
    let mut nearest: BinaryHeap<(i64, u64, [usize; 2])> = BinaryHeap::with_capacity(kept);
    for i in 0..count {
        for j in i + 1..count {
            let apart = centers[i].distance_squared(centers[j]);
            // A camera that stands still has ties: any of them, evenly.
            let tie = scramble((i * count + j) as u64);
            let pair = (in_total_order(apart), tie, [i, j]);
            if nearest.len() < kept {
                nearest.push(pair);
            } else if let Some(mut farthest) = nearest.peek_mut()
                && pair < *farthest
            {
                *farthest = pair;
            }
        }
    }
    let sorted = nearest.into_sorted_vec();
    sorted.into_iter().map(|(_, _, pair)| pair).collect()
}

/// Integers in the order of [`f64::total_cmp`].
fn in_total_order(value: f64) -> i64 {
    let bits = value.to_bits() as i64;
    // Of negative numbers the greater have the lesser bits.
    if bits < 0 { bits ^ i64::MAX } else { bits }
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
    /// By how many seconds lags may differ and be the same.
    same_s: f64,
}

fn lags(pairs: &[Pair], times_s: &[f64], same_s: f64) -> Lags {
    let step_s = ROUNDED * same_s;
    let lag = |pair: &Pair| {
        let [i, j] = pair.photos;
        let steps = ((times_s[i] - times_s[j]).abs() / step_s).round();
        (steps * step_s, pair.difference)
    };
    let mut pairs: Vec<(f64, f64)> = pairs.iter().map(lag).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut sums = vec![0.0];
    sums.extend(pairs.iter().scan(0.0, |sum, (_, difference)| {
        *sum += difference;
        Some(*sum)
    }));
    Lags {
        pairs,
        sums,
        same_s,
    }
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
///
/// Nothing where a bin has fewer than `least_in_bin` pairs, or all bins together too few.
fn explained(lags: &Lags, hz: f64, least_in_bin: usize) -> f64 {
    let half_s = 0.5 / hz;
    let same_s = lags.same_s;
    let longest_s = lags.pairs.last().map_or(0.0, |pair| pair.0);
    let mut bins = [(0.0, 0_usize); BINS];
    let mut squares = 0.0;
    let mut sum = 0.0;
    let (mut from, mut to) = (0, 0);
    for &(lag_s, difference) in &lags.pairs {
        if lag_s < half_s - same_s || lag_s + half_s > longest_s + same_s {
            continue;
        }
        while lags.pairs[from].0 < lag_s - half_s - same_s {
            from += 1;
        }
        while to < lags.pairs.len() && lags.pairs[to].0 <= lag_s + half_s + same_s {
            to += 1;
        }
        let off = difference - mean((lags.sums[to] - lags.sums[from], to - from));
        let turns = lag_s * hz;
        let apart = (turns - turns.round()).abs();
        let bin = ((2.0 * BINS as f64 * (apart + same_s * hz)) as usize).min(BINS - 1);
        bins[bin].0 += off;
        bins[bin].1 += 1;
        sum += difference;
        squares += difference * difference;
    }
    let all = bins
        .iter()
        .fold((0.0, 0), |all, bin| (all.0 + bin.0, all.1 + bin.1));
    if all.1 < BINS * MIN_IN_BIN || bins.iter().any(|(_, count)| *count < least_in_bin) {
        return 0.0;
    }
    let of_bins = |bins: &[Bin]| -> f64 { bins.iter().map(|bin| bin.0 * mean(*bin)).sum() };
    let between = of_bins(&ascending(&bins)) - of_bins(&[all]);
    (between / (squares - of_bins(&[(sum, all.1)]))).max(0.0)
}

/// Bins whose means ascend, of neighbours joined where they do not: isotonic regression by
/// pooling adjacent violators (Ayer et al. 1955). Those that are empty are left out.
fn ascending(bins: &[Bin]) -> Vec<Bin> {
    let mut joined: Vec<Bin> = Vec::new();
    for &next in bins.iter().filter(|bin| bin.1 > 0) {
        let mut next = next;
        while let Some(last) = joined.pop_if(|last| mean(*last) >= mean(next)) {
            next = (next.0 + last.0, next.1 + last.1);
        }
        joined.push(next);
    }
    joined
}

/// Pseudo-random numbers, the same everywhere: SplitMix64 (Steele et al. 2014).
pub(crate) fn scramble(index: u64) -> u64 {
    let z = index.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whole numbers in a small range, so that some are the same.
    fn some(seed: u64, range: u64) -> f64 {
        (scramble(seed + 1) % range) as f64
    }

    #[test]
    fn the_nearest_pairs_are_those_that_sorting_all_finds() {
        for (count, range) in [
            (0, 9),
            (1, 9),
            (2, 9),
            (20, 3),
            (20, 1000),
            (300, 20),
            (300, 1),
        ] {
            let center = |i: u64| DVec3::new(some(2 * i, range), some(2 * i + 1, range), 0.0);
            let mut centers: Vec<DVec3> = (0..count).map(center).collect();
            if count == 20 {
                centers[3] = DVec3::NAN;
                centers[7] = DVec3::INFINITY;
            }
            let count = centers.len();
            let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| [i, j]));
            let mut all: Vec<(f64, u64, [usize; 2])> = pairs
                .map(|[i, j]| {
                    let apart = centers[i].distance_squared(centers[j]);
                    (apart, scramble((i * count + j) as u64), [i, j])
                })
                .collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let kept = (NEAR_PART * all.len() as f64).ceil() as usize;
            all.truncate(kept.min(MAX_PAIRS));
            let plain: Vec<[usize; 2]> = all.into_iter().map(|(_, _, pair)| pair).collect();
            assert!(nearest(&centers) == plain, "{count} places, {range}");
        }
    }

    #[test]
    fn integers_stand_in_the_order_of_numbers() {
        let numbers = [
            f64::NAN,
            -f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            0.0,
            -0.0,
            1e-310,
            -1e-310,
            2.5,
            -2.5,
        ];
        for a in numbers {
            for b in numbers {
                let order = in_total_order(a).cmp(&in_total_order(b));
                assert_eq!(order, a.total_cmp(&b), "{a} {b}");
            }
        }
    }

    #[test]
    fn photos_nearly_at_once_and_quick_ones_ask_for_no_more_periods_than_can_be_tried() {
        let of = |times_s: &[f64]| candidates(times_s).unwrap();
        // 1. At even steps: from half the whole time to twice a step.
        let even: Vec<f64> = (0..600).map(|i| 0.1 * f64::from(i)).collect();
        let found = of(&even);
        let (first_hz, last_hz) = (
            found.frequencies_hz[0],
            *found.frequencies_hz.last().unwrap(),
        );
        assert!((1.0 / first_hz - 0.5 * 59.9).abs() < 1e-9);
        assert!((last_hz - 1.0 / 0.2).abs() < 1.001 * found.step_hz);
        // 2. A rig of two cameras, the second a little late, is no quicker than one.
        let rig = even.iter().flat_map(|&time_s| [time_s, time_s + 1e-4]);
        let of_rig = of(&rig.collect::<Vec<f64>>());
        let off = of_rig
            .frequencies_hz
            .len()
            .abs_diff(found.frequencies_hz.len());
        assert!(off < 10, "{off}");
        // 3. Ten thousand photos in a second, and one after a minute: these would ask for millions.
        let mut burst: Vec<f64> = (0..10_000).map(|i| 1e-4 * f64::from(i)).collect();
        burst.push(60.0);
        let found = of(&burst);
        assert_eq!(found.frequencies_hz.len(), MAX_CANDIDATES);
        assert!((1.0 / found.frequencies_hz[0] - 30.0).abs() < 1e-9);
    }
}
