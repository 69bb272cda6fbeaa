//! The reference images of an interior and the LDIs of them, made when they are first asked for.

use super::photographed::photographed;
use super::{Captured, CellGeometry, REFERENCE_SIZE, Reference};
use crate::RenderError;
use crate::ldi::{ClipTree, ConstructOptions, Layered, construct, construct_of_photos};
use crate::residency::Residency;
use glam::DVec3;
use proxy::interior::{
    CellId, Interior, PortalId, SemicircleOptions, SemicircleView, angle_before, semicircles,
};
use proxy::mesh::Model;
use std::ops::Range;
use std::sync::Arc;

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
            ldi: ConstructOptions::default(),
            budget: None,
        }
    }
}

/// A portal's LDI, from one side.
#[derive(Clone, Debug)]
pub struct PortalLdi {
    /// Its samples.
    pub ldi: Layered,
    /// What tells which of its columns are in sight.
    pub tree: ClipTree,
}

/// Of some sides, in order; nothing for one whose images make none.
type Ldis = Vec<Arc<Option<PortalLdi>>>;

/// The places of all reference images, and those images and LDIs that are in memory.
#[derive(Debug)]
pub struct Library {
    options: LibraryOptions,
    places: Vec<SemicircleView>,
    /// Of each portal and direction, one after the other: which places, from left to right.
    sides: Vec<Range<usize>>,
    /// By place.
    images: Vec<Option<Kept<Reference>>>,
    /// By side; nothing for images that make none.
    ldis: Vec<Option<Kept<Option<PortalLdi>>>>,
    /// Counts frames.
    turn: u64,
    residency: Residency,
}

/// What is in memory.
#[derive(Clone, Debug)]
struct Kept<T> {
    what: Arc<T>,
    bytes: u64,
    /// When it was last used.
    used: u64,
}

impl Library {
    /// Places of an interior; no image is made.
    pub fn new(interior: &Interior, options: &LibraryOptions) -> Self {
        let places = semicircles(interior, &options.semicircles);
        let side = |place: &SemicircleView| (place.portal, place.from, place.into);
        let mut sides = Vec::new();
        let mut first = 0;
        for i in 1..=places.len() {
            if i == places.len() || side(&places[i]) != side(&places[first]) {
                sides.push(first..i);
                first = i;
            }
        }
        Self {
            options: LibraryOptions {
                size: options.size.map(|n| n.clamp(1, 4096)),
                ..*options
            },
            images: vec![None; places.len()],
            ldis: vec![None; sides.len()],
            places,
            sides,
            turn: 0,
            residency: Residency {
                budget: options.budget,
                ..Residency::default()
            },
        }
    }

    /// How many images there may be.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there are no places at all.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// What the images take and took; `loads` counts those that were made.
    pub fn residency(&self) -> Residency {
        self.residency
    }

    /// The places nearest to an eye by their angle before a portal, the nearest first; of two at
    /// one angle the one on the left.
    pub fn nearest(
        &self,
        interior: &Interior,
        portal: PortalId,
        from: CellId,
        into: CellId,
        eye: DVec3,
        count: usize,
    ) -> Vec<usize> {
        let side = self.side(portal, from, into);
        let range = side.map_or(0..0, |side| self.sides[side].clone());
        let eye_angle = angle_before(interior, interior.portal(portal), Some(from), eye);
        let mut places: Vec<usize> = range.collect();
        let off = |i: &usize| (self.places[*i].angle - eye_angle).abs();
        places.sort_by(|a, b| off(a).total_cmp(&off(b)));
        places.truncate(count);
        places
    }

    /// The portal and direction of that cell's, which has an LDI of its own; `None` where there are no
    /// places.
    pub fn side(&self, portal: PortalId, from: CellId, into: CellId) -> Option<usize> {
        self.sides.iter().position(|range| {
            let place = &self.places[range.start];
            (place.portal, place.from, place.into) == (portal, Some(from), into)
        })
    }

    /// How many LDIs there may be.
    pub fn side_count(&self) -> usize {
        self.sides.len()
    }

    /// The images of a frame's places, in their order, and how many were made for it. Others go,
    /// those not used for longest first, as far as the budget asks. Where photos are given, they colour
    /// what is made.
    ///
    /// # Errors
    /// The photos' engine's.
    pub fn images(
        &mut self,
        places: &[usize],
        interior: &Interior,
        model: &Model,
        geometry: &CellGeometry,
        mut captured: Option<&mut Captured>,
    ) -> Result<(Vec<Arc<Reference>>, usize), RenderError> {
        self.turn += 1;
        // 1. What stays is no candidate for leaving.
        let missing = touch(&mut self.images, places, self.turn);
        let bytes = Reference::bytes(self.options.size);
        self.make_room(missing.len() as u64 * bytes);
        // 2. What is missing.
        for &place in &missing {
            let captured = captured.as_deref_mut();
            let made = self.make(place, interior, model, geometry, captured)?;
            self.images[place] = Some(Kept {
                what: Arc::new(made),
                bytes,
                used: self.turn,
            });
            self.residency.change(bytes, 0);
            self.residency.loads += 1;
        }
        Ok((found(&self.images, places), missing.len()))
    }

