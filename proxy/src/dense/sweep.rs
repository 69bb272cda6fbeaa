//! Costs of depths: a photo compared with its neighbours over a sweep of planes.

use super::small::SmallPhoto;
use glam::{DMat3, DVec3, Vec4};

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
const WINDOW: usize = 2 * RADIUS + 1;
/// Depths tried.
const LEAST_DEPTHS: f64 = 32.0;
const MOST_DEPTHS: f64 = 128.0;
/// Variance of grays added to every window's: less is noise, not texture.
const NOISE: f32 = 4.0;
/// The share of a window that a neighbour must show. What it does not show counts as gray, which
/// spoils little: with whole windows only, photos' borders tell less (−0.5 dB on desk-sweep).
const LEAST_SEEN: f32 = 0.3;
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
    let own = Moments::of(reference);
    let mut costs = vec![0_u8; pixels * count];
    let mut best = vec![[0.0_f32; 2]; pixels];
    let mut scratch = Scratch::new(reference);
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
    fn of(photo: &SmallPhoto) -> Self {
        let mut grays: Vec<Vec4> = photo
            .grays
            .iter()
            .map(|g| Vec4::new(*g, g * g, 0.0, 0.0))
            .collect();
        Rows::new(photo.width).box_mean(&mut grays);
        Self {
            mean: grays.iter().map(|g| g.x).collect(),
            variance: grays.iter().map(|g| g.y - g.x * g.x).collect(),
        }
    }
}

/// What comparing needs room for: per pixel the neighbour's gray, its square, its product
/// with the reference's, and 1 where the neighbour shows it.
struct Scratch {
    warped: Vec<Vec4>,
    rows: Rows,
}

impl Scratch {
    fn new(photo: &SmallPhoto) -> Self {
        Self {
            warped: vec![Vec4::ZERO; photo.width * photo.height],
            rows: Rows::new(photo.width),
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
        self.rows.box_mean(&mut self.warped);
        for (i, best) in best.iter_mut().enumerate() {
            let [mean, square, product, seen] = self.warped[i].to_array();
            if seen < LEAST_SEEN {
                continue;
            }
            let variance = square - mean * mean + NOISE;
            let covariance = product - mean * own.mean[i];
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
                // A little beyond its border the photo repeats itself, so that windows on it
                // count.
                let (near_u, near_v) = (u.clamp(0.0, right), v.clamp(0.0, bottom));
                let beyond = (u - near_u).abs().max((v - near_v).abs());
                if !(p.z > 0.0 && beyond <= RADIUS as f32) {
                    self.warped[row + x] = Vec4::ZERO;
                    continue;
                }
                let (u, v) = (near_u, near_v);
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
                let gray = upper + fy * (lower - upper);
                let seen = f32::from(u8::from(other.used[at]));
                let own = reference.grays[row + x];
                self.warped[row + x] = Vec4::new(gray, gray * gray, gray * own, seen);
            }
        }
    }
}

/// Room for means over windows.
struct Rows {
    width: usize,
    /// Sums of a row up to each pixel.
    sums: Vec<Vec4>,
    /// Sums of the window's rows, by column, and the rows themselves.
    column: Vec<Vec4>,
    kept: Vec<Vec4>,
}

impl Rows {
    fn new(width: usize) -> Self {
        Self {
            width,
            sums: vec![Vec4::ZERO; width + 1],
            column: vec![Vec4::ZERO; width],
            kept: vec![Vec4::ZERO; width * WINDOW],
        }
    }

    /// The mean over the window around each pixel, which the image's border cuts.
    fn box_mean(&mut self, values: &mut [Vec4]) {
        let width = self.width;
        let height = values.len() / width;
        self.column.fill(Vec4::ZERO);
        for y in 0..height + RADIUS {
            // 1. A row leaves the window, and the next one enters it, summed along.
            let slot = (y % WINDOW) * width;
            let kept = &mut self.kept[slot..][..width];
            if y >= WINDOW {
                self.column
                    .iter_mut()
                    .zip(kept.iter())
                    .for_each(|(s, v)| *s -= *v);
            }
            if y < height {
                let row = &values[y * width..][..width];
                for (x, value) in row.iter().enumerate() {
                    self.sums[x + 1] = self.sums[x] + *value;
                }
                for (x, kept) in kept.iter_mut().enumerate() {
                    let (from, to) = (x.saturating_sub(RADIUS), (x + RADIUS + 1).min(width));
                    *kept = (self.sums[to] - self.sums[from]) / (to - from) as f32;
                }
                self.column
                    .iter_mut()
                    .zip(kept.iter())
                    .for_each(|(s, v)| *s += *v);
            }
            // 2. The row in its middle.
            if y >= RADIUS {
                let middle = y - RADIUS;
                let rows = (middle + RADIUS + 1).min(height) - middle.saturating_sub(RADIUS);
                let out = &mut values[middle * width..][..width];
                let share = 1.0 / rows as f32;
                out.iter_mut()
                    .zip(&self.column)
                    .for_each(|(o, s)| *o = *s * share);
            }
        }
    }
}
