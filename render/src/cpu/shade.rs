//! Sampling photos and masks: the f32 twin of [`crate::reference::sample`].

use super::lanes::{LANES, Lane, each};
use super::source::Sight;
use crate::frame::SHOULDER;
use crate::mask::{IGNORED, Mask};
use crate::pyramid::Pyramid;
use crate::visibility::{DistanceMap, FADE, HIDDEN_ROOT, TEXEL_PER_PIXEL, TOLERANCE};
use glam::Vec4;
use image::{ImageBuffer, Pixel};
use std::ops::{Add, Mul, Sub};

/// Adds a photo's colours, by its weights, to those of a tile and to their sum.
#[inline(always)]
pub(super) fn add(
    photo: &Pyramid,
    exposure: Vec4,
    sight: &Sight,
    weights: &[f32],
    color: &mut [Vec4; LANES],
    sum: &mut Lane,
) {
    let as_it_is = exposure == Vec4::ONE;
    for (k, &w) in weights.iter().enumerate().take(LANES) {
        if w > 0.0 {
            let mut seen = sample(photo, sight.u[k], sight.v[k], sight.level[k]);
            if !as_it_is {
                seen = exposed(seen, exposure);
            }
            color[k] += seen * w;
            sum[k] += w;
        }
    }
}

/// Trilinear; premultiplied, 0…255.
#[inline(always)]
pub(crate) fn sample(photo: &Pyramid, u: f32, v: f32, level: f32) -> Vec4 {
    let texel =
        |[r, g, b, a]: [u8; 4]| Vec4::new(f32::from(r), f32::from(g), f32::from(b), f32::from(a));
    trilinear(&photo.levels, u, v, level.max(photo.finest as f32), texel)
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
#[inline]
pub(crate) fn straight_rgba8(color: Vec4, weights: f32) -> [u8; 4] {
    let alpha = (color.w / weights + 0.5) as u8;
    if alpha == 0 {
        return [0; 4];
    }
    let straight = (color * (255.0 / color.w) + 0.5).min(Vec4::splat(255.0));
    [straight.x as u8, straight.y as u8, straight.z as u8, alpha]
}

/// What a mask leaves of its photo, 0…1; trilinear.
#[inline]
pub(crate) fn sample_mask(mask: &Mask, u: f32, v: f32, level: f32) -> f32 {
    let texel = |[value]: [u8; 1]| f32::from(value);
    let value = trilinear(&mask.levels, u, v, level, texel);
    ((value - IGNORED) / (255.0 - IGNORED)).max(0.0)
}

/// `texel` makes a number or several of a texel's bytes.
#[inline(always)]
fn trilinear<P, T, const CHANNELS: usize>(
    levels: &[ImageBuffer<P, Vec<u8>>],
    u: f32,
    v: f32,
    level: f32,
    texel: impl Fn([u8; CHANNELS]) -> T + Copy,
) -> T
where
    P: Pixel<Subpixel = u8>,
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f32, Output = T>,
{
    if level <= 0.0 {
        return bilinear(levels, u, v, 0, texel);
    }
    let level = level.min((levels.len() - 1) as f32);
    let lower = level as usize;
    let fraction = level - lower as f32;
    let color = bilinear(levels, u, v, lower, texel);
    if fraction > 0.0 {
        color + (bilinear(levels, u, v, lower + 1, texel) - color) * fraction
    } else {
        color
    }
}

#[inline(always)]
fn bilinear<P, T, const CHANNELS: usize>(
    levels: &[ImageBuffer<P, Vec<u8>>],
    u: f32,
    v: f32,
    level: usize,
    texel: impl Fn([u8; CHANNELS]) -> T,
) -> T
where
    P: Pixel<Subpixel = u8>,
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f32, Output = T>,
{
    let image = &levels[level];
    let (texels, _) = image.as_raw().as_chunks::<CHANNELS>();
    let (last_x, last_y) = (image.width() as i32 - 1, image.height() as i32 - 1);
    let scale = 1.0 / (1_u32 << level) as f32;
    // The pixel lies inside the photo, so a shift by one keeps truncation a floor.
    let (x, y) = (u * scale + 0.5, v * scale + 0.5);
    let (right, bottom) = (x as i32, y as i32);
    let (fx, fy) = (x - right as f32, y - bottom as f32);
    let x0 = (right - 1).clamp(0, last_x) as usize;
    let x1 = right.clamp(0, last_x) as usize;
    let pitch = image.width() as usize;
    let row0 = (bottom - 1).clamp(0, last_y) as usize * pitch;
    let row1 = bottom.clamp(0, last_y) as usize * pitch;
    let at = |i: usize| texel(texels[i]);
    let top = at(row0 + x0) + (at(row0 + x1) - at(row0 + x0)) * fx;
    let low = at(row1 + x0) + (at(row1 + x1) - at(row1 + x0)) * fx;
    top + (low - top) * fy
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
    let (mut at, mut shares) = ([[0; LANES]; 4], [[0.0; LANES]; 2]);
    // What is not in the photo may be anywhere, and no number.
    let within = |at: f32, side: i32| at.max(-1.0).min(side as f32);
    for k in 0..LANES {
        let x = within(sight.u[k] * TEXEL_PER_PIXEL - 0.5, width);
        let y = within(sight.v[k] * TEXEL_PER_PIXEL - 0.5, height);
        let (left, top) = (floor(x), floor(y));
        (shares[0][k], shares[1][k]) = (x - left as f32, y - top as f32);
        let column = |i: i32| i.clamp(0, width - 1);
        let row = |i: i32| i.clamp(0, height - 1) * width;
        let (x0, x1, y0, y1) = (column(left), column(left + 1), row(top), row(top + 1));
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

/// Without a call.
#[inline(always)]
fn floor(x: f32) -> i32 {
    let whole = x as i32;
    whole - i32::from(x < whole as f32)
}
