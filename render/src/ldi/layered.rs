//! The data of a layered depth image.

use super::{Ends, Look};
use crate::interior::{Pinhole, PinholeError};
use calibrate::{Lens, Rigid3, View};
use glam::DVec2;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

/// Samples of several images as one camera's, any number in a pixel.
///
/// Samples lie row by row, pixel by pixel, back to front. What is worked on at once lies together,
/// so each property is a list of its own, padded by [`PAD`](Self::PAD) entries that mean nothing.
#[derive(Clone, Debug)]
pub struct Layered {
    /// Tells it from every other in the program, for caches; copies have it, too.
    id: u64,
    /// The camera: a pinhole, wider than the portal.
    pub view: View,
    /// The same, as drawing takes it.
    pub camera: Pinhole,
    /// Which portal of the interior it stands before.
    pub portal: u32,
    /// The depth in front of which nothing lies, in world units; 0 where there is no sample.
    pub near: f64,
    /// Of each pixel, row by row, its first sample; one more at the end.
    first: Vec<u32>,
    /// Where the samples are, in pixels.
    pub(super) x: Vec<f32>,
    /// How far below their row's middle they are, in pixels.
    pub(super) y: Vec<f32>,
    pub(super) inverse_depth: Vec<f32>,
    pub(super) color: Vec<[u8; 4]>,
    pub(super) look: Vec<Look>,
    pub(super) ends: Vec<Ends>,
}

/// One sample of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// sRGB; alpha is 255.
    pub color: [u8; 4],
    /// 1 / z in the LDI camera's frame, positive.
    pub inverse_depth: f32,
    /// From the pixel's middle, in 256ths of a pixel.
    pub offset: [i8; 2],
    /// The surface's normal and the size of what the sample stands for.
    pub look: Look,
    /// Where its surface ends, as the LDI's camera sees it.
    pub ends: Ends,
}

/// Why samples make no LDI.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LdiError {
    /// No image to make it of.
    #[error("there are no images to make an LDI of; give at least the central one")]
    NoImages,
    /// Its camera is none that images are drawn for.
    #[error("the LDI's camera: {0}")]
    Camera(#[from] PinholeError),
    /// Not a count for every pixel.
    #[error("{found} counts of samples for an LDI of {expected} pixels")]
    Counts {
        /// As given.
        found: usize,
        /// Width times height.
        expected: usize,
    },
    /// Not as many samples as the counts say.
    #[error("{found} samples where the counts add up to {expected}")]
    Samples {
        /// As given.
        found: usize,
        /// The sum of the counts.
        expected: usize,
    },
    /// A depth that is none.
    #[error("sample {index} has the inverse depth {found}; expected a positive number")]
    Depth {
        /// In the order given.
        index: usize,
        /// As given.
        found: f32,
    },
}

impl Layered {
    /// Entries after the last sample of every list, so that blocks can be read whole.
    pub const PAD: usize = super::project::LANES;
    /// The most samples that a pixel has.
    pub const MOST: usize = 255;

    /// An LDI of its samples, row by row, pixel by pixel, back to front.
    ///
    /// # Errors
    /// An unusable camera; counts and samples that do not fit; an inverse depth that is not
    /// positive and finite.
    pub fn new(
        view: View,
        portal: u32,
        counts: &[u8],
        samples: impl ExactSizeIterator<Item = Sample>,
    ) -> Result<Self, LdiError> {
        let camera = Pinhole::new(&view)?;
        let expected = view.width as usize * view.height as usize;
        if counts.len() != expected {
            let found = counts.len();
            return Err(LdiError::Counts { found, expected });
        }
        let expected: usize = counts.iter().map(|n| usize::from(*n)).sum();
        if samples.len() != expected {
            let found = samples.len();
            return Err(LdiError::Samples { found, expected });
        }
        static NEXT_ID: AtomicU64 = AtomicU64::new(0);
        let mut first = Vec::with_capacity(counts.len() + 1);
        let room = expected + Self::PAD;
        let mut ldi = Self {
            id: NEXT_ID.fetch_add(1, Ordering::Relaxed),
            x: Vec::with_capacity(room),
            y: Vec::with_capacity(room),
            inverse_depth: Vec::with_capacity(room),
            color: Vec::with_capacity(room),
            look: Vec::with_capacity(room),
            ends: Vec::with_capacity(room),
            first: Vec::new(),
            near: 0.0,
            view,
            camera,
            portal,
        };
        let mut samples = samples;
        let mut nearest = 0.0_f32;
        for (pixel, count) in counts.iter().enumerate() {
            first.push(ldi.x.len() as u32);
            let column = (pixel % ldi.view.width as usize) as f32 + 0.5;
            for sample in samples.by_ref().take(usize::from(*count)) {
                let s = sample.inverse_depth;
                if !(s > 0.0 && s.is_finite()) {
                    let index = ldi.x.len();
                    return Err(LdiError::Depth { index, found: s });
                }
                nearest = nearest.max(s);
                let [dx, dy] = sample.offset.map(|o| f32::from(o) / 256.0);
                ldi.x.push(column + dx);
                ldi.y.push(dy);
                ldi.inverse_depth.push(s);
                ldi.color.push(sample.color);
                ldi.look.push(sample.look);
                ldi.ends.push(sample.ends);
            }
        }
        first.push(ldi.x.len() as u32);
        ldi.first = first;
        if nearest > 0.0 {
            ldi.near = 1.0 / f64::from(nearest);
        }
        ldi.x.resize(room, 0.0);
        ldi.y.resize(room, 0.0);
        ldi.inverse_depth.resize(room, 0.0);
        ldi.color.resize(room, [0; 4]);
        ldi.look.resize(room, Look::default());
        ldi.ends.resize(room, Ends::default());
        Ok(ldi)
    }

