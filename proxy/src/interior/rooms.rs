//! Interiors out of models: rooms given by hand (`rooms.json`), or named in the model.
//!
//! ```json
//! {
//!   "version": 1,
//!   "up": [0, 1, 0],
//!   "eye_height": 1.6,
//!   "rooms": [
//!     {"name": "hall", "min": [0, 0, 0], "max": [4, 2.5, 3]},
//!     {"name": "study", "min": [4, 0, 0], "max": [8, 2.5, 3], "floor": [[4, 0, 0], …]}
//!   ],
//!   "openings": [
//!     {"name": "door", "between": ["hall", "study"],
//!      "polygon": [[4, 0, 1], [4, 0, 2], [4, 2, 2], [4, 2, 1]], "radius": 1.5},
//!     {"name": "window", "between": ["hall", null], "polygon": […]}
//!   ]
//! }
//! ```
//!
//! `up` is y, of a capture's rooms as its cameras had it, and `eye_height` 1.6 metres where they are not given;
//! `floor` and `radius` need not be. An outline may go either way round; where boxes do not tell its sides (both
//! are all around it), it is counter-clockwise as the first of its rooms sees it. Boxes should meet in the plane of the
//! opening between them: triangles between boxes are in no cell, and drawn always.
//!
//! In a model, the node `cell:NAME` and all below it are a cell, and the node `portal:A|B`, a
//! flat mesh, is the opening between two of them; `portal:A|` leads outside. What follows
//! another `|` tells openings between the same cells apart, and so does a number that an editor put
//! after the name of a copy (`portal:A|B.001`). A face may be there twice, once from each side.

use super::arrays::{exactly, points, points_or_none};
use super::contents::below;
use super::file::{Stored, StoredBox, StoredCell, StoredPortal, parse_version_1, sides};
use super::seen::Seen;
use super::{
    Cell, CellId, Content, Contents, Extra, Interior, InteriorError, InteriorFileError,
    InteriorWarning, Polygon, Portal,
};
use crate::mesh::{Model, PORTAL_NODE, Place, place};
use glam::DVec3;
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;
use std::path::Path;

/// Where eyes are over the floor where nothing else is said, in metres.
pub const EYE_HEIGHT: f64 = 1.6;

/// What a file says is up is far off what was up for cameras from this angle on: its cosine.
const FAR_OFF: f64 = 0.5;

/// Rooms that a file gives.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenRooms {
    /// They, and the openings between them.
    pub interior: Interior,
    /// What is odd about them.
    pub warnings: Vec<InteriorWarning>,
    /// Whether the file says which way is up; else it is y.
    pub says_up: bool,
}

impl GivenRooms {
    /// Compares with which way was up for a capture's cameras. Where the file does not say it, that axis of the world
    /// is taken which is next to theirs, as boxes stand along axes; where it says something far off, a warning does.
    ///
    /// # Errors
    /// As for [`Interior::check`].
    pub fn ask_cameras(&mut self, up: DVec3) -> Result<(), InteriorError> {
        let next = next_axis(up);
        if !self.says_up {
            let mut interior = self.interior.clone();
            interior.up = next;
            (self.interior, self.warnings) = interior_from_rooms(interior)?;
        } else if self.interior.up.dot(up) < FAR_OFF * up.length() {
            let given = self.interior.up;
            let warning = InteriorWarning::UpOfCameras { given, next };
            self.warnings.insert(0, warning);
        }
        Ok(())
    }
}

/// The axis of the world, either way, that is next to a direction.
fn next_axis(direction: DVec3) -> DVec3 {
    // What is as near to two of them has the first.
    let mut next = DVec3::Y;
    for axis in DVec3::AXES {
        for axis in [axis, DVec3::ZERO - axis] {
            if axis.dot(direction) > next.dot(direction) {
                next = axis;
            }
        }
    }
    next
}

#[derive(Deserialize)]
struct Rooms {
    #[serde(default, deserialize_with = "exactly_some")]
    up: Option<[f64; 3]>,
    eye_height: Option<f64>,
    rooms: Vec<Room>,
    #[serde(default)]
    openings: Vec<Opening>,
}

