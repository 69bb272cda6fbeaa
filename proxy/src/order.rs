//! Points in an order of their own: what is fitted to some of them, picked by their places in a list, does not depend
//! on how a file lists them.

use crate::cloud::{by_coordinates, median, middle};
use glam::DVec3;

/// Distances are told apart by so many steps of the typical one: rounding, as of a world whose origin is far away,
/// hardly ever decides which of two points comes first.
const STEPS: f64 = (1 << 30) as f64;

/// Finite points, those nearest to their middle first. The same to the bit in whatever order they come, so that what
/// is added up over them is, too; and however the world is turned, moved or scaled, but that the coordinates decide
/// between points that are equally far from the middle.
pub(crate) fn in_own_order(points: &[DVec3]) -> Vec<DVec3> {
    let Some(middle) = middle(points.to_vec()) else {
        return Vec::new();
    };
    let distances: Vec<f64> = points.iter().map(|p| p.distance(middle)).collect();
    let typical = median(distances.clone());
    // Where most are at one place they are at step zero, as NaN is, and all others at the last.
    let step = |distance: f64| (distance / typical * STEPS).round() as i64;
    let steps = distances.into_iter().map(step);
    let mut ordered: Vec<(i64, DVec3)> = steps.zip(points.iter().copied()).collect();
    ordered.sort_unstable_by(|a, b| a.0.cmp(&b.0).then_with(|| by_coordinates(&a.1, &b.1)));
    ordered.into_iter().map(|(_, point)| point).collect()
}

/// At most `most` of points that stand in their [own order](in_own_order), spread over it.
pub(crate) fn spread_over(ordered: &[DVec3], most: usize) -> Vec<DVec3> {
    let stride = ordered.len().div_ceil(most).max(1);
    // One of each stride, but not always the first: where points lie evenly as many may be equally far from the
    // middle, and the first of those would always be the same corner.
    let pick = |(i, some): (usize, &[DVec3])| some[i % some.len()];
    ordered.chunks(stride).enumerate().map(pick).collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use glam::DQuat;

    /// The same points in other orders: backwards, with the last one first, and dealt.
    pub(crate) fn in_other_orders(points: &[DVec3]) -> [Vec<DVec3>; 3] {
        let backwards = points.iter().rev().copied().collect();
        let mut last_first = points.to_vec();
        last_first.rotate_right(1);
        // A prime: each comes once, unless they are a multiple of as many.
        let dealt = (0..points.len()).map(|i| points[i * 7919 % points.len()]);
        [backwards, last_first, dealt.collect()]
    }

    /// Repeatable points in a box, a few of them at one place and one far away.
    fn cloud(count: u32) -> Vec<DVec3> {
        let part = |i: u32, factor: f64| (f64::from(i) * factor).fract();
        let point = |i: u32| {
            DVec3::new(
                3.0 * part(i, 0.754_877_666),
                2.0 * part(i, 0.569_840_291),
                part(i * i, 0.618_033_989),
            )
        };
        let mut points: Vec<DVec3> = (0..count).map(point).collect();
        points[7] = points[3];
        points[5] = DVec3::new(1e4, -3e4, 2e4);
        points
    }

    #[test]
    fn the_order_that_points_come_in_changes_nothing() {
        for count in [8, 500] {
            let points = cloud(count);
            let expected = in_own_order(&points);
            assert_eq!(expected.len(), points.len());
            for other in in_other_orders(&points) {
                assert!(other != points, "{count}");
                assert!(in_own_order(&other) == expected, "{count}");
            }
        }
    }

    #[test]
    fn the_world_s_axes_origin_and_unit_change_nothing() {
        let points = cloud(500);
        let expected = in_own_order(&points);
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
            let place = |p: &DVec3| scale * (turn * *p) + shift;
            let moved: Vec<DVec3> = points.iter().map(place).collect();
            for (there, here) in in_own_order(&moved).iter().zip(&expected) {
                let off = there.distance(place(here));
                assert!(off < 1e-6 * scale, "{axis} by {angle}: {there} {here}");
            }
        }
    }

    #[test]
    fn some_are_spread_over_all_even_of_a_lattice() {
        // Eight corners, or a multiple of them, are equally far from the middle; one in eight is picked.
        let along = || (0..20).map(|i| f64::from(i) - 9.5);
        let row = |x: f64, y: f64| along().map(move |z| DVec3::new(x, y, z));
        let square = |x: f64| along().flat_map(move |y| row(x, y));
        let lattice: Vec<DVec3> = along().flat_map(square).collect();
        let few = spread_over(&in_own_order(&lattice), 1000);
        assert_eq!(few.len(), 1000);
        for octant in 0..8 {
            let is_in = |p: &&DVec3| (0..3).all(|k| (p[k] > 0.0) == (octant >> k & 1 == 1));
            let count = few.iter().filter(is_in).count();
            assert!((60..250).contains(&count), "{octant}: {count}");
        }
        assert_eq!(spread_over(&lattice[..9], 9), lattice[..9]);
        assert_eq!(spread_over(&lattice[..9], 4).len(), 3);
        assert!(spread_over(&[], 4).is_empty());
    }

    #[test]
    fn points_without_extent_or_beyond_all_numbers_are_all_there() {
        assert!(in_own_order(&[]).is_empty());
        assert_eq!(in_own_order(&[DVec3::ONE; 5]), [DVec3::ONE; 5]);
        let odd = [DVec3::MAX, DVec3::ZERO, DVec3::MIN, DVec3::ZERO, DVec3::Y];
        assert_eq!(in_own_order(&odd).len(), odd.len());
    }
}
