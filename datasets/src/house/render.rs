//! What a camera sees of a house.

use super::House;
use crate::model_picture::render_model;
use calibrate::View;
use glam::DVec3;
use image::RgbaImage;

/// The picture and the depth along z of each pixel's centre, row by row, in metres; alpha is 0
/// and the depth NaN where a ray meets nothing.
///
/// One ray a pixel; the model's own colours ([`proxy::mesh::Model::color`]), no light added.
pub fn render(house: &House, view: &View) -> (RgbaImage, Vec<f64>) {
    render_model(&house.model, &house.solid, view, 1)
}

impl House {
    /// The first triangle that a ray meets, and how far along, in lengths of `direction`.
    pub fn first_hit(&self, from: DVec3, direction: DVec3) -> Option<proxy::Hit> {
        self.solid.first_hit(from, direction)
    }
}
