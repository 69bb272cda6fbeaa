//! The floor plan: rooms on a lattice, and the openings between them.

use crate::noise::{hash, unit};
use glam::DVec2;

/// From floor to ceiling.
pub(super) const HEIGHT: f64 = 2.75;
/// From the middle of a wall to its face.
pub(super) const HALF_WALL: f64 = STEP;
/// Everything that rooms and openings share lies on this lattice, so that no rounding parts
/// what belongs together.
const STEP: f64 = 0.0625;

/// A room's outline in x and z, to the middle of its walls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub(super) min: DVec2,
    pub(super) max: DVec2,
}

impl Rect {
    pub(super) fn size(&self) -> DVec2 {
        self.max - self.min
    }

    pub(super) fn middle(&self) -> DVec2 {
        0.5 * (self.min + self.max)
    }

    pub(super) fn overlaps(&self, other: &Self) -> bool {
        self.min.cmplt(other.max).all() && other.min.cmplt(self.max).all()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Door,
    Doorway,
    Window,
    /// To pass plates through.
    Hatch,
}

impl Kind {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Door => "door",
            Self::Doorway => "doorway",
            Self::Window => "window",
            Self::Hatch => "hatch",
        }
    }

    /// Width, lower and upper end.
    fn shape(self) -> (f64, f64, f64) {
        match self {
            Self::Door => (0.875, 0.0, 2.0625),
            Self::Doorway => (1.5, 0.0, 2.25),
            Self::Window => (1.125, 0.9375, 2.0),
            Self::Hatch => (0.5, 1.0625, 1.625),
        }
    }
}

/// A hole in the wall between two rooms.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Opening {
    pub(super) kind: Kind,
    /// On the lesser side of the wall's middle, and on the greater.
    pub(super) rooms: [usize; 2],
    /// 0 where the wall is across x, 1 where it is across z.
    pub(super) axis: usize,
    /// The wall's middle on that axis.
    pub(super) at: f64,
    /// Along the wall.
    pub(super) from: f64,
    pub(super) to: f64,
    /// Its lower and upper end.
    pub(super) sill: f64,
    pub(super) head: f64,
}

pub(super) struct Plan {
    pub(super) rooms: Vec<Rect>,
    pub(super) openings: Vec<Opening>,
}

/// Openings for each room: 52 for 19, as Brooks House has (Rafferty et al. 1998, §6).
const OPENINGS_PER_ROOM: f64 = 52.0 / 19.0;
/// Square metres.
const AREA_PER_ROOM: f64 = 19.0;
/// From an opening to a corner or to the next opening.
const CLEARANCE: f64 = 3.0 * STEP;

fn snap(x: f64) -> f64 {
    (x / STEP).round() * STEP
}

