//! How reference images and LDIs are made.

use crate::interior::{Captured, REFERENCE_SIZE, Reference};
use crate::ldi::{ConstructOptions, making_bytes};
use proxy::interior::SemicircleOptions;

/// What LDIs are made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LdiSource {
    /// Images drawn at the places of semicircles.
    Views,
    /// Photos with depth maps, wherever they were taken; images where none sees the portal, or there
    /// are no photos.
    #[default]
    Photos,
}

/// How reference images are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LibraryOptions {
    /// Width and height in pixels, 1 to 4096.
    pub size: [u32; 2],
    /// Where they are made.
    pub semicircles: SemicircleOptions,
    /// What LDIs are made of.
    pub ldi_of: LdiSource,
    /// How many views, those nearest to the viewer, an LDI of views is made of beside the semicircle's
    /// middle one, 1 or more: a side then has several LDIs, and between two of them both are shown, mixed. With
    /// `None` all views of a semicircle make one. Pictures depend on where the viewer is, never on where
    /// from or when. LDIs of photos are of all photos all the same.
    pub ldi_views: Option<usize>,
    /// How an LDI is made of them.
    pub ldi: ConstructOptions,
    /// The most bytes that they may take between frames; `None` for no limit. A frame has all
    /// that it needs, even if they are more. No picture depends on it.
    pub budget: Option<u64>,
}

impl Default for LibraryOptions {
    fn default() -> Self {
        Self {
            size: REFERENCE_SIZE,
            semicircles: SemicircleOptions::default(),
            ldi_of: LdiSource::default(),
            ldi_views: None,
            ldi: ConstructOptions::default(),
            budget: None,
        }
    }
}

impl LibraryOptions {
    /// As they are meant where cells are drawn from these photos, or from none: without depth maps LDIs
    /// are of views, and one of photos is of all of them, as those were taken wherever they were.
    pub fn with_photos(mut self, captured: Option<&Captured>) -> Self {
        let has_depth = captured.is_some_and(|captured| captured.depth_maps().is_some());
        match self.ldi_of {
            LdiSource::Photos if has_depth => self.ldi_views = None,
            _ => self.ldi_of = LdiSource::Views,
        }
        self
    }

    /// How many views an LDI of views is made of, at most.
    pub fn views_of_ldi(&self) -> usize {
        let all = self.semicircles.views;
        let nearest_and_middle = self.ldi_views.map(|count| count.max(1) + 1);
        nearest_and_middle.map_or(all, |count| count.min(all))
    }

    /// About how many bytes it takes to make an LDI of views, whatever the budget: its images, and what is kept
    /// of their pixels meanwhile. Where the portal is small or little is beyond it, it takes less.
    pub fn making_bytes(&self) -> u64 {
        let views = self.views_of_ldi() as u64;
        let [width, height] = self.size.map(u64::from);
        let images = views * Reference::bytes(self.size);
        images + making_bytes(views, width * height, &self.ldi)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_making_an_ldi_takes_grows_with_its_views_pixels() {
        let mut options = LibraryOptions {
            size: [4096, 4096],
            ..LibraryOptions::default()
        };
        let of_all = options.making_bytes();
        // 13 views of 4096 × 4096 took 18.6 GB in all.
        assert!((15e9..20e9).contains(&(of_all as f64)), "{of_all}");
        options.size = [2048, 2048];
        let of_quarter = options.making_bytes();
        assert!(4 * of_quarter > of_all && 4 * of_quarter < of_all + of_all / 100);
        // The three nearest, and the middle one.
        options.size = [4096, 4096];
        options.ldi_views = Some(3);
        assert_eq!(options.views_of_ldi(), 4);
        assert!(2 * options.making_bytes() < of_all);
        options.ldi_views = Some(99);
        assert_eq!(options.making_bytes(), of_all);
    }
}
