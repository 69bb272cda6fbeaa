//! Cameras on a grid, held by hand.

use crate::noise::signed;
use calibrate::Rigid3;
use glam::{DQuat, DVec3};

/// Views side by side and one above the other, none quite where it should be.
pub(crate) struct HandHeldGrid {
    /// What all look at, more or less; world.
    pub(crate) target: DVec3,
    /// From there to the grid's middle, world units, and in which direction.
    pub(crate) distance: f64,
    pub(crate) towards: DVec3,
    /// Columns over rows.
    pub(crate) columns_per_row: f64,
    /// Between neighbours, in distances.
    pub(crate) spacing: f64,
    /// How far beside the target they aim, world units.
    pub(crate) aim: f64,
    pub(crate) seed: u32,
}

impl HandHeldGrid {
    /// Camera `i` of `count`.
    pub(crate) fn camera_from_world(&self, i: usize, count: usize) -> Rigid3 {
        let columns = ((count as f64 * self.columns_per_row).sqrt().round() as usize).max(1);
        let rows = count.div_ceil(columns);
        let spacing = self.spacing * self.distance;
        let column = (i % columns) as f64 - 0.5 * (columns as f64 - 1.0);
        let row = 0.5 * (rows as f64 - 1.0) - (i / columns) as f64;
        let r = |k: i32| signed(self.seed, i as i32, k, 4);
        let shake = spacing * DVec3::new(0.15 * r(0), 0.15 * r(1), 0.3 * r(2));
        let middle = self.target + self.distance * self.towards.normalize();
        let center = middle + spacing * DVec3::new(column, row, 0.0) + shake;
        let target = self.target + self.aim * DVec3::new(r(3), r(4), r(5));
        let roll = Rigid3::new(DQuat::from_rotation_z(0.02 * r(6)), DVec3::ZERO);
        roll * Rigid3::looking_at(center, target, DVec3::Y)
    }
}
