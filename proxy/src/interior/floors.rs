//! How high floors are, of cells and before portals, and which portals are doors.

use super::{CellId, Contents, Interior, Portal, RoomBox};
use glam::DVec3;

/// How high a threshold one steps over, in eye heights.
const STEP: f64 = 0.25;

impl Contents {
    /// How high a cell's floor is, along `up`: the lowest point of its outline, or where that is not
    /// known, of what bounds it; `None` of a cell whose place is unknown.
    pub fn floor_of(&self, interior: &Interior, id: CellId) -> Option<f64> {
        let outline = interior.cells.get(id.0 as usize)?.floor.as_ref();
        let lowest = |corners: &[DVec3]| extent(corners, interior.up)[0];
        match (outline, self.bounds_of(id)) {
            (Some(outline), _) => Some(lowest(outline.corners())),
            (None, Some(room)) => Some(lowest(&room.corners())),
            (None, None) => None,
        }
    }

    /// How high the floor is before a portal on the side of a cell (none: the outside), along `up`.
    ///
    /// It is the higher of the floors of the portal's two cells, if that is at most a step below its
    /// sill: a cell of several storeys has its own floor on the lowest. Else, as before a window, it
    /// is the lowest point of the viewer's cell, or where the place of that is unknown, of the portal.
    pub fn floor_height(&self, interior: &Interior, from: Option<CellId>, portal: &Portal) -> f64 {
        let [sill, head] = extent(portal.polygon.corners(), interior.up);
        // On a floor that is over the opening nobody looks through it.
        let threshold = self.threshold(interior, portal);
        let threshold = threshold.filter(|floor| *floor < head);
        threshold
            .or_else(|| self.floor_of(interior, from?))
            .unwrap_or(sill)
    }

    /// Whether one can walk through a portal, and it is no window: a floor of its cells is at most a
    /// step below its sill, or neither is known.
    pub fn is_door(&self, interior: &Interior, portal: &Portal) -> bool {
        let mut cells = portal.cells.into_iter().flatten();
        let is_known = cells.any(|id| self.floor_of(interior, id).is_some());
        !is_known || self.threshold(interior, portal).is_some()
    }

    /// The higher floor of a portal's cells, if it is at most a step below the sill.
    fn threshold(&self, interior: &Interior, portal: &Portal) -> Option<f64> {
        let [sill, _] = extent(portal.polygon.corners(), interior.up);
        let cells = portal.cells.into_iter().flatten();
        let floors = cells.filter_map(|id| self.floor_of(interior, id));
        let higher = floors.reduce(f64::max)?;
        (sill - higher <= STEP * interior.eye_height).then_some(higher)
    }

    /// What bounds a cell, if that is known.
    pub(super) fn bounds_of(&self, id: CellId) -> Option<RoomBox> {
        self.bounds.get(id.0 as usize).copied().flatten()
    }
}

/// How high the lowest and the highest of some points are.
pub(super) fn extent(points: &[DVec3], up: DVec3) -> [f64; 2] {
    let heights = points.iter().map(|p| p.dot(up));
    heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], h| {
        [low.min(h), high.max(h)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interior::{Content, SemicircleOptions, parse_rooms, semicircles};
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
                let found = contents.floor_height(&interior, from, portal);
                assert_eq!(found, floor, "{} from {from:?}", portal.name);
            }
        }
        // There cameras are at eye height.
        for view in semicircles(&interior, &contents, &SemicircleOptions::default()) {
            let height = view.camera_from_world.center().y;
            if view.portal.0 < 2 {
                let floor = [0.0, 2.8][view.portal.0 as usize];
                assert!((height - floor - 1.6).abs() < 1e-9, "{view:?}");
            }
        }
    }

    #[test]
    fn cameras_stand_where_triangles_say_that_rooms_are_as_where_boxes_do() {
        let (interior, _) = parse_rooms(Path::new("r.json"), STAIRS.as_bytes(), "m.glb").unwrap();
        let (contents, _) = Contents::new(&interior, &Model::default()).unwrap();
        let options = SemicircleOptions::default();
        let of_boxes = semicircles(&interior, &contents, &options);
        // The same places, which only the triangles of nodes tell.
        let mut of_nodes = interior.clone();
        for cell in &mut of_nodes.cells {
            cell.content = Content::Nodes(vec![format!("cell:{}", cell.name)]);
        }
        assert_eq!(semicircles(&of_nodes, &contents, &options), of_boxes);
        // Before the window they are over the floor, not over the sill, and those too far off are not
        // in the room.
        let lower = Some(CellId(1));
        for portal in &mut of_nodes.portals {
            portal.cells = portal.cells.map(|side| side.or(Some(CellId(3))));
        }
        of_nodes.portals[3].radius = Some(4.5);
        let views = semicircles(&of_nodes, &contents, &options);
        let views = views.iter().filter(|v| v.portal.0 == 3 && v.from == lower);
        let mut is_inside = Vec::new();
        for view in views {
            assert!((view.camera_from_world.center().y - 1.6).abs() < 1e-9);
            is_inside.push(view.is_inside);
        }
        assert!(is_inside.len() == 13 && !is_inside[6], "{is_inside:?}");
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
