//! How triangles of a model are coloured: each made ready for many of its pixels, and many pixels
//! coloured together.

use super::model::texel_area;
use super::texture::{Level, level_of};
use super::{Model, Part, Wrap};

/// What colours a triangle: its corners' colours times its material's, and its texture.
#[derive(Clone, Debug)]
pub struct Skin<'a> {
    /// Of the first corner, and what the second's and the third's have more: sRGB codes, 0 to 255;
    /// times the material's colour. The last number is of no use.
    colors: [[f32; 4]; 3],
    /// The same of texture coordinates.
    uvs: [[f64; 2]; 3],
    /// The texture's, of all levels; white without one.
    texels: &'a [[u8; 4]],
    /// At least one.
    levels: &'a [Level],
    /// As numbers of [`Wrap`].
    wraps: [u64; 2],
    /// Texels of the finest level that a footprint of 1 covers.
    texel_area: f64,
}

/// Places of triangles that are coloured together, at most [`MOST`], number by number.
#[derive(Clone, Debug)]
pub struct Places<'a> {
    count: usize,
    /// Without the texture.
    colors: [[f32; MOST]; 3],
    uvs: [[f64; MOST]; 2],
    texels: [&'a [[u8; 4]]; MOST],
    wraps: [[u64; MOST]; 2],
    /// The finer of two levels, and the coarser.
    levels: [Levels; 2],
    /// The coarser one's.
    shares: [f32; MOST],
    /// Whether one of those is more than 0.
    has_coarse: bool,
}

/// A level for each place.
#[derive(Clone, Debug)]
struct Levels {
    /// Their first texels.
    firsts: [f64; MOST],
    /// Columns and rows.
    counts: [[f64; MOST]; 2],
}

