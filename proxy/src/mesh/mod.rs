//! Triangle meshes, and the files that hold them.

mod coloring;
mod error;
mod file;
mod glb;
mod gltf;
mod holes;
mod look;
mod model;
mod model_glb;
mod obj;
mod paint;
mod pieces;
mod ply;
mod ply_header;
mod polygon;
mod quadric;
mod simplify;
mod skin;
mod texture;

pub use coloring::{Coloring, FEW, Neighbours};
pub use error::{ExportError, MeshFileError};
pub use file::{files_beside, parse, parse_model, read, read_model, write};
pub use glb::to_glb;
pub use look::lies_where_cameras_look;
pub(crate) use model::PORTAL_NODE;
pub use model::{Material, Model, ModelNode, Part, Wrap, footprint, linear_from_srgb};
pub use model_glb::model_to_glb;
pub use paint::Painting;
pub use ply::{ply_hull, to_ply};
pub use skin::Skin;
pub use texture::{Level, Texture};

use glam::{DMat4, DVec3};

/// A triangle mesh in the world, seen from both sides.
///
/// Triangles wind counter-clockwise where they are looked at from outside, or from where the
/// cameras are. Indices are valid: whoever makes a mesh sees to that.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The corners.
    pub positions: Vec<DVec3>,
    /// Indices of three corners each.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// A triangle's corners.
    pub fn corners(&self, triangle_idx: usize) -> [DVec3; 3] {
        self.triangles[triangle_idx].map(|i| self.positions[i as usize])
    }

    /// What a closed mesh encloses, in cubed world units: positive where it winds
    /// counter-clockwise from outside. Measured from a corner, so that it keeps its digits far
    /// from the origin.
    pub fn volume(&self) -> f64 {
        let from = self.positions.first().copied().unwrap_or_default();
        let tetrahedron = |i: usize| {
            let [a, b, c] = self.corners(i).map(|p| p - from);
            a.dot(b.cross(c)) / 6.0
        };
        (0..self.triangles.len()).map(tetrahedron).sum()
    }

    /// Takes in another mesh as it is: nothing is joined.
    pub fn append(&mut self, other: &Self) {
        let first = self.positions.len() as u32;
        self.positions.extend(&other.positions);
        let moved = |t: &[u32; 3]| t.map(|i| i + first);
        self.triangles.extend(other.triangles.iter().map(moved));
    }

    /// Moves it into another frame, as a file whose axes or units are not the scene's needs.
    /// Triangles keep their outside where the map mirrors. Perspective is ignored.
    pub fn transform(&mut self, there_from_here: &DMat4) {
        for position in &mut self.positions {
            *position = there_from_here.transform_point3(*position);
        }
        if there_from_here.determinant() < 0.0 {
            self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
    }

    /// The least and the greatest coordinates; `None` if it is empty.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let first = *self.positions.first()?;
        let wider = |(low, high): (DVec3, DVec3), p: &DVec3| (low.min(*p), high.max(*p));
        Some(self.positions.iter().fold((first, first), wider))
    }
}
