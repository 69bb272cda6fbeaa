//! The warp in any order: the default.
//!
//! 1. Where samples fall, and how large they are there; sorted by bands of the picture.
//! 2. In each band the nearest depth of every pixel, of what splats cover.
//! 3. The mean, with Gaussian weights, of all samples within a few per cent of that depth.
//!
//! A band adds up its samples in the LDI's order, so the bytes do not depend on threads.

use super::fill::fill;
use super::look::Sizes;
use super::project::{Block, LANES, Projection};
use super::{Clipped, Layered};
use crate::cpu::lanes::vectorised;
use crate::interior::{Pinhole, Target, Window};
use rayon::prelude::*;
use std::ops::Range;

/// How it is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeOptions {
    /// Samples within this share of the nearest depth are one surface.
    pub tolerance: f32,
    /// The Gaussian's deviation, in half sides of the sample's patch.
    pub deviation: f32,
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

impl FreeOptions {
    /// How far from its place a sample is drawn at most, in pixels.
    pub fn reach(&self) -> f32 {
        // What is beyond a patch counts only where another covers.
        BEYOND * self.within_bounds().most
    }

    pub(crate) fn within_bounds(&self) -> Options {
        Options::of(self)
    }
}

impl Default for FreeOptions {
    fn default() -> Self {
        Self {
            tolerance: 0.05,
            deviation: 0.7,
            grow: 1.3,
            least: 0.6,
            wide: 1.6,
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

/// A sample as it will be drawn.
#[derive(Clone, Copy, Debug)]
struct Drawn {
    x: f32,
    y: f32,
    inverse_depth: f32,
    /// Half a side of the patch.
    half: [f32; 2],
    /// The first column and row within reach, from the margin's.
    first: [i16; 2],
    color: [u8; 4],
}

/// What is kept between frames: memory.
#[derive(Debug, Default)]
pub struct Free {
    chunks: Vec<Chunk>,
    bands: Vec<Band>,
}

/// Rows of the LDI worked on together, and what of them falls in each band of the picture.
#[derive(Debug, Default)]
struct Chunk {
    bands: Vec<Vec<Drawn>>,
    samples: usize,
    drawn: usize,
}

/// Rows of the picture.
#[derive(Debug, Default)]
struct Band {
    /// The nearest inverse depth, then what is behind that the same surface.
    nearest: Vec<f32>,
    /// The same of wide patches.
    widest: Vec<f32>,
    /// By columns of pixels, whether there is a hole in or beside them, and the samples there.
    holes: Vec<bool>,
    beside: Vec<Drawn>,
    /// Red, green, blue, weight: plane by plane.
    sums: [Vec<f32>; 4],
}

/// Rows of the LDI in a chunk, and of the picture in a band.
const CHUNK: u32 = 16;
const BAND: usize = 16;
/// Pixels worked on together, and those beside the picture that may be written to.
const WIDE: usize = 4;
const MARGIN: usize = 16;
/// Pixels across that have their holes found together.
const COLUMN: usize = 8;
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
    let band_count = down.len().div_ceil(BAND);
    let stride = width + 2 * MARGIN;
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
        band_count,
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
            || band.draw(lists, i, stride, work.options),
        );
    };
    let bands = &mut scratch.bands[..band_count];
    bands.par_iter_mut().enumerate().for_each(draw);
    // 4. Into the picture.
    let bands = &scratch.bands[..band_count];
    let picture = into.width as usize;
    let rows = down.start as usize * picture..down.end as usize * picture;
    let colors = into.color[rows.clone()].par_chunks_mut(picture);
    let rows = colors.zip(into.inverse_depth[rows].par_chunks_mut(picture));
    let resolve = |(y, (colors, depths)): (usize, (&mut [[u8; 4]], &mut [f32]))| {
        let open = window.row(down.start + y as u32);
        let open = open.start as usize..open.end.min(across.end) as usize;
        let start = (y % BAND) * stride + MARGIN;
        let band = &bands[y / BAND];
        let mut holes = 0;
        for x in open.clone() {
            let i = start + x - across.start as usize;
            let weight = band.sums[3][i];
            if weight > 0.0 {
                let scale = 1.0 / weight;
                let channel = |k: usize| (band.sums[k][i] * scale + 0.5) as u8;
                colors[x] = [channel(0), channel(1), channel(2), 255];
                depths[x] = band.nearest[i];
            } else {
                holes += 1;
                (colors[x], depths[x]) = ([0; 4], 0.0);
            }
        }
        (open.len(), holes)
    };
    let counts = rows.enumerate().map(resolve);
    (cost.pixels, cost.holes) = counts.reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    cost.unfilled = match (options.fill, cost.holes) {
        (0, _) | (_, 0) => cost.holes,
        (reach, _) => fill(window, [&across, &down], reach, into),
    };
    cost
}

