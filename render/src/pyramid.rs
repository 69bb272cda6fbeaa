//! A photo as it is sampled: premultiplied, with mip levels.

use crate::mask::Mask;
use image::{GrayImage, ImageBuffer, Pixel, Rgba, RgbaImage};
use std::fmt;

/// A decoded photo and its mip levels.
///
/// Texel (i, j) of level l covers pixels i·2ˡ…(i+1)·2ˡ of the photo exactly, as far as they are within it, whatever
/// its size. An odd last row or column of each level pairs with itself. Colour is premultiplied by alpha.
#[derive(Clone, PartialEq, Eq)]
pub struct Pyramid {
    /// Level 0 is the photo. Those finer than [`Self::finest`] are empty.
    pub levels: Vec<RgbaImage>,
    /// The finest level that is there; samples of finer ones come from it.
    pub finest: usize,
    /// Whether every pixel is opaque.
    pub opaque: bool,
}

/// Mip levels at most: a footprint of 64 × 64 pixels.
pub const MAX_LEVELS: usize = 7;

impl Pyramid {
    /// Builds the levels of a photo with straight alpha.
    pub fn new(photo: RgbaImage) -> Self {
        let (photo, opaque) = premultiplied(photo);
        let mut levels = vec![photo];
        while levels.len() < MAX_LEVELS && levels[levels.len() - 1].dimensions() != (1, 1) {
            levels.push(halve(&levels[levels.len() - 1], |_| 1));
        }
        Self {
            levels,
            finest: 0,
            opaque,
        }
    }

    /// Builds the levels of a photo with straight alpha, of which some is to be ignored.
    ///
    /// What is ignored takes on the colours around it, and coarser levels are means of what
    /// is not ignored: filtering never mixes in anything that the mask hides.
    ///
    /// # Panics
    /// If the sizes differ.
    pub fn masked(photo: RgbaImage, mask: &Mask) -> Self {
        assert_eq!(photo.dimensions(), mask.levels[0].dimensions());
        let (photo, opaque) = premultiplied(photo);
        // 1. Means by weight, from fine to coarse.
        let mut levels = vec![photo];
        for mask in &mask.levels[..mask.levels.len() - 1] {
            let weights = mask.as_raw();
            levels.push(halve(&levels[levels.len() - 1], |i| u32::from(weights[i])));
        }
        // 2. What is ignored, from coarse to fine; at first the mean of the whole.
        let coarsest = levels.len() - 1;
        let mean = mean_by(&levels[coarsest], &mask.levels[coarsest]);
        for level in (0..levels.len()).rev() {
            let (fine, coarse) = levels.split_at_mut(level + 1);
            let weights = mask.levels[level].pixels();
            for ((x, y, texel), weight) in fine[level].enumerate_pixels_mut().zip(weights) {
                if weight.0[0] == 0 {
                    *texel = coarse.first().map_or(mean, |c| *c.get_pixel(x / 2, y / 2));
                }
            }
        }
        Self {
            levels,
            finest: 0,
            opaque,
        }
    }

    /// The same without the levels finer than `level`, or than its coarsest.
    #[must_use]
    pub fn from_level(&self, level: usize) -> Self {
        let finest = self.finest.max(level.min(self.levels.len() - 1));
        let kept = |(level, image): (usize, &RgbaImage)| match level < finest {
            true => RgbaImage::new(0, 0),
            false => image.clone(),
        };
        Self {
            levels: self.levels.iter().enumerate().map(kept).collect(),
            finest,
            opaque: self.opaque,
        }
    }

    /// Bytes held in memory.
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(|l| l.as_raw().len()).sum()
    }

    /// Bytes that a photo of so many pixels takes with all its levels, which are rounded up where it is odd.
    pub fn bytes_of(width: u32, height: u32) -> u64 {
        texels(halved_sizes(width, height).take(MAX_LEVELS)).saturating_mul(4)
    }
}

