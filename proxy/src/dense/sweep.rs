//! Costs of depths: a photo compared with its neighbours over a sweep of planes.

use super::small::SmallPhoto;
use super::warp::{Warp, nearest};
use super::windows::{WINDOW, Windows};
use pulp::Arch;
use std::collections::BTreeMap;

/// Costs of a photo's pixels at a number of inverse depths, evenly spaced.
pub(super) struct Costs {
    /// The first, and the step to the next.
    pub(super) first: f64,
    pub(super) step: f64,
    pub(super) count: usize,
    /// Pixel by pixel, all depths of one after the other; 0 is best, 255 worst.
    pub(super) costs: Vec<u8>,
}

/// Depths tried.
const LEAST_DEPTHS: f64 = 32.0;
const MOST_DEPTHS: f64 = 128.0;
/// Variance of grays added to every window's: less is noise, not texture.
const NOISE: f32 = 4.0;
/// The share of a window that a neighbour must show. What it does not show counts as gray, which
/// spoils little: with whole windows only, photos' borders tell less (−0.5 dB on desk-sweep).
const LEAST_SEEN: f32 = 0.3;
/// The cost of what a neighbour does not show, and of what is no better.
const UNSEEN: f32 = 0.6;
/// Planes between which costs are turned from image by image to pixel by pixel: one by one, each
/// cost would touch a cache line of its own.
const AT_ONCE: usize = 16;
/// So many choices of neighbours share a sweep: each takes a byte for each pixel and plane.
const MOST_CHOICES: usize = 4;

/// The costs of a photo's depths between two inverse depths, for some choices of neighbours, none of
/// which is empty. `found` is given each choice's index, and its costs, in some order.
///
/// What choices have in common is compared once, where they try the same depths.
pub(super) fn costs(
    reference: &SmallPhoto,
    photos: &[Option<SmallPhoto>],
    choices: &[Vec<usize>],
    [nearest_to_zero, greatest]: [f64; 2],
    mut found: impl FnMut(usize, Costs),
) {
    // 1. Steps of about one pixel in the neighbour that moves most but one.
    let range = greatest - nearest_to_zero;
    let count_of = |choice: &Vec<usize>| {
        let others = choice.iter().filter_map(|&j| photos[j].as_ref());
        let mut shifts: Vec<f64> = others
            .map(|other| reference.focal * (other.center - reference.center).length())
            .collect();
        shifts.sort_by(|a, b| b.total_cmp(a));
        let shift = shifts[1.min(shifts.len() - 1)];
        (range * shift).clamp(LEAST_DEPTHS, MOST_DEPTHS).round() as usize
    };
    let mut of_count: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (i, choice) in choices.iter().enumerate() {
        of_count.entry(count_of(choice)).or_default().push(i);
    }

    // 2. Some planes after the other.
    for (count, alike) in of_count {
        let step = range / (count - 1) as f64;
        for some in alike.chunks(MOST_CHOICES) {
            let choices: Vec<&[usize]> = some.iter().map(|&i| &choices[i][..]).collect();
            let mut comparison = Comparison::new(reference, photos, &choices);
            let costs = comparison.sweep(count, |plane| nearest_to_zero + step * plane as f64);
            for (&i, costs) in some.iter().zip(costs) {
                let costs = Costs {
                    first: nearest_to_zero,
                    step,
                    count,
                    costs,
                };
                found(i, costs);
            }
        }
    }
}

/// A photo, its neighbours, and room to compare them row after row.
struct Comparison<'a> {
    reference: &'a SmallPhoto,
    others: Vec<&'a SmallPhoto>,
    /// Which of the others each choice has.
    choices: Vec<Vec<usize>>,
    /// Of the window around each of the reference's pixels: the mean of its grays, and 1 over
    /// their deviation.
    means: Vec<f32>,
    sharpness: Vec<f32>,
    /// 1 over how many columns of a window lie in the image.
    columns: Vec<f32>,
    /// By neighbour: of its grays, their squares, their products with the reference's, and 1
    /// where it shows anything.
    windows: Vec<Windows<4>>,
    sums: [Vec<f32>; 4],
    /// By neighbour, of a row.
    costs: Vec<Vec<f32>>,
    /// A row's least costs, and the least but one.
    best: [Vec<f32>; 2],
}

