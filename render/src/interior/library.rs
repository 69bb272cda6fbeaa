//! The reference images of an interior, made when they are first asked for.

use super::{CellGeometry, REFERENCE_SIZE, Reference};
use crate::residency::Residency;
use glam::DVec3;
use proxy::interior::{
    CellId, Interior, PortalId, SemicircleOptions, SemicircleView, angle_before, semicircles,
};
use proxy::mesh::Model;
use std::ops::Range;
use std::sync::Arc;

/// How reference images are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LibraryOptions {
    /// Width and height in pixels, 1 to 4096.
    pub size: [u32; 2],
    /// Where they are made.
    pub semicircles: SemicircleOptions,
    /// The most bytes that they may take between frames; `None` for no limit. A frame has all
    /// that it needs, even if they are more. No picture depends on it.
    pub budget: Option<u64>,
}

impl Default for LibraryOptions {
    fn default() -> Self {
        Self {
            size: REFERENCE_SIZE,
            semicircles: SemicircleOptions::default(),
            budget: None,
        }
    }
}

/// The places of all reference images, and those images that are in memory.
#[derive(Debug)]
pub struct Library {
    size: [u32; 2],
    places: Vec<SemicircleView>,
    /// Of each portal and direction, one after the other: which places, from left to right.
    sides: Vec<Range<usize>>,
    /// By place, with the turn that it was last used in.
    images: Vec<Option<(Arc<Reference>, u64)>>,
    /// Counts frames.
    turn: u64,
    residency: Residency,
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
            images: vec![None; places.len()],
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

    /// The images of a frame's places, in their order, and how many were made for it. Others go,
    /// those not used for longest first, as far as the budget asks.
    pub fn images(
        &mut self,
        places: &[usize],
        interior: &Interior,
        model: &Model,
        geometry: &CellGeometry,
    ) -> (Vec<Arc<Reference>>, usize) {
        self.turn += 1;
        // 1. What stays is no candidate for leaving.
        let mut missing: Vec<usize> = Vec::new();
        for &place in places {
            match &mut self.images[place] {
                Some((_, used)) => *used = self.turn,
                None if !missing.contains(&place) => missing.push(place),
                None => {}
            }
        }
        let needed = missing.len() as u64 * Reference::bytes(self.size);
        self.make_room(needed);
        // 2. What is missing.
        for &place in &missing {
            let made = Reference::new(interior, model, geometry, &self.places[place], self.size);
            self.images[place] = Some((Arc::new(made), self.turn));
            self.residency.change(Reference::bytes(self.size), 0);
            self.residency.loads += 1;
        }
        let image = |place: &usize| self.images[*place].as_ref().map(|(image, _)| image.clone());
        (places.iter().filter_map(image).collect(), missing.len())
    }

    fn make_room(&mut self, bytes: u64) {
        while !self.residency.allows(self.residency.held + bytes) {
            let others = self.images.iter().enumerate();
            let others = others.filter_map(|(i, image)| Some((image.as_ref()?.1, i)));
            let Some((_, oldest)) = others.filter(|(used, _)| *used < self.turn).min() else {
                return;
            };
            self.images[oldest] = None;
            self.residency.change(0, Reference::bytes(self.size));
            self.residency.evictions += 1;
        }
    }
}
