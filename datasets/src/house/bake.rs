//! Light that stays where it is: a ceiling lamp for each room, shadows, and darker corners.

use super::builder::Builder;
use super::plan::{HEIGHT, Plan};
use crate::picture::srgb_from_linear;
use glam::{DVec2, DVec3};
use proxy::Solid;
use rayon::prelude::*;

/// Where the lamps' light comes from, below what one sees of them.
const LAMP_HEIGHT: f64 = HEIGHT - 0.5;
const LAMP_HALF: f64 = 0.18;
/// Light of a lamp on a floor straight below, for each square metre of its room.
const LAMP_POWER: f64 = 0.27;
const LAMP_COLOR: DVec3 = DVec3::new(1.0, 0.94, 0.84);
/// Light from everywhere.
const AMBIENT: DVec3 = DVec3::new(0.24, 0.26, 0.28);
/// Corners darken where something is nearer than this.
const REACH: f64 = 0.8;
/// A ray's start is off the surface.
const OFF: f64 = 1e-3;

/// The colours of all corners.
pub(super) fn bake(builder: &Builder, plan: &Plan, solid: &Solid) -> Vec<[u8; 4]> {
    let positions = &solid.mesh().positions;
    let corner = |i: usize| {
        if builder.shines[i] {
            return [255; 4];
        }
        let [r, g, b] = srgb_from_linear(light(positions[i], builder.normals[i], plan, solid));
        [r, g, b, 255]
    };
    (0..positions.len()).into_par_iter().map(corner).collect()
}

/// Linear light that a white surface gives back.
fn light(at: DVec3, normal: DVec3, plan: &Plan, solid: &Solid) -> [f64; 3] {
    let from = at + OFF * normal;
    // 1. The lamp of the room that one is in.
    let plane = DVec2::new(at.x, at.z);
    let inside = plan
        .rooms
        .iter()
        .find(|r| plane.cmpge(r.min).all() && plane.cmple(r.max).all());
    let mut direct = 0.0;
    if let Some(room) = inside {
        let area = room.size().x * room.size().y;
        for (dx, dz) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
            let middle = room.middle();
            let offset = DVec3::new(dx, 0.0, dz) * LAMP_HALF;
            let to = DVec3::new(middle.x, LAMP_HEIGHT, middle.y) + offset - from;
            let squared = to.length_squared();
            let facing = normal.dot(to) / squared.sqrt();
            let is_hidden = || solid.first_hit(from, to).is_some_and(|hit| hit.along < 1.0);
            if facing > 0.0 && !is_hidden() {
                direct += 0.25 * LAMP_POWER * area * facing / squared.max(0.3);
            }
        }
    }
    // 2. The surroundings.
    let x = normal.any_orthonormal_vector();
    let y = normal.cross(x);
    let mut openness = 0.0;
    for k in 0..6 {
        let direction = match k {
            0 => normal,
            _ => {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 5.0).sin_cos();
                (normal + x * cos + y * sin).normalize()
            }
        };
        let free = solid.first_hit(from, direction).map_or(REACH, |h| h.along);
        openness += (free / REACH).min(1.0) / 6.0;
    }
    let light = AMBIENT * (0.25 + 0.75 * openness) + LAMP_COLOR * direct;
    // As film takes it: nothing is whiter than white.
    light.to_array().map(|l| 1.0 - (-1.6 * l).exp())
}
