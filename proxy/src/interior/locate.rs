//! Which cell a viewer is in.

use super::{CellId, Contents, Interior, Polygon, Portal};
use glam::DVec3;

/// How near to a portal's plane counts as on it, in shares of its size.
const ON_PLANE: f64 = 1e-9;
/// What positions in the world are rounded to, in shares of their distance from its origin.
const ROUNDING: f64 = 1e-14;

/// How near to a portal's plane counts as on it, in world units.
pub(super) fn tolerance(portal: &Portal) -> f64 {
    let center = portal.polygon.center().abs().max_element();
    ON_PLANE * portal.polygon.size() + ROUNDING * center
}

impl Contents {
    /// The cell that a point is in, if any. Of several, it is the smallest. In a doorway as
    /// deep as a wall, between two boxes or in both, it is the one on the same side of the portal.
    pub fn locate(&self, interior: &Interior, point: DVec3) -> Option<CellId> {
        if !point.is_finite() {
            return None;
        }
        let ids = (0..interior.cells.len() as u32).map(CellId);
        let inside = ids.filter_map(|id| Some((self.room_around(interior, id, point)?, id)));
        let inside: Vec<(f64, CellId)> = inside.collect();
        // The first of those that are alike.
        let smallest = inside.iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, smallest)) = smallest else {
            return nearest_side(interior, point, |portal, cell| {
                let bounds = self.bounds.get(cell.0 as usize).copied().flatten();
                let foot = point - portal.polygon.height(point) * portal.polygon.normal();
                bounds.is_some_and(|room| room.distance(point) <= room.distance(foot))
            });
        };
        let has = |cell: Option<CellId>| inside.iter().any(|(_, id)| Some(*id) == cell);
        let is_in_both = |portal: &Portal, _| portal.cells.iter().all(|cell| has(*cell));
        let side = match inside.len() {
            1 => None,
            _ => nearest_side(interior, point, is_in_both),
        };
        Some(side.unwrap_or(*smallest))
    }

    /// Something that grows with a cell's size, if the point is in it.
    fn room_around(&self, interior: &Interior, id: CellId, point: DVec3) -> Option<f64> {
        let bounds = self.bounds.get(id.0 as usize).copied().flatten();
        let floor = interior.cell(id).floor.as_ref();
        if bounds.is_some_and(|room| !room.contains(point)) {
            return None;
        }
        let Some(floor) = floor else {
            return Some(bounds?.volume());
        };
        // Of floors one over the other, the next below.
        let height = height_over(floor, interior.up, point)?;
        Some(bounds.map_or(height, |room| room.volume()))
    }
}

/// How high over a floor a point is, if it is over it.
pub(super) fn height_over(floor: &Polygon, up: DVec3, point: DVec3) -> Option<f64> {
    let along_up = up * floor.normal().dot(up).signum();
    let steepness = floor.normal().dot(along_up);
    let height = floor.height(point) / steepness.abs().max(1e-6);
    let over = point - height * along_up;
    let height = height * floor.normal().dot(up).signum();
    let is_over = height >= -ON_PLANE * floor.size() && floor.covers(over, 0.0);
    is_over.then(|| height.max(0.0))
}

/// Of those portals that a point is right before or behind, and their cell on its side, that are
/// `wanted` the nearest's cell.
fn nearest_side(
    interior: &Interior,
    point: DVec3,
    wanted: impl Fn(&Portal, CellId) -> bool,
) -> Option<CellId> {
    let sides = interior.portals.iter().filter_map(|portal| {
        let height = portal.polygon.height(point);
        let cell = portal.cells[usize::from(height < 0.0)]?;
        let is_in = wanted(portal, cell) && portal.polygon.covers(point, tolerance(portal));
        is_in.then_some((height.abs(), cell))
    });
    let nearest = sides.min_by(|a, b| a.0.total_cmp(&b.0));
    nearest.map(|(_, cell)| cell)
}
