use glam::{DMat3, DVec3};
use std::ops::AddAssign;

/// The sum of squared distances from planes, each with a weight (Garland and Heckbert 1997):
/// pᵀ A p + 2 bᵀ p + c.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Quadric {
    /// xx, yy, zz.
    diagonal: DVec3,
    /// yz, xz, xy.
    mixed: DVec3,
    linear: DVec3,
    constant: f64,
}

impl Quadric {
    /// Of the plane through `point` across a unit `normal`.
    pub(super) fn plane(normal: DVec3, point: DVec3, weight: f64) -> Self {
        let offset = -normal.dot(point);
        Self {
            diagonal: normal * normal * weight,
            mixed: DVec3::new(
                normal.y * normal.z,
                normal.x * normal.z,
                normal.x * normal.y,
            ) * weight,
            linear: normal * (offset * weight),
            constant: offset * offset * weight,
        }
    }

    fn matrix(&self) -> DMat3 {
        let (d, m) = (self.diagonal, self.mixed);
        DMat3::from_cols(
            DVec3::new(d.x, m.z, m.y),
            DVec3::new(m.z, d.y, m.x),
            DVec3::new(m.y, m.x, d.z),
        )
    }

    /// The sum at a point, never negative.
    pub(super) fn at(&self, point: DVec3) -> f64 {
        let quadratic = point.dot(self.matrix() * point) + 2.0 * self.linear.dot(point);
        (quadratic + self.constant).max(0.0)
    }

    /// The planes' weights added up.
    pub(super) fn weight(&self) -> f64 {
        self.diagonal.element_sum()
    }

    /// Where the sum is least, as near to `start` as planes leave open.
    pub(super) fn least_near(&self, start: DVec3) -> DVec3 {
        let matrix = self.matrix();
        let held = matrix + DMat3::from_diagonal(DVec3::splat(1e-3 * self.weight()));
        let step = held.inverse() * (matrix * start + self.linear);
        let found = start - step;
        if found.is_finite() { found } else { start }
    }
}

impl AddAssign for Quadric {
    fn add_assign(&mut self, other: Self) {
        self.diagonal += other.diagonal;
        self.mixed += other.mixed;
        self.linear += other.linear;
        self.constant += other.constant;
    }
}
