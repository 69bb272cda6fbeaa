//! A frame's picture out of surfaces and fills.

use super::Walk;
use super::filled::Filled;
use crate::RenderError;
use crate::interior::{Pinhole, Target};
use calibrate::View;
use rayon::prelude::*;

impl Walk<'_> {
    /// The picture; how many pixels of portals nothing was drawn in.
    pub(super) fn compose(
        &mut self,
        view: &View,
        camera: &Pinhole,
        fills: &[Filled<'_>],
    ) -> Result<usize, RenderError> {
        let width = camera.width as usize;
        let (owners, filled) = (&self.owners, &self.filled);
        let fill_of = |pixel: usize| fills.get(usize::from(owners[pixel]).wrapping_sub(1));
        let is_before = |pixel: usize, f: &Filled<'_>, inverse_depth: f32| {
            // Narrow numbers divide faster.
            let (pixel, width) = (pixel as u32, camera.width);
            let ray = camera.ray(pixel % width, pixel / width);
            !f.plane.has(ray, f64::from(inverse_depth))
        };
        let last = match self.options.persist {
            true => std::mem::take(&mut self.picture),
            false => Target::default(),
        };
        let is_alike = (last.width, last.height) == (camera.width, camera.height);
        self.picture.clear(camera.width, camera.height);
        let is_wanted = |pixel: usize, inverse_depth: f32| match fill_of(pixel) {
            None => true,
            Some(f) => {
                f.share < 1.0
                    || f.leaves_open(filled.color[pixel][3])
                    || is_before(pixel, f, inverse_depth)
            }
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
            let mut holes = 0;
            for (x, (color, depth)) in colors.iter_mut().zip(depths).enumerate() {
                let pixel = y * width + x;
                let Some(f) = fill_of(pixel) else {
                    continue;
                };
                let own = painter.inverse_depth(pixel);
                if own.is_some_and(|s| is_before(pixel, f, s)) {
                    continue;
                }
                let mut image = filled.color[pixel];
                if image[3] == 0 && own.is_some() && is_captured {
                    // All that might be there was met.
                    continue;
                }
                if image[3] == 0 {
                    holes += usize::from(own.is_none());
                    if is_alike {
                        image = last.color[pixel];
                    }
                }
                let covers = filled.color[pixel][3];
                if f.share < 1.0 {
                    *color = mixed(*color, image, f.share);
                } else if covers > 0 && own.is_some() && f.leaves_open(covers) {
                    // A hole of one of two LDIs shows what is behind as far as the other leaves it open.
                    let opaque = [image[0], image[1], image[2], u8::MAX];
                    *color = mixed(*color, opaque, f64::from(covers) / 255.0);
                } else if own.is_none() || filled.color[pixel][3] > 0 {
                    *color = image;
                }
                if own.is_none() || (f.share >= 1.0 && filled.color[pixel][3] > 0) {
                    *depth = filled.inverse_depth[pixel];
                }
            }
            holes
        };
        Ok(rows.enumerate().map(row).sum())
    }
}

/// Colours with coverage mixed, `share` of the second.
pub(super) fn mixed(a: [u8; 4], b: [u8; 4], share: f64) -> [u8; 4] {
    let weights = [(1.0 - share) * f64::from(a[3]), share * f64::from(b[3])];
    let alpha = weights[0] + weights[1];
    if alpha < 0.5 {
        return [0; 4];
    }
    let part = weights[1] / alpha;
    let mix = |k: usize| f64::from(a[k]) + part * (f64::from(b[k]) - f64::from(a[k]));
    [mix(0), mix(1), mix(2), alpha].map(|v| v.round() as u8)
}
