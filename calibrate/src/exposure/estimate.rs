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
    /// No two photos show a point in common that is neither too dark nor too bright, or
    /// all such points lie in one place.
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

/// Estimates each photo's gains from what it and others show of the same points, whose
/// places in the world are `points_in_world`.
///
/// Whether they mean anything is asked of the points in two halves that lie in different
/// places (`halves`). Each is fitted by itself. What the two agree on, Σ a·b / n over n
/// photos, is the variance of the true gains; what they don't, Σ (a − b)² / 2n, that of
/// either's errors, whatever those are due to: noise, highlights, false matches.
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
        .map(|c| Channel::new(photo_count, &by_point, c, |_| true).fit(CLUSTER / variance))
        .collect();
    let gains = |i: usize| std::array::from_fn(|c| log_gains[c][i].exp());
    Exposure {
        gains: (0..photo_count).map(gains).collect(),
        verdict: Verdict::Matched(evidence),
    }
}

/// Two halves' gains of one channel, compared over the photos that both have.
struct Agreement {
    photos: f64,
    /// Σ a·b / n.
    covariance: f64,
    /// Σ (a − b)² / 2n.
    error_variance: f64,
}

impl Agreement {
    fn new(photo_count: usize, by_point: &[&Observation], c: usize, half: &[bool]) -> Option<Self> {
        let channel = |side: bool| Channel::new(photo_count, by_point, c, |p| half[p] == side);
        let (first, second) = (channel(false), channel(true));
        let (a, b) = (first.fit(0.0), second.fit(0.0));
        let (in_first, in_second) = (first.linked(), second.linked());
        let in_both: Vec<usize> = (0..photo_count)
            .filter(|&i| in_first[i] && in_second[i])
            .collect();
        if in_both.len() < 2 {
            return None;
        }
        let photos = in_both.len() as f64;
        let mean =
            |value: &dyn Fn(usize) -> f64| in_both.iter().map(|&i| value(i)).sum::<f64>() / photos;
        Some(Self {
            photos,
            covariance: mean(&|i| a[i] * b[i]),
            error_variance: mean(&|i| 0.5 * (a[i] - b[i]).powi(2)),
        })
    }
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
