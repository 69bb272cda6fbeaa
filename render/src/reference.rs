//! The specification: the blending field and the picture, in plain f64, one ray at a time.
//!
//! Nothing here is fast. The `cpu` and `gpu` paths are compared with it.

use crate::blend::{Candidate, Contributor, blend};
use crate::contradictions::{Contradictions, Shown, frame_of_cells};
use crate::edges::Edges;
use crate::field::TriangulatedField;
use crate::frame::{Frame, ProxyPoint, exposed, trust};
use crate::held::Held;
use crate::image_out::straight_rgba8;
use crate::mask::IGNORED;
use crate::photos::PhotoError;
use crate::pyramid::Pyramid;
use calibrate::Pixel;
use glam::Vec3;
use image::{ImageBuffer, RgbaImage};
use rayon::prelude::*;

/// The exact blending field at a proxy point: who paints it, and how much.
pub fn blend_at(frame: &Frame<'_>, point: &ProxyPoint) -> Vec<Contributor> {
    blend_among(frame, point, 0..frame.sources.len())
}

/// The same of some source views, in order.
fn blend_among(
    frame: &Frame<'_>,
    point: &ProxyPoint,
    among: impl Iterator<Item = usize>,
) -> Vec<Contributor> {
    let seen = |source_idx: usize| {
        let pixel = frame.project(source_idx, point)?;
        candidate(frame, source_idx, point, pixel, || {
            frame.difference(source_idx, point)
        })
    };
    let candidates: Vec<Candidate> = among.filter_map(seen).collect();
    blend(&candidates, &frame.options)
}

/// Draws edges into their frame's picture, of the photos that its field lists, if it has one.
///
/// # Errors
/// A photo or mask that is needed cannot be decoded.
pub(crate) fn smooth(
    frame: &Frame<'_>,
    field: Option<&TriangulatedField>,
    edges: &Edges<'_>,
    picture: &mut RgbaImage,
) -> Result<(), PhotoError> {
    let among = field.map_or_else(|| frame.taking_part().collect(), TriangulatedField::listed);
    let photos = Held::again(frame, &among);
    let frame_of_samples = edges.frame_of_samples();
    let frame = &frame_of_samples;
    let color = |point: &ProxyPoint| {
        if point.inverse_distance < 0.0 {
            return Ok(None);
        }
        let contributors = blend_among(frame, point, among.iter().copied());
        let color = color_at(frame, &photos, point, &contributors)?;
        Ok((!contributors.is_empty()).then(|| straight_rgba8(color)))
    };
    let draw = |(): &mut (), points: &[ProxyPoint]| points.iter().map(color).collect();
    edges.put(|| (), draw, picture)?;
    frame.check_masks()
}

/// Where the photos of a frame contradict each other, of those that its field lists, if it has one.
///
/// # Errors
/// A photo or mask that is needed cannot be decoded.
pub(crate) fn contradictions(
    frame: &Frame<'_>,
    field: Option<&TriangulatedField>,
) -> Result<Option<Contradictions>, PhotoError> {
    if !Contradictions::may_be(frame) {
        return Ok(None);
    }
    let among = field.map_or_else(|| frame.taking_part().collect(), TriangulatedField::listed);
    let photos = Held::again(frame, &among);
    let frame_of_cells = frame_of_cells(frame);
    let shown_at = |point: &ProxyPoint| {
        let contributors = blend_among(&frame_of_cells, point, among.iter().copied());
        shown_by(&frame_of_cells, &photos, point, &contributors)
    };
    let shown = |(): &mut (), points: &[ProxyPoint]| points.iter().map(shown_at).collect();
    let found = Contradictions::of(frame, || (), shown)?;
    frame.check_masks()?;
    Ok(Some(found))
}

