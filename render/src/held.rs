//! The photos of one frame, kept for as long as it is drawn.

use crate::frame::Frame;
use crate::photos::{PhotoError, PhotoStore};
use crate::pyramid::Pyramid;
use crate::residency::finest_level;
use calibrate::View;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// What one drawing of a frame samples from: the store's photos, decoded when first asked for,
/// from one mip level on that follows from the budget and the frame alone.
///
/// The store may let go of a photo meanwhile; whoever holds it still has it.
#[derive(Debug)]
pub struct Held<'a> {
    store: &'a PhotoStore,
    finest: usize,
    /// Small, as there is room for all that the store has.
    photos: Vec<OnceLock<Result<Arc<Pyramid>, Box<PhotoError>>>>,
    /// Whether the store is told how many were sampled.
    counted: bool,
}

impl<'a> Held<'a> {
    /// Makes room in the store for the photos that a frame may sample; `wanted` names each
    /// once. Those of other frames go, the least recently used first, as far as the budget
    /// asks. Where it is too small for what is wanted, all are held without their finest mip
    /// levels.
    pub fn new(frame: &Frame<'a>, wanted: &[usize]) -> Self {
        Self::of(frame, wanted, false)
    }

    /// The same for more of a frame that was drawn before, which the store is not told of.
    pub(crate) fn again(frame: &Frame<'a>, wanted: &[usize]) -> Self {
        Self::of(frame, wanted, true).uncounted()
    }

    fn of(frame: &Frame<'a>, wanted: &[usize], is_again: bool) -> Self {
        let store = &frame.lumigraph.photos;
        let sizes = sizes_of(frame, wanted);
        let finest = finest_level(store.residency().budget, sizes.clone());
        store.make_room(wanted, sizes, finest, is_again);
        Self {
            store,
            finest,
            photos: (0..store.len()).map(|_| OnceLock::new()).collect(),
            counted: true,
        }
    }

    /// For what is no drawing: [`PhotoStore::last_sampled`] does not speak of it.
    pub(crate) fn uncounted(mut self) -> Self {
        self.counted = false;
        self
    }

    /// Whether the store has room for all of `wanted` in full.
    pub(crate) fn fit(frame: &Frame<'_>, wanted: &[usize]) -> bool {
        let budget = frame.lumigraph.photos.residency().budget;
        finest_level(budget, sizes_of(frame, wanted)) == 0
    }

    /// The photo of a source view.
    ///
    /// # Errors
    /// As [`PhotoStore::get`].
    pub fn get(&self, source_idx: usize) -> Result<&Pyramid, PhotoError> {
        let get = || self.store.get_from_level(source_idx, self.finest);
        let photo = self.photos[source_idx].get_or_init(|| get().map_err(Box::new));
        photo
            .as_ref()
            .map(Arc::as_ref)
            .map_err(|e| e.as_ref().clone())
    }
}

impl Drop for Held<'_> {
    fn drop(&mut self) {
        if !self.counted {
            return;
        }
        let sampled = self.photos.iter().filter(|photo| photo.get().is_some());
        self.store.note_sampled(sampled.count());
    }
}

/// Decodes the photos that the next frame may sample, while another is drawn, on all threads
/// of rayon, until told to `stop`: no photo whose turn comes later is begun then. Those in
/// `without` are left alone; what the budget has no room for beside the current frame's photos
/// is, too. No picture depends on it.
pub fn decode_ahead(next: &Frame<'_>, wanted: &[usize], without: &[usize], stop: &AtomicBool) {
    if !Held::fit(next, wanted) {
        return;
    }
    let store = &next.lumigraph.photos;
    let mut stay = vec![false; store.len()];
    wanted.iter().for_each(|&i| stay[i] = true);
    let mut is_there = vec![false; store.len()];
    without.iter().for_each(|&i| is_there[i] = true);
    let missing = wanted.par_iter().filter(|&&i| !is_there[i]);
    missing.for_each(|&i| {
        if !stop.load(Ordering::Relaxed) {
            let View { width, height, .. } = next.lumigraph.sources[i].view;
            store.decode_ahead(i, [width, height], &stay);
        }
    });
}

fn sizes_of(frame: &Frame<'_>, wanted: &[usize]) -> impl Iterator<Item = [u32; 2]> + Clone {
    let sources = &frame.lumigraph.sources;
    let size = |&i: &usize| [sources[i].view.width, sources[i].view.height];
    wanted.iter().map(size)
}
