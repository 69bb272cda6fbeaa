//! Costs of depths: a photo compared with its neighbours over a sweep of planes.

use super::small::SmallPhoto;
use glam::{DMat3, DVec3};

/// Costs of a photo's pixels at a number of inverse depths, evenly spaced.
pub(super) struct Costs {
    /// The first, and the step to the next.
    pub(super) first: f64,
    pub(super) step: f64,
    pub(super) count: usize,
    /// Pixel by pixel, all depths of one after the other; 0 is best, 255 worst.
    pub(super) costs: Vec<u8>,
}

/// Half the side of the windows that are compared, in pixels.
const RADIUS: usize = 2;
/// Depths tried.
const LEAST_DEPTHS: f64 = 32.0;
const MOST_DEPTHS: f64 = 128.0;
/// Variance of grays added to every window's: less is noise, not texture.
const NOISE: f32 = 4.0;
/// The cost of what a neighbour does not show.
const UNSEEN: f32 = 0.6;

/// The costs between two inverse depths; `None` without neighbours.
pub(super) fn costs(
    reference: &SmallPhoto,
    others: &[&SmallPhoto],
    [nearest_to_zero, greatest]: [f64; 2],
) -> Option<Costs> {
    if others.is_empty() {
        return None;
    }
    // 1. Steps of about one pixel in the neighbour that moves most but one.
    let mut shifts: Vec<f64> = others
        .iter()
        .map(|other| reference.focal * (other.center - reference.center).length())
        .collect();
    shifts.sort_by(|a, b| b.total_cmp(a));
    let shift = shifts[1.min(shifts.len() - 1)];
    let range = greatest - nearest_to_zero;
    let count = (range * shift).clamp(LEAST_DEPTHS, MOST_DEPTHS).round() as usize;
    let step = range / (count - 1) as f64;

    // 2. Plane after plane.
    let pixels = reference.width * reference.height;
    let own = Moments::of(reference, &reference.grays);
    let mut costs = vec![0_u8; pixels * count];
    let mut best = vec![[0.0_f32; 2]; pixels];
    let mut scratch = Scratch::new(pixels);
    for plane in 0..count {
        let inverse_depth = nearest_to_zero + step * plane as f64;
        best.fill([UNSEEN; 2]);
        for other in others {
            scratch.compare(reference, other, &own, inverse_depth, &mut best);
        }
        for (pixel, [first, second]) in best.iter().enumerate() {
            let cost = if others.len() > 1 {
                0.5 * (first + second)
            } else {
                *first
            };
            costs[pixel * count + plane] = (255.0 * cost.clamp(0.0, 1.0)) as u8;
        }
    }
    Some(Costs {
        first: nearest_to_zero,
        step,
        count,
        costs,
    })
}

/// Means over the window around each pixel.
struct Moments {
    mean: Vec<f32>,
    variance: Vec<f32>,
}

impl Moments {
    fn of(photo: &SmallPhoto, grays: &[f32]) -> Self {
        let mut row = Vec::new();
        let mut mean = vec![0.0; grays.len()];
        let mut square: Vec<f32> = grays.iter().map(|g| g * g).collect();
        mean.copy_from_slice(grays);
        box_mean(&mut mean, photo.width, &mut row);
        box_mean(&mut square, photo.width, &mut row);
        let variance = square.iter().zip(&mean).map(|(s, m)| s - m * m);
        Self {
            variance: variance.collect(),
            mean,
        }
    }
}

/// What comparing needs room for.
struct Scratch {
    warped: Vec<f32>,
    squares: Vec<f32>,
    products: Vec<f32>,
    seen: Vec<bool>,
    row: Vec<f32>,
}

impl Scratch {
    fn new(pixels: usize) -> Self {
        Self {
            warped: vec![0.0; pixels],
            squares: vec![0.0; pixels],
            products: vec![0.0; pixels],
            seen: vec![false; pixels],
            row: Vec::new(),
        }
    }

    /// Compares with one neighbour at one plane, and keeps each pixel's best two costs.
    fn compare(
        &mut self,
        reference: &SmallPhoto,
        other: &SmallPhoto,
        own: &Moments,
        inverse_depth: f64,
        best: &mut [[f32; 2]],
    ) {
        self.warp(reference, other, inverse_depth);
        for (i, warped) in self.warped.iter().enumerate() {
            self.squares[i] = warped * warped;
            self.products[i] = warped * reference.grays[i];
        }
        let width = reference.width;
        box_mean(&mut self.warped, width, &mut self.row);
        box_mean(&mut self.squares, width, &mut self.row);
        box_mean(&mut self.products, width, &mut self.row);
        for (i, best) in best.iter_mut().enumerate() {
            if !self.seen[i] {
                continue;
            }
            let (mean, own_mean) = (self.warped[i], own.mean[i]);
            let variance = self.squares[i] - mean * mean + NOISE;
            let covariance = self.products[i] - mean * own_mean;
            let correlation = covariance / (variance * (own.variance[i] + NOISE)).sqrt();
            let cost = 0.5 * (1.0 - correlation);
            if cost < best[0] {
                *best = [cost, best[0]];
            } else if cost < best[1] {
                best[1] = cost;
            }
        }
    }

