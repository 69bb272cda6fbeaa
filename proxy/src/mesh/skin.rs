//! How one triangle of a model is coloured, made ready for many of its pixels.

use super::{Model, Part, Wrap};
use image::RgbaImage;

/// What colours a triangle: its corners' colours times its material's, and its texture.
#[derive(Clone, Debug)]
pub struct Skin<'a> {
    /// Of the first corner, and what the second's and the third's have more: sRGB codes, 0 to 255;
    /// times the material's colour.
    colors: [[f32; 4]; 3],
    /// The same of texture coordinates.
    uvs: [[f64; 2]; 3],
    texture: Option<(&'a RgbaImage, [Wrap; 2])>,
}

/// The two columns (or rows) of a texture around a place, and the second's share.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Around {
    texels: [usize; 2],
    share: f32,
}

impl<'a> Skin<'a> {
    /// A triangle's that lies in a part of a model, if it lies in one: without one it has no
    /// material.
    pub fn new(model: &'a Model, part: Option<&Part>, triangle_idx: u32) -> Self {
        let material = part.and_then(|part| model.materials.get(part.material_idx as usize));
        let base = material.map_or([1.0; 3], |material| material.base_color);
        let texture = material.and_then(|material| {
            let texture = model.textures.get(material.texture_idx? as usize)?;
            let is_empty = texture.width() == 0 || texture.height() == 0;
            (!is_empty).then_some((texture, material.wrap))
        });
        // Loops, not chains of calls, here and below: those are not always compiled in place.
        let corners = model.mesh.triangles[triangle_idx as usize];
        let (mut colors, mut uvs) = ([[0.0; 4]; 3], [[0.0; 2]; 3]);
        for i in 0..3 {
            let corner = corners[i] as usize;
            let (color, uv) = (model.colors[corner], model.uvs[corner]);
            for k in 0..3 {
                colors[i][k] = f32::from(color[k]) * base[k];
            }
            uvs[i] = [f64::from(uv[0]), f64::from(uv[1])];
        }
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
            texture,
        }
    }

    /// Red, green and blue at a place of the triangle, sRGB codes 0 to 255, then nothing: the
    /// texture bilinear at its finest level, the product of all that colours it. `second` and
    /// `third` are those corners' barycentric weights, where all three sum to 1.
    #[inline(always)]
    pub fn color(&self, second: f64, third: f64) -> [f32; 4] {
        let [first, b, c] = &self.colors;
        let (share_b, share_c) = (second as f32, third as f32);
        let mut color = [0.0; 4];
        for k in 0..4 {
            color[k] = first[k] + share_b * b[k] + share_c * c[k];
        }
        let Some((texture, wrap)) = self.texture else {
            return color;
        };
        let [first, b, c] = &self.uvs;
        let u = first[0] + second * b[0] + third * c[0];
        let v = first[1] + second * b[1] + third * c[1];
        let texel = sample(texture, [u, v], wrap);
        for k in 0..4 {
            color[k] *= texel[k] * (1.0 / 255.0);
        }
        color
    }
}

impl Wrap {
    /// What is around a place, where 0 to 1 is once the texture of that many texels.
    #[inline(always)]
    fn around(self, at: f64, count: u32) -> Around {
        let last = f64::from(count - 1);
        let (first, next, x) = match self {
            Self::Repeat => {
                let x = (at - at.floor()) * f64::from(count) - 0.5;
                let first = x.floor();
                let next = if first < last { first + 1.0 } else { 0.0 };
                (if first < 0.0 { last } else { first }, next, x - first)
            }
            Self::Clamp | Self::Mirror => {
                let at = if self == Self::Mirror {
                    let within = at - 2.0 * (0.5 * at).floor();
                    within.min(2.0 - within)
                } else {
                    at
                };
                // Beyond the outermost texels' middles is what they show.
                let x = (at * f64::from(count) - 0.5).max(0.0).min(last);
                let first = x.floor();
                (first, (first + 1.0).min(last), x - first)
            }
        };
        // Casts keep within range; so do rounding and what is no number.
        let [first, next] = [first as u32, next as u32];
        Around {
            texels: [first.min(count - 1) as usize, next.min(count - 1) as usize],
            share: x as f32,
        }
    }
}

/// A texture's colour, bilinear between the pixels' centres.
#[inline(always)]
fn sample(texture: &RgbaImage, uv: [f64; 2], wrap: [Wrap; 2]) -> [f32; 4] {
    let (width, height) = texture.dimensions();
    let across = wrap[0].around(uv[0], width);
    let down = wrap[1].around(uv[1], height);
    let (texels, _) = texture.as_raw().as_chunks::<4>();
    let [above, below] = down.texels;
    let [above, below] = [above * width as usize, below * width as usize];
    let [left, right] = across.texels;
    let above = mixed(&texels[above + left], &texels[above + right], across.share);
    let below = mixed(&texels[below + left], &texels[below + right], across.share);
    let mut color = [0.0; 4];
    for k in 0..4 {
        color[k] = above[k] + down.share * (below[k] - above[k]);
    }
    color
}

/// Two texels' mean, so much of the second.
#[inline(always)]
fn mixed(a: &[u8; 4], b: &[u8; 4], share: f32) -> [f32; 4] {
    let mut mix = [0.0; 4];
    for k in 0..4 {
        let (a, b) = (f32::from(a[k]), f32::from(b[k]));
        mix[k] = a + share * (b - a);
    }
    mix
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn textures_go_on_beyond_their_sides_as_they_should() {
        let at = |wrap: Wrap, i: f64, n: u32| {
            let Around { texels, share } = wrap.around((i + 0.5) / f64::from(n), n);
            assert!(texels.iter().all(|texel| *texel < n as usize));
            let [a, b] = texels.map(|texel| texel as f32);
            a + share * (b - a)
        };
        let three = |wrap: Wrap| [-2.0, -1.0, 0.0, 2.0, 3.0, 4.0].map(|i| at(wrap, i, 3).round());
        assert_eq!(three(Wrap::Repeat), [1.0, 2.0, 0.0, 2.0, 0.0, 1.0]);
        assert_eq!(three(Wrap::Mirror), [1.0, 0.0, 0.0, 2.0, 2.0, 1.0]);
        assert_eq!(three(Wrap::Clamp), [0.0, 0.0, 0.0, 2.0, 2.0, 2.0]);
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for far in [1e300, -1e300, f64::INFINITY, f64::NAN] {
                assert!(wrap.around(far, 3).texels.iter().all(|texel| *texel < 3));
            }
            for n in 1..5 {
                let texel = |i: i32| wrap.texel(f64::from(i), n);
                for i in -12..12 {
                    let pair = [texel(i), texel(i + 1)].map(|texel| texel as f32);
                    let between = at(wrap, f64::from(i) + 0.25, n);
                    let expected = 0.75 * pair[0] + 0.25 * pair[1];
                    assert!(
                        (between - expected).abs() < 1e-4,
                        "{wrap:?} {i} of {n}: {between} for {expected}"
                    );
                }
            }
        }
        let texture = RgbaImage::from_fn(2, 1, |x, _| image::Rgba([100 * x as u8; 4]));
        let at = |u: f64| sample(&texture, [u, 0.3], [Wrap::Clamp; 2])[0];
        assert_eq!([at(0.25), at(0.5), at(0.75)], [0.0, 50.0, 100.0]);
    }
}
