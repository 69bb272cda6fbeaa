//! A depth map made ready: inverse depths, their slopes, and how far each is believed.

use calibrate::{DepthAlong, Lens, Pixel, View};
use capture::DepthMap;
use glam::DVec3;
use rayon::prelude::*;

/// The rays of all pixels of a lens, as [`DepthAlong::ray`] has them, made anew only for another lens; NaN
/// where a pixel has none that a depth could lie on.
#[derive(Default)]
pub(super) struct Rays {
    of: Option<(Lens, u32, u32)>,
    rays: Vec<DVec3>,
}

impl Rays {
    pub(super) fn of(&mut self, lens: &Lens, width: u32, height: u32) -> &[DVec3] {
        let wanted = Some((*lens, width, height));
        if self.of != wanted {
            let along = DepthAlong::of(lens, width, height);
            let ray = |i: usize| {
                let (column, row) = (i as u32 % width, i as u32 / width);
                let ray = lens.unproject(Pixel::center_of(column, row));
                ray.and_then(|ray| along.ray(ray)).unwrap_or(DVec3::NAN)
            };
            self.rays = (0..width as usize * height as usize)
                .into_par_iter()
                .map(ray)
                .collect();
            self.of = wanted;
        }
        &self.rays
    }
}

/// A depth map's inverse depths, 0 where unknown.
pub(super) struct Inverse<'a> {
    pub(super) view: View,
    along: DepthAlong,
    width: usize,
    height: usize,
    values: Vec<f64>,
    pub(super) rays: &'a [DVec3],
}

impl<'a> Inverse<'a> {
    /// The depth map must be as large as the view and have all its values.
    pub(super) fn new(view: View, depth: &DepthMap, rays: &'a [DVec3]) -> Self {
        let inverse = |(&depth, ray): (&f32, &DVec3)| {
            let inverse = f64::from(depth).recip();
            let is_known = depth > 0.0 && depth.is_finite() && ray.is_finite();
            if is_known && inverse.is_finite() {
                inverse
            } else {
                0.0
            }
        };
        Self {
            along: DepthAlong::of_view(&view),
            view,
            width: depth.width as usize,
            height: depth.height as usize,
            values: depth.depths.iter().zip(rays).map(inverse).collect(),
            rays,
        }
    }

    /// The index of the pixel so far from another, if there is one.
    fn beside(&self, i: usize, (right, down): (isize, isize)) -> Option<usize> {
        let column = (i % self.width).checked_add_signed(right)?;
        let row = (i / self.width).checked_add_signed(down)?;
        (column < self.width && row < self.height).then_some(row * self.width + column)
    }

    /// How far apart the rays of neighbouring pixels are around one, at a depth of 1.
    fn step(&self, i: usize) -> f64 {
        let ways = [(1, 0), (-1, 0), (0, 1), (0, -1)];
        let beside = ways.iter().filter_map(|way| self.beside(i, *way));
        let steps = beside.map(|j| self.rays[i].distance(self.rays[j]));
        steps.fold(0.0, f64::max)
    }
}

/// What depth maps have in common.
#[derive(Default)]
pub(super) struct Statistics {
    depths: Vec<f64>,
    footprints: Vec<f64>,
    curvatures: Vec<f64>,
}

impl Statistics {
    /// Takes in every so-manieth pixel of a depth map.
    pub(super) fn add(&mut self, inverse: &Inverse) {
        // Not a divisor of usual widths.
        for i in (0..inverse.values.len()).step_by(37) {
            let value = inverse.values[i];
            if value == 0.0 {
                continue;
            }
            self.depths.push(value.recip());
            self.footprints.push(inverse.step(i) / value);
            for way in [(1, 0), (0, 1)] {
                let back = (-way.0, -way.1);
                let sides = inverse.beside(i, way).zip(inverse.beside(i, back));
                if let Some((a, b)) = sides
                    && inverse.values[a] > 0.0
                    && inverse.values[b] > 0.0
                {
                    let curvature = inverse.values[a] + inverse.values[b] - 2.0 * value;
                    self.curvatures.push(curvature.abs());
                }
            }
        }
    }

    /// The median depth, if any is known.
    pub(super) fn depth(&self) -> Option<f64> {
        median(&self.depths)
    }

    /// How wide a pixel is at the surfaces, median.
    pub(super) fn footprint(&self) -> f64 {
        median(&self.footprints).unwrap_or(0.0)
    }

    /// The standard deviation of inverse depths. Planes have straight inverse depths (in
    /// pinholes); what three neighbours in a row are off a line, by the median, is noise.
    pub(super) fn noise(&self) -> f64 {
        // Of Gaussian noise the second difference has √6 times the deviation, and its median
        // is 0.6745 of that.
        median(&self.curvatures).unwrap_or(0.0) / (0.6745 * 6_f64.sqrt())
    }
}

