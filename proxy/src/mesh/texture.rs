//! Pictures on surfaces, at the sizes that they are seen at.

use super::linear_from_srgb;
use super::model::srgb_from_linear;
use image::RgbaImage;
use std::sync::LazyLock;

/// A picture and smaller ones of it, sRGB: each level is half as wide and high as the one before, down
/// to one texel, and each of its texels the mean of those under it in linear light (Williams 1983,
/// "Pyramidal parametrics").
#[derive(Clone, Default, PartialEq)]
pub struct Texture {
    /// Level by level, each row by row.
    bytes: Vec<u8>,
    levels: Vec<Level>,
}

/// A level of a [`Texture`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Level {
    /// Its first texel, in the texels of all levels.
    pub first: u32,
    /// Texels across.
    pub width: u32,
    /// Texels down.
    pub height: u32,
}

/// Steps of linear light, each with its sRGB code.
const STEPS: usize = 1 << 16;

impl Texture {
    /// Makes the smaller ones. A picture without pixels has no levels.
    pub fn new(picture: RgbaImage) -> Self {
        let (width, height) = picture.dimensions();
        if width == 0 || height == 0 {
            return Self::default();
        }
        // 1. Where they are, so that memory is asked for once.
        let mut levels = vec![Level {
            first: 0,
            width,
            height,
        }];
        let mut last = levels[0];
        while last.width > 1 || last.height > 1 {
            let [width, height] = [last.width, last.height].map(|n| n.max(2) / 2);
            let first = last.first + last.width * last.height;
            last = Level {
                first,
                width,
                height,
            };
            levels.push(last);
        }
        // 2. Each of the one before, as light that was not rounded to codes.
        let mut bytes = picture.into_raw();
        bytes.reserve_exact(4 * (last.first as usize + 1) - bytes.len());
        let mut light: Vec<[f32; 4]> = Vec::new();
        for pair in levels.windows(2) {
            light = match light.is_empty() {
                true => halved(|i| light_of(bytes.as_chunks().0[i]), pair),
                false => halved(|i| light[i], pair),
            };
            bytes.extend(light.iter().flat_map(|light| code_of(*light)));
        }
        Self { bytes, levels }
    }

    /// Red, green, blue and what is of no use, of all levels.
    #[inline]
    pub fn texels(&self) -> &[[u8; 4]] {
        self.bytes.as_chunks().0
    }

    /// From the finest on.
    #[inline]
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// The finest level.
    pub fn picture(&self) -> RgbaImage {
        let (width, height) = match self.levels.first() {
            Some(level) => (level.width, level.height),
            None => (0, 0),
        };
        let bytes = &self.bytes[..4 * width as usize * height as usize];
        RgbaImage::from_raw(width, height, bytes.to_vec()).expect("four bytes a texel")
    }
}

impl std::fmt::Debug for Texture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Texture({:?})", self.levels)
    }
}

/// The level that a pixel should be taken from which covers so many of the finest level's texels: 0 for
/// one, one more for each four times as many, and in between the line through those, so that it changes
/// without a step; below 0 for fewer than one.
///
/// A pixel that is long and narrow on the surface is taken for a square as large: finer
/// across it than it could be, coarser along it than it should.
#[inline(always)]
pub(super) fn level_of(texels: f32) -> f32 {
    // The bits of a number are its logarithm, but for what lies between powers of two.
    let log2 = texels.to_bits().wrapping_sub(1.0_f32.to_bits()) as i32;
    log2 as f32 * (0.5 / (1 << 23) as f32)
}

/// A level of the one before it: means of two columns and two rows, or of three where there is an odd
/// one, as much of each as lies under the new texel.
fn halved(light: impl Fn(usize) -> [f32; 4], pair: &[Level]) -> Vec<[f32; 4]> {
    let [old, new] = [pair[0], pair[1]].map(|level| [level.width, level.height]);
    let [old, new] = [old, new].map(|size| size.map(|n| n as usize));
    let shares = [0, 1].map(|axis| under(old[axis], new[axis]));
    let mut halved = Vec::with_capacity(new[0] * new[1]);
    for (top, down) in &shares[1] {
        for (left, across) in &shares[0] {
            let mut sum = [0.0; 4];
            for (y, down) in down.iter().enumerate().filter(|(_, share)| **share > 0.0) {
                for (x, across) in across.iter().enumerate().filter(|(_, s)| **s > 0.0) {
                    let light = light((top + y) * old[0] + left + x);
                    for k in 0..4 {
                        sum[k] += down * across * light[k];
                    }
                }
            }
            halved.push(sum);
        }
    }
    halved
}