/// The options, within their bounds.
#[derive(Clone, Copy)]
pub(crate) struct Options {
    /// What makes the nearest inverse depth the farthest of the same surface.
    pub(crate) nearer: f32,
    pub(crate) deviation: f32,
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
            grow: within(options.grow, 0.1, 10.0),
            least,
            wide: within(options.wide, 1.0, 4.0),
            least_wide,
            most: within(options.most, least_wide, MOST),
        }
    }
}

/// What all rows have in common.
struct Work<'a> {
    ldi: &'a Layered,
    columns: &'a Clipped,
    projection: &'a Projection,
    sizes: &'a Sizes,
    options: Options,
    size: [f32; 2],
    band_count: usize,
}

impl Work<'_> {
    #[inline(always)]
    fn place(&self, rows: Range<u32>, chunk: &mut Chunk) {
        chunk
            .bands
            .resize_with(self.band_count.max(chunk.bands.len()), Vec::new);
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
                    for k in 0..LANES {
                        let y = if ready.is_seen[k] { block.y[k] } else { 0.0 };
                        ready.bands[0][k] = (y - most - 0.5) as i32 / BAND as i32;
                        ready.bands[1][k] = (y + most + 0.5) as i32 / BAND as i32;
                    }
                    for (axis, at) in [&block.x, &block.y].into_iter().enumerate() {
                        for k in 0..LANES {
                            let half = ready.half[axis][k] * (grow * block.scale[k]);
                            let half = half.max(least).min(most);
                            ready.half[axis][k] = half;
                            let at = if ready.is_seen[k] { at[k] } else { 0.0 };
                            ready.first[axis][k] = first_within(at, BEYOND * half);
                        }
                    }
                    for k in 0..LANES.min(samples.end - first) {
                        if !ready.is_seen[k] {
                            continue;
                        }
                        chunk.drawn += 1;
                        let drawn = Drawn {
                            x: block.x[k],
                            y: block.y[k],
                            inverse_depth: block.inverse_depth[k],
                            half: [ready.half[0][k], ready.half[1][k]],
                            first: [ready.first[0][k] as i16, ready.first[1][k] as i16],
                            color: self.ldi.color[first + k],
                        };
                        let from = ready.bands[0][k].max(0) as usize;
                        let to = (ready.bands[1][k].max(0) as usize).min(self.band_count - 1);
                        for band in from..=to {
                            chunk.bands[band].push(drawn);
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
    first: [[i32; LANES]; 2],
    /// The first and the last band it may reach.
    bands: [[i32; LANES]; 2],
}

impl Ready {
    const EMPTY: Self = Self {
        is_seen: [false; LANES],
        half: [[0.0; LANES]; 2],
        first: [[0; LANES]; 2],
        bands: [[0; LANES]; 2],
    };
}

/// Within less than 2, 4 and 6 pixels are no more than 4, 8 and 12 middles.
#[inline(always)]
fn tile_count(reach: f32) -> i32 {
    1 + i32::from(reach >= 2.0) + i32::from(reach >= 4.0)
}

/// From a place to the middle of a pixel, counted from the margin's first.
#[inline(always)]
fn off(first: i32, at: f32) -> f32 {
    (first - MARGIN as i32) as f32 + 0.5 - at
}

/// The first pixel whose middle is within reach of a place, counted from the margin's; places
/// are within the margin, so it is not negative.
#[inline(always)]
fn first_within(at: f32, reach: f32) -> i32 {
    (at - reach + (MARGIN as f32 + 0.5)) as i32
}

/// The tiles of [`WIDE`] by [`WIDE`] pixels that a splat may reach.
struct Tiles {
    /// The first column, with the margin, and the first row, from the band's.
    first: [i32; 2],
    count: [i32; 2],
    /// The first column's and row's middle from the sample.
    offset: [f32; 2],
}

impl Drawn {
    /// Of a reach, within which a pixel is the first.
    #[inline(always)]
    fn tiles(&self, first: [i32; 2], reach: [f32; 2], top: i32) -> Tiles {
        Tiles {
            first: [first[0], first[1] - MARGIN as i32 - top],
            count: [tile_count(reach[0]), tile_count(reach[1])],
            offset: [off(first[0], self.x), off(first[1], self.y)],
        }
    }

    #[inline(always)]
    fn narrow_tiles(&self, top: i32) -> Tiles {
        let [x, y] = self.half;
        let [left, above] = self.first;
        let reach = [BEYOND * x, BEYOND * y];
        self.tiles([i32::from(left), i32::from(above)], reach, top)
    }

    #[inline(always)]
    fn wide_tiles(&self, [x, y]: [f32; 2], top: i32) -> Tiles {
        let first = [first_within(self.x, x), first_within(self.y, y)];
        self.tiles(first, [x, y], top)
    }

    /// Half a side of what it covers if nothing else does.
    #[inline(always)]
    fn wide(&self, options: Options) -> [f32; 2] {
        let Options {
            wide,
            least_wide,
            most,
            ..
        } = options;
        let [x, y] = self.half;
        [x, y].map(
            #[inline(always)]
            |h| (h * wide).max(least_wide).min(most),
        )
    }
}

impl Band {
    #[inline(always)]
    fn draw<'a>(
        &mut self,
        lists: impl Iterator<Item = &'a [Drawn]> + Clone,
        index: usize,
        stride: usize,
        options: Options,
    ) {
        let size = stride * BAND + WIDE;
        for plane in self
            .sums
            .iter_mut()
            .chain([&mut self.nearest, &mut self.widest])
        {
            plane.clear();
            plane.resize(size, 0.0);
        }
        let deviation = options.deviation;
        let at = Place {
            top: (index * BAND) as i32,
            stride,
            deviation,
        };
        // What patches cover.
        for list in lists.clone() {
            for drawn in list {
                let tiles = drawn.narrow_tiles(at.top);
                near(drawn, &tiles, drawn.half, at, &mut self.nearest);
            }
        }
        for nearest in &mut self.nearest {
            *nearest *= options.nearer;
        }
        for list in lists.clone() {
            for drawn in list {
                let [x, y] = drawn.half;
                let reach = [BEYOND * x, BEYOND * y];
                let tiles = drawn.narrow_tiles(at.top);
                let (half, depths) = (drawn.half, &mut self.nearest);
                add(drawn, &tiles, half, reach, at, depths, &mut self.sums);
            }
        }
        // What only wide ones do: of samples near a hole.
        self.find_holes(stride);
        let holes = &self.holes;
        let is_near_hole =
            |drawn: &&Drawn| holes[(drawn.x + MARGIN as f32) as i32 as usize / COLUMN];
        self.beside.clear();
        for list in lists {
            for drawn in list.iter().filter(is_near_hole) {
                let tiles = drawn.wide_tiles(drawn.wide(options), at.top);
                if meets_hole(&tiles, at, &self.nearest) {
                    self.beside.push(*drawn);
                }
            }
        }
        for drawn in &self.beside {
            let wide = drawn.wide(options);
            let tiles = drawn.wide_tiles(wide, at.top);
            near(drawn, &tiles, wide, at, &mut self.widest);
        }
        for (nearest, wide) in self.nearest.iter().zip(&mut self.widest) {
            *wide = if *nearest > 0.0 {
                f32::INFINITY
            } else {
                options.nearer * *wide
            };
        }
        for drawn in &self.beside {
            let wide = drawn.wide(options);
            let tiles = drawn.wide_tiles(wide, at.top);
            add(
                drawn,
                &tiles,
                wide,
                wide,
                at,
                &mut self.widest,
                &mut self.sums,
            );
        }
        for (nearest, wide) in self.nearest.iter_mut().zip(&self.widest) {
            *nearest = if *nearest > 0.0 { *nearest } else { *wide } / options.nearer;
        }
    }

    /// Marks the columns with holes and those beside them.
    #[inline(always)]
    fn find_holes(&mut self, stride: usize) {
        let count = stride / COLUMN + 2;
        self.holes.clear();
        self.holes.resize(count, false);
        for row in self.nearest.chunks_exact(stride).take(BAND) {
            let row = &row[MARGIN..stride - MARGIN];
            for (i, part) in row.chunks(COLUMN).enumerate() {
                if part.iter().fold(false, |any, s| any | (*s == 0.0)) {
                    let i = i + MARGIN / COLUMN;
                    self.holes[i - 1..=i + 1].fill(true);
                }
            }
        }
    }
}

/// Where a band is.
#[derive(Clone, Copy)]
struct Place {
    top: i32,
    stride: usize,
    deviation: f32,
}

/// A plane's pixels in a row of a tile.
#[inline(always)]
fn row_of(plane: &mut [f32], i: usize) -> &mut [f32; WIDE] {
    (&mut plane[i..i + WIDE]).try_into().expect("as many")
}

/// Adds weights times a value.
#[inline(always)]
fn more(row: &mut [f32; WIDE], weights: [f32; WIDE], value: f32) {
    let mut sums = *row;
    for k in 0..WIDE {
        sums[k] += weights[k] * value;
    }
    *row = sums;
}

/// What a squared distance is multiplied by in the exponent, of a patch of that half side.
#[inline(always)]
fn narrowness(deviation: f32, half: f32) -> f32 {
    let deviation = deviation * half;
    0.5 / (deviation * deviation)
}

/// The weights of a tile's columns, or rows.
#[inline(always)]
fn weights(offset: f32, tile: i32, narrow: f32, reach: f32) -> [f32; WIDE] {
    let first = offset + (tile * WIDE as i32) as f32;
    let mut weights = [0.0; WIDE];
    for k in 0..WIDE {
        let d = first + k as f32;
        let weight = gaussian(d * d * narrow);
        weights[k] = if d.abs() <= reach { weight } else { 0.0 };
    }
    weights
}

/// Keeps the nearest depths of what a box around a sample covers.
#[inline(always)]
fn near(drawn: &Drawn, tiles: &Tiles, half: [f32; 2], at: Place, plane: &mut [f32]) {
    let s = drawn.inverse_depth;
    for right in 0..tiles.count[0] {
        let mut here = [0.0; WIDE];
        for k in 0..WIDE {
            let d = tiles.offset[0] + (right * WIDE as i32 + k as i32) as f32;
            here[k] = if d.abs() <= half[0] { s } else { 0.0 };
        }
        let column = (tiles.first[0] + right * WIDE as i32) as usize;
        for row in 0..tiles.count[1] * WIDE as i32 {
            let y = (tiles.first[1] + row) as usize;
            let d = tiles.offset[1] + row as f32;
            // Above the band is beyond it, too.
            if y >= BAND || d.abs() > half[1] {
                continue;
            }
            let depths = row_of(plane, y * at.stride + column);
            // As a value: a vector is stored, not parts of one.
            let mut nearest = *depths;
            for k in 0..WIDE {
                nearest[k] = nearest[k].max(here[k]);
            }
            *depths = nearest;
        }
    }
}

/// Whether nothing is in some pixel of tiles.
#[inline(always)]
fn meets_hole(tiles: &Tiles, at: Place, plane: &[f32]) -> bool {
    let mut least = [f32::INFINITY; WIDE];
    for right in 0..tiles.count[0] {
        let column = (tiles.first[0] + right * WIDE as i32) as usize;
        for row in 0..tiles.count[1] * WIDE as i32 {
            let y = (tiles.first[1] + row) as usize;
            if y < BAND {
                let i = y * at.stride + column;
                let depths: &[f32; WIDE] = plane[i..i + WIDE].try_into().expect("as many");
                for k in 0..WIDE {
                    least[k] = least[k].min(depths[k]);
                }
            }
        }
    }
    least.iter().fold(false, |any, s| any | (*s == 0.0))
}

/// Adds a sample to the pixels within its reach where it is no farther than a depth.
#[inline(always)]
fn add(
    drawn: &Drawn,
    tiles: &Tiles,
    half: [f32; 2],
    reach: [f32; 2],
    at: Place,
    depths: &mut [f32],
    sums: &mut [Vec<f32>; 4],
) {
    let s = drawn.inverse_depth;
    let narrow = [
        narrowness(at.deviation, half[0]),
        narrowness(at.deviation, half[1]),
    ];
    let [r, g, b, _] = drawn.color;
    let (r, g, b) = (f32::from(r), f32::from(g), f32::from(b));
    let [red, green, blue, sum] = sums;
    for below in 0..tiles.count[1] {
        for right in 0..tiles.count[0] {
            let column = (tiles.first[0] + right * WIDE as i32) as usize;
            let row = |j: usize| (tiles.first[1] + below * WIDE as i32 + j as i32) as usize;
            // Most of what is behind something is so all over.
            let mut is_any = false;
            for y in (0..WIDE).map(row).filter(|y| *y < BAND) {
                let nearest = *row_of(depths, y * at.stride + column);
                is_any |= nearest.iter().fold(false, |any, n| any | is_same(s, *n));
            }
            if !is_any {
                continue;
            }
            let across = weights(tiles.offset[0], right, narrow[0], reach[0]);
            let down = weights(tiles.offset[1], below, narrow[1], reach[1]);
            for j in 0..WIDE {
                let y = row(j);
                if y >= BAND || down[j] == 0.0 {
                    continue;
                }
                let i = y * at.stride + column;
                let nearest = *row_of(depths, i);
                let mut here = [0.0; WIDE];
                for k in 0..WIDE {
                    let weight = down[j] * across[k];
                    here[k] = if is_same(s, nearest[k]) { weight } else { 0.0 };
                }
                more(row_of(red, i), here, r);
                more(row_of(green, i), here, g);
                more(row_of(blue, i), here, b);
                more(row_of(sum, i), here, 1.0);
            }
        }
    }
}

/// Whether a sample counts where that is the farthest that does; 0 where nothing is.
#[inline(always)]
fn is_same(s: f32, farthest: f32) -> bool {
    (s >= farthest) & (farthest > 0.0)
}

/// e⁻ᵗ within 6 % of 1 for t ≥ 0: (1 − t/16)¹⁶, zero from 16 on.
#[inline(always)]
fn gaussian(t: f32) -> f32 {
    let base = (1.0 - t * (1.0 / 16.0)).max(0.0);
    let two = base * base;
    let four = two * two;
    let eight = four * four;
    eight * eight
}
