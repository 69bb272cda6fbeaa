//! Sampling photos and masks: the f32 twin of [`crate::reference::sample`].

use super::lanes::{LANES, Lane, each, whole};
use super::source::Sight;
use crate::frame::{SHOULDER, TRANSPARENT};
use crate::mask::{IGNORED, Mask};
use crate::pyramid::Pyramid;
use crate::visibility::{DistanceMap, FADE, HIDDEN_ROOT, TOLERANCE};
use glam::Vec4;
use image::{ImageBuffer, Pixel};
use std::ops::{Add, Mul, Sub};

/// Adds a photo's colours, by its weights, to those of a tile and to their sum.
#[inline(always)]
pub(super) fn add(
    photo: &Pyramid,
    exposure: Vec4,
    sight: &Sight,
    weights: &Lane,
    color: &mut [Vec4; LANES],
    sum: &mut Lane,
) {
    let weighs = |k: usize| weights[k] > 0.0;
    let texel =
        |[r, g, b, a]: [u8; 4]| Vec4::new(f32::from(r), f32::from(g), f32::from(b), f32::from(a));
    let samples = sample(&photo.levels, photo.finest, sight, weighs, texel);
    let as_it_is = exposure == Vec4::ONE;
    for k in (0..LANES).filter(|&k| weighs(k)) {
        let mut seen = samples[k];
        if !as_it_is {
            seen = exposed(seen, exposure);
        }
        let mut w = weights[k];
        if !photo.opaque {
            // As [`crate::frame::trust`] has it.
            w *= TRANSPARENT as f32 + (1.0 - TRANSPARENT) as f32 / 255.0 * seen.w;
        }
        color[k] += seen * w;
        sum[k] += w;
    }
}

/// What levels of a photo or a mask have at those pixels of a tile that are wanted; trilinear, 0…255. Level
/// by level, as neighbours share theirs. `texel` makes a number or several of a texel's bytes.
#[inline(always)]
fn sample<P, T, const CHANNELS: usize>(
    levels: &[ImageBuffer<P, Vec<u8>>],
    finest: usize,
    sight: &Sight,
    wanted: impl Fn(usize) -> bool,
    texel: impl Fn([u8; CHANNELS]) -> T + Copy,
) -> [T; LANES]
where
    P: Pixel<Subpixel = u8>,
    T: Copy + Default + Add<Output = T> + Sub<Output = T> + Mul<f32, Output = T>,
{
    let (finest, coarsest) = (finest as f32, (levels.len() - 1) as f32);
    let level = each(|k| sight.level[k].max(finest).min(coarsest));
    let (mut lower, mut share) = ([0; LANES], [0.0; LANES]);
    for k in 0..LANES {
        let (floor, whole) = whole(level[k]);
        (lower[k], share[k]) = (whole, level[k] - floor);
    }
    let (mut first, mut last) = (i32::MAX, -1);
    for k in 0..LANES {
        if wanted(k) {
            first = first.min(lower[k]);
            last = last.max(lower[k] + i32::from(share[k] > 0.0));
        }
    }
    let mut samples = [T::default(); LANES];
    for of in first..=last {
        let image = &levels[of as usize];
        let (texels, _) = image.as_raw().as_chunks::<CHANNELS>();
        let places = Places::new(image.dimensions(), sight, of);
        let at = |k: usize| places.bilinear(|i| texel(texels[i]), k);
        for k in 0..LANES {
            if wanted(k) && lower[k] == of {
                samples[k] = at(k);
            } else if wanted(k) && lower[k] + 1 == of && share[k] > 0.0 {
                samples[k] = samples[k] + (at(k) - samples[k]) * share[k];
            }
        }
    }
    samples
}

/// Which texels of a level the pixels of a tile lie between.
struct Places {
    /// The upper left of 2 × 2, all of which are in the image.
    at: Lane<i32>,
    /// How far the pixel is from it to the right, and down: 0…1.
    share: [Lane; 2],
    /// From one texel to the next, and from one row to the next: nothing where there is only one.
    step: [usize; 2],
}

impl Places {
    #[inline(always)]
    fn new((width, height): (u32, u32), sight: &Sight, level: i32) -> Self {
        let scale = 1.0 / (1_u32 << level) as f32;
        let (columns, x) = Self::along(&sight.u, scale, width as i32);
        let (rows, y) = Self::along(&sight.v, scale, height as i32);
        let mut at = [0; LANES];
        for k in 0..LANES {
            at[k] = rows[k] * width as i32 + columns[k];
        }
        Self {
            at,
            share: [x, y],
            step: [
                usize::from(width > 1),
                if height > 1 { width as usize } else { 0 },
            ],
        }
    }

    /// The texel before, and the share of the next. At the border that is all or nothing: what would lie
    /// beyond repeats it.
    #[inline(always)]
    fn along(at: &Lane, scale: f32, count: i32) -> (Lane<i32>, Lane) {
        let (mut before, mut share) = ([0; LANES], [0.0; LANES]);
        let last = (count - 2).max(0);
        for k in 0..LANES {
            // The pixel lies inside the photo, so a shift by one keeps truncation a floor.
            let x = at[k] * scale + 0.5;
            let (floor, next) = whole(x);
            // Of pixels that weigh nothing it may be any number.
            let own = next.wrapping_sub(1);
            before[k] = own.min(last).max(0);
            let inner = if own >= 0 { x - floor } else { 0.0 };
            share[k] = if own > last { 1.0 } else { inner };
        }
        (before, share)
    }

