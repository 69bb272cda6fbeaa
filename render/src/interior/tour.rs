//! A tour through all rooms of an interior.

mod heading;
mod steep;
mod way;

use super::floor_map::{FloorMap, level_into};
use crate::path::{CameraPath, PathError, PathFrame};
use calibrate::{Camera, Rigid3};
use glam::{DQuat, DVec3};
use heading::Headings;
use proxy::interior::{CellId, Contents, Interior, PortalId};
use proxy::mesh::Model;
use std::collections::{BTreeSet, VecDeque};
use way::Way;

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
/// Room enough on both sides of who goes through an opening.
const ENOUGH: f64 = 0.16;
/// Heights that are nearer to one another are of one storey, likewise.
const STOREY: f64 = 0.5;

/// A walk through an interior, and what is not as one would walk.
#[derive(Clone, Debug, PartialEq)]
pub struct Tour {
    /// The walk.
    pub path: CameraPath,
    /// Rooms that it does not come to, as no opening leads to them from where it begins.
    pub left_out: Vec<CellId>,
    /// Rooms in which no way around what stands there was found, or between storeys something is in the way:
    /// it goes straight through that.
    pub blocked: Vec<CellId>,
    /// Openings with something in them wherever one might pass, which it does all the same.
    pub shut: Vec<PortalId>,
}

impl Tour {
    /// A walk at eye height through the middles of all rooms and of the openings between them, from
    /// the first room to the nearest that was not seen yet, and so on, looking ahead; at even speed,
    /// in so many frames. Rooms to which no opening leads that one could walk through are entered by
    /// other openings; those with none at all are left out. A single room is looked around in.
    ///
    /// What stands at eye height, walls and furniture, is walked around where there is a way.
    ///
    /// # Errors
    /// No room's place is known; the camera is unusable; no frames.
    pub fn new(
        interior: &Interior,
        contents: &Contents,
        model: &Model,
        camera: &Camera,
        frames: usize,
        fps: f64,
    ) -> Result<Self, TourError> {
        let mut rooms = Rooms::new(interior, contents, model);
        let legs = rooms.legs().ok_or(TourError::NoPlace)?;
        let ids = (0..interior.cells.len() as u32).map(CellId);
        Ok(Self {
            left_out: ids
                .filter(|id| !legs.iter().any(|leg| leg.cell == *id))
                .collect(),
            path: path(&mut rooms, legs, camera, frames, fps)?,
            blocked: rooms.blocked.into_iter().collect(),
            shut: rooms.shut.into_iter().collect(),
        })
    }
}

