//! Ignore masks: where a photo does not count.

use crate::pyramid::{MAX_LEVELS, halve, halved_sizes, texels};
use crate::score::HALF;
use calibrate::Pixel;
use image::GrayImage;
use std::fmt;

/// An ignore mask and its mip levels, texel for texel like those of its photo: 0 = ignore,
/// 255 = use.
#[derive(Clone, PartialEq, Eq)]
pub struct Mask {
    /// Level 0 is the mask itself.
    pub levels: Vec<GrayImage>,
    /// Least and greatest value of blocks of [`BLOCK`] × [`BLOCK`] pixels, of 2 × 2 such
    /// blocks and so on to the whole.
    blocks: Vec<Blocks>,
}

/// A filtered value of this (of 255) or less ignores; from here on the mask rises, to one.
/// At a photo's own place it has all the weight that its mask leaves, however little, and
/// with zero as the limit rounding would decide beside a mask's edge. No stored value lies
/// on half a step.
pub(crate) const IGNORED: f32 = 0.5;

/// Sides of the smallest blocks, in pixels.
const BLOCK: u32 = 8;

#[derive(Clone, PartialEq, Eq)]
struct Blocks {
    columns: u32,
    rows: u32,
    ranges: Vec<(u8, u8)>,
}

impl Mask {
    /// Builds the levels of a mask.
    pub fn new(mask: GrayImage) -> Self {
        let blocks = blocks_of(&mask);
        let mut levels = vec![mask];
        while levels.len() < MAX_LEVELS && levels[levels.len() - 1].dimensions() != (1, 1) {
            levels.push(halve(&levels[levels.len() - 1], |_| 1));
        }
        Self { levels, blocks }
    }

    /// A mask that ignores everything, whatever the photo's size.
    pub(crate) fn nothing() -> Self {
        Self::new(GrayImage::new(1, 1))
    }

    /// Whether at least half of a photo counts at a pixel; outside as on the border.
    pub(crate) fn uses(&self, pixel: Pixel) -> bool {
        let finest = &self.levels[0];
        let at = |at: f64, side: u32| (at.max(0.0) as u32).min(side - 1);
        let (x, y) = (at(pixel.x, finest.width()), at(pixel.y, finest.height()));
        finest.get_pixel(x, y).0[0] >= HALF
    }

    /// Bounds of the values between two corners of a rectangle in pixels; what lies outside
    /// repeats the border.
    pub(crate) fn range(&self, [left, top]: [f64; 2], [right, bottom]: [f64; 2]) -> (u8, u8) {
        let (width, height) = self.levels[0].dimensions();
        let block = |at: f64, side: u32| at.clamp(0.0, f64::from(side - 1)).floor() as u32 / BLOCK;
        let (mut x0, mut x1) = (block(left, width), block(right, width));
        let (mut y0, mut y1) = (block(top, height), block(bottom, height));
        // As fine as a few blocks allow.
        const ACROSS: u32 = 4;
        let mut level = 0;
        while x1 - x0 >= ACROSS || y1 - y0 >= ACROSS {
            (x0, x1, y0, y1) = (x0 / 2, x1 / 2, y0 / 2, y1 / 2);
            level += 1;
        }
        let blocks = &self.blocks[level];
        let all = (y0..=y1)
            .flat_map(|y| (x0..=x1).map(move |x| blocks.ranges[(y * blocks.columns + x) as usize]));
        all.fold((u8::MAX, 0), union)
    }

    /// Bytes held in memory.
    pub fn bytes(&self) -> usize {
        let levels = self.levels.iter().map(|l| l.as_raw().len());
        let blocks = self.blocks.iter().map(|b| 2 * b.ranges.len());
        levels.chain(blocks).sum()
    }

    /// Bytes that the mask of a photo of so many pixels takes.
    pub fn bytes_of(width: u32, height: u32) -> u64 {
        let levels = halved_sizes(width, height).take(MAX_LEVELS);
        let blocks = halved_sizes(width.div_ceil(BLOCK), height.div_ceil(BLOCK));
        texels(levels).saturating_add(texels(blocks).saturating_mul(2))
    }
}

impl fmt::Debug for Mask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (width, height) = self.levels[0].dimensions();
        write!(f, "Mask({width} × {height}, {} levels)", self.levels.len())
    }
}

fn union(a: (u8, u8), b: (u8, u8)) -> (u8, u8) {
    (a.0.min(b.0), a.1.max(b.1))
}

fn blocks_of(mask: &GrayImage) -> Vec<Blocks> {
    let (width, height) = mask.dimensions();
    let value = |x: u32, y: u32| {
        let value = mask.get_pixel(x, y).0[0];
        (value, value)
    };
    let mut pyramid = vec![reduced(width, height, BLOCK, value)];
    while let last = &pyramid[pyramid.len() - 1]
        && (last.columns > 1 || last.rows > 1)
    {
        let range = |x: u32, y: u32| last.ranges[(y * last.columns + x) as usize];
        let next = reduced(last.columns, last.rows, 2, range);
        pyramid.push(next);
    }
    pyramid
}

/// The ranges of blocks of `side` × `side` of the things that `range` gives the range of.
fn reduced(width: u32, height: u32, side: u32, range: impl Fn(u32, u32) -> (u8, u8)) -> Blocks {
    let (columns, rows) = (width.div_ceil(side), height.div_ceil(side));
    let mut ranges = vec![(u8::MAX, 0); columns as usize * rows as usize];
    for y in 0..height {
        for x in 0..width {
            let block = &mut ranges[((y / side) * columns + x / side) as usize];
            *block = union(*block, range(x, y));
        }
    }
    Blocks {
        columns,
        rows,
        ranges,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;

    /// Ignores a disc.
    fn disc(width: u32, height: u32) -> GrayImage {
        GrayImage::from_fn(width, height, |x, y| {
            let radius = (f64::from(x) - 40.0).hypot(f64::from(y) - 30.0);
            Luma([(20.0 * (radius - 10.0)).clamp(0.0, 255.0) as u8])
        })
    }

    #[test]
    fn ranges_hold_every_value_of_the_rectangle_and_are_tight_far_from_edges() {
        let mask = Mask::new(disc(101, 77));
        let value = |x: i32, y: i32| {
            let at = (x.clamp(0, 100) as u32, y.clamp(0, 76) as u32);
            mask.levels[0].get_pixel(at.0, at.1).0[0]
        };
        for (left, top, width, height) in [
            (0, 0, 100, 76),
            (35, 25, 3, 3),
            (-30, -9, 12, 200),
            (90, 70, 40, 40),
            (17, 29, 61, 1),
        ] {
            let corner = |x: i32, y: i32| [f64::from(x) + 0.5, f64::from(y) + 0.5];
            let (least, greatest) =
                mask.range(corner(left, top), corner(left + width, top + height));
            for y in top..=top + height {
                for x in left..=left + width {
                    assert!((least..=greatest).contains(&value(x, y)), "{x} {y}");
                }
            }
        }
        assert_eq!(mask.range([85.0, 60.0], [200.0, 200.0]), (255, 255));
        assert_eq!(mask.range([40.0, 30.0], [42.0, 31.0]), (0, 0));
        assert_eq!(mask.range([0.0, 0.0], [101.0, 77.0]), (0, 255));
    }

    #[test]
    fn nothing_counts_in_no_place() {
        let mask = Mask::nothing();
        assert_eq!(mask.range([-9.0, 3.0], [900.0, 700.0]), (0, 0));
    }
}