/// What the contributors' photos show of a proxy point.
fn shown_by(
    frame: &Frame<'_>,
    photos: &Held<'_>,
    point: &ProxyPoint,
    contributors: &[Contributor],
) -> Result<Vec<Shown>, PhotoError> {
    let mut shown = Vec::new();
    for &contributor in contributors {
        if let Some((weight, [r, g, b, _])) = painted(frame, photos, point, contributor)? {
            shown.push(Shown {
                source_idx: contributor.source_idx,
                weight: weight as f32,
                color: Vec3::from_array([r, g, b].map(|c| c as f32)),
            });
        }
    }
    Ok(shown)
}

/// A source view as a candidate for a proxy point that falls on a pixel of its image; `None`
/// outside the image and where its mask ignores it.
pub(crate) fn candidate(
    frame: &Frame<'_>,
    source_idx: usize,
    point: &ProxyPoint,
    pixel: Pixel,
    diff: impl FnOnce() -> f64,
) -> Option<Candidate> {
    let (fov, mask) = shown(frame, source_idx, point, pixel)?;
    Some(Candidate {
        source_idx,
        diff: diff(),
        fov,
        mask: mask * frame.visible(source_idx, point, pixel),
    })
}

/// fovBlend and mask where a proxy point falls on a pixel of a source view's image; `None` outside the image
/// and where the mask ignores it.
pub(crate) fn shown(
    frame: &Frame<'_>,
    source_idx: usize,
    point: &ProxyPoint,
    pixel: Pixel,
) -> Option<(f64, f64)> {
    let fov = frame.fov_blend(source_idx, pixel);
    if fov < 0.0 {
        return None;
    }
    // The mask is sampled as its photo is, so that neither flickers more than the other.
    let mask = frame.lumigraph.photos.mask(source_idx).map_or(1.0, |mask| {
        let level = frame.level_of_detail(source_idx, point);
        let [value] = trilinear(&mask.levels, pixel, level);
        let ignored = f64::from(IGNORED);
        ((value * 255.0 - ignored) / (255.0 - ignored)).max(0.0)
    });
    (mask > 0.0).then_some((fov, mask))
}

/// The colour of a proxy point: premultiplied sRGB and coverage, 0…1.
///
/// Each contributor is brought to the frame's exposure first, and counts less where its matte shows
/// nothing.
///
/// # Errors
/// A contributor's photo cannot be decoded.
pub fn color_at(
    frame: &Frame<'_>,
    photos: &Held<'_>,
    point: &ProxyPoint,
    contributors: &[Contributor],
) -> Result<[f64; 4], PhotoError> {
    let (mut color, mut sum) = ([0.0; 4], 0.0);
    for &contributor in contributors {
        let Some((weight, sample)) = painted(frame, photos, point, contributor)? else {
            continue;
        };
        for c in 0..4 {
            color[c] += weight * sample[c];
        }
        sum += weight;
    }
    Ok(if sum > 0.0 {
        color.map(|v| v / sum)
    } else {
        color
    })
}

/// What a contributor paints a proxy point with, and what that counts.
fn painted(
    frame: &Frame<'_>,
    photos: &Held<'_>,
    point: &ProxyPoint,
    Contributor { source_idx, weight }: Contributor,
) -> Result<Option<(f64, [f64; 4])>, PhotoError> {
    let Some(pixel) = frame.project(source_idx, point) else {
        return Ok(None);
    };
    let photo = photos.get(source_idx)?;
    let sample = sample(photo, pixel, frame.level_of_detail(source_idx, point));
    let sample = exposed(sample, frame.sources[source_idx].exposure);
    Ok(Some((weight * trust(sample[3]), sample)))
}

/// The exact picture: straight alpha, alpha = coverage.
///
/// # Errors
/// A photo or mask that is needed cannot be decoded.
pub fn render_exact(frame: &Frame<'_>) -> Result<RgbaImage, PhotoError> {
    let taking_part: Vec<usize> = frame.taking_part().collect();
    if Held::fit(frame, &taking_part) {
        let photos = Held::new(frame, &taking_part);
        return render(frame, &photos, |_, point| blend_at(frame, point));
    }
    // With little memory, who paints is found out before any photo is decoded.
    let width = frame.desired.width;
    let at_pixel = |i: u32| {
        let point = frame.proxy_point(Pixel::center_of(i % width, i / width));
        point.map_or_else(Vec::new, |point| blend_at(frame, &point))
    };
    let field: Vec<Vec<Contributor>> = (0..width * frame.desired.height)
        .into_par_iter()
        .map(at_pixel)
        .collect();
    let mut used: Vec<usize> = field.iter().flatten().map(|c| c.source_idx).collect();
    used.sort_unstable();
    used.dedup();
    let photos = Held::new(frame, &used);
    render(frame, &photos, |(x, y), _| {
        field[(y * width + x) as usize].clone()
    })
}