#[derive(Deserialize)]
struct Room {
    name: String,
    #[serde(deserialize_with = "exactly")]
    min: [f64; 3],
    #[serde(deserialize_with = "exactly")]
    max: [f64; 3],
    #[serde(default, deserialize_with = "points_or_none")]
    floor: Option<Vec<[f64; 3]>>,
}

#[derive(Deserialize)]
struct Opening {
    name: String,
    #[serde(deserialize_with = "exactly")]
    between: [Option<String>; 2],
    #[serde(deserialize_with = "points")]
    polygon: Vec<[f64; 3]>,
    radius: Option<f64>,
}

/// What is there is all there, and no null.
fn exactly_some<'de, D: Deserializer<'de>>(from: D) -> Result<Option<[f64; 3]>, D::Error> {
    exactly(from).map(Some)
}

/// Reads rooms and openings; `model` is the model's file, beside the `interior.json` to be, and `meter` a
/// metre in world units: that is how high eyes are told where the file does not say.
///
/// # Errors
/// The file, and what is wrong with it.
pub fn read_rooms(path: &Path, model: &str, meter: f64) -> Result<GivenRooms, InteriorFileError> {
    let bytes = std::fs::read(path).map_err(|e| InteriorFileError::Io(path.to_owned(), e))?;
    rooms_of(path, &bytes, model, meter)
}

/// Reads the content of a file as [`read_rooms`] does, of a world in metres; y is up where it does not say.
///
/// # Errors
/// As for [`read_rooms`].
pub fn parse_rooms(
    path: &Path,
    bytes: &[u8],
    model: &str,
) -> Result<(Interior, Vec<InteriorWarning>), InteriorFileError> {
    let given = rooms_of(path, bytes, model, 1.0)?;
    Ok((given.interior, given.warnings))
}

fn rooms_of(
    path: &Path,
    bytes: &[u8],
    model: &str,
    meter: f64,
) -> Result<GivenRooms, InteriorFileError> {
    let rooms: Rooms = parse_version_1(path, "a list of rooms", bytes)?;
    let says_up = rooms.up.is_some();
    let failed = |e| InteriorFileError::Interior(path.to_owned(), e);
    let interior = rooms.stored(model, meter).interior().map_err(failed)?;
    let (interior, warnings) = interior_from_rooms(interior).map_err(failed)?;
    Ok(GivenRooms {
        interior,
        warnings,
        says_up,
    })
}

impl Rooms {
    /// The same as an interior's file has it.
    fn stored(self, model: &str, meter: f64) -> Stored {
        let cell = |room: Room| StoredCell {
            name: room.name,
            scene: None,
            nodes: None,
            room: Some(StoredBox {
                min: room.min,
                max: room.max,
            }),
            floor: room.floor,
            other: Extra::new(),
        };
        let portal = |opening: Opening| StoredPortal {
            name: opening.name,
            polygon: opening.polygon,
            cells: opening.between,
            radius: opening.radius,
            other: Extra::new(),
        };
        Stored {
            version: 1,
            model: Some(model.to_owned()),
            up: self.up.unwrap_or(DVec3::Y.to_array()),
            eye_height: self.eye_height.unwrap_or(EYE_HEIGHT * meter),
            cells: self.rooms.into_iter().map(cell).collect(),
            portals: self.openings.into_iter().map(portal).collect(),
            held_out: Vec::new(),
            other: Extra::new(),
        }
    }
}

/// Turns the outlines round that go the other way, by which cell is before them and which behind,
/// and checks the whole.
///
/// # Errors
/// As for [`Interior::check`].
pub fn interior_from_rooms(
    mut interior: Interior,
) -> Result<(Interior, Vec<InteriorWarning>), InteriorError> {
    interior.check()?;
    let portals = interior.portals.iter();
    let turned: Vec<bool> = portals.map(|portal| interior.is_turned(portal)).collect();
    turn(&mut interior.portals, &turned);
    let warnings = interior.check()?;
    Ok((interior, warnings))
}

fn turn(portals: &mut [Portal], turned: &[bool]) {
    for (portal, is_turned) in portals.iter_mut().zip(turned) {
        if *is_turned {
            portal.polygon = portal.polygon.clone().reversed();
        }
    }
}

