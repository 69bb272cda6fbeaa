//! Holes in what parts two rooms.

use super::columns::{Columns, band, height_of};
use super::holes::{LEAST, holes};
use super::regions::Grown;
use super::thick::{SILLS, THICKEST};
use glam::DVec2;
use std::collections::BTreeMap;
use std::ops::Range;

/// A rectangle that one sees through, upright, across an axis of the plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Opening {
    /// The label in front of it, on the greater side of its axis, and behind.
    pub(super) rooms: [u32; 2],
    /// The axis of the plan that it lies across.
    pub(super) axis: usize,
    /// Where it is on that axis, in world units of the level's frame; all others, too.
    pub(super) at: f64,
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) sill: f64,
    pub(super) head: f64,
    /// Whether it is in the middle of a thick wall, to which rooms' outlines do not reach.
    pub(super) is_deep: bool,
}

impl Opening {
    pub(super) fn ends(&self) -> [DVec2; 2] {
        [self.from, self.to].map(|along| match self.axis {
            0 => DVec2::new(self.at, along),
            _ => DVec2::new(along, self.at),
        })
    }

    /// Towards the first room.
    pub(super) fn normal(&self) -> DVec2 {
        match self.axis {
            0 => DVec2::X,
            _ => DVec2::Y,
        }
    }
}

/// A square's side that parts two rooms: where it is on the axis across it, and along it.
type Edge = (usize, usize);

/// A straight part of what parts two rooms.
pub(super) struct Side {
    rooms: [u32; 2],
    /// In squares.
    length: usize,
    /// How much of it is open at eye height.
    open: usize,
    /// How much of that has a lintel.
    lintel: usize,
    /// How much of it is wall.
    walled: usize,
    pub(super) openings: Vec<Opening>,
}

/// Where a side is: what it lies between by its labels, and where it goes straight on though they
/// do not.
struct Place {
    span: Squares,
    straightened: Vec<Squares>,
}

/// The least and the greatest of squares along both axes of the plan.
#[derive(Clone, Copy)]
struct Squares {
    least: [usize; 2],
    most: [usize; 2],
}

impl Squares {
    /// By ranges on an axis and along it.
    fn of(axis: usize, at: Range<usize>, along: Range<usize>) -> Self {
        let pair = |at: usize, along: usize| if axis == 0 { [at, along] } else { [along, at] };
        Self {
            least: pair(at.start, along.start),
            most: pair(at.end, along.end),
        }
    }

    fn has(&self, other: &Self) -> bool {
        (0..2).all(|k| self.least[k] <= other.least[k] && other.most[k] <= self.most[k])
    }
}

/// Sides of two rooms are one if they lie within this; metres.
const SAME_PLANE: f64 = 0.2;
/// Walls are looked for on both sides of where rooms meet; metres.
const REACH: f64 = 0.35;
/// Openings that end within this of each other, and of a wall between the rooms beyond, end there; metres.
const SAME_END: f64 = 0.35;
/// Floors are rough: an opening that begins lower begins at the floor; metres.
const THRESHOLD: f64 = 0.3;
const ROUGH: f64 = 0.15;
/// Where rooms meet in the open, the line between them bends towards the end of a wall. What parts
/// them goes straight on, if there is a wall within this; metres.
const BENT: f64 = 0.6;
/// The highest an opening is believed without a ceiling; metres.
const NO_CEILING: f64 = 2.2;
/// Rooms are one if this much of what parts them is open, and this much of that below a beam.
const ALL_OPEN: f64 = 0.85;
const BELOW_BEAM: f64 = 0.5;
/// What is open on less than this below a lintel is a doorway, not a beam's room; metres.
const WIDEST_DOORWAY: f64 = 3.0;
/// Longer sides than this with hardly a wall part nothing; metres.
const UNMARKED: f64 = 2.6;