/// Of each of so many new columns (or rows) the first old one under it, and how much of it is that
/// one, the next and the one after.
fn under(old: usize, new: usize) -> Vec<(usize, [f32; 3])> {
    let ratio = old as f64 / new as f64;
    let of = |i: usize| {
        let (from, to) = (i as f64 * ratio, (i + 1) as f64 * ratio);
        let first = from.floor();
        let share = |k: usize| {
            let left = first + k as f64;
            ((to.min(left + 1.0) - from.max(left)).max(0.0) / ratio) as f32
        };
        (first as usize, [share(0), share(1), share(2)])
    };
    (0..new).map(of).collect()
}

fn light_of([r, g, b, a]: [u8; 4]) -> [f32; 4] {
    static LIGHT: LazyLock<Vec<f32>> = LazyLock::new(|| {
        let code = |code: u16| linear_from_srgb(f64::from(code) / 255.0) as f32;
        (0..256).map(code).collect()
    });
    let light = |code: u8| LIGHT[usize::from(code)];
    [light(r), light(g), light(b), f32::from(a)]
}

fn code_of([r, g, b, a]: [f32; 4]) -> [u8; 4] {
    static CODES: LazyLock<Vec<u8>> = LazyLock::new(|| {
        let light = |step: usize| step as f64 / (STEPS - 1) as f64;
        let code = |step| (255.0 * srgb_from_linear(light(step))).round() as u8;
        (0..STEPS).map(code).collect()
    });
    let code = |light: f32| CODES[((light * (STEPS - 1) as f32 + 0.5) as usize).min(STEPS - 1)];
    [code(r), code(g), code(b), (a + 0.5) as u8]
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgba;

    #[test]
    fn levels_are_halves_and_keep_the_mean_light() {
        for (width, height) in [(1, 1), (8, 8), (7, 5), (1, 6), (300, 2)] {
            let picture = RgbaImage::from_fn(width, height, |x, y| {
                Rgba([(37 * x + 11 * y) as u8, (x * y) as u8, 200, 255])
            });
            let texture = Texture::new(picture.clone());
            assert_eq!(texture.picture(), picture);
            let mean = |level: &Level| {
                let from = level.first as usize;
                let count = (level.width * level.height) as usize;
                let light = texture.texels()[from..from + count].iter();
                let sum: f64 = light.map(|t| f64::from(light_of(*t)[0])).sum();
                sum / count as f64
            };
            let levels = texture.levels();
            let last = levels.last().unwrap();
            assert_eq!((last.width, last.height), (1, 1));
            assert_eq!(last.first as usize + 1, texture.texels().len());
            for pair in levels.windows(2) {
                let [a, b] = [pair[0], pair[1]];
                assert_eq!(
                    [b.width, b.height],
                    [a.width, a.height].map(|n| n.max(2) / 2)
                );
                assert_eq!(b.first, a.first + a.width * a.height);
                // But for rounding to codes.
                let (fine, coarse) = (mean(&levels[0]), mean(&b));
                assert!((fine - coarse).abs() < 4e-3, "{fine} {coarse}");
            }
        }
        assert!(Texture::new(RgbaImage::new(0, 3)).levels().is_empty());
    }

    #[test]
    fn levels_go_up_by_one_for_four_times_the_texels() {
        for i in -3..12 {
            assert_eq!(level_of(4.0_f32.powi(i)), i as f32);
        }
        let mut last = f32::NEG_INFINITY;
        for i in 1..4000 {
            let texels = 1e-2 * 1.004_f32.powi(i);
            let level = level_of(texels);
            assert!(level > last && (level - 0.5 * texels.log2()).abs() < 0.05);
            last = level;
        }
        assert!(level_of(0.0) < -50.0 && level_of(f32::INFINITY) > 50.0);
        assert!(level_of(f32::NAN) > 50.0);
    }
}
