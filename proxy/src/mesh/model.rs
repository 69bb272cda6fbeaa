//! A textured model: a mesh and how it looks.

use super::Mesh;
use super::texture::{Level, Texture, level_of};
use glam::{DVec2, DVec3};
use std::ops::Range;

/// What the names of nodes begin with that stand for openings, and are not drawn.
pub(crate) const PORTAL_NODE: &str = "portal:";

/// A mesh, the colours of its surface and the names of its parts.
///
/// Its colour at a place is the product of its material's base colour, its texture there and
/// its corners' colours, all as sRGB codes: no light is added, because baked light is part of
/// the corners' colours. Everything is opaque; what a file's alpha makes invisible is not there.
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
    /// What the materials refer to.
    pub textures: Vec<Texture>,
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

impl Wrap {
    /// The column (or row) of a texture of that many.
    pub(super) fn texel(self, i: f64, count: u32) -> u32 {
        let n = f64::from(count);
        let within = match self {
            Self::Repeat => i.rem_euclid(n),
            Self::Clamp => i,
            Self::Mirror => {
                let twice = i.rem_euclid(2.0 * n);
                twice.min(2.0 * n - 1.0 - twice)
            }
        };
        within.clamp(0.0, n - 1.0) as u32
    }
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

    /// Red, green and blue at a place of a triangle, sRGB codes 0 to 255: the product of all that
    /// colours it. `shares` are the corners' barycentric weights, and sum to 1.
    ///
    /// Files say factors and corners' colours as shares of linear light, which are read into codes. The product of
    /// codes stands for that of light: where one is a power of the other, as sRGB is nearly, the two commute.
    ///
    /// The texture is bilinear in each of the two levels that suit a pixel with a [`footprint`], and
    /// mixed between them; 0 asks for the finest. [`Coloring`](super::Coloring) is the fast twin, in f32,
    /// for many places.
    pub fn color(&self, triangle_idx: u32, shares: [f64; 3], footprint: f64) -> [f64; 3] {
        let corners = self.mesh.triangles[triangle_idx as usize].map(|i| i as usize);
        let (mut color, mut uv) = ([0.0; 3], [0.0; 2]);
        for (share, corner) in shares.iter().zip(corners) {
            for (sum, x) in color.iter_mut().zip(self.colors[corner]) {
                *sum += share * f64::from(x);
            }
            for (sum, x) in uv.iter_mut().zip(self.uvs[corner]) {
                *sum += share * f64::from(x);
            }
        }
        let part = self.part_of(triangle_idx);
        let Some(material) = part.and_then(|p| self.materials.get(p.material_idx as usize)) else {
            return color;
        };
        let texture = material.texture_idx;
        let texture = texture.and_then(|i| self.textures.get(i as usize));
        let uvs = corners.map(|corner| self.uvs[corner].map(f64::from));
        let texel = texture.map_or([255.0; 3], |texture| {
            let texels = (footprint * texel_area(texture, uvs)) as f32;
            sample(texture, uv, material.wrap, texels)
        });
        [0, 1, 2].map(|k| color[k] * f64::from(material.base_color[k]) * texel[k] / 255.0)
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

/// How much of a triangle a pixel covers: the area that its barycentric weights, two of them, cover
/// there. Corners and the ray, with z = 1, are in the camera's frame; `focal` is in pixels, and the lens is taken
/// for one that bends nothing. 0 where the ray does not meet its plane.
///
/// Weights are edges times the ray over their sum (Olano and Greer 1997), as a map from rays to weights
/// one of the plane to itself, whose Jacobian is its determinant, the volume squared, over the sum cubed.
pub fn footprint([a, b, c]: [DVec3; 3], ray: DVec3, focal: DVec2) -> f64 {
    let edges = b.cross(c) + c.cross(a) + a.cross(b);
    let (volume, sum) = (a.dot(b.cross(c)), edges.dot(ray));
    let footprint = (volume * volume / (sum * sum * sum)).abs() / (focal.x * focal.y);
    if footprint.is_finite() {
        footprint
    } else {
        0.0
    }
}

/// Texels of the finest level of a texture that a footprint of 1 covers, where those are a triangle's
/// texture coordinates.
pub(super) fn texel_area(texture: &Texture, [a, b, c]: [[f64; 2]; 3]) -> f64 {
    let [b, c] = [b, c].map(|corner| [corner[0] - a[0], corner[1] - a[1]]);
    let area = (b[0] * c[1] - b[1] * c[0]).abs();
    texture.levels().first().map_or(0.0, |level| {
        area * f64::from(level.width) * f64::from(level.height)
    })
}

/// A texture's colour where a pixel covers so many texels.
fn sample(texture: &Texture, uv: [f64; 2], wrap: [Wrap; 2], texels: f32) -> [f64; 3] {
    let Some(last) = texture.levels().len().checked_sub(1) else {
        return [255.0; 3];
    };
    let level = level_of(texels).max(0.0).min(last as f32);
    let fine = level as usize;
    let share = f64::from(level - fine as f32);
    let of = |i: usize| bilinear(texture, &texture.levels()[i.min(last)], uv, wrap);
    let (fine, coarse) = (of(fine), of(fine + 1));
    [0, 1, 2].map(|k| fine[k] + share * (coarse[k] - fine[k]))
}

/// A level's colour, bilinear between the texels' centres.
fn bilinear(texture: &Texture, level: &Level, uv: [f64; 2], wrap: [Wrap; 2]) -> [f64; 3] {
    let Level {
        first,
        width,
        height,
    } = *level;
    let [x, y] = [uv[0] * f64::from(width), uv[1] * f64::from(height)].map(|at| at - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let (right_share, bottom_share) = (x - left, y - top);
    let mut color = [0.0; 3];
    for (dy, down) in [(0.0, 1.0 - bottom_share), (1.0, bottom_share)] {
        for (dx, across) in [(0.0, 1.0 - right_share), (1.0, right_share)] {
            let column = wrap[0].texel(left + dx, width);
            let row = wrap[1].texel(top + dy, height);
            let texel = texture.texels()[(first + row * width + column) as usize];
            for k in 0..3 {
                color[k] += across * down * f64::from(texel[k]);
            }
        }
    }
    color
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
    fn textures_go_on_beyond_their_sides_as_they_should() {
        let texels = |wrap: Wrap| [-2.0, -1.0, 0.0, 2.0, 3.0, 4.0].map(|i| wrap.texel(i, 3));
        assert_eq!(texels(Wrap::Repeat), [1, 2, 0, 2, 0, 1]);
        assert_eq!(texels(Wrap::Mirror), [1, 0, 0, 2, 2, 1]);
        assert_eq!(texels(Wrap::Clamp), [0, 0, 0, 2, 2, 2]);
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            assert!(wrap.texel(1e300, 3) < 3 && wrap.texel(-1e300, 3) < 3);
        }
        let picture = image::RgbaImage::from_fn(2, 1, |x, _| image::Rgba([100 * x as u8; 4]));
        let texture = Texture::new(picture);
        let at = |u: f64| sample(&texture, [u, 0.3], [Wrap::Clamp; 2], 0.0)[0];
        assert_eq!([at(0.25), at(0.5), at(0.75)], [0.0, 50.0, 100.0]);
        // From two texels a pixel on, half way to the level of one texel, the mean in linear light.
        let coarse = |texels: f32| sample(&texture, [0.25, 0.3], [Wrap::Clamp; 2], texels)[0];
        assert_eq!([coarse(1.0), coarse(2.0)], [0.0, 0.5 * coarse(4.0)]);
        assert_eq!([coarse(4.0), coarse(f32::INFINITY)], [71.0; 2]);
    }

    #[test]
    fn a_footprint_is_the_area_between_neighbouring_pixels() {
        let corners = [[0.3, -0.2, 2.0], [1.4, 0.1, 3.0], [-0.1, 1.2, 2.5]].map(DVec3::from);
        let focal = DVec2::new(500.0, 430.0);
        let [a, b, c] = corners;
        let weights = |x: f64, y: f64| {
            let ray = DVec3::new(x, y, 1.0);
            let edges = [b.cross(c), c.cross(a), a.cross(b)].map(|edge| edge.dot(ray));
            let sum: f64 = edges.iter().sum();
            DVec2::new(edges[1] / sum, edges[2] / sum)
        };
        for (x, y) in [(0.2, 0.1), (0.3, 0.3), (0.05, 0.4)] {
            let step = 1e-3;
            let here = weights(x, y);
            let right = weights(x + step / focal.x, y) - here;
            let below = weights(x, y + step / focal.y) - here;
            let area = right.perp_dot(below).abs() / (step * step);
            let found = footprint(corners, DVec3::new(x, y, 1.0), focal);
            assert!((found / area - 1.0).abs() < 1e-4, "{found} for {area}");
        }
        // Edge on, or of no area.
        assert!(footprint([a, b, a + b], DVec3::Z, focal) < 1e-30);
        assert_eq!(footprint([a, a, b], DVec3::Z, focal), 0.0);
    }

    #[test]
    fn codes_and_light_are_inverse() {
        for code in 0..=255 {
            let code = f64::from(code) / 255.0;
            assert!((srgb_from_linear(linear_from_srgb(code)) - code).abs() < 1e-6);
        }
    }
}
