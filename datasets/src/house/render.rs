//! What a camera sees of a house: the truth that other renderers of its model are held to.

use super::House;
use calibrate::{Pixel, View};
use glam::DVec3;
use image::{Rgba, RgbaImage};
use rayon::prelude::*;

/// The picture and the depth along z of each pixel's centre, row by row, in metres; alpha is 0
/// and the depth NaN where a ray meets nothing.
///
/// One ray a pixel; the model's own colours ([`proxy::mesh::Model::color`]), no light added.
pub fn render(house: &House, view: &View) -> (RgbaImage, Vec<f64>) {
    let world_from_camera = view.camera_from_world.rotation.conjugate();
    let center = view.center();
    let pixel = |i: u32| {
        let at = Pixel::center_of(i % view.width, i / view.width);
        let ray = view.lens.unproject(at)?;
        let direction = world_from_camera * ray;
        let hit = house.solid.first_hit(center, direction)?;
        let corners = house.model.mesh.corners(hit.triangle_idx as usize);
        let shares = shares(corners, center + hit.along * direction);
        let color = house.model.color(hit.triangle_idx, shares);
        Some((color.map(|c| c.round() as u8), hit.along * ray.z))
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

impl House {
    /// The first triangle that a ray meets, and how far along, in lengths of `direction`.
    pub fn first_hit(&self, from: DVec3, direction: DVec3) -> Option<proxy::Hit> {
        self.solid.first_hit(from, direction)
    }
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
