//! A textured model: a mesh and how it looks.

use super::{Mesh, Skin};
use image::RgbaImage;
use std::ops::Range;

/// A mesh, the colours of its surface and the names of its parts.
///
/// Its colour at a place is the product of its material's base colour, its texture there and
/// its corners' colours, all as sRGB codes: no light is added, because baked light is part of
/// the corners' colours. Everything is opaque.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// The triangles, in the world.
    pub mesh: Mesh,
    /// Texture coordinates of each corner, (0, 0) at the picture's top left; finite.
    pub uvs: Vec<[f32; 2]>,
    /// Colour of each corner, sRGB; white where it has none. The fourth is always 255.
    pub colors: Vec<[u8; 4]>,
    /// Runs of triangles, one after the other, that cover all of them.
    pub parts: Vec<Part>,
    /// The nodes of the file's scene, parents first.
    pub nodes: Vec<ModelNode>,
    /// What the parts refer to.
    pub materials: Vec<Material>,
    /// What the materials refer to; sRGB.
    pub textures: Vec<RgbaImage>,
}

/// A run of triangles of one node and one material.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Indices into the mesh's triangles.
    pub triangles: Range<u32>,
    /// Index into [`Model::nodes`].
    pub node_idx: u32,
    /// Index into [`Model::materials`].
    pub material_idx: u32,
}

/// A node of the file's scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModelNode {
    /// Empty where the file gives none.
    pub name: String,
    /// Index into [`Model::nodes`].
    pub parent_idx: Option<u32>,
}

/// The colour of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Red, green and blue as sRGB codes, 0 to 1.
    pub base_color: [f32; 3],
    /// Index into [`Model::textures`].
    pub texture_idx: Option<u32>,
    /// What lies beyond the texture's sides, across and down.
    pub wrap: [Wrap; 2],
}

impl Default for Material {
    fn default() -> Self {
        Self {
            base_color: [1.0; 3],
            texture_idx: None,
            wrap: [Wrap::Repeat; 2],
        }
    }
}

/// What lies beyond a texture's sides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The texture again.
    #[default]
    Repeat,
    /// Its mirror image.
    Mirror,
    /// Its outermost pixels.
    Clamp,
}

impl Model {
    /// The part that a triangle belongs to. A model whose parts do not cover its triangles has
    /// none for some.
    pub fn part_of(&self, triangle_idx: u32) -> Option<&Part> {
        let after = self
            .parts
            .partition_point(|part| part.triangles.start <= triangle_idx);
        let part = self.parts.get(after.checked_sub(1)?)?;
        part.triangles.contains(&triangle_idx).then_some(part)
    }

    /// Red, green and blue at a place of a triangle, sRGB codes 0 to 255: the texture
    /// bilinear at its finest level, the product of all that colours it. `shares` are the
    /// corners' barycentric weights, and sum to 1. See [`Skin`] for many places.
    pub fn color(&self, triangle_idx: u32, shares: [f64; 3]) -> [f64; 3] {
        let skin = Skin::new(self, self.part_of(triangle_idx), triangle_idx);
        let [r, g, b, _] = skin.color(shares[1], shares[2]).map(f64::from);
        [r, g, b]
    }

    /// Adds white triangles as a node of its own; their indices.
    pub fn append(&mut self, mesh: &Mesh, node: &str) -> Range<u32> {
        let first = self.mesh.triangles.len() as u32;
        self.mesh.append(mesh);
        self.uvs.resize(self.mesh.positions.len(), [0.0; 2]);
        self.colors.resize(self.mesh.positions.len(), [255; 4]);
        let triangles = first..self.mesh.triangles.len() as u32;
        self.parts.push(Part {
            triangles: triangles.clone(),
            node_idx: self.nodes.len() as u32,
            material_idx: self.materials.len() as u32,
        });
        self.nodes.push(ModelNode {
            name: node.to_owned(),
            parent_idx: None,
        });
        self.materials.push(Material::default());
        triangles
    }
}

/// The sRGB code, 0 to 1, of linear light; what is beyond is clipped.
pub(super) fn srgb_from_linear(linear: f64) -> f64 {
    let linear = linear.clamp(0.0, 1.0);
    match linear <= 0.003_130_8 {
        true => 12.92 * linear,
        false => 1.055 * linear.powf(1.0 / 2.4) - 0.055,
    }
}

/// Linear light of an sRGB code, 0 to 1; what is beyond is clipped.
pub fn linear_from_srgb(code: f64) -> f64 {
    let code = code.clamp(0.0, 1.0);
    match code <= 0.040_45 {
        true => code / 12.92,
        false => ((code + 0.055) / 1.055).powf(2.4),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_and_light_are_inverse() {
        for code in 0..=255 {
            let code = f64::from(code) / 255.0;
            assert!((srgb_from_linear(linear_from_srgb(code)) - code).abs() < 1e-6);
        }
    }
}
