//! Where one can walk in a room: what stands at eye height, on a grid.

use glam::{DVec2, DVec3};
use proxy::interior::{CellId, Contents, Interior, Portal, RoomBox};
use proxy::mesh::Model;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Squares' side, and what is beside the eyes, above and below them; in eye heights.
const STEP: f64 = 0.04;
const BAND: [f64; 2] = [-0.12, 0.08];
/// Squares along a side at most.
const MOST: f64 = 1024.0;
/// How far from walls one walks, in eye heights: the first of these that leads there.
const CLEAR: [f64; 4] = [0.16, 0.1, 0.05, 0.0];

/// How far inside of a room's openings one is surely in it, in eye heights.
const INSIDE: [f64; 3] = [0.1, 0.2, 0.3];

/// Which way an opening leads into one of its cells, level and of unit length; nothing of a hatch, which lies flat.
pub(super) fn level_into(portal: &Portal, cell: CellId, up: DVec3) -> Option<DVec3> {
    let normal = portal.normal_into(Some(cell));
    let level = normal - up * normal.dot(up);
    (!portal.lies_flat(up)).then(|| level.normalize())
}

/// A room's floor with what stands at eye height over it.
pub(super) struct FloorMap {
    axes: [DVec3; 2],
    origin: DVec2,
    step: f64,
    size: [usize; 2],
    /// Squares to the nearest that is taken, by city blocks and diagonals alike; 0 is taken.
    free: Vec<u32>,
    /// Squares of the room itself: not all that is in its box need be.
    is_inside: Vec<bool>,
    unit: f64,
}

impl FloorMap {
    /// What of a room's triangles is about as high as `eye`, in the room's box; nothing for a room
    /// without one. `unit` is the eyes' height over the floor.
    pub(super) fn new(
        interior: &Interior,
        contents: &Contents,
        model: &Model,
        id: CellId,
        eye: DVec3,
        unit: f64,
    ) -> Option<Self> {
        let i = id.0 as usize;
        let room = contents.bounds.get(i).copied().flatten()?;
        let triangles = contents.triangles.get(i)?;
        let up = interior.up;
        let along = up.any_orthonormal_vector();
        let axes = [along, up.cross(along)];
        let flat = |p: DVec3| DVec2::new(p.dot(axes[0]), p.dot(axes[1]));
        let half = 0.5 * (room.max - room.min);
        let middle = flat(room.min.midpoint(room.max));
        let reach = DVec2::new(half.dot(axes[0].abs()), half.dot(axes[1].abs()));
        let step = (STEP * unit).max(2.0 * reach.max_element() / MOST);
        let around = reach + 2.0 * step;
        let size = (2.0 * around / step).ceil();
        let mut map = Self {
            axes,
            origin: middle - around,
            step,
            size: [size.x.max(1.0) as usize, size.y.max(1.0) as usize],
            free: Vec::new(),
            is_inside: Vec::new(),
            unit,
        };
        map.free = vec![u32::MAX; map.size[0] * map.size[1]];
        let band = BAND.map(|h| eye.dot(up) + h * unit);
        for triangle in triangles {
            let corners = model.mesh.corners(*triangle as usize);
            let heights = corners.map(|p| p.dot(up));
            let is_off = heights.iter().all(|h| *h < band[0])
                || heights.iter().all(|h| *h > band[1])
                || !corners.iter().all(|p| p.is_finite());
            if !is_off {
                map.take(corners.map(flat), heights, band);
            }
        }
        map.spread();
        map.is_inside = map.inside(interior, id, room, eye);
        Some(map)
    }