    /// The neighbour as the reference would see it if all lay on a plane.
    fn warp(&mut self, reference: &SmallPhoto, other: &SmallPhoto, inverse_depth: f64) {
        // x' ~ R x + t·w for the ray x through a pixel, z = 1.
        let rotation = other.rotation * reference.rotation.transpose();
        let translation = other.rotation * (reference.center - other.center);
        let half = |side: usize| side as f64 / 2.0;
        let from_pixel = DMat3::from_cols(
            DVec3::X / reference.focal,
            DVec3::Y / reference.focal,
            DVec3::new(
                (0.5 - half(reference.width)) / reference.focal,
                (0.5 - half(reference.height)) / reference.focal,
                1.0,
            ),
        );
        let plane = DMat3::from_cols(DVec3::ZERO, DVec3::ZERO, translation * inverse_depth);
        // Both matrices act on rays with z = 1, so the third column takes the translation.
        let to_pixel = DMat3::from_cols(
            DVec3::X * other.focal,
            DVec3::Y * other.focal,
            DVec3::new(half(other.width) - 0.5, half(other.height) - 0.5, 1.0),
        );
        let h = to_pixel * (rotation + plane) * from_pixel;
        let (right, bottom) = ((other.width - 1) as f32, (other.height - 1) as f32);
        let [hx, hz] = [h.x_axis.as_vec3(), h.z_axis.as_vec3()];
        for y in 0..reference.height {
            let start = (h.y_axis * y as f64).as_vec3() + hz;
            let row = y * reference.width;
            for x in 0..reference.width {
                let p = start + hx * x as f32;
                let (u, v) = (p.x / p.z, p.y / p.z);
                let inside = p.z > 0.0 && u >= 0.0 && v >= 0.0 && u <= right && v <= bottom;
                if !inside {
                    self.warped[row + x] = reference.grays[row + x];
                    self.seen[row + x] = false;
                    continue;
                }
                let (left, top) = (u as usize, v as usize);
                let (fx, fy) = (u - left as f32, v - top as f32);
                let at = top * other.width + left;
                let over = usize::from(left + 1 < other.width);
                let under = if top + 1 < other.height {
                    other.width
                } else {
                    0
                };
                let g = &other.grays;
                let upper = g[at] + fx * (g[at + over] - g[at]);
                let lower = g[at + under] + fx * (g[at + under + over] - g[at + under]);
                self.warped[row + x] = upper + fy * (lower - upper);
                self.seen[row + x] = other.used[at];
            }
        }
    }
}

/// The mean over the window around each pixel, which the image's border cuts.
fn box_mean(values: &mut [f32], width: usize, sums: &mut Vec<f32>) {
    let height = values.len() / width;
    // 1. Along rows.
    sums.clear();
    sums.resize(width + 1, 0.0);
    for row in values.chunks_exact_mut(width) {
        for (x, value) in row.iter().enumerate() {
            sums[x + 1] = sums[x] + value;
        }
        for (x, value) in row.iter_mut().enumerate() {
            let (from, to) = (x.saturating_sub(RADIUS), (x + RADIUS + 1).min(width));
            *value = (sums[to] - sums[from]) / (to - from) as f32;
        }
    }
    // 2. Down columns: the rows that the window still needs, kept aside.
    let window = 2 * RADIUS + 1;
    let mut kept = vec![0.0; window * width];
    let mut sum = vec![0.0_f32; width];
    let slot = |y: usize| (y % window) * width;
    for y in 0..height + RADIUS {
        if y < height {
            if y >= window {
                // Its row leaves the window, and the kept rows with it.
                let old = &kept[slot(y)..][..width];
                sum.iter_mut().zip(old).for_each(|(s, v)| *s -= v);
            }
            let row = &values[y * width..][..width];
            kept[slot(y)..][..width].copy_from_slice(row);
            sum.iter_mut().zip(row).for_each(|(s, v)| *s += v);
        } else if y >= window {
            let old = &kept[slot(y)..][..width];
            sum.iter_mut().zip(old).for_each(|(s, v)| *s -= v);
        }
        if y >= RADIUS {
            let middle = y - RADIUS;
            let rows = (middle + RADIUS + 1).min(height) - middle.saturating_sub(RADIUS);
            let out = &mut values[middle * width..][..width];
            out.iter_mut()
                .zip(&sum)
                .for_each(|(o, s)| *o = s / rows as f32);
        }
    }
}
