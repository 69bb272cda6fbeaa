//! Colours of many places of a model's triangles: a few neighbours are added together, and wait for others of the
//! same texture and level, to be coloured with them.

use super::Wrap;
use super::skin::{LEVEL_BITS, ONE_TEXEL, PLAIN, SIDE_BITS, Skin};
use super::texture::{Level, level_of};

/// A few neighbouring places of a triangle, number by number: `second` and `third` are those corners'
/// barycentric weights, where all three sum to 1; see [`footprint`](super::footprint).
#[derive(Clone, Copy, Debug, Default)]
pub struct Neighbours {
    /// The second corner's weights.
    pub second: [f64; FEW],
    /// The third's.
    pub third: [f64; FEW],
    /// How much of the triangle a pixel covers.
    pub footprint: [f64; FEW],
}

/// Places that wait for others of the same texture and level, to be coloured with them.
#[derive(Clone, Debug)]
pub struct Coloring<'a> {
    open: [Places<'a>; OPEN],
}

/// Places of one texture and finer level, number by number.
#[derive(Clone, Debug)]
struct Places<'a> {
    /// Of texture and level.
    key: u32,
    count: usize,
    texels: &'a [[u8; 4]],
    /// The finer of two levels, and the coarser.
    levels: [Level; 2],
    /// Whether the texture follows its own last column, and row.
    is_repeated: [bool; 2],
    /// Which they are.
    numbers: [u32; MOST],
    /// Without the texture.
    colors: [[f32; MOST]; 3],
    /// Where in the texture, 0 to 1.
    uvs: [[f32; MOST]; 2],
    /// The coarser level's.
    shares: [f32; MOST],
}

/// Neighbouring places that are added together.
pub const FEW: usize = 4;
/// The most places that are coloured together.
const MOST: usize = 32;
/// Textures and levels that are waited for, a power of 2.
const OPEN: usize = 8;

impl Default for Coloring<'_> {
    fn default() -> Self {
        let places = Places {
            key: PLAIN,
            count: 0,
            texels: &[],
            levels: [ONE_TEXEL[0]; 2],
            is_repeated: [false; 2],
            numbers: [0; MOST],
            colors: [[0.0; MOST]; 3],
            uvs: [[0.0; MOST]; 2],
            shares: [0.0; MOST],
        };
        Self {
            open: std::array::from_fn(|_| places.clone()),
        }
    }
}

