//! What a sample stands for: its surface's normal and how large a patch, in 16 bits.
//!
//! Gortler et al. 1997 index a table of splat sizes by normal and distance; the table is made
//! anew for each desired camera. Here the second index is the patch's side, which is what the
//! distance was for.

use crate::interior::Pinhole;
use glam::{DMat3, DVec3};

/// The index into a table of splat sizes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct Look(pub u16);

/// Steps of each of a normal's two coordinates.
const STEPS: u16 = 32;
const NORMALS: usize = (STEPS * STEPS) as usize;
/// Steps of a side for each doubling.
const SIDE_STEPS: f64 = 4.0;
const SIDES: usize = 64;
/// The side's logarithm of the last step.
const LARGEST: f64 = 1.0;

impl Look {
    /// Of a surface with a normal in the LDI camera's frame, either of the two, of any length, and
    /// a patch whose side is that many times its depth z.
    pub fn new(normal: DVec3, side: f64) -> Self {
        let n = if normal.z < 0.0 { -normal } else { normal };
        let size = n.x.abs() + n.y.abs() + n.z;
        let n = if size > 0.0 && size.is_finite() {
            n / size
        } else {
            DVec3::Z
        };
        // The octahedron's half, turned to a square.
        let code = |v: f64| {
            let step = (0.5 * (v + 1.0) * f64::from(STEPS)).floor();
            step.clamp(0.0, f64::from(STEPS - 1)) as u16
        };
        let normal = code(n.x + n.y) * STEPS + code(n.x - n.y);
        let last = (SIDES - 1) as f64;
        let step = SIDE_STEPS * (side.max(1e-12).log2() - LARGEST) + last;
        let side = step.round().clamp(0.0, last) as u16;
        Self(side * NORMALS as u16 + normal)
    }

    /// The normal, unit length, z ≥ 0, to about 3°.
    pub fn normal(self) -> DVec3 {
        normal(usize::from(self.0) % NORMALS)
    }

    /// The patch's side over its depth, to 9 %.
    pub fn side(self) -> f64 {
        side(usize::from(self.0) / NORMALS)
    }
}

fn normal(index: usize) -> DVec3 {
    let steps = usize::from(STEPS);
    let value = |code: usize| 2.0 * (code as f64 + 0.5) / steps as f64 - 1.0;
    let (sum, difference) = (value(index / steps), value(index % steps));
    let (x, y) = (0.5 * (sum + difference), 0.5 * (sum - difference));
    DVec3::new(x, y, 1.0 - x.abs() - y.abs()).normalize()
}

fn side(index: usize) -> f64 {
    ((index as f64 - (SIDES - 1) as f64) / SIDE_STEPS + LARGEST).exp2()
}

/// Half the width and height of patches as a desired camera sees them, in pixels times the
/// warp's divisor.
pub(crate) struct Sizes {
    normals: Vec<[f32; 2]>,
    sides: Vec<f32>,
}

impl Sizes {
    /// For a desired camera. A patch is a disc, as tall as the LDI's pixels are in proportion,
    /// seen from so far that all rays are as the axis (as in Gortler et al. 1997).
    pub(crate) fn new(ldi: &Pinhole, desired: &Pinhole) -> Self {
        let desired_from_ldi: DMat3 = desired.rotation * ldi.rotation.transpose();
        let tall = (ldi.focal.x / ldi.focal.y).sqrt().clamp(0.25, 4.0);
        let extent = |i: usize| {
            let n = desired_from_ldi * normal(i);
            let half = |n: f64| 0.5 * (1.0 - n * n).max(0.0).sqrt();
            let x = half(n.x) / tall * desired.focal.x;
            let y = half(n.y) * tall * desired.focal.y;
            [x as f32, y as f32]
        };
        Self {
            normals: (0..NORMALS).map(extent).collect(),
            sides: (0..SIDES).map(|i| side(i) as f32).collect(),
        }
    }

    /// By normal, half the width and height; then by step, the sides.
    pub(crate) fn words(&self) -> Vec<f32> {
        let normals = self.normals.as_flattened().iter();
        normals.chain(&self.sides).copied().collect()
    }

    /// To be divided by the warp's divisor.
    #[inline(always)]
    pub(super) fn half(&self, look: Look) -> [f32; 2] {
        let index = usize::from(look.0);
        let [x, y] = self.normals[index % NORMALS];
        let side = self.sides[index / NORMALS];
        [x * side, y * side]
    }
}
