//! Where samples fall: a block of a row at a time, in vectors.
//!
//! The warp equation in f32, x₂ ≐ H·x₁ + s·t: H·x₁ of the row's middle is computed once in f64,
//! so a sample adds what its column, its place within the row and its inverse depth do. No
//! multiply-adds are fused, so every machine computes the same bytes.

use super::Layered;
use super::ends::quarter_turns;
use crate::interior::{Pinhole, Warp};
use glam::DVec3;

/// Samples worked on together.
pub(super) const LANES: usize = 32;

/// The warp from an LDI to a desired image.
#[derive(Clone, Copy)]
pub(crate) struct Projection {
    row: [DVec3; 2],
    /// What a sample adds to its row's homogeneous position: for its x, for how far below its row's
    /// middle it is, and for its inverse depth.
    pub(crate) per_x: [f32; 3],
    pub(crate) per_y: [f32; 3],
    pub(crate) per_depth: [f32; 3],
    /// By how many quarters the LDI is turned in the desired image, from right to below.
    pub(crate) turn: u32,
}

/// Where up to [`LANES`] samples fall.
pub(super) struct Block {
    /// In the desired image, less the origin. Of what is behind the camera, NaN or far outside.
    pub(super) x: [f32; LANES],
    pub(super) y: [f32; LANES],
    /// In the desired camera's frame; not positive behind it.
    pub(super) inverse_depth: [f32; LANES],
    /// One over the divisor.
    pub(super) scale: [f32; LANES],
}

impl Block {
    pub(super) const EMPTY: Self = Self {
        x: [0.0; LANES],
        y: [0.0; LANES],
        inverse_depth: [0.0; LANES],
        scale: [0.0; LANES],
    };
}

impl Projection {
    /// To the desired image, whose pixels count from `origin`.
    pub(crate) fn new(ldi: &Layered, desired: &Pinhole, origin: [i32; 2]) -> Self {
        let warp = Warp::new(&ldi.camera, desired);
        let shifted = |v: DVec3| {
            let [x, y] = origin.map(f64::from);
            DVec3::new(v.x - x * v.z, v.y - y * v.z, v.z)
        };
        let h = warp.pixel_from_pixel;
        let small = |v: DVec3| shifted(v).to_array().map(|v| v as f32);
        let middle = shifted(h.z_axis) + 0.5 * shifted(h.y_axis);
        Self {
            row: [middle, shifted(h.y_axis)],
            per_x: small(h.x_axis),
            per_y: small(h.y_axis),
            per_depth: small(warp.shift),
            turn: quarter_turns(desired.rotation * ldi.camera.rotation.transpose()),
        }
    }

    /// What all samples of a row have in common.
    #[inline(always)]
    pub(crate) fn row(&self, row: u32) -> [f32; 3] {
        let base = self.row[0] + f64::from(row) * self.row[1];
        base.to_array().map(|v| v as f32)
    }

    /// The samples from `first` on, of that row.
    #[inline(always)]
    pub(super) fn block(&self, base: [f32; 3], ldi: &Layered, first: usize, into: &mut Block) {
        let list = |list: &'_ [f32]| -> [f32; LANES] {
            let mut block = [0.0; LANES];
            block.copy_from_slice(&list[first..first + LANES]);
            block
        };
        let (x, y, s) = (list(&ldi.x), list(&ldi.y), list(&ldi.inverse_depth));
        for k in 0..LANES {
            let at = |i: usize| {
                base[i] + self.per_x[i] * x[k] + self.per_y[i] * y[k] + self.per_depth[i] * s[k]
            };
            let scale = 1.0 / at(2);
            into.x[k] = at(0) * scale;
            into.y[k] = at(1) * scale;
            into.inverse_depth[k] = s[k] * scale;
            into.scale[k] = scale;
        }
    }
}
