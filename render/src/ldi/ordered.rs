//! The papers' warp: back to front, without depths.
//!
//! With several fragments they are drawn at once, but for the samples whose stamps may reach
//! another one's. Those pixels are then cleared, and all samples that reach them are drawn again
//! in the one order that there is. So the bytes are those of one fragment. Where half a pixel of the LDI
//! is so large that a sample lies far beyond the cut that its pixel's middle is on this side of, all is
//! drawn as one fragment.

use super::fragments::{Pieces, Wedge, overlap};
use super::free::bounds;
use super::look::Sizes;
use super::order::{Run, Traversal};
use super::project::{Block, LANES, Projection};
use super::splat::{Stamp, blend, pack, unpack};
use super::{Clipped, Layered};
use crate::cpu::lanes::vectorised;
use crate::interior::{Pinhole, Target, Warp, Window};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// How it is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OrderedOptions {
    /// How large samples are.
    pub stamp: Stamp,
    /// How many fragments; pictures are the same.
    pub fragments: usize,
}

impl Default for OrderedOptions {
    fn default() -> Self {
        Self {
            stamp: Stamp::default(),
            fragments: 1,
        }
    }
}

/// What a warp took.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OrderedCost {
    /// Samples looked at: those in columns that were not clipped.
    pub samples: usize,
    /// Those that reach the window's rows and columns.
    pub drawn: usize,
    /// Those that were left to buffer zones.
    pub buffer: usize,
    /// Those drawn a second time beside them.
    pub again: usize,
    /// By fragment, samples looked at; of one where no cut was of use.
    pub areas: Vec<usize>,
}

/// What is kept between frames: memory.
#[derive(Default)]
pub struct Ordered {
    canvas: Vec<AtomicU64>,
    is_dirty: Vec<bool>,
}

/// Pixels beside the window's box that may be written to.
const MARGIN: i32 = 8;
/// How far places may be off by rounding, in pixels.
const SLACK: f64 = 0.25;
/// Rows that are drawn again at once.
const BAND: usize = 32;

/// Draws the columns of an LDI that are left as a desired camera sees them, over what is there,
/// in the pixels of a window. Nothing is drawn where the picture's size is not the camera's.
pub fn ordered(
    ldi: &Layered,
    columns: &Clipped,
    desired: &Pinhole,
    window: &Window,
    options: &OrderedOptions,
    scratch: &mut Ordered,
    into: &mut Target,
) -> OrderedCost {
    let traversal = Traversal::new(ldi, desired);
    ordered_by(
        &traversal, ldi, columns, desired, window, options, scratch, into,
    )
}

