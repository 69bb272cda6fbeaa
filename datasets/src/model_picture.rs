//! What a camera sees of a model: the truth that renderers of it are held to.

use crate::picture::srgb_from_linear;
use calibrate::{Pixel, View};
use glam::DVec3;
use image::{Rgba, RgbaImage};
use proxy::Solid;
use proxy::mesh::{Model, footprint, linear_from_srgb};
use rayon::prelude::*;

/// The picture and the depth along z of each pixel's centre, row by row, in world units; alpha
/// is 0 and the depth NaN where the ray through the centre meets nothing.
///
/// The model's own colours ([`Model::color`], of textures' levels that suit the rays), no light added; a
/// pixel is the mean, in linear light, of `samples_per_side` squared rays, spread evenly over it.
pub(crate) fn render_model(
    model: &Model,
    solid: &Solid,
    view: &View,
    samples_per_side: u32,
) -> (RgbaImage, Vec<f64>) {
    let world_from_camera = view.camera_from_world.rotation.conjugate();
    let center = view.center();
    // In rays, not pixels.
    let focal = view.lens.focal * f64::from(samples_per_side.max(1));
    let rotation = view.camera_from_world.matrix();
    let look = |at: Pixel| {
        let ray = view.lens.unproject(at)?;
        let direction = world_from_camera * ray;
        let hit = solid.first_hit(center, direction)?;
        let corners = model.mesh.corners(hit.triangle_idx as usize);
        let point = center + hit.along * direction;
        let in_camera = corners.map(|corner| rotation * (corner - center));
        let footprint = footprint(in_camera, ray / ray.z, focal);
        let color = model.color(hit.triangle_idx, shares(corners, point), footprint);
        Some((color, hit.along * ray.z))
    };
    let pixel = |i: u32| {
        let (x, y) = (i % view.width, i / view.width);
        let (color, depth) = look(Pixel::center_of(x, y))?;
        if samples_per_side <= 1 {
            return Some((color.map(|c| c.round() as u8), depth));
        }
        let step = 1.0 / f64::from(samples_per_side);
        let at = |k: u32| (f64::from(k) + 0.5) * step;
        let samples = (0..samples_per_side.pow(2)).filter_map(|k| {
            let (dx, dy) = (at(k % samples_per_side), at(k / samples_per_side));
            look(Pixel::new(f64::from(x) + dx, f64::from(y) + dy))
        });
        let (sum, count) = samples.fold((DVec3::ZERO, 0.0), |(sum, count), (color, _)| {
            (
                sum + DVec3::from(color.map(|c| linear_from_srgb(c / 255.0))),
                count + 1.0,
            )
        });
        let mean = if count > 0.0 {
            srgb_from_linear((sum / count).to_array())
        } else {
            color.map(|c| c.round() as u8)
        };
        Some((mean, depth))
    };
    let count = view.width * view.height;
    let pixels: Vec<_> = (0..count).into_par_iter().map(pixel).collect();
    let picture = RgbaImage::from_fn(view.width, view.height, |x, y| {
        match pixels[(y * view.width + x) as usize] {
            Some(([r, g, b], _)) => Rgba([r, g, b, 255]),
            None => Rgba([0; 4]),
        }
    });
    let depths = pixels.iter().map(|p| p.map_or(f64::NAN, |(_, z)| z));
    (picture, depths.collect())
}

/// The place that a ray meets first, how far along in lengths of `direction`, and its colour
/// in steps of 255, textures at their finest.
pub(crate) fn look(
    model: &Model,
    solid: &Solid,
    from: DVec3,
    direction: DVec3,
) -> Option<(DVec3, f64, [f64; 3])> {
    let hit = solid.first_hit(from, direction)?;
    let corners = model.mesh.corners(hit.triangle_idx as usize);
    let point = from + hit.along * direction;
    let color = model.color(hit.triangle_idx, shares(corners, point), 0.0);
    Some((point, hit.along, color))
}

/// Barycentric weights of a point of a triangle, none negative.
fn shares([a, b, c]: [DVec3; 3], point: DVec3) -> [f64; 3] {
    let normal = (b - a).cross(c - a);
    let area = |p: DVec3, q: DVec3| (p - point).cross(q - point).dot(normal).max(0.0);
    let areas = [area(b, c), area(c, a), area(a, b)];
    let sum: f64 = areas.iter().sum();
    match sum > 0.0 {
        true => areas.map(|x| x / sum),
        false => [1.0, 0.0, 0.0],
    }
}
