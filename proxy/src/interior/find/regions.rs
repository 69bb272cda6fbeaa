//! Rooms as regions of the floor grid.

use super::FindOptions;
use super::columns::Columns;
use super::complete::complete;
use super::corridors;
use super::distance::squared_distances;
use super::thick;
use std::collections::BTreeMap;

/// Walls thinner than twice this lie between two rooms; metres.
const HALF_WALL: f64 = 0.26;
/// How far a room goes into a wall with nothing behind it; metres.
const INTO_WALL: f64 = 0.06;
/// What stands before walls belongs to the room up to this depth; metres.
const FURNITURE: f64 = 1.0;
/// Half the width of the narrowest room; metres.
const LEAST_HALF_WIDTH: f64 = 0.3;
/// A region with nothing around so much of it is no room, where all floor is known.
const OPEN_OUTLINE: f64 = 0.25;

/// Free squares by room, from 1; 0 is none.
pub(super) struct Labels {
    pub(super) labels: Vec<u32>,
    pub(super) count: u32,
}

/// The same with rooms up to the middle of their walls.
pub(super) struct Grown {
    pub(super) labels: Vec<u32>,
    pub(super) count: u32,
    /// What is of a doorway or window in a thick wall.
    pub(super) is_doorway: Vec<bool>,
}

/// The basins of the distance to walls, those joined that no bottleneck parts (watershed by
/// flooding from the peaks, Vincent and Soille 1991).
pub(super) fn regions(columns: &Columns, options: &FindOptions) -> Labels {
    let (squared, _) = squared_distances(columns.size, |i| !columns.is_free(i));
    let distances: Vec<f64> = squared.iter().map(|d| d.sqrt() * columns.step_m).collect();
    let mut order: Vec<u32> = (0..columns.count() as u32)
        .filter(|i| columns.is_free(*i as usize) && distances[*i as usize].is_finite())
        .collect();
    order.sort_by(|a, b| distances[*b as usize].total_cmp(&distances[*a as usize]));
    let mut basins = Basins::default();
    let mut labels = vec![0_u32; columns.count()];
    let width = columns.size[0];
    for i in order {
        let i = i as usize;
        // Nothing is free on the grid's border, so there are always eight.
        let around = [
            i - 1,
            i + 1,
            i - width,
            i + width,
            i - width - 1,
            i - width + 1,
            i + width - 1,
            i + width + 1,
        ];
        // Uphill: where basins meet, they do not run along each other's shores.
        let known = around.into_iter().filter(|j| labels[*j] != 0);
        let uphill = known.clone().reduce(|best, j| {
            if distances[j] > distances[best] {
                j
            } else {
                best
            }
        });
        labels[i] = match uphill {
            None => basins.begin(distances[i]),
            Some(uphill) => {
                let own = labels[uphill];
                for j in known {
                    basins.meet(own, labels[j], distances[i], options);
                }
                own
            }
        };
    }
    for label in labels.iter_mut().filter(|l| **l != 0) {
        let root = basins.root(*label);
        // Between the two faces of a wall is no room.
        *label = match basins.peaks[root as usize - 1] < LEAST_HALF_WIDTH {
            true => 0,
            false => root,
        };
    }
    let mut found = Labels { labels, count: 0 };
    if columns.seen.is_none() {
        drop_outside(columns, &mut found);
    }
    renumber(&mut found);
    corridors::split(columns, &mut found, options);
    renumber(&mut found);
    found
}

#[derive(Default)]
struct Basins {
    /// By label less one.
    parents: Vec<u32>,
    peaks: Vec<f64>,
}

impl Basins {
    fn begin(&mut self, peak: f64) -> u32 {
        self.parents.push(self.parents.len() as u32 + 1);
        self.peaks.push(peak);
        self.parents.len() as u32
    }

    fn root(&mut self, label: u32) -> u32 {
        let mut at = label;
        while self.parents[at as usize - 1] != at {
            let above = self.parents[at as usize - 1];
            self.parents[at as usize - 1] = self.parents[above as usize - 1];
            at = above;
        }
        at
    }

    /// Two basins meet at a saddle, and become one unless it is narrow.
    fn meet(&mut self, a: u32, b: u32, saddle: f64, options: &FindOptions) {
        let (a, b) = (self.root(a), self.root(b));
        let (high, low) = match self.peaks[a as usize - 1] >= self.peaks[b as usize - 1] {
            true => (a, b),
            false => (b, a),
        };
        let is_narrow = saddle < options.bottleneck * self.peaks[low as usize - 1];
        if high != low && !(is_narrow && 2.0 * saddle <= options.max_passage) {
            self.parents[low as usize - 1] = high;
        }
    }
}

