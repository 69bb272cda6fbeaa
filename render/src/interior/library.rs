//! The reference images of an interior and the LDIs of them, made when they are first asked for.

use super::neighbourhood::{self, Shown};
use super::photographed::photographed;
use super::recipe::{Made, Recipe};
use super::shelf::Shelf;
use super::{Captured, CellGeometry, REFERENCE_SIZE, Reference};
use crate::RenderError;
use crate::ldi::{ClipTree, ConstructOptions, Layered, construct_of_photos};
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

/// A portal's LDI, from one side.
#[derive(Clone, Debug)]
pub struct PortalLdi {
    /// Its samples.
    pub ldi: Layered,
    /// What tells which of its columns are in sight.
    pub tree: ClipTree,
}

impl PortalLdi {
    /// Made ready to be drawn.
    pub(super) fn new(ldi: Layered) -> Self {
        Self {
            tree: ClipTree::new(&ldi),
            ldi,
        }
    }

    fn bytes(&self) -> u64 {
        self.ldi.bytes() + self.tree.bytes()
    }
}

/// Of some places, in order; nothing for one whose images make none.
type Ldis = Vec<Arc<Option<PortalLdi>>>;

/// The places of all reference images, and those images and LDIs that are in memory.
#[derive(Debug)]
pub struct Library {
    options: LibraryOptions,
    places: Vec<SemicircleView>,
    /// Of each portal and direction, one after the other: which places, from left to right.
    sides: Vec<Range<usize>>,
    shelf: Shelf,
    /// The most bytes that an LDI took.
    largest_ldi: u64,
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
            shelf: Shelf::new(places.len(), options.budget),
            largest_ldi: 0,
            places,
            sides,
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
        self.shelf.residency
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
        let side = self.side(portal, from, into).unwrap_or_default();
        let eye_angle = angle_before(interior, interior.portal(portal), Some(from), eye);
        let mut places: Vec<usize> = side.collect();
        let off = |i: &usize| (self.places[*i].angle - eye_angle).abs();
        places.sort_by(|a, b| off(a).total_cmp(&off(b)));
        places.truncate(count);
        places
    }

    /// The LDIs that show what is beyond a portal to an eye; `None` where there are no places.
    pub fn shown(
        &self,
        interior: &Interior,
        portal: PortalId,
        from: CellId,
        into: CellId,
        eye: DVec3,
    ) -> Option<Shown> {
        let side = self.side(portal, from, into)?;
        Some(match self.options.ldi_views {
            None => Shown::alone(neighbourhood::middle(&side)),
            Some(count) => {
                let eye = angle_before(interior, interior.portal(portal), Some(from), eye);
                let places = neighbourhood::places(&side, count);
                neighbourhood::shown(&places, |place| self.places[place].angle, eye)
            }
        })
    }

    /// The places of LDIs beside the one of a place.
    pub(super) fn beside(&self, place: usize) -> Vec<usize> {
        let count = self.options.ldi_views.unwrap_or(usize::MAX);
        let places = neighbourhood::places(&self.side_of(place), count);
        let at = places.partition_point(|i| *i < place);
        let [left, right] = [at.checked_sub(1), Some(at + 1)];
        let beside = [left, right].into_iter().flatten();
        beside.filter_map(|i| places.get(i).copied()).collect()
    }

    /// The places before a portal, on that cell's side.
    fn side(&self, portal: PortalId, from: CellId, into: CellId) -> Option<Range<usize>> {
        let mut sides = self.sides.iter();
        let side = sides.find(|range| {
            let place = &self.places[range.start];
            (place.portal, place.from, place.into) == (portal, Some(from), into)
        });
        side.cloned()
    }

    /// The places of the side that a place is of.
    fn side_of(&self, place: usize) -> Range<usize> {
        let side = self.sides.partition_point(|range| range.end <= place);
        self.sides[side].clone()
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
        self.shelf.begin();
        // 1. What stays is no candidate for leaving.
        let missing = self.shelf.touch_images(places);
        let bytes = Reference::bytes(self.options.size);
        self.shelf.make_room(missing.len() as u64 * bytes);
        // 2. What is missing.
        for &place in &missing {
            let captured = captured.as_deref_mut();
            self.add_image(place, interior, model, geometry, captured)?;
        }
        Ok((self.shelf.images_of(places), missing.len()))
    }

    /// Makes an image, for which there is room.
    pub(super) fn add_image(
        &mut self,
        place: usize,
        interior: &Interior,
        model: &Model,
        geometry: &CellGeometry,
        captured: Option<&mut Captured>,
    ) -> Result<(), RenderError> {
        let (view, size) = (&self.places[place], self.options.size);
        let made = image(interior, model, geometry, view, size, captured)?;
        let bytes = Reference::bytes(size);
        self.shelf.keep_image(place, Arc::new(made), bytes);
        self.shelf.residency.loads += 1;
        Ok(())
    }

    /// The LDIs of a frame by their places, in their order, and how many reference images were
    /// made for them; nothing for a place whose images make none. Others go as for [`Self::images`].
    ///
    /// # Errors
    /// The photos' engine's.
    pub fn ldis(
        &mut self,
        places: &[usize],
        interior: &Interior,
        model: &Model,
        geometry: &CellGeometry,
        mut captured: Option<&mut Captured>,
    ) -> Result<(Ldis, usize), RenderError> {
        self.shelf.begin();
        let mut images = 0;
        for place in self.shelf.touch_ldis(places) {
            let of_photos = match (self.options.ldi_of, captured.as_deref_mut()) {
                (LdiSource::Photos, Some(photos)) => self.of_photos(place, interior, photos)?,
                _ => None,
            };
            if let Some((layered, photos)) = of_photos {
                images += photos;
                self.shelf.residency.loads += photos as u64;
                let ldi = Some(PortalLdi::new(layered));
                self.keep(place, ldi);
                continue;
            }
            let made = self.recipe(place).make(|view, size| {
                let captured = captured.as_deref_mut();
                image(interior, model, geometry, view, size, captured)
            })?;
            images += made.images.len();
            self.take(made, true);
        }
        Ok((self.shelf.ldis_of(places), images))
    }

    /// Whether the LDI of a place is in memory.
    pub(super) fn has_ldi(&self, place: usize) -> bool {
        self.shelf.ldis[place].is_some()
    }

    /// What an LDI of views is made of.
    fn recipe(&self, place: usize) -> Recipe {
        let side = self.side_of(place);
        let count = self.options.ldi_views.unwrap_or(side.len());
        let views = neighbourhood::views(&side, place, count);
        Recipe {
            place,
            center: neighbourhood::middle(&side),
            images: views.iter().map(|i| self.shelf.image(*i)).collect(),
            views: views
                .into_iter()
                .map(|i| (i, self.places[i].clone()))
                .collect(),
            size: self.options.size,
            options: self.options.ldi,
        }
    }

    /// Takes in an LDI of views and the images that were made for it: those serve the LDIs beside it,
    /// too, but are of no more use where all of a side's make one. What no frame needs yet only goes where
    /// there is room.
    pub(super) fn take(&mut self, made: Made, is_needed: bool) {
        self.shelf.residency.loads += made.images.len() as u64;
        let bytes = Reference::bytes(self.options.size);
        let ldi_bytes = made.ldi.as_ref().map_or(0, PortalLdi::bytes);
        self.largest_ldi = self.largest_ldi.max(ldi_bytes);
        if is_needed || self.shelf.make_room(ldi_bytes) {
            self.keep(made.place, made.ldi);
        }
        if self.options.ldi_views.is_some() {
            for (place, image) in made.images {
                if self.shelf.make_room(bytes) {
                    self.shelf.keep_image(place, image, bytes);
                }
            }
        }
    }

    fn keep(&mut self, place: usize, ldi: Option<PortalLdi>) {
        let bytes = ldi.as_ref().map_or(0, PortalLdi::bytes);
        self.shelf.make_room(bytes);
        self.shelf.keep_ldi(place, ldi, bytes);
    }

    /// Of LDIs that frames may need soon, the sooner the earlier, marks those that are there, and tells what
    /// the first that is not is made of; nothing where all are, or where there is no room for it.
    pub(super) fn ahead(&mut self, places: &[usize]) -> Option<Recipe> {
        let missing = self.shelf.touch_ldis(places);
        let recipe = self.recipe(*missing.first()?);
        let views: Vec<usize> = recipe.views.iter().map(|(i, _)| *i).collect();
        let images = self.shelf.touch_images(&views).len() as u64;
        let bytes = images * Reference::bytes(self.options.size) + self.largest_ldi;
        self.shelf.make_room(bytes).then_some(recipe)
    }

    /// The LDI of the photos that see through the portal of a place, in the camera of the middle of its
    /// semicircle, and how many they are; nothing where none does.
    fn of_photos(
        &self,
        place: usize,
        interior: &Interior,
        captured: &mut Captured,
    ) -> Result<Option<(Layered, usize)>, RenderError> {
        let places = &self.places[self.side_of(place)];
        let Some(photos) = photographed(interior, places, self.options.size, captured)? else {
            return Ok(None);
        };
        let images: Vec<&Reference> = photos.images.iter().collect();
        let (place, options) = (&places[places.len() / 2], &self.options.ldi);
        let made = construct_of_photos(place, &photos.camera, &images, photos.noise, options);
        Ok(made.ok().map(|made| (made.ldi, images.len())))
    }
}

/// What a place sees, coloured from photos where they are given.
fn image(
    interior: &Interior,
    model: &Model,
    geometry: &CellGeometry,
    place: &SemicircleView,
    size: [u32; 2],
    captured: Option<&mut Captured>,
) -> Result<Reference, RenderError> {
    match captured {
        Some(captured) => Reference::of_photos(interior, model, geometry, place, size, captured),
        None => Ok(Reference::new(interior, model, geometry, place, size)),
    }
}