pub(super) fn plan(count: usize, seed: u32) -> Plan {
    // 1. Rooms: the largest is split until there are enough.
    let depth = snap((count as f64 * AREA_PER_ROOM * 0.72).sqrt());
    let width = snap(count as f64 * AREA_PER_ROOM / depth);
    let mut rooms = vec![Rect {
        min: DVec2::ZERO,
        max: DVec2::new(width, depth),
    }];
    while rooms.len() < count {
        let area = |r: &Rect| r.size().x * r.size().y;
        let largest = (0..rooms.len()).fold(0, |best, i| {
            if area(&rooms[i]) > area(&rooms[best]) {
                i
            } else {
                best
            }
        });
        let room = rooms[largest];
        let axis = usize::from(room.size().y > room.size().x);
        let share = 0.42 + 0.16 * unit(seed, rooms.len() as i32, 1, 0);
        let at = snap(room.min[axis] + share * room.size()[axis]);
        let (mut low, mut high) = (room, room);
        low.max[axis] = at;
        high.min[axis] = at;
        rooms[largest] = low;
        rooms.push(high);
    }
    // From the front left to the back right.
    rooms.sort_by(|a, b| {
        let key = |r: &Rect| (r.min.y, r.min.x);
        key(a)
            .partial_cmp(&key(b))
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    let openings = openings(&rooms, seed);
    Plan { rooms, openings }
}

/// A wall between two rooms, and where it is free.
struct Wall {
    rooms: [usize; 2],
    axis: usize,
    at: f64,
    free: Vec<(f64, f64)>,
}

impl Wall {
    /// Makes a hole, if there is room for it.
    fn open(&mut self, kind: Kind, jitter: f64) -> Option<Opening> {
        let (width, sill, head) = kind.shape();
        let i = self
            .free
            .iter()
            .position(|(from, to)| to - from >= width + 2.0 * CLEARANCE)?;
        let (from, to) = self.free.swap_remove(i);
        let slack = to - from - width - 2.0 * CLEARANCE;
        let start = from + CLEARANCE + (jitter * slack / STEP).floor() * STEP;
        self.free.push((from, start));
        self.free.push((start + width, to));
        Some(Opening {
            kind,
            rooms: self.rooms,
            axis: self.axis,
            at: self.at,
            from: start,
            to: start + width,
            sill,
            head,
        })
    }
}

fn openings(rooms: &[Rect], seed: u32) -> Vec<Opening> {
    let mut walls = walls(rooms);
    walls.sort_by_key(|wall| hash(seed, wall.rooms[0] as i32, wall.rooms[1] as i32, 2));
    let mut found = Vec::new();
    // 1. Every room can be walked to.
    let mut group: Vec<usize> = (0..rooms.len()).collect();
    for (i, wall) in walls.iter_mut().enumerate() {
        let [a, b] = wall.rooms.map(|r| group[r]);
        if a == b {
            continue;
        }
        let wide = unit(seed, i as i32, 3, 0) < 0.4;
        let kinds = if wide {
            [Kind::Doorway, Kind::Door]
        } else {
            [Kind::Door; 2]
        };
        let jitter = unit(seed, i as i32, 4, 0);
        if let Some(opening) = kinds.into_iter().find_map(|kind| wall.open(kind, jitter)) {
            found.push(opening);
            group.iter_mut().filter(|g| **g == b).for_each(|g| *g = a);
        }
    }
    // 2. More, a wall at a time.
    let wanted = (OPENINGS_PER_ROOM * rooms.len() as f64).round() as usize;
    for round in 0..6 {
        for (i, wall) in walls.iter_mut().enumerate() {
            if found.len() >= wanted {
                break;
            }
            let kinds = match (round, hash(seed, i as i32, 5, round) % 3) {
                (2.., _) => [Kind::Hatch, Kind::Hatch],
                (_, 0) => [Kind::Window, Kind::Door],
                (_, 1) => [Kind::Door, Kind::Window],
                _ => [Kind::Doorway, Kind::Window],
            };
            // Anywhere first, then side by side.
            let jitter = if round < 1 {
                unit(seed, i as i32, 6, round)
            } else {
                0.0
            };
            found.extend(kinds.into_iter().find_map(|kind| wall.open(kind, jitter)));
        }
    }
    found
}

fn walls(rooms: &[Rect]) -> Vec<Wall> {
    let mut walls = Vec::new();
    for (i, a) in rooms.iter().enumerate() {
        for (j, b) in rooms.iter().enumerate() {
            for axis in 0..2 {
                let along = 1 - axis;
                let (from, to) = (
                    a.min[along].max(b.min[along]) + HALF_WALL,
                    a.max[along].min(b.max[along]) - HALF_WALL,
                );
                if a.max[axis] == b.min[axis] && from < to {
                    walls.push(Wall {
                        rooms: [i, j],
                        axis,
                        at: a.max[axis],
                        free: vec![(from, to)],
                    });
                }
            }
        }
    }
    walls
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn houses_are_connected_and_have_the_openings_they_should() {
        for seed in 0..40 {
            for count in [2, 3, 5, 8, 13, 19, 40] {
                let Plan { rooms, openings } = plan(count, seed);
                assert_eq!(rooms.len(), count);
                let wanted = (OPENINGS_PER_ROOM * count as f64).round() as usize;
                // Two rooms have but one wall between them.
                let least = if count < 8 { wanted * 3 / 5 } else { wanted };
                let range = least..=wanted;
                assert!(
                    range.contains(&openings.len()),
                    "{count} rooms, seed {seed}: {}",
                    openings.len()
                );
                assert!(
                    rooms.iter().all(|r| r.size().min_element() >= 2.0),
                    "{rooms:?}"
                );
                for (i, a) in rooms.iter().enumerate() {
                    assert!(!rooms[..i].iter().any(|b| a.overlaps(b)));
                }
                // One walks through doors to every room.
                let mut reached = vec![0];
                let mut next = 0;
                while let Some(room) = reached.get(next).copied() {
                    for opening in openings.iter().filter(|o| o.sill == 0.0) {
                        let [a, b] = opening.rooms;
                        for (from, to) in [(a, b), (b, a)] {
                            if from == room && !reached.contains(&to) {
                                reached.push(to);
                            }
                        }
                    }
                    next += 1;
                }
                assert_eq!(reached.len(), count, "seed {seed}");
                // Openings in a wall keep apart.
                for (i, a) in openings.iter().enumerate() {
                    for b in &openings[..i] {
                        let same = (a.axis, a.at) == (b.axis, b.at);
                        assert!(!same || a.to < b.from || b.to < a.from);
                    }
                }
            }
        }
    }
}