impl<'a> Coloring<'a> {
    /// Adds the first few, up to `count`, of some places of a triangle, which are `number` and those
    /// after it. Red, green and blue of a place, and 255, go to `put` with its number sooner or later; see
    /// [`Model::color`](super::Model::color).
    #[inline(always)]
    pub fn add(
        &mut self,
        skin: &Skin<'a>,
        places: &Neighbours,
        number: u32,
        count: usize,
        put: &mut impl FnMut(u32, [u8; 4]),
    ) {
        // 1. Colours without the texture, where in it they are, and which of its levels suit.
        // Without branches, so that they may become vector instructions.
        let (mut colors, mut uvs) = ([[0.0; FEW]; 3], [[0.0; FEW]; 2]);
        for k in 0..FEW {
            let (b, c) = (places.second[k] as f32, places.third[k] as f32);
            for i in 0..3 {
                let [first, second, third] = [0, 1, 2].map(
                    #[inline(always)]
                    |corner| skin.colors[corner][i],
                );
                colors[i][k] = first + b * second + c * third;
            }
        }
        for i in 0..2 {
            let [first, second, third] = [0, 1, 2].map(
                #[inline(always)]
                |corner| skin.uvs[corner][i],
            );
            let mut at = [0.0; FEW];
            for k in 0..FEW {
                at[k] = first + places.second[k] * second + places.third[k] * third;
            }
            uvs[i] = within(&at, skin.wraps[i]);
        }
        let last = (skin.levels.len() - 1) as f32;
        let (mut fine, mut shares) = ([0; FEW], [0.0; FEW]);
        for k in 0..FEW {
            let level = level_of((places.footprint[k] * skin.texel_area) as f32);
            let level = level.max(0.0).min(last);
            let finer = level.floor();
            fine[k] = whole(finer);
            shares[k] = level - finer;
        }
        // 2. To those of the same level.
        let mut from = 0;
        while from < count {
            let level = fine[from];
            let mut to = from + 1;
            while to < count && fine[to] == level {
                to += 1;
            }
            let key = skin.key | level;
            let places = &mut self.open[(key ^ key >> (LEVEL_BITS + SIDE_BITS)) as usize % OPEN];
            if places.key != key || places.count + FEW > MOST {
                places.finish(put);
                places.begin(skin, key);
            }
            let start = places.count;
            if from == 0 {
                // All of them: what is beyond is overwritten, or of no use.
                for i in 0..3 {
                    places.colors[i][start..start + FEW].copy_from_slice(&colors[i]);
                }
                for i in 0..2 {
                    places.uvs[i][start..start + FEW].copy_from_slice(&uvs[i]);
                }
                places.shares[start..start + FEW].copy_from_slice(&shares);
                for k in 0..FEW {
                    places.numbers[start + k] = number + k as u32;
                }
            } else {
                for k in from..to {
                    let here = start + k - from;
                    for i in 0..3 {
                        places.colors[i][here] = colors[i][k];
                    }
                    for i in 0..2 {
                        places.uvs[i][here] = uvs[i][k];
                    }
                    places.shares[here] = shares[k];
                    places.numbers[here] = number + k as u32;
                }
            }
            places.count += to - from;
            from = to;
        }
    }

    /// Colours those that still wait.
    #[inline(always)]
    pub fn finish(&mut self, put: &mut impl FnMut(u32, [u8; 4])) {
        for places in &mut self.open {
            places.finish(put);
        }
    }
}

impl<'a> Places<'a> {
    /// Takes places of a skin's texture at the level that a key says.
    #[inline(always)]
    fn begin(&mut self, skin: &Skin<'a>, key: u32) {
        let level = (key & ((1 << LEVEL_BITS) - 1)) as usize;
        let last = skin.levels.len() - 1;
        self.key = key;
        self.texels = skin.texels;
        self.levels = [level, (level + 1).min(last)].map(|i| skin.levels[i]);
        self.is_repeated = [0, 1].map(|k| key >> (LEVEL_BITS + k) & 1 != 0);
    }

    /// Colours what waits.
    #[inline(always)]
    fn finish(&mut self, put: &mut impl FnMut(u32, [u8; 4])) {
        if self.count == 0 {
            return;
        }
        // Loops over all, as of fixed length they are compiled to vector instructions.
        let colors = self.colors();
        let mut codes = [0; MOST];
        for i in 0..MOST {
            let [r, g, b] = [0, 1, 2].map(
                #[inline(always)]
                |k| {
                    // What is no number is black.
                    let rounded = (colors[k][i] + 0.5).max(0.0);
                    whole(rounded.min(255.0).floor())
                },
            );
            codes[i] = r | g << 8 | b << 16 | 255 << 24;
        }
        for i in 0..self.count.min(MOST) {
            put(self.numbers[i], codes[i].to_le_bytes());
        }
        self.count = 0;
    }

    /// Red, green and blue of what waits: sRGB codes, 0 to 255.
    #[inline(always)]
    fn colors(&self) -> [[f32; MOST]; 3] {
        let mut colors = self.colors;
        if self.key != PLAIN {
            let mut texels = self.of_level(&self.levels[0]);
            let shares = &self.shares[..self.count];
            if shares.iter().fold(false, |any, share| any | (*share > 0.0)) {
                let coarse = self.of_level(&self.levels[1]);
                for (texel, coarse) in texels.iter_mut().zip(&coarse) {
                    for i in 0..MOST {
                        texel[i] += self.shares[i] * (coarse[i] - texel[i]);
                    }
                }
            }
            for (color, texel) in colors.iter_mut().zip(&texels) {
                for i in 0..MOST {
                    color[i] *= texel[i] * (1.0 / 255.0);
                }
            }
        }
        colors
    }

