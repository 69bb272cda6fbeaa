//! The photos of a lumigraph, decoded when first needed and kept within a memory budget.

use crate::mask::Mask;
use crate::pyramid::Pyramid;
use crate::residency::{Residency, photo_bytes};
use image::{GrayImage, RgbaImage};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

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

/// The photos of a lumigraph and their ignore masks, each decoded when it is first asked for.
///
/// Photos are kept as far as the memory budget goes, masks always: the field asks all of them
/// for every frame. A photo that is being decoded comes on top of the budget.
pub struct PhotoStore {
    /// Held by whoever decodes the photo, so that nobody else does.
    decoding: Vec<Mutex<()>>,
    /// Never locked for long; nothing else is locked meanwhile.
    shelf: Mutex<Shelf>,
    load: Box<Load<RgbaImage>>,
    /// By source view, where any has a mask.
    masks: Vec<Option<OnceLock<Result<Mask, PhotoError>>>>,
    load_mask: Box<Load<GrayImage>>,
    /// Stands in for a mask that cannot be decoded.
    nothing: Mask,
    /// What drawings asked for in vain, by source view.
    missed: Mutex<BTreeMap<usize, PhotoError>>,
    id: u64,
    /// How many photos the last drawing sampled.
    sampled: AtomicUsize,
    decode_nanos: AtomicU64,
}

/// What is in memory.
#[derive(Default)]
struct Shelf {
    slots: Vec<Slot>,
    /// Counts uses.
    clock: u64,
    /// The clock when the last frame's photos were named: those used since are its own.
    frame_began: u64,
    /// Bytes of photos that are on their way, for which room was made.
    awaited: u64,
    residency: Residency,
}

#[derive(Clone, Default)]
struct Slot {
    photo: Option<Arc<Pyramid>>,
    error: Option<PhotoError>,
    last_used: u64,
    awaited: u64,
    ever_decoded: bool,
}

impl Shelf {
    fn put(&mut self, source_idx: usize, photo: Option<Arc<Pyramid>>) {
        let bytes = |photo: &Option<Arc<Pyramid>>| photo.as_ref().map_or(0, |p| p.bytes() as u64);
        let slot = &mut self.slots[source_idx];
        self.residency.change(bytes(&photo), bytes(&slot.photo));
        slot.photo = photo;
        self.awaited -= std::mem::take(&mut slot.awaited);
    }

    /// Keeps room for a photo that is on its way.
    fn await_photo(&mut self, source_idx: usize, bytes: u64) {
        let slot = &mut self.slots[source_idx];
        self.awaited += bytes;
        self.awaited -= std::mem::replace(&mut slot.awaited, bytes);
    }

    fn touch(&mut self, source_idx: usize) {
        self.clock += 1;
        self.slots[source_idx].last_used = self.clock;
    }

    /// Lets go of the least recently used photos but those that are to `stay`, until `more`
    /// bytes fit.
    fn evict(&mut self, more: u64, stay: impl Fn(usize) -> bool) {
        if self.residency.allows(self.residency.held + more) {
            return;
        }
        let mut by_age: Vec<(u64, usize)> = (0..self.slots.len())
            .filter(|&i| self.slots[i].photo.is_some() && !stay(i))
            .map(|i| (self.slots[i].last_used, i))
            .collect();
        by_age.sort_unstable();
        for (_, i) in by_age {
            if self.residency.allows(self.residency.held + more) {
                break;
            }
            self.put(i, None);
            self.residency.evictions += 1;
        }
    }
}

