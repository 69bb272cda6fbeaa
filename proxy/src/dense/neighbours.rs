//! Which photos to compare, and between which depths.

use super::small::SmallPhoto;
use crate::SparsePoint;
use calibrate::View;

/// Photos that each one is compared with, at most.
const NEIGHBOURS: usize = 5;
/// Angles at a point, radians, that tell depths best: below they tell little, beyond photos
/// look too unlike.
const LEAST_ANGLE: f64 = 0.06;
const MOST_ANGLE: f64 = 0.35;
/// Shares of a photo's points left out at either end, and how much wider than the rest the
/// range of depths is.
const OUTLIERS: f64 = 0.01;
const NEARER: f64 = 1.25;
const FARTHER: f64 = 0.6;

/// How well any two photos tell the depths of what both show.
pub(super) struct Affinity {
    /// A row for each view.
    scores: Vec<f64>,
    count: usize,
}

impl Affinity {
    /// Judged by the points that both observe.
    pub(super) fn new(views: &[View], sparse: &[SparsePoint]) -> Self {
        let count = views.len();
        let centers: Vec<_> = views.iter().map(View::center).collect();
        let mut scores = vec![0.0; count * count];
        for point in sparse {
            let seen = || point.seen_by.iter().map(|&i| i as usize);
            for i in seen() {
                let here = centers[i] - point.position;
                for j in seen().filter(|&j| j > i) {
                    let there = centers[j] - point.position;
                    let angle = here.cross(there).length().atan2(here.dot(there));
                    let good =
                        (angle / LEAST_ANGLE).min(1.0) * (MOST_ANGLE / angle).min(1.0).powi(2);
                    if good.is_finite() {
                        scores[i * count + j] += good;
                        scores[j * count + i] += good;
                    }
                }
            }
        }
        Self { scores, count }
    }

    /// For each view those it is best compared with, best first, of the usable ones.
    pub(super) fn neighbours(&self, usable: impl Fn(usize) -> bool) -> Vec<Vec<usize>> {
        let of = |i: usize| -> Vec<usize> {
            let row = &self.scores[i * self.count..][..self.count];
            let mut order: Vec<usize> = (0..self.count)
                .filter(|&j| row[j] > 0.0 && usable(j))
                .collect();
            order.sort_by(|&a, &b| row[b].total_cmp(&row[a]).then(a.cmp(&b)));
            order.truncate(NEIGHBOURS);
            order
        };
        (0..self.count).map(of).collect()
    }
}

/// The least and greatest inverse depth to try for each photo, from the points it sees.
pub(super) fn depth_ranges(
    photos: &[Option<SmallPhoto>],
    sparse: &[SparsePoint],
) -> Vec<Option<[f64; 2]>> {
    let mut seen: Vec<Vec<f64>> = vec![Vec::new(); photos.len()];
    for point in sparse {
        for &i in &point.seen_by {
            let Some(photo) = &photos[i as usize] else {
                continue;
            };
            if let Some((_, depth)) = photo.project(point.position) {
                seen[i as usize].push(1.0 / depth);
            }
        }
    }
    let range = |mut inverse: Vec<f64>| {
        inverse.retain(|v| v.is_finite() && *v > 0.0);
        inverse.sort_by(f64::total_cmp);
        let out = (inverse.len() as f64 * OUTLIERS) as usize;
        let (first, last) = (inverse.get(out)?, inverse.get(inverse.len() - 1 - out)?);
        Some([first * FARTHER, last * NEARER])
    };
    seen.into_iter().map(range).collect()
}
