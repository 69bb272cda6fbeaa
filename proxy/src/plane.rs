use glam::DVec3;

/// An infinite plane in the world.
///
/// It is held by a point and a normal rather than a normal and an offset: far from the
/// world's origin (UTM metres, say) the offset would round away the digits that matter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    point: DVec3,
    normal: DVec3,
}

/// What does not make a plane.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PlaneError {
    /// A coordinate is NaN or infinite.
    #[error("the plane's point {0} or normal {1} is not finite")]
    NotFinite(DVec3, DVec3),
    /// The normal has no direction.
    #[error("the plane's normal is zero; give a direction such as 0,0,1")]
    ZeroNormal,
    /// Three points on a line, or in one place.
    #[error("the points {0}, {1} and {2} lie on a line; move one of them off it")]
    Collinear(DVec3, DVec3, DVec3),
}

/// Three points whose height over their longest side is below this share of it lie on a
/// line: the digits of coordinates far from the origin tell no more.
const COLLINEAR: f64 = 1e-9;

impl Plane {
    /// The plane through `point` across `normal` (any length but zero).
    ///
    /// # Errors
    /// Numbers that are not finite; a zero normal.
    pub fn new(point: DVec3, normal: DVec3) -> Result<Self, PlaneError> {
        if !point.is_finite() || !normal.is_finite() {
            return Err(PlaneError::NotFinite(point, normal));
        }
        let largest = normal.abs().max_element();
        if largest == 0.0 {
            return Err(PlaneError::ZeroNormal);
        }
        Ok(Self {
            point,
            normal: (normal / largest).normalize(),
        })
    }

    /// The plane through three points. From the side to which its normal points they run
    /// counter-clockwise.
    ///
    /// # Errors
    /// Numbers that are not finite; points on a line.
    pub fn through(points_in_world: [DVec3; 3]) -> Result<Self, PlaneError> {
        let [a, b, c] = points_in_world;
        if let Some(odd) = points_in_world.into_iter().find(|p| !p.is_finite()) {
            return Err(PlaneError::NotFinite(odd, (b - a).cross(c - a)));
        }
        let longest = (b - a).length().max((c - b).length()).max((a - c).length());
        // Lengths relative to the longest side: squares of tiny ones vanish.
        let sides = [(b - a) / longest, (c - a) / longest];
        let unit = sides[0].cross(sides[1]);
        if !(unit.length() > COLLINEAR) {
            return Err(PlaneError::Collinear(a, b, c));
        }
        Self::new(a, unit)
    }

    /// A point on it, in the world.
    pub fn point(&self) -> DVec3 {
        self.point
    }

    /// Its unit normal, in the world.
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// The distance of a point from the plane, positive on the normal's side.
    pub fn signed_distance(&self, point_in_world: DVec3) -> f64 {
        self.normal.dot(point_in_world - self.point)
    }

    /// The vector q with which the plane looks simple from a viewer: along a ray v from
    /// there, the plane lies at p = viewer + v / s with **s = q · v**. Where s is
    /// positive the ray meets the plane, at s = 0 it runs parallel to it (the plane's
    /// horizon), below it never meets it.
    ///
    /// This stays finite right up to the horizon, where p itself does not. `None` where
    /// the viewer lies in the plane and sees it edge on.
    ///
    /// ```
    /// use glam::DVec3;
    /// let plane = proxy::Plane::new(DVec3::new(0.0, 0.0, 5.0), DVec3::Z).unwrap();
    /// let viewer = DVec3::new(0.0, 0.0, 1.0);
    /// let q = plane.inverse_distance_from(viewer).unwrap();
    /// let ray = DVec3::new(0.5, 0.0, 1.0);
    /// assert_eq!(viewer + ray / q.dot(ray), DVec3::new(2.0, 0.0, 5.0));
    /// ```
    pub fn inverse_distance_from(&self, viewer_in_world: DVec3) -> Option<DVec3> {
        let q = self.normal / -self.signed_distance(viewer_in_world);
        q.is_finite().then_some(q)
    }