/// [`ordered`] in an order of one's own, even a wrong one.
pub fn ordered_by(
    traversal: &Traversal,
    ldi: &Layered,
    columns: &Clipped,
    desired: &Pinhole,
    window: &Window,
    options: &OrderedOptions,
    scratch: &mut Ordered,
    into: &mut Target,
) -> OrderedCost {
    let mut cost = OrderedCost::default();
    if (into.width, into.height) != (desired.width, desired.height) {
        return cost;
    }
    let Some([across, down]) = bounds(window, into) else {
        return cost;
    };
    let origin = [across.start as i32 - MARGIN, down.start as i32 - MARGIN];
    let stride = across.len() + 2 * MARGIN as usize;
    let height = down.len() + 2 * MARGIN as usize;
    let reach = options.stamp.reach() as i32;
    let [low, high] = [MARGIN - reach, reach - MARGIN];
    let sizes = (options.stamp == Stamp::Sized).then(|| Sizes::new(&ldi.camera, desired));
    let work = Work {
        ldi,
        columns,
        traversal,
        projection: Projection::new(ldi, desired, origin),
        sizes: sizes.as_ref(),
        stamp: options.stamp,
        stride,
        low: low as f32,
        high: [stride as i32 + high, height as i32 + high].map(|v| v as f32),
        ranks: Ranks::new(ldi, traversal),
    };
    scratch
        .canvas
        .resize_with(stride * height, AtomicU64::default);
    let canvas = &mut scratch.canvas;
    clear(canvas);
    // 1. Fragments, each in order.
    let warp = Warp::new(&ldi.camera, desired);
    let mut is_drawn = false;
    if options.fragments > 1 {
        let (f, c) = (ldi.camera.focal, ldi.camera.principal);
        let epipole = DVec3::new(
            f.x * warp.center.x + c.x * warp.center.z,
            f.y * warp.center.y + c.y * warp.center.z,
            warp.center.z,
        );
        let pieces = Pieces::new(ldi, columns, epipole, options.fragments);
        let wedges = pieces.wedges.iter();
        let fences: Vec<Fence> = wedges
            .map(|w| Fence::new(w, &warp, options.stamp))
            .collect();
        let cells = &*canvas;
        let draw = |(spans, fence): (&Vec<(u32, Range<u32>)>, &Fence)| {
            let mut part = Part::default();
            vectorised(
                #[inline(always)]
                || work.draw(Some(spans), Some(fence), cells, &mut part),
            );
            part
        };
        let all = pieces.spans.par_iter().zip(&fences).with_max_len(1);
        let parts: Vec<Part> = all.map(draw).collect();
        is_drawn = !parts.iter().any(|part| part.has_strays);
        if !is_drawn {
            clear(canvas);
        }
        for part in parts.iter().filter(|_| is_drawn) {
            cost.samples += part.samples;
            cost.drawn += part.drawn;
            cost.areas.push(part.samples);
        }
        // 2. What lies between.
        let zone = parts.into_iter().filter(|_| is_drawn);
        let mut zone: Vec<Kept> = zone.flat_map(|part| part.zone).collect();
        zone.par_sort_unstable_by_key(|kept| kept.rank);
        cost.buffer = zone.iter().filter(|kept| kept.is_buffer).count();
        cost.again = zone.len() - cost.buffer;
        scratch.is_dirty.clear();
        scratch.is_dirty.resize(stride * height, false);
        work.draw_again(&zone, canvas, &mut scratch.is_dirty);
    }
    if !is_drawn {
        let mut part = Part::default();
        vectorised(
            #[inline(always)]
            || work.draw(None, None, canvas, &mut part),
        );
        (cost.samples, cost.drawn) = (part.samples, part.drawn);
        cost.areas = vec![part.samples];
    }
    // 3. Into the picture.
    let picture = into.width as usize;
    let rows = down.start as usize * picture..down.end as usize * picture;
    let colors = into.color[rows.clone()].par_chunks_mut(picture);
    let rows = colors.zip(into.inverse_depth[rows].par_chunks_mut(picture));
    let canvas = &mut scratch.canvas[MARGIN as usize * stride..];
    let all = rows.zip(canvas.par_chunks_mut(stride)).enumerate();
    all.for_each(|(y, ((colors, depths), cells))| {
        let open = window.row(down.start + y as u32);
        let open = open.start as usize..open.end.min(across.end) as usize;
        let shift = MARGIN as usize;
        for x in open {
            let value = *cells[x - across.start as usize + shift].get_mut();
            if value != 0 {
                (colors[x], depths[x]) = unpack(value);
            }
        }
    });
    cost
}

fn clear(canvas: &mut [AtomicU64]) {
    canvas.par_chunks_mut(1 << 14).for_each(|part| {
        for cell in part {
            *cell.get_mut() = 0;
        }
    });
}

/// Where samples are in the order: how many come before each row.
struct Ranks {
    rows: Vec<u32>,
}

impl Ranks {
    fn new(ldi: &Layered, traversal: &Traversal) -> Self {
        let [width, height] = ldi.size();
        let mut rows = vec![0; height as usize];
        let mut sum = 0;
        for row in traversal.rows.iter().flat_map(Run::iter) {
            rows[row as usize] = sum;
            sum += ldi.samples_of(0..width, row).len() as u32;
        }
        Self { rows }
    }

    fn rank(&self, ldi: &Layered, runs: &[Run; 3], row: u32, sample: usize) -> u32 {
        let column = ldi.x[sample] as u32;
        let mut sum = self.rows[row as usize];
        for run in runs {
            let all = ldi.samples_of(run.range.clone(), row);
            if !run.range.contains(&column) {
                sum += all.len() as u32;
                continue;
            }
            let own = ldi.samples_of(column..column + 1, row);
            let before = match run.is_reversed {
                true => all.end - own.end,
                false => own.start - all.start,
            };
            return sum + (before + sample - own.start) as u32;
        }
        sum
    }
}

/// The lines at which a fragment ends, as distances in the desired image.
struct Fence {
    /// Of (x, y from the row's middle, row + 1/2), in pixels of the LDI: times the scale, a
    /// distance over what stamps reach.
    lines: [[f64; 3]; 2],
    is_convex: bool,
}

