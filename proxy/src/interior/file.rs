//! `interior.json`, version 1.
//!
//! ```json
//! {
//!   "version": 1,
//!   "model": "house.glb",
//!   "up": [0, 1, 0],
//!   "eye_height": 1.6,
//!   "cells": [
//!     {"name": "hall", "box": {"min": [0, 0, 0], "max": [4, 2.5, 3]}},
//!     {"name": "study", "nodes": ["cell:study"]},
//!     {"name": "attic", "scene": "../attic", "box": {"min": [0, 3, 0], "max": [4, 5, 3]}}
//!   ],
//!   "portals": [
//!     {"name": "door", "polygon": [[4, 0, 1], [4, 0, 2], [4, 2, 2], [4, 2, 1]],
//!      "cells": ["hall", "study"], "radius": 1.5},
//!     {"name": "window", "polygon": […], "cells": ["hall", null]}
//!   ],
//!   "held_out": ["b.jpg"]
//! }
//! ```
//!
//! A polygon is counter-clockwise as the first of its cells sees it. Paths are relative to the
//! file's folder, with `/` between their parts. The photos of a `scene` colour the model's triangles
//! in the box beside it; those that the whole file's `held_out` names are not drawn from. Keys that this version does
//! not know are kept when the file is written again.

use super::arrays::{exactly, points, points_or_none};
use super::{
    Cell, CellId, Content, Extra, Interior, InteriorError, InteriorFileError, InteriorWarning,
    Polygon, PolygonError, Portal, RoomBox,
};
use crate::file::write_whole;
use capture::without_byte_order_mark;
use glam::DVec3;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Serialize, Deserialize)]
pub(super) struct Stored {
    pub version: u32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    #[serde(deserialize_with = "exactly")]
    pub up: [f64; 3],
    pub eye_height: f64,
    pub cells: Vec<StoredCell>,
    pub portals: Vec<StoredPortal>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub held_out: Vec<String>,
    #[serde(flatten)]
    pub other: Extra,
}

#[derive(Serialize, Deserialize)]
pub(super) struct StoredCell {
    pub name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodes: Option<Vec<String>>,
    #[serde(default, rename = "box", skip_serializing_if = "Option::is_none")]
    pub room: Option<StoredBox>,
    #[serde(
        default,
        deserialize_with = "points_or_none",
        skip_serializing_if = "Option::is_none"
    )]
    pub floor: Option<Vec<[f64; 3]>>,
    #[serde(flatten)]
    pub other: Extra,
}

#[derive(Serialize, Deserialize)]
pub(super) struct StoredBox {
    #[serde(deserialize_with = "exactly")]
    pub min: [f64; 3],
    #[serde(deserialize_with = "exactly")]
    pub max: [f64; 3],
}

#[derive(Serialize, Deserialize)]
pub(super) struct StoredPortal {
    pub name: String,
    #[serde(deserialize_with = "points")]
    pub polygon: Vec<[f64; 3]>,
    #[serde(deserialize_with = "exactly")]
    pub cells: [Option<String>; 2],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    #[serde(flatten)]
    pub other: Extra,
}

/// A polygon of a file's numbers.
fn polygon(corners: &[[f64; 3]]) -> Result<Polygon, PolygonError> {
    Polygon::new(corners.iter().map(|p| DVec3::from_array(*p)).collect())
}

/// Numbers of a file for a polygon.
fn corners(polygon: &Polygon) -> Vec<[f64; 3]> {
    polygon.corners().iter().map(DVec3::to_array).collect()
}

/// A file of version 1, whatever is in it.
pub(super) fn parse_version_1<T: DeserializeOwned>(
    path: &Path,
    what: &'static str,
    bytes: &[u8],
) -> Result<T, InteriorFileError> {
    /// Of a later version nothing else need be readable.
    #[derive(Deserialize)]
    struct Version {
        version: Option<u64>,
    }
    let json = |e| InteriorFileError::Json(path.to_owned(), what, e);
    let bytes = without_byte_order_mark(bytes);
    let Version { version } = serde_json::from_slice(bytes).map_err(json)?;
    if let Some(found) = version.filter(|v| *v != 1) {
        return Err(InteriorFileError::Version(path.to_owned(), found));
    }
    serde_json::from_slice(bytes).map_err(json)
}

/// The ids that a portal's sides stand for.
pub(super) fn sides(
    portal: &str,
    names: &[Option<String>; 2],
    ids: &BTreeMap<&str, CellId>,
) -> Result<[Option<CellId>; 2], InteriorError> {
    let id = |name: &Option<String>| match name {
        None => Ok(None),
        Some(name) => ids.get(name.as_str()).copied().map(Some).ok_or_else(|| {
            let known: Vec<&str> = ids.keys().copied().collect();
            InteriorError::UnknownCell {
                portal: portal.to_owned(),
                cell: name.clone(),
                known: known.join(", "),
            }
        }),
    };
    Ok([id(&names[0])?, id(&names[1])?])
}