    #[inline(always)]
    fn bilinear<T>(&self, texel: impl Fn(usize) -> T, k: usize) -> T
    where
        T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f32, Output = T>,
    {
        let (at, [right, down]) = (self.at[k] as usize, self.step);
        let (x, y) = (self.share[0][k], self.share[1][k]);
        let top = texel(at) + (texel(at + right) - texel(at)) * x;
        let low = texel(at + down) + (texel(at + down + right) - texel(at + down)) * x;
        top + (low - top) * y
    }
}

/// [`crate::frame::exposed`] for a colour of 0…255.
#[inline(always)]
pub(crate) fn exposed(color: Vec4, exposure: Vec4) -> Vec4 {
    let white = ((1.0 - SHOULDER) as f32 * color.w).max(f32::MIN_POSITIVE);
    let share = (Vec4::splat(color.w) - color) / white;
    color + (exposure - 1.0) * color * share.clamp(Vec4::ZERO, Vec4::ONE)
}

/// Straight 8-bit RGBA of a sum of premultiplied colours of 0…255, over the sum of their weights;
/// see [`crate::image_out::straight_rgba8`].
#[inline(always)]
pub(super) fn straight_rgba8(color: Vec4, weights: f32) -> [u8; 4] {
    // They are 0…256.
    let byte = |v: f32| whole(v).1 as u8;
    let alpha = byte(color.w / weights + 0.5);
    let straight = (color * (255.0 / color.w) + 0.5).min(Vec4::splat(255.0));
    let opaque = [byte(straight.x), byte(straight.y), byte(straight.z), alpha];
    if alpha == 0 { [0; 4] } else { opaque }
}

/// What a mask leaves of its photo at those pixels of a tile that are wanted, 0…1.
#[inline(always)]
pub(super) fn left_by(mask: &Mask, sight: &Sight, wanted: impl Fn(usize) -> bool) -> Lane {
    let values = sample(&mask.levels, 0, sight, wanted, |[value]: [u8; 1]| {
        f32::from(value)
    });
    each(
        #[inline(always)]
        |k| ((values[k] - IGNORED) / (255.0 - IGNORED)).max(0.0),
    )
}

/// How much a photo counts at the points of a tile: see [`crate::visibility`]. Of pixels that it
/// does not see, any number.
#[inline(always)]
pub(super) fn visible(map: &DistanceMap, sight: &Sight) -> Lane {
    let nearest = nearest(map, sight);
    each(
        #[inline(always)]
        |k| {
            let nearest = nearest[k];
            let slack = nearest * TOLERANCE as f32;
            let beyond = nearest - sight.inverse_distance[k] / map.unit as f32;
            let r = ((beyond - slack) / (FADE as f32 * slack)).clamp(0.0, 1.0);
            let root = 1.0 - (1.0 - HIDDEN_ROOT as f32) * r * r * (3.0 - 2.0 * r);
            let hidden = (root * root) * (root * root);
            if beyond <= slack { 1.0 } else { hidden }
        },
    )
}

/// [`DistanceMap::sample`] of a tile's pixels.
#[inline(always)]
fn nearest(map: &DistanceMap, sight: &Sight) -> Lane {
    let [width, height] = map.size.map(|side| side as i32);
    let texel_per_pixel = 1.0 / map.reduction as f32;
    let (mut at, mut shares) = ([[0; LANES]; 4], [[0.0; LANES]; 2]);
    // What is not in the photo may be anywhere, and no number. (From the texel before the first on, so that
    // no number is negative.)
    let within = |at: f32, side: i32| at.max(0.0).min((side + 1) as f32);
    for k in 0..LANES {
        let x = within(sight.u[k] * texel_per_pixel + 0.5, width);
        let y = within(sight.v[k] * texel_per_pixel + 0.5, height);
        let ((left, right), (top, bottom)) = (whole(x), whole(y));
        (shares[0][k], shares[1][k]) = (x - left, y - top);
        let (left, top) = (right - 1, bottom - 1);
        let column = |i: i32| i.clamp(0, width - 1);
        let row = |i: i32| i.clamp(0, height - 1) * width;
        let (x0, x1, y0, y1) = (column(left), column(right), row(top), row(bottom));
        at[0][k] = y0 + x0;
        at[1][k] = y0 + x1;
        at[2][k] = y1 + x0;
        at[3][k] = y1 + x1;
    }
    let mut corners = [[0.0; LANES]; 4];
    for (corner, at) in corners.iter_mut().zip(&at) {
        for k in 0..LANES {
            corner[k] = map.values[at[k] as usize];
        }
    }
    let [a, b, c, d] = &corners;
    each(
        #[inline(always)]
        |k| {
            let upper = a[k] + shares[0][k] * (b[k] - a[k]);
            let lower = c[k] + shares[0][k] * (d[k] - c[k]);
            upper + shares[1][k] * (lower - upper)
        },
    )
}
