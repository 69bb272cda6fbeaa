//! Photos made small and straight for comparing.

use super::windows::WINDOW;
use calibrate::{Pixel, View};
use glam::{DMat3, DVec3};
use image::RgbaImage;
use image::imageops::{FilterType, resize};
use std::ops::Range;

/// The widest angle from the axis that a straight photo shows, radians: beyond it a pinhole
/// spends its pixels on little.
const WIDEST: f64 = 0.95;
/// Alpha from which on a pixel is used.
const OPAQUE: u8 = 128;

/// A reduced photo through a pinhole: what is around all that is used of it.
#[derive(Clone, Debug)]
pub(super) struct SmallPhoto {
    pub(super) width: usize,
    pub(super) height: usize,
    /// In pixels.
    pub(super) focal: f64,
    /// Where the axis meets it, in pixels: the middle of the whole photo.
    pub(super) principal: [f64; 2],
    /// Turns world directions into the camera's.
    pub(super) rotation: DMat3,
    /// In the world.
    pub(super) center: DVec3,
    /// −128…127, row by row: sums of squares stay small.
    pub(super) grays: Vec<f32>,
    /// Whether a pixel shows anything.
    pub(super) used: Vec<bool>,
    /// The grays of a pixel (in the lowest byte), the next one, and those below them, 1…255: what
    /// lies between them takes one look. A neighbour that shows nothing, or that there is none of,
    /// counts as the pixel itself; 0 where the pixel shows nothing.
    pub(super) quads: Vec<u32>,
}

impl SmallPhoto {
    /// `None` for a view without any ray to look along, or a photo of which nothing is used.
    pub(super) fn new(view: &View, photo: &RgbaImage, long_side: u32) -> Option<Self> {
        // 1. The pinhole: as wide as the photo, within reason.
        let long = f64::from(view.width.max(view.height));
        let scale = (f64::from(long_side) / long).min(1.0);
        let tangent = |x: f64, y: f64| {
            let ray = view.lens.unproject(Pixel::new(x, y))?;
            let limit = WIDEST.tan();
            let part = |v: f64| {
                if ray.z > 0.0 {
                    (v / ray.z).abs().min(limit)
                } else {
                    limit
                }
            };
            Some((part(ray.x), part(ray.y)))
        };
        let (w, h) = (f64::from(view.width), f64::from(view.height));
        let across = [tangent(0.0, h / 2.0), tangent(w, h / 2.0)];
        let down = [tangent(w / 2.0, 0.0), tangent(w / 2.0, h)];
        let tan_x = across.iter().flatten().map(|t| t.0).fold(0.0, f64::max);
        let tan_y = down.iter().flatten().map(|t| t.1).fold(0.0, f64::max);
        let focal = view.lens.mean_focal() * scale;
        if !(tan_x > 0.0 && tan_y > 0.0 && focal > 0.0) {
            return None;
        }
        let side = |tangent: f64| {
            (2.0 * focal * tangent)
                .round()
                .clamp(8.0, 2.0 * f64::from(long_side))
        };
        let (width, height) = (side(tan_x) as usize, side(tan_y) as usize);

        // 2. The photo reduced by area, then looked up through its lens.
        let reduced = |side: u32| ((f64::from(side) * scale).round() as u32).max(1);
        let small = resize(
            photo,
            reduced(view.width),
            reduced(view.height),
            FilterType::Triangle,
        );
        let to_small = [f64::from(small.width()) / w, f64::from(small.height()) / h];
        let mut grays = vec![0.0; width * height];
        let mut used = vec![false; width * height];
        let principal = [width, height].map(|side| side as f64 / 2.0);
        for y in 0..height {
            for x in 0..width {
                let ray = ray([x, y], principal, focal);
                let Some(pixel) = view.lens.project(ray).filter(|p| view.contains(*p)) else {
                    continue;
                };
                let (gray, alpha) = sample(&small, pixel.x * to_small[0], pixel.y * to_small[1]);
                grays[y * width + x] = gray - 128.0;
                used[y * width + x] = alpha >= f32::from(OPAQUE);
            }
        }
        // 3. What is used, and what windows on it reach.
        let [columns, rows] = around_used(&used, width)?;
        let grays = cut(&grays, width, &columns, &rows);
        let used = cut(&used, width, &columns, &rows);
        Some(Self {
            width: columns.len(),
            height: rows.len(),
            focal,
            principal: [
                principal[0] - columns.start as f64,
                principal[1] - rows.start as f64,
            ],
            rotation: view.camera_from_world.matrix(),
            center: view.center(),
            quads: quads(&grays, &used, columns.len()),
            grays,
            used,
        })
    }

