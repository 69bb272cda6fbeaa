//! What is drawn into.

use image::RgbaImage;
use rayon::prelude::*;

/// A picture with depth.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Target {
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
    /// Row by row, sRGB; alpha is 255, or 0 where nothing was drawn. In a picture of a walk it is
    /// between them where a hole is mixed in.
    pub color: Vec<[u8; 4]>,
    /// 1 / z of what was drawn, in the camera's frame; 0 where nothing was.
    pub inverse_depth: Vec<f32>,
}

impl Target {
    /// Nothing drawn yet.
    pub fn new(width: u32, height: u32) -> Self {
        let mut target = Self::default();
        target.clear(width, height);
        target
    }

    /// Empties it, as large as that.
    pub fn clear(&mut self, width: u32, height: u32) {
        let count = width as usize * height as usize;
        (self.width, self.height) = (width, height);
        fill_all(&mut self.color, count, [0; 4]);
        fill_all(&mut self.inverse_depth, count, 0.0);
    }

    /// The picture.
    pub fn picture(&self) -> RgbaImage {
        let bytes = self.color.as_flattened().to_vec();
        RgbaImage::from_raw(self.width, self.height, bytes).expect("four bytes a pixel")
    }
}

/// Pixels that are worth a thread to be emptied.
pub(super) const ALONE: usize = 1 << 15;

/// So many of a value in a list, whatever was there. Whole pictures are emptied several times a frame.
pub(super) fn fill_all<T: Copy + Send + Sync>(list: &mut Vec<T>, count: usize, value: T) {
    list.truncate(count);
    let parts = list.par_chunks_mut(ALONE);
    parts.for_each(|part| part.fill(value));
    list.resize(count, value);
}
