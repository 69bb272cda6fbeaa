//! Points as whole numbers, so that every predicate about them is exact.

use glam::{DMat3, DVec3};

/// Bits an axis. With 24 the in-sphere determinant stays below 2^126 and fits an `i128`.
pub(super) const BITS: u32 = 24;

/// A place on the lattice; each coordinate lies in 0..2^[`BITS`].
pub(super) type Site = [i32; 3];

/// A cube of lattice places around a ball of the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lattice {
    center_in_world: DVec3,
    /// A rotation.
    lattice_from_world: DMat3,
    step: f64,
}

impl Lattice {
    /// The lattice along these axes, the columns of a rotation, whose cube just holds the ball.
    pub(super) fn around(center_in_world: DVec3, radius: f64, axes_in_world: DMat3) -> Self {
        // One place is left free on each side, for rounding.
        Self {
            center_in_world,
            lattice_from_world: axes_in_world.transpose(),
            step: 2.0 * radius / f64::from((1 << BITS) - 3),
        }
    }

    /// A point in lattice steps, not rounded.
    pub(super) fn steps(&self, point_in_world: DVec3) -> DVec3 {
        let middle = 0.5 * f64::from((1 << BITS) - 1);
        let offset = self.lattice_from_world * (point_in_world - self.center_in_world);
        offset / self.step + DVec3::splat(middle)
    }

    /// The nearest place; what lies outside the cube goes to its border.
    pub(super) fn snap(&self, point_in_world: DVec3) -> Site {
        let at = self.steps(point_in_world);
        let last = f64::from((1 << BITS) - 1);
        at.to_array().map(|x| x.round().clamp(0.0, last) as i32)
    }
}

/// A place as a vector in lattice steps.
pub(super) fn vector(site: Site) -> DVec3 {
    DVec3::from_array(site.map(f64::from))
}