/// All that rooms share, in order.
pub(super) fn openings(columns: &Columns, grown: &Grown) -> Vec<Side> {
    // 1. Where labels change: across an axis, at a place on it, from one square to the next.
    let mut edges: BTreeMap<([u32; 2], usize), Vec<Edge>> = BTreeMap::new();
    let [width, height] = columns.size;
    for y in 0..height {
        for x in 0..width {
            let i = y * width + x;
            let ways = [(0, x + 1 < width, i + 1), (1, y + 1 < height, i + width)];
            for (axis, is_in, j) in ways {
                if !is_in || grown.labels[i] == 0 {
                    continue;
                }
                let rooms = [grown.labels[j], grown.labels[i]];
                if rooms[0] != 0 && rooms[0] != rooms[1] {
                    let (at, along) = if axis == 0 { (x + 1, y) } else { (y + 1, x) };
                    edges.entry((rooms, axis)).or_default().push((at, along));
                }
            }
        }
    }
    // 2. Straight sides, the longest first.
    let mut sides = Vec::new();
    let reach = columns.squares(SAME_PLANE).round() as usize;
    for ((rooms, axis), mut left) in edges {
        loop {
            let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
            left.iter()
                .for_each(|(at, _)| *counts.entry(*at).or_default() += 1);
            let around = |at: usize| -> usize {
                let near = counts.range(at.saturating_sub(reach)..=at + reach);
                near.map(|(_, n)| n).sum()
            };
            let best = counts
                .keys()
                .copied()
                .max_by_key(|at| (around(*at), counts[at]));
            let Some(best) = best else { break };
            if (around(best) as f64) < columns.squares(LEAST) {
                break;
            }
            let (near, rest) = left
                .into_iter()
                .partition(|(at, _)| at.abs_diff(best) <= reach);
            left = rest;
            sides.push(side(columns, grown, rooms, axis, near));
        }
    }
    // 3. Without the bends of lines that go straight on.
    let is_bend = |(side, place): &(Side, Place)| {
        let is_of = |other: &Side| side.rooms.iter().all(|r| other.rooms.contains(r));
        let others = sides.iter().filter(|(other, _)| is_of(other));
        let mut bends = others.flat_map(|(_, other)| &other.straightened);
        bends.any(|bend| bend.has(&place.span))
    };
    let bends: Vec<bool> = sides.iter().map(is_bend).collect();
    let sides = sides.into_iter().zip(bends).filter(|(_, bend)| !bend);
    sides.map(|((side, _), _)| side).collect()
}

/// Where openings of one room into two others meet, the wall between those two begins: both end at its
/// plane. (Around the end of a wall rooms do not meet in a straight line.)
pub(super) fn meet(columns: &Columns, openings: &mut [Opening]) {
    let near = SAME_END * columns.meter;
    for i in 0..openings.len() {
        for j in 0..openings.len() {
            let (a, b) = (openings[i], openings[j]);
            let is_one_side = a.axis == b.axis && (a.at - b.at).abs() <= near;
            if i == j || !is_one_side || (a.to - b.from).abs() > near {
                continue;
            }
            let ends: Vec<u32> = a
                .rooms
                .into_iter()
                .filter(|r| !b.rooms.contains(r))
                .collect();
            let others: Vec<u32> = b
                .rooms
                .into_iter()
                .filter(|r| !a.rooms.contains(r))
                .collect();
            let is_between = |c: &&Opening| {
                let pair = [ends.first(), others.first()].map(Option::<&u32>::copied);
                c.axis != a.axis
                    && pair.iter().all(|r| r.is_some_and(|r| c.rooms.contains(&r)))
                    && (c.at - a.to).abs() <= near
            };
            if let Some(at) = openings.iter().find(is_between).map(|c| c.at) {
                openings[i].to = at;
                openings[j].from = at;
            }
        }
    }
}

/// What parts two rooms, the lesser label first: how much there is of it, and how much is open, has a
/// lintel, and is wall.
type Parts = BTreeMap<(u32, u32), [usize; 4]>;

fn add(parts: &mut Parts, [a, b]: [u32; 2], more: [usize; 4]) {
    let sums = parts.entry((a.min(b), a.max(b))).or_default();
    sums.iter_mut().zip(more).for_each(|(sum, n)| *sum += n);
}

