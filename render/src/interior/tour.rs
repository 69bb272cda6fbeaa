//! A tour through all rooms of an interior.

use crate::path::{CameraPath, PathError, PathFrame};
use calibrate::{Camera, Rigid3};
use glam::{DQuat, DVec3};
use proxy::interior::{CellId, Contents, Interior, Portal, PortalId, RoomBox};
use std::collections::VecDeque;

/// Why there is no tour.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TourError {
    /// No room's place is known.
    #[error("no cell has a box, a floor or triangles, so there is nowhere to walk; give a path")]
    NoPlace,
    /// It is no path.
    #[error(transparent)]
    Path(#[from] PathError),
}

/// Lengths in eye heights, which is what tells a doll's house from a palace.
const BEFORE_DOOR: f64 = 0.3;
const SMOOTH: f64 = 0.22;
const LOOK_AHEAD: f64 = 0.8;
const TURN: f64 = 0.6;
/// How high a threshold one steps over, likewise.
const STEP: f64 = 0.25;

/// A walk at eye height through the middles of all rooms and of the openings between them, from
/// the first room to the nearest that was not seen yet, and so on, looking ahead; at even speed, in
/// so many frames. Rooms to which no opening leads that one could walk through are entered by
/// other openings; those with none at all are left out. A single room is looked around in.
///
/// Furniture is walked through.
///
/// # Errors
/// No room's place is known; the camera is unusable; no frames.
pub fn tour(
    interior: &Interior,
    contents: &Contents,
    camera: &Camera,
    frames: usize,
    fps: f64,
) -> Result<CameraPath, TourError> {
    let up = interior.up;
    let way = Way::new(stops(interior, contents).ok_or(TourError::NoPlace)?);
    let unit = interior.eye_height.abs().max(1e-9);
    let length = way.length();
    let count = frames.max(1);
    let level = up.any_orthonormal_vector();
    let mut heading = level;
    let frame = |i: usize| {
        let share = i as f64 / (count.max(2) - 1) as f64;
        let along = share * length;
        let center = way.smoothed(along, SMOOTH * unit);
        if length > 0.0 {
            // The mean of where one will look a little before and after.
            let ahead = |s: f64| {
                let d = way.smoothed(s + LOOK_AHEAD * unit, SMOOTH * unit)
                    - way.smoothed(s, SMOOTH * unit);
                (d - up * d.dot(up)).normalize_or_zero()
            };
            let mean: DVec3 = (-4..=4)
                .map(|k| ahead((along + f64::from(k) / 4.0 * TURN * unit).clamp(0.0, length)))
                .sum();
            if mean.length() > 0.05 {
                heading = mean.normalize();
            }
        } else {
            heading = DQuat::from_axis_angle(up, std::f64::consts::TAU * share) * level;
        }
        let pose = Rigid3::looking_at(center, center + heading * unit, up);
        let name = format!("frame_{i:04}");
        let time_s = Some(i as f64 / fps);
        PathFrame::new(name, camera.clone(), pose, time_s).map_err(|error| PathError::Camera {
            kind: "frame",
            index: i,
            error,
        })
    };
    let frames = (0..count).map(frame).collect::<Result<Vec<_>, _>>()?;
    Ok(CameraPath::new(fps, frames)?)
}

/// Points to pass, in order.
fn stops(interior: &Interior, contents: &Contents) -> Option<Vec<DVec3>> {
    let places: Vec<Option<DVec3>> = (0..interior.cells.len() as u32)
        .map(|i| place(interior, contents, CellId(i)))
        .collect();
    let first = places.iter().position(Option::is_some)?;
    let mut at = CellId(first as u32);
    let mut stops = vec![places[first]?];
    let mut is_seen = vec![false; places.len()];
    is_seen[first] = true;
    let unit = interior.eye_height;
    while let Some(route) = route(interior, contents, &places, &is_seen, at) {
        for (id, into) in route {
            let portal = interior.portal(id);
            let up = interior.up;
            let center = portal.polygon.center();
            let height = floor(interior, contents, at, portal) + unit;
            let center = center + up * (height - center.dot(up));
            // Straight through.
            let normal = portal.normal_into(Some(at));
            let level = (normal - up * normal.dot(up)).normalize_or_zero();
            let off = BEFORE_DOOR * unit * level;
            stops.extend([center + off, center, center - off]);
            is_seen[into.0 as usize] = true;
            at = into;
        }
        stops.extend(places[at.0 as usize]);
    }
    Some(stops)
}

