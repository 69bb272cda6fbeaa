//! From observations to gains, and whether they mean anything.

use super::Observation;
use super::halves::halves;
use super::solve::Channel;
use glam::DVec3;
use rayon::prelude::*;

/// The gains of a photo set.
#[derive(Clone, Debug, PartialEq)]
pub struct Exposure {
    /// By photo: exposure of red, green and blue relative to the other photos. Their
    /// geometric mean is one over each group of photos that points link; a photo without
    /// points has one. All are one unless the verdict is [`Verdict::Matched`].
    pub gains: Vec<[f64; 3]>,
    /// Whether they differ.
    pub verdict: Verdict,
}

/// Whether the gains of a photo set differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// They do.
    Matched(Evidence),
    /// What differs may be chance, or is too little to be seen.
    NotMeasurable(Evidence),
    /// No two photos show a point in common that is whole (no matte or mask cuts into it) and neither too dark nor too
    /// bright, or all such points lie in one place.
    NoLinks,
}

/// How much gains differ, and how surely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence {
    /// Standard deviation of the photos' log gains without what is due to chance.
    pub spread: f64,
    /// Standard error of a log gain.
    pub error: f64,
    /// How many standard errors the spread is from chance.
    pub significance: f64,
}

/// Gains that spread less than this, as logarithms, are left alone: a step of 255 at mid
/// grey.
pub const MIN_SPREAD: f64 = 1.0 / 128.0;
/// A spread must be this many standard errors from chance.
const MIN_SIGNIFICANCE: f64 = 4.0;
/// Points near to each other err alike. On real captures the gains of half the points
/// differ from those of the other half as if this many points counted for one.
const CLUSTER: f64 = 10.0;
/// Half of the points may link a photo by a few false matches alone, which robust weights cut
/// off, or nearly: then its log gain could be anything. The prior that log gains are within
/// about one of zero holds it, and is nothing beside a single match.
const HALF_PRECISION: f64 = 1.0;

/// Estimates each photo's gains from what it and others show of the same points, whose
/// places in the world are `points_in_world`.
///
/// Whether they mean anything is asked of the points in two halves that lie in different
/// places (`halves`). Each is fitted by itself. What the two agree on, Σ a·b / n over n
/// photos, is the variance of the true gains; what they don't, Σ (a − b)² / 2n, that of
/// either's errors, whatever those are due to: noise, highlights, false matches. Photos with
/// few points in a half count for less in both (`shares`): one alone may be off by more than
/// all gains differ.
///
/// The fit to all points has the first as the prior variance of log gains around zero, so
/// that a photo with few points keeps a gain near one.
pub fn estimate(
    photo_count: usize,
    points_in_world: &[DVec3],
    observations: &[Observation],
) -> Exposure {
    let mut by_point: Vec<&Observation> = observations.iter().collect();
    by_point.sort_by_key(|o| (o.point_idx, o.photo_idx));
    let half = halves(points_in_world);
    let unmatched = |verdict| Exposure {
        gains: vec![[1.0; 3]; photo_count],
        verdict,
    };

    // 1. What the two halves agree on.
    let compared: Vec<Option<Agreement>> = (0..3)
        .into_par_iter()
        .map(|c| Agreement::new(photo_count, &by_point, c, &half))
        .collect();
    let compared: Vec<Agreement> = compared.into_iter().flatten().collect();
    let Some(evidence) = evidence(&compared) else {
        return unmatched(Verdict::NoLinks);
    };
    if evidence.spread < MIN_SPREAD || evidence.significance < MIN_SIGNIFICANCE {
        return unmatched(Verdict::NotMeasurable(evidence));
    }

    // 2. All points together.
    let variance = evidence.spread * evidence.spread;
    let log_gains: Vec<Vec<f64>> = (0..3)
        .into_par_iter()
        .map(|c| {
            let channel = Channel::new(photo_count, &by_point, c, |_| true);
            channel.fit(CLUSTER / variance, &vec![1.0; photo_count])
        })
        .collect();
    let gains = |i: usize| std::array::from_fn(|c| log_gains[c][i].exp());
    Exposure {
        gains: (0..photo_count).map(gains).collect(),
        verdict: Verdict::Matched(evidence),
    }
}

/// Two halves' gains of one channel, compared over the photos that both have.
struct Agreement {
    /// How many photos that count in full are worth as much.
    photos: f64,
    /// Σ a·b / n.
    covariance: f64,
    /// Σ (a − b)² / 2n.
    error_variance: f64,
}

impl Agreement {
    fn new(photo_count: usize, by_point: &[&Observation], c: usize, half: &[bool]) -> Option<Self> {
        let channel = |side: bool| Channel::new(photo_count, by_point, c, |p| half[p] == side);
        let (first, second) = rayon::join(|| channel(false), || channel(true));
        let shares = shares(&first.counts(), &second.counts());
        if shares.iter().filter(|share| **share > 0.0).count() < 2 {
            return None;
        }
        let fit = |half: &Channel| half.fit(HALF_PRECISION, &shares);
        let (a, b) = rayon::join(|| fit(&first), || fit(&second));
        let total: f64 = shares.iter().sum();
        let mean = |value: &dyn Fn(usize) -> f64| {
            (0..photo_count).map(|i| shares[i] * value(i)).sum::<f64>() / total
        };
        Some(Self {
            photos: total / mean(&|i| shares[i]),
            covariance: mean(&|i| a[i] * b[i]),
            error_variance: mean(&|i| 0.5 * (a[i] - b[i]).powi(2)),
        })
        .filter(|found| found.covariance.is_finite() && found.error_variance.is_finite())
    }
}

/// What each photo counts for where the halves' gains are compared, by how many observations
/// it has in each. Below [`CLUSTER`] it has not even one independent one: the fewer, n, the
/// further it errs, a·b with a variance of 1/n², and it counts for the inverse. All others
/// count alike, as their gains differ by more than they err.
fn shares(in_first: &[usize], in_second: &[usize]) -> Vec<f64> {
    let fewer = in_first.iter().zip(in_second).map(|(a, b)| *a.min(b));
    fewer
        .map(|n| (n as f64 / CLUSTER).min(1.0).powi(2))
        .collect()
}

/// The channels together. Were all gains one, a·b would have the mean 0 and the variance
/// of either's errors squared. The channels share most of their errors, so they count as
/// one.
fn evidence(channels: &[Agreement]) -> Option<Evidence> {
    let mean = |value: fn(&Agreement) -> f64| {
        channels.iter().map(value).sum::<f64>() / channels.len() as f64
    };
    if channels.is_empty() {
        return None;
    }
    let covariance = mean(|a| a.covariance);
    let error_variance = mean(|a| a.error_variance);
    let by_chance = error_variance / mean(|a| a.photos).sqrt();
    Some(Evidence {
        spread: covariance.max(0.0).sqrt(),
        // Both halves together have half the variance of one.
        error: (0.5 * error_variance).sqrt(),
        significance: if covariance > 0.0 {
            covariance / by_chance
        } else {
            0.0
        },
    })
}
