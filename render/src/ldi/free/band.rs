//! Drawing samples into the rows of a band: the nearest depths, then the means.
//!
//! What pixels keep lies column by column, a column's planes one after the other, so that all that a
//! sample may change is at places that are known when this is compiled.

use super::{BEYOND, Options};
use crate::cpu::lanes::whole;
use crate::ldi::Ends;
use glam::{Vec4, Vec4Swizzles};
use std::ops::Mul;

/// A sample as it will be drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drawn {
    /// From its place to the middle of the first column and row within reach.
    pub(super) offset: [f32; 2],
    pub(super) inverse_depth: f32,
    /// Half a side of the patch.
    pub(super) half: [f32; 2],
    /// See [`narrowness`].
    pub(super) narrow: [f32; 2],
    /// The first column and row within reach, from the margin's.
    pub(super) first: [i16; 2],
    pub(super) color: [u8; 3],
    /// Of its patch in the picture.
    pub(super) ends: Ends,
}

/// Rows of the picture.
#[derive(Debug, Default)]
pub(super) struct Band {
    /// By column of pixels, margins included, [`COLUMN`] numbers.
    columns: Vec<f32>,
    /// The same of wide patches: their nearest depths alone.
    widest: Vec<f32>,
    /// By column of pixels, margins included, the rows with holes as bits, and those from which a wide patch
    /// may reach one.
    holes: Vec<u64>,
    near_holes: Vec<u64>,
    /// Wide patches that may reach one.
    beside: Vec<Drawn>,
}

/// Rows of the picture in a band.
pub(super) const BAND: usize = 16;
/// Pixels across, and down, that are worked on together.
const WIDE: usize = 4;
/// Pixels beside the picture that may be written to, and rows above and below a band.
pub(super) const MARGIN: usize = 16;
const EDGE: usize = WIDE - 1;
const ROWS: usize = BAND + 2 * EDGE;
/// What is kept of each pixel, in as many planes: the nearest inverse depth, then the least that is of the
/// same surface, infinite where nothing is; red, green, blue; and the weight.
const PLANES: usize = 5;
const COLUMN: usize = PLANES * ROWS;
/// Samples that are looked at together.
const TOGETHER: usize = 128;
/// The bit of a band's first row; rows so far above it have one, too.
const FIRST_BIT: i32 = 16;
/// A wide patch reaches at most 4 pixels from its place, which is up to 5.5 beyond the first pixel that the sample counts in.
/// So what it reaches is within six pixels of the second one after that, by which a sample is looked up;
/// and one more for rounding.
const NEAR_HOLE: usize = 7;

/// From the first to the last number of a tile: of all its planes, and of one.
const TILE: usize = (WIDE - 1) * COLUMN + (PLANES - 1) * ROWS + WIDE;
const TILE_OF_ONE: usize = (WIDE - 1) * ROWS + WIDE;

/// Within less than 2, 4 and 6 pixels are no more than 4, 8 and 12 middles.
#[inline(always)]
fn tile_count(reach: f32) -> i32 {
    1 + i32::from(reach >= 2.0) + i32::from(reach >= 4.0)
}

/// Whether all is in one tile.
#[inline(always)]
fn is_small([x, y]: [f32; 2]) -> bool {
    tile_count(x.max(y)) == 1
}

/// The first pixel whose middle is within reach of a place, counted from the margin's; places
/// are within the margin, so it is not negative. And from the place to that middle.
#[inline(always)]
pub(super) fn first_within(at: f32, reach: f32) -> (i32, f32) {
    let (first, idx) = whole(at - reach + (MARGIN as f32 + 0.5));
    (idx, first - (MARGIN as f32 - 0.5) - at)
}

/// [`WIDE`] by [`WIDE`] pixels that a splat may reach, some of them the band's.
#[derive(Clone, Copy)]
struct Tile {
    /// Its first column, with the margin, and its first row, with the edge.
    first: [usize; 2],
    /// Its first column's and row's middle from the sample.
    offset: [f32; 2],
}