/// What the names of nodes begin with that hold a cell.
pub(super) const CELL_NODE: &str = "cell:";

/// Cells and portals by the names of a model's nodes; `file` is the model's, beside the
/// `interior.json` to be, and `meter` a metre in world units: that is how high eyes are told. Up is
/// y, as glTF has it.
///
/// # Errors
/// No such nodes, outlines that are none, and what [`Interior::check`] finds.
pub fn interior_from_nodes(
    model: &Model,
    file: &str,
    meter: f64,
) -> Result<(Interior, Vec<InteriorWarning>), InteriorError> {
    // 1. Cells.
    let names = model.nodes.iter().map(|n| n.name.as_str());
    let is_misspelt = |begin: &str| match misspelt(names.clone(), begin) {
        Some(name) => Err(InteriorError::MisspeltNode(name.to_owned())),
        None => Ok(()),
    };
    is_misspelt(CELL_NODE)?;
    let cells: Vec<Cell> = names
        .clone()
        .filter_map(|name| name.strip_prefix(CELL_NODE))
        .map(|name| Cell {
            name: name.to_owned(),
            content: Content::Nodes(vec![format!("{CELL_NODE}{name}")]),
            floor: None,
            other: Extra::new(),
        })
        .collect();
    if cells.is_empty() {
        return Err(InteriorError::NoCellNodes);
    }
    is_misspelt(PORTAL_NODE)?;
    let mut interior = Interior {
        model: Some(file.to_owned()),
        up: DVec3::Y,
        eye_height: EYE_HEIGHT * meter,
        cells,
        portals: Vec::new(),
        held_out: Vec::new(),
        other: Extra::new(),
    };
    interior.check_cells()?;
    // 2. Portals.
    let ids = interior.cells.iter().map(|c| c.name.as_str());
    let ids: BTreeMap<&str, CellId> = ids.zip((0..).map(CellId)).collect();
    for name in names {
        let Some(between) = name.strip_prefix(PORTAL_NODE) else {
            continue;
        };
        let failed = |problem: String| InteriorError::PortalNode(name.to_owned(), problem);
        if !between.contains('|') {
            let expected = "expected `portal:A|B`, or `portal:A|` for an opening to the outside";
            return Err(failed(expected.to_owned()));
        }
        let mut parts = between.splitn(3, '|');
        let mut side = || {
            let part = parts.next().map(|part| without_number(part, &ids));
            part.filter(|part| !part.is_empty()).map(str::to_owned)
        };
        let between_cells = [side(), side()];
        let corners = outline(model, &below(model, |n| n == name)).map_err(failed)?;
        let polygon =
            Polygon::new(corners).map_err(|e| InteriorError::Portal(between.to_owned(), e))?;
        let portal = Portal {
            cells: sides(between, &between_cells, &ids)?,
            name: between.to_owned(),
            polygon,
            radius: None,
            other: Extra::new(),
        };
        interior.portals.push(portal);
    }
    // 3. Their sides, by what of the model one sees through them.
    if !interior.portals.is_empty() {
        let (contents, _) = Contents::listed(&interior, model)?;
        let seen = Seen::new(model, &contents.triangles, &[]);
        let portals = interior.portals.iter();
        let turned = portals.map(|portal| contents.is_turned(&seen, portal));
        let turned: Vec<bool> = turned.collect();
        turn(&mut interior.portals, &turned);
    }
    let warnings = interior.check()?;
    Ok((interior, warnings))
}

/// The first name that begins as nodes of a kind do, but for capitals.
fn misspelt<'a>(mut names: impl Iterator<Item = &'a str>, begin: &str) -> Option<&'a str> {
    let is_misspelt = |name: &&str| {
        let start = name.get(..begin.len());
        start.is_some_and(|start| start != begin && start.eq_ignore_ascii_case(begin))
    };
    names.find(is_misspelt)
}