/// A picture from any field over pixels.
pub(crate) fn render(
    frame: &Frame<'_>,
    photos: &Held<'_>,
    field: impl Fn((u32, u32), &ProxyPoint) -> Vec<Contributor> + Sync,
) -> Result<RgbaImage, PhotoError> {
    let (width, height) = (frame.desired.width, frame.desired.height);
    let row = |y: u32| {
        let mut pixels = Vec::with_capacity(width as usize * 4);
        for x in 0..width {
            let color = match frame.proxy_point(Pixel::center_of(x, y)) {
                Some(point) => color_at(frame, photos, &point, &field((x, y), &point))?,
                None => [0.0; 4],
            };
            pixels.extend(straight_rgba8(color));
        }
        Ok(pixels)
    };
    let rows: Vec<Result<Vec<u8>, _>> = (0..height).into_par_iter().map(row).collect();
    // The first error from the top, whichever thread is the first to meet one.
    let rows: Vec<Vec<u8>> = rows.into_iter().collect::<Result<_, _>>()?;
    frame.check_masks()?;
    Ok(RgbaImage::from_raw(width, height, rows.concat()).expect("one row each"))
}

/// A photo's colour at a pixel: premultiplied, 0…1.
pub fn sample(photo: &Pyramid, pixel: Pixel, level_of_detail: f64) -> [f64; 4] {
    let level = level_of_detail.max(photo.finest as f64);
    trilinear(&photo.levels, pixel, level)
}

/// Bilinear in the two nearest mip levels, 0…1.
fn trilinear<P: image::Pixel<Subpixel = u8>, const CHANNELS: usize>(
    levels: &[ImageBuffer<P, Vec<u8>>],
    pixel: Pixel,
    level_of_detail: f64,
) -> [f64; CHANNELS] {
    let level = level_of_detail.min((levels.len() - 1) as f64);
    let lower = level.floor();
    let fraction = level - lower;
    let mut color = bilinear(levels, pixel, lower as usize);
    if fraction > 0.0 {
        let upper: [f64; CHANNELS] = bilinear(levels, pixel, lower as usize + 1);
        for c in 0..CHANNELS {
            color[c] += fraction * (upper[c] - color[c]);
        }
    }
    color.map(|v| v / 255.0)
}

fn bilinear<P: image::Pixel<Subpixel = u8>, const CHANNELS: usize>(
    levels: &[ImageBuffer<P, Vec<u8>>],
    pixel: Pixel,
    level: usize,
) -> [f64; CHANNELS] {
    let image = &levels[level];
    let scale = 1.0 / f64::from(1_u32 << level);
    let (x, y) = (pixel.x * scale - 0.5, pixel.y * scale - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let (fx, fy) = (x - left, y - top);
    let mut color = [0.0; CHANNELS];
    for (column, row, share) in [
        (left, top, (1.0 - fx) * (1.0 - fy)),
        (left + 1.0, top, fx * (1.0 - fy)),
        (left, top + 1.0, (1.0 - fx) * fy),
        (left + 1.0, top + 1.0, fx * fy),
    ] {
        let column = column.clamp(0.0, f64::from(image.width() - 1)) as u32;
        let row = row.clamp(0.0, f64::from(image.height() - 1)) as u32;
        let texel = image.get_pixel(column, row).channels();
        for c in 0..CHANNELS {
            color[c] += share * f64::from(texel[c]);
        }
    }
    color
}
