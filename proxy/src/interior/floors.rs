//! How high floors are, of cells and before portals, and which portals are doors.

use super::{CellId, Contents, Interior, Portal, RoomBox};
use crate::mesh::Model;
use glam::DVec3;

/// How high a threshold one steps over, in eye heights.
const STEP: f64 = 0.25;
/// How far before a portal its floor is looked for, in eye heights: beyond the wall, where one sets foot.
const BEFORE: [f64; 3] = [0.2, 0.3, 0.4];

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

    /// How high the floor is before a portal on the side of a cell (none: the outside), along `up`: as high as in it
    /// ([`Self::floor_within`]), but where the cell's triangles are far below, as a hall's before a gallery, its own.
    pub fn floor_height(&self, interior: &Interior, from: Option<CellId>, portal: &Portal) -> f64 {
        let side = from.filter(|id| self.aloft.contains(&(portal.name.clone(), *id)));
        let own = side.and_then(|id| self.floor_of(interior, id));
        own.unwrap_or_else(|| self.floor_within(interior, from, portal))
    }

    /// How high the floor is for one who passes a portal from the side of a cell (none: the outside), along `up`.
    ///
    /// It is the higher of the floors of the portal's two cells, if that is at most a step below its
    /// sill: a cell of several storeys has its own floor on the lowest. Else, as before a window, it
    /// is the lowest point of the viewer's cell, and outside of the cell within. Where that is not known it is the
    /// lowest point of the portal, and so it is outside of one that lies flat, a hatch in a roof.
    pub fn floor_within(&self, interior: &Interior, from: Option<CellId>, portal: &Portal) -> f64 {
        let [sill, head] = extent(portal.polygon.corners(), interior.up);
        // On a floor that is over the opening nobody looks through it.
        let threshold = self.threshold(interior, portal);
        let threshold = threshold.filter(|floor| *floor < head);
        let own = || match from {
            Some(id) => self.floor_of(interior, id),
            None if portal.lies_flat(interior.up) => None,
            None => self
                .higher_floor(interior, portal)
                .filter(|floor| *floor < sill),
        };
        threshold.or_else(own).unwrap_or(sill)
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
        let higher = self.higher_floor(interior, portal)?;
        (sill - higher <= STEP * interior.eye_height).then_some(higher)
    }

    /// The higher floor of a portal's cells, of those that are known.
    fn higher_floor(&self, interior: &Interior, portal: &Portal) -> Option<f64> {
        let cells = portal.cells.into_iter().flatten();
        let floors = cells.filter_map(|id| self.floor_of(interior, id));
        floors.reduce(f64::max)
    }

    /// Whether a portal is a step or more over the floor of one of its cells, and at the other's: only triangles tell
    /// whether the one has something to stand on before it, as a stairwell has and a hall under a gallery has not.
    pub fn has_raised(&self, interior: &Interior) -> bool {
        self.raised(interior).next().is_some()
    }

    /// Finds the sides of portals before which a cell's triangles are far below.
    pub(super) fn find_aloft(&mut self, interior: &Interior, model: &Model) {
        let sides = self.raised(interior);
        let aloft = sides.filter(|(portal, id, floor)| {
            let highest = self.highest_before(interior, model, portal, *id, *floor);
            // Where nothing is, nothing is known.
            highest.is_some_and(|highest| floor - highest > STEP * interior.eye_height)
        });
        let aloft = aloft.map(|(portal, id, _)| (portal.name.clone(), id));
        self.aloft = aloft.collect();
    }

    /// Sides of portals that stand a step or more over the floor of their cell, as high as the other's, which is told.
    fn raised<'a>(
        &'a self,
        interior: &'a Interior,
    ) -> impl Iterator<Item = (&'a Portal, CellId, f64)> + 'a {
        let portals = interior.portals.iter();
        let upright = portals.filter(move |portal| !portal.lies_flat(interior.up));
        upright.flat_map(move |portal| {
            let threshold = self.threshold(interior, portal);
            let cells = portal.cells.into_iter().flatten();
            cells.filter_map(move |id| {
                let (floor, own) = (threshold?, self.floor_of(interior, id)?);
                (floor - own > STEP * interior.eye_height).then_some((portal, id, floor))
            })
        })
    }

    /// How high what a cell has right before the middle of a portal is, of what is no more than a step over a floor.
    fn highest_before(
        &self,
        interior: &Interior,
        model: &Model,
        portal: &Portal,
        id: CellId,
        floor: f64,
    ) -> Option<f64> {
        let (up, unit) = (interior.up, interior.eye_height);
        let normal = portal.normal_into(Some(id));
        let ahead = (normal - up * normal.dot(up)).normalize();
        let places = BEFORE.map(|off| portal.polygon.center() + off * unit * ahead);
        let triangles = self.triangles.get(id.0 as usize)?.iter();
        let heights = triangles.flat_map(|i| {
            let corners = model.mesh.corners(*i as usize);
            places.map(|place| height_at(corners, place, up))
        });
        let low = heights.flatten().filter(|h| *h <= floor + STEP * unit);
        low.reduce(f64::max)
    }

    /// What bounds a cell, if that is known.
    pub(super) fn bounds_of(&self, id: CellId) -> Option<RoomBox> {
        self.bounds.get(id.0 as usize).copied().flatten()
    }
}

