//! How reference images and LDIs are made.

use crate::interior::{Captured, REFERENCE_SIZE};
use crate::ldi::ConstructOptions;
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
}