fn median(values: &[f64]) -> Option<f64> {
    let mut values = values.to_vec();
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// What is believed of depth maps.
pub(super) struct Trust {
    /// Slant, radians.
    pub(super) max_slant: f64,
    /// World units.
    pub(super) max_depth: f64,
    /// World units that a pixel may be wide.
    pub(super) max_footprint: f64,
    /// Standard deviation of inverse depths.
    pub(super) noise: f64,
    /// The depth at which a frontal pixel weighs 1.
    pub(super) unit_depth: f64,
}

/// What a pixel says of the surface.
#[derive(Clone, Copy, Default)]
pub(super) struct Sample {
    /// Inverse depth at its centre; 0 where it says nothing.
    pub(super) inverse: f32,
    /// By column and by row.
    pub(super) slope: [f32; 2],
    /// Of the angle between the ray and the surface's normal; 0 where only what lies well
    /// before this depth is known: to be free.
    pub(super) cos: f32,
    /// How much it counts.
    pub(super) weight: f32,
}

/// Weights are kept within this factor of 1.
const WEIGHT_RANGE: f64 = 16.0;
/// The side in pixels of the tiles whose extremes are kept.
pub(super) const TILE: usize = 8;

/// The extremes of a tile's inverse depths.
#[derive(Clone, Copy)]
pub(super) struct Extremes {
    pub(super) least: f32,
    pub(super) greatest: f32,
    /// Whether every pixel says something about the surface.
    pub(super) whole: bool,
}

/// A depth map ready to be fused.
pub(super) struct Frame {
    pub(super) view: View,
    /// What its depths are along.
    pub(super) along: DepthAlong,
    pub(super) samples: Vec<Sample>,
    pub(super) tiles: Vec<Extremes>,
    pub(super) tiles_across: usize,
    unit_depth: f64,
}

/// What a frontal pixel counts: errors of depth grow with its square.
fn weight_at(depth: f64, unit_depth: f64) -> f64 {
    let weight = (unit_depth / depth).powi(2);
    weight.clamp(WEIGHT_RANGE.recip(), WEIGHT_RANGE)
}

impl Frame {
    pub(super) fn new(inverse: &Inverse, trust: &Trust) -> Self {
        let samples: Vec<Sample> = (0..inverse.values.len())
            .into_par_iter()
            .map(|i| sample(inverse, i, trust))
            .collect();
        let (width, height) = (inverse.width, inverse.height);
        let (across, down) = (width.div_ceil(TILE), height.div_ceil(TILE));
        let extremes = |tile: usize| {
            let (left, top) = (tile % across * TILE, tile / across * TILE);
            let rows = top..(top + TILE).min(height);
            let pixels = rows.flat_map(|row| {
                let row = &samples[row * width..(row + 1) * width];
                &row[left..(left + TILE).min(width)]
            });
            let nothing = Extremes {
                least: f32::INFINITY,
                greatest: 0.0,
                whole: true,
            };
            pixels.fold(nothing, |sum, sample| match sample.inverse {
                0.0 => Extremes {
                    whole: false,
                    ..sum
                },
                inverse => Extremes {
                    least: sum.least.min(inverse),
                    greatest: sum.greatest.max(inverse),
                    whole: sum.whole && sample.cos > 0.0,
                },
            })
        };
        let tiles = (0..across * down).into_par_iter().map(extremes).collect();
        Self {
            view: inverse.view.clone(),
            along: inverse.along,
            samples,
            tiles,
            tiles_across: across,
            unit_depth: trust.unit_depth,
        }
    }
}

/// What pixel `i` says.
///
/// A pixel whose depth jumps to both its neighbours along an axis saw foreground and
/// background mixed, or something a pixel wide: it says nothing, and neither does one on a
/// slope too steep to be measured. One at a mere edge of a surface is as good as any.
fn sample(map: &Inverse, i: usize, trust: &Trust) -> Sample {
    let here = map.values[i];
    if here == 0.0 {
        return Sample::default();
    }
    let ray = map.rays[i];
    let steepest = trust.max_slant.tan();
    let beside = |way| {
        let j = map.beside(i, way)?;
        let there = map.values[j];
        // A plane's inverse depth changes by at most this between two rays.
        let step = map.rays[i].distance(map.rays[j]);
        let most = here.max(there) * step * steepest + 4.0 * trust.noise;
        let is_same = there > 0.0 && (here - there).abs() <= most;
        is_same.then(|| (map.rays[j] / there, there))
    };
    let point = ray / here;
    let tangent = |back: (isize, isize), on: (isize, isize)| {
        let (from, to) = (beside(back), beside(on));
        let span = if from.is_some() && to.is_some() {
            0.5
        } else {
            1.0
        };
        let (from, to) = match (from, to) {
            (None, None) => return None,
            (from, to) => (from.unwrap_or((point, here)), to.unwrap_or((point, here))),
        };
        Some(((to.0 - from.0) * span, (to.1 - from.1) * span))
    };
    let tangents = tangent((-1, 0), (1, 0)).zip(tangent((0, -1), (0, 1)));
    let Some(((right, by_column), (down, by_row))) = tangents else {
        return Sample::default();
    };
    let normal = right.cross(down);
    let cos = (normal.dot(ray) / (normal.length() * ray.length())).abs();
    let believed = Sample {
        inverse: here as f32,
        slope: [by_column as f32, by_row as f32],
        cos: cos as f32,
        weight: 1.0,
    };
    let depth = here.recip();
    if depth > trust.max_depth || map.step(i) * depth > trust.max_footprint {
        return Sample {
            cos: 0.0,
            ..believed
        };
    }
    // NaN where the pixels' rays coincide.
    if !(cos >= trust.max_slant.cos()) {
        return Sample::default();
    }
    Sample {
        weight: (weight_at(depth, trust.unit_depth) * cos) as f32,
        ..believed
    }
}

impl Frame {
    /// What a frontal pixel counts at a depth.
    pub(super) fn weight_at(&self, depth: f64) -> f64 {
        weight_at(depth, self.unit_depth)
    }

    /// The points that pixels believe to be on the surface, in the camera's frame, each with
    /// the cosine of its slant.
    pub(super) fn surface<'a>(
        &'a self,
        rays: &'a [DVec3],
        row: usize,
    ) -> impl Iterator<Item = (DVec3, f64)> + 'a {
        let width = self.view.width as usize;
        let pixels = row * width..(row + 1) * width;
        let believed = pixels.filter(|i| self.samples[*i].cos > 0.0);
        believed.map(|i| {
            let sample = &self.samples[i];
            let point = rays[i] / f64::from(sample.inverse);
            (point, f64::from(sample.cos))
        })
    }
}