/// How high a triangle is over or under a point, along `up`; nothing where it is beside it, or upright.
fn height_at(corners: [DVec3; 3], point: DVec3, up: DVec3) -> Option<f64> {
    let offsets = corners.map(|p| p - point);
    // Areas in the plan, of either sign.
    let area = |i: usize| offsets[(i + 1) % 3].cross(offsets[(i + 2) % 3]).dot(up);
    let areas = [area(0), area(1), area(2)];
    let is_over = areas.iter().all(|a| *a >= 0.0) || areas.iter().all(|a| *a <= 0.0);
    let all: f64 = areas.iter().sum();
    let height: f64 = (0..3).map(|i| areas[i] / all * offsets[i].dot(up)).sum();
    (is_over && height.is_finite()).then(|| point.dot(up) + height)
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
    use crate::mesh::Mesh;
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
            // Each side's own; outside, that of the room within.
            (3, false, [(lower, 0.0), (None, 0.0)]),
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
            if [0, 1, 3].contains(&view.portal.0) {
                let floor = [0.0, 2.8, 0.3, 0.0][view.portal.0 as usize];
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
    fn outside_a_window_eyes_are_as_high_as_within_and_over_a_hatch_in_the_roof_above_it() {
        let (interior, _) = parse_rooms(Path::new("r.json"), STAIRS.as_bytes(), "m.glb").unwrap();
        let (mut contents, _) = Contents::new(&interior, &Model::default()).unwrap();
        let window = &interior.portals[3];
        let views = semicircles(&interior, &contents, &SemicircleOptions::default());
        let outside: Vec<_> = views.iter().filter(|view| view.from.is_none()).collect();
        assert_eq!(outside.len(), 13);
        for view in outside {
            assert!((view.camera_from_world.center().y - 1.6).abs() < 1e-9);
        }
        let mut hatch = interior.portals[4].clone();
        hatch.cells[1] = None;
        assert_eq!(contents.floor_height(&interior, None, &hatch), 2.8);
        // Of a room whose place is unknown the sill is what there is.
        contents.bounds[1] = None;
        assert_eq!(contents.floor_height(&interior, None, window), 1.0);
    }

    /// A hall of 5 m, and behind an opening half way up a gallery.
    const HALL: &str = r#"{"version": 1, "rooms": [
        {"name": "hall", "min": [0, 0, 0], "max": [6, 5, 4]},
        {"name": "gallery", "min": [6, 2.5, 0], "max": [10, 5, 4]}],
        "openings": [{"name": "rail", "between": ["hall", "gallery"],
            "polygon": [[6, 2.5, 0.5], [6, 2.5, 3.5], [6, 4.5, 3.5], [6, 4.5, 0.5]]}]}"#;

    /// Levels, each so high, from x to x.
    fn levels(levels: &[[f64; 3]]) -> Model {
        let mut model = Model::default();
        for [height, from, to] in levels {
            let corner = |x: f64, z: f64| DVec3::new(x, *height, z);
            let mesh = Mesh {
                positions: vec![
                    corner(*from, 0.0),
                    corner(*to, 0.0),
                    corner(*to, 4.0),
                    corner(*from, 4.0),
                ],
                triangles: vec![[0, 1, 2], [0, 2, 3]],
            };
            model.append(&mesh, "level");
        }
        model
    }

    #[test]
    fn before_a_gallery_the_floor_is_that_of_the_hall_but_where_a_landing_is() {
        let (interior, _) = parse_rooms(Path::new("r.json"), HALL.as_bytes(), "m.glb").unwrap();
        let [hall, gallery] = [0, 1].map(|i| Some(CellId(i)));
        let rail = &interior.portals[0];
        let (floor, ceiling, upper) = ([0.0, 0.0, 6.0], [5.0, 0.0, 10.0], [2.5, 6.0, 10.0]);
        // The sill, as deep as half of the wall, is no landing; where nothing is known one is taken for granted.
        let sill = [2.5, 5.9, 6.0];
        for (model, expected) in [
            (levels(&[floor, ceiling, upper]), 0.0),
            (levels(&[floor, ceiling, upper, sill]), 0.0),
            (levels(&[floor, ceiling, upper, [2.5, 4.8, 6.0]]), 2.5),
            (levels(&[ceiling, upper]), 2.5),
            (Model::default(), 2.5),
        ] {
            let (contents, _) = Contents::new(&interior, &model).unwrap();
            assert!(contents.has_raised(&interior));
            assert!(contents.is_door(&interior, rail));
            assert_eq!(contents.floor_height(&interior, hall, rail), expected);
            assert_eq!(contents.floor_height(&interior, gallery, rail), 2.5);
            // Who passes it stands in it.
            for side in [hall, gallery] {
                assert_eq!(contents.floor_within(&interior, side, rail), 2.5);
            }
            for view in semicircles(&interior, &contents, &SemicircleOptions::default()) {
                let floor = if view.from == hall { expected } else { 2.5 };
                let height = view.camera_from_world.center().y;
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
