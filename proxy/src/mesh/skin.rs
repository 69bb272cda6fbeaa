//! How triangles of a model are coloured: each made ready for many of its pixels, and many pixels
//! coloured together.

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

/// A place of a triangle, ready to be coloured.
struct Place {
    /// Without the texture; the last number is of no use.
    color: [f32; 4],
    /// The texture's four pixels around it.
    texels: [u32; 4],
    /// The second column's and the second row's.
    shares: [f32; 2],
}

/// Places of triangles that are coloured together, at most [`MOST`], number by number.
#[derive(Clone, Debug)]
pub struct Places {
    count: usize,
    colors: [[f32; MOST]; 3],
    texels: [[u32; MOST]; 4],
    shares: [[f32; MOST]; 2],
}

/// The most places that are coloured together.
pub const MOST: usize = 32;
/// What leaves a colour as it is.
const WHITE: u32 = u32::MAX;

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

    /// A place of the triangle: `second` and `third` are those corners' barycentric weights, where all
    /// three sum to 1.
    #[inline(always)]
    fn place(&self, second: f64, third: f64) -> Place {
        let [first, b, c] = &self.colors;
        let (share_b, share_c) = (second as f32, third as f32);
        let mut color = [0.0; 4];
        for k in 0..4 {
            color[k] = first[k] + share_b * b[k] + share_c * c[k];
        }
        let mut place = Place {
            color,
            texels: [WHITE; 4],
            shares: [0.0; 2],
        };
        if let Some((texture, wrap)) = self.texture {
            let [first, b, c] = &self.uvs;
            let u = first[0] + second * b[0] + third * c[0];
            let v = first[1] + second * b[1] + third * c[1];
            (place.texels, place.shares) = around(texture, [u, v], wrap);
        }
        place
    }
}

impl Default for Places {
    fn default() -> Self {
        Self {
            count: 0,
            colors: [[0.0; MOST]; 3],
            texels: [[WHITE; MOST]; 4],
            shares: [[0.0; MOST]; 2],
        }
    }
}

impl Places {
    /// Forgets all.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// How many there are.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there are none.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Adds a place of a triangle: `second` and `third` are those corners' barycentric weights, where
    /// all three sum to 1. Beyond [`MOST`] it takes the last one's place.
    #[inline(always)]
    pub fn add(&mut self, skin: &Skin<'_>, second: f64, third: f64) {
        let place = skin.place(second, third);
        let i = self.count.min(MOST - 1);
        for k in 0..3 {
            self.colors[k][i] = place.color[k];
        }
        for k in 0..4 {
            self.texels[k][i] = place.texels[k];
        }
        for k in 0..2 {
            self.shares[k][i] = place.shares[k];
        }
        self.count = i + 1;
    }

    /// Red, green and blue of each place, in the order in which they were added: sRGB codes, 0 to 255;
    /// the texture bilinear at its finest level, the product of all that colours it.
    #[inline(always)]
    pub fn colors(&self) -> [[f32; MOST]; 3] {
        let mut colors = self.colors;
        let [across, down] = &self.shares;
        let [a, b, c, d] = &self.texels;
        // Loops over all, as of fixed length they are compiled to vector instructions.
        for (channel, color) in colors.iter_mut().enumerate() {
            let code = |texel: u32| (texel >> (8 * channel) & 255) as i32 as f32;
            for i in 0..MOST {
                let [a, b, c, d] = [code(a[i]), code(b[i]), code(c[i]), code(d[i])];
                let above = a + across[i] * (b - a);
                let below = c + across[i] * (d - c);
                let texel = above + down[i] * (below - above);
                color[i] *= texel * (1.0 / 255.0);
            }
        }
        colors
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

/// The four pixels of a texture around a place, row by row, and the second column's and the second
/// row's shares.
#[inline(always)]
fn around(texture: &RgbaImage, uv: [f64; 2], wrap: [Wrap; 2]) -> ([u32; 4], [f32; 2]) {
    let (width, height) = texture.dimensions();
    let across = wrap[0].around(uv[0], width);
    let down = wrap[1].around(uv[1], height);
    let (texels, _) = texture.as_raw().as_chunks::<4>();
    let [above, below] = down.texels;
    let [above, below] = [above * width as usize, below * width as usize];
    let [left, right] = across.texels;
    let texel = |i: usize| u32::from_le_bytes(texels[i]);
    let texels = [
        texel(above + left),
        texel(above + right),
        texel(below + left),
        texel(below + right),
    ];
    (texels, [across.share, down.share])
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
        let skin = Skin {
            colors: [[255.0; 4], [0.0; 4], [0.0; 4]],
            uvs: [[0.0, 0.3], [1.0, 0.0], [0.0; 2]],
            texture: Some((&texture, [Wrap::Clamp; 2])),
        };
        let mut places = Places::default();
        for u in [0.25, 0.5, 0.75] {
            places.add(&skin, u, 0.0);
        }
        let found = &places.colors()[0][..places.len()];
        assert_eq!(found.len(), 3);
        for (found, expected) in found.iter().zip([0.0, 50.0, 100.0]) {
            assert!((found - expected).abs() < 1e-4, "{found} for {expected}");
        }
    }
}
