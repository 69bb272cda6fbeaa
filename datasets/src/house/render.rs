//! What a camera sees of a house.

use super::House;
use crate::model_picture::render_model;
use calibrate::View;
use glam::DVec3;
use image::RgbaImage;

/// The picture and the depth along z of each pixel's centre, row by row, in metres; alpha is 0
/// and the depth NaN where a ray meets nothing.
///
/// One ray a pixel; the model's own colours ([`proxy::mesh::Model::color`]), no light added, textures as
/// fine as a pixel shows them.
pub fn render(house: &House, view: &View) -> (RgbaImage, Vec<f64>) {
    render_model(&house.model, &house.solid, view, 1)
}

impl House {
    /// The first triangle that a ray meets, and how far along, in lengths of `direction`.
    pub fn first_hit(&self, from: DVec3, direction: DVec3) -> Option<proxy::Hit> {
        self.solid.first_hit(from, direction)
    }
}

#[cfg(test)]
mod tests {
    use crate::house::{HouseOptions, house};
    use crate::model_picture::render_model;
    use calibrate::{Lens, Rigid3, View};
    use glam::{DVec2, DVec3};

    #[test]
    fn one_ray_shows_of_textures_about_what_many_do() {
        let options = HouseOptions {
            rooms: 3,
            ..HouseOptions::default()
        };
        let house = house(&options).unwrap();
        let (low, high) = house.model.mesh.bounds().unwrap();
        let (mut sum, mut count) = (0.0, 0.0);
        for i in 0..6 {
            let share = 0.2 + 0.1 * f64::from(i);
            let eye = low.lerp(high, share).with_y(low.y + 1.6);
            let turn = 1.1 * f64::from(i);
            let ahead = DVec3::new(turn.cos(), -0.1, turn.sin());
            let view = View {
                lens: Lens::pinhole(DVec2::splat(112.0), DVec2::new(80.0, 64.0)),
                width: 160,
                height: 128,
                camera_from_world: Rigid3::looking_at(eye, eye + ahead, DVec3::Y),
            };
            let rays = |n: u32| render_model(&house.model, &house.solid, &view, n).0;
            let (one, many) = (rays(1), rays(8));
            for (a, b) in one.pixels().zip(many.pixels()).filter(|(a, _)| a.0[3] > 0) {
                for k in 0..3 {
                    sum += (f64::from(a.0[k]) - f64::from(b.0[k])).powi(2);
                    count += 1.0;
                }
            }
        }
        let psnr = 10.0 * (255.0 * 255.0 * count / sum).log10();
        // 31.03; of textures at their finest 29.57.
        assert!(psnr > 30.8, "{psnr}");
    }
}