impl Stored {
    fn of(interior: &Interior) -> Self {
        let cell = |cell: &Cell| StoredCell {
            name: cell.name.clone(),
            scene: cell.content.scene().map(str::to_owned),
            nodes: match &cell.content {
                Content::Nodes(names) => Some(names.clone()),
                _ => None,
            },
            room: cell.content.room().map(|RoomBox { min, max }| StoredBox {
                min: min.to_array(),
                max: max.to_array(),
            }),
            floor: cell.floor.as_ref().map(corners),
            other: cell.other.clone(),
        };
        let name = |id: CellId| interior.cells.get(id.0 as usize).map(|c| c.name.clone());
        let portal = |portal: &Portal| StoredPortal {
            name: portal.name.clone(),
            polygon: corners(&portal.polygon),
            cells: portal.cells.map(|side| side.and_then(name)),
            radius: portal.radius,
            other: portal.other.clone(),
        };
        Self {
            version: 1,
            model: interior.model.clone(),
            up: interior.up.to_array(),
            eye_height: interior.eye_height,
            cells: interior.cells.iter().map(cell).collect(),
            portals: interior.portals.iter().map(portal).collect(),
            held_out: interior.held_out.clone(),
            other: interior.other.clone(),
        }
    }

    /// The interior, whose cells are checked; see [`Interior::check`].
    pub(super) fn interior(self) -> Result<Interior, InteriorError> {
        let mut cells = Vec::with_capacity(self.cells.len());
        for cell in self.cells {
            let given = usize::from(cell.scene.is_some())
                + usize::from(cell.nodes.is_some())
                + usize::from(cell.room.is_some());
            let room = cell.room.map(|StoredBox { min, max }| RoomBox {
                min: DVec3::from_array(min),
                max: DVec3::from_array(max),
            });
            let content = match (cell.scene, cell.nodes, room) {
                (Some(folder), None, room) => Content::Scene { folder, room },
                (None, Some(names), None) => Content::Nodes(names),
                (None, None, Some(room)) => Content::Box(room),
                _ => return Err(InteriorError::Content(cell.name, given)),
            };
            let floor = cell.floor.map(|corners| polygon(&corners)).transpose();
            cells.push(Cell {
                floor: floor.map_err(|e| InteriorError::Floor(cell.name.clone(), e))?,
                name: cell.name,
                content,
                other: cell.other,
            });
        }
        let mut interior = Interior {
            model: self.model,
            up: direction(self.up)?,
            eye_height: self.eye_height,
            cells,
            portals: Vec::with_capacity(self.portals.len()),
            held_out: self.held_out,
            other: self.other,
        };
        // Portals tell cells by their names.
        interior.check_cells()?;
        let names = interior.cells.iter().map(|c| c.name.as_str());
        let ids: BTreeMap<&str, CellId> = names.zip((0..).map(CellId)).collect();
        for portal in self.portals {
            let outline = polygon(&portal.polygon);
            interior.portals.push(Portal {
                cells: sides(&portal.name, &portal.cells, &ids)?,
                polygon: outline.map_err(|e| InteriorError::Portal(portal.name.clone(), e))?,
                name: portal.name,
                radius: portal.radius,
                other: portal.other,
            });
        }
        Ok(interior)
    }
}

/// Unit length; what has it already keeps every digit.
fn direction(up: [f64; 3]) -> Result<DVec3, InteriorError> {
    let given = DVec3::from_array(up);
    if (given.length() - 1.0).abs() < 1e-12 {
        return Ok(given);
    }
    given.try_normalize().ok_or(InteriorError::Up(up))
}

/// Reads an interior, and what is odd about it.
///
/// # Errors
/// The file, and what is wrong with it.
pub fn read_interior(path: &Path) -> Result<(Interior, Vec<InteriorWarning>), InteriorFileError> {
    let bytes = std::fs::read(path).map_err(|e| InteriorFileError::Io(path.to_owned(), e))?;
    parse_interior(path, &bytes)
}

/// Reads the content of a file; `path` is only named in errors.
///
/// # Errors
/// As for [`read_interior`].
pub fn parse_interior(
    path: &Path,
    bytes: &[u8],
) -> Result<(Interior, Vec<InteriorWarning>), InteriorFileError> {
    let failed = |e| InteriorFileError::Interior(path.to_owned(), e);
    let stored: Stored = parse_version_1(path, "an interior", bytes)?;
    let interior = stored.interior().map_err(failed)?;
    let warnings = interior.check().map_err(failed)?;
    Ok((interior, warnings))
}

/// Writes an interior. The file appears complete or not at all, and reads back the same to
/// the last digit.
///
/// # Errors
/// An interior that contradicts itself; the file system's.
pub fn write_interior(path: &Path, interior: &Interior) -> Result<(), InteriorFileError> {
    let failed = |e| InteriorFileError::Interior(path.to_owned(), e);
    interior.check().map_err(failed)?;
    let json = |e| InteriorFileError::Json(path.to_owned(), "an interior", e);
    let text = serde_json::to_string_pretty(&Stored::of(interior)).map_err(json)? + "\n";
    write_whole(path, text.as_bytes()).map_err(|e| InteriorFileError::Write(path.to_owned(), e))
}
