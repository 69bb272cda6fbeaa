//! What must hold of an interior, and what is odd about one.

use super::by_cell::PortalsByCell;
use super::{CellId, Content, Interior, InteriorError, InteriorWarning, Polygon, RoomBox};
use glam::{DMat3, DVec3};
use std::collections::BTreeSet;

/// What may be due to rounding, in shares of a box's or polygon's size.
const ROUNDING: f64 = 1e-6;
/// The largest number that a length or a place may have: squares and cubes of larger ones, and what is counted in
/// eye heights, leave what numbers can hold.
const MOST: f64 = 1e12;
/// Overlaps that are told: of many boxes in one place, there would be their number squared.
const MAX_OVERLAPS: usize = 64;
/// Of floors whose normal is farther from up than 60° nobody takes one for a ramp: the cosine.
const STEEP: f64 = 0.5;
/// Eyes that are lower than this over a floor, in heights of the lowest cell, are told. In a church they are not; of
/// units taken for others, metres for inches are nearest to it (0.016).
const LOW_EYES: f64 = 0.05;

impl RoomBox {
    /// Whether two share more than a side.
    pub(super) fn overlaps(&self, other: &Self) -> bool {
        let shared = self.max.min(other.max) - self.min.max(other.min);
        let size = (self.max - self.min).min(other.max - other.min);
        shared.cmpgt(ROUNDING * size).all()
    }
}

impl Interior {
    /// Checks an interior that was made or changed in memory, as reading one from a file does.
    ///
    /// # Errors
    /// The first contradiction found.
    pub fn check(&self) -> Result<Vec<InteriorWarning>, InteriorError> {
        self.check_cells()?;
        self.check_portals()?;
        Ok(self.oddities())
    }

    /// The part of [`Self::check`] that is not about portals, which are told by cells' names.
    pub(super) fn check_cells(&self) -> Result<(), InteriorError> {
        if !(self.eye_height > 0.0 && self.eye_height.is_finite()) {
            let what = "`eye_height`".to_owned();
            return Err(InteriorError::Length(what, self.eye_height));
        }
        no_more("`eye_height`", &[self.eye_height])?;
        if !((self.up.length() - 1.0).abs() < 1e-6) {
            return Err(InteriorError::Up(self.up.to_array()));
        }
        if self.cells.is_empty() {
            return Err(InteriorError::NoCells);
        }
        unique("cell", "cells", self.cells.iter().map(|c| c.name.as_str()))?;
        for cell in &self.cells {
            if let Some(RoomBox { min, max }) = cell.content.room()
                && !(min.cmplt(max).all() && min.is_finite() && max.is_finite())
            {
                return Err(InteriorError::Box(cell.name.clone()));
            }
            if let Some(RoomBox { min, max }) = cell.content.room() {
                let what = format!("the box of cell `{}`", cell.name);
                no_more(&what, &[min.to_array(), max.to_array()].concat())?;
            }
            if let Some(floor) = &cell.floor {
                let what = format!("the floor of cell `{}`", cell.name);
                near(&what, floor)?;
            }
            if self.model.is_none() && !matches!(cell.content, Content::Scene { .. }) {
                return Err(InteriorError::NoModel(cell.name.clone()));
            }
        }
        Ok(())
    }

    fn check_portals(&self) -> Result<(), InteriorError> {
        let names = self.portals.iter().map(|p| p.name.as_str());
        unique("portal", "portals", names)?;
        for portal in &self.portals {
            if let Some(radius) = portal.radius
                && !(radius > 0.0 && radius.is_finite())
            {
                let what = format!("the radius of portal `{}`", portal.name);
                return Err(InteriorError::Length(what, radius));
            }
            let radius = portal.radius.as_slice();
            no_more(&format!("the radius of portal `{}`", portal.name), radius)?;
            let outline = format!("the outline of portal `{}`", portal.name);
            near(&outline, &portal.polygon)?;
            if portal.cells[0] == portal.cells[1] {
                let side = portal.cells[0].and_then(|id| self.cells.get(id.0 as usize));
                let side = side.map_or("null".to_owned(), |cell| format!("`{}`", cell.name));
                return Err(InteriorError::SameCell(portal.name.clone(), side));
            }
            let is_unknown = |id: &CellId| id.0 as usize >= self.cells.len();
            if let Some(id) = portal.cells.into_iter().flatten().find(is_unknown) {
                return Err(InteriorError::UnknownCell {
                    portal: portal.name.clone(),
                    cell: id.0.to_string(),
                    known: self.cell_names(),
                });
            }
        }
        Ok(())
    }

    /// For messages.
    pub(super) fn cell_names(&self) -> String {
        let names: Vec<&str> = self.cells.iter().map(|c| c.name.as_str()).collect();
        names.join(", ")
    }

    /// What is odd about the eyes' height, as far as cells have boxes: they are over all of them, or next to the
    /// floor.
    pub fn odd_eye_height(&self) -> Option<InteriorWarning> {
        self.odd_eyes_in(self.cells.iter().filter_map(|cell| cell.content.room()))
    }

    /// The same of cells that these bound.
    pub(super) fn odd_eyes_in(
        &self,
        rooms: impl Iterator<Item = RoomBox>,
    ) -> Option<InteriorWarning> {
        let eye_height = self.eye_height;
        let none = (f64::INFINITY, f64::NEG_INFINITY);
        let height = |room: RoomBox| {
            let corners = room.corners().map(|p| p.dot(self.up));
            let span = corners
                .into_iter()
                .fold(none, |(l, h), x| (l.min(x), h.max(x)));
            span.1 - span.0
        };
        // What is flat has no ceiling.
        let heights = rooms.map(height).filter(|height| *height > 0.0);
        let (least, most) = heights.fold(none, |(l, h), x| (l.min(x), h.max(x)));
        let is_odd = least <= most && (eye_height > most || eye_height < LOW_EYES * least);
        is_odd.then_some(InteriorWarning::EyeHeight {
            eye_height,
            least,
            most,
        })
    }

