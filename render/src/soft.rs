//! What nobody knows is drawn softly: guesses, and what photos contradict each other of.
//!
//! What no photo has, or shows, of the proxy is looked at elsewhere along its ray, where one does (`sight.rs`). Of such
//! pixels neighbours may look at things far apart: streaks, teeth and patterns, as sharp as photos are. What is right beside
//! what photos show is likely to go on as they do; farther in nobody knows more than a colour. So each guess becomes the
//! mean of what is around it, over as much as it is far from what is seen. And where photos contradict each other
//! (`contradictions.rs`) at most one of them shows what is there: the less they agree, the wider the mean. Both by one
//! pyramid, whose levels are mixed from coarse to fine (Burt and Adelson 1983).

use crate::contradictions::{Contradictions, goes_all_round};
use crate::frame::Frame;
use crate::surface::{FacetMap, Surface};
use glam::Vec4;
use image::{GenericImage, GenericImageView, RgbaImage};
use rayon::prelude::*;
use std::ops::Range;

/// A guess has the level of the pyramid that is the binary logarithm of one more than so many times its distance from what is
/// seen. With twice as much held-out photos of temple-ring lose 0.09 dB, whose guesses, of the dark behind the object, are
/// right; those of four other captures gain 0.05.
const LEVEL_BY_DISTANCE: f32 = 0.35;

/// What photos contradict each other of has the level that is the binary logarithm of one more than so many times the
/// picture's longer side by how far they are from their mean, 0…1, beyond [`AGREE`].
const LEVEL_BY_CONTRADICTION: f32 = 0.04;

/// No farther from their mean, 0…1, photos agree.
const AGREE: f32 = 0.05;

/// A pixel of the coarsest level that is mixed in has in it what is within so many times its side: to make all levels takes two
/// pixels of each finer one around it, and to go back as much.
const REACH: usize = 4;

/// What a level of the pyramid is made of and made finer by: a pixel and two on either side.
const TAPS: [f32; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];

/// How many pixels of a picture were drawn softly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Softened {
    /// That no photo shows.
    pub guessed: usize,
    /// All others: photos contradict each other.
    pub contradicted: usize,
}

/// Draws those parts of a frame's picture softly that no photo shows, but for a guess, and those of which photos contradict
/// each other, as far as contradictions are given. Their alpha stays.
///
/// Not so of a proxy that is a plane, of which nothing is guessed: what no photo has is not covered.
pub fn soften(
    frame: &Frame<'_>,
    contradictions: Option<&Contradictions>,
    picture: &mut RgbaImage,
) -> Softened {
    let Surface::Facets(map) = &frame.surface else {
        return Softened::default();
    };
    if !goes_all_round(&frame.desired) {
        return soften_where(map, contradictions, 0, picture);
    }
    // The left border of a picture that goes all round is beside the right one.
    let (width, height) = picture.dimensions();
    let beside = width / 2;
    let mut wide = RgbaImage::from_fn(width + 2 * beside, height, |x, y| {
        *picture.get_pixel((x + width - beside) % width, y)
    });
    let count = soften_where(map, contradictions, beside as usize, &mut wide);
    picture
        .copy_from(&*wide.view(beside, 0, width, height), 0, 0)
        .expect("it is as large");
    count
}

