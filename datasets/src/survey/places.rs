//! Where one stands to take photos of rooms.

use crate::DatasetError;
use glam::DVec3;
use proxy::Solid;
use proxy::interior::{CellId, Contents, Interior};
use rayon::prelude::*;

/// Between places that are tried, in eye heights.
const SPACING: f64 = 0.2;
/// How far from anything an eye stays, in eye heights.
const CLEARANCE: f64 = 0.2;
/// How far below an eye the floor may be, in eye heights.
const STEP_DOWN: f64 = 1.2;

/// Up to `count` places for an eye, as far from each other as may be, the one nearest to the
/// middle of each room first.
pub(super) fn places(
    interior: &Interior,
    contents: &Contents,
    solid: &Solid,
    count: usize,
) -> Result<Vec<DVec3>, DatasetError> {
    let free = free_places(interior, contents, solid);
    let mut distances = vec![f64::INFINITY; free.len()];
    let mut chosen = Vec::new();
    let choose = |i: usize, chosen: &mut Vec<DVec3>, distances: &mut Vec<f64>| {
        chosen.push(free[i].1);
        for (distance, (_, place)) in distances.iter_mut().zip(&free) {
            *distance = distance.min(place.distance(free[i].1));
        }
    };
    // 1. The middles of rooms.
    for (cell, bounds) in contents.bounds.iter().enumerate() {
        let Some(bounds) = bounds else { continue };
        let middle = 0.5 * (bounds.min + bounds.max);
        let off = |i: &usize| free[*i].1.distance(middle);
        let inside = (0..free.len()).filter(|i| free[*i].0.0 as usize == cell);
        if let Some(i) = inside.min_by(|a, b| off(a).total_cmp(&off(b))) {
            choose(i, &mut chosen, &mut distances);
        }
    }
    // 2. Wherever one is farthest from them all, as long as that is elsewhere.
    while chosen.len() < count {
        let farthest = (0..free.len()).max_by(|a, b| distances[*a].total_cmp(&distances[*b]));
        let Some(i) = farthest.filter(|i| distances[*i] > 0.0) else {
            break;
        };
        choose(i, &mut chosen, &mut distances);
    }
    chosen.truncate(count);
    if chosen.is_empty() {
        return Err(DatasetError::NoPlace);
    }
    Ok(chosen)
}

/// Places on a grid at eye height, each with its cell, in order of cells.
fn free_places(interior: &Interior, contents: &Contents, solid: &Solid) -> Vec<(CellId, DVec3)> {
    let up = interior.up.normalize_or(DVec3::Y);
    let across = up.any_orthonormal_vector();
    let along = up.cross(across);
    let in_frame = |at: DVec3| DVec3::new(at.dot(across), at.dot(along), at.dot(up));
    let mut tried = Vec::new();
    for (i, bounds) in contents.bounds.iter().enumerate() {
        let Some(bounds) = bounds else { continue };
        // The box, in directions across the floor and up.
        let corners = bounds.corners().map(in_frame);
        let (low, high) = corners
            .into_iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| {
                (l.min(p), h.max(p))
            });
        let step = SPACING * interior.eye_height;
        let steps = ((high - low) / step).floor();
        let id = CellId(i as u32);
        let floor = contents.floor_of(interior, id).unwrap_or(low.z);
        let eye = floor + interior.eye_height;
        for a in 1..steps.x as usize {
            for b in 1..steps.y as usize {
                let at = low + step * DVec3::new(a as f64, b as f64, 0.0);
                tried.push((id, at.x * across + at.y * along + eye * up));
            }
        }
    }
    let is_free = |(cell, at): &(CellId, DVec3)| {
        contents.locate(interior, *at) == Some(*cell)
            && is_clear(solid, *at, CLEARANCE * interior.eye_height)
            && has_floor(solid, *at, up, interior.eye_height)
    };
    tried.into_par_iter().filter(is_free).collect()
}

/// Whether there is something to stand on, no farther down than a step: a cell's box may reach
/// beyond its walls.
fn has_floor(solid: &Solid, at: DVec3, up: DVec3, eye_height: f64) -> bool {
    let below = solid.first_hit(at, -up);
    below.is_some_and(|hit| hit.along < STEP_DOWN * eye_height)
}

/// Whether there is nothing within a distance, in the 26 directions of a cube's corners,
/// edges and sides.
fn is_clear(solid: &Solid, at: DVec3, distance: f64) -> bool {
    let direction = |k: i32| DVec3::new(f64::from(k % 3), f64::from(k / 3 % 3), f64::from(k / 9));
    let directions = (0..27).map(|k| direction(k) - DVec3::ONE);
    let mut directions = directions.filter_map(DVec3::try_normalize);
    directions.all(|d| {
        solid
            .first_hit(at, d)
            .is_none_or(|hit| hit.along > distance)
    })
}
