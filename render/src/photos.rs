//! Photos as the engine samples them: decoded when first needed, premultiplied, with mip
//! levels.

use image::RgbaImage;
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
    pub fn new(mut photo: RgbaImage) -> Self {
        let opaque = photo.pixels().all(|p| p.0[3] == 255);
        if !opaque {
            for pixel in photo.pixels_mut() {
                let [r, g, b, a] = pixel.0.map(u32::from);
                let times_alpha = |v: u32| ((v * a + 127) / 255) as u8;
                pixel.0 = [times_alpha(r), times_alpha(g), times_alpha(b), a as u8];
            }
        }
        let mut levels = vec![photo];
        while levels.len() < MAX_LEVELS {
            let last = &levels[levels.len() - 1];
            if last.width() == 1 && last.height() == 1 {
                break;
            }
            let next = halve(last);
            levels.push(next);
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

/// Averages 2 × 2 texels; an odd last row or column pairs with itself.
fn halve(image: &RgbaImage) -> RgbaImage {
    let (width, height) = image.dimensions();
    let pitch = width as usize * 4;
    let texels = image.as_raw();
    let (half_width, half_height) = (width.div_ceil(2), height.div_ceil(2));
    let mut half = Vec::with_capacity(half_width as usize * half_height as usize * 4);
    for y in 0..half_height {
        let top = &texels[(2 * y) as usize * pitch..][..pitch];
        let bottom = &texels[(2 * y + 1).min(height - 1) as usize * pitch..][..pitch];
        for x in 0..half_width {
            let left = (2 * x) as usize * 4;
            let right = (2 * x + 1).min(width - 1) as usize * 4;
            for c in 0..4 {
                let sum = [
                    top[left + c],
                    top[right + c],
                    bottom[left + c],
                    bottom[right + c],
                ];
                half.push((sum.map(u16::from).iter().sum::<u16>() + 2).div_euclid(4) as u8);
            }
        }
    }
    RgbaImage::from_raw(half_width, half_height, half).expect("the size was computed above")
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

type Load = dyn Fn(usize) -> Result<RgbaImage, String> + Send + Sync;

/// The photos of a lumigraph, each decoded when it is first asked for and then kept.
pub struct PhotoStore {
    slots: Vec<OnceLock<Result<Pyramid, PhotoError>>>,
    load: Box<Load>,
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
            decoded: AtomicUsize::new(0),
            id,
        }
    }

    /// A store of photos already in memory.
    pub fn from_images(photos: Vec<RgbaImage>) -> Self {
        let count = photos.len();
        Self::new(count, move |i| Ok(photos[i].clone()))
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
        let loaded = self.slots.iter().filter_map(|s| s.get()?.as_ref().ok());
        loaded.map(Pyramid::bytes).sum()
    }

    /// The photo of a source view.
    ///
    /// # Errors
    /// It cannot be decoded; every later call says the same.
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
        let photo = (self.load)(source_idx).map_err(|message| PhotoError {
            source_idx,
            message,
        })?;
        Ok(Pyramid::new(photo))
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