    /// Tells it from every other in the program, but not from copies.
    pub(crate) fn id(&self) -> u64 {
        self.id
    }

    /// Its samples as a graphics device has them: x, y from the row's middle, inverse depth, colour
    /// with where the surface ends in place of alpha, and look.
    pub(crate) fn words(&self) -> impl ExactSizeIterator<Item = [u32; 5]> + '_ {
        (0..self.len()).map(|i| {
            let [x, y, s] = [self.x[i], self.y[i], self.inverse_depth[i]].map(f32::to_bits);
            let [r, g, b, _] = self.color[i];
            let color = u32::from_le_bytes([r, g, b, self.ends[i].0]);
            [x, y, s, color, u32::from(self.look[i].0)]
        })
    }

    /// How many samples it has.
    pub fn len(&self) -> usize {
        self.x.len() - Self::PAD
    }

    /// What it takes in memory.
    pub fn bytes(&self) -> u64 {
        let sample =
            size_of::<[f32; 3]>() + size_of::<[u8; 4]>() + size_of::<Look>() + size_of::<Ends>();
        (self.x.len() * sample + self.first.len() * size_of::<u32>()) as u64
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.view.width, self.view.height]
    }

    /// How many samples a pixel has.
    pub fn count(&self, x: u32, y: u32) -> usize {
        self.samples_of(x..x + 1, y).len()
    }

    /// A pixel's samples, back to front.
    pub fn pixel(&self, x: u32, y: u32) -> impl ExactSizeIterator<Item = Sample> + '_ {
        let column = x as f32 + 0.5;
        self.samples_of(x..x + 1, y).map(move |i| Sample {
            color: self.color[i],
            inverse_depth: self.inverse_depth[i],
            offset: [self.x[i] - column, self.y[i]].map(|o| (256.0 * o) as i8),
            look: self.look[i],
            ends: self.ends[i],
        })
    }

    /// Where a sample is, in pixels, and its inverse depth.
    pub fn place(&self, index: usize, row: u32) -> (DVec2, f64) {
        let y = f64::from(row) + 0.5 + f64::from(self.y[index]);
        let at = DVec2::new(f64::from(self.x[index]), y);
        (at, f64::from(self.inverse_depth[index]))
    }

    /// The samples of some columns of a row; columns that it has not are left out.
    pub fn samples_of(&self, columns: Range<u32>, row: u32) -> Range<usize> {
        if row >= self.view.height {
            return 0..0;
        }
        let width = self.view.width;
        let start = (row * width) as usize;
        let at = |x: u32| self.first[start + x.min(width) as usize] as usize;
        at(columns.start)..at(columns.end.max(columns.start))
    }

    /// The counts of all pixels, row by row.
    pub fn counts(&self) -> impl ExactSizeIterator<Item = u8> + '_ {
        self.first.windows(2).map(|pair| (pair[1] - pair[0]) as u8)
    }

    /// All samples, as [`new`](Self::new) takes them.
    pub fn samples(&self) -> Vec<Sample> {
        let [width, height] = self.size();
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        pixels.flat_map(|(x, y)| self.pixel(x, y)).collect()
    }
}

/// A pinhole view.
pub(super) fn pinhole_view(
    camera_from_world: Rigid3,
    focal: DVec2,
    principal: DVec2,
    [width, height]: [u32; 2],
) -> View {
    View {
        lens: Lens::pinhole(focal, principal),
        width,
        height,
        camera_from_world,
    }
}