/// Width and height of what is so large, of that halved, and so on to a single texel.
pub(crate) fn halved_sizes(width: u32, height: u32) -> impl Iterator<Item = (u32, u32)> {
    let halved = |&(width, height): &(u32, u32)| {
        (width > 1 || height > 1).then(|| (width.div_ceil(2), height.div_ceil(2)))
    };
    std::iter::successors(Some((width, height)), halved)
}

/// Texels of images of these sizes, together.
pub(crate) fn texels(sizes: impl Iterator<Item = (u32, u32)>) -> u64 {
    let areas = sizes.map(|(width, height)| u64::from(width) * u64::from(height));
    areas.fold(0, u64::saturating_add)
}

impl fmt::Debug for Pyramid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (width, height) = self.levels[self.finest].dimensions();
        write!(
            f,
            "Pyramid({width} × {height}, levels {} to {})",
            self.finest,
            self.levels.len() - 1
        )
    }
}

/// The photo with its colours premultiplied by its alpha, and whether that is one all over.
fn premultiplied(mut photo: RgbaImage) -> (RgbaImage, bool) {
    let opaque = photo.pixels().all(|p| p.0[3] == 255);
    if !opaque {
        for pixel in photo.pixels_mut() {
            let [r, g, b, a] = pixel.0.map(u32::from);
            let times_alpha = |v: u32| ((v * a + 127) / 255) as u8;
            pixel.0 = [times_alpha(r), times_alpha(g), times_alpha(b), a as u8];
        }
    }
    (photo, opaque)
}

/// Averages 2 × 2 texels by the weights of their indices, alike where all are zero; an odd
/// last row or column pairs with itself. Ties are rounded to even numbers: upwards, each level would be an eighth of
/// a step brighter than the one before.
pub(crate) fn halve<P: Pixel<Subpixel = u8>>(
    image: &ImageBuffer<P, Vec<u8>>,
    weight: impl Fn(usize) -> u32,
) -> ImageBuffer<P, Vec<u8>> {
    let (width, height) = image.dimensions();
    let channels = usize::from(P::CHANNEL_COUNT);
    let texels = image.as_raw();
    let (half_width, half_height) = (width.div_ceil(2), height.div_ceil(2));
    let mut half = Vec::with_capacity(half_width as usize * half_height as usize * channels);
    for y in 0..half_height {
        let top = 2 * y as usize * width as usize;
        let bottom = (2 * y + 1).min(height - 1) as usize * width as usize;
        for x in 0..half_width {
            let left = 2 * x as usize;
            let right = (2 * x + 1).min(width - 1) as usize;
            let four = [top + left, top + right, bottom + left, bottom + right];
            let mut weights = four.map(&weight);
            if weights == [0; 4] {
                weights = [1; 4];
            }
            let total: u32 = weights.iter().sum();
            for c in 0..channels {
                let value = |k: usize| weights[k] * u32::from(texels[four[k] * channels + c]);
                let sum: u32 = (0..4).map(value).sum();
                let (whole, twice_rest) = (sum / total, 2 * (sum % total));
                half.push((whole + u32::from(twice_rest + (whole & 1) > total)) as u8);
            }
        }
    }
    ImageBuffer::from_raw(half_width, half_height, half).expect("the size was computed above")
}

