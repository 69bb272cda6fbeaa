//! What a library has in memory, and what of it goes first.

use super::{PortalLdi, Reference};
use crate::residency::Residency;
use std::ops::Range;
use std::sync::Arc;

/// Images and LDIs, each by its place, within a budget.
#[derive(Debug)]
pub(super) struct Shelf {
    pub(super) images: Vec<Option<Kept<Reference>>>,
    /// Nothing for images that make none.
    pub(super) ldis: Vec<Option<Kept<Option<PortalLdi>>>>,
    /// Counts frames.
    turn: u64,
    pub(super) residency: Residency,
}

/// What is in memory.
#[derive(Clone, Debug)]
pub(super) struct Kept<T> {
    what: Arc<T>,
    bytes: u64,
    /// When it was last used.
    used: u64,
}

impl Shelf {
    /// Empty, with room for so many places.
    pub(super) fn new(places: usize, budget: Option<u64>) -> Self {
        Self {
            images: vec![None; places],
            ldis: vec![None; places],
            turn: 0,
            residency: Residency {
                budget,
                ..Residency::default()
            },
        }
    }

    /// Begins a frame.
    pub(super) fn begin(&mut self) {
        self.turn += 1;
    }

    /// Marks images that are used in this frame, which is why they stay; which of them are not there, each
    /// once.
    pub(super) fn touch_images(&mut self, places: &[usize]) -> Vec<usize> {
        touch(&mut self.images, places, self.turn)
    }

    /// The same of LDIs.
    pub(super) fn touch_ldis(&mut self, places: &[usize]) -> Vec<usize> {
        touch(&mut self.ldis, places, self.turn)
    }

    /// Those of some images that are there.
    pub(super) fn images_of(&self, places: &[usize]) -> Vec<Arc<Reference>> {
        found(&self.images, places)
    }

    /// Those of some LDIs that are there.
    pub(super) fn ldis_of(&self, places: &[usize]) -> Vec<Arc<Option<PortalLdi>>> {
        found(&self.ldis, places)
    }

    /// An image, if it is there.
    pub(super) fn image(&self, place: usize) -> Option<Arc<Reference>> {
        self.images[place].as_ref().map(|kept| kept.what.clone())
    }

    /// Takes an image in, for which there is room.
    pub(super) fn keep_image(&mut self, place: usize, image: Arc<Reference>, bytes: u64) {
        let (come, go) = put(&mut self.images[place], image, bytes, self.turn);
        self.residency.change(come, go);
    }

    /// The same of an LDI.
    pub(super) fn keep_ldi(&mut self, place: usize, ldi: Option<PortalLdi>, bytes: u64) {
        let (come, go) = put(&mut self.ldis[place], Arc::new(ldi), bytes, self.turn);
        self.residency.change(come, go);
    }

    /// Lets go what is of other places than these.
    pub(super) fn keep_only(&mut self, places: &Range<usize>) {
        for i in (0..self.images.len()).filter(|i| !places.contains(i)) {
            let image = self.images[i].take().map_or(0, |kept| kept.bytes);
            let ldi = self.ldis[i].take().map_or(0, |kept| kept.bytes);
            self.residency.change(0, image + ldi);
        }
    }

    /// Lets go what was used longest ago until so many bytes have room; whether they have. What this
    /// frame uses stays.
    pub(super) fn make_room(&mut self, bytes: u64) -> bool {
        while !self.residency.allows(self.residency.held + bytes) {
            let images = self.images.iter().enumerate();
            let images = images.filter_map(|(i, kept)| Some((kept.as_ref()?.used, 0, i)));
            let ldis = self.ldis.iter().enumerate();
            let ldis = ldis.filter_map(|(i, kept)| Some((kept.as_ref()?.used, 1, i)));
            let others = images.chain(ldis).filter(|(used, ..)| *used < self.turn);
            let freed = match others.min() {
                Some((_, 0, image)) => self.images[image].take().map(|kept| kept.bytes),
                Some((.., ldi)) => self.ldis[ldi].take().map(|kept| kept.bytes),
                None => return false,
            };
            self.residency.change(0, freed.unwrap_or(0));
            self.residency.evictions += 1;
        }
        true
    }
}

/// Marks what is used in a turn; which of it is not there, each once.
fn touch<T>(kept: &mut [Option<Kept<T>>], wanted: &[usize], turn: u64) -> Vec<usize> {
    let mut missing = Vec::new();
    for &i in wanted {
        match &mut kept[i] {
            Some(kept) => kept.used = turn,
            None if !missing.contains(&i) => missing.push(i),
            None => {}
        }
    }
    missing
}

fn found<T>(kept: &[Option<Kept<T>>], wanted: &[usize]) -> Vec<Arc<T>> {
    let what = |i: &usize| kept[*i].as_ref().map(|kept| kept.what.clone());
    wanted.iter().filter_map(what).collect()
}

/// The bytes that come and those that go.
fn put<T>(at: &mut Option<Kept<T>>, what: Arc<T>, bytes: u64, used: u64) -> (u64, u64) {
    let last = at.replace(Kept { what, bytes, used });
    (bytes, last.map_or(0, |last| last.bytes))
}
