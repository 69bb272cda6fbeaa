//! What the sparse points say about themselves through their neighbours.

use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::cmp::Ordering;
use std::num::NonZero;

/// How many neighbours decide whether a point stands alone.
const NEIGHBOURS: usize = 8;
/// A point is isolated when its neighbours are this many times farther away than they
/// are for the typical point. Sparse points thin out smoothly by factors of ten between
/// near and far; mismatches lie hundreds of spacings from anything.
const ISOLATION: f64 = 30.0;

/// Spacing and isolation of a point cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudStatistics {
    /// The median distance from a point to its nearest neighbour, in world units.
    pub spacing: f64,
    /// How many points stand alone.
    pub isolated: usize,
}

/// Measures a cloud; `None` with fewer than two finite points.
pub fn statistics(points_in_world: &[DVec3]) -> Option<CloudStatistics> {
    let neighbours = neighbours(points_in_world)?;
    let isolated = isolated(points_in_world, &neighbours);
    Some(CloudStatistics {
        spacing: median(neighbours.iter().map(|n| n.nearest).collect()),
        isolated: isolated.iter().filter(|&&b| b).count(),
    })
}

/// Which points stand alone: far from their neighbours by the cloud's own measure.
/// Points that are not finite always do. With fewer than three points none does.
pub fn isolated_points(points_in_world: &[DVec3]) -> Vec<bool> {
    let neighbours = neighbours(points_in_world).unwrap_or_default();
    isolated(points_in_world, &neighbours)
}

/// [`isolated_points`] by the finite points' neighbours.
fn isolated(points_in_world: &[DVec3], neighbours: &[Neighbours]) -> Vec<bool> {
    let mut isolated: Vec<bool> = points_in_world.iter().map(|p| !p.is_finite()).collect();
    if neighbours.len() < 3 {
        return isolated;
    }
    let limit = ISOLATION * median(neighbours.iter().map(|n| n.mean).collect());
    let finite = isolated.iter_mut().filter(|is_isolated| !**is_isolated);
    for (is_isolated, neighbours) in finite.zip(neighbours) {
        *is_isolated = neighbours.mean > limit;
    }
    isolated
}

/// How far a point is from the others, in world units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Neighbours {
    /// From the nearest.
    nearest: f64,
    /// From the [`NEIGHBOURS`] nearest, on average.
    mean: f64,
}

/// Those of each finite point, in order; `None` with fewer than two.
fn neighbours(points_in_world: &[DVec3]) -> Option<Vec<Neighbours>> {
    let finite: Vec<[f64; 3]> = points_in_world
        .iter()
        .filter(|p| p.is_finite())
        .map(DVec3::to_array)
        .collect();
    if finite.len() < 2 {
        return None;
    }
    let tree: ImmutableKdTree<f64, 3> = ImmutableKdTree::new_from_slice(&finite).ok()?;
    // One more than asked for: the nearest is the point itself.
    let wanted = NonZero::new(NEIGHBOURS.min(finite.len() - 1) + 1)?;
    let of_point = |&point_idx: &u32| {
        let found = tree
            .query(&finite[point_idx as usize])
            .nearest_n::<SquaredEuclidean<f64>>(wanted)
            .execute();
        let mean_of = |count: usize| {
            let found = &found[..found.len().min(count + 1)];
            let sum: f64 = found.iter().map(|item| item.distance.sqrt()).sum();
            sum / (found.len().max(2) - 1) as f64
        };
        Neighbours {
            nearest: mean_of(1),
            mean: mean_of(NEIGHBOURS),
        }
    };
    // Asked leaf by leaf, points find in the caches what those before them have looked at.
    let order: Vec<u32> = tree.iter().map(|(point_idx, _)| point_idx).collect();
    let found: Vec<Neighbours> = order.par_iter().map(of_point).collect();
    let mut neighbours = vec![Neighbours::default(); finite.len()];
    for (point_idx, found) in order.into_iter().zip(found) {
        neighbours[point_idx as usize] = found;
    }
    Some(neighbours)
}

/// The point of least summed distance, by Weiszfeld's iteration; a few of the points may be anywhere. Not finite
/// of none.
pub fn geometric_median(points: &[DVec3]) -> DVec3 {
    let mut at = points.iter().sum::<DVec3>() / points.len() as f64;
    if points.is_empty() {
        return at;
    }
    for _ in 0..50 {
        // Of most, as what is near is not to be told by what is farthest.
        let scale = median(points.iter().map(|p| p.distance(at)).collect());
        let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
        for p in points {
            let weight = 1.0 / p.distance(at).max(1e-6 * scale).max(f64::MIN_POSITIVE);
            sum += weight * *p;
            weights += weight;
        }
        let next = sum / weights;
        if !next.is_finite() {
            break;
        }
        at = next;
    }
    at
}

/// The [`geometric_median`], the same in whatever order points come; `None` without any.
pub(crate) fn middle(mut points: Vec<DVec3>) -> Option<DVec3> {
    points.sort_by(by_coordinates);
    // From one of them, so that far from the world's origin no digits are lost.
    let origin = *points.get(points.len() / 2)?;
    points.iter_mut().for_each(|p| *p -= origin);
    let place = origin + geometric_median(&points);
    Some(if place.is_finite() { place } else { origin })
}