impl Fence {
    fn new(wedge: &Wedge, warp: &Warp, stamp: Stamp) -> Self {
        // The line's image: for all samples on it and all of their depths, l'·X = l·x.
        let inverse: DMat3 = warp.pixel_from_pixel.inverse();
        let reach = f64::from(stamp.reach()) + 1.0;
        let scaled = |line: DVec3| {
            // The line at infinity: everything is on one side of it.
            let nowhere = [0.0, 0.0, 1e30 * line.z.signum()];
            if line.x == 0.0 && line.y == 0.0 {
                return nowhere;
            }
            let image = inverse.transpose() * line;
            let length = image.truncate().length();
            // Along a line's normal a stamp reaches that far.
            let far = reach * (image.x.abs() + image.y.abs()) + SLACK * length;
            let scale = 1.0 / far;
            match scale.is_finite() && line.is_finite() {
                true => (line * scale).to_array(),
                false => nowhere,
            }
        };
        Self {
            lines: wedge.lines.map(scaled),
            is_convex: wedge.is_convex,
        }
    }
}

/// A sample beside a cut.
struct Kept {
    rank: u32,
    at: u32,
    class: u8,
    is_buffer: bool,
    value: u64,
}

/// What drawing a fragment leaves.
#[derive(Default)]
struct Part {
    samples: usize,
    drawn: usize,
    zone: Vec<Kept>,
    /// Whether a sample is drawn farther beyond a cut than zones are wide for.
    has_strays: bool,
}

/// Samples of a run, ready to be drawn.
#[derive(Default)]
struct Ready {
    /// The pixel on the canvas; [`NOWHERE`] of what is not seen.
    at: Vec<u32>,
    value: Vec<u64>,
    class: Vec<u8>,
    /// How far from the cuts, in reaches of stamps; negative beyond them.
    apart: Vec<f32>,
}

const NOWHERE: u32 = u32::MAX;

/// What all rows have in common.
struct Work<'a> {
    ldi: &'a Layered,
    columns: &'a Clipped,
    traversal: &'a Traversal,
    projection: Projection,
    sizes: Option<&'a Sizes>,
    stamp: Stamp,
    stride: usize,
    low: f32,
    high: [f32; 2],
    ranks: Ranks,
}

