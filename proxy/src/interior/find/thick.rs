//! Doorways and windows in thick walls, where rooms that grow to the middle of thin ones do not meet.

use super::columns::{Columns, band};
use super::distance::squared_distances;
use super::regions::{Grown, Labels, renumber};
use std::collections::BTreeSet;

/// Rooms meet in openings of walls that are no thicker; metres.
pub(super) const THICKEST: f64 = 1.2;
/// What hangs over a doorway is at this height or higher, and so far below the ceiling; metres.
const LEAST_HEAD: f64 = 1.8;
const BELOW_CEILING: f64 = 0.12;
const NO_CEILING: f64 = 2.5;
/// One looks through a window between these heights over the floor, and its sill is between those; metres.
const SEEN: [f64; 2] = [1.3, 1.65];
pub(super) const SILLS: [f64; 2] = [0.3, SEEN[0]];
/// A wall's hollow begins so near to its doorway; metres.
const JAMB: f64 = 0.2;

/// By square of doorways and windows as deep as a thick wall, the room that goes on there, half as deep as the wall; 0 is
/// none. `known` are rooms before they grow, and `grown` after, neither of which reach all through.
pub(super) fn passages(columns: &Columns, known: &[u32], grown: &[u32]) -> Vec<u32> {
    let top = columns.ceiling.unwrap_or(NO_CEILING) - BELOW_CEILING;
    let mut labels = vec![0_u32; known.len()];
    // 1. Doorways: there is floor, and a lintel over it.
    let heads = band([LEAST_HEAD, top]);
    let is_passage = |i: usize| {
        let has_head = columns.taken[i] & heads != 0;
        let is_below = has_head && (columns.is_free(i) || columns.is_low(i));
        known[i] == 0 && (columns.is_lintel(i) || is_below)
    };
    label(columns, [known, grown], is_passage, &mut labels);
    // 2. Windows elsewhere: there is a sill, and what hangs over it, but floor below need not be.
    let is_of_doorway: Vec<bool> = labels.iter().map(|label| *label != 0).collect();
    let [sills, between, heads] = [SILLS, SEEN, [SEEN[1], top]].map(band);
    let is_over_sill = |i: usize| {
        let has = |heights: u128| columns.taken[i] & heights != 0;
        let is_face = || columns.beside(i).any(|j| known[j] != 0);
        known[i] == 0
            && !is_of_doorway[i]
            && has(sills)
            && !has(between)
            && has(heads)
            // Else nothing tells how thick the wall is.
            && (!is_face() || columns.is_lintel(i) || columns.is_wall(i))
    };
    label(columns, [known, grown], is_over_sill, &mut labels);
    labels
}

/// Labels squares of passages that lead from a room to another through what is not theirs yet, each with the room that is
/// nearest along it.
fn label(
    columns: &Columns,
    [known, grown]: [&[u32]; 2],
    is_passage: impl Fn(usize) -> bool,
    labels: &mut [u32],
) {
    let deepest = columns.squares(0.5 * THICKEST) + 1.0;
    let mut is_done = vec![false; known.len()];
    for first in 0..known.len() {
        if is_done[first] || !is_passage(first) {
            continue;
        }
        // 1. All that hangs together, and the rooms that it is beside.
        is_done[first] = true;
        let mut piece = vec![first];
        let mut next = 0;
        while let Some(i) = piece.get(next).copied() {
            next += 1;
            for j in columns.beside(i) {
                if !is_done[j] && is_passage(j) {
                    is_done[j] = true;
                    piece.push(j);
                }
            }
        }
        let room_beside = |i: usize| columns.beside(i).map(|j| known[j]).find(|room| *room != 0);
        let rooms: BTreeSet<u32> = piece.iter().filter_map(|i| room_beside(*i)).collect();
        let left = piece.iter().filter(|i| grown[**i] == 0).count();
        if rooms.len() < 2 || 2 * left <= piece.len() {
            continue;
        }
        // 2. From all of them square by square, unless that goes too far.
        let mut front: Vec<usize> = Vec::new();
        for i in &piece {
            if let Some(room) = room_beside(*i) {
                labels[*i] = room;
                front.push(*i);
            }
        }
        let mut depth = 0_usize;
        while !front.is_empty() {
            depth += 1;
            let mut further = Vec::new();
            for i in front {
                for j in columns.beside(i) {
                    if labels[j] == 0 && is_passage(j) {
                        labels[j] = labels[i];
                        further.push(j);
                    }
                }
            }
            front = further;
        }
        if depth as f64 > deepest {
            piece.iter().for_each(|i| labels[*i] = 0);
        }
    }
}

/// Drops what is only the hollow of a thick wall: beside a doorway in it, no wider than such a wall, and with nothing
/// but wall around; whether there was one.
pub(super) fn drop_hollows(columns: &Columns, found: &mut Labels, grown: &Grown) -> bool {
    if !grown.is_doorway.contains(&true) {
        return false;
    }
    let (to_doorway, _) = squared_distances(columns.size, |i| grown.is_doorway[i]);
    let (to_side, _) = squared_distances(columns.size, |i| found.labels[i] == 0);
    let near = columns.squares(JAMB).powi(2);
    let widest = (columns.squares(0.5 * THICKEST) + 0.5).powi(2);
    let count = found.count as usize + 1;
    let (mut is_near, mut is_room) = (vec![false; count], vec![false; count]);
    for (i, label) in found.labels.iter().enumerate().filter(|(_, l)| **l != 0) {
        let mut beside = columns.beside(i).filter(|j| found.labels[*j] != *label);
        let is_open = beside.any(|j| columns.is_free(j) || columns.is_lintel(j));
        is_near[*label as usize] |= to_doorway[i] <= near;
        is_room[*label as usize] |= is_open || to_side[i] > widest;
    }
    let is_hollow = |label: u32| is_near[label as usize] && !is_room[label as usize];
    let is_any = (1..=found.count).any(is_hollow);
    if is_any {
        for label in &mut found.labels {
            if is_hollow(*label) {
                *label = 0;
            }
        }
        renumber(found);
    }
    is_any
}
