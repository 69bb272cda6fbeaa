//! What colours a triangle of a model, made ready once for many of its pixels.

use super::model::texel_area;
use super::texture::Level;
use super::{Model, Part, Wrap};

/// What colours a triangle: its corners' colours times its material's, and its texture.
#[derive(Clone, Debug)]
pub struct Skin<'a> {
    /// Of the first corner, and what the second's and the third's have more: sRGB codes, 0 to 255;
    /// times the material's colour.
    pub(super) colors: [[f32; 3]; 3],
    /// The same of texture coordinates.
    pub(super) uvs: [[f64; 2]; 3],
    /// The texture's, of all levels; none without one.
    pub(super) texels: &'a [[u8; 4]],
    /// At least one.
    pub(super) levels: &'a [Level],
    pub(super) wraps: [Wrap; 2],
    /// Texels of the finest level that a footprint of 1 covers.
    pub(super) texel_area: f64,
    /// Which texture it is, and which of its sides are followed by the texture again.
    pub(super) key: u32,
}

/// The key of what has no texture.
pub(super) const PLAIN: u32 = u32::MAX << LEVEL_BITS;
/// Bits of a key that say which level, and beside which sides the texture is again.
pub(super) const LEVEL_BITS: u32 = 5;
pub(super) const SIDE_BITS: u32 = 2;
/// Of what has no texture.
pub(super) static ONE_TEXEL: [Level; 1] = [Level {
    first: 0,
    width: 1,
    height: 1,
}];

impl<'a> Skin<'a> {
    /// A triangle's that lies in a part of a model, if it lies in one: without one it has no
    /// material.
    pub fn new(model: &'a Model, part: Option<&Part>, triangle_idx: u32) -> Self {
        let material = part.and_then(|part| model.materials.get(part.material_idx as usize));
        let base = material.map_or([1.0; 3], |material| material.base_color);
        let wraps = material.map_or([Wrap::Clamp; 2], |material| material.wrap);
        let texture = material.and_then(|material| {
            let idx = material.texture_idx?;
            let texture = model.textures.get(idx as usize)?;
            (!texture.levels().is_empty()).then_some((idx, texture))
        });
        // Loops, not chains of calls, here and below: those are not always compiled in place.
        let corners = model.mesh.triangles[triangle_idx as usize];
        let (mut colors, mut uvs) = ([[0.0; 3]; 3], [[0.0; 2]; 3]);
        for i in 0..3 {
            let corner = corners[i] as usize;
            let (color, uv) = (model.colors[corner], model.uvs[corner]);
            for k in 0..3 {
                colors[i][k] = f32::from(color[k]) * base[k];
            }
            uvs[i] = [f64::from(uv[0]), f64::from(uv[1])];
        }
        let (texels, levels, texel_area, key) = match texture {
            Some((idx, texture)) => (
                texture.texels(),
                texture.levels(),
                texel_area(texture, uvs),
                key_of(idx, wraps),
            ),
            None => (&[][..], &ONE_TEXEL[..], 0.0, PLAIN),
        };
        for i in 1..3 {
            for k in 0..3 {
                colors[i][k] -= colors[0][k];
            }
            for k in 0..2 {
                uvs[i][k] -= uvs[0][k];
            }
        }
        Self {
            colors,
            uvs,
            texels,
            levels,
            wraps,
            texel_area,
            key,
        }
    }
}

/// A texture's key at its finest level.
fn key_of(texture_idx: u32, wraps: [Wrap; 2]) -> u32 {
    let sides = [0, 1].map(|k| u32::from(wraps[k] == Wrap::Repeat) << k);
    (texture_idx << SIDE_BITS | sides[0] | sides[1]) << LEVEL_BITS
}