impl Tile {
    /// The numbers of its pixels, in columns of so many.
    #[inline(always)]
    fn of<const APART: usize, const COUNT: usize>(self, columns: &mut [f32]) -> &mut [f32; COUNT] {
        let start = self.first[0] * APART + self.first[1];
        (&mut columns[start..start + COUNT])
            .try_into()
            .expect("as many")
    }

    /// Of all planes: a column's are [`COLUMN`] apart, a plane's [`ROWS`].
    #[inline(always)]
    fn of_all(self, columns: &mut [f32]) -> &mut [f32; TILE] {
        self.of::<COLUMN, TILE>(columns)
    }

    /// Of one plane by itself.
    #[inline(always)]
    fn of_one(self, plane: &mut [f32]) -> &mut [f32; TILE_OF_ONE] {
        self.of::<ROWS, TILE_OF_ONE>(plane)
    }
}

impl Drawn {
    /// Its first row, from the band's.
    #[inline(always)]
    fn row(&self, top: i32) -> i32 {
        i32::from(self.first[1]) - MARGIN as i32 - top
    }

    /// Its tile so many columns and rows beyond the first; `None` if no row of that is the band's.
    #[inline(always)]
    fn tile(&self, top: i32, [right, down]: [i32; 2]) -> Option<Tile> {
        let (column, row) = (i32::from(self.first[0]) + right, self.row(top) + down);
        (row > -(WIDE as i32) && row < BAND as i32).then(|| Tile {
            first: [column as usize, (row + EDGE as i32) as usize],
            offset: [self.offset[0] + right as f32, self.offset[1] + down as f32],
        })
    }

    /// Calls a function with each of the tiles within reach that have rows of the band.
    #[inline(always)]
    fn for_each_tile(&self, reach: [f32; 2], top: i32, mut f: impl FnMut(Tile)) {
        if is_small(reach) {
            if let Some(tile) = self.tile(top, [0; 2]) {
                f(tile);
            }
            return;
        }
        let [across, down] = reach.map(|reach| tile_count(reach) * WIDE as i32);
        for down in (0..down).step_by(WIDE) {
            for right in (0..across).step_by(WIDE) {
                if let Some(tile) = self.tile(top, [right, down]) {
                    f(tile);
                }
            }
        }
    }

    /// Whether it may count in some pixel of the band.
    #[inline(always)]
    fn may_count(&self, top: i32, columns: &mut [f32]) -> bool {
        if !is_small(self.reach()) {
            return true;
        }
        let Some(tile) = self.tile(top, [0; 2]) else {
            return false;
        };
        let s = Vec4::splat(self.inverse_depth);
        let [a, b, c, d] = depths_of::<COLUMN>(tile.of_all(columns));
        a.min(b).min(c.min(d)).cmple(s).any()
    }

    /// How far it counts.
    #[inline(always)]
    fn reach(&self) -> [f32; 2] {
        self.half.map(|half| BEYOND * half)
    }

    /// Whether a wide patch may reach a hole.
    #[inline(always)]
    fn is_near_hole(&self, top: i32, near_holes: &[u64]) -> bool {
        let bit = self.row(top) + (2 + FIRST_BIT);
        near_holes[self.first[0] as usize + 2] >> bit.clamp(0, 63) & 1 != 0
    }

    /// What it covers if nothing else does, which is all that it counts in.
    #[inline(always)]
    fn widened(&self, options: Options) -> Self {
        let half = self.half.map(|half| options.wide_half(half));
        let (mut first, mut offset) = ([0; 2], [0.0; 2]);
        for k in 0..2 {
            let place = f32::from(self.first[k]) - (MARGIN as f32 - 0.5) - self.offset[k];
            let (idx, from) = first_within(place, half[k]);
            (first[k], offset[k]) = (idx as i16, from);
        }
        Self {
            half,
            narrow: half.map(|half| narrowness(options.deviation, half)),
            first,
            offset,
            ..*self
        }
    }

    /// Whether there is a hole in the tiles of a wide patch.
    #[inline(always)]
    fn meets_hole(&self, top: i32, holes: &[u64]) -> bool {
        let [across, down] = self.half.map(|half| WIDE * tile_count(half) as usize);
        let first = self.first[0] as usize;
        let any = holes[first..first + across].iter().fold(0, |a, b| a | b);
        any >> (self.row(top) + FIRST_BIT).clamp(0, 63) & ((1 << down) - 1) != 0
    }
}