/// By x, then by y, then by z.
pub(crate) fn by_coordinates(a: &DVec3, b: &DVec3) -> Ordering {
    let plan = a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y));
    plan.then(a.z.total_cmp(&b.z))
}

/// The middle value (the upper of two). The slice must not be empty.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice() -> Vec<DVec3> {
        let along = |n: usize| (0..n).map(|i| i as f64 * 0.5).collect::<Vec<_>>();
        let mut points = Vec::new();
        for x in along(6) {
            for y in along(6) {
                for z in along(6) {
                    points.push(DVec3::new(x, y, z));
                }
            }
        }
        points
    }

    #[test]
    fn the_geometric_median_is_where_most_are_and_turns_with_them() {
        let mut points: Vec<DVec3> = lattice().iter().map(|p| *p - DVec3::splat(1.25)).collect();
        assert!(geometric_median(&points).length() < 1e-9);
        for far in [1e3, 1e7, 1e14] {
            points.push(far * DVec3::new(1.0, -0.3, 0.2));
            let median = geometric_median(&points);
            assert!(median.length() < 0.1, "{far:e}: {median}");
        }
        let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 2.1, -0.4, 0.9);
        points.truncate(100);
        let turned: Vec<DVec3> = points.iter().map(|p| turn * *p).collect();
        let expected = turn * geometric_median(&points);
        assert!(geometric_median(&turned).distance(expected) < 1e-9);
        assert_eq!(geometric_median(&[DVec3::X; 9]), DVec3::X);
        assert!(!geometric_median(&[]).is_finite());
    }

    /// The mean distance from each point to its `count` nearest others.
    fn mean_distances(points: &[DVec3], count: usize) -> Vec<f64> {
        let of_point = |i: usize| {
            let others = (0..points.len()).filter(|&k| k != i);
            let mut distances: Vec<f64> = others.map(|k| points[k].distance(points[i])).collect();
            distances.sort_unstable_by(f64::total_cmp);
            distances.truncate(count);
            distances.iter().sum::<f64>() / distances.len() as f64
        };
        (0..points.len()).map(of_point).collect()
    }

    #[test]
    fn every_point_has_its_own_neighbours_in_the_order_of_the_points() {
        let fraction = |i: u32, factor: f64| (f64::from(i) * factor).fract();
        let point = |i: u32| {
            // Some where another is.
            let i = if i % 50 == 49 { i / 2 } else { i };
            DVec3::new(
                fraction(i, 0.754_877_666),
                3.0 * fraction(i, 0.569_840_291),
                1e3 * fraction(i * i, 0.618_033_989),
            )
        };
        for count in [2, 3, 8, 9, 10, 1500] {
            let finite: Vec<DVec3> = (0..count).map(point).collect();
            let mut points = finite.clone();
            points.insert(1, DVec3::NAN);
            points.push(DVec3::new(0.0, f64::INFINITY, 0.0));
            let found = neighbours(&points).unwrap();
            assert_eq!(found.len(), finite.len());
            let nearest = mean_distances(&finite, 1);
            let mean = mean_distances(&finite, NEIGHBOURS);
            for (i, found) in found.iter().enumerate() {
                let errors = [found.nearest - nearest[i], found.mean - mean[i]];
                assert!(
                    errors.iter().all(|error| error.abs() < 1e-9),
                    "{count} points, {i}: {found:?}, off by {errors:?}"
                );
            }
            let statistics = statistics(&points).unwrap();
            assert!((statistics.spacing - median(nearest)).abs() < 1e-9);
            let isolated = isolated_points(&points);
            assert_eq!(
                statistics.isolated,
                isolated.iter().filter(|b| **b).count(),
                "{count}"
            );
            assert!(isolated[1] && isolated[points.len() - 1]);
        }
        assert_eq!(neighbours(&[DVec3::ONE, DVec3::NAN]), None);
    }

    #[test]
    fn a_lattice_has_its_spacing_and_no_outliers() {
        let statistics = statistics(&lattice()).unwrap();
        assert_eq!(
            statistics,
            CloudStatistics {
                spacing: 0.5,
                isolated: 0
            }
        );
    }

    #[test]
    fn a_far_point_and_a_nan_stand_alone() {
        let mut points = lattice();
        points.insert(7, DVec3::splat(1e9));
        points.push(DVec3::new(f64::NAN, 0.0, 0.0));
        let isolated = isolated_points(&points);
        let found: Vec<usize> = (0..points.len()).filter(|&i| isolated[i]).collect();
        assert_eq!(found, [7, points.len() - 1]);
    }

    #[test]
    fn many_points_in_one_place_are_no_trouble() {
        let points = vec![DVec3::ONE; 500];
        assert_eq!(statistics(&points).unwrap().spacing, 0.0);
        assert_eq!(isolated_points(&points), vec![false; 500]);
    }
}
