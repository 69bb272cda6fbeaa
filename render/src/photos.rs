//! Photos as the engine samples them: decoded when first needed, premultiplied, with mip
//! levels.

use crate::mask::Mask;
use image::{GrayImage, ImageBuffer, Pixel, Rgba, RgbaImage};
use std::fmt;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

/// A decoded photo and its mip levels.
///
/// Texel (i, j) of level l covers pixels i·2ˡ…(i+1)·2ˡ of the photo exactly, whatever its
/// size; what would lie outside repeats the border. Colour is premultiplied by alpha.
#[derive(Clone, PartialEq, Eq)]
pub struct Pyramid {
    /// Level 0 is the photo.
    pub levels: Vec<RgbaImage>,
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
        Self { levels, opaque }
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
        Self { levels, opaque }
    }

    /// Bytes held in memory.
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(|l| l.as_raw().len()).sum()
    }
}

impl fmt::Debug for Pyramid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (width, height) = self.levels[0].dimensions();
        write!(
            f,
            "Pyramid({width} × {height}, {} levels)",
            self.levels.len()
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
/// last row or column pairs with itself.
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
                half.push(((sum + total / 2) / total) as u8);
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

/// Why a photo could not be had.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct PhotoError {
    /// Which source view.
    pub source_idx: usize,
    /// What is wrong, naming the file.
    pub message: String,
}

type Load<T> = dyn Fn(usize) -> Result<T, String> + Send + Sync;

/// The photos of a lumigraph and their ignore masks, each decoded when it is first asked
/// for and then kept.
pub struct PhotoStore {
    slots: Vec<OnceLock<Result<Pyramid, PhotoError>>>,
    load: Box<Load<RgbaImage>>,
    /// By source view, where any has a mask.
    masks: Vec<Option<OnceLock<Result<Mask, PhotoError>>>>,
    load_mask: Box<Load<GrayImage>>,
    /// Stands in for a mask that cannot be decoded.
    nothing: Mask,
    decoded: AtomicUsize,
    id: u64,
}

impl PhotoStore {
    /// A store of `count` photos. `load` decodes one by its source view's index, or says
    /// what is wrong, naming the file.
    pub fn new(
        count: usize,
        load: impl Fn(usize) -> Result<RgbaImage, String> + Send + Sync + 'static,
    ) -> Self {
        let slots = (0..count).map(|_| OnceLock::new()).collect();
        static NEXT_ID: AtomicU64 = AtomicU64::new(0);
        let id = NEXT_ID.fetch_add(1, Ordering::Relaxed);
        Self {
            slots,
            load: Box::new(load),
            masks: Vec::new(),
            load_mask: Box::new(|_| Err("there is no mask".to_owned())),
            nothing: Mask::nothing(),
            decoded: AtomicUsize::new(0),
            id,
        }
    }

    /// A store of photos already in memory.
    pub fn from_images(photos: Vec<RgbaImage>) -> Self {
        let count = photos.len();
        Self::new(count, move |i| Ok(photos[i].clone()))
    }

    /// The store with ignore masks (0 = ignore, 255 = use, as large as their photos) for the
    /// source views of which `masked` says so. `load` decodes one, or says what is wrong,
    /// naming the file.
    ///
    /// # Panics
    /// If `masked` does not hold one entry for each photo.
    pub fn with_masks(
        mut self,
        masked: &[bool],
        load: impl Fn(usize) -> Result<GrayImage, String> + Send + Sync + 'static,
    ) -> Self {
        assert_eq!(masked.len(), self.slots.len());
        if masked.contains(&true) {
            let slot = |&masked: &bool| masked.then(OnceLock::new);
            self.masks = masked.iter().map(slot).collect();
        }
        self.load_mask = Box::new(load);
        self
    }

    /// How many photos there are.
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Tells this store from every other in the program, for caches.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// How many have been decoded.
    pub fn decoded(&self) -> usize {
        self.decoded.load(Ordering::Relaxed)
    }

    /// Bytes held by decoded photos.
    pub fn bytes(&self) -> usize {
        let photos = self.slots.iter().filter_map(|s| s.get()?.as_ref().ok());
        let masks = self.masks.iter().flatten();
        let masks = masks.filter_map(|m| m.get()?.as_ref().ok());
        photos.map(Pyramid::bytes).sum::<usize>() + masks.map(Mask::bytes).sum::<usize>()
    }

    /// Whether any source view has an ignore mask.
    pub fn any_masked(&self) -> bool {
        !self.masks.is_empty()
    }

    /// Whether a source view has an ignore mask.
    pub fn is_masked(&self, source_idx: usize) -> bool {
        self.masks.get(source_idx).is_some_and(Option::is_some)
    }