    /// A point's position in pixels (the first pixel's centre is (0.5, 0.5)) and its depth
    /// along z; `None` behind the camera.
    pub(super) fn project(&self, point_in_world: DVec3) -> Option<([f64; 2], f64)> {
        let p = self.rotation * (point_in_world - self.center);
        let [x, y] = self.principal;
        let at = |v: f64, principal: f64| self.focal * v / p.z + principal;
        (p.z > 0.0).then(|| ([at(p.x, x), at(p.y, y)], p.z))
    }

    /// The index of the pixel that a position falls on, if it lies in the photo.
    pub(super) fn index(&self, [x, y]: [f64; 2]) -> Option<usize> {
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64;
        inside.then(|| y as usize * self.width + x as usize)
    }

    /// The ray of a pixel's centre in the camera's frame, at z = 1.
    pub(super) fn ray(&self, x: usize, y: usize) -> DVec3 {
        ray([x, y], self.principal, self.focal)
    }

    /// The point at an inverse depth behind a pixel's centre.
    pub(super) fn point(&self, x: usize, y: usize, inverse_depth: f64) -> DVec3 {
        self.center + self.rotation.transpose() * (self.ray(x, y) / inverse_depth)
    }
}

/// See [`SmallPhoto::ray`].
fn ray([x, y]: [usize; 2], principal: [f64; 2], focal: f64) -> DVec3 {
    let at = |i: usize, principal: f64| (i as f64 + 0.5 - principal) / focal;
    DVec3::new(at(x, principal[0]), at(y, principal[1]), 1.0)
}

/// The columns and rows that are used of an image so wide, with a border that windows on them reach, and one
/// pixel more that is not used, so that nothing is repeated beyond it. `None` if nothing is used.
fn around_used(used: &[bool], width: usize) -> Option<[Range<usize>; 2]> {
    let height = used.len() / width;
    let is_used = |row: &&[bool]| row.contains(&true);
    let rows = used.chunks_exact(width).enumerate();
    let rows: Vec<(usize, &[bool])> = rows.filter(|(_, row)| is_used(row)).collect();
    let (top, bottom) = (rows.first()?.0, rows.last()?.0);
    let left = rows
        .iter()
        .filter_map(|(_, row)| row.iter().position(|u| *u));
    let right = rows
        .iter()
        .filter_map(|(_, row)| row.iter().rposition(|u| *u));
    let border = WINDOW / 2 + 1;
    let around = |first: usize, last: usize, side: usize| {
        first.saturating_sub(border)..(last + 1 + border).min(side)
    };
    Some([
        around(left.min()?, right.max()?, width),
        around(top, bottom, height),
    ])
}

/// Some columns and rows of an image so wide.
fn cut<T: Copy>(image: &[T], width: usize, columns: &Range<usize>, rows: &Range<usize>) -> Vec<T> {
    let of_row = |y: usize| &image[y * width..][columns.clone()];
    rows.clone().flat_map(of_row).copied().collect()
}

/// See [`SmallPhoto::quads`].
fn quads(grays: &[f32], used: &[bool], width: usize) -> Vec<u32> {
    let byte = |i: usize| (grays[i] + 128.0).round().clamp(1.0, 255.0) as u32;
    let of = |i: usize| {
        if !used[i] {
            return 0;
        }
        let right = usize::from(!(i + 1).is_multiple_of(width));
        let below = if i + width < grays.len() { width } else { 0 };
        let or_own = |j: usize| byte(if used[j] { j } else { i });
        let around = [i, i + right, i + below, i + below + right];
        around
            .into_iter()
            .enumerate()
            .fold(0, |quad, (k, j)| quad | or_own(j) << (8 * k))
    };
    (0..grays.len()).map(of).collect()
}

/// Bilinear gray and alpha.
fn sample(image: &RgbaImage, x: f64, y: f64) -> (f32, f32) {
    let (x, y) = (x - 0.5, y - 0.5);
    let (fx, fy) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
    let texel = |dx: f64, dy: f64| {
        let column = (x.floor() + dx).clamp(0.0, f64::from(image.width() - 1)) as u32;
        let row = (y.floor() + dy).clamp(0.0, f64::from(image.height() - 1)) as u32;
        let [r, g, b, a] = image.get_pixel(column, row).0.map(f32::from);
        (0.299 * r + 0.587 * g + 0.114 * b, a)
    };
    let mix = |a: (f32, f32), b: (f32, f32), f: f32| (a.0 + f * (b.0 - a.0), a.1 + f * (b.1 - a.1));
    let upper = mix(texel(0.0, 0.0), texel(1.0, 0.0), fx);
    let lower = mix(texel(0.0, 1.0), texel(1.0, 1.0), fx);
    mix(upper, lower, fy)
}