impl Band {
    /// Draws samples into a band so many pixels wide of which some columns are open, from … to.
    #[inline(always)]
    pub(super) fn draw<'a>(
        &mut self,
        lists: impl Iterator<Item = &'a [Drawn]> + Clone,
        index: usize,
        width: usize,
        open: [u32; 2],
        options: Options,
    ) {
        let count = width + 2 * MARGIN;
        self.columns.clear();
        self.columns.resize(count * COLUMN, 0.0);
        let covered = options.covered();
        let top = (index * BAND) as i32;
        // What patches cover.
        let columns = &mut self.columns[..];
        for list in lists.clone() {
            for drawn in list {
                let sides = &covered[usize::from(drawn.ends.0 & 15)];
                let near = Near::new(drawn, sides);
                drawn.for_each_tile(
                    drawn.reach(),
                    top,
                    #[inline(always)]
                    |tile| near.draw::<COLUMN>(tile, tile.of_all(columns)),
                );
            }
        }
        for column in columns.chunks_exact_mut(COLUMN) {
            for nearest in &mut column[..ROWS] {
                *nearest = farthest(*nearest, options);
            }
        }
        let mut seen = [0; TOGETHER];
        for list in lists.clone() {
            for some in list.chunks(TOGETHER) {
                // Most of what is behind something is so all over: found without a branch that no one foresees.
                let mut count = 0;
                for (i, drawn) in some.iter().enumerate() {
                    seen[count] = i as u8;
                    count += usize::from(drawn.may_count(top, columns));
                }
                for i in &seen[..count] {
                    let drawn = &some[usize::from(*i)];
                    let reach = drawn.reach();
                    drawn.for_each_tile(
                        reach,
                        top,
                        #[inline(always)]
                        |tile| {
                            let pixels = tile.of_all(columns);
                            let depths = depths_of::<COLUMN>(pixels);
                            add(drawn, tile, reach, depths, pixels);
                        },
                    );
                }
            }
        }
        // What only wide ones do: of samples near a hole.
        if self.find_holes(open) {
            self.draw_wide(lists, top, &covered, options);
        }
        for column in self.columns.chunks_exact_mut(COLUMN) {
            for nearest in &mut column[..ROWS] {
                *nearest /= options.nearer;
            }
        }
    }

    /// Draws wide patches where no others are.
    #[inline(always)]
    fn draw_wide<'a>(
        &mut self,
        lists: impl Iterator<Item = &'a [Drawn]> + Clone,
        top: i32,
        covered: &[[f32; 4]; 16],
        options: Options,
    ) {
        let columns = &mut self.columns[..];
        let holes = &self.near_holes;
        self.beside.clear();
        for list in lists {
            for some in list.chunks(TOGETHER) {
                let (mut near, mut count) = ([0; TOGETHER], 0);
                for (i, drawn) in some.iter().enumerate() {
                    near[count] = i as u8;
                    count += usize::from(drawn.is_near_hole(top, holes));
                }
                for i in &near[..count] {
                    let wide = some[usize::from(*i)].widened(options);
                    if wide.meets_hole(top, &self.holes) {
                        self.beside.push(wide);
                    }
                }
            }
        }
        // Where others are nothing is near enough.
        self.widest.clear();
        self.widest.resize(columns.len() / PLANES, f32::INFINITY);
        let widest = &mut self.widest[..];
        let by_column = columns
            .chunks_exact(COLUMN)
            .zip(widest.chunks_exact_mut(ROWS));
        for ((column, widest), _) in by_column.zip(holes).filter(|(_, holes)| **holes != 0) {
            for (nearest, wide) in column[..ROWS].iter().zip(widest) {
                let is_hole = *nearest == f32::INFINITY;
                *wide = if is_hole { 0.0 } else { f32::INFINITY };
            }
        }
        for wide in &self.beside {
            let sides = &covered[usize::from(wide.ends.0 & 15)];
            let near = Near::new(wide, sides);
            wide.for_each_tile(
                wide.half,
                top,
                #[inline(always)]
                |tile| near.draw::<ROWS>(tile, tile.of_one(widest)),
            );
        }
        let by_column = widest.chunks_exact_mut(ROWS).zip(holes);
        for (widest, _) in by_column.filter(|(_, holes)| **holes != 0) {
            for wide in widest {
                *wide = farthest(*wide, options);
            }
        }
        for wide in &self.beside {
            wide.for_each_tile(
                wide.half,
                top,
                #[inline(always)]
                |tile| {
                    let depths = depths_of::<ROWS>(tile.of_one(widest));
                    add(wide, tile, wide.half, depths, tile.of_all(columns));
                },
            );
        }
        let by_column = columns
            .chunks_exact_mut(COLUMN)
            .zip(widest.chunks_exact(ROWS));
        for ((column, widest), _) in by_column.zip(holes).filter(|(_, holes)| **holes != 0) {
            for (nearest, wide) in column[..ROWS].iter_mut().zip(widest) {
                *nearest = nearest.min(*wide);
            }
        }
    }

    /// Finds holes in the columns that are open; whether there are any.
    #[inline(always)]
    fn find_holes(&mut self, [from, to]: [u32; 2]) -> bool {
        let count = self.columns.len() / COLUMN;
        for holes in [&mut self.holes, &mut self.near_holes] {
            holes.clear();
            holes.resize(count, 0);
        }
        let mut is_any = false;
        for x in MARGIN + from as usize..MARGIN + to as usize {
            let column = &self.columns[x * COLUMN + EDGE..][..BAND];
            let is_hole = |nearest: &f32| *nearest == f32::INFINITY;
            if !column.iter().fold(false, |any, n| any | is_hole(n)) {
                continue;
            }
            is_any = true;
            let bits = column.iter().enumerate();
            let bits: u64 = bits.map(|(y, n)| u64::from(is_hole(n)) << y).sum();
            self.holes[x] = bits << FIRST_BIT;
            // In rows, then in columns.
            let (mut rows, from) = (0, FIRST_BIT as usize - NEAR_HOLE);
            for row in from..=from + 2 * NEAR_HOLE {
                rows |= bits << row;
            }
            let before = x.saturating_sub(NEAR_HOLE);
            for holes in &mut self.near_holes[before..=(x + NEAR_HOLE).min(count - 1)] {
                *holes |= rows;
            }
        }
        is_any
    }

    /// What a pixel of the window shows: red, green, blue and the sum of weights, and the nearest inverse
    /// depth.
    #[inline(always)]
    pub(super) fn at(&self, x: usize, y: usize) -> ([f32; 4], f32) {
        let column = &self.columns[(MARGIN + x) * COLUMN..][..COLUMN];
        let plane = |k: usize| column[k * ROWS + EDGE + y];
        ([plane(1), plane(2), plane(3), plane(4)], plane(0))
    }
}