    /// The squares that one comes to from the room's openings without passing what stands, an
    /// opening, or the box; and within the room's outline, where that is known. All of the outline,
    /// or of the box, where that leaves nothing.
    fn inside(&self, interior: &Interior, id: CellId, room: RoomBox, eye: DVec3) -> Vec<bool> {
        let count = self.free.len();
        let outline = interior.cell(id).floor.as_ref();
        let within: Vec<bool> = (0..count)
            .map(|i| {
                let at = self.lifted(self.place(i), eye);
                let is_near = room.distance(at) <= 0.5 * self.step;
                is_near && outline.is_none_or(|floor| floor.covers(at, 0.0))
            })
            .collect();
        // 1. Openings are shut, and what is just inside of them is where to begin; what is over or under a
        //    hatch is of the room.
        let mut is_shut = vec![false; count];
        let mut queue = Vec::new();
        for (_, portal) in interior.portals_of(Some(id)) {
            if level_into(portal, id, interior.up).is_none() {
                queue.extend(self.square(self.flat(portal.polygon.center())));
                continue;
            }
            let corners = portal.polygon.corners();
            for (k, from) in corners.iter().enumerate() {
                let to = corners[(k + 1) % corners.len()];
                let steps = (2.0 * from.distance(to) / self.step).ceil().clamp(1.0, 1e4);
                for j in 0..=steps as usize {
                    let at = from.lerp(to, j as f64 / steps);
                    if let Some(i) = self.square(self.flat(at)) {
                        is_shut[i] = true;
                    }
                }
            }
            let inwards = portal.normal_into(Some(id));
            let off = |share: &f64| portal.polygon.center() + share * self.unit * inwards;
            queue.extend(INSIDE.iter().filter_map(|s| self.square(self.flat(off(s)))));
        }
        // 2. From there on, side by side: diagonals pass between a wall's squares.
        let [width, height] = self.size;
        let mut is_inside = vec![false; count];
        while let Some(i) = queue.pop() {
            if is_inside[i] || is_shut[i] || !within[i] || self.free[i] == 0 {
                continue;
            }
            is_inside[i] = true;
            let (x, y) = (i % width, i / width);
            queue.extend((x > 0).then(|| i - 1));
            queue.extend((x + 1 < width).then_some(i + 1));
            queue.extend((y > 0).then(|| i - width));
            queue.extend((y + 1 < height).then_some(i + width));
        }
        match (is_inside.contains(&true), within.contains(&true)) {
            (true, _) => is_inside,
            (false, true) => within,
            (false, false) => vec![true; count],
        }
    }

    /// Takes the squares under a triangle's part in the band, by samples half a square apart.
    fn take(&mut self, corners: [DVec2; 3], heights: [f64; 3], band: [f64; 2]) {
        let length = |i: usize| {
            let j = (i + 1) % 3;
            corners[i]
                .distance(corners[j])
                .max((heights[i] - heights[j]).abs())
        };
        let longest = (0..3).map(length).fold(0.0, f64::max);
        let count = (2.0 * longest / self.step).ceil().clamp(1.0, 4096.0) as usize;
        for i in 0..=count {
            for j in 0..=count - i {
                let (a, b) = (i as f64 / count as f64, j as f64 / count as f64);
                let c = 1.0 - a - b;
                let height = a * heights[0] + b * heights[1] + c * heights[2];
                if height >= band[0] && height <= band[1] {
                    let at = a * corners[0] + b * corners[1] + c * corners[2];
                    if let Some(i) = self.square(at) {
                        self.free[i] = 0;
                    }
                }
            }
        }
    }

    /// Finds how far each square is from the nearest that is taken (in two passes, Rosenfeld and
    /// Pfaltz 1966).
    fn spread(&mut self) {
        let [width, height] = self.size;
        for is_back in [false, true] {
            for k in 0..self.free.len() {
                let i = if is_back { self.free.len() - 1 - k } else { k };
                let (x, y) = (i % width, i / width);
                let mut least = self.free[i];
                for (dx, dy) in [(0, 1), (1, 0), (1, 1), (1, 2)] {
                    // (1, 2) stands for the other diagonal.
                    let (dx, dy): (isize, isize) = if dy == 2 { (-1, 1) } else { (dx, dy) };
                    let way = if is_back { 1 } else { -1 };
                    let (x, y) = (x as isize + way * dx, y as isize + way * dy);
                    if x >= 0 && y >= 0 && (x as usize) < width && (y as usize) < height {
                        let j = y as usize * width + x as usize;
                        least = least.min(self.free[j].saturating_add(1));
                    }
                }
                self.free[i] = least;
            }
        }
    }

    fn square(&self, at: DVec2) -> Option<usize> {
        let p = (at - self.origin) / self.step;
        let is_in =
            p.x >= 0.0 && p.y >= 0.0 && p.x < self.size[0] as f64 && p.y < self.size[1] as f64;
        is_in.then(|| p.y as usize * self.size[0] + p.x as usize)
    }

    fn flat(&self, p: DVec3) -> DVec2 {
        DVec2::new(p.dot(self.axes[0]), p.dot(self.axes[1]))
    }

    /// How far what stands nearest to a point is, in world units; infinite beside the map.
    pub(super) fn clearance(&self, p: DVec3) -> f64 {
        let square = self.square(self.flat(p));
        square.map_or(f64::INFINITY, |i| f64::from(self.free[i]) * self.step)
    }