    /// The LDIs of a frame's sides, in their order, and how many reference images were made for
    /// them; nothing for a side whose images make none. Others go as for [`Self::images`].
    ///
    /// # Errors
    /// The photos' engine's.
    pub fn ldis(
        &mut self,
        sides: &[usize],
        interior: &Interior,
        model: &Model,
        geometry: &CellGeometry,
        mut captured: Option<&mut Captured>,
    ) -> Result<(Ldis, usize), RenderError> {
        self.turn += 1;
        let mut made = 0;
        for side in touch(&mut self.ldis, sides, self.turn) {
            let of_photos = match (self.options.ldi_of, captured.as_deref_mut()) {
                (LdiSource::Photos, Some(photos)) => self.of_photos(side, interior, photos)?,
                _ => None,
            };
            let (layered, images) = match of_photos {
                Some((layered, images)) => (Some(layered), images),
                None => self.of_views(side, interior, model, geometry, captured.as_deref_mut())?,
            };
            made += images;
            let ldi = layered.map(|ldi| PortalLdi {
                tree: ClipTree::new(&ldi),
                ldi,
            });
            let bytes = ldi.as_ref().map_or(0, |l| l.ldi.bytes() + l.tree.bytes());
            self.make_room(bytes);
            self.ldis[side] = Some(Kept {
                what: Arc::new(ldi),
                bytes,
                used: self.turn,
            });
            self.residency.change(bytes, 0);
        }
        self.residency.loads += made as u64;
        Ok((found(&self.ldis, sides), made))
    }

    /// The LDI of a side's images, and how many were made for it: they are of no more use once it
    /// is made.
    fn of_views(
        &self,
        side: usize,
        interior: &Interior,
        model: &Model,
        geometry: &CellGeometry,
        mut captured: Option<&mut Captured>,
    ) -> Result<(Option<Layered>, usize), RenderError> {
        let mut made = 0;
        let images: Vec<Arc<Reference>> = self.sides[side]
            .clone()
            .map(|place| match &self.images[place] {
                Some(kept) => Ok(kept.what.clone()),
                None => {
                    made += 1;
                    let captured = captured.as_deref_mut();
                    let image = self.make(place, interior, model, geometry, captured)?;
                    Ok(Arc::new(image))
                }
            })
            .collect::<Result<_, RenderError>>()?;
        let images: Vec<&Reference> = images.iter().map(|image| &**image).collect();
        let constructed = construct(&images, &self.options.ldi);
        Ok((constructed.ok().map(|made| made.ldi), made))
    }

    /// The LDI of the photos that see through a side's portal, and how many they are; nothing where
    /// none does.
    fn of_photos(
        &self,
        side: usize,
        interior: &Interior,
        captured: &mut Captured,
    ) -> Result<Option<(Layered, usize)>, RenderError> {
        let places = &self.places[self.sides[side].clone()];
        let Some(photos) = photographed(interior, places, self.options.size, captured)? else {
            return Ok(None);
        };
        let images: Vec<&Reference> = photos.images.iter().collect();
        let (place, options) = (&places[places.len() / 2], &self.options.ldi);
        let made = construct_of_photos(place, &photos.camera, &images, photos.noise, options);
        Ok(made.ok().map(|made| (made.ldi, images.len())))
    }

    fn make(
        &self,
        place: usize,
        interior: &Interior,
        model: &Model,
        geometry: &CellGeometry,
        captured: Option<&mut Captured>,
    ) -> Result<Reference, RenderError> {
        let (place, size) = (&self.places[place], self.options.size);
        match captured {
            Some(captured) => {
                Reference::of_photos(interior, model, geometry, place, size, captured)
            }
            None => Ok(Reference::new(interior, model, geometry, place, size)),
        }
    }

    fn make_room(&mut self, bytes: u64) {
        while !self.residency.allows(self.residency.held + bytes) {
            let images = self.images.iter().enumerate();
            let images = images.filter_map(|(i, kept)| Some((kept.as_ref()?.used, 0, i)));
            let ldis = self.ldis.iter().enumerate();
            let ldis = ldis.filter_map(|(i, kept)| Some((kept.as_ref()?.used, 1, i)));
            let others = images.chain(ldis).filter(|(used, ..)| *used < self.turn);
            let freed = match others.min() {
                Some((_, 0, image)) => self.images[image].take().map(|kept| kept.bytes),
                Some((.., ldi)) => self.ldis[ldi].take().map(|kept| kept.bytes),
                None => return,
            };
            self.residency.change(0, freed.unwrap_or(0));
            self.residency.evictions += 1;
        }
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
