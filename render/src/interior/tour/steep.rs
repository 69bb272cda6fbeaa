//! Where a way goes through something between storeys: maps tell of what stands at one height alone.

use super::way::Way;
use glam::DVec3;
use proxy::interior::{CellId, Contents, Interior, surface_of};
use proxy::mesh::Model;
use proxy::{MeshKind, Solid};
use std::collections::BTreeSet;

/// Rise over length from which on a way is no level one.
const STEEP: f64 = 0.25;
/// Its pieces' length in eye heights, and how many there are at most.
const STEP: f64 = 0.05;
const MOST: f64 = 1e5;

/// The cells in which a way, smoothed over so far, climbs or falls through the model's surface.
pub(super) fn passed(
    way: &Way,
    reach: f64,
    interior: &Interior,
    contents: &Contents,
    model: &Model,
) -> BTreeSet<CellId> {
    // 1. What of it is steep.
    let length = way.length();
    let pieces = (length / (STEP * interior.eye_height))
        .ceil()
        .clamp(1.0, MOST) as usize;
    let at = |i: usize| way.smoothed(length * i as f64 / pieces as f64, reach);
    let places: Vec<DVec3> = (0..=pieces).map(at).collect();
    let is_steep = |pair: &&[DVec3]| {
        let off = pair[1] - pair[0];
        off.dot(interior.up).abs() > STEEP * off.length()
    };
    let steep: Vec<&[DVec3]> = places.windows(2).filter(is_steep).collect();
    if steep.is_empty() {
        return BTreeSet::new();
    }
    // 2. What is in its way.
    let solid = Solid::new(MeshKind::Mesh, surface_of(model).into_owned());
    let is_through = |pair: &&[DVec3]| {
        let hit = solid.first_hit(pair[0], pair[1] - pair[0]);
        hit.is_some_and(|hit| hit.along <= 1.0)
    };
    let through = steep.into_iter().filter(is_through);
    let cells = through.filter_map(|pair| {
        let mut ends = pair.iter();
        ends.find_map(|end| contents.locate(interior, *end))
    });
    cells.collect()
}
