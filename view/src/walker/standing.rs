//! Where in a room one can stand.

use super::{Obstacles, RADIUS, nearest_on};
use glam::{DVec2, DVec3};
use proxy::interior::{CellId, Contents, Interior};
use proxy::mesh::Model;
use std::f64::consts::TAU;

/// What is in the way of who stands, in eye heights over the floor: what is lower is a rug or a
/// threshold. Tables are walked through, but one does not begin in one.
const BAND: [f64; 2] = [0.1, 1.0];
/// Places are tried on rings so far apart, in radii of who walks; so many on each.
const APART: f64 = 0.5;
const ON_RING: u32 = 12;
/// The last ring, in eye heights: 2 m from the first place.
const FARTHEST: f64 = 1.25;

impl Obstacles {
    /// The place nearest to `eye` in a cell, as high as that, where one can stand: within who walks'
    /// radius is nothing of the cell that reaches into the band between a threshold and the eyes.
    /// `None` where there is none within 1.25 eye heights.
    pub(crate) fn standing_near(
        &self,
        interior: &Interior,
        contents: &Contents,
        model: &Model,
        cell: CellId,
        eye: DVec3,
    ) -> Option<DVec3> {
        let floor = self.height_of(Some(cell))?;
        let [low, high] = BAND.map(|height| floor + height * self.eye_height);
        let middle = self.seen_from_above(eye);
        // 1. What may be in the way.
        let reach = FARTHEST * self.eye_height + self.radius;
        let triangles = contents.triangles.get(cell.0 as usize)?;
        let in_way = triangles.iter().filter_map(|i| {
            let corners = model.mesh.corners(*i as usize);
            let heights = corners.map(|p| p.dot(self.up));
            if !heights.iter().any(|h| *h > low) || !heights.iter().any(|h| *h < high) {
                return None;
            }
            let above = Above::new(corners.map(|p| self.seen_from_above(p)));
            above.is_within(reach, middle).then_some(above)
        });
        let in_way: Vec<Above> = in_way.collect();
        // 2. From the middle outwards.
        let rings = (FARTHEST / (APART * RADIUS)) as u32;
        let mut places = (0..=rings).flat_map(|ring| {
            let off = f64::from(ring) * APART * self.radius;
            let count = if ring == 0 { 1 } else { ON_RING };
            (0..count).map(move |i| off * DVec2::from_angle(TAU * f64::from(i) / f64::from(count)))
        });
        places.find_map(|off| {
            let at = middle + off;
            if in_way.iter().any(|above| above.is_within(self.radius, at)) {
                return None;
            }
            let place = eye + self.axes[0] * off.x + self.axes[1] * off.y;
            (contents.locate(interior, place) == Some(cell)).then_some(place)
        })
    }
}

/// A triangle seen from above.
struct Above {
    corners: [DVec2; 3],
    min: DVec2,
    max: DVec2,
}

impl Above {
    fn new(corners: [DVec2; 3]) -> Self {
        let [a, b, c] = corners;
        Self {
            corners,
            min: a.min(b).min(c),
            max: a.max(b).max(c),
        }
    }

    /// Whether any of it is nearer to a point than `reach`.
    fn is_within(&self, reach: f64, point: DVec2) -> bool {
        let reaches = DVec2::splat(reach);
        let is_beside =
            point.cmpgt(self.min - reaches).all() && point.cmplt(self.max + reaches).all();
        if !is_beside {
            return false;
        }
        let [a, b, c] = self.corners;
        let edges = [[a, b], [b, c], [c, a]];
        let sides = edges.map(|[p, q]| (q - p).perp_dot(point - p));
        let is_over = sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0);
        is_over
            || edges
                .map(|ends| nearest_on(ends, point))
                .iter()
                .any(|p| p.distance(point) < reach)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{middle, place};
    use super::*;

    #[test]
    fn one_stands_beside_the_table_and_where_nothing_is() {
        let place = place();
        let obstacles = &place.obstacles;
        let near = |cell, eye| {
            obstacles.standing_near(&place.interior, &place.contents, &place.model, cell, eye)
        };
        // A table of 1.50 m by 0.85 m is in the middle of this room.
        let over_table = middle(place, CellId(0));
        let beside = near(CellId(0), over_table).unwrap();
        let off = beside - over_table;
        assert!((0.6..1.25).contains(&off.length()), "{off}");
        assert_eq!(off.dot(obstacles.up), 0.0);
        assert_eq!(
            place.contents.locate(&place.interior, beside),
            Some(CellId(0))
        );
        // Who stands stays.
        assert_eq!(near(CellId(0), beside), Some(beside));
        // Far from the room, and in none.
        let away = over_table + 100.0 * obstacles.axes[0];
        assert_eq!(near(CellId(0), away), None);
        assert_eq!(near(CellId(99), over_table), None);
    }

    #[test]
    fn a_triangle_is_near_where_it_lies_and_upright_ones_along_a_line() {
        let [a, b, c] = [DVec2::ZERO, DVec2::new(4.0, 0.0), DVec2::new(0.0, 4.0)];
        let flat = Above::new([a, b, c]);
        assert!(flat.is_within(0.1, DVec2::splat(1.0)), "over it");
        assert!(flat.is_within(0.1, DVec2::splat(2.05)));
        assert!(!flat.is_within(0.1, DVec2::splat(2.1)));
        assert!(!flat.is_within(0.1, DVec2::new(-0.2, 1.0)));
        let upright = Above::new([a, b, 0.5 * b]);
        assert!(upright.is_within(0.1, DVec2::new(3.0, 0.05)));
        assert!(!upright.is_within(0.1, DVec2::new(3.0, 0.2)));
        let broken = Above::new([a, b, DVec2::NAN]);
        assert!(!broken.is_within(0.1, DVec2::new(1.0, 5.0)));
    }
}
