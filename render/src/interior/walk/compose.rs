//! A frame's picture out of surfaces and fills.

use super::Walk;
use super::filled::Filled;
use crate::RenderError;
use crate::interior::raster::ON_PLANE;
use crate::interior::{Pinhole, Target};
use calibrate::View;
use rayon::prelude::*;

/// A pixel, where those left open are added up: as whole numbers, whose sum is the same in any order.
const PIXEL: u64 = 1 << 16;

impl Walk<'_> {
    /// The picture; how many pixels of portals nothing was drawn in ([`FrameCost::holes`](super::FrameCost::holes)).
    /// `floor` is what [`Walk::find_floor`] found.
    pub(super) fn compose(
        &mut self,
        view: &View,
        camera: &Pinhole,
        fills: &[Filled<'_>],
        floor: &[f32],
    ) -> Result<usize, RenderError> {
        let width = camera.width as usize;
        let (owners, filled) = (&self.owners, &self.filled);
        let last = match self.options.persist {
            true => std::mem::take(&mut self.picture),
            false => Target::default(),
        };
        let is_alike = (last.width, last.height) == (camera.width, camera.height);
        self.picture.clear(camera.width, camera.height);
        // What is behind an image that leaves nothing open is not seen.
        let is_before_floor = |plane: f32, s: f32| s > plane * (1.0 + ON_PLANE as f32);
        let is_wanted = |pixel: usize, s: f32| match floor.get(pixel) {
            Some(plane) => is_before_floor(*plane, s),
            None => true,
        };
        self.painter
            .shade(self.model, view, camera, &mut self.picture, is_wanted)?;
        if fills.is_empty() {
            return Ok(0);
        }
        let painter = &self.painter;
        let is_captured = painter.captured().is_some();
        let colors = self.picture.color.par_chunks_mut(width);
        let rows = colors.zip(self.picture.inverse_depth.par_chunks_mut(width));
        let row = |(y, (colors, depths)): (usize, (&mut [[u8; 4]], &mut [f32]))| {
            let mut holes = 0_u64;
            let owners = &owners[y * width..][..width];
            for (x, (color, depth)) in colors.iter_mut().zip(depths).enumerate() {
                let Some(f) = fills.get(usize::from(owners[x]).wrapping_sub(1)) else {
                    continue;
                };
                let pixel = y * width + x;
                let own = painter.inverse_depth(pixel);
                let is_before = |s: f32| match floor.get(pixel) {
                    Some(plane) if *plane > 0.0 => is_before_floor(*plane, s),
                    _ => !f.plane.has(camera.ray(x as u32, y as u32), f64::from(s)),
                };
                if own.is_some_and(is_before) {
                    continue;
                }
                let mut image = filled.color[pixel];
                let covers = image[3];
                if covers == 0 && own.is_some() && is_captured {
                    // All that might be there was met.
                    continue;
                }
                holes += left_open(f, covers, own.is_some());
                if covers == 0 && is_alike {
                    image = last.color[pixel];
                }
                if f.share < 1.0 {
                    *color = mixed(*color, image, f.share);
                } else if covers > 0 && own.is_some() && f.leaves_open(covers) {
                    // A hole of one of two LDIs shows what is behind as far as the other leaves it open.
                    let opaque = [image[0], image[1], image[2], u8::MAX];
                    *color = mixed(*color, opaque, f64::from(covers) / 255.0);
                } else if own.is_none() || covers > 0 {
                    *color = image;
                }
                if own.is_none() || (f.share >= 1.0 && covers > 0) {
                    *depth = filled.inverse_depth[pixel];
                }
            }
            holes
        };
        let holes: u64 = rows.enumerate().map(row).sum();
        Ok(((holes + PIXEL / 2) / PIXEL) as usize)
    }
}

/// How much of a pixel is left open, of [`PIXEL`], where a portal's images have that alpha: all that they leave
/// open; where there is geometry, as far as they are mixed with it, and nothing where they are to be alone, as it shows.
fn left_open(f: &Filled<'_>, covers: u8, has_geometry: bool) -> u64 {
    if !f.leaves_open(covers) {
        return 0;
    }
    let of_images = match has_geometry {
        false => 1.0,
        true if f.share < 1.0 => f.share,
        true => 0.0,
    };
    let open = f64::from(u8::MAX - covers) / f64::from(u8::MAX);
    (PIXEL as f64 * of_images * open).round() as u64
}

/// Colours with coverage mixed, `share` of the second.
pub(super) fn mixed(a: [u8; 4], b: [u8; 4], share: f64) -> [u8; 4] {
    let share = share as f32;
    let weights = [(1.0 - share) * f32::from(a[3]), share * f32::from(b[3])];
    let alpha = weights[0] + weights[1];
    if alpha < 0.5 {
        return [0; 4];
    }
    let part = weights[1] / alpha;
    let mix = |k: usize| f32::from(a[k]) + part * (f32::from(b[k]) - f32::from(a[k]));
    // Rounded without a call: they are not negative.
    [mix(0), mix(1), mix(2), alpha].map(|v| (v + 0.5) as u8)
}