/// Pairs of rooms that nothing but a beam parts, or nothing at all; no more than so many. From one pair on
/// its second room goes by the name of its first, and what parts the two from a third is one.
pub(super) fn open_pairs(columns: &Columns, sides: &[Side], at_once: usize) -> Vec<(u32, u32)> {
    let mut parts = Parts::new();
    for side in sides {
        let sums = [side.length, side.open, side.lintel, side.walled];
        add(&mut parts, side.rooms, sums);
    }
    let widest = columns.squares(UNMARKED);
    let is_open = |[length, open, lintel, walled]: [usize; 4]| {
        let below_beam = lintel as f64 > BELOW_BEAM * open as f64;
        // What is as narrow as a doorway is one, though no wall was seen beside it.
        let is_wide = open as f64 > columns.squares(WIDEST_DOORWAY);
        let is_beam = is_wide && open as f64 > ALL_OPEN * length as f64 && below_beam;
        // Where not all is seen, what is unknown looks like a bottleneck.
        let is_gap = !below_beam && length as f64 > widest && 4 * walled < length;
        is_beam || is_gap
    };
    let mut pairs = Vec::new();
    while pairs.len() < at_once {
        let open = parts.iter().find(|(_, sums)| is_open(**sums));
        let Some((&(a, b), _)) = open else { break };
        pairs.push((a, b));
        for ((c, d), sums) in std::mem::take(&mut parts) {
            let rooms = [c, d].map(|label| if label == b { a } else { label });
            if rooms[0] != rooms[1] {
                add(&mut parts, rooms, sums);
            }
        }
    }
    pairs
}

