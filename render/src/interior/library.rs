//! The reference images of an interior, made when they are first asked for.

use super::{CellGeometry, REFERENCE_SIZE, Reference};
use glam::DVec3;
use proxy::interior::{
    CellId, Interior, PortalId, SemicircleOptions, SemicircleView, angle_before, semicircles,
};
use proxy::mesh::Model;
use std::ops::Range;
use std::sync::OnceLock;

/// How reference images are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LibraryOptions {
    /// Width and height in pixels, 1 to 4096.
    pub size: [u32; 2],
    /// Where they are made.
    pub semicircles: SemicircleOptions,
}

impl Default for LibraryOptions {
    fn default() -> Self {
        Self {
            size: REFERENCE_SIZE,
            semicircles: SemicircleOptions::default(),
        }
    }
}

/// The places of all reference images, and those images that were made.
#[derive(Debug)]
pub struct Library {
    size: [u32; 2],
    places: Vec<SemicircleView>,
    /// Of each portal and direction, one after the other: which places, from left to right.
    sides: Vec<Range<usize>>,
    made: Vec<OnceLock<Reference>>,
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
            size: options.size.map(|n| n.clamp(1, 4096)),
            made: places.iter().map(|_| OnceLock::new()).collect(),
            places,
            sides,
        }
    }

    /// How many images there may be, and how many were made.
    pub fn counts(&self) -> (usize, usize) {
        let made = self.made.iter().filter(|image| image.get().is_some());
        (self.made.len(), made.count())
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
        let is_meant = |range: &&Range<usize>| {
            let place = &self.places[range.start];
            (place.portal, place.from, place.into) == (portal, Some(from), into)
        };
        let range = self.sides.iter().find(is_meant).cloned().unwrap_or(0..0);
        let eye_angle = angle_before(interior, interior.portal(portal), Some(from), eye);
        let mut places: Vec<usize> = range.collect();
        let off = |i: &usize| (self.places[*i].angle - eye_angle).abs();
        places.sort_by(|a, b| off(a).total_cmp(&off(b)));
        places.truncate(count);
        places
    }

    /// The image of a place, made now if it was not yet.
    pub fn image(
        &self,
        place: usize,
        interior: &Interior,
        model: &Model,
        geometry: &CellGeometry,
    ) -> &Reference {
        let place_of = &self.places[place];
        let make = || Reference::new(interior, model, geometry, place_of, self.size);
        self.made[place].get_or_init(make)
    }

    /// Whether the image of a place was made.
    pub fn is_made(&self, place: usize) -> bool {
        self.made[place].get().is_some()
    }
}