impl<'a> Comparison<'a> {
    fn new(
        reference: &'a SmallPhoto,
        photos: &'a [Option<SmallPhoto>],
        choices: &[&[usize]],
    ) -> Self {
        let mut all: Vec<usize> = choices.concat();
        all.sort_unstable();
        all.dedup();
        all.retain(|&j| photos[j].is_some());
        let within_all = |choice: &&[usize]| -> Vec<usize> {
            let places = choice.iter().filter_map(|j| all.binary_search(j).ok());
            places.collect()
        };
        let width = reference.width;
        let row = || vec![0.0; width];
        let own = Self {
            reference,
            others: all.iter().filter_map(|&j| photos[j].as_ref()).collect(),
            choices: choices.iter().map(within_all).collect(),
            means: vec![0.0; reference.grays.len()],
            sharpness: vec![0.0; reference.grays.len()],
            columns: (0..width).map(|x| 1.0 / within(x, width) as f32).collect(),
            windows: all.iter().map(|_| Windows::new(width)).collect(),
            sums: [row(), row(), row(), row()],
            costs: all.iter().map(|_| row()).collect(),
            best: [row(), row()],
        };
        // A closure that gives away what it has can be called but once; others are called through
        // a function that is not compiled for wide vectors.
        Arch::new().dispatch(
            #[inline(always)]
            move || own.described(),
        )
    }

    /// With the reference's own windows.
    #[inline(always)]
    fn described(mut self) -> Self {
        let (width, height) = (self.reference.width, self.reference.height);
        let mut windows = Windows::<2>::new(width);
        for y in 0..height + WINDOW / 2 {
            match self.reference.grays.chunks_exact(width).nth(y) {
                Some(row) => windows.enter(
                    #[inline(always)]
                    |[grays, squares]| {
                        grays.copy_from_slice(row);
                        for (square, gray) in squares.iter_mut().zip(row) {
                            *square = gray * gray;
                        }
                    },
                ),
                None => windows.enter_nothing(),
            }
            let Some(y) = y.checked_sub(WINDOW / 2) else {
                continue;
            };
            let [sums, squares, ..] = &mut self.sums;
            windows.sums([sums, squares]);
            let rows = 1.0 / within(y, height) as f32;
            let means = &mut self.means[y * width..][..width];
            let sharpness = &mut self.sharpness[y * width..][..width];
            for x in 0..width {
                let share = rows * self.columns[x];
                let mean = sums[x] * share;
                means[x] = mean;
                let variance = (squares[x] * share - mean * mean).max(0.0) + NOISE;
                sharpness[x] = 1.0 / variance.sqrt();
            }
        }
        self
    }

    /// For each choice the costs at so many planes, pixel by pixel.
    fn sweep(&mut self, count: usize, inverse_depth: impl Fn(usize) -> f64) -> Vec<Vec<u8>> {
        let pixels = self.reference.grays.len();
        let each = self.choices.len();
        let mut costs = vec![vec![0_u8; pixels * count]; each];
        let mut planes = vec![vec![0_u8; pixels * AT_ONCE.min(count)]; each];
        for first in (0..count).step_by(AT_ONCE) {
            let depths = AT_ONCE.min(count - first);
            for plane in 0..depths {
                let out = planes
                    .iter_mut()
                    .map(|planes| &mut planes[plane * pixels..][..pixels]);
                self.plane(inverse_depth(first + plane), &mut out.collect::<Vec<_>>());
            }
            for (costs, planes) in costs.iter_mut().zip(&planes) {
                for (pixel, costs) in costs.chunks_exact_mut(count).enumerate() {
                    let costs = costs[first..][..depths].iter_mut();
                    let planes = planes[pixel..].iter().step_by(pixels);
                    costs.zip(planes).for_each(|(cost, plane)| *cost = *plane);
                }
            }
        }
        costs
    }

    /// The costs of all pixels at one plane, for each choice: the mean over the two neighbours that
    /// agree best.
    fn plane(&mut self, inverse_depth: f64, out: &mut [&mut [u8]]) {
        let warps: Vec<Warp<'_>> = self
            .others
            .iter()
            .map(|other| Warp::new(self.reference, other, inverse_depth))
            .collect();
        Arch::new().dispatch(
            #[inline(always)]
            move || self.rows(warps, out),
        );
    }