impl Work<'_> {
    /// Draws a fragment, or all.
    #[inline(always)]
    fn draw(
        &self,
        spans: Option<&Vec<(u32, Range<u32>)>>,
        fence: Option<&Fence>,
        canvas: &[AtomicU64],
        part: &mut Part,
    ) {
        let whole = 0..self.ldi.size()[0];
        let mut ready = Ready::default();
        for row in self.traversal.rows.iter().flat_map(Run::iter) {
            let everywhere = [(row, whole.clone())];
            let spans = match spans {
                None => &everywhere[..],
                Some(spans) => {
                    let from = spans.partition_point(|(y, _)| *y < row);
                    let to = spans.partition_point(|(y, _)| *y <= row);
                    &spans[from..to]
                }
            };
            if spans.is_empty() {
                continue;
            }
            let kept = self.columns.of_row(row);
            for run in &self.traversal.columns {
                // Ranges lie from left to right.
                let count = spans.len() * kept.len();
                for i in 0..count {
                    let i = if run.is_reversed { count - 1 - i } else { i };
                    let span = &spans[i / kept.len()].1;
                    let columns = &kept[i % kept.len()];
                    let columns = overlap(&overlap(span, columns), &run.range);
                    let samples = self.ldi.samples_of(columns, row);
                    if samples.is_empty() {
                        continue;
                    }
                    part.samples += samples.len();
                    self.place(row, samples.clone(), fence, &mut ready);
                    if run.is_reversed {
                        let mut end = samples.end;
                        while end > samples.start {
                            let column = self.ldi.x[end - 1] as u32;
                            let mut start = end - 1;
                            while start > samples.start && self.ldi.x[start - 1] as u32 == column {
                                start -= 1;
                            }
                            self.stamp(row, &samples, start..end, &ready, fence, canvas, part);
                            end = start;
                        }
                    } else {
                        self.stamp(row, &samples, samples.clone(), &ready, fence, canvas, part);
                    }
                }
            }
        }
    }

    /// Where samples of a row fall.
    #[inline(always)]
    fn place(&self, row: u32, samples: Range<usize>, fence: Option<&Fence>, ready: &mut Ready) {
        let base = self.projection.row(row);
        let room = samples.len() + LANES;
        ready.at.resize(room.max(ready.at.len()), 0);
        ready.value.resize(room.max(ready.value.len()), 0);
        ready.class.resize(room.max(ready.class.len()), 0);
        ready.apart.resize(room.max(ready.apart.len()), 0.0);
        let mut block = Block::EMPTY;
        let shift = self.stamp.shift();
        for first in samples.clone().step_by(LANES) {
            self.projection.block(base, self.ldi, first, &mut block);
            let to = first - samples.start..first - samples.start + LANES;
            let at = &mut ready.at[to.clone()];
            for k in 0..LANES {
                let (x, y) = (block.x[k] - shift, block.y[k] - shift);
                let is_seen = (block.scale[k] > 0.0)
                    & (x >= self.low)
                    & (x < self.high[0])
                    & (y >= self.low)
                    & (y < self.high[1]);
                let (x, y) = if is_seen { (x, y) } else { (0.0, 0.0) };
                let index = y as i32 as u32 * self.stride as u32 + x as i32 as u32;
                at[k] = if is_seen { index } else { NOWHERE };
            }
            let colors = &self.ldi.color[first..first + LANES];
            let value = &mut ready.value[to.clone()];
            for k in 0..LANES {
                value[k] = pack(colors[k], block.inverse_depth[k]);
            }
            if let Some(sizes) = self.sizes {
                let looks = &self.ldi.look[first..first + LANES];
                let class = &mut ready.class[to.clone()];
                for k in 0..LANES {
                    let half = sizes.half(looks[k]).map(|h| h * block.scale[k]);
                    class[k] = Stamp::class(half);
                }
            }
            if let Some(fence) = fence {
                let xs = &self.ldi.x[first..first + LANES];
                let ys = &self.ldi.y[first..first + LANES];
                let middle = f64::from(row) + 0.5;
                let [a, b] = fence
                    .lines
                    .map(|[x, y, w]| [x, y, y * middle + w].map(|v| v as f32));
                let apart = &mut ready.apart[to];
                for k in 0..LANES {
                    let off = |l: [f32; 3]| (l[0] * xs[k] + l[1] * ys[k] + l[2]) * block.scale[k];
                    let (a, b) = (off(a), off(b));
                    let nearer = a.abs().min(b.abs());
                    // How far it lies within.
                    let inside = match fence.is_convex {
                        true => a.min(b),
                        false => a.max(b),
                    };
                    apart[k] = if inside > 0.0 { nearer } else { inside };
                }
            }
        }
    }

    #[inline(always)]
    fn stamp(
        &self,
        row: u32,
        samples: &Range<usize>,
        some: Range<usize>,
        ready: &Ready,
        fence: Option<&Fence>,
        canvas: &[AtomicU64],
        part: &mut Part,
    ) {
        for i in some {
            let k = i - samples.start;
            let at = ready.at[k];
            if at == NOWHERE {
                continue;
            }
            part.drawn += 1;
            let (class, value) = (ready.class[k], ready.value[k]);
            if fence.is_some() {
                let apart = ready.apart[k];
                let is_buffer = !(apart >= 1.0);
                // A sample of the buffer is within one reach of a cut, on either side, and so is what it
                // draws of it; what reaches that is within three.
                part.has_strays |= !(apart >= -1.0);
                if !(apart >= 3.0) {
                    part.zone.push(Kept {
                        rank: self.ranks.rank(self.ldi, &self.traversal.columns, row, i),
                        at,
                        class,
                        is_buffer,
                        value,
                    });
                }
                if is_buffer {
                    continue;
                }
            }
            self.stamp
                .draw(at as usize, class, self.stride, |pixel, share| {
                    let cell = &canvas[pixel];
                    let below = match self.stamp {
                        Stamp::Sized => cell.load(Relaxed),
                        _ => 0,
                    };
                    cell.store(blend(below, value, share), Relaxed);
                });
        }
    }

    /// Draws what reaches the buffer zones, in order.
    fn draw_again(&self, zone: &[Kept], canvas: &mut [AtomicU64], is_dirty: &mut [bool]) {
        let buffer = zone.iter().filter(|kept| kept.is_buffer);
        for kept in buffer {
            let at = kept.at as usize;
            self.stamp.draw(at, kept.class, self.stride, |pixel, _| {
                is_dirty[pixel] = true
            });
        }
        // Rows of the canvas at once, each in the same order.
        let rows = BAND * self.stride;
        let reach = self.stamp.reach() as usize * (self.stride + 1);
        let bands = canvas.par_chunks_mut(rows).enumerate();
        bands.for_each(|(i, cells)| {
            let first = i * rows;
            let is_dirty = &is_dirty[first..first + cells.len()];
            for (cell, is_dirty) in cells.iter_mut().zip(is_dirty) {
                if *is_dirty {
                    *cell.get_mut() = 0;
                }
            }
            for kept in zone {
                let at = kept.at as usize;
                if at + reach < first || at >= first + rows + reach {
                    continue;
                }
                self.stamp
                    .draw(at, kept.class, self.stride, |pixel, share| {
                        let here = pixel.wrapping_sub(first);
                        if here < cells.len() && is_dirty[here] {
                            let cell = cells[here].get_mut();
                            *cell = blend(*cell, kept.value, share);
                        }
                    });
            }
        });
    }
}
