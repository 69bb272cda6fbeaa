//! Triangle meshes.

mod pieces;

use glam::DVec3;

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

    /// Takes in another mesh as it is: nothing is joined.
    pub fn append(&mut self, other: &Self) {
        let first = self.positions.len() as u32;
        self.positions.extend(&other.positions);
        let moved = |t: &[u32; 3]| t.map(|i| i + first);
        self.triangles.extend(other.triangles.iter().map(moved));
    }
}
