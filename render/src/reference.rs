//! The specification: the blending field and the picture, in plain f64, one ray at a time.
//!
//! Nothing here is fast. The `cpu` and `gpu` paths are compared with it.

use crate::blend::{Candidate, Contributor, blend};
use crate::frame::{Frame, ProxyPoint};
use crate::image_out::straight_rgba8;
use crate::photos::{PhotoError, Pyramid};
use calibrate::Pixel;
use image::RgbaImage;
use rayon::prelude::*;

/// The exact blending field at a proxy point: who paints it, and how much.
pub fn blend_at(frame: &Frame<'_>, point: &ProxyPoint) -> Vec<Contributor> {
    let sees = |source_idx: usize| {
        let fov = frame.fov_blend(source_idx, frame.project(source_idx, point)?);
        let diff = frame.difference(source_idx, point);
        (fov >= 0.0).then_some(Candidate {
            source_idx,
            diff,
            fov,
        })
    };
    let candidates: Vec<Candidate> = (0..frame.sources.len()).filter_map(sees).collect();
    blend(&candidates, &frame.options)
}

/// The colour of a proxy point: premultiplied sRGB and coverage, 0…1.
///
/// Each contributor is brought to the frame's exposure first.
///
/// # Errors
/// A contributor's photo cannot be decoded.
pub fn color_at(
    frame: &Frame<'_>,
    point: &ProxyPoint,
    contributors: &[Contributor],
) -> Result<[f64; 4], PhotoError> {
    let mut color = [0.0; 4];
    for &Contributor { source_idx, weight } in contributors {
        let Some(pixel) = frame.project(source_idx, point) else {
            continue;
        };
        let photo = frame.lumigraph.photos.get(source_idx)?;
        let sample = sample(photo, pixel, frame.level_of_detail(source_idx, point));
        let exposure = frame.sources[source_idx].exposure;
        for c in 0..3 {
            color[c] += weight * exposure[c] * sample[c];
        }
        color[3] += weight * sample[3];
    }
    Ok(color)
}

/// The exact picture: straight alpha, alpha = coverage.
///
/// # Errors
/// A photo that is needed cannot be decoded.
pub fn render_exact(frame: &Frame<'_>) -> Result<RgbaImage, PhotoError> {
    render(frame, |_, point| blend_at(frame, point))
}

/// A picture from any field over pixels.
pub(crate) fn render(
    frame: &Frame<'_>,
    field: impl Fn((u32, u32), &ProxyPoint) -> Vec<Contributor> + Sync,
) -> Result<RgbaImage, PhotoError> {
    let (width, height) = (frame.desired.width, frame.desired.height);
    let row = |y: u32| {
        let mut pixels = Vec::with_capacity(width as usize * 4);
        for x in 0..width {
            let color = match frame.proxy_point(Pixel::center_of(x, y)) {
                Some(point) => color_at(frame, &point, &field((x, y), &point))?,
                None => [0.0; 4],
            };
            pixels.extend(straight_rgba8(color));
        }
        Ok(pixels)
    };
    let rows: Vec<Vec<u8>> = (0..height)
        .into_par_iter()
        .map(row)
        .collect::<Result<_, _>>()?;
    Ok(RgbaImage::from_raw(width, height, rows.concat()).expect("one row each"))
}

/// Trilinear: bilinear in the two nearest mip levels. Premultiplied, 0…1.
pub fn sample(photo: &Pyramid, pixel: Pixel, level_of_detail: f64) -> [f64; 4] {
    let level = level_of_detail.min((photo.levels.len() - 1) as f64);
    let lower = level.floor();
    let fraction = level - lower;
    let mut color = bilinear(photo, pixel, lower as usize);
    if fraction > 0.0 {
        let upper = bilinear(photo, pixel, lower as usize + 1);
        for c in 0..4 {
            color[c] += fraction * (upper[c] - color[c]);
        }
    }
    color.map(|v| v / 255.0)
}

fn bilinear(photo: &Pyramid, pixel: Pixel, level: usize) -> [f64; 4] {
    let image = &photo.levels[level];
    let scale = 1.0 / f64::from(1_u32 << level);
    let (x, y) = (pixel.x * scale - 0.5, pixel.y * scale - 0.5);
    let texel = |column: f64, row: f64| {
        let column = column.clamp(0.0, f64::from(image.width() - 1)) as u32;
        let row = row.clamp(0.0, f64::from(image.height() - 1)) as u32;
        image.get_pixel(column, row).0.map(f64::from)
    };
    let (left, top) = (x.floor(), y.floor());
    let (fx, fy) = (x - left, y - top);
    let mut color = [0.0; 4];
    for (column, row, share) in [
        (left, top, (1.0 - fx) * (1.0 - fy)),
        (left + 1.0, top, fx * (1.0 - fy)),
        (left, top + 1.0, (1.0 - fx) * fy),
        (left + 1.0, top + 1.0, fx * fy),
    ] {
        let values = texel(column, row);
        for c in 0..4 {
            color[c] += share * values[c];
        }
    }
    color
}