/// Frames along a tour.
fn path(
    rooms: &mut Rooms<'_>,
    legs: Vec<Leg>,
    camera: &Camera,
    frames: usize,
    fps: f64,
) -> Result<CameraPath, TourError> {
    let (up, unit) = (rooms.interior.up, rooms.unit());
    let reach = rooms.smoothness(&legs, SMOOTH * unit);
    let way = Way::new(legs.into_iter().flat_map(|leg| leg.stops).collect());
    let length = way.length();
    let count = frames.max(1);
    let level = up.any_orthonormal_vector();
    let (interior, contents, model) = (rooms.interior, rooms.contents, rooms.model);
    let passed = steep::passed(&way, reach, interior, contents, model);
    rooms.blocked.extend(passed);
    let headings = Headings::new(&way, up, unit, SMOOTH * unit);
    let frame = |i: usize| {
        let share = i as f64 / (count.max(2) - 1) as f64;
        let along = share * length;
        let center = way.smoothed(along, reach);
        let heading = match length > 0.0 {
            true => headings.at(along),
            false => DQuat::from_axis_angle(up, std::f64::consts::TAU * share) * level,
        };
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

/// Points to pass in one room, in order.
struct Leg {
    cell: CellId,
    stops: Vec<DVec3>,
}

/// Rooms and what stands in them.
struct Rooms<'a> {
    interior: &'a Interior,
    contents: &'a Contents,
    model: &'a Model,
    /// By cell, when it is first walked through: at which height, as a cell may have several storeys,
    /// and what is there.
    maps: Vec<Vec<(f64, Option<FloorMap>)>>,
    /// See [`Tour::blocked`].
    blocked: BTreeSet<CellId>,
    /// See [`Tour::shut`].
    shut: BTreeSet<PortalId>,
}

/// Places along an opening that are tried, for one where nothing is in the way.
const TRIED: usize = 21;

impl<'a> Rooms<'a> {
    fn new(interior: &'a Interior, contents: &'a Contents, model: &'a Model) -> Self {
        Self {
            interior,
            contents,
            model,
            maps: interior.cells.iter().map(|_| Vec::new()).collect(),
            blocked: BTreeSet::new(),
            shut: BTreeSet::new(),
        }
    }

    fn unit(&self) -> f64 {
        self.interior.eye_height.abs().max(1e-9)
    }

    /// A room's map at about the height of a point; nothing for a room without bounds.
    fn map(&mut self, id: CellId, eye: DVec3) -> Option<&FloorMap> {
        let (unit, height) = (self.unit(), eye.dot(self.interior.up));
        let maps = &mut self.maps[id.0 as usize];
        let is_near =
            |(other, _): &(f64, Option<FloorMap>)| (other - height).abs() <= STOREY * unit;
        let i = match maps.iter().position(is_near) {
            Some(i) => i,
            None => {
                let map = FloorMap::new(self.interior, self.contents, self.model, id, eye, unit);
                maps.push((height, map));
                maps.len() - 1
            }
        };
        maps[i].1.as_ref()
    }

    /// The tour, room by room.
    fn legs(&mut self) -> Option<Vec<Leg>> {
        let (interior, contents) = (self.interior, self.contents);
        let mut places: Vec<Option<DVec3>> = (0..interior.cells.len() as u32)
            .map(|i| place(interior, contents, CellId(i)))
            .collect();
        for (i, place) in places.iter_mut().enumerate() {
            if let Some(at) = *place {
                let map = self.map(CellId(i as u32), at);
                *place = Some(map.map_or(at, |map| map.roomy(at)));
            }
        }
        let first = places.iter().position(Option::is_some)?;
        let mut at = CellId(first as u32);
        let mut here = places[first]?;
        let mut legs = vec![Leg {
            cell: at,
            stops: vec![here],
        }];
        let mut is_seen = vec![false; places.len()];
        is_seen[first] = true;
        while let Some(route) = route(interior, contents, &places, &is_seen, at) {
            for (id, into) in route {
                let [before, middle, after] = self.through(id, at, into);
                let mut leg = Leg {
                    cell: at,
                    stops: Vec::new(),
                };
                self.walk(&mut leg, here, before);
                leg.stops.push(middle);
                legs.push(leg);
                legs.push(Leg {
                    cell: into,
                    stops: vec![after],
                });
                here = after;
                is_seen[into.0 as usize] = true;
                at = into;
            }
            if let Some(place) = places[at.0 as usize] {
                let mut leg = Leg {
                    cell: at,
                    stops: Vec::new(),
                };
                self.walk(&mut leg, here, place);
                legs.push(leg);
                here = place;
            }
        }
        Some(legs)
    }

    /// Goes on in a room to a point, around what stands there.
    fn walk(&mut self, leg: &mut Leg, from: DVec3, to: DVec3) {
        let map = self.map(leg.cell, from);
        match map.map_or(Some(Vec::new()), |map| map.way(from, to)) {
            Some(way) => leg.stops.extend(way),
            None => {
                self.blocked.insert(leg.cell);
            }
        }
        leg.stops.push(to);
    }

    /// Straight through an opening: before it, in it, and after it; where most is free around.
    fn through(&mut self, id: PortalId, from: CellId, into: CellId) -> [DVec3; 3] {
        let (interior, contents, unit) = (self.interior, self.contents, self.unit());
        let portal = interior.portal(id);
        let up = interior.up;
        let Some(level) = level_into(portal, from, up) else {
            return self.climb(id, from, into);
        };
        let center = portal.polygon.center();
        let height = contents.floor_within(interior, Some(from), portal) + unit;
        let center = center + up * (height - center.dot(up));
        let normal = portal.normal_into(Some(from));
        let off = BEFORE_DOOR * unit * level;
        let aside = up.cross(level) * 0.5 * portal.width(up);
        let mut best: Option<(f64, [DVec3; 3])> = None;
        // The middle first, then farther and farther aside.
        for k in 0..TRIED {
            let share = k.div_ceil(2) as f64 / (TRIED / 2 + 1) as f64;
            let middle = center + aside * if k % 2 == 0 { share } else { -share };
            if !portal
                .polygon
                .covers(middle - normal * portal.polygon.height(middle), 0.0)
                && k > 0
            {
                continue;
            }
            let points = [middle + off, middle, middle - off];
            let mut room = f64::INFINITY;
            for cell in [from, into] {
                if let Some(map) = self.map(cell, middle) {
                    let along = (0..=8).map(|i| points[0].lerp(points[2], f64::from(i) / 8.0));
                    room = along.map(|p| map.clearance(p)).fold(room, f64::min);
                }
            }
            // What is enough is enough.
            let room = room.min(ENOUGH * unit);
            if best.as_ref().is_none_or(|(most, _)| room > *most) {
                best = Some((room, points));
            }
        }
        if matches!(best, Some((room, _)) if room <= 0.0) {
            self.shut.insert(id);
        }
        best.map_or([center + off, center, center - off], |(_, points)| points)
    }

    /// Straight up or down through an opening that lies flat: at eye height over the floor of one room, in it, and
    /// over that of the other.
    fn climb(&mut self, id: PortalId, from: CellId, into: CellId) -> [DVec3; 3] {
        let (interior, contents, unit) = (self.interior, self.contents, self.unit());
        let portal = interior.portal(id);
        let (up, center) = (interior.up, portal.polygon.center());
        let over = |cell: CellId| {
            let floor = contents.floor_of(interior, cell);
            let height =
                floor.unwrap_or_else(|| contents.floor_within(interior, Some(cell), portal)) + unit;
            center + up * (height - center.dot(up))
        };
        let [before, after] = [from, into].map(over);
        for (cell, eye) in [(from, before), (into, after)] {
            if self
                .map(cell, eye)
                .is_some_and(|map| map.clearance(eye) <= 0.0)
            {
                self.shut.insert(id);
            }
        }
        [before, center, after]
    }

    /// Over how far the way may be smoothed without coming nearer to what stands than it must: the
    /// asked reach, or less.
    fn smoothness(&mut self, legs: &[Leg], asked: f64) -> f64 {
        let way = Way::new(legs.iter().flat_map(|leg| leg.stops.clone()).collect());
        let (up, unit) = (self.interior.up, self.unit());
        let used = self.maps.iter().flatten();
        let used = used.filter_map(|(height, map)| Some((*height, map.as_ref()?)));
        let used: Vec<(f64, &FloorMap)> = used.collect();
        let count = (way.length() / (0.02 * self.interior.eye_height.abs()).max(1e-9)).min(2e4);
        let is_free = |reach: f64| {
            (0..=count as usize).all(|i| {
                let along = way.length() * i as f64 / count.max(1.0);
                let [rough, smooth] = [way.at(along), way.smoothed(along, reach)];
                let least = |p: DVec3| {
                    // What stands in another storey is not in the way.
                    let is_near = |height: f64| (height - p.dot(up)).abs() <= STOREY * unit;
                    let near = used.iter().filter(|(height, _)| is_near(*height));
                    near.map(|(_, map)| map.clearance(p))
                        .fold(f64::INFINITY, f64::min)
                };
                least(smooth) > 0.0 || least(rough) == 0.0
            })
        };
        let tried = [1.0, 0.7, 0.5, 0.35, 0.25, 0.15, 0.08];
        let found = tried
            .into_iter()
            .map(|s| s * asked)
            .find(|reach| is_free(*reach));
        found.unwrap_or(0.0)
    }
}

/// The middle of a room, at eye height.
fn place(interior: &Interior, contents: &Contents, id: CellId) -> Option<DVec3> {
    let up = interior.up;
    let room = contents.bounds.get(id.0 as usize).copied().flatten();
    let middle = match (&interior.cell(id).floor, room) {
        (Some(floor), _) => floor.center(),
        (None, Some(room)) => room.min.midpoint(room.max),
        (None, None) => return None,
    };
    let floor = contents.floor_of(interior, id)?;
    let at = middle + up * (floor + interior.eye_height - middle.dot(up));
    at.is_finite().then_some(at)
}

/// The portals to pass to the nearest room not seen yet.
fn route(
    interior: &Interior,
    contents: &Contents,
    places: &[Option<DVec3>],
    is_seen: &[bool],
    from: CellId,
) -> Option<Vec<(PortalId, CellId)>> {
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
                if !is_new || (doors_only && !contents.is_door(interior, portal)) {
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