/// The least inverse depth that is of the same surface as the nearest; infinite where nothing is.
#[inline(always)]
fn farthest(nearest: f32, options: Options) -> f32 {
    match nearest > 0.0 {
        true => nearest * options.nearer,
        false => f32::INFINITY,
    }
}

/// The columns, or rows, of a tile from its first.
const STEPS: Vec4 = Vec4::new(0.0, 1.0, 2.0, 3.0);

/// A column's pixels in a tile, in one plane.
#[inline(always)]
fn read(numbers: &[f32], i: usize) -> Vec4 {
    Vec4::from_slice(&numbers[i..i + WIDE])
}

/// Sets them.
#[inline(always)]
fn write(numbers: &mut [f32], i: usize, pixels: Vec4) {
    pixels.write_to_slice(&mut numbers[i..i + WIDE]);
}

/// Column by column the depths of a tile, whose columns are so many numbers apart.
#[inline(always)]
fn depths_of<const APART: usize>(numbers: &[f32]) -> [Vec4; WIDE] {
    [0, 1, 2, 3].map(
        #[inline(always)]
        |column| read(numbers, column * APART),
    )
}

/// Each of four numbers, four times.
#[inline(always)]
fn each(v: Vec4) -> [Vec4; WIDE] {
    [v.xxxx(), v.yyyy(), v.zzzz(), v.wwww()]
}

