//! Colours for which what is drawn agrees with all that the images saw.
//!
//! Of each surface an LDI has one sample a pixel, with the colour of a point: what the other images saw
//! beside it is lost. As drawn in any order a pixel is a mean of the samples around it, so each sample
//! offered says what such a mean should be. A step of the simultaneous iterative reconstruction technique
//! (Gilbert 1972) moves the colours towards it; further steps are worth 0.04 dB together.

use super::free::{BEYOND, FreeOptions, gaussian, narrowness};
use super::look::Sizes;
use super::{Layered, Sample};
use crate::cpu::lanes::vectorised;
use rayon::prelude::*;
use std::array::from_fn;
use std::ops::Range;

/// A sample of an image, and the LDI's pixel in which it falls.
#[derive(Clone, Copy)]
pub(super) struct Offered {
    pub(super) pixel: u32,
    pub(super) sample: Sample,
}

/// Samples worked on together; no more than lists are padded by.
const LANES: usize = 8;

/// The colours of an LDI's samples, fitted to what images offered, given by bands of so many rows. Samples of
/// inverse depths within a share of one another are of one surface.
pub(super) fn fitted(ldi: &Layered, bands: &[&[Offered]], rows: usize, range: f64) -> Vec<[u8; 4]> {
    let fit = Fit::new(ldi, range);
    let height = ldi.size()[1] as usize;
    let of_band = |(band, offered): (usize, &&[Offered])| {
        let low = (band * rows).saturating_sub(1).min(height);
        let high = ((band + 1) * rows + 1).min(height);
        vectorised(
            #[inline(always)]
            || fit.band(low as u32..high as u32, offered),
        )
    };
    let bands: Vec<_> = bands.par_iter().enumerate().map(of_band).collect();
    // In the bands' order, so that sums are the same whatever the threads.
    let mut all: [Vec<f32>; 4] = from_fn(|_| vec![0.0; ldi.len() + LANES]);
    for (first, sums) in bands {
        for (all, sums) in all.iter_mut().zip(sums) {
            let all = &mut all[first..];
            all.iter_mut().zip(sums).for_each(|(all, sum)| *all += sum);
        }
    }
    let moved = |i: usize| {
        let mut color = ldi.color[i];
        if all[3][i] > 0.0 {
            for k in 0..3 {
                let moved = f32::from(color[k]) + all[k][i] / all[3][i];
                color[k] = moved.round().clamp(0.0, 255.0) as u8;
            }
        }
        color
    };
    (0..ldi.len()).map(moved).collect()
}

/// Of all lanes, by halves: as deep a sum as need be.
#[inline(always)]
fn sum_of(lanes: [f32; LANES]) -> f32 {
    let mut lanes = lanes;
    for half in [4, 2, 1] {
        for k in 0..half {
            lanes[k] += lanes[k + half];
        }
    }
    lanes[0]
}

/// The samples, property by property, as their own camera sees them.
struct Fit<'a> {
    ldi: &'a Layered,
    /// What makes the greater of two inverse depths of a surface the least of the other.
    same: f32,
    /// How far a sample counts to the sides and up and down, and how narrow its Gaussian is.
    reach: [Vec<f32>; 2],
    narrow: [Vec<f32>; 2],
    color: [Vec<f32>; 3],
}

impl<'a> Fit<'a> {
    fn new(ldi: &'a Layered, range: f64) -> Self {
        let options = FreeOptions::default().within_bounds();
        let sizes = Sizes::new(&ldi.camera, &ldi.camera);
        let halves: Vec<[f32; 2]> = ldi.look.iter().map(|look| sizes.half(*look)).collect();
        let of = |axis: usize, value: &dyn Fn(f32) -> f32| {
            let half = |half: &[f32; 2]| value(options.grow * half[axis]);
            halves.iter().map(half).collect()
        };
        Self {
            ldi,
            same: 1.0 - range as f32,
            reach: from_fn(|axis| of(axis, &|half| BEYOND * half)),
            narrow: from_fn(|axis| of(axis, &|half| narrowness(options.deviation, half))),
            color: from_fn(|k| ldi.color.iter().map(|color| f32::from(color[k])).collect()),
        }
    }

