//! Points split into two halves that lie in different places.

use crate::{outer, principal_axes};
use glam::{DMat3, DVec3};

/// Points are cut in two this often: 2⁶ blocks.
const CUTS: u32 = 6;
/// Places along a block's axis are told apart by so many steps from its mean to its farthest point: rounding, as of
/// a world whose origin is far away, does not decide which of two comes first.
const STEPS: f64 = (1 << 20) as f64;
/// A point is clearly to one side of its block's mean from this share of the farthest one's distance on.
const CLEAR: f64 = 1e-3;

/// Which half each point is in. The points are cut at their median along their principal axis
/// again and again; blocks go to the halves as the squares of a chessboard, so that
/// each half is everywhere and no point has its neighbours in the other. However the world is turned, moved or
/// scaled, halves are the same.
pub(super) fn halves(points: &[DVec3]) -> Vec<bool> {
    let mut half = vec![false; points.len()];
    let mut order: Vec<usize> = (0..points.len()).collect();
    cut(points, &mut order, CUTS, false, &mut half);
    half
}

fn cut(points: &[DVec3], block: &mut [usize], cuts: u32, side: bool, half: &mut [bool]) {
    if cuts == 0 || block.len() < 2 {
        for &i in &*block {
            half[i] = side;
        }
        return;
    }
    let places = along_principal_axis(points, block);
    for (slot, (_, i)) in block.iter_mut().zip(places) {
        *slot = i;
    }
    let (first, second) = block.split_at_mut(block.len() / 2);
    cut(points, first, cuts - 1, side, half);
    cut(points, second, cuts - 1, !side, half);
}

/// The points of a block and where they lie along its principal axis, in steps from its mean; in order, those at one
/// place by their indices. The axis points to the side of the first point that clearly lies on one.
fn along_principal_axis(points: &[DVec3], block: &[usize]) -> Vec<(i64, usize)> {
    let count = block.len() as f64;
    let mean: DVec3 = block.iter().map(|&i| points[i] / count).sum();
    let offsets = || block.iter().map(|&i| points[i] - mean);
    // In units of about the largest, squares of offsets are finite.
    let reach = offsets().fold(0.0_f64, |reach, d| reach.max(d.abs().max_element()));
    let mut spread = DMat3::ZERO;
    for offset in offsets() {
        spread += outer(offset / reach);
    }
    let [(_, axis), ..] = principal_axes(spread);
    let along: Vec<f64> = offsets().map(|d| axis.dot(d / reach)).collect();
    let farthest = along.iter().fold(0.0_f64, |far, t| far.max(t.abs()));
    let clear = block.iter().zip(&along);
    let clear = clear.filter(|(_, t)| t.abs() > CLEAR * farthest);
    let sign = clear
        .min_by_key(|(i, _)| **i)
        .map_or(1.0, |(_, t)| t.signum());
    // Where all are at one place all are at step zero, as NaN is.
    let step = |t: &f64| (t / farthest * sign * STEPS).round() as i64;
    let mut places: Vec<(i64, usize)> = along.iter().map(step).zip(block.iter().copied()).collect();
    places.sort_unstable();
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    /// Repeatable points in a box; every tenth where the one before is.
    fn cloud(count: u32) -> Vec<DVec3> {
        let value = |i: u32, salt: u32| {
            let h = (i ^ salt.wrapping_mul(0x9E37_79B1)).wrapping_mul(0x85EB_CA77);
            let h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
            f64::from(h ^ (h >> 12)) / f64::from(u32::MAX)
        };
        let point = |i: u32| {
            let i = if i % 10 == 9 { i - 1 } else { i };
            DVec3::new(3.0 * value(i, 1), 2.0 * value(i, 2), value(i, 3))
        };
        (0..count).map(point).collect()
    }

    #[test]
    fn the_world_s_axes_origin_and_unit_decide_nothing() {
        for count in [2, 3, 64, 500, 3000] {
            let points = cloud(count);
            let expected = halves(&points);
            let inside = expected.iter().filter(|half| **half).count() as f64;
            assert!(
                (inside / f64::from(count) - 0.5).abs() < 0.2,
                "{count}: {inside}"
            );
            for (axis, angle, scale, shift) in [
                (DVec3::X, 0.8, 1.0, DVec3::ZERO),
                (DVec3::Z, 90.0_f64.to_radians(), 1e-3, DVec3::ZERO),
                (
                    DVec3::new(1.0, 2.0, 3.0),
                    2.0,
                    7.0,
                    DVec3::new(5e5, 5e6, 100.0),
                ),
            ] {
                let turn = DQuat::from_axis_angle(axis.normalize(), angle);
                let moved = points.iter().map(|p| scale * (turn * *p) + shift);
                let moved: Vec<DVec3> = moved.collect();
                assert!(
                    halves(&moved) == expected,
                    "{count} points, {axis} by {angle}"
                );
            }
        }
    }

    #[test]
    fn halves_lie_in_different_places_and_each_is_everywhere() {
        let points = cloud(6400);
        let half = halves(&points);
        // Neighbours are of one block as a rule.
        let nearest = |i: usize| {
            let others = (0..points.len()).filter(|&k| k != i);
            let distance = |k: &usize| points[*k].distance_squared(points[i]);
            others
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))
                .unwrap()
        };
        let sample: Vec<usize> = (0..points.len()).step_by(16).collect();
        let alike = sample
            .iter()
            .filter(|i| half[nearest(**i)] == half[**i])
            .count();
        assert!(alike * 10 > sample.len() * 7, "{alike} of {}", sample.len());
        // In each eighth of space.
        for octant in 0..8 {
            let is_in = |p: &DVec3| {
                let above = [p.x > 1.5, p.y > 1.0, p.z > 0.5];
                (0..3).all(|k| above[k] == (octant >> k & 1 == 1))
            };
            let here = points.iter().zip(&half).filter(|(p, _)| is_in(p));
            let (count, inside) = here.fold((0, 0), |(n, m), (_, h)| (n + 1, m + usize::from(*h)));
            assert!(
                inside * 5 > count && inside * 5 < 4 * count,
                "{octant}: {inside} of {count}"
            );
        }
    }

    #[test]
    fn points_at_one_place_or_beyond_all_numbers_are_cut_by_index() {
        for place in [DVec3::ZERO, DVec3::new(5e5, 5e6, 0.1)] {
            let half = halves(&vec![place; 128]);
            let expected = (0..128_u32).map(|i| (i / 2).count_ones() % 2 == 1);
            assert!(half.into_iter().eq(expected), "{place}");
        }
        assert_eq!(halves(&[DVec3::MAX, DVec3::MIN, DVec3::ZERO]).len(), 3);
        assert_eq!(halves(&[]), [false; 0]);
    }
}