/// The same of a picture beside which so many columns of it are repeated on either side.
fn soften_where(
    map: &FacetMap,
    contradictions: Option<&Contradictions>,
    beside: usize,
    picture: &mut RgbaImage,
) -> Softened {
    let size = [picture.width() as usize, picture.height() as usize];
    let width = size[0] - 2 * beside;
    let own = |x: usize| match beside {
        0 => x,
        _ => (x + width - beside) % width,
    };
    let shift_px = |x: usize, y: usize| map.shift_px(map.facet_of[y * width + own(x)]);
    let is_guess = |x: usize, y: usize| shift_px(x, y) > 0.0;
    // 1. How coarse each is to be: where photos contradict each other, and of guesses.
    let longer = width.max(size[1]) as f32;
    let pixels = picture.as_raw().as_chunks::<4>().0;
    let of_row = |y: usize| {
        let offs = contradictions.map(|all| all.row(y)).into_iter().flatten();
        let level = |(off, pixel): (f32, &[u8; 4])| match pixel[3] {
            0 => 0.0,
            _ => level(LEVEL_BY_CONTRADICTION * longer * (off - AGREE).max(0.0)),
        };
        let own = &pixels[y * size[0] + beside..][..width];
        offs.zip(own).map(level).collect()
    };
    let contradicted: Vec<Vec<f32>> = (0..size[1]).into_par_iter().map(of_row).collect();
    let contradicted_at = |x: usize, y: usize| contradicted[y].get(own(x)).copied();
    let is_soft = |x: usize, y: usize| {
        contradicted_at(x, y).is_some_and(|level| level > 0.0) || is_guess(x, y)
    };
    let Some(soft) = Part::around(size, is_soft) else {
        return Softened::default();
    };
    let far = soft.and(1, 1, size);
    let distances = match map.any_is_moved() {
        true => distances(&far, is_guess),
        false => vec![Vec::new(); far.rows.len()],
    };
    let of_row = |(y, distances): (usize, Vec<f32>)| -> Vec<f32> {
        let distances = distances.into_iter().chain(std::iter::repeat(0.0));
        let row = far.columns.clone().zip(distances);
        let level = |(x, distance): (usize, f32)| {
            let of_guess = level(LEVEL_BY_DISTANCE * distance.min(shift_px(x, y)));
            of_guess.max(contradicted_at(x, y).unwrap_or(0.0))
        };
        row.map(level).collect()
    };
    let rows = far.rows.clone().into_par_iter();
    let levels: Vec<Vec<f32>> = rows.zip(distances).map(of_row).collect();
    let level_at = |x: usize, y: usize| far.place(x, y).map_or(0.0, |[x, y]| levels[y][x]);
    let coarsest = levels.par_iter().flat_map_iter(|row| row.iter().copied());
    let coarsest = coarsest.reduce(|| 0.0, f32::max).ceil() as usize;
    // 2. Ever coarser pictures of what is around, whose pixels lie on the same ones of the picture wherever that is.
    let around = soft.and(REACH << coarsest, 1 << coarsest, size);
    let mut pyramid = vec![Level::of(picture, &around)];
    for l in 0..coarsest {
        let coarser = pyramid[l].reduced();
        pyramid.push(coarser);
    }
    // 3. From coarse to fine, each as far as no coarser one is wanted.
    let mut mixed = pyramid.pop().expect("the picture at least");
    for (l, mut own) in pyramid.into_iter().enumerate().rev() {
        let first = [around.columns.start, around.rows.start];
        let share = |x: usize, y: usize| {
            // The pixel of the picture on which that of the level lies.
            let level = level_at(first[0] + (x << l), first[1] + (y << l));
            (level - l as f32).clamp(0.0, 1.0)
        };
        own.mix_with(&mixed, share);
        mixed = own;
    }
    // 4. Into the picture.
    let columns = soft.columns.start.max(beside)..soft.columns.end.min(beside + width);
    let of_row = |(y, row): (usize, &mut [[u8; 4]])| {
        let mut count = Softened::default();
        for x in columns.clone().filter(|x| level_at(*x, y) > 0.0) {
            let Some([column, row_of_part]) = around.place(x, y) else {
                continue;
            };
            let sum = mixed.rows[row_of_part][column];
            let pixel = &mut row[x];
            let is_guess = is_guess(x, y);
            count.guessed += usize::from(is_guess);
            if pixel[3] > 0 && sum.w > 0.0 {
                count.contradicted += usize::from(!is_guess);
                let straight = (sum * (255.0 / sum.w) + 0.5).min(Vec4::splat(255.0));
                let [r, g, b] = straight.truncate().to_array().map(|c| c as u8);
                *pixel = [r, g, b, pixel[3]];
            }
        }
        count
    };
    let rows = picture.as_chunks_mut::<4>().0.par_chunks_exact_mut(size[0]);
    let rows = rows.enumerate().skip(soft.rows.start).take(soft.rows.len());
    rows.map(of_row).reduce(Softened::default, Softened::and)
}

