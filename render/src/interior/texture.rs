//! A reference image as a picture on the portal's plane.

use super::{Beyond, Pinhole, Reference, Target, Warp, Window};
use crate::cpu::lanes::{vectorised, whole_f64};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Pixels of a row that are looked at together.
const TOGETHER: usize = 16;

/// Where pixels of a row fall in a reference image.
struct Places {
    /// The four pixels around, row by row: their numbers in the image.
    idxs: [[i32; TOGETHER]; 4],
    /// How much each counts: nothing beyond the image.
    weights: [[f32; TOGETHER]; 4],
    /// The plane's; 0 where nothing is seen.
    inverse_depth: [f64; TOGETHER],
}

/// Draws a reference image as if it were painted on the portal's plane, over what is there, in
/// the pixels of a window (Aliaga and Lastra 1997, "Architectural walkthroughs using portal
/// textures"). It is right where the desired camera is the reference's. How many pixels were
/// drawn.
pub fn texture(
    reference: &Reference,
    plane: &Beyond,
    desired: &Pinhole,
    window: &Window,
    into: &mut Target,
) -> usize {
    // The warp the other way, every pixel at the plane's depth.
    let warp = Warp::new(desired, &reference.camera);
    let width = into.width as usize;
    if width == 0
        || reference.seen.color.is_empty()
        || (into.width, into.height) != (desired.width, desired.height)
    {
        return 0;
    }
    let colors = into.color.par_chunks_mut(width);
    let rows = colors.zip(into.inverse_depth.par_chunks_mut(width));
    let row = |(y, (colors, depths)): (usize, (&mut [[u8; 4]], &mut [f32]))| {
        let open = window.row(y as u32);
        let open = open.start as usize..(open.end as usize).min(width);
        vectorised(
            #[inline(always)]
            || {
                let mut count = 0;
                for first in open.clone().step_by(TOGETHER) {
                    let places = Places::new(&reference.seen, plane, desired, &warp, [first, y]);
                    let to = open.end.min(first + TOGETHER);
                    count += places.draw(
                        &reference.seen,
                        &mut colors[first..to],
                        &mut depths[first..to],
                    );
                }
                count
            },
        )
    };
    rows.enumerate().map(row).sum()
}

impl Places {
    /// Of pixels from a first one on; the row's last again where there are no more.
    #[inline(always)]
    fn new(
        seen: &Target,
        plane: &Beyond,
        desired: &Pinhole,
        warp: &Warp,
        [first, y]: [usize; 2],
    ) -> Self {
        let size = [f64::from(seen.width), f64::from(seen.height)];
        let last = desired.columns.len() - 1;
        let mut places = Self {
            idxs: [[0; TOGETHER]; 4],
            weights: [[0.0; TOGETHER]; 4],
            inverse_depth: [0.0; TOGETHER],
        };
        let mut across = [0.0; TOGETHER];
        for k in 0..TOGETHER {
            across[k] = desired.columns[(first + k).min(last)];
        }
        // Without a branch, so that it may become vector instructions.
        for k in 0..TOGETHER {
            let ray = DVec3::new(across[k], desired.rows[y], 1.0);
            let s = plane.inverse_depth(ray);
            let center = DVec2::new((first + k) as f64 + 0.5, y as f64 + 0.5);
            let at = warp.homogeneous(center, s);
            let (x, y) = (at.x / at.z - 0.5, at.y / at.z - 0.5);
            let (left, top) = (x.floor(), y.floor());
            // What is no number is not compared with any.
            let is_seen = (s > 0.0)
                & (s < f64::INFINITY)
                & (at.z > 0.0)
                & (left >= -1.0)
                & (left < size[0])
                & (top >= -1.0)
                & (top < size[1]);
            places.inverse_depth[k] = if is_seen { s } else { 0.0 };
            let (right, below) = ((x - left) as f32, (y - top) as f32);
            for (i, (dx, dy, weight)) in [
                (0.0, 0.0, (1.0 - right) * (1.0 - below)),
                (1.0, 0.0, right * (1.0 - below)),
                (0.0, 1.0, (1.0 - right) * below),
                (1.0, 1.0, right * below),
            ]
            .into_iter()
            .enumerate()
            {
                let (x, y) = (left + dx, top + dy);
                // As far as a pixel off, whose neighbours may be inside.
                let is_inside = is_seen & (x >= 0.0) & (x < size[0]) & (y >= 0.0) & (y < size[1]);
                places.weights[i][k] = if is_inside { weight } else { 0.0 };
                let idx = if is_inside { y * size[0] + x } else { 0.0 };
                (_, places.idxs[i][k]) = whole_f64(idx);
            }
        }
        places
    }

    /// Bilinear among the pixels that show anything; how many were drawn.
    #[inline(always)]
    fn draw(&self, seen: &Target, colors: &mut [[u8; 4]], depths: &mut [f32]) -> usize {
        // 1. Their colours, with nothing between them, so that waiting for one is waiting for many.
        let mut codes = [[0; TOGETHER]; 4];
        for (i, idxs) in self.idxs.iter().enumerate() {
            for k in 0..TOGETHER {
                codes[i][k] = u32::from_le_bytes(seen.color[idxs[k] as usize]);
            }
        }
        // 2. Between them: red, green, blue, weight.
        let mut sums = [[0.0_f32; TOGETHER]; 4];
        for (codes, weights) in codes.iter().zip(&self.weights) {
            for k in 0..TOGETHER {
                let weight = if codes[k] >> 24 == 0 { 0.0 } else { weights[k] };
                for (channel, sum) in sums[..3].iter_mut().enumerate() {
                    sum[k] += weight * (codes[k] >> (8 * channel) & 255) as i32 as f32;
                }
                sums[3][k] += weight;
            }
        }
        let mut count = 0;
        for (k, (color, depth)) in colors.iter_mut().zip(depths).enumerate() {
            let [r, g, b, weight] = [0, 1, 2, 3].map(
                #[inline(always)]
                |i| sums[i][k],
            );
            // The outline's last pixels have no neighbours beyond.
            if weight > 1e-3 {
                // Rounded without a call: they are not negative.
                let code = |sum: f32| (sum / weight + 0.5) as u8;
                *color = [code(r), code(g), code(b), 255];
                *depth = self.inverse_depth[k] as f32;
                count += 1;
            }
        }
        count
    }
}