    /// Where a ray meets the plane ahead of its origin.
    pub fn intersect(&self, origin_in_world: DVec3, direction_in_world: DVec3) -> Option<DVec3> {
        let s = self
            .inverse_distance_from(origin_in_world)?
            .dot(direction_in_world);
        let point = origin_in_world + direction_in_world / s;
        (s > 0.0 && point.is_finite()).then_some(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_meet_the_plane_from_both_sides_and_only_ahead() {
        let plane = Plane::new(DVec3::new(0.0, 0.0, 2.0), DVec3::new(0.0, 0.0, -7.0)).unwrap();
        let hit = plane
            .intersect(DVec3::ZERO, DVec3::new(1.0, 0.0, 2.0))
            .unwrap();
        assert!((hit - DVec3::new(1.0, 0.0, 2.0)).length() < 1e-15);
        let from_behind = plane
            .intersect(DVec3::new(0.0, 0.0, 4.0), DVec3::NEG_Z)
            .unwrap();
        assert!((from_behind - DVec3::new(0.0, 0.0, 2.0)).length() < 1e-15);
        assert_eq!(plane.intersect(DVec3::ZERO, DVec3::NEG_Z), None);
        assert_eq!(plane.intersect(DVec3::ZERO, DVec3::X), None, "parallel");
        assert_eq!(
            plane.intersect(DVec3::new(3.0, 1.0, 2.0), DVec3::X),
            None,
            "edge on"
        );
    }

    #[test]
    fn far_from_the_origin_no_digits_are_lost() {
        let shift = DVec3::new(5e5, 5.4e6, 300.0);
        let normal = DVec3::new(0.3, -0.4, 0.8);
        let near = Plane::new(DVec3::new(1.0, 2.0, 5.0), normal).unwrap();
        let far = Plane::new(near.point() + shift, normal).unwrap();
        let q_near = near.inverse_distance_from(DVec3::ZERO).unwrap();
        let q_far = far.inverse_distance_from(shift).unwrap();
        assert!((q_near - q_far).length() < 1e-9);
    }

    #[test]
    fn three_points_span_a_plane_unless_they_lie_on_a_line() {
        let shift = DVec3::new(5e5, 5.4e6, 300.0);
        let corners = [DVec3::ZERO, DVec3::X, DVec3::new(0.0, 2.0, 1.0)];
        for scale in [1e-6, 1.0, 1e6] {
            for shift in [DVec3::ZERO, shift * scale] {
                let points = corners.map(|p| p * scale + shift);
                let plane = Plane::through(points).unwrap();
                for point in points {
                    assert!(plane.signed_distance(point).abs() < 1e-8 * scale);
                }
                let normal = DVec3::new(0.0, -1.0, 2.0).normalize();
                assert!((plane.normal() - normal).length() < 1e-8, "{plane:?}");
            }
        }
        for on_a_line in [
            [DVec3::ZERO, DVec3::X, 3.0 * DVec3::X],
            [DVec3::ONE, DVec3::ONE, DVec3::X],
            [DVec3::ONE; 3],
        ] {
            let [a, b, c] = on_a_line;
            let error = Plane::through(on_a_line).unwrap_err();
            assert_eq!(error, PlaneError::Collinear(a, b, c));
        }
        for odd in [DVec3::NAN, DVec3::INFINITY] {
            assert!(Plane::through([DVec3::ZERO, DVec3::X, odd]).is_err());
        }
    }

    #[test]
    fn what_is_no_plane_is_refused() {
        assert_eq!(
            Plane::new(DVec3::ZERO, DVec3::ZERO),
            Err(PlaneError::ZeroNormal)
        );
        assert!(Plane::new(DVec3::NAN, DVec3::Z).is_err());
        // Normals too small to square are still directions.
        let tiny = Plane::new(DVec3::ZERO, DVec3::new(0.0, 0.0, 1e-200)).unwrap();
        assert_eq!(tiny.normal(), DVec3::Z);
    }
}
