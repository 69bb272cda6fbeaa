//! Triangles and boxes (Akenine-Möller 2001, "Fast 3D triangle-box overlap testing").

use super::RoomBox;
use glam::DVec3;

/// How far apart what touches may seem, in shares of the box's size: due to rounding.
const ROUNDING: f64 = 1e-12;

/// Whether a triangle and a box share a point; touching is enough.
///
/// ```
/// use glam::DVec3;
/// use proxy::interior::{RoomBox, triangle_touches_box};
///
/// let room = RoomBox { min: DVec3::ZERO, max: DVec3::ONE };
/// // Its bounds overlap the box's; the triangle passes by the corner.
/// let passing = [[1.5, 0.6, 0.5], [0.6, 1.5, 0.5], [1.5, 1.5, 0.5]].map(DVec3::from_array);
/// assert!(!triangle_touches_box(passing, &room));
/// assert!(triangle_touches_box(passing.map(|p| p - DVec3::X * 0.1), &room));
/// ```
pub fn triangle_touches_box(corners: [DVec3; 3], room: &RoomBox) -> bool {
    // 1. The box's own axes, which decide most.
    let low = corners[0].min(corners[1]).min(corners[2]);
    let high = corners[0].max(corners[1]).max(corners[2]);
    if low.cmpgt(room.max).any() || high.cmplt(room.min).any() {
        return false;
    }
    let center = room.min.midpoint(room.max);
    let half = 0.5 * (room.max - room.min);
    let [a, b, c] = corners.map(|p| p - center);
    let sides = [b - a, c - b, a - c];
    let separates = |axis: DVec3| {
        let [p, q, r] = [a, b, c].map(|corner| corner.dot(axis));
        let reach = half.dot(axis.abs()) + ROUNDING * half.length() * axis.length();
        p.min(q).min(r) > reach || p.max(q).max(r) < -reach
    };
    // 2. The triangle's plane. 3. What is across both an edge of one and an edge of the other.
    let across = |side: DVec3| DVec3::AXES.map(|axis| axis.cross(side));
    !separates(sides[0].cross(sides[1])) && !sides.into_iter().flat_map(across).any(separates)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = DVec3> {
        (-2.0..3.0, -2.0..3.0, -2.0..3.0).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    /// The part of a triangle within a box, by clipping it: the slow twin.
    fn is_any_left(corners: [DVec3; 3], room: &RoomBox) -> bool {
        let mut left = corners.to_vec();
        for k in 0..3 {
            for (sign, bound) in [(1.0, -room.min[k]), (-1.0, room.max[k])] {
                let height = |p: &DVec3| sign * p[k] + bound;
                let mut next = Vec::new();
                for (i, p) in left.iter().enumerate() {
                    let q = left[(i + 1) % left.len()];
                    let (hp, hq) = (height(p), height(&q));
                    if hp >= 0.0 {
                        next.push(*p);
                    }
                    if (hp < 0.0) != (hq < 0.0) {
                        next.push(p.lerp(q, hp / (hp - hq)));
                    }
                }
                left = next;
            }
        }
        !left.is_empty()
    }

    proptest! {
        #[test]
        fn a_triangle_touches_what_clipping_leaves_some_of(a in point(), b in point(), c in point()) {
            let room = RoomBox { min: DVec3::ZERO, max: DVec3::new(1.0, 0.5, 1.5) };
            prop_assert_eq!(triangle_touches_box([a, b, c], &room), is_any_left([a, b, c], &room));
        }
    }

    #[test]
    fn touching_is_enough_and_degenerate_triangles_are_fine() {
        let room = RoomBox {
            min: DVec3::ZERO,
            max: DVec3::ONE,
        };
        let on_side = [[1.0, 0.2, 0.2], [1.0, 0.8, 0.2], [2.0, 0.5, 0.5]].map(DVec3::from_array);
        assert!(triangle_touches_box(on_side, &room));
        assert!(triangle_touches_box([DVec3::ONE; 3], &room));
        assert!(!triangle_touches_box([DVec3::ONE * 1.1; 3], &room));
        let line = [DVec3::NEG_ONE, DVec3::ONE * 2.0, DVec3::ONE * 2.0];
        assert!(triangle_touches_box(line, &room));
    }
}