impl Softened {
    fn and(self, more: Self) -> Self {
        Self {
            guessed: self.guessed + more.guessed,
            contradicted: self.contradicted + more.contradicted,
        }
    }
}

/// The level of the pyramid of what is so much wider than a pixel.
fn level(more: f32) -> f32 {
    if more > 0.0 { (more + 1.0).log2() } else { 0.0 }
}

/// A part of a picture.
struct Part {
    columns: Range<usize>,
    rows: Range<usize>,
}

impl Part {
    /// The smallest one with all pixels of a kind; `None` without any.
    fn around(
        [width, height]: [usize; 2],
        is_in: impl Fn(usize, usize) -> bool + Sync,
    ) -> Option<Self> {
        let of_row = |y: usize| {
            let first = (0..width).find(|x| is_in(*x, y))?;
            let last = (0..width).rfind(|x| is_in(*x, y))?;
            Some((first..last + 1, y))
        };
        let rows = (0..height).into_par_iter().with_min_len(32);
        let all: Vec<(Range<usize>, usize)> = rows.filter_map(of_row).collect();
        Some(Self {
            columns: all.iter().map(|(columns, _)| columns.start).min()?
                ..all.iter().map(|(columns, _)| columns.end).max()?,
            rows: all.first()?.1..all.last()?.1 + 1,
        })
    }

    /// So much more on all sides, as far as there is a picture, from a whole number of steps on.
    fn and(&self, more: usize, step: usize, [width, height]: [usize; 2]) -> Self {
        let grown = |range: &Range<usize>, side: usize| {
            range.start.saturating_sub(more) / step * step..(range.end + more).min(side)
        };
        Self {
            columns: grown(&self.columns, width),
            rows: grown(&self.rows, height),
        }
    }

    /// Its column and row in which a pixel of the picture is, if it is in it.
    fn place(&self, x: usize, y: usize) -> Option<[usize; 2]> {
        let is_in = self.columns.contains(&x) && self.rows.contains(&y);
        is_in.then(|| [x - self.columns.start, y - self.rows.start])
    }
}

/// How far each pixel of a part, row by row, is from those that are no guesses, in pixels; as far as the part is wide and high
/// where there are none. Exact (Meijster et al. 2000: down columns, then the lowest of parabolas along rows).
fn distances(part: &Part, is_guess: impl Fn(usize, usize) -> bool + Sync) -> Vec<Vec<f32>> {
    let (width, height) = (part.columns.len(), part.rows.len());
    let none = width + height;
    // 1. To the nearest above or below.
    let mut down = vec![0; width * height];
    let mut last = vec![none; width];
    for (y, row) in part.rows.clone().zip(down.chunks_exact_mut(width)) {
        for ((x, own), last) in part.columns.clone().zip(row).zip(&mut last) {
            *last = if is_guess(x, y) { *last + 1 } else { 0 };
            *own = (*last).min(none);
        }
    }
    for row in down.chunks_exact_mut(width).rev() {
        for (own, last) in row.iter_mut().zip(&mut last) {
            *last = (*last + 1).min(*own);
            *own = *last;
        }
    }
    // 2. Of all columns: of each run of guesses those and the seen ones at its ends, as what is beyond is farther.
    let rows = down.par_chunks_exact(width).map(|row| {
        let mut distances = vec![0.0; width];
        let mut lowest = Vec::new();
        let mut start = 0;
        for run in row.chunk_by(|a, b| (*a == 0) == (*b == 0)) {
            let end = start + run.len();
            if run[0] > 0 {
                let first = start.saturating_sub(1);
                let columns = &row[first..(end + 1).min(width)];
                lowest_parabolas(columns, &mut lowest);
                let mut k = 0;
                for (x, distance) in (start - first..).zip(&mut distances[start..end]) {
                    while lowest.get(k + 1).is_some_and(|(_, from)| *from < x as f64) {
                        k += 1;
                    }
                    let nearest: usize = lowest[k].0;
                    let squared = x.abs_diff(nearest).pow(2) + columns[nearest].pow(2);
                    *distance = (squared as f64).sqrt() as f32;
                }
            }
            start = end;
        }
        distances
    });
    rows.collect()
}

