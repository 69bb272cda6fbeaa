//! The warp in any order: the default.
//!
//! 1. Where samples fall, and how large they are there; sorted by bands of the picture.
//! 2. In each band the nearest depth of every pixel, of what splats cover.
//! 3. The mean, with Gaussian weights, of all samples within a few per cent of that depth.
//!
//! A band adds up its samples in the LDI's order, so the bytes do not depend on threads.

mod band;
mod place;

use super::ends::Ends;
use super::fill::fill;
use super::look::Sizes;
use super::project::Projection;
use super::{Clipped, Layered};
use crate::cpu::lanes::vectorised;
use crate::interior::{Pinhole, Target, Window};
use band::{BAND, Band};
pub(super) use band::{gaussian, narrowness};
use place::{Chunk, Work};
use rayon::prelude::*;
use std::ops::Range;

/// How it is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeOptions {
    /// Samples within this share of the nearest depth are one surface.
    pub tolerance: f32,
    /// The Gaussian's deviation, in half sides of the sample's patch.
    pub deviation: f32,
    /// What of half a side a patch covers where its surface ends.
    pub end: f32,
    /// What patches are made larger by, so that few gaps are left between neighbours.
    pub grow: f32,
    /// The least half side of a patch, in pixels.
    pub least: f32,
    /// What a patch is made larger by, again, for pixels that no patch covers, 1 to 4.
    pub wide: f32,
    /// The least half side of those, in pixels.
    pub least_wide: f32,
    /// The greatest, up to 4.
    pub most: f32,
    /// Holes up to this wide, or high, in pixels, are filled; 0 leaves all.
    pub fill: u32,
}

/// The width of pictures that the defaults are for.
const USUAL_WIDTH: u32 = 640;

impl FreeOptions {
    /// How far from its place a sample is drawn at most, in pixels.
    pub fn reach(&self) -> f32 {
        // What is beyond a patch counts only where another covers.
        BEYOND * self.within_bounds().most
    }

    /// The same for a picture so wide: where the same holes are of more pixels, as many more are filled.
    pub fn for_width(mut self, width: u32) -> Self {
        self.fill = self.fill.saturating_mul(width.div_ceil(USUAL_WIDTH).max(1));
        self
    }

    pub(crate) fn within_bounds(&self) -> Options {
        Options::of(self)
    }
}

impl Default for FreeOptions {
    fn default() -> Self {
        Self {
            tolerance: 0.06,
            deviation: 0.48,
            end: 0.2,
            grow: 1.5,
            least: 0.5,
            wide: 1.2,
            least_wide: 1.5,
            most: 4.0,
            fill: 8,
        }
    }
}

/// What a warp took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FreeCost {
    /// Samples looked at: those in columns that were not clipped.
    pub samples: usize,
    /// Those that reach the window's rows and columns.
    pub drawn: usize,
    /// Pixels of the window.
    pub pixels: usize,
    /// Those of them that no sample reaches.
    pub holes: usize,
    /// Those left after filling.
    pub unfilled: usize,
}

/// What is kept between frames: memory.
#[derive(Debug, Default)]
pub struct Free {
    chunks: Vec<Chunk>,
    bands: Vec<Band>,
}

/// Rows of the LDI in a chunk.
const CHUNK: u32 = 16;
/// How far beyond its patch a sample counts, in half sides, for pixels that another covers.
pub(crate) const BEYOND: f32 = 1.25;
/// The greatest half side of a patch, and what a Gaussian may reach.
const MOST: f32 = 4.0;

/// The pixels of a window: from the least to the greatest column and row.
pub(crate) fn bounds(window: &Window, into: &Target) -> Option<[Range<u32>; 2]> {
    let open = |y: u32| {
        let row = window.row(y);
        row.start..row.end.min(into.width)
    };
    let rows = (0..into.height).filter(|y| !open(*y).is_empty());
    let (mut low, mut high) = ([u32::MAX; 2], [0; 2]);
    for y in rows {
        let row = open(y);
        low = [low[0].min(row.start), low[1].min(y)];
        high = [high[0].max(row.end), high[1].max(y + 1)];
    }
    (low[0] < high[0]).then(|| [low[0]..high[0], low[1]..high[1]])
}

/// By band of a window's rows the columns, from its first one on, that are open in any of them: from …
/// to.
fn open_by_band(window: &Window, into: &Target, [across, down]: [&Range<u32>; 2]) -> Vec<[u32; 2]> {
    let of_band = |first: u32| {
        let rows = first..(first + BAND as u32).min(down.end);
        rows.map(|y| window.row(y))
            .map(|row| [row.start, row.end.min(into.width)])
            .filter(|[start, end]| start < end)
            .map(|row| row.map(|x| x - across.start))
            .reduce(|[a, b], [start, end]| [a.min(start), b.max(end)])
            .unwrap_or_default()
    };
    down.clone().step_by(BAND).map(of_band).collect()
}