    /// By sample of some rows, from the first of them on: what to add to red, green and blue, times the
    /// weight, and the weight.
    #[inline(always)]
    fn band(&self, rows: Range<u32>, offered: &[Offered]) -> (usize, [Vec<f32>; 4]) {
        let ldi = self.ldi;
        let [width, height] = ldi.size();
        let first = ldi.samples_of(0..0, rows.start).start;
        let end = ldi.samples_of(0..width, rows.end.max(1) - 1).end.max(first);
        let mut sums: [Vec<f32>; 4] = from_fn(|_| vec![0.0; end - first + LANES]);
        let mut around: Vec<(usize, [f32; LANES])> = Vec::new();
        for offered in offered {
            let (x, y) = (offered.pixel % width, offered.pixel / width);
            let [dx, dy] = offered.sample.offset.map(|o| f32::from(o) / 256.0);
            let s = offered.sample.inverse_depth;
            // 1. What is drawn there.
            around.clear();
            let mut drawn = [[0.0; LANES]; 4];
            for row in y.saturating_sub(1)..(y + 2).min(height) {
                let at = [x as f32 + 0.5 + dx, y as f32 - row as f32 + dy];
                let samples = ldi.samples_of(x.saturating_sub(1)..x + 2, row);
                for block in samples.clone().step_by(LANES) {
                    let Some(weights) = self.weights(block, at, s, samples.end - block) else {
                        continue;
                    };
                    for k in 0..LANES {
                        drawn[3][k] += weights[k];
                    }
                    for (drawn, color) in drawn.iter_mut().zip(&self.color) {
                        for k in 0..LANES {
                            drawn[k] += weights[k] * color[block + k];
                        }
                    }
                    around.push((block, weights));
                }
            }
            let [r, g, b, sum] = drawn.map(sum_of);
            if !(sum > 0.0) {
                continue;
            }
            // 2. What is missing, to be added by those that count there, as they count.
            let scale = 1.0 / sum;
            let given = offered.sample.color;
            let missing = [r, g, b].map(|v| scale * v);
            let missing: [f32; 3] = from_fn(|k| f32::from(given[k]) - missing[k]);
            for (block, weights) in &around {
                let at = block - first;
                let shares: [f32; LANES] = from_fn(|k| scale * weights[k]);
                let [red, green, blue, sum] = &mut sums;
                let colors = [red, green, blue].into_iter().zip(missing);
                for (sums, missing) in colors.chain([(sum, 1.0)]) {
                    let sums: &mut [f32; LANES] =
                        (&mut sums[at..at + LANES]).try_into().expect("as many");
                    for k in 0..LANES {
                        sums[k] += shares[k] * missing;
                    }
                }
            }
        }
        (first, sums)
    }

    /// How much samples from one on, of a row, count at a place, from the row's middle, on a surface: so many.
    /// `None` where none does.
    #[inline(always)]
    fn weights(&self, from: usize, at: [f32; 2], s: f32, count: usize) -> Option<[f32; LANES]> {
        let list = |list: &[f32]| -> [f32; LANES] {
            let list = &list[from..from + LANES];
            list.try_into().expect("as many")
        };
        let (x, y, others) = (
            list(&self.ldi.x),
            list(&self.ldi.y),
            list(&self.ldi.inverse_depth),
        );
        let [right, down] = self.reach.each_ref().map(|reach| list(reach));
        let mut counts = [false; LANES];
        for k in 0..LANES {
            let d = [at[0] - x[k], at[1] - y[k]];
            let is_same = s.min(others[k]) >= self.same * s.max(others[k]);
            let is_within = (d[0].abs() <= right[k]) & (d[1].abs() <= down[k]);
            counts[k] = is_same & is_within & (k < count);
        }
        // Half of the rows are out of reach.
        if !counts.iter().fold(false, |any, counts| any | counts) {
            return None;
        }
        let [narrow_x, narrow_y] = self.narrow.each_ref().map(|narrow| list(narrow));
        let mut weights = [0.0; LANES];
        for k in 0..LANES {
            let d = [at[0] - x[k], at[1] - y[k]];
            let weight = gaussian(d[0] * d[0] * narrow_x[k]) * gaussian(d[1] * d[1] * narrow_y[k]);
            weights[k] = if counts[k] { weight } else { 0.0 };
        }
        Some(weights)
    }
}