/// The mean colour by the weights of a mask; black where all are zero.
fn mean_by(image: &RgbaImage, mask: &GrayImage) -> Rgba<u8> {
    let mut sums = [0_u64; 4];
    let mut total = 0;
    for (texel, weight) in image.pixels().zip(mask.pixels()) {
        let weight = u64::from(weight.0[0]);
        total += weight;
        (0..4).for_each(|c| sums[c] += weight * u64::from(texel.0[c]));
    }
    Rgba(sums.map(|sum| (sum / total.max(1)) as u8))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_average_and_odd_borders_repeat() {
        let photo = RgbaImage::from_fn(3, 2, |x, y| Rgba([(x * 10 + y * 100) as u8, 0, 0, 255]));
        let pyramid = Pyramid::new(photo);
        let sizes: Vec<_> = pyramid.levels.iter().map(RgbaImage::dimensions).collect();
        assert_eq!(sizes, [(3, 2), (2, 1), (1, 1)]);
        assert_eq!(pyramid.levels[1].get_pixel(0, 0).0, [55, 0, 0, 255]);
        assert_eq!(pyramid.levels[1].get_pixel(1, 0).0, [70, 0, 0, 255]);
    }

    #[test]
    fn what_a_photo_and_its_mask_take_is_known_before_they_are_decoded() {
        for (width, height) in [(1, 1), (2, 1), (3, 500), (101, 77), (333, 251), (640, 512)] {
            let photo = Pyramid::new(RgbaImage::new(width, height));
            assert_eq!(Pyramid::bytes_of(width, height), photo.bytes() as u64);
            let mask = Mask::new(GrayImage::new(width, height));
            assert_eq!(Mask::bytes_of(width, height), mask.bytes() as u64);
        }
    }

    #[test]
    fn levels_are_as_bright_as_the_photo() {
        let mut state = 5_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        let photo = RgbaImage::from_fn(256, 256, |_, _| Rgba([random(), random(), random(), 255]));
        let pyramid = Pyramid::new(photo);
        let mean = |level: &RgbaImage| {
            let colors = level.pixels().flat_map(|p| p.0.into_iter().take(3));
            colors.map(f64::from).sum::<f64>() / (3.0 * f64::from(level.width() * level.height()))
        };
        for level in &pyramid.levels[1..5] {
            let off = mean(level) - mean(&pyramid.levels[0]);
            assert!(off.abs() < 0.05, "{off}");
        }
    }

    #[test]
    fn alpha_is_premultiplied() {
        let pyramid = Pyramid::new(RgbaImage::from_pixel(2, 2, Rgba([200, 100, 0, 128])));
        assert!(!pyramid.opaque);
        assert_eq!(pyramid.levels[0].get_pixel(0, 0).0, [100, 50, 0, 128]);
    }

    #[test]
    fn what_a_mask_hides_bleeds_into_no_level() {
        // Red to be used, and blue to be ignored: a block, a single pixel, a whole corner.
        let hidden = |x: u32, y: u32| (x > 40 && y > 30) || (9..13).contains(&x) || x * y == 6;
        let photo = RgbaImage::from_fn(101, 77, |x, y| match hidden(x, y) {
            true => Rgba([0, 0, 255, 255]),
            false => Rgba([200, 0, 0, 255]),
        });
        let mask = GrayImage::from_fn(101, 77, |x, y| image::Luma([u8::from(!hidden(x, y)) * 255]));
        let pyramid = Pyramid::masked(photo.clone(), &Mask::new(mask));
        assert_eq!(pyramid.levels.len(), MAX_LEVELS);
        for level in &pyramid.levels {
            assert!(level.pixels().all(|p| p.0 == [200, 0, 0, 255]));
        }
        // One that hides nothing changes nothing.
        let whole = Mask::new(GrayImage::from_pixel(101, 77, image::Luma([255])));
        assert!(Pyramid::masked(photo.clone(), &whole) == Pyramid::new(photo));
    }

    #[test]
    fn without_its_finest_levels_the_others_are_as_they_were() {
        let photo = RgbaImage::from_fn(37, 21, |x, y| Rgba([x as u8, y as u8, 9, 255]));
        let whole = Pyramid::new(photo);
        assert_eq!(whole.from_level(0), whole);
        let coarse = whole.from_level(2);
        assert_eq!((coarse.finest, coarse.levels.len()), (2, 7));
        assert_eq!(coarse.levels[2..], whole.levels[2..]);
        assert_eq!(coarse.levels[1].dimensions(), (0, 0));
        assert!(coarse.bytes() < whole.bytes() / 10);
        // Nothing brings levels back, and the last one stays.
        assert_eq!(coarse.from_level(1), coarse);
        assert_eq!(whole.from_level(99).finest, 6);
    }
}