impl PhotoStore {
    /// A store of `count` photos without a memory budget. `load` decodes one by its source
    /// view's index, or says what is wrong, naming the file.
    pub fn new(
        count: usize,
        load: impl Fn(usize) -> Result<RgbaImage, String> + Send + Sync + 'static,
    ) -> Self {
        static NEXT_ID: AtomicU64 = AtomicU64::new(0);
        let id = NEXT_ID.fetch_add(1, Ordering::Relaxed);
        Self {
            decoding: (0..count).map(|_| Mutex::new(())).collect(),
            shelf: Mutex::new(Shelf {
                slots: vec![Slot::default(); count],
                ..Shelf::default()
            }),
            load: Box::new(load),
            masks: Vec::new(),
            load_mask: Box::new(|_| Err("there is no mask".to_owned())),
            nothing: Mask::nothing(),
            missed: Mutex::default(),
            id,
            sampled: AtomicUsize::new(0),
            decode_nanos: AtomicU64::new(0),
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
        assert_eq!(masked.len(), self.decoding.len());
        if masked.contains(&true) {
            let slot = |&masked: &bool| masked.then(OnceLock::new);
            self.masks = masked.iter().map(slot).collect();
        }
        self.load_mask = Box::new(load);
        self
    }

    /// Goes on where another store ends, of the same photos and some more: those of its source views
    /// `gone`. What it holds of the others stays in memory, and its counts and its budget hold for
    /// both.
    ///
    /// # Panics
    /// If the other has not these photos more.
    pub fn go_on_from(&mut self, other: Self, gone: &BTreeSet<usize>) {
        assert_eq!(other.len(), self.len() + gone.len());
        let shelf = other.shelf.into_inner();
        let mut shelf = shelf.unwrap_or_else(PoisonError::into_inner);
        gone.iter().for_each(|&i| shelf.put(i, None));
        let slots = std::mem::take(&mut shelf.slots).into_iter().enumerate();
        let stay = slots.filter(|(source_idx, _)| !gone.contains(source_idx));
        shelf.slots = stay.map(|(_, slot)| slot).collect();
        shelf.awaited = 0;
        for (source_idx, slot) in shelf.slots.iter_mut().enumerate() {
            slot.awaited = 0;
            if let Some(error) = &mut slot.error {
                error.source_idx = source_idx;
            }
        }
        self.shelf = Mutex::new(shelf);
        *self.decode_nanos.get_mut() += other.decode_nanos.into_inner();
        // Those that cannot be decoded say so again, by their new places.
        let masks = other.masks.into_iter().enumerate();
        let masks = masks.filter(|(source_idx, _)| !gone.contains(source_idx));
        for (own, (_, mask)) in self.masks.iter_mut().zip(masks) {
            if let (Some(own), Some(Ok(mask))) = (own, mask.and_then(OnceLock::into_inner)) {
                *own = OnceLock::from(Ok(mask));
            }
        }
    }

    /// How many photos there are.
    pub fn len(&self) -> usize {
        self.decoding.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.decoding.is_empty()
    }

    /// Tells this store from every other in the program, for caches.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// The most bytes that photos may take between frames; `None` for no limit.
    pub fn set_budget(&mut self, bytes: Option<u64>) {
        let mut shelf = self.shelf();
        shelf.residency.budget = bytes;
        shelf.evict(0, |_| false);
    }

    /// How many different ones have been decoded.
    pub fn decoded(&self) -> usize {
        let shelf = self.shelf();
        shelf.slots.iter().filter(|slot| slot.ever_decoded).count()
    }

    /// Whether a photo has been decoded.
    pub fn was_decoded(&self, source_idx: usize) -> bool {
        self.shelf().slots[source_idx].ever_decoded
    }

    /// The time that decoding took so far, with making mip levels, summed over the threads that
    /// did it.
    pub fn decode_time(&self) -> Duration {
        Duration::from_nanos(self.decode_nanos.load(Ordering::Relaxed))
    }

    /// How many photos the last drawing by the CPU or the reference sampled.
    pub fn last_sampled(&self) -> usize {
        self.sampled.load(Ordering::Relaxed)
    }

    pub(crate) fn note_sampled(&self, count: usize) {
        self.sampled.store(count, Ordering::Relaxed);
    }

    /// What the photos took so far, masks not included.
    pub fn residency(&self) -> Residency {
        self.shelf().residency
    }

    /// Bytes held by decoded photos and masks.
    pub fn bytes(&self) -> usize {
        let masks = self.masks.iter().flatten();
        let masks = masks.filter_map(|m| m.get()?.as_ref().ok());
        self.residency().held as usize + masks.map(Mask::bytes).sum::<usize>()
    }

    fn shelf(&self) -> MutexGuard<'_, Shelf> {
        lock(&self.shelf)
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

    /// Whether every mask of these source views that was asked for could be decoded.
    ///
    /// # Errors
    /// The first of those that could not; [`Self::take_missed`] tells all.
    pub fn check_masks(&self, of: impl IntoIterator<Item = usize>) -> Result<(), PhotoError> {
        let masks = of.into_iter().filter_map(|i| self.masks.get(i)?.as_ref());
        let asked = masks.filter_map(OnceLock::get);
        let mut failed = asked.filter_map(|mask| mask.as_ref().err());
        let Some(first) = failed.next() else {
            return Ok(());
        };
        std::iter::once(first)
            .chain(failed)
            .for_each(|error| self.miss(error));
        Err(first.clone())
    }

    /// What drawings asked for in vain, in the order of the source views, and forgets it. A drawing returns the
    /// first that it meets as its error, but goes on to ask for what else it needs, so that all can be left out
    /// at once.
    pub fn take_missed(&self) -> Vec<PhotoError> {
        std::mem::take(&mut *lock(&self.missed))
            .into_values()
            .collect()
    }

    /// Asks for all of these, as a drawing did for one in vain.
    pub(crate) fn find_missed(&self, wanted: &[usize]) {
        let failed = wanted.par_iter().filter_map(|&i| self.get(i).err());
        failed.for_each(|error| self.miss(&error));
    }

    fn miss(&self, error: &PhotoError) {
        let mut missed = lock(&self.missed);
        let known = missed.entry(error.source_idx);
        known.or_insert_with(|| error.clone());
    }

    /// The photo of a source view, in full; kept if the budget has room for it.
    ///
    /// # Errors
    /// It or its ignore mask cannot be decoded, or their sizes differ; every later call
    /// says the same.
    pub fn get(&self, source_idx: usize) -> Result<Arc<Pyramid>, PhotoError> {
        self.find_or_decode(source_idx, 0, |shelf, photo| {
            let bytes = photo.bytes() as u64;
            if shelf.residency.allows(bytes) {
                shelf.put(source_idx, None);
                // And for those that are being decoded ahead of need, for which there was room before.
                shelf.evict(shelf.awaited + bytes, |_| false);
                shelf.put(source_idx, Some(Arc::clone(photo)));
            }
        })
    }

    /// The photo of a source view from a mip level on, for a drawing, kept whatever the budget: room was made
    /// before.
    pub(crate) fn get_from_level(
        &self,
        source_idx: usize,
        finest: usize,
    ) -> Result<Arc<Pyramid>, PhotoError> {
        self.find_or_decode(source_idx, finest, |shelf, photo| {
            shelf.put(source_idx, Some(Arc::clone(photo)));
        })
        .inspect_err(|error| self.miss(error))
    }

    fn find_or_decode(
        &self,
        source_idx: usize,
        finest: usize,
        keep: impl FnOnce(&mut Shelf, &Arc<Pyramid>),
    ) -> Result<Arc<Pyramid>, PhotoError> {
        let _alone = lock(&self.decoding[source_idx]);
        {
            let mut shelf = self.shelf();
            shelf.touch(source_idx);
            let slot = &shelf.slots[source_idx];
            if let Some(error) = &slot.error {
                return Err(error.clone());
            }
            if let Some(photo) = slot.photo.as_ref().filter(|p| is_from(p, finest)) {
                return Ok(Arc::clone(photo));
            }
        }
        let decoded = self.decode(source_idx);
        let mut shelf = self.shelf();
        shelf.residency.loads += 1;
        shelf.slots[source_idx].ever_decoded = true;
        match decoded {
            Ok(photo) => {
                let photo = Arc::new(match finest {
                    0 => photo,
                    _ => photo.from_level(finest),
                });
                keep(&mut shelf, &photo);
                Ok(photo)
            }
            Err(error) => {
                shelf.put(source_idx, None);
                shelf.slots[source_idx].error = Some(error.clone());
                Err(error)
            }
        }
    }

    /// Makes room for the photos `wanted`, of the given sizes, from a mip level on. Of those
    /// that are there, levels that are finer go, and what is coarser goes as a whole, so that
    /// all that is there is as it will be sampled. Whether a frame is drawn again, of which note was taken.
    pub(crate) fn make_room(
        &self,
        wanted: &[usize],
        sizes: impl Iterator<Item = [u32; 2]>,
        finest: usize,
        is_again: bool,
    ) {
        let mut shelf = self.shelf();
        if !is_again {
            shelf.residency.note_frame(finest);
        }
        shelf.slots.iter_mut().for_each(|slot| slot.awaited = 0);
        shelf.awaited = 0;
        shelf.frame_began = shelf.clock;
        let mut stays = vec![false; self.len()];
        for (&i, size) in wanted.iter().zip(sizes) {
            stays[i] = true;
            shelf.touch(i);
            let as_wanted = shelf.slots[i].photo.as_ref().map(|photo| match photo {
                photo if is_from(photo, finest) => Some(Arc::clone(photo)),
                photo if photo.finest < finest => Some(Arc::new(photo.from_level(finest))),
                _ => None,
            });
            if let Some(as_wanted) = as_wanted {
                shelf.put(i, as_wanted);
            }
            if shelf.slots[i].photo.is_none() {
                shelf.await_photo(i, photo_bytes(size, finest));
            }
        }
        let more = shelf.awaited;
        shelf.evict(more, |i| stays[i]);
    }

    /// Begins a frame that asks for photos one by one; see [`Self::decode_ahead`].
    pub(crate) fn begin_frame(&self) {
        let mut shelf = self.shelf();
        shelf.frame_began = shelf.clock;
    }

    /// Decodes a photo in full that the next frame will ask for, of the given size, if that
    /// leaves the current one's and those that `stay` where they are. Pictures do not depend on
    /// it, and errors wait until somebody asks for the photo.
    pub(crate) fn decode_ahead(&self, source_idx: usize, size: [u32; 2], stay: &[bool]) {
        let bytes = photo_bytes(size, 0);
        {
            let mut shelf = self.shelf();
            let slot = &shelf.slots[source_idx];
            if slot.photo.is_some() || slot.error.is_some() || slot.awaited > 0 {
                return;
            }
            let stays: Vec<bool> = (0..self.len())
                .map(|i| stay[i] || shelf.slots[i].last_used > shelf.frame_began)
                .collect();
            let staying = shelf.slots.iter().zip(&stays).filter(|(_, stays)| **stays);
            let staying = staying.filter_map(|(slot, _)| slot.photo.as_ref());
            let staying: u64 = staying.map(|photo| photo.bytes() as u64).sum();
            if !shelf.residency.allows(staying + shelf.awaited + bytes) {
                return;
            }
            let more = shelf.awaited + bytes;
            shelf.evict(more, |i| stays[i]);
            shelf.await_photo(source_idx, bytes);
        }
        // An error is kept for whoever asks.
        let _ = self.find_or_decode(source_idx, 0, |shelf, photo| {
            // A frame that began meanwhile may have taken the room, or wait for some levels of the photo alone.
            let (slot, more) = (&shelf.slots[source_idx], shelf.awaited + bytes);
            let has_room = match slot.awaited {
                0 => slot.photo.is_none() && shelf.residency.allows(shelf.residency.held + more),
                awaited => awaited == bytes,
            };
            if has_room {
                shelf.put(source_idx, Some(Arc::clone(photo)));
            }
        });
    }

    /// The photo of a source view, decoded anew and not kept.
    ///
    /// # Errors
    /// It cannot be decoded.
    pub fn decode(&self, source_idx: usize) -> Result<Pyramid, PhotoError> {
        let start = Instant::now();
        let decoded = self.decode_untimed(source_idx);
        let nanos = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.decode_nanos.fetch_add(nanos, Ordering::Relaxed);
        decoded
    }

    fn decode_untimed(&self, source_idx: usize) -> Result<Pyramid, PhotoError> {
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

/// Whether a photo is what it is from a mip level on, no more and no less.
fn is_from(photo: &Pyramid, finest: usize) -> bool {
    photo.finest == finest.min(photo.levels.len() - 1)
}

/// A thread that panicked while it held the lock left nothing half done.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;
