//! Drawing samples into the rows of a band: the nearest depths, then the means.

use super::{BEYOND, Options};
use crate::ldi::Ends;
use std::ops::Range;

/// A sample as it will be drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drawn {
    pub(super) x: f32,
    pub(super) y: f32,
    pub(super) inverse_depth: f32,
    /// Half a side of the patch.
    pub(super) half: [f32; 2],
    /// The first column and row within reach, from the margin's.
    pub(super) first: [i16; 2],
    pub(super) color: [u8; 3],
    /// Of its patch in the picture.
    pub(super) ends: Ends,
}

/// Rows of the picture.
#[derive(Debug, Default)]
pub(super) struct Band {
    /// The nearest inverse depth, then what is behind that the same surface.
    pub(super) nearest: Vec<f32>,
    /// The same of wide patches.
    widest: Vec<f32>,
    /// By columns of pixels, whether there is a hole in or beside them, and the samples there.
    holes: Vec<bool>,
    beside: Vec<Drawn>,
    /// Red, green, blue, weight: plane by plane.
    pub(super) sums: [Vec<f32>; 4],
}

/// Rows of the picture in a band.
pub(super) const BAND: usize = 16;
/// Pixels worked on together, and those beside the picture that may be written to.
const WIDE: usize = 4;
pub(super) const MARGIN: usize = 16;
/// Pixels across that have their holes found together.
const COLUMN: usize = 8;

/// Rows of the tiles that a splat may reach, rounded up.
const MOST_ROWS: usize = 16;

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
pub(super) fn first_within(at: f32, reach: f32) -> i32 {
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
        let [x, y] = self.half;
        [options.wide_half(x), options.wide_half(y)]
    }
}

impl Band {
    #[inline(always)]
    pub(super) fn draw<'a>(
        &mut self,
        lists: impl Iterator<Item = &'a [Drawn]> + Clone,
        index: usize,
        stride: usize,
        open: [u32; 2],
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
        let covered = options.covered();
        let at = Place {
            top: (index * BAND) as i32,
            stride,
            deviation: options.deviation,
        };
        // What patches cover.
        for list in lists.clone() {
            for drawn in list {
                let tiles = drawn.narrow_tiles(at.top);
                let covered = &covered[usize::from(drawn.ends.0 & 15)];
                near(drawn, &tiles, drawn.half, covered, at, &mut self.nearest);
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
        self.find_holes(stride, open);
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
            let covered = &covered[usize::from(drawn.ends.0 & 15)];
            near(drawn, &tiles, wide, covered, at, &mut self.widest);
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

    /// Marks the columns with holes, among those that are open, and those beside them.
    #[inline(always)]
    fn find_holes(&mut self, stride: usize, [from, to]: [u32; 2]) {
        let count = stride / COLUMN + 2;
        self.holes.clear();
        self.holes.resize(count, false);
        // Whole columns of pixels that are worked on together.
        let first = from as usize / COLUMN;
        for row in self.nearest.chunks_exact(stride).take(BAND) {
            let row = &row[MARGIN + first * COLUMN..MARGIN + to as usize];
            for (i, part) in row.chunks(COLUMN).enumerate() {
                if part.iter().fold(false, |any, s| any | (*s == 0.0)) {
                    let i = first + i + MARGIN / COLUMN;
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

impl Place {
    /// The band's rows whose middles are within reach above and below a place.
    #[inline(always)]
    fn rows(&self, y: f32, [above, below]: [f32; 2]) -> Range<i32> {
        let top = self.top + MARGIN as i32;
        let past = (y + below + (MARGIN as f32 + 0.5)) as i32;
        (first_within(y, above) - top).max(0)..(past - top).min(BAND as i32)
    }
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
pub(in crate::ldi) fn narrowness(deviation: f32, half: f32) -> f32 {
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

/// Keeps the nearest depths of what a box around a sample covers: of half a side some part to the right,
/// below, to the left and above.
#[inline(always)]
fn near(
    drawn: &Drawn,
    tiles: &Tiles,
    half: [f32; 2],
    [right, below, left, above]: &[f32; 4],
    at: Place,
    plane: &mut [f32],
) {
    let s = drawn.inverse_depth;
    let low = [-left * half[0], -above * half[1]];
    let high = [right * half[0], below * half[1]];
    let rows = at.rows(drawn.y, [-low[1], high[1]]);
    for tile in 0..tiles.count[0] {
        let mut here = [0.0; WIDE];
        for k in 0..WIDE {
            let d = tiles.offset[0] + (tile * WIDE as i32 + k as i32) as f32;
            here[k] = if (d >= low[0]) & (d <= high[0]) {
                s
            } else {
                0.0
            };
        }
        let column = (tiles.first[0] + tile * WIDE as i32) as usize;
        for y in rows.clone() {
            let depths = row_of(plane, y as usize * at.stride + column);
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
    let [r, g, b] = drawn.color.map(f32::from);
    let [red, green, blue, sum] = sums;
    let mut down = [0.0; MOST_ROWS];
    for (tile, down) in (0..tiles.count[1]).zip(down.chunks_exact_mut(WIDE)) {
        down.copy_from_slice(&weights(tiles.offset[1], tile, narrow[1], reach[1]));
    }
    let rows = at.rows(drawn.y, [reach[1]; 2]);
    for tile in 0..tiles.count[0] {
        let column = (tiles.first[0] + tile * WIDE as i32) as usize;
        let start = |y: i32| y as usize * at.stride + column;
        // Most of what is behind something is so all over.
        let mut is_any = false;
        for y in rows.clone() {
            let nearest = *row_of(depths, start(y));
            is_any |= nearest.iter().fold(false, |any, n| any | is_same(s, *n));
        }
        if !is_any {
            continue;
        }
        let across = weights(tiles.offset[0], tile, narrow[0], reach[0]);
        for y in rows.clone() {
            let i = start(y);
            let down = down[(y - tiles.first[1]) as usize % MOST_ROWS];
            let nearest = *row_of(depths, i);
            let mut here = [0.0; WIDE];
            for k in 0..WIDE {
                let weight = down * across[k];
                here[k] = if is_same(s, nearest[k]) { weight } else { 0.0 };
            }
            more(row_of(red, i), here, r);
            more(row_of(green, i), here, g);
            more(row_of(blue, i), here, b);
            more(row_of(sum, i), here, 1.0);
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
pub(in crate::ldi) fn gaussian(t: f32) -> f32 {
    let base = (1.0 - t * (1.0 / 16.0)).max(0.0);
    let two = base * base;
    let four = two * two;
    let eight = four * four;
    eight * eight
}
