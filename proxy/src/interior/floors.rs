//! How high floors are, of cells and before portals, and which portals are doors.

use super::{CellId, Contents, Interior, Portal, RoomBox};
use glam::DVec3;

/// How high a threshold one steps over, in eye heights.
const STEP: f64 = 0.25;

impl Interior {
    /// How high the floor is before a portal on the side of a cell (none: the outside), along `up`.
    ///
    /// It is the higher of the floors of the portal's two cells, if that is at most a step below its
    /// sill: a cell of several storeys has its own floor on the lowest. Else, as before a window, it
    /// is the lowest point of the viewer's cell, or where that has neither a box nor a floor, of the
    /// portal.
    pub fn floor_height(&self, from: Option<CellId>, portal: &Portal) -> f64 {
        let floor_of = |id: CellId| {
            let cell = self.cells.get(id.0 as usize)?;
            floor(self, id, cell.content.room())
        };
        before(self, from, portal, floor_of)
    }
}

impl Contents {
    /// How high a cell's floor is, along `up`: the lowest point of its outline, or where that is not
    /// known, of what bounds it; `None` of a cell whose place is unknown.
    pub fn floor_of(&self, interior: &Interior, id: CellId) -> Option<f64> {
        let room = self.bounds.get(id.0 as usize).copied().flatten();
        floor(interior, id, room)
    }

    /// The same as [`Interior::floor_height`], where triangles tell the floors of cells that are
    /// nodes.
    pub fn floor_height(&self, interior: &Interior, from: Option<CellId>, portal: &Portal) -> f64 {
        let floor_of = |id: CellId| self.floor_of(interior, id);
        before(interior, from, portal, floor_of)
    }

    /// Whether one can walk through a portal, and it is no window: a floor of its cells is at most a
    /// step below its sill, or neither is known.
    pub fn is_door(&self, interior: &Interior, portal: &Portal) -> bool {
        let floor_of = |id: CellId| self.floor_of(interior, id);
        let mut cells = portal.cells.into_iter().flatten();
        let is_known = cells.any(|id| floor_of(id).is_some());
        !is_known || threshold(interior, portal, floor_of).is_some()
    }
}

/// See [`Interior::floor_height`].
fn before(
    interior: &Interior,
    from: Option<CellId>,
    portal: &Portal,
    floor_of: impl Fn(CellId) -> Option<f64>,
) -> f64 {
    let [sill, head] = extent(portal.polygon.corners(), interior.up);
    // On a floor that is over the opening nobody looks through it.
    let threshold = threshold(interior, portal, &floor_of).filter(|floor| *floor < head);
    threshold.or_else(|| floor_of(from?)).unwrap_or(sill)
}

/// The higher floor of a portal's cells, if it is at most a step below the sill.
fn threshold(
    interior: &Interior,
    portal: &Portal,
    floor_of: impl Fn(CellId) -> Option<f64>,
) -> Option<f64> {
    let [sill, _] = extent(portal.polygon.corners(), interior.up);
    let floors = portal.cells.into_iter().flatten().filter_map(floor_of);
    let higher = floors.reduce(f64::max)?;
    (sill - higher <= STEP * interior.eye_height).then_some(higher)
}

/// The lowest point of a cell's outline, else of what bounds it.
fn floor(interior: &Interior, id: CellId, room: Option<RoomBox>) -> Option<f64> {
    let outline = interior.cells.get(id.0 as usize)?.floor.as_ref();
    let lowest = |corners: &[DVec3]| extent(corners, interior.up)[0];
    match (outline, room) {
        (Some(outline), _) => Some(lowest(outline.corners())),
        (None, Some(room)) => Some(lowest(&room.corners())),
        (None, None) => None,
    }
}