/// Draws the columns of an LDI that are left as a desired camera sees them, in the pixels of a
/// window, over what is there. Nothing is drawn where the picture's size is not the camera's.
pub fn free(
    ldi: &Layered,
    columns: &Clipped,
    desired: &Pinhole,
    window: &Window,
    options: &FreeOptions,
    scratch: &mut Free,
    into: &mut Target,
) -> FreeCost {
    let mut cost = FreeCost::default();
    if (into.width, into.height) != (desired.width, desired.height) {
        return cost;
    }
    let Some([across, down]) = bounds(window, into) else {
        return cost;
    };
    let width = across.len();
    let open: Vec<[u32; 2]> = open_by_band(window, into, [&across, &down]);
    let band_count = open.len();
    // 1.
    let origin = [across.start as i32, down.start as i32];
    let projection = Projection::new(ldi, desired, origin);
    let sizes = Sizes::new(&ldi.camera, desired);
    let height = ldi.size()[1];
    let work = Work {
        ldi,
        columns,
        projection: &projection,
        sizes: &sizes,
        options: options.within_bounds(),
        size: [width as f32, down.len() as f32],
        open: &open,
    };
    let chunk_count = height.div_ceil(CHUNK) as usize;
    scratch
        .chunks
        .resize_with(chunk_count.max(scratch.chunks.len()), Chunk::default);
    let chunks = &mut scratch.chunks[..chunk_count];
    let place = |(i, chunk): (usize, &mut Chunk)| {
        let rows = i as u32 * CHUNK..((i + 1) as u32 * CHUNK).min(height);
        vectorised(
            #[inline(always)]
            || work.place(rows, chunk),
        );
    };
    chunks.par_iter_mut().enumerate().for_each(place);
    cost.samples = chunks.iter().map(|c| c.samples).sum();
    cost.drawn = chunks.iter().map(|c| c.drawn).sum();
    // 2 and 3.
    scratch
        .bands
        .resize_with(band_count.max(scratch.bands.len()), Band::default);
    let chunks = &scratch.chunks[..chunk_count];
    let draw = |(i, band): (usize, &mut Band)| {
        let lists = chunks.iter().map(|chunk| chunk.bands[i].as_slice());
        vectorised(
            #[inline(always)]
            || band.draw(lists, i, width, open[i], work.options),
        );
    };
    let bands = &mut scratch.bands[..band_count];
    bands.par_iter_mut().enumerate().for_each(draw);
    // 4. Into the picture.
    let bands = &scratch.bands[..band_count];
    let picture = into.width as usize;
    let rows = down.start as usize * picture..down.end as usize * picture;
    let colors = into.color[rows.clone()].par_chunks_mut(BAND * picture);
    let depths = into.inverse_depth[rows].par_chunks_mut(BAND * picture);
    let resolve = |(i, (colors, depths)): (usize, (&mut [[u8; 4]], &mut [f32]))| {
        let first = down.start + (i * BAND) as u32;
        let mut open = [const { 0..0 }; BAND];
        for (y, open) in open.iter_mut().enumerate().take(colors.len() / picture) {
            let row = window.row(first + y as u32);
            *open = row.start as usize..row.end.min(across.end) as usize;
        }
        resolve(
            &bands[i],
            &open,
            across.start as usize,
            picture,
            colors,
            depths,
        )
    };
    let counts = colors.zip(depths).enumerate().map(resolve);
    (cost.pixels, cost.holes) = counts.reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    cost.unfilled = match (options.fill, cost.holes) {
        (0, _) | (_, 0) => cost.holes,
        (reach, _) => fill(window, [&across, &down], reach, into),
    };
    cost
}

/// Colours and depths of a band's rows where they are open, out of a band that begins at a column of the
/// picture; how many pixels, and how many of them are holes.
fn resolve(
    band: &Band,
    open: &[Range<usize>; BAND],
    start: usize,
    width: usize,
    colors: &mut [[u8; 4]],
    depths: &mut [f32],
) -> (usize, usize) {
    let (mut pixels, mut holes) = (0, 0);
    let is_any = open.iter().filter(|row| !row.is_empty());
    let (from, to) = is_any.fold((usize::MAX, 0), |(from, to), row| {
        (from.min(row.start), to.max(row.end))
    });
    // As numbers lie in the band.
    for x in from..to {
        for (y, open) in open.iter().enumerate() {
            if !open.contains(&x) {
                continue;
            }
            pixels += 1;
            let i = y * width + x;
            let ([r, g, b, weight], nearest) = band.at(x - start, y);
            if weight > 0.0 {
                let scale = 1.0 / weight;
                let code = |sum: f32| (sum * scale + 0.5) as u8;
                colors[i] = [code(r), code(g), code(b), 255];
                depths[i] = nearest;
            } else {
                holes += 1;
                (colors[i], depths[i]) = ([0; 4], 0.0);
            }
        }
    }
    (pixels, holes)
}

/// The options, within their bounds.
#[derive(Clone, Copy)]
pub(crate) struct Options {
    /// What makes the nearest inverse depth the farthest of the same surface.
    pub(crate) nearer: f32,
    pub(crate) deviation: f32,
    pub(crate) end: f32,
    pub(crate) grow: f32,
    pub(crate) least: f32,
    pub(crate) wide: f32,
    pub(crate) least_wide: f32,
    pub(crate) most: f32,
}

impl Options {
    fn of(options: &FreeOptions) -> Self {
        let within = |v: f32, low: f32, high: f32| if v > low { v.min(high) } else { low };
        let least = within(options.least, 0.5, MOST);
        let least_wide = within(options.least_wide, least, MOST);
        Self {
            nearer: 1.0 - within(options.tolerance, 0.0, 0.5),
            deviation: within(options.deviation, 0.2, 2.0),
            end: within(options.end, 0.0, 1.0),
            grow: within(options.grow, 0.1, 10.0),
            least,
            wide: within(options.wide, 1.0, 4.0),
            least_wide,
            most: within(options.most, least_wide, MOST),
        }
    }

    /// By where its surface ends, what of half a side a patch covers to the right, below, to the left
    /// and above.
    fn covered(&self) -> [[f32; 4]; 16] {
        std::array::from_fn(|bits| Ends(bits as u8).covered(self.end))
    }

    /// Half a side of what a patch of that half side covers if nothing else does.
    #[inline(always)]
    fn wide_half(&self, half: f32) -> f32 {
        (half * self.wide).max(self.least_wide).min(self.most)
    }
}
