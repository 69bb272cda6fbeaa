//! The ray through each pixel of the desired image.

use calibrate::{Distortion, Lens, Pixel, View};
use glam::DVec3;
use proxy::Rays;
use rayon::prelude::*;

/// The rays of the last lens and image size, for the next frame along a path.
#[derive(Debug, Default)]
pub(crate) struct RayCache {
    last: Option<(Lens, [u32; 2], RayMap)>,
}

impl RayCache {
    pub(crate) fn of(&mut self, view: &View) -> &RayMap {
        let size = [view.width, view.height];
        let last = self.last.take().filter(|l| (l.0, l.1) == (view.lens, size));
        let last = last.unwrap_or_else(|| (view.lens, size, RayMap::of(view)));
        &self.last.insert(last).2
    }
}

/// The ray through a pixel before it is rounded: at z = 1 where there is a z, as a pinhole's.
pub(crate) fn ray_of(lens: &Lens, pixel: Pixel) -> Option<DVec3> {
    let ray = lens.unproject(pixel)?;
    Some(if ray.z > 0.1 { ray / ray.z } else { ray })
}

/// Rays through pixel centres, in the desired camera's frame. A pinhole's are computed as
/// they are needed; any other lens has them in a table, inverted in f64.
#[derive(Debug)]
pub(crate) enum RayMap {
    Pinhole(Pinhole),
    /// Row by row; NaN where the lens has no ray.
    Table {
        width: usize,
        rays: Vec<[f32; 4]>,
    },
}

/// What takes a pinhole's pixels to z = 1, across and down.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pinhole {
    scale: [f64; 2],
    offset: [f64; 2],
}

impl Pinhole {
    /// Where rays through the centres of a column (axis 0) or a row (axis 1) are at z = 1.
    #[inline(always)]
    pub(crate) fn at(&self, axis: usize, pixel: usize) -> f32 {
        ((f64::from(pixel as u32) + self.offset[axis]) * self.scale[axis]) as f32
    }
}

impl RayMap {
    pub(crate) fn of(view: &View) -> Self {
        let lens = view.lens;
        if lens.distortion() == Distortion::None {
            let scale = [1.0 / lens.focal.x, 1.0 / lens.focal.y];
            let offset = [0.5 - lens.principal.x, 0.5 - lens.principal.y];
            return Self::Pinhole(Pinhole { scale, offset });
        }
        let width = view.width as usize;
        let count = width * view.height as usize;
        // Those that the surface was scanned along are known.
        let known = (count <= Rays::MOST_KEPT).then(|| Rays::of(&lens, (view.width, view.height)));
        let known = known.flatten();
        let ray = |i: usize| {
            if let Some(known) = &known {
                let at = known.at(i % width, i / width);
                return at.map_or([f32::NAN; 4], |at| [at.x as f32, at.y as f32, 1.0, 0.0]);
            }
            let pixel = Pixel::center_of((i % width) as u32, (i / width) as u32);
            ray_of(&lens, pixel).map_or([f32::NAN; 4], |ray| ray.as_vec3().extend(0.0).to_array())
        };
        Self::Table {
            width,
            rays: (0..count).into_par_iter().map(ray).collect(),
        }
    }

    /// The ray through a pixel's centre; any length.
    #[inline]
    pub(crate) fn ray(&self, column: usize, row: usize) -> Option<[f32; 3]> {
        match self {
            Self::Pinhole(pinhole) => Some([pinhole.at(0, column), pinhole.at(1, row), 1.0]),
            Self::Table { width, rays } => {
                let [x, y, z, _] = rays[row * width + column];
                (!x.is_nan()).then_some([x, y, z])
            }
        }
    }
}