    /// The texture's colours at a level.
    #[inline(always)]
    fn of_level(&self, level: &Level) -> [[f32; MOST]; 3] {
        let [width, height] = [level.width, level.height];
        let texels = &self.texels[level.first as usize..][..(width * height) as usize];
        // 1. Which four texels, row by row, and the second column's and the second row's shares.
        let mut idxs = [[0; MOST]; 4];
        let mut shares = [[0.0; MOST]; 2];
        for i in 0..MOST {
            let (columns, across) = around(self.uvs[0][i], width as f32, self.is_repeated[0]);
            let (rows, down) = around(self.uvs[1][i], height as f32, self.is_repeated[1]);
            let [above, below] = rows.map(
                #[inline(always)]
                |row| row * width,
            );
            idxs[0][i] = above + columns[0];
            idxs[1][i] = above + columns[1];
            idxs[2][i] = below + columns[0];
            idxs[3][i] = below + columns[1];
            (shares[0][i], shares[1][i]) = (across, down);
        }
        // 2. The texels.
        let mut codes = [[0; MOST]; 4];
        for i in 0..self.count.min(MOST) {
            for k in 0..4 {
                codes[k][i] = u32::from_le_bytes(texels[idxs[k][i] as usize]);
            }
        }
        // 3. Between them.
        let mut colors = [[0.0; MOST]; 3];
        let [across, down] = &shares;
        let [a, b, c, d] = &codes;
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

/// Where between a texture's sides, 0 to 1, it looks as at some places: found in f64, as places may be
/// far from it.
#[inline(always)]
fn within(at: &[f64; FEW], wrap: Wrap) -> [f32; FEW] {
    let mut within = [0.0; FEW];
    match wrap {
        Wrap::Repeat => {
            for k in 0..FEW {
                within[k] = (at[k] - at[k].floor()) as f32;
            }
        }
        Wrap::Mirror => {
            for k in 0..FEW {
                let twice = at[k] - 2.0 * (0.5 * at[k]).floor();
                within[k] = twice.min(2.0 - twice) as f32;
            }
        }
        Wrap::Clamp => {
            for k in 0..FEW {
                within[k] = at[k].clamp(0.0, 1.0) as f32;
            }
        }
    }
    within
}

/// The two columns (or rows) of a texture around a place between its sides, 0 to 1, of so many texels,
/// and the second's share. Whatever the place is, the texture has them.
#[inline(always)]
fn around(at: f32, count: f32, is_repeated: bool) -> ([u32; 2], f32) {
    let last = count - 1.0;
    let x = at * count - 0.5;
    // Beyond the outermost texels' middles is what they show.
    let x = if is_repeated { x } else { x.max(0.0).min(last) };
    let first = x.floor();
    let beyond = if is_repeated { 0.0 } else { last };
    let next = if first < last { first + 1.0 } else { beyond };
    let before = if first < 0.0 { last } else { first };
    // Rounding and what is no number keep within range.
    let kept = [before, next].map(
        #[inline(always)]
        |texel| whole(texel.max(0.0).min(last)),
    );
    (kept, x - first)
}

/// A whole number of at least 0 and less than 2²³ as an integer. (A cast says what becomes of others,
/// too, and is done one by one.)
#[inline(always)]
fn whole(x: f32) -> u32 {
    // Beyond 2²³ numbers have no digits for fractions.
    const SHIFT: f32 = (1 << 23) as f32;
    (x + SHIFT).to_bits() & ((1 << 23) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Material, Mesh, Model, Part, Texture};
    use glam::DVec3;

    #[test]
    fn colours_before_they_are_rounded_are_those_of_the_model() {
        // Of texture coordinates far beyond its sides.
        let picture = image::RgbaImage::from_fn(5, 3, |x, y| {
            let code = |i: u32| ((x * 89 + y * 57 + i * 101 + x * y * 31) % 256) as u8;
            image::Rgba([code(0), code(1), code(2), 255])
        });
        let wraps = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];
        for wrap in wraps.iter().flat_map(|u| wraps.map(|v| [*u, v])) {
            let model = Model {
                mesh: Mesh {
                    positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
                    triangles: vec![[0, 1, 2]],
                },
                uvs: vec![[-2.3, 7.1], [3.9, -1.2], [0.4, 11.7]],
                colors: vec![[250, 10, 120, 255], [30, 255, 60, 255], [90, 70, 255, 255]],
                parts: vec![Part {
                    triangles: 0..1,
                    node_idx: 0,
                    material_idx: 0,
                }],
                materials: vec![Material {
                    base_color: [0.9, 1.0, 0.7],
                    texture_idx: Some(0),
                    wrap,
                }],
                textures: vec![Texture::new(picture.clone())],
                ..Model::default()
            };
            let skin = Skin::new(&model, model.part_of(0), 0);
            let mut waiting = Coloring::default();
            let places = |i: usize, j: usize| Neighbours {
                second: [i as f64 / 20.0; FEW],
                third: [j as f64 / 20.0; FEW],
                footprint: [0.0, 0.001, 0.02, 1e9],
            };
            for (i, j) in (0..=20).flat_map(|i| (0..=20 - i).map(move |j| (i, j))) {
                let mut put = |_, _| panic!("there is room for all");
                waiting.add(&skin, &places(i, j), 0, FEW, &mut put);
                let mut seen = 0;
                for open in waiting.open.iter_mut().filter(|open| open.count > 0) {
                    let colors = open.colors();
                    for k in 0..open.count {
                        let n = open.numbers[k] as usize;
                        let place = places(i, j);
                        let [b, c] = [place.second[n], place.third[n]];
                        let expected = model.color(0, [1.0 - b - c, b, c], place.footprint[n]);
                        for channel in 0..3 {
                            let found = f64::from(colors[channel][k]);
                            assert!(
                                (found - expected[channel]).abs() < 1e-3,
                                "{wrap:?} {i} {j} {n}: {found} for {expected:?}"
                            );
                        }
                    }
                    seen += open.count;
                    open.count = 0;
                }
                assert_eq!(seen, FEW);
            }
        }
    }

    #[test]
    fn textures_go_on_beyond_their_sides_as_they_should() {
        let around = |wrap: Wrap, at: f64, n: u32| {
            let [at, ..] = within(&[at; FEW], wrap);
            around(at, n as f32, wrap == Wrap::Repeat)
        };
        let at = |wrap: Wrap, i: f64, n: u32| {
            let (texels, share) = around(wrap, (i + 0.5) / f64::from(n), n);
            assert!(texels.iter().all(|texel| *texel < n));
            let [a, b] = texels.map(f64::from);
            a + f64::from(share) * (b - a)
        };
        let three = |wrap: Wrap| [-2.0, -1.0, 0.0, 2.0, 3.0, 4.0].map(|i| at(wrap, i, 3).round());
        assert_eq!(three(Wrap::Repeat), [1.0, 2.0, 0.0, 2.0, 0.0, 1.0]);
        assert_eq!(three(Wrap::Mirror), [1.0, 0.0, 0.0, 2.0, 2.0, 1.0]);
        assert_eq!(three(Wrap::Clamp), [0.0, 0.0, 0.0, 2.0, 2.0, 2.0]);
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for far in [1e300, -1e300, f64::INFINITY, f64::NAN] {
                let (texels, _) = around(wrap, far, 3);
                assert!(texels.iter().all(|texel| *texel < 3));
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