/// What a portal's node calls a cell, without the number that tells copies of the node apart (`.001`): of
/// a name that no cell has but for that.
fn without_number<'a>(name: &'a str, ids: &BTreeMap<&str, CellId>) -> &'a str {
    let Some((whole, number)) = name.rsplit_once('.') else {
        return name;
    };
    let is_number = number.len() >= 3 && number.bytes().all(|b| b.is_ascii_digit());
    let is_copy = !ids.contains_key(name) && (whole.is_empty() || ids.contains_key(whole));
    if is_number && is_copy { whole } else { name }
}

/// The sides that only one of some triangles has, by where they begin and end; their ends.
fn lone_sides(model: &Model, triangles: &[u32]) -> BTreeMap<(Place, Place), DVec3> {
    let mut sides = BTreeMap::new();
    for i in triangles {
        let corners = model.mesh.corners(*i as usize);
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            if sides.remove(&(place(b), place(a))).is_none() {
                sides.insert((place(a), place(b)), b);
            }
        }
    }
    sides
}

/// The one loop of sides that only one triangle has.
fn outline(model: &Model, triangles: &[u32]) -> Result<Vec<DVec3>, String> {
    // 1. The sides; of a face that is there twice, once for who looks from each side, those of one.
    let normal = |i: &u32| {
        let [a, b, c] = model.mesh.corners(*i as usize);
        (b - a).cross(c - a)
    };
    let first = triangles.first().map_or(DVec3::ZERO, normal);
    let faces_as_first = |i: &u32| normal(i).dot(first) >= 0.0;
    let (front, back): (Vec<u32>, Vec<u32>) = triangles.iter().copied().partition(faces_as_first);
    let (front, back) = (lone_sides(model, &front), lone_sides(model, &back));
    let is_twice =
        front.len() == back.len() && front.keys().all(|(a, b)| back.contains_key(&(*b, *a)));
    let sides = match is_twice {
        true => front,
        false => lone_sides(model, triangles),
    };
    // 2. One after the other.
    let next: BTreeMap<_, DVec3> = sides.iter().map(|((a, _), b)| (*a, *b)).collect();
    if next.len() != sides.len() {
        return Err(
            "its outline is no simple loop; give it one flat face, all corners of which are joined"
                .to_owned(),
        );
    }
    let Some(first) = next.values().next().copied() else {
        return Err("it has no triangles, or no outline; give it a flat mesh".to_owned());
    };
    let mut corners = vec![first];
    while corners.len() < next.len() {
        match next.get(&place(corners[corners.len() - 1])) {
            Some(corner) if place(*corner) != place(first) => corners.push(*corner),
            _ => {
                return Err(
                    "its outline is more than one loop; give it one flat face without holes"
                        .to_owned(),
                );
            }
        }
    }
    Ok(corners)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given(up: &str) -> GivenRooms {
        let text = format!(
            r#"{{"version": 1, {up} "eye_height": 1.6,
                "rooms": [{{"name": "a", "min": [0, 0, 0], "max": [4, 3, 4]}}]}}"#
        );
        rooms_of(Path::new("rooms.json"), text.as_bytes(), "m.glb", 1.0).unwrap()
    }

    #[test]
    fn cameras_say_which_way_is_up_where_a_file_does_not() {
        // Held a little down.
        let up = DVec3::new(0.1, -0.9, 0.3).normalize();
        let mut rooms = given("");
        assert_eq!((rooms.interior.up, rooms.says_up), (DVec3::Y, false));
        rooms.ask_cameras(up).unwrap();
        assert_eq!(rooms.interior.up, DVec3::NEG_Y);
        assert!(rooms.warnings.is_empty(), "{:?}", rooms.warnings);
        // It is believed, and told where it is far off.
        for (text, is_far) in [
            ("0, -2, 0", false),
            ("0, -1, 1", false),
            ("0, 1, 0", true),
            ("1, 0, 0", true),
        ] {
            let mut rooms = given(&format!(r#""up": [{text}],"#));
            let said = rooms.interior.up;
            rooms.ask_cameras(up).unwrap();
            let warning = InteriorWarning::UpOfCameras {
                given: said,
                next: DVec3::NEG_Y,
            };
            assert_eq!(rooms.interior.up, said);
            assert_eq!(rooms.warnings.contains(&warning), is_far, "{text}");
        }
    }
}