fn side(
    columns: &Columns,
    grown: &Grown,
    rooms: [u32; 2],
    axis: usize,
    edges: Vec<Edge>,
) -> (Side, Place) {
    let labels = &grown.labels;
    let index = |at: usize, along: usize| match axis {
        0 => along * columns.size[0] + at,
        _ => at * columns.size[0] + along,
    };
    let most = columns.size[axis];
    let mut places: Vec<usize> = edges.iter().map(|(at, _)| *at).collect();
    places.sort_unstable();
    let middle = places[places.len() / 2];
    let mut alongs: Vec<usize> = edges.iter().map(|(_, along)| *along).collect();
    alongs.sort_unstable();
    alongs.dedup();
    let (first, last) = (alongs[0], alongs[alongs.len() - 1] + 1);
    let span = Squares::of(axis, places[0]..places[places.len() - 1], first..last);
    let is_inside = |along: &usize| {
        let both = [middle.saturating_sub(1), middle.min(most - 1)];
        let mut labels = both.iter().map(|at| labels[index(*at, *along)]);
        labels.all(|label| rooms.contains(&label))
    };
    let bent = columns.squares(BENT).round() as usize;
    let ahead = (last..columns.size[1 - axis]).take_while(is_inside);
    let behind = (0..first).rev().take_while(is_inside);
    let ahead = last..last + ahead.take(bent + 1).count();
    let behind = first - behind.take(bent + 1).count()..first;
    let mut straightened = Vec::new();
    for more in [ahead, behind] {
        if (1..=bent).contains(&more.len()) {
            let around = middle.saturating_sub(bent)..middle + bent;
            let beside = more.start.saturating_sub(bent)..more.end + bent;
            straightened.push(Squares::of(axis, around, beside));
            alongs.extend(more);
        }
    }
    alongs.sort_unstable();
    // 1. How thick the wall is, and where its middle is.
    let in_doorway = edges
        .iter()
        .filter(|(at, along)| grown.is_doorway[index(*at, *along)]);
    let is_deep = 2 * in_doorway.count() > edges.len();
    let reach = if is_deep {
        0.5 * THICKEST + columns.step_m
    } else {
        REACH
    };
    let reach = columns.squares(reach).round() as usize;
    let around = middle.saturating_sub(reach)..(middle + reach).min(most);
    let is_wall = |at: usize, along: usize| {
        let i = index(at, along);
        columns.is_wall(i) || columns.is_lintel(i)
    };
    let mut walls: Vec<(usize, usize)> = Vec::new();
    for along in &alongs {
        let mut of = around.clone().filter(|at| is_wall(*at, *along));
        if let Some(first) = of.next() {
            walls.push((first, of.next_back().unwrap_or(first) + 1));
        }
    }
    let (low, high) = if columns.seen.is_some() {
        // Of a wall often one face was seen, and leaves of doors beside the other: all that is as
        // long as the narrowest opening is of it.
        let length = |at: usize| alongs.iter().filter(|a| is_wall(at, **a)).count() as f64;
        let mut faces = around.filter(|at| length(*at) >= columns.squares(LEAST));
        let first = faces.next();
        let last = faces.next_back().or(first).map(|at| at + 1);
        (first.unwrap_or(middle), last.unwrap_or(middle))
    } else {
        let median = |pick: fn(&(usize, usize)) -> usize| {
            let mut all: Vec<usize> = walls.iter().map(pick).collect();
            all.sort_unstable();
            all.get(all.len() / 2).copied().unwrap_or(middle)
        };
        (median(|w| w.0), median(|w| w.1))
    };
    let at = 0.5 * (low + high) as f64;
    let across = low.saturating_sub(1)..(high + 1).min(most);
    // 2. What is open, square by square along it.
    let first = alongs[0];
    let length = alongs[alongs.len() - 1] - first + 1;
    let mut open = vec![0_u128; length];
    let (mut open_count, mut lintel_count) = (0, 0);
    let top = columns.lintel_band().unwrap_or(0);
    let range = band([ROUGH, columns.ceiling.unwrap_or(NO_CEILING)]);
    let sills = band(SILLS);
    for along in &alongs {
        let all = across.clone().map(|at| index(at, *along));
        let taken = all.clone().fold(0, |t, i| t | columns.taken[i]);
        let mut free = !taken & range;
        let mut is_open = columns.is_open_at_eye(taken);
        // All that there is of deep sides is openings, and however wide windows are, no beam alone parts the rooms.
        is_open &= !(is_deep && taken & sills != 0);
        if columns.seen.is_some() {
            // Someone saw through all of its thickness.
            let inner = low..high.max(low + 1);
            free &= inner.fold(!0, |s, at| s & columns.seen_near(at, *along, axis));
            free = reaching(free, !taken & range);
            is_open &= !columns.is_open_at_eye(free);
        }
        open[along - first] = free;
        open_count += usize::from(is_open);
        let has_top = 2 * (taken & top).count_ones() >= top.count_ones() && top != 0;
        lintel_count += usize::from(is_open && has_top);
    }
    // 3. Its holes.
    let unit = columns.step;
    let [along_origin, at_origin] = match axis {
        0 => [columns.origin.y, columns.origin.x],
        _ => [columns.origin.x, columns.origin.y],
    };
    let highest = columns.ceiling.unwrap_or(NO_CEILING);
    let opening = |hole: [usize; 4]| {
        let [from, to, sill, head] = hole;
        let sill = height_of(sill);
        let head = height_of(head);
        Opening {
            rooms,
            axis,
            at: at_origin + at * unit,
            from: along_origin + (first + from) as f64 * unit,
            to: along_origin + (first + to) as f64 * unit,
            sill: if sill < THRESHOLD {
                0.0
            } else {
                sill * columns.meter
            },
            head: head.min(highest) * columns.meter,
            is_deep,
        }
    };
    let holes = holes(&open, columns.step_m);
    let side = Side {
        rooms,
        length: alongs.len(),
        open: open_count,
        lintel: lintel_count,
        walled: walls.len(),
        openings: holes.into_iter().map(opening).collect(),
    };
    (side, Place { span, straightened })
}

/// All of a column's free bins that join what was seen to be open: an opening ends where there is
/// surface, not where lines of sight did.
fn reaching(seen: u128, free: u128) -> u128 {
    let mut all = seen & free;
    loop {
        let more = (all | all << 1 | all >> 1) & free;
        if more == all {
            return all;
        }
        all = more;
    }
}