/// Of parabolas over columns, each as far above as that column's value squared, those that are lowest somewhere, from left
/// to right, and from where on.
fn lowest_parabolas(columns: &[usize], lowest: &mut Vec<(usize, f64)>) {
    // Where that of one column is as high as that of one at its left.
    let meet = |left: usize, right: usize| {
        let square = |x: usize| (columns[x].pow(2) + x.pow(2)) as f64;
        (square(right) - square(left)) / (2 * (right - left)) as f64
    };
    lowest.clear();
    for x in 0..columns.len() {
        let from = loop {
            let Some(&(left, since)) = lowest.last() else {
                break f64::NEG_INFINITY;
            };
            let from = meet(left, x);
            if from > since {
                break from;
            }
            lowest.pop();
        };
        lowest.push((x, from));
    }
}

/// A level of the pyramid: premultiplied colours of 0…255 and alpha, row by row. (Each row has memory of its own: in one
/// piece, all that a frame needs is asked of the system anew, on one thread.)
struct Level {
    rows: Vec<Vec<Vec4>>,
}

impl Level {
    /// The finest, of a part of a picture.
    fn of(picture: &RgbaImage, part: &Part) -> Self {
        let pixels = picture.as_raw().as_chunks::<4>().0;
        let premultiplied = |[r, g, b, alpha]: &[u8; 4]| {
            let straight = Vec4::new(f32::from(*r), f32::from(*g), f32::from(*b), 255.0);
            straight * (f32::from(*alpha) / 255.0)
        };
        let of_row = |y: usize| {
            let row = &pixels[y * picture.width() as usize..][part.columns.clone()];
            row.iter().map(premultiplied).collect()
        };
        Self {
            rows: part.rows.clone().into_par_iter().map(of_row).collect(),
        }
    }

    /// Half as wide and high: a pixel lies on every other one. What is beyond the border repeats it.
    fn reduced(&self) -> Self {
        let (width, height) = self.size();
        let near = |at: usize, k: usize, side: usize| (2 * at + k).saturating_sub(2).min(side - 1);
        let half = width.div_ceil(2);
        let of_row = |y: usize| {
            let mut column = vec![Vec4::ZERO; width];
            for (k, tap) in TAPS.into_iter().enumerate() {
                let row = column.iter_mut().zip(&self.rows[near(y, k, height)]);
                row.for_each(|(sum, own)| *sum += *own * tap);
            }
            let mean = |x: usize| {
                let taps = TAPS.into_iter().enumerate();
                taps.map(|(k, tap)| column[near(x, k, width)] * tap)
                    .sum::<Vec4>()
            };
            (0..half).map(mean).collect()
        };
        let rows = (0..height.div_ceil(2)).into_par_iter();
        Self {
            rows: rows.map(of_row).collect(),
        }
    }

    fn size(&self) -> (usize, usize) {
        (self.rows.first().map_or(0, Vec::len), self.rows.len())
    }