    fn oddities(&self) -> Vec<InteriorWarning> {
        let mut found = Vec::from_iter(self.odd_eye_height());
        let boxes: Vec<(&str, RoomBox)> = self
            .cells
            .iter()
            .filter(|cell| cell.floor.is_none())
            .filter_map(|cell| Some((cell.name.as_str(), cell.content.room()?)))
            .collect();
        for (i, (name, a)) in boxes.iter().enumerate() {
            for (other, b) in &boxes[..i] {
                if found.len() < MAX_OVERLAPS && a.overlaps(b) {
                    let names = ((*other).to_owned(), (*name).to_owned());
                    found.push(InteriorWarning::Overlap(names.0, names.1));
                }
            }
        }
        let portals = PortalsByCell::new(self);
        for (id, cell) in (0..).map(CellId).zip(&self.cells) {
            if portals.of(id).is_empty() && self.cells.len() > 1 {
                found.push(InteriorWarning::NoPortal(cell.name.clone()));
            }
            if cell.other.contains_key("held_out") {
                found.push(InteriorWarning::HeldOut(cell.name.clone()));
            }
        }
        for cell in &self.cells {
            let Some(floor) = &cell.floor else {
                continue;
            };
            if !(floor.normal().dot(self.up).abs() >= STEEP) {
                // Whether it is over the box is another question.
                found.push(InteriorWarning::FloorSteep(cell.name.clone()));
                continue;
            }
            let Some(room) = cell.content.room() else {
                continue;
            };
            if let Some(distance) = self.floor_away(floor, &room) {
                found.push(InteriorWarning::FloorAway {
                    cell: cell.name.clone(),
                    distance,
                });
            } else if self.is_floor_high(floor, &room) {
                found.push(InteriorWarning::FloorHigh(cell.name.clone()));
            }
        }
        for portal in &self.portals {
            for id in portal.cells.into_iter().flatten() {
                let cell = self.cell(id);
                let Some(room) = cell.content.room() else {
                    continue;
                };
                if let Some(distance) = away(&portal.polygon, &room) {
                    found.push(InteriorWarning::Away {
                        portal: portal.name.clone(),
                        cell: cell.name.clone(),
                        distance,
                    });
                }
            }
            if self.is_turned(portal) {
                found.push(InteriorWarning::Turned(portal.name.clone()));
            }
        }
        found
    }

    /// How far a cell's floor is from its box, in world units, where no part of its outline is over the box, it
    /// is above the box, or so far below that not even eyes over it are in the box.
    fn floor_away(&self, floor: &Polygon, room: &RoomBox) -> Option<f64> {
        let (low, high) = self.span(&room.corners());
        let (floor_low, floor_high) = self.span(floor.corners());
        let apart = |below: DVec3| (floor_low - high).max(low - floor_high - below);
        let eyes = DVec3::new(0.0, self.eye_height, 0.0);
        let is_outside = apart(eyes).cmpgt(-ROUNDING * (high - low)).any();
        is_outside.then(|| apart(DVec3::ZERO).max(DVec3::ZERO).length())
    }

    /// Whether eyes over a cell's floor, where that is lowest, are above the cell's box, though over the box's own
    /// bottom they are not.
    fn is_floor_high(&self, floor: &Polygon, room: &RoomBox) -> bool {
        let (low, high) = self.span(&room.corners());
        let (floor_low, _) = self.span(floor.corners());
        let most = high.y + ROUNDING * (high.y - low.y);
        low.y + self.eye_height <= most && floor_low.y + self.eye_height > most
    }

    /// From where to where points lie along two axes of the plan, and along the one between, y, which is up.
    fn span(&self, points: &[DVec3]) -> (DVec3, DVec3) {
        let across = self.up.any_orthonormal_vector();
        let to_plan = DMat3::from_cols(across, self.up, self.up.cross(across)).transpose();
        let places = points.iter().map(|p| to_plan * *p);
        places.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
            (low.min(p), high.max(p))
        })
    }
}

/// How far a portal's middle is from the box of one of its cells, in world units, where that is too far for one.
pub(super) fn away(portal: &Polygon, room: &RoomBox) -> Option<f64> {
    let distance = room.distance(portal.center());
    (distance > 0.5 * portal.size()).then_some(distance)
}

/// Fails where a record of numbers has one that is too large.
fn no_more(record: &str, numbers: &[f64]) -> Result<(), InteriorError> {
    match numbers.iter().find(|x| x.abs() > MOST) {
        Some(found) => Err(InteriorError::Huge(record.to_owned(), *found)),
        None => Ok(()),
    }
}

/// The same of a polygon's corners.
fn near(record: &str, polygon: &Polygon) -> Result<(), InteriorError> {
    let mut corners = polygon.corners().iter();
    corners.try_for_each(|corner| no_more(record, &corner.to_array()))
}

fn unique<'a>(
    one: &'static str,
    several: &'static str,
    names: impl Iterator<Item = &'a str>,
) -> Result<(), InteriorError> {
    let mut seen = BTreeSet::new();
    for name in names {
        if name.is_empty() {
            return Err(InteriorError::NoName(one));
        }
        if !seen.insert(name) {
            return Err(InteriorError::DuplicateName(several, name.to_owned()));
        }
    }
    Ok(())
}