/// What a squared distance is multiplied by in the exponent, of a patch of that half side.
#[inline(always)]
pub(in crate::ldi) fn narrowness(deviation: f32, half: f32) -> f32 {
    let deviation = deviation * half;
    0.5 / (deviation * deviation)
}

/// The weights of a tile's columns, or rows.
#[inline(always)]
fn weights(offset: f32, narrow: f32, reach: f32) -> Vec4 {
    let d = STEPS + Vec4::splat(offset);
    let base = Vec4::ONE - d * d * Vec4::splat(narrow) * Vec4::splat(1.0 / 16.0);
    let weights = to_the_16th(base.max(Vec4::ZERO));
    Vec4::select(d.abs().cmple(Vec4::splat(reach)), weights, Vec4::ZERO)
}

/// A box around a sample, and how near it is.
struct Near {
    inverse_depth: Vec4,
    low: [Vec4; 2],
    high: [Vec4; 2],
}

impl Near {
    /// Of half a side some part to the right, below, to the left and above.
    #[inline(always)]
    fn new(drawn: &Drawn, [right, below, left, above]: &[f32; 4]) -> Self {
        let half = drawn.half;
        Self {
            inverse_depth: Vec4::splat(drawn.inverse_depth),
            low: [-left * half[0], -above * half[1]].map(Vec4::splat),
            high: [right * half[0], below * half[1]].map(Vec4::splat),
        }
    }

    /// Keeps the nearest depths of what it covers.
    #[inline(always)]
    fn draw<const APART: usize>(&self, tile: Tile, numbers: &mut [f32]) {
        let [across, down] = [0, 1].map(
            #[inline(always)]
            |k| {
                let d = STEPS + Vec4::splat(tile.offset[k]);
                let is_covered = d.cmpge(self.low[k]) & d.cmple(self.high[k]);
                Vec4::select(is_covered, self.inverse_depth, Vec4::ZERO)
            },
        );
        for (column, across) in each(across).into_iter().enumerate() {
            let i = column * APART;
            let nearest = read(numbers, i).max(across.min(down));
            write(numbers, i, nearest);
        }
    }
}

/// Adds a sample to the pixels within its reach where it is no farther than a depth.
#[inline(always)]
fn add(
    drawn: &Drawn,
    tile: Tile,
    reach: [f32; 2],
    depths: [Vec4; WIDE],
    numbers: &mut [f32; TILE],
) {
    let s = Vec4::splat(drawn.inverse_depth);
    let same = depths.map(
        #[inline(always)]
        |farthest| s.cmpge(farthest),
    );
    // Most of what is behind something is so all over.
    if !(same[0] | same[1] | same[2] | same[3]).any() {
        return;
    }
    let across = weights(tile.offset[0], drawn.narrow[0], reach[0]);
    let down = weights(tile.offset[1], drawn.narrow[1], reach[1]);
    let [r, g, b] = drawn.color.map(f32::from);
    let color = [r, g, b, 1.0].map(Vec4::splat);
    for (column, across) in each(across).into_iter().enumerate() {
        let here = Vec4::select(same[column], across * down, Vec4::ZERO);
        for (k, color) in color.iter().enumerate() {
            let i = column * COLUMN + (1 + k) * ROWS;
            let sum = read(numbers, i) + here * *color;
            write(numbers, i, sum);
        }
    }
}

/// e⁻ᵗ within 6 % of 1 for t ≥ 0: (1 − t/16)¹⁶, zero from 16 on.
#[inline(always)]
pub(in crate::ldi) fn gaussian(t: f32) -> f32 {
    to_the_16th((1.0 - t * (1.0 / 16.0)).max(0.0))
}

#[inline(always)]
fn to_the_16th<T: Mul<Output = T> + Copy>(base: T) -> T {
    let two = base * base;
    let four = two * two;
    let eight = four * four;
    eight * eight
}