    /// The ignore mask of a source view, if it has one. One that cannot be decoded ignores
    /// the whole photo, so that nothing is painted that it would hide;
    /// [`Self::check_masks`] tells.
    pub fn mask(&self, source_idx: usize) -> Option<&Mask> {
        self.try_mask(source_idx).unwrap_or(Some(&self.nothing))
    }

    /// The ignore mask of a source view, if it has one.
    ///
    /// # Errors
    /// It cannot be decoded.
    pub fn try_mask(&self, source_idx: usize) -> Result<Option<&Mask>, PhotoError> {
        let Some(Some(slot)) = self.masks.get(source_idx) else {
            return Ok(None);
        };
        let failed = |message| PhotoError {
            source_idx,
            message,
        };
        let load = || (self.load_mask)(source_idx).map(Mask::new).map_err(failed);
        slot.get_or_init(load)
            .as_ref()
            .map(Some)
            .map_err(Clone::clone)
    }

    /// Whether every mask that was asked for could be decoded.
    ///
    /// # Errors
    /// The first of those that could not.
    pub fn check_masks(&self) -> Result<(), PhotoError> {
        let mut asked = self.masks.iter().flatten().filter_map(OnceLock::get);
        match asked.find_map(|mask| mask.as_ref().err()) {
            Some(error) => Err(error.clone()),
            None => Ok(()),
        }
    }

    /// The photo of a source view.
    ///
    /// # Errors
    /// It or its ignore mask cannot be decoded, or their sizes differ; every later call
    /// says the same.
    pub fn get(&self, source_idx: usize) -> Result<&Pyramid, PhotoError> {
        let slot = self.slots[source_idx].get_or_init(|| {
            self.decoded.fetch_add(1, Ordering::Relaxed);
            self.decode(source_idx)
        });
        slot.as_ref().map_err(Clone::clone)
    }

    /// The photo of a source view, decoded anew and not kept.
    ///
    /// # Errors
    /// It cannot be decoded.
    pub fn decode(&self, source_idx: usize) -> Result<Pyramid, PhotoError> {
        let failed = |message| PhotoError {
            source_idx,
            message,
        };
        let photo = (self.load)(source_idx).map_err(failed)?;
        let Some(mask) = self.try_mask(source_idx)? else {
            return Ok(Pyramid::new(photo));
        };
        let (size, of_mask) = (photo.dimensions(), mask.levels[0].dimensions());
        if size != of_mask {
            return Err(failed(format!(
                "the photo has {} × {} pixels and its ignore mask {} × {}; make the mask \
                 as large as the photo",
                size.0, size.1, of_mask.0, of_mask.1
            )));
        }
        Ok(Pyramid::masked(photo, mask))
    }
}

impl fmt::Debug for PhotoStore {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "PhotoStore({} of {} decoded)",
            self.decoded(),
            self.len()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgba;

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
    fn a_mask_that_cannot_be_decoded_ignores_all_and_tells() {
        let store = PhotoStore::new(3, |_| Ok(RgbaImage::new(4, 4)));
        let store = store.with_masks(&[true, false, true], |i| match i {
            0 => Ok(GrayImage::new(4, 3)),
            _ => Err("c.png: corrupt".to_owned()),
        });
        assert_eq!(
            (0..3).map(|i| store.is_masked(i)).collect::<Vec<_>>(),
            [true, false, true]
        );
        assert_eq!(store.check_masks(), Ok(()));
        assert!(store.mask(1).is_none() && store.get(1).is_ok());
        assert_eq!(store.mask(2), Some(&Mask::nothing()));
        let expected = PhotoError {
            source_idx: 2,
            message: "c.png: corrupt".to_owned(),
        };
        assert_eq!(store.check_masks(), Err(expected.clone()));
        assert_eq!(store.get(2), Err(expected));
        assert_eq!(
            store.get(0).unwrap_err().to_string(),
            "the photo has 4 × 4 pixels and its ignore mask 4 × 3; make the mask as large as \
             the photo"
        );
    }

    #[test]
    fn photos_are_decoded_once_and_only_when_asked_for() {
        let store = PhotoStore::new(3, |i| match i {
            2 => Err("c.png: corrupt".to_owned()),
            _ => Ok(RgbaImage::new(4, 4)),
        });
        assert_eq!(store.decoded(), 0);
        store.get(1).unwrap();
        store.get(1).unwrap();
        assert_eq!(store.decoded(), 1);
        let error = store.get(2).unwrap_err();
        assert_eq!(
            error,
            PhotoError {
                source_idx: 2,
                message: "c.png: corrupt".to_owned()
            }
        );
    }
}
