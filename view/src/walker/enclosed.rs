//! Who came to be in something that stands on a table.

use super::Obstacles;
use super::squares::Squares;
use glam::DVec2;
use std::f64::consts::TAU;

/// Ways that are tried, in steps of so many radii of who walks, so many steps far.
const WAYS: u32 = 16;
const STEP: f64 = 0.5;
const STEPS: u32 = 8;
/// The first way is aslant to whatever was built along the axes: it does not pass through corners.
const FIRST_WAY: f64 = 0.1;

impl Obstacles {
    /// Whether who stands there has too little room, and no straight way leads to where there is
    /// enough: one flew there, or it is where a room is shown from.
    pub(super) fn is_enclosed(&self, squares: &Squares, at: DVec2) -> bool {
        let has_room = |at: DVec2| self.room(squares, at) >= 0.99 * self.radius;
        let leads_out = |way: u32| {
            let angle = FIRST_WAY + TAU * f64::from(way) / f64::from(WAYS);
            let step = STEP * self.radius * DVec2::from_angle(angle);
            let mut from = at;
            for _ in 0..STEPS {
                let next = from + step;
                if self.crosses(squares, [from, next]) {
                    return false;
                }
                if has_room(next) {
                    return true;
                }
                from = next;
            }
            false
        };
        !has_room(at) && !(0..WAYS).any(leads_out)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{middle, obstacles_of, place, wall_between};
    use super::*;
    use glam::DVec3;
    use proxy::interior::CellId;
    use proxy::mesh::Mesh;

    /// Where a walk of a metre ends, in frames of 2.5 cm.
    fn walked(obstacles: &Obstacles, eye: DVec3, angle: f64) -> DVec3 {
        let [x, y] = obstacles.axes;
        let motion = 0.025 * (angle.cos() * x + angle.sin() * y);
        (0..40).fold(eye, |at, _| obstacles.walk(Some(CellId(0)), at, motion))
    }

    #[test]
    fn who_is_in_a_bowl_on_a_table_walks_out_of_it() {
        let place = place();
        let obstacles = &place.obstacles;
        let [x, y] = obstacles.axes;
        let table = middle(place, CellId(0));
        for off in [[0.0, 0.0], [0.08, 0.02], [-0.05, 0.1], [-0.1, -0.07]] {
            let eye = table + off[0] * x + off[1] * y;
            let at = obstacles.seen_from_above(eye);
            assert!(
                obstacles.is_enclosed(&obstacles.floors[0].squares, at),
                "{off:?}"
            );
            for way in 0..8 {
                let angle = 0.05 + TAU * f64::from(way) / 8.0;
                let to = walked(obstacles, eye, angle);
                assert!(
                    to.distance(eye) > 0.3,
                    "{off:?}, {way}: {}",
                    to.distance(eye)
                );
            }
        }
    }

    /// Four sides of something 30 cm wide about the origin, from one height to another.
    fn tube([low, high]: [f64; 2]) -> Obstacles {
        obstacles_of(&[0.0], |up, [x, y]| {
            let corner = |i: usize, height: f64| {
                let [u, v] = [[-0.15, -0.15], [0.15, -0.15], [0.15, 0.15], [-0.15, 0.15]][i];
                u * x + v * y + height * up
            };
            let below = (0..4).map(|i| corner(i, low));
            let above = (0..4).map(|i| corner(i, high));
            let sides = (0..4_u32).flat_map(|i| {
                let next = (i + 1) % 4;
                [[i, next, next + 4], [i, next + 4, i + 4]]
            });
            Mesh {
                positions: below.chain(above).collect(),
                triangles: sides.collect(),
            }
        })
    }

    #[test]
    fn what_is_higher_than_what_stands_on_tables_lets_nobody_out() {
        for (heights, is_let_out) in [
            ([0.75, 0.9], true),
            ([0.75, 1.3], false),
            ([0.0, 2.0], false),
        ] {
            let obstacles = tube(heights);
            let [x, y] = obstacles.axes;
            let eye = 1.6 * obstacles.up + 0.04 * x + 0.03 * y;
            for way in 0..8 {
                let to = walked(&obstacles, eye, 0.3 + TAU * f64::from(way) / 8.0);
                let off = obstacles.seen_from_above(to).abs().max_element();
                assert_eq!(off > 0.3, is_let_out, "{heights:?}, {way}: {off}");
                assert_eq!(off > 0.15, is_let_out, "{heights:?}, {way}: {off}");
            }
        }
    }

    #[test]
    fn who_is_too_near_to_a_parapet_does_not_climb_it() {
        let obstacles = wall_between(5.0, [0.0, 0.95], &[0.0]);
        let [x, y] = obstacles.axes;
        // It lies along x + y.
        let off = (x - y).normalize();
        for near in [0.01, 0.1, 0.2] {
            let eye = 1.6 * obstacles.up + near * off;
            for angle in [2.0, 2.356, 3.0, 3.5] {
                let to = walked(&obstacles, eye, angle);
                assert!(to.dot(off) > 0.0, "{near}, {angle}: {}", to.dot(off));
            }
        }
    }
}