/// The most places that are coloured together.
pub const MOST: usize = 32;
/// What leaves a colour as it is.
static WHITE: [[u8; 4]; 1] = [[255; 4]];
static ONE_TEXEL: [Level; 1] = [Level {
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
        let wrap = material.map_or([Wrap::Clamp; 2], |material| material.wrap);
        let texture = material.and_then(|material| {
            let texture = model.textures.get(material.texture_idx? as usize)?;
            (!texture.levels().is_empty()).then_some(texture)
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
        let (texels, levels, texel_area) = match texture {
            Some(texture) => (texture.texels(), texture.levels(), texel_area(texture, uvs)),
            None => (&WHITE[..], &ONE_TEXEL[..], 0.0),
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
            wraps: wrap.map(|wrap| wrap as u64),
            texel_area,
        }
    }
}

impl Default for Places<'_> {
    fn default() -> Self {
        let levels = Levels {
            firsts: [0.0; MOST],
            counts: [[1.0; MOST]; 2],
        };
        Self {
            count: 0,
            colors: [[0.0; MOST]; 3],
            uvs: [[0.0; MOST]; 2],
            texels: [&WHITE; MOST],
            wraps: [[Wrap::Clamp as u64; MOST]; 2],
            levels: [levels.clone(), levels],
            shares: [0.0; MOST],
            has_coarse: false,
        }
    }
}

impl<'a> Places<'a> {
    /// Forgets all.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.count = 0;
        self.has_coarse = false;
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
    /// all three sum to 1; see [`footprint`](super::footprint). Beyond [`MOST`] it takes the last one's
    /// place.
    #[inline(always)]
    pub fn add(&mut self, skin: &Skin<'a>, second: f64, third: f64, footprint: f64) {
        let i = self.count.min(MOST - 1);
        let [first, b, c] = &skin.colors;
        let (share_b, share_c) = (second as f32, third as f32);
        for k in 0..3 {
            self.colors[k][i] = first[k] + share_b * b[k] + share_c * c[k];
        }
        let [first, b, c] = &skin.uvs;
        for k in 0..2 {
            self.uvs[k][i] = first[k] + second * b[k] + third * c[k];
            self.wraps[k][i] = skin.wraps[k];
        }
        let last = skin.levels.len() - 1;
        let level = level_of((footprint * skin.texel_area) as f32);
        let level = level.max(0.0).min(last as f32);
        let fine = level as usize;
        self.shares[i] = level - fine as f32;
        self.has_coarse |= self.shares[i] > 0.0;
        for (k, levels) in self.levels.iter_mut().enumerate() {
            let level = &skin.levels[(fine + k).min(last)];
            levels.firsts[i] = f64::from(level.first);
            levels.counts[0][i] = f64::from(level.width);
            levels.counts[1][i] = f64::from(level.height);
        }
        self.texels[i] = skin.texels;
        self.count = i + 1;
    }

    /// Red, green and blue of each place, in the order in which they were added: sRGB codes, 0 to 255;
    /// see [`Model::color`].
    #[inline(always)]
    pub fn colors(&self) -> [[f32; MOST]; 3] {
        let mut colors = self.of_level(&self.levels[0]);
        if self.has_coarse {
            let coarse = self.of_level(&self.levels[1]);
            for (color, coarse) in colors.iter_mut().zip(&coarse) {
                for i in 0..MOST {
                    color[i] += self.shares[i] * (coarse[i] - color[i]);
                }
            }
        }
        for (color, plain) in colors.iter_mut().zip(&self.colors) {
            for i in 0..MOST {
                color[i] = plain[i] * (color[i] * (1.0 / 255.0));
            }
        }
        colors
    }

    /// The textures' colours at a level.
    #[inline(always)]
    fn of_level(&self, levels: &Levels) -> [[f32; MOST]; 3] {
        // Loops over all, as of fixed length they are compiled to vector instructions.
        // 1. Which four texels, row by row, and the second column's and the second row's shares.
        let mut idxs = [[0; MOST]; 4];
        let mut shares = [[0.0_f32; MOST]; 2];
        for i in 0..MOST {
            let [width, height] = [levels.counts[0][i], levels.counts[1][i]];
            let (columns, across) = around(self.uvs[0][i], width, self.wraps[0][i]);
            let (rows, down) = around(self.uvs[1][i], height, self.wraps[1][i]);
            let [above, below] = [0, 1].map(
                #[inline(always)]
                |k| levels.firsts[i] + rows[k] * width,
            );
            idxs[0][i] = whole(above + columns[0]);
            idxs[1][i] = whole(above + columns[1]);
            idxs[2][i] = whole(below + columns[0]);
            idxs[3][i] = whole(below + columns[1]);
            (shares[0][i], shares[1][i]) = (across as f32, down as f32);
        }
        // 2. The texels.
        let mut texels = [[0; MOST]; 4];
        for i in 0..self.count.min(MOST) {
            for k in 0..4 {
                texels[k][i] = u32::from_le_bytes(self.texels[i][idxs[k][i] as usize]);
            }
        }
        // 3. Between them.
        let mut colors = [[0.0; MOST]; 3];
        let [across, down] = &shares;
        let [a, b, c, d] = &texels;
        for (channel, color) in colors.iter_mut().enumerate() {
            let code = |texel: u32| (texel >> (8 * channel) & 255) as i32 as f32;
            for i in 0..MOST {
                let [a, b, c, d] = [code(a[i]), code(b[i]), code(c[i]), code(d[i])];
                let above = a + across[i] * (b - a);
                let below = c + across[i] * (d - c);
                color[i] = above + down[i] * (below - above);
            }
        }
        colors
    }
}

/// The two columns (or rows) of a texture around a place, where 0 to 1 is once the texture of that many
/// texels, and the second's share. Whatever the place is, the texture has them.
#[inline(always)]
fn around(at: f64, count: f64, wrap: u64) -> ([f64; 2], f64) {
    let last = count - 1.0;
    let is_repeated = wrap == Wrap::Repeat as u64;
    // All ways are gone, and one is chosen: no branches.
    let repeated = (at - at.floor()) * count - 0.5;
    let within = at - 2.0 * (0.5 * at).floor();
    let mirrored = within.min(2.0 - within);
    let inside = if wrap == Wrap::Mirror as u64 {
        mirrored
    } else {
        at
    };
    // Beyond the outermost texels' middles is what they show.
    let inside = (inside * count - 0.5).max(0.0).min(last);
    let x = if is_repeated { repeated } else { inside };
    let first = x.floor();
    let beyond = if is_repeated { 0.0 } else { last };
    let next = if first < last { first + 1.0 } else { beyond };
    let before = if first < 0.0 { last } else { first };
    // Rounding and what is no number keep within range.
    let kept = [before, next].map(|texel| texel.max(0.0).min(last));
    (kept, x - first)
}

/// A whole number of at least 0 and less than 2⁵² as an integer. (A cast says what becomes of others,
/// too, and is done one by one.)
#[inline(always)]
fn whole(x: f64) -> u64 {
    // Beyond 2⁵² numbers have no digits for fractions.
    const SHIFT: f64 = (1_u64 << 52) as f64;
    (x + SHIFT).to_bits() & ((1 << 52) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn textures_go_on_beyond_their_sides_as_they_should() {
        let at = |wrap: Wrap, i: f64, n: u32| {
            let count = f64::from(n);
            let ([a, b], share) = around((i + 0.5) / count, count, wrap as u64);
            assert!([a, b].iter().all(|texel| (0.0..count).contains(texel)));
            a + share * (b - a)
        };
        let three = |wrap: Wrap| [-2.0, -1.0, 0.0, 2.0, 3.0, 4.0].map(|i| at(wrap, i, 3).round());
        assert_eq!(three(Wrap::Repeat), [1.0, 2.0, 0.0, 2.0, 0.0, 1.0]);
        assert_eq!(three(Wrap::Mirror), [1.0, 0.0, 0.0, 2.0, 2.0, 1.0]);
        assert_eq!(three(Wrap::Clamp), [0.0, 0.0, 0.0, 2.0, 2.0, 2.0]);
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for far in [1e300, -1e300, f64::INFINITY, f64::NAN] {
                let (texels, _) = around(far, 3.0, wrap as u64);
                assert!(texels.iter().all(|texel| [0.0, 1.0, 2.0].contains(texel)));
            }
            for n in 1..5 {
                let texel = |i: i32| wrap.texel(f64::from(i), n);
                for i in -12..12 {
                    let pair = [texel(i), texel(i + 1)].map(f64::from);
                    let between = at(wrap, f64::from(i) + 0.25, n);
                    let expected = 0.75 * pair[0] + 0.25 * pair[1];
                    assert!(
                        (between - expected).abs() < 1e-4,
                        "{wrap:?} {i} of {n}: {between} for {expected}"
                    );
                }
            }
        }
    }
}