    /// Takes of the coarser level as large a share as is wanted of it at each pixel, 0…1.
    fn mix_with(&mut self, coarser: &Self, share: impl Fn(usize, usize) -> f32 + Sync) {
        let (width, height) = coarser.size();
        let mix = |(y, row): (usize, &mut Vec<Vec4>)| {
            for (x, sum) in row.iter_mut().enumerate() {
                let share = share(x, y);
                if share > 0.0 {
                    let mut wide = Vec4::ZERO;
                    for (row, down) in finer_taps(y, height) {
                        let row = &coarser.rows[row];
                        for (column, along) in finer_taps(x, width) {
                            wide += row[column] * (down * along);
                        }
                    }
                    *sum += (wide - *sum) * share;
                }
            }
        };
        self.rows.par_iter_mut().enumerate().for_each(mix);
    }
}

/// The pixels of a coarser level, so many wide or high, that one of the finer level is made of, and by what shares: of [`TAPS`]
/// those that fall on pixels, twice.
fn finer_taps(at: usize, side: usize) -> [(usize, f32); 3] {
    let on = at / 2;
    let next = (on + 1).min(side - 1);
    if at.is_multiple_of(2) {
        let [outer, _, middle, ..] = TAPS.map(|tap| 2.0 * tap);
        [(on.saturating_sub(1), outer), (on, middle), (next, outer)]
    } else {
        let half = 2.0 * TAPS[1];
        [(on, half), (next, half), (on, 0.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::{Level, Part, distances, finer_taps};
    use image::{Rgba, RgbaImage};

    #[test]
    fn distances_are_those_to_the_nearest_pixel_that_is_seen() {
        let (width, height) = (37_usize, 23_usize);
        for (seen_of_64, salt) in [(1, 1), (5, 2), (40, 3)] {
            // Any pattern.
            let is_guess =
                |x: usize, y: usize| (31 * x + 17 * y + 7 * x * y + salt) % 64 >= seen_of_64;
            let part = Part {
                columns: 2..width,
                rows: 3..height,
            };
            let places = || {
                part.rows
                    .clone()
                    .flat_map(|y| (2..width).map(move |x| (x, y)))
            };
            let found = distances(&part, is_guess).into_iter().flatten();
            for ((x, y), found) in places().zip(found) {
                let seen = places().filter(|(x, y)| !is_guess(*x, *y));
                let to = seen.map(|(a, b)| a.abs_diff(x).pow(2) + b.abs_diff(y).pow(2));
                let expected = (to.min().unwrap() as f32).sqrt();
                assert_eq!(found, expected, "{x}, {y}");
            }
        }
    }

    #[test]
    fn where_nothing_is_seen_distances_are_finite() {
        let part = Part {
            columns: 0..5,
            rows: 0..4,
        };
        for distance in distances(&part, |_, _| true).into_iter().flatten() {
            assert!((9.0..=14.0).contains(&distance), "{distance}");
        }
    }

    #[test]
    fn levels_of_one_colour_have_that_colour() {
        let color = Rgba([200, 100, 50, 255]);
        for (width, height) in [(1, 1), (2, 3), (13, 8)] {
            let picture = RgbaImage::from_pixel(width, height, color);
            let part = Part {
                columns: 0..width as usize,
                rows: 0..height as usize,
            };
            let mut fine = Level::of(&picture, &part);
            let coarse = fine.reduced().reduced();
            let mut middle = fine.reduced();
            middle.mix_with(&coarse, |_, _| 1.0);
            fine.mix_with(&middle, |_, _| 0.5);
            for sum in fine.rows.iter().chain(&coarse.rows).flatten() {
                let off = *sum - glam::Vec4::new(200.0, 100.0, 50.0, 255.0);
                assert!(off.abs().max_element() < 1e-3, "{sum}");
            }
        }
    }

    #[test]
    fn what_is_taken_of_a_coarser_level_is_all_of_it() {
        for side in 1..4 {
            for at in 0..2 * side {
                let taps = finer_taps(at, side);
                assert_eq!(taps.iter().map(|(_, tap)| tap).sum::<f32>(), 1.0);
                assert!(taps.iter().all(|(i, _)| *i < side), "{at} of {side}");
            }
        }
    }
}