    #[inline(always)]
    fn rows(&mut self, warps: Vec<Warp<'_>>, out: &mut [&mut [u8]]) {
        let (width, height) = (self.reference.width, self.reference.height);
        self.windows.iter_mut().for_each(Windows::clear);
        for y in 0..height + WINDOW / 2 {
            let own = self.reference.grays.chunks_exact(width).nth(y);
            for (windows, warp) in self.windows.iter_mut().zip(&warps) {
                match own {
                    Some(own) => windows.enter(
                        #[inline(always)]
                        |channels| warp.row(y, own, channels),
                    ),
                    None => windows.enter_nothing(),
                }
            }
            if let Some(y) = y.checked_sub(WINDOW / 2) {
                self.row(y, out);
            }
        }
    }

    /// One row of them.
    #[inline(always)]
    fn row(&mut self, y: usize, out: &mut [&mut [u8]]) {
        let width = self.reference.width;
        let rows = 1.0 / within(y, self.reference.height) as f32;
        let own = y * width..(y + 1) * width;
        for (windows, costs) in self.windows.iter().zip(&mut self.costs) {
            let [grays, squares, products, seen] = &mut self.sums;
            windows.sums([grays, squares, products, seen]);
            correlate(
                [grays, squares, products, seen],
                [
                    &self.means[own.clone()],
                    &self.sharpness[own.clone()],
                    &self.columns,
                ],
                rows,
                costs,
            );
        }
        let [first, second] = &mut self.best;
        for (choice, out) in self.choices.iter().zip(out) {
            first.fill(UNSEEN);
            second.fill(UNSEEN);
            for &other in choice {
                add(&self.costs[other], first, second);
            }
            let seconds: &[f32] = if choice.len() == 1 { first } else { second };
            let out = out[own.clone()].iter_mut();
            for ((out, first), second) in out.zip(&first[..]).zip(seconds) {
                let cost = 0.5 * (first + second);
                *out = nearest(255.0 * cost.clamp(0.0, 1.0)) as u8;
            }
        }
    }
}

/// A neighbour's costs along a row.
///
/// Noise is one more part of both windows that they have in common, so nothing fits better than the window itself. (Added to
/// their variances alone, it let windows of more contrast fit better where there was little: depths of soft texture were off by
/// more than a step.) What a window shows by itself, beside noise, is how much its fit tells.
#[inline(always)]
fn correlate(
    [grays, squares, products, seen]: [&[f32]; 4],
    [means, sharpness, columns]: [&[f32]; 3],
    rows: f32,
    costs: &mut [f32],
) {
    let width = costs.len();
    let (grays, squares, products) = (&grays[..width], &squares[..width], &products[..width]);
    let (seen, means, sharpness) = (&seen[..width], &means[..width], &sharpness[..width]);
    let columns = &columns[..width];
    for x in 0..width {
        let share = rows * columns[x];
        let mean = grays[x] * share;
        let variance = (squares[x] * share - mean * mean).max(0.0) + NOISE;
        let covariance = products[x] * share - mean * means[x];
        let sharp = sharpness[x];
        let told = 1.0 - NOISE * sharp * sharp;
        let correlation = told * (covariance + NOISE) * sharp / variance.sqrt();
        let enough = seen[x] * share >= LEAST_SEEN;
        costs[x] = if enough {
            0.5 * (1.0 - correlation)
        } else {
            UNSEEN
        };
    }
}

/// Adds costs to the best two.
#[inline(always)]
fn add(costs: &[f32], first: &mut [f32], second: &mut [f32]) {
    let width = costs.len();
    let (first, second) = (&mut first[..width], &mut second[..width]);
    for x in 0..width {
        second[x] = second[x].min(first[x].max(costs[x]));
        first[x] = first[x].min(costs[x]);
    }
}

/// How many of a window's pixels lie in a row of so many, around one of them.
fn within(middle: usize, length: usize) -> usize {
    (middle + WINDOW / 2 + 1).min(length) - middle.saturating_sub(WINDOW / 2)
}
