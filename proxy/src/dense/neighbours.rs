//! Which photos to compare, and between which depths.

use super::small::SmallPhoto;
use crate::SparsePoint;
use calibrate::View;
use rayon::prelude::*;

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
        // 1. What each view observes, in the order of the points: so sums are the same on any number of
        // threads.
        let mut observed: Vec<Vec<usize>> = vec![Vec::new(); count];
        for (k, point) in sparse.iter().enumerate() {
            for &i in &point.seen_by {
                observed[i as usize].push(k);
            }
        }

        // 2. Each with those after it.
        let mut scores: Vec<f64> = vec![0.0; count * count];
        let rows = scores.par_chunks_mut(count.max(1)).zip(&observed);
        rows.enumerate().for_each(|(i, (row, observed))| {
            for point in observed.iter().map(|&k| &sparse[k]) {
                let here = centers[i] - point.position;
                let seen = point.seen_by.iter().map(|&j| j as usize);
                for j in seen.filter(|&j| j > i) {
                    let there = centers[j] - point.position;
                    let angle = here.cross(there).length().atan2(here.dot(there));
                    let good =
                        (angle / LEAST_ANGLE).min(1.0) * (MOST_ANGLE / angle).min(1.0).powi(2);
                    if good.is_finite() {
                        row[j] += good;
                    }
                }
            }
        });

        // 3. And these with it.
        for i in 0..count {
            for j in 0..i {
                scores[i * count + j] = scores[j * count + i];
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

/// The points, each seen by those of its photos alone that show it when they are made straight: of wide lenses
/// that is a part. What lies far aside has hardly any depth along the axis, and what nothing shows cannot be compared.
pub(super) fn shown(photos: &[Option<SmallPhoto>], sparse: &[SparsePoint]) -> Vec<SparsePoint> {
    let shown = |point: &SparsePoint| {
        let by = |i: &u32| {
            let photo = photos[*i as usize].as_ref()?;
            photo.index(photo.project(point.position)?.0)
        };
        let seen_by = point.seen_by.iter().copied();
        SparsePoint {
            position: point.position,
            seen_by: seen_by.filter(|i| by(i).is_some()).collect(),
        }
    };
    sparse.par_iter().map(shown).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Lens, Rigid3};
    use glam::{DVec2, DVec3};

    #[test]
    fn scores_are_the_sums_over_the_points_in_their_order() {
        const COUNT: usize = 12;
        let view = |i: usize| View {
            lens: Lens::pinhole(DVec2::splat(170.0), DVec2::new(96.0, 72.0)),
            width: 192,
            height: 144,
            camera_from_world: Rigid3::looking_at(
                DVec3::new(0.3 * i as f64, 0.1 * (i * i % 7) as f64, 0.0),
                DVec3::new(1.5, 0.0, 6.0),
                DVec3::Y,
            ),
        };
        let views: Vec<View> = (0..COUNT).map(view).collect();
        // As the tracks of some models have them: in any order, and a view twice.
        let point = |k: u32| SparsePoint {
            position: DVec3::new(0.05, 0.01, 4.0 / 99.0) * f64::from(k),
            seen_by: (0..2 + k % 9).map(|n| (k + 5 * n * n) % 12).collect(),
        };
        let points: Vec<SparsePoint> = (0..99).map(point).collect();
        let mut plain: Vec<f64> = vec![0.0; COUNT * COUNT];
        for point in &points {
            let seen = || point.seen_by.iter().map(|&i| i as usize);
            for i in seen() {
                for j in seen().filter(|&j| j > i) {
                    let [here, there] = [i, j].map(|i| views[i].center() - point.position);
                    let angle = here.cross(there).length().atan2(here.dot(there));
                    let good =
                        (angle / LEAST_ANGLE).min(1.0) * (MOST_ANGLE / angle).min(1.0).powi(2);
                    plain[i * COUNT + j] += good;
                    plain[j * COUNT + i] += good;
                }
            }
        }
        assert!(plain.iter().filter(|score| **score > 0.0).count() > 60);
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let affinity = pool.unwrap().install(|| Affinity::new(&views, &points));
            assert_eq!(affinity.scores, plain);
        }
    }
}
