//! A photo as its neighbour would see it if all lay on a plane.

use super::small::SmallPhoto;
use super::windows::WINDOW;
use glam::{DMat3, DVec3};

/// So far beyond its border a photo repeats itself, in pixels, so that windows on it count.
const BEYOND: f32 = (WINDOW / 2) as f32;
/// Pixels worked on together.
const LANES: usize = 32;

/// Where a reference's pixels fall in another photo.
pub(super) struct Warp<'a> {
    other: &'a SmallPhoto,
    /// From pixels' indices in the reference to indices in the other, homogeneous.
    other_from_reference: DMat3,
}

impl<'a> Warp<'a> {
    /// By the plane at an inverse depth along the reference's axis.
    pub(super) fn new(reference: &SmallPhoto, other: &'a SmallPhoto, inverse_depth: f64) -> Self {
        // x' ~ R x + t·w for the ray x through a pixel, z = 1.
        let rotation = other.rotation * reference.rotation.transpose();
        let translation = other.rotation * (reference.center - other.center);
        let from_pixel = DMat3::from_cols(
            DVec3::X / reference.focal,
            DVec3::Y / reference.focal,
            DVec3::new(
                (0.5 - reference.principal[0]) / reference.focal,
                (0.5 - reference.principal[1]) / reference.focal,
                1.0,
            ),
        );
        let plane = DMat3::from_cols(DVec3::ZERO, DVec3::ZERO, translation * inverse_depth);
        // Both matrices act on rays with z = 1, so the third column takes the translation.
        let to_pixel = DMat3::from_cols(
            DVec3::X * other.focal,
            DVec3::Y * other.focal,
            DVec3::new(other.principal[0] - 0.5, other.principal[1] - 0.5, 1.0),
        );
        Self {
            other,
            other_from_reference: to_pixel * (rotation + plane) * from_pixel,
        }
    }

    /// Of a row of the reference's pixels, whose own grays are given: the other's grays, their
    /// squares, their products with the own ones, and 1 where the other shows anything, else 0.
    #[inline(always)]
    pub(super) fn row(
        &self,
        y: usize,
        own: &[f32],
        [grays, squares, products, seen]: [&mut [f32]; 4],
    ) {
        let width = own.len();
        for first in (0..width).step_by(LANES) {
            let count = LANES.min(width - first);
            let (found, shown) = self.pixels(first, y);
            let row = first..first + count;
            grays[row.clone()].copy_from_slice(&found[..count]);
            seen[row].copy_from_slice(&shown[..count]);
        }
        let (squares, products) = (&mut squares[..width], &mut products[..width]);
        for ((square, product), (gray, own)) in
            squares.iter_mut().zip(products).zip(grays.iter().zip(own))
        {
            (*square, *product) = (gray * gray, gray * own);
        }
    }

    /// Of some neighbouring pixels the grays, and 1 where there is one.
    #[inline(always)]
    fn pixels(&self, first: usize, y: usize) -> ([f32; LANES], [f32; LANES]) {
        let h = &self.other_from_reference;
        let start = (h.y_axis * y as f64 + h.x_axis * first as f64 + h.z_axis).as_vec3();
        let step = h.x_axis.as_vec3();
        let (right, bottom) = (
            (self.other.width - 1) as f32,
            (self.other.height - 1) as f32,
        );
        let stride = self.other.width as i32;
        // 1. Where they fall.
        let (mut at, mut inside) = ([0_i32; LANES], [false; LANES]);
        let (mut fx, mut fy) = ([0.0_f32; LANES], [0.0_f32; LANES]);
        for k in 0..LANES {
            let t = k as f32;
            let z = start.z + step.z * t;
            let (u, v) = ((start.x + step.x * t) / z, (start.y + step.y * t) / z);
            let (near_u, near_v) = (u.max(0.0).min(right), v.max(0.0).min(bottom));
            let beyond = (u - near_u).abs().max((v - near_v).abs());
            inside[k] = (z > 0.0) & (beyond <= BEYOND);
            let (left, top) = (near_u.floor(), near_v.floor());
            (fx[k], fy[k]) = (near_u - left, near_v - top);
            at[k] = nearest(top) * stride + nearest(left);
        }
        // 2. The four pixels around each.
        let mut quads = [0_u32; LANES];
        for k in 0..LANES {
            quads[k] = self.other.quads[at[k] as usize];
        }
        // 3. What lies between them.
        let (mut grays, mut seen) = ([0.0; LANES], [0.0; LANES]);
        for k in 0..LANES {
            let corner = |shift: u32| (quads[k] >> shift & 0xff) as i32 as f32;
            let [a, b, c, d] = [corner(0), corner(8), corner(16), corner(24)];
            let (upper, lower) = (a + fx[k] * (b - a), c + fx[k] * (d - c));
            let gray = upper + fy[k] * (lower - upper) - 128.0;
            let shown = inside[k] & (quads[k] != 0);
            grays[k] = if shown { gray } else { 0.0 };
            seen[k] = if shown { 1.0 } else { 0.0 };
        }
        (grays, seen)
    }
}

/// The whole number nearest to 0 ≤ x < 2²³. (A cast says what becomes of any other number, too, and is
/// done one by one.)
#[inline(always)]
pub(super) fn nearest(x: f32) -> i32 {
    const SHIFT: f32 = 8_388_608.0;
    (x + SHIFT).to_bits().wrapping_sub(SHIFT.to_bits()) as i32
}