/// The middle of a room, at eye height.
fn place(interior: &Interior, contents: &Contents, id: CellId) -> Option<DVec3> {
    let up = interior.up;
    let middle = match (&interior.cell(id).floor, bounds(contents, id)) {
        (Some(floor), _) => floor.center(),
        (None, Some(room)) => room.min.midpoint(room.max),
        (None, None) => return None,
    };
    let lowest = lowest(interior, contents, id)?;
    let at = middle + up * (lowest + interior.eye_height - middle.dot(up));
    at.is_finite().then_some(at)
}

fn bounds(contents: &Contents, id: CellId) -> Option<RoomBox> {
    contents.bounds.get(id.0 as usize).copied().flatten()
}

/// How high a room's lowest point is, of its floor if that is known.
fn lowest(interior: &Interior, contents: &Contents, id: CellId) -> Option<f64> {
    let up = interior.up;
    if let Some(floor) = &interior.cell(id).floor {
        let heights = floor.corners().iter().map(|p| p.dot(up));
        return Some(heights.fold(f64::INFINITY, f64::min));
    }
    let room = bounds(contents, id)?;
    let half = 0.5 * (room.max - room.min);
    Some(room.min.midpoint(room.max).dot(up) - half.dot(up.abs()))
}

/// How high the floor is before a portal: the room's, or where nothing is known of that, what
/// the interior takes it for.
fn floor(interior: &Interior, contents: &Contents, id: CellId, portal: &Portal) -> f64 {
    let of_room = lowest(interior, contents, id);
    of_room.unwrap_or_else(|| interior.floor_height(Some(id), portal))
}

/// The portals to pass to the nearest room not seen yet.
fn route(
    interior: &Interior,
    contents: &Contents,
    places: &[Option<DVec3>],
    is_seen: &[bool],
    from: CellId,
) -> Option<Vec<(PortalId, CellId)>> {
    let is_door = |cell: CellId, portal: &Portal| {
        let up = interior.up;
        let heights = portal.polygon.corners().iter().map(|p| p.dot(up));
        let sill = heights.fold(f64::INFINITY, f64::min);
        sill - floor(interior, contents, cell, portal) <= STEP * interior.eye_height
    };
    let search = |doors_only: bool| {
        let mut came: Vec<Option<(CellId, PortalId)>> = vec![None; places.len()];
        let mut queue = VecDeque::from([from]);
        while let Some(cell) = queue.pop_front() {
            for (id, portal) in interior.portals_of(Some(cell)) {
                let Some(into) = portal.beyond(Some(cell)).flatten() else {
                    continue;
                };
                let i = into.0 as usize;
                let is_new = into != from && came[i].is_none();
                if !is_new || (doors_only && !is_door(cell, portal)) {
                    continue;
                }
                came[i] = Some((cell, id));
                if !is_seen[i] && places[i].is_some() {
                    let mut way = Vec::new();
                    let mut at = into;
                    while let Some((before, id)) = came[at.0 as usize] {
                        way.push((id, at));
                        at = before;
                    }
                    way.reverse();
                    return Some(way);
                }
                queue.push_back(into);
            }
        }
        None
    };
    search(true).or_else(|| search(false))
}

/// A line from stop to stop.
struct Way {
    stops: Vec<DVec3>,
    /// How far along each is.
    along: Vec<f64>,
}

impl Way {
    fn new(stops: Vec<DVec3>) -> Self {
        let mut along = vec![0.0];
        for pair in stops.windows(2) {
            along.push(along[along.len() - 1] + pair[0].distance(pair[1]));
        }
        Self { stops, along }
    }

    fn length(&self) -> f64 {
        self.along[self.along.len() - 1]
    }

    fn at(&self, along: f64) -> DVec3 {
        let along = along.clamp(0.0, self.length());
        let after = self.along.partition_point(|a| *a < along).max(1);
        let Some(&q) = self.stops.get(after) else {
            return self.stops[self.stops.len() - 1];
        };
        let (from, to) = (self.along[after - 1], self.along[after]);
        let share = if to > from {
            (along - from) / (to - from)
        } else {
            0.0
        };
        self.stops[after - 1].lerp(q, share)
    }

    /// The mean over some way before and after, less the farther.
    fn smoothed(&self, along: f64, reach: f64) -> DVec3 {
        let weight = |k: i32| f64::from(9 - k.abs());
        let steps = -8..=8;
        let sum: DVec3 = steps
            .clone()
            .map(|k| weight(k) * self.at(along + 2.0 * reach * f64::from(k) / 8.0))
            .sum();
        sum / steps.map(weight).sum::<f64>()
    }
}