    /// Whether a straight way keeps so far from all that stands.
    fn is_clear(&self, from: DVec3, to: DVec3, clear: f64) -> bool {
        let count = (2.0 * from.distance(to) / self.step).ceil().max(1.0) as usize;
        let at = |k: usize| from.lerp(to, k as f64 / count as f64);
        (0..=count).all(|k| self.clearance(at(k)) > clear)
    }

    /// The corners of a short way around what stands between two points, without them: none where
    /// the straight way is free. Nothing where no way is.
    pub(super) fn way(&self, from: DVec3, to: DVec3) -> Option<Vec<DVec3>> {
        // Who starts beside a wall may.
        let ends = self.clearance(from).min(self.clearance(to));
        CLEAR.iter().find_map(|clear| {
            let clear = (clear * self.unit).min(0.5 * ends);
            match self.is_clear(from, to, clear) {
                true => Some(Vec::new()),
                false => self.found(from, to, clear),
            }
        })
    }

    /// The place of the room nearest to a point that has room around it, as much as there is; the
    /// point where it has, or no place is free.
    pub(super) fn roomy(&self, near: DVec3) -> DVec3 {
        let at = self.flat(near);
        let found = CLEAR.iter().find_map(|clear| {
            let is_free = |i: &usize| {
                self.is_inside[*i] && f64::from(self.free[*i]) * self.step > clear * self.unit
            };
            if self.square(at).is_some_and(|i| is_free(&i)) {
                return Some(near);
            }
            let off = |i: &usize| self.place(*i).distance_squared(at);
            let best = (0..self.free.len())
                .filter(is_free)
                .min_by(|a, b| off(a).total_cmp(&off(b)).then(a.cmp(b)));
            best.map(|i| self.lifted(self.place(i), near))
        });
        found.unwrap_or(near)
    }

    fn place(&self, i: usize) -> DVec2 {
        let p = DVec2::new((i % self.size[0]) as f64, (i / self.size[0]) as f64);
        self.origin + (p + 0.5) * self.step
    }

    /// A place of the map, as high as a point.
    fn lifted(&self, at: DVec2, like: DVec3) -> DVec3 {
        let off = at - self.flat(like);
        like + off.x * self.axes[0] + off.y * self.axes[1]
    }

    /// A shortest way over squares (Dijkstra 1959), and of its squares those that are needed.
    fn found(&self, from: DVec3, to: DVec3, clear: f64) -> Option<Vec<DVec3>> {
        let [start, goal] = [from, to].map(|p| self.square(self.flat(p)));
        let (start, goal) = (start?, goal?);
        let [width, height] = self.size;
        let is_open = |i: usize| f64::from(self.free[i]) * self.step > clear;
        let mut came = vec![usize::MAX; self.free.len()];
        let mut cost = vec![u64::MAX; self.free.len()];
        let mut queue = BinaryHeap::from([Reverse((0_u64, start))]);
        cost[start] = 0;
        while let Some(Reverse((so_far, i))) = queue.pop() {
            if i == goal {
                break;
            }
            if so_far > cost[i] {
                continue;
            }
            let (x, y) = ((i % width) as isize, (i / width) as isize);
            for (dx, dy) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))) {
                let (x, y) = (x + dx, y + dy);
                let is_in = x >= 0 && y >= 0 && (x as usize) < width && (y as usize) < height;
                if !is_in || (dx, dy) == (0, 0) {
                    continue;
                }
                let j = y as usize * width + x as usize;
                let all = so_far + if dx != 0 && dy != 0 { 14 } else { 10 };
                if is_open(j) && all < cost[j] {
                    cost[j] = all;
                    came[j] = i;
                    queue.push(Reverse((all, j)));
                }
            }
        }
        if came[goal] == usize::MAX && goal != start {
            return None;
        }
        let mut squares = Vec::new();
        let mut at = goal;
        while at != start {
            squares.push(self.lifted(self.place(at), from));
            at = came[at];
        }
        squares.reverse();
        // As straight as may be: from each corner to the last that it sees.
        let mut way = Vec::new();
        let mut here = from;
        let mut k = 0;
        while k < squares.len() && !self.is_clear(here, to, clear) {
            let seen = (k..squares.len())
                .rev()
                .find(|j| self.is_clear(here, squares[*j], clear));
            let next = seen.unwrap_or(k);
            here = squares[next];
            way.push(here);
            k = next + 1;
        }
        Some(way)
    }
}
