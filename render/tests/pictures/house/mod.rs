//! What the tests of interiors share. Each of them uses a part.
#![allow(dead_code)]

#[path = "../../../../proxy/tests/surfaces/house/mod.rs"]
mod shared;

use calibrate::View;
use proxy::interior::{Contents, Interior, Region, visible};
use render::interior::{CellGeometry, Runs, Target};
#[allow(unused_imports)]
pub(crate) use shared::{own_house, random, room, small_house, view, viewpoint};

/// What portal culling leaves to draw.
pub(crate) fn drawn<'a>(
    interior: &Interior,
    contents: &Contents,
    geometry: &'a CellGeometry,
    view: &View,
) -> Runs<'a> {
    let cell = contents.locate(interior, view.center());
    let visibility = visible(interior, cell, view);
    geometry.seen(view.center(), &visibility, &Region::of(view))
}

/// A picture with what its edges follow from.
pub(crate) struct Pixels {
    width: usize,
    color: Vec<[u8; 4]>,
    /// 0 where nothing is.
    inverse_depth: Vec<f64>,
}

impl Pixels {
    pub(crate) fn of(target: &Target) -> Self {
        Self {
            width: target.width as usize,
            color: target.color.clone(),
            inverse_depth: target.inverse_depth.iter().map(|s| f64::from(*s)).collect(),
        }
    }

    pub(crate) fn of_rays(picture: &image::RgbaImage, depths: &[f64]) -> Self {
        Self {
            width: picture.width() as usize,
            color: picture.pixels().map(|p| p.0).collect(),
            inverse_depth: depths.iter().map(|z| 1.0 / z).collect(),
        }
    }

    /// Whether a pixel lies within 1.5 pixels of an edge: of depth or of colour.
    pub(crate) fn is_edge(&self, pixel: usize) -> bool {
        let height = self.color.len() / self.width;
        let (x, y) = (pixel % self.width, pixel / self.width);
        let around = |at: usize, end: usize| at.saturating_sub(1)..=(at + 1).min(end - 1);
        let (s, color) = (self.inverse_depth[pixel], self.color[pixel]);
        let mut pixels =
            around(y, height).flat_map(|v| around(x, self.width).map(move |u| v * self.width + u));
        pixels.any(|i| {
            let far = (self.inverse_depth[i] - s).abs() > 0.01 * s;
            far || (0..3).any(|k| color[k].abs_diff(self.color[i][k]) > 8)
        })
    }

    /// Whether a pixel of a picture `times` smaller lies within 1.5 of its pixels of an edge.
    pub(crate) fn has_edge_around(&self, [x, y]: [u32; 2], times: u32) -> bool {
        let height = self.color.len() / self.width;
        let reach = |at: u32, end: usize| {
            let from = (at * times).saturating_sub(times);
            from as usize..(((at + 2) * times) as usize).min(end)
        };
        let mut pixels =
            reach(y, height).flat_map(|v| reach(x, self.width).map(move |u| v * self.width + u));
        pixels.any(|pixel| self.is_edge(pixel))
    }
}
