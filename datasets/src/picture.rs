//! Photos and depth maps of a scene.

use crate::Scene;
use calibrate::{Pixel, View};
use glam::DVec3;
use image::RgbaImage;
use rayon::prelude::*;

/// A photo: each pixel is the mean, in linear light, of `samples_per_side`² rays spread
/// evenly over it, stored as sRGB. Alpha is the part of them that met something. The
/// same bytes come out whatever the number of threads.
pub fn render_view(scene: &Scene, view: &View, samples_per_side: u32) -> RgbaImage {
    let (width, height) = (view.width, view.height);
    let world_from_camera = view.camera_from_world.matrix().transpose();
    let center = view.center();
    let side = samples_per_side.max(1);
    let mut bytes = vec![0_u8; 4 * width as usize * height as usize];
    bytes
        .par_chunks_mut(4 * width.max(1) as usize)
        .enumerate()
        .for_each(|(row, out)| {
            let mut rays = Vec::new();
            let mut candidates = Vec::new();
            for (column, rgba) in out.chunks_exact_mut(4).enumerate() {
                // 1. The pixel's rays, and the cone around them.
                rays.clear();
                for i in 0..side * side {
                    let within = |k: u32| (f64::from(k) + 0.5) / f64::from(side);
                    let pixel = Pixel::new(
                        column as f64 + within(i % side),
                        row as f64 + within(i / side),
                    );
                    rays.extend(view.lens.unproject(pixel).map(|r| world_from_camera * r));
                }
                let Some(axis) = rays.iter().sum::<DVec3>().try_normalize() else {
                    continue;
                };
                let sin_angle = rays
                    .iter()
                    .map(|ray| ray.cross(axis).length())
                    .fold(0.0, f64::max);
                // 2. What they can meet, and what they do.
                scene.within_cone(center, axis, sin_angle * 1.001, &mut candidates);
                let mut sum = DVec3::ZERO;
                let mut hits = 0_u32;
                for &ray in &rays {
                    if let Some(hit) = scene.trace_among(center, ray, &candidates) {
                        // A highlight is clipped before it is averaged: smoother edges.
                        sum += DVec3::from_array(hit.color).min(DVec3::ONE);
                        hits += 1;
                    }
                }
                if hits > 0 {
                    let mean = sum / f64::from(hits);
                    rgba[..3].copy_from_slice(&srgb_from_linear(mean.to_array()));
                    let coverage = f64::from(hits) / f64::from(side * side);
                    rgba[3] = (255.0 * coverage).round() as u8;
                }
            }
        });
    RgbaImage::from_raw(width, height, bytes).expect("four bytes a pixel")
}

/// The depth along the camera's z axis at every pixel's centre, row by row, in world
/// units; NaN where the pixel's ray meets nothing.
pub fn render_depth(scene: &Scene, view: &View) -> Vec<f64> {
    let world_from_camera = view.camera_from_world.matrix().transpose();
    let center = view.center();
    let mut depth = vec![f64::NAN; view.width as usize * view.height as usize];
    depth
        .par_chunks_mut(view.width.max(1) as usize)
        .enumerate()
        .for_each(|(row, out)| {
            for (column, depth) in out.iter_mut().enumerate() {
                let pixel = Pixel::center_of(column as u32, row as u32);
                if let Some(ray) = view.lens.unproject(pixel)
                    && let Some(distance) = scene.distance(center, world_from_camera * ray)
                {
                    *depth = distance * ray.z;
                }
            }
        });
    depth
}

/// The 8-bit sRGB code of linear light, clipped to what it can hold.
pub fn srgb_from_linear(linear: [f64; 3]) -> [u8; 3] {
    linear.map(|value| {
        let value = value.clamp(0.0, 1.0);
        let code = if value <= 0.003_130_8 {
            12.92 * value
        } else {
            1.055 * value.powf(1.0 / 2.4) - 0.055
        };
        (255.0 * code).round() as u8
    })
}
