//! Corners of triangles as a camera sees them, each found once for its neighbouring triangles.

use super::Pinhole;
use glam::{DVec2, DVec3};
use proxy::mesh::Model;

/// A corner relative to a camera.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    /// Of the model's corners; `NONE` for none.
    idx: u32,
    /// Whether it is so far before the eye that it can be projected.
    pub(super) is_in_front: bool,
    /// In the camera's frame.
    pub(super) point: DVec3,
    /// Where it is in the image, and 1 / z; of no use where it is not in front.
    pub(super) pixel: DVec2,
    pub(super) inverse_depth: f64,
}

/// The corners that were asked for lately, for one model and one camera: each in the place that its
/// index says. Triangles that are near one another in a model share theirs.
#[derive(Debug)]
pub(super) struct Corners {
    places: Vec<Corner>,
}

/// Places, a power of 2: more than a run of triangles has corners.
const PLACES: usize = 256;
const NONE: u32 = u32::MAX;
/// Corners nearer to the plane of the eye than this, in shares of their distance, are not
/// projected.
pub(super) const IN_FRONT: f64 = 1e-6;

impl Corners {
    /// Without any.
    pub(super) fn new() -> Self {
        let none = Corner {
            idx: NONE,
            is_in_front: false,
            point: DVec3::ZERO,
            pixel: DVec2::ZERO,
            inverse_depth: 0.0,
        };
        Self {
            places: vec![none; PLACES],
        }
    }

    /// A triangle's.
    #[inline(always)]
    pub(super) fn of(&mut self, model: &Model, camera: &Pinhole, triangle_idx: u32) -> [Corner; 3] {
        let [a, b, c] = model.mesh.triangles[triangle_idx as usize];
        [
            self.at(model, camera, a),
            self.at(model, camera, b),
            self.at(model, camera, c),
        ]
    }

    #[inline(always)]
    fn at(&mut self, model: &Model, camera: &Pinhole, idx: u32) -> Corner {
        let place = &mut self.places[idx as usize % PLACES];
        if place.idx != idx || idx == NONE {
            *place = Corner::new(model, camera, idx);
        }
        *place
    }
}

impl Corner {
    #[inline(always)]
    fn new(model: &Model, camera: &Pinhole, idx: u32) -> Self {
        let point = camera.point(model.mesh.positions[idx as usize]);
        let inverse_depth = 1.0 / point.z;
        Self {
            idx,
            is_in_front: point.z > IN_FRONT * point.abs().max_element(),
            point,
            pixel: point.truncate() * inverse_depth * camera.focal + camera.principal,
            inverse_depth,
        }
    }
}
