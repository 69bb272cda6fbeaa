//! The reference images of an interior and the LDIs of them, made when they are first asked for.

use super::neighbourhood::{self, Shown};
use super::photographed::photographed;
use super::recipe::{Made, Recipe};
use super::shelf::Shelf;
use super::{Captured, CellGeometry, Reference};
use crate::RenderError;
use crate::ldi::{ClipTree, Layered, construct_of_photos};
use crate::residency::Residency;
use glam::DVec3;
use proxy::interior::{
    CellId, Contents, Interior, PortalId, SemicircleView, angle_before, semicircles,
};
use proxy::mesh::Model;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::SystemTime;

mod files;
mod options;

pub use options::{LdiSource, LibraryOptions};

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

/// What LDIs took that were not in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LdiCost {
    /// LDIs made.
    pub made: usize,
    /// Reference images made for them.
    pub images: usize,
    /// LDIs read from files.
    pub read: usize,
}

/// The places of all reference images, and those images and LDIs that are in memory.
#[derive(Debug)]
pub struct Library {
    options: LibraryOptions,
    places: Vec<SemicircleView>,
    /// Of each portal and direction, one after the other: which places, from left to right.
    sides: Vec<Range<usize>>,
    shelf: Shelf,
    /// Of each place, the file that its LDI is in, if there is one, and when it was written.
    files: Vec<Option<(PathBuf, SystemTime)>>,
    /// The most bytes that an LDI took.
    largest_ldi: u64,
}

impl Library {
    /// Places of an interior; no image is made. Where LDIs are of views, there are none before portals that lie flat
    /// ([`Portal::lies_flat`](proxy::interior::Portal::lies_flat)): beyond those all is geometry.
    pub fn new(interior: &Interior, contents: &Contents, options: &LibraryOptions) -> Self {
        let mut places = semicircles(interior, contents, &options.semicircles);
        if options.ldi_of == LdiSource::Views {
            // Before those that lie flat no frame needs any; photos are where they are.
            places.retain(|place| !interior.portal(place.portal).lies_flat(interior.up));
        }
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
            files: vec![None; places.len()],
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

    /// The LDIs of a frame by their places, in their order, and what they took; nothing for a place
    /// whose images make none. Those that have files are read, the rest are made. Others go as for
    /// [`Self::images`].
    ///
    /// # Errors
    /// The photos' engine's; a file that holds no such LDI.
    pub fn ldis(
        &mut self,
        places: &[usize],
        interior: &Interior,
        model: &Model,
        geometry: &CellGeometry,
        mut captured: Option<&mut Captured>,
    ) -> Result<(Ldis, LdiCost), RenderError> {
        self.shelf.begin();
        let mut cost = LdiCost::default();
        for place in self.shelf.touch_ldis(places) {
            if let Some(ldi) = self.read(place)? {
                self.keep(place, Some(ldi));
                cost.read += 1;
                continue;
            }
            let captured = captured.as_deref_mut();
            cost.images += self.make(place, interior, model, geometry, captured)?;
            cost.made += 1;
        }
        Ok((self.shelf.ldis_of(places), cost))
    }

    /// Makes the LDI of a place whatever is in files, and lets go what is of other sides; nothing where
    /// its images make none.
    ///
    /// # Errors
    /// The photos' engine's.
    pub(super) fn make_alone(
        &mut self,
        place: usize,
        interior: &Interior,
        model: &Model,
        geometry: &CellGeometry,
        captured: Option<&mut Captured>,
    ) -> Result<Arc<Option<PortalLdi>>, RenderError> {
        self.shelf.begin();
        self.shelf.keep_only(&self.side_of(place));
        self.make(place, interior, model, geometry, captured)?;
        Ok(self.shelf.ldis_of(&[place]).pop().unwrap_or_default())
    }

    /// Makes the LDI of a place; how many reference images were made for it.
    fn make(
        &mut self,
        place: usize,
        interior: &Interior,
        model: &Model,
        geometry: &CellGeometry,
        mut captured: Option<&mut Captured>,
    ) -> Result<usize, RenderError> {
        let of_photos = match (self.options.ldi_of, captured.as_deref_mut()) {
            (LdiSource::Photos, Some(photos)) => self.of_photos(place, interior, photos)?,
            _ => None,
        };
        if let Some((layered, photos)) = of_photos {
            self.shelf.residency.loads += photos as u64;
            self.keep(place, Some(PortalLdi::new(layered)));
            return Ok(photos);
        }
        let made = self.recipe(place).make(|view, size| {
            let captured = captured.as_deref_mut();
            image(interior, model, geometry, view, size, captured)
        })?;
        let images = made.images.len();
        self.take(made, true);
        Ok(images)
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
    /// the first that is neither there nor in a file is made of; nothing where there is none, or no room for
    /// it.
    pub(super) fn ahead(&mut self, places: &[usize]) -> Option<Recipe> {
        let mut missing = self.shelf.touch_ldis(places).into_iter();
        let recipe = self.recipe(missing.find(|place| self.files[*place].is_none())?);
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