/// How high the lowest and the highest of some points are.
fn extent(points: &[DVec3], up: DVec3) -> [f64; 2] {
    let heights = points.iter().map(|p| p.dot(up));
    heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], h| {
        [low.min(h), high.max(h)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interior::{SemicircleOptions, parse_rooms, semicircles};
    use crate::mesh::Model;
    use std::path::Path;

    /// A stairwell of two storeys, a room beside each, and beside the lower one a landing two steps up;
    /// doors between them, a window to the outside, and a hatch.
    const STAIRS: &str = r#"{"version": 1, "rooms": [
        {"name": "stairwell", "min": [0, 0, 0], "max": [4, 5.4, 4]},
        {"name": "lower", "min": [4, 0, 0], "max": [9, 2.6, 4]},
        {"name": "upper", "min": [4, 2.8, 0], "max": [9, 5.4, 4]},
        {"name": "landing", "min": [9, 0.3, 0], "max": [12, 2.6, 4]}],
        "openings": [
        {"name": "down", "between": ["stairwell", "lower"],
            "polygon": [[4, 0, 0.5], [4, 0, 1.5], [4, 2, 1.5], [4, 2, 0.5]]},
        {"name": "up", "between": ["stairwell", "upper"],
            "polygon": [[4, 2.8, 2.5], [4, 2.8, 3.5], [4, 4.8, 3.5], [4, 4.8, 2.5]]},
        {"name": "steps", "between": ["lower", "landing"],
            "polygon": [[9, 0.3, 1], [9, 0.3, 2], [9, 2.3, 2], [9, 2.3, 1]]},
        {"name": "window", "between": ["lower", null],
            "polygon": [[5, 1, 0], [6, 1, 0], [6, 2, 0], [5, 2, 0]]},
        {"name": "hatch", "between": ["lower", "upper"],
            "polygon": [[6, 2.8, 1], [7, 2.8, 1], [7, 2.8, 2], [6, 2.8, 2]]}]}"#;

    #[test]
    fn doors_of_every_storey_have_its_floor_before_them() {
        let (interior, _) = parse_rooms(Path::new("r.json"), STAIRS.as_bytes(), "m.glb").unwrap();
        let (contents, _) = Contents::new(&interior, &Model::default()).unwrap();
        let [stairwell, lower, upper, landing] = [0, 1, 2, 3].map(|i| Some(CellId(i)));
        for (i, is_door, sides) in [
            (0, true, [(stairwell, 0.0), (lower, 0.0)]),
            (1, true, [(stairwell, 2.8), (upper, 2.8)]),
            (2, true, [(lower, 0.3), (landing, 0.3)]),
            // Each side's own; outside, the sill.
            (3, false, [(lower, 0.0), (None, 1.0)]),
            (4, true, [(lower, 0.0), (upper, 2.8)]),
        ] {
            let portal = &interior.portals[i];
            assert_eq!(
                contents.is_door(&interior, portal),
                is_door,
                "{}",
                portal.name
            );
            for (from, floor) in sides {
                let found = interior.floor_height(from, portal);
                assert_eq!(found, floor, "{} from {from:?}", portal.name);
                assert_eq!(contents.floor_height(&interior, from, portal), found);
            }
        }
        // There cameras are at eye height.
        for view in semicircles(&interior, &SemicircleOptions::default()) {
            let height = view.camera_from_world.center().y;
            if view.portal.0 < 2 {
                let floor = [0.0, 2.8][view.portal.0 as usize];
                assert!((height - floor - 1.6).abs() < 1e-9, "{view:?}");
            }
        }
    }

    #[test]
    fn of_cells_whose_place_is_unknown_any_opening_may_be_a_door() {
        let (mut interior, _) =
            parse_rooms(Path::new("r.json"), STAIRS.as_bytes(), "m.glb").unwrap();
        let (mut contents, _) = Contents::new(&interior, &Model::default()).unwrap();
        contents.bounds[1] = None;
        let window = interior.portals[3].clone();
        assert_eq!(contents.floor_of(&interior, CellId(1)), None);
        assert!(contents.is_door(&interior, &window));
        // Before it one stands on the sill.
        let from = Some(CellId(1));
        assert_eq!(contents.floor_height(&interior, from, &window), 1.0);
        // An outline tells, too.
        let floor = interior.portals[4].polygon.clone();
        interior.cells[1].floor = Some(floor);
        assert_eq!(contents.floor_of(&interior, CellId(1)), Some(2.8));
        // Cells that are not there are no floor.
        assert_eq!(contents.floor_of(&interior, CellId(9)), None);
    }
}
