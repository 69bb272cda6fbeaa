//! Triangle meshes, and the files that hold them.

mod coarse;
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

pub use coarse::Coarse;
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
use std::collections::BTreeMap;

/// A corner, the same where its position is.
pub(crate) type Place = [u64; 3];

pub(crate) fn place(p: DVec3) -> Place {
    p.to_array().map(|x| (x + 0.0).to_bits())
}

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

    /// The ends of an edge that triangles run along more often one way than the other, if there is one: none of a
    /// closed mesh whose triangles all go the same way round. Corners in one place are one.
    pub fn open_edge(&self) -> Option<[DVec3; 2]> {
        // 1. By corner, the first in its place.
        let mut first = BTreeMap::new();
        let places = self.positions.iter().map(|p| place(*p)).zip(0_u32..);
        let same: Vec<u32> = places
            .map(|(place, i)| *first.entry(place).or_insert(i))
            .collect();
        // 2. Every edge, and whether it is run along from its lesser end.
        let mut edges: Vec<([u32; 2], bool)> = Vec::with_capacity(3 * self.triangles.len());
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|i| same[i as usize]);
            let runs = [[a, b], [b, c], [c, a]];
            let runs = runs.into_iter().filter(|[from, to]| from != to);
            edges.extend(runs.map(|[from, to]| ([from.min(to), from.max(to)], from < to)));
        }
        edges.sort_unstable();
        let is_open = |runs: &&[([u32; 2], bool)]| {
            2 * runs.iter().filter(|(_, way)| *way).count() != runs.len()
        };
        let open = edges.chunk_by(|a, b| a.0 == b.0).find(is_open)?;
        Some(open[0].0.map(|i| self.positions[i as usize]))
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