/// What is around a region, in squares' sides.
#[derive(Default)]
struct Outline {
    /// Nothing known.
    open: usize,
    /// Floor below what is too low to stand under.
    low: usize,
    all: usize,
}

/// Drops regions that nothing encloses: gardens, and floor around a house. Those that sloped ceilings
/// enclose reach as far below these as there is floor.
fn drop_outside(columns: &Columns, found: &mut Labels) {
    let mut outlines: BTreeMap<u32, Outline> = BTreeMap::new();
    for i in (0..columns.count()).filter(|i| found.labels[*i] != 0) {
        let outline = outlines.entry(found.labels[i]).or_default();
        for j in columns.beside(i).filter(|j| !columns.is_free(*j)) {
            let is_low = columns.is_low(j);
            outline.all += 1;
            outline.low += usize::from(is_low);
            outline.open += usize::from(!is_low && !columns.is_wall(j) && !columns.is_lintel(j));
        }
    }
    let is_much = |part: usize, outline: &Outline| part as f64 > OPEN_OUTLINE * outline.all as f64;
    let of = |label: &u32| outlines.get(label);
    let is_outside = |label: &u32| of(label).is_some_and(|o| is_much(o.open, o));
    let is_sloped = |label: &u32| of(label).is_some_and(|o| is_much(o.open + o.low, o));
    for label in &mut found.labels {
        if is_outside(label) {
            *label = 0;
        }
    }
    let mut reached: Vec<usize> = (0..columns.count())
        .filter(|i| is_sloped(&found.labels[*i]))
        .collect();
    let mut next = 0;
    while let Some(i) = reached.get(next).copied() {
        next += 1;
        for j in columns.beside(i) {
            if found.labels[j] == 0 && columns.is_low(j) {
                found.labels[j] = found.labels[i];
                reached.push(j);
            }
        }
    }
}

/// Numbers regions in the order of their first squares.
pub(super) fn renumber(found: &mut Labels) {
    let mut names: BTreeMap<u32, u32> = BTreeMap::new();
    for label in found.labels.iter_mut().filter(|l| **l != 0) {
        let next = names.len() as u32 + 1;
        *label = *names.entry(*label).or_insert(next);
    }
    found.count = names.len() as u32;
}

/// Rooms with what stands in them and half of their walls.
pub(super) fn grown(columns: &Columns, found: &Labels) -> Grown {
    let mut known = found.labels.clone();
    if columns.seen.is_some() {
        complete(columns, &mut known);
    }
    let (squared, nearest) = squared_distances(columns.size, |i| known[i] != 0);
    // 1. Furniture that is open above: what is free above it is of the room.
    let top = columns.lintel_band();
    let depth = columns.squares(FURNITURE).powi(2);
    let is_tall = |i: usize| top.is_some_and(|top| columns.taken[i] & top != 0);
    let is_room = |i: usize| {
        let is_thing = top.is_some()
            && squared[i] <= depth
            && columns.is_wall(i)
            && !is_tall(i)
            // Not the other face of a wall.
            && !columns.between(i, nearest[i] as usize).any(is_tall);
        known[i] != 0 || is_thing
    };
    // 2. Walls between rooms: gaps in all of them together. Other walls: a little of them.
    let mut is_in = columns.closed(HALF_WALL, is_room);
    let skin = columns.squares(INTO_WALL).powi(2);
    for i in 0..columns.count() {
        is_in[i] |= squared[i] <= skin;
    }
    let label = |i: usize| match is_in[i] && nearest[i] != u32::MAX {
        true => known[nearest[i] as usize],
        false => 0,
    };
    let mut labels: Vec<u32> = (0..columns.count()).map(label).collect();
    // 3. In doorways and windows of thick walls: there they meet in the middle, too.
    let doorways = match columns.seen {
        None => thick::passages(columns, &known, &labels),
        Some(_) => vec![0; labels.len()],
    };
    for (label, doorway) in labels.iter_mut().zip(&doorways) {
        if *doorway != 0 {
            *label = *doorway;
        }
    }
    Grown {
        labels,
        count: found.count,
        is_doorway: doorways.iter().map(|doorway| *doorway != 0).collect(),
    }
}
