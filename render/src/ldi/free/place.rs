//! Where samples fall and how large they are there.

use super::band::{BAND, Drawn, first_within, narrowness};
use super::{BEYOND, Options};
use crate::cpu::lanes::whole;
use crate::ldi::look::Sizes;
use crate::ldi::project::{Block, LANES, Projection};
use crate::ldi::{Clipped, Layered};
use std::ops::Range;

/// Rows of the LDI worked on together, and what of them falls in each band of the picture.
#[derive(Debug, Default)]
pub(super) struct Chunk {
    pub(super) bands: Vec<Vec<Drawn>>,
    pub(super) samples: usize,
    pub(super) drawn: usize,
}

/// What all rows have in common.
pub(super) struct Work<'a> {
    pub(super) ldi: &'a Layered,
    pub(super) columns: &'a Clipped,
    pub(super) projection: &'a Projection,
    pub(super) sizes: &'a Sizes,
    pub(super) options: Options,
    pub(super) size: [f32; 2],
    /// By band of the picture, the columns that the window leaves open in any of its rows: from … to.
    pub(super) open: &'a [[u32; 2]],
}

impl Work<'_> {
    #[inline(always)]
    pub(super) fn place(&self, rows: Range<u32>, chunk: &mut Chunk) {
        let band_count = self.open.len();
        chunk
            .bands
            .resize_with(band_count.max(chunk.bands.len()), Vec::new);
        chunk.bands.iter_mut().for_each(Vec::clear);
        (chunk.samples, chunk.drawn) = (0, 0);
        let mut block = Block::EMPTY;
        let Options {
            least, most, grow, ..
        } = self.options;
        let [width, height] = self.size;
        let mut ready = Ready::EMPTY;
        for row in rows {
            let base = self.projection.row(row);
            for columns in self.columns.of_row(row) {
                let samples = self.ldi.samples_of(columns.clone(), row);
                chunk.samples += samples.len();
                for first in samples.clone().step_by(LANES) {
                    self.projection.block(base, self.ldi, first, &mut block);
                    let looks = &self.ldi.look[first..first + LANES];
                    for k in 0..LANES {
                        [ready.half[0][k], ready.half[1][k]] = self.sizes.half(looks[k]);
                    }
                    for k in 0..LANES {
                        let (x, y) = (block.x[k], block.y[k]);
                        ready.is_seen[k] = (block.scale[k] > 0.0)
                            & (x > -most)
                            & (x < width + most)
                            & (y > -most)
                            & (y < height + most);
                    }
                    for (axis, at) in [&block.x, &block.y].into_iter().enumerate() {
                        for k in 0..LANES {
                            let half = ready.half[axis][k] * (grow * block.scale[k]);
                            let half = half.max(least).min(most);
                            ready.half[axis][k] = half;
                            ready.narrow[axis][k] = narrowness(self.options.deviation, half);
                            let at = if ready.is_seen[k] { at[k] } else { 0.0 };
                            (ready.first[axis][k], ready.offset[axis][k]) =
                                first_within(at, BEYOND * half);
                        }
                    }
                    for k in 0..LANES {
                        // A pixel's middle is half a pixel off, and the rest is for rounding.
                        let reach =
                            |half: f32| (BEYOND * half).max(self.options.wide_half(half)) + 0.51;
                        let y = if ready.is_seen[k] { block.y[k] } else { 0.0 };
                        let down = reach(ready.half[1][k]);
                        // Less than a band above the first one.
                        let band_of = |y: f32| whole(y + BAND as f32).1 / BAND as i32 - 1;
                        ready.bands[0][k] = band_of(y - down);
                        ready.bands[1][k] = band_of(y + down);
                        let across = reach(ready.half[0][k]);
                        ready.sides[0][k] = block.x[k] - across;
                        ready.sides[1][k] = block.x[k] + across;
                    }
                    for k in 0..LANES.min(samples.end - first) {
                        if !ready.is_seen[k] {
                            continue;
                        }
                        chunk.drawn += 1;
                        let [r, g, b, _] = self.ldi.color[first + k];
                        let ends = self.ldi.ends[first + k].turned(self.projection.turn);
                        let drawn = Drawn {
                            offset: [ready.offset[0][k], ready.offset[1][k]],
                            inverse_depth: block.inverse_depth[k],
                            half: [ready.half[0][k], ready.half[1][k]],
                            narrow: [ready.narrow[0][k], ready.narrow[1][k]],
                            first: [ready.first[0][k] as i16, ready.first[1][k] as i16],
                            color: [r, g, b],
                            ends,
                        };
                        let from = ready.bands[0][k].max(0) as usize;
                        let to = (ready.bands[1][k].max(0) as usize).min(band_count - 1);
                        let (left, right) = (ready.sides[0][k], ready.sides[1][k]);
                        for band in from..=to {
                            // Of what only closed pixels would show nothing is seen.
                            let [start, end] = self.open[band].map(|x| x as f32);
                            if left <= end && right >= start {
                                chunk.bands[band].push(drawn);
                            }
                        }
                    }
                }
            }
        }
    }
}

/// What is worked out of a block's samples.
struct Ready {
    is_seen: [bool; LANES],
    half: [[f32; LANES]; 2],
    narrow: [[f32; LANES]; 2],
    first: [[i32; LANES]; 2],
    offset: [[f32; LANES]; 2],
    /// The first and the last band it may reach.
    bands: [[i32; LANES]; 2],
    /// From where to where it reaches across.
    sides: [[f32; LANES]; 2],
}

impl Ready {
    const EMPTY: Self = Self {
        is_seen: [false; LANES],
        half: [[0.0; LANES]; 2],
        narrow: [[0.0; LANES]; 2],
        first: [[0; LANES]; 2],
        offset: [[0.0; LANES]; 2],
        bands: [[0; LANES]; 2],
        sides: [[0.0; LANES]; 2],
    };
}
