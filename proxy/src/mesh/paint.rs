//! A mesh's corners coloured from photos.

use super::Mesh;
use calibrate::{Pixel, View};
use capture::DepthMap;
use glam::DVec3;
use image::RgbaImage;
use rayon::prelude::*;

/// Photos that a corner's colour is the mean of.
const BEST: usize = 4;
/// A corner is what a depth map shows if its depth differs by no more than this share of it, or
/// than the tolerance that was given.
const SAME_DEPTH: f64 = 0.02;
/// Photos that see a surface at more than 80° are not asked.
const LEAST_COS: f64 = 0.17;
/// Rounds in which corners that no photo sees take their neighbours' colours.
const ROUNDS: usize = 64;
const UNSEEN: [u8; 4] = [128, 128, 128, 255];

/// Colours gathered photo by photo, so that one is held at a time.
pub struct Painting<'a> {
    mesh: &'a Mesh,
    normals: Vec<DVec3>,
    /// For each corner, the best views so far: how good, and the colour.
    best: Vec<[(f64, [f64; 3]); BEST]>,
    tolerance: f64,
}

impl<'a> Painting<'a> {
    /// Nothing yet. `tolerance` is how far the mesh may be from what depth maps say, in world
    /// units.
    pub fn new(mesh: &'a Mesh, tolerance: f64) -> Self {
        let mut normals = vec![DVec3::ZERO; mesh.positions.len()];
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
            let across = (b - a).cross(c - a);
            triangle.iter().for_each(|i| normals[*i as usize] += across);
        }
        Self {
            mesh,
            normals,
            best: vec![[(0.0, [0.0; 3]); BEST]; mesh.positions.len()],
            tolerance,
        }
    }

    /// Takes in a photo where its depth map shows the mesh: frontal and near is better. The
    /// photo and the map are as large as the view.
    pub fn add(&mut self, view: &View, photo: &RgbaImage, depth: &DepthMap) {
        let size = (view.width, view.height);
        if photo.dimensions() != size || (depth.width, depth.height) != size {
            return;
        }
        let center = view.center();
        let tolerance = self.tolerance;
        let corners = self.mesh.positions.par_iter().zip(&self.normals);
        let corners = self.best.par_iter_mut().zip(corners);
        corners.for_each(|(best, (position, normal))| {
            let z = (view.camera_from_world * *position).z;
            let Some(pixel) = view.project(*position).filter(|p| view.contains(*p)) else {
                return;
            };
            let (x, y) = (pixel.x as u32, pixel.y as u32);
            let (x, y) = (x.min(size.0 - 1), y.min(size.1 - 1));
            let shown = depth.at(x, y).map(f64::from);
            let is_shown = |d: f64| (d - z).abs() <= tolerance.max(SAME_DEPTH * z);
            if !shown.is_some_and(is_shown) {
                return;
            }
            let toward = center - *position;
            let distance = toward.length();
            let cos = normal.normalize_or_zero().dot(toward) / distance;
            let goodness = cos / distance;
            if !(cos > LEAST_COS && goodness.is_finite()) {
                return;
            }
            let worst = (0..BEST).fold(0, |w, k| if best[k].0 < best[w].0 { k } else { w });
            if goodness > best[worst].0
                && let Some(color) = sample(photo, pixel)
            {
                best[worst] = (goodness, color);
            }
        });
    }

    /// The corners' colours: means of the best photos; where none saw a corner, those of its
    /// neighbours, or grey.
    pub fn colors(&self) -> Vec<[u8; 4]> {
        let mean = |best: &[(f64, [f64; 3]); BEST]| {
            let seen = best.iter().filter(|b| b.0 > 0.0);
            let (sum, weight) = seen.fold((DVec3::ZERO, 0.0), |(s, w), (goodness, color)| {
                (s + *goodness * DVec3::from_array(*color), w + goodness)
            });
            (weight > 0.0).then(|| sum / weight)
        };
        let mut colors: Vec<Option<DVec3>> = self.best.iter().map(mean).collect();
        for _ in 0..ROUNDS {
            let mut sums = vec![(DVec3::ZERO, 0.0); colors.len()];
            let mut is_more = false;
            for triangle in &self.mesh.triangles {
                let of = triangle.map(|i| colors[i as usize]);
                for (k, i) in triangle
                    .iter()
                    .enumerate()
                    .filter(|(k, _)| of[*k].is_none())
                {
                    for color in [of[(k + 1) % 3], of[(k + 2) % 3]].into_iter().flatten() {
                        sums[*i as usize].0 += color;
                        sums[*i as usize].1 += 1.0;
                        is_more = true;
                    }
                }
            }
            if !is_more {
                break;
            }
            for (color, (sum, count)) in colors.iter_mut().zip(sums) {
                if color.is_none() && count > 0.0 {
                    *color = Some(sum / count);
                }
            }
        }
        let code = |color: Option<DVec3>| match color {
            Some(c) => {
                let [r, g, b] = c.to_array().map(|x| x.round().clamp(0.0, 255.0) as u8);
                [r, g, b, 255]
            }
            None => UNSEEN,
        };
        colors.into_iter().map(code).collect()
    }
}

/// Bilinear; nothing where a mask makes it transparent.
fn sample(photo: &RgbaImage, pixel: Pixel) -> Option<[f64; 3]> {
    let (x, y) = (pixel.x - 0.5, pixel.y - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let (s, t) = (x - left, y - top);
    let at = |column: f64, row: f64| {
        let column = column.clamp(0.0, f64::from(photo.width() - 1)) as u32;
        let row = row.clamp(0.0, f64::from(photo.height() - 1)) as u32;
        photo.get_pixel(column, row).0
    };
    let corners = [
        (at(left, top), (1.0 - s) * (1.0 - t)),
        (at(left + 1.0, top), s * (1.0 - t)),
        (at(left, top + 1.0), (1.0 - s) * t),
        (at(left + 1.0, top + 1.0), s * t),
    ];
    let is_opaque = corners.iter().all(|(color, _)| color[3] == 255);
    let channel = |c: usize| {
        corners
            .iter()
            .map(|(color, w)| w * f64::from(color[c]))
            .sum()
    };
    is_opaque.then(|| [channel(0), channel(1), channel(2)])
}
