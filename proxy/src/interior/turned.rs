//! Which way round a portal's outline goes, by which cell is right before it, and which behind.
//!
//! Where whole cells are says little: the middle of one that goes round a corner may lie behind its
//! own door, beyond the next room.

use super::locate::height_over;
use super::seen::{Seen, TURN};
use super::{CellId, Contents, Interior, Portal};
use glam::DVec3;

/// The first places that are looked at are so far from a portal's centre, in shares of its size;
/// each next pair is farther by a factor, up to about its size. Cells may leave out the wall between
/// them, or both have it.
const NEAREST: f64 = 0.015;
const FARTHER: f64 = 1.25;
const PLACES: usize = 20;
/// So much more of cells must be on their sides than on the others, or the other way, in cells.
const CLEAR: f64 = 0.25;
/// Rays into the half of all directions that lies ahead.
const RAYS: u32 = 64;

/// Whether an outline goes the other way round. `presence` is how much of a cell, from 0 to 1, is
/// known to be at a place before or behind the portal, looking away from it.
///
/// Only if no cell is known to be near, the middles of cells tell; where cells are, but as much on
/// the one side as on the other, the outline is believed.
fn is_turned(
    portal: &Portal,
    presence: impl Fn(CellId, DVec3, DVec3) -> f64,
    middle: impl Fn(CellId) -> Option<DVec3>,
) -> bool {
    // 1. Nearby.
    let polygon = &portal.polygon;
    let mut reach = NEAREST * polygon.size();
    let mut is_any_near = false;
    for _ in 0..PLACES {
        let mut more_on_own_side = 0.0_f64;
        for (cell, side) in portal.cells.into_iter().zip([1.0, -1.0]) {
            let Some(cell) = cell else { continue };
            let [own, other] = [side, -side].map(|side| {
                let ahead = side * polygon.normal();
                presence(cell, polygon.center() + reach * ahead, ahead)
            });
            is_any_near |= own > 0.0 || other > 0.0;
            more_on_own_side += own - other;
        }
        if more_on_own_side.abs() >= CLEAR {
            return more_on_own_side < 0.0;
        }
        reach *= FARTHER;
    }
    if is_any_near {
        return false;
    }
    // 2. By the middles.
    match portal
        .cells
        .map(|cell| Some(polygon.height(middle(cell?)?)))
    {
        [Some(front), Some(back)] => front < back,
        [Some(front), None] => front < 0.0,
        [None, Some(back)] => back > 0.0,
        [None, None] => false,
    }
}

impl Interior {
    /// Whether a portal's outline goes the other way round, by its cells' boxes and floors.
    pub(super) fn is_turned(&self, portal: &Portal) -> bool {
        let presence = |id: CellId, at: DVec3, _| f64::from(self.is_at(id, at));
        is_turned(portal, presence, |id| self.middle(id))
    }

    /// Whether a point is in a cell's box and over its floor, as far as it has them.
    fn is_at(&self, id: CellId, point: DVec3) -> bool {
        let cell = self.cell(id);
        match (cell.content.room(), &cell.floor) {
            (None, None) => false,
            (room, floor) => {
                room.is_none_or(|room| room.contains(point))
                    && floor
                        .as_ref()
                        .is_none_or(|floor| height_over(floor, self.up, point).is_some())
            }
        }
    }

    /// About where a cell is, by its own words.
    fn middle(&self, id: CellId) -> Option<DVec3> {
        let cell = self.cell(id);
        match &cell.floor {
            Some(floor) => Some(floor.center()),
            None => cell.content.room().map(|room| room.min.midpoint(room.max)),
        }
    }
}

impl Contents {
    /// Whether a portal's outline goes the other way round, by what one sees looking out of it, for cells
    /// that have neither boxes nor floors; `seen` are these contents.
    pub(super) fn is_turned(&self, seen: &Seen, portal: &Portal) -> bool {
        let middle = |id: CellId| {
            let bounds = self.bounds[id.0 as usize]?;
            Some(bounds.min.midpoint(bounds.max))
        };
        is_turned(
            portal,
            |id, from, ahead| share(seen, id, from, ahead),
            middle,
        )
    }
}

/// In which share of the directions ahead a cell is the first that one sees, those straight
/// ahead counting most.
fn share(seen: &Seen, id: CellId, from: DVec3, ahead: DVec3) -> f64 {
    let x = ahead.any_orthonormal_vector();
    let y = ahead.cross(x);
    let is_seen = |i: &u32| {
        // Evenly over the disc below a half sphere, so by their cosines on it.
        let inner = (f64::from(*i) + 0.5) / f64::from(RAYS);
        let (sin, cos) = (TURN * f64::from(*i)).sin_cos();
        let ray = inner.sqrt() * (cos * x + sin * y) + (1.0 - inner).sqrt() * ahead;
        let first = seen.first(from, ray);
        first.is_some_and(|(_, cells)| cells.contains(&id))
    };
    (0..RAYS).filter(is_seen).count() as f64 / f64::from(RAYS)
}
