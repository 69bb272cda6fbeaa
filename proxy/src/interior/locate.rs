//! Which cell a viewer is in.

use super::seen::{Seen, TURN};
use super::{Cell, CellId, Content, Contents, Interior, Polygon, Portal};
use glam::DVec3;

/// How near to a portal's plane counts as on it, in shares of its size.
const ON_PLANE: f64 = 1e-9;
/// What positions in the world are rounded to, in shares of their distance from its origin.
const ROUNDING: f64 = 1e-14;

/// Rays that a viewer sends out to all sides where bounds leave several cells.
const RAYS: u32 = 64;
/// So near to an opening one may be in either cell, in shares of its size.
const BESIDE: f64 = 0.5;
/// A leaf or a pane in an opening is behind it, if no nearer than by this share of its distance.
const IN_OPENING: f64 = 1e-9;

/// How near to a portal's plane counts as on it, in world units.
pub(super) fn tolerance(portal: &Portal) -> f64 {
    let center = portal.polygon.center().abs().max_element();
    ON_PLANE * portal.polygon.size() + ROUNDING * center
}

impl Contents {
    /// The cell that a point is in, if any. Of several boxes, it is the smallest. In a doorway as
    /// deep as a wall, between two boxes or in both, it is the one on the same side of the portal.
    ///
    /// Cells without a box or a floor are where their triangles are. Where the bounds of one reach into
    /// another's, and a point may be in several cells, it is in the one that one sees from there; in
    /// none if that does not tell.
    pub fn locate(&self, interior: &Interior, point: DVec3) -> Option<CellId> {
        if !point.is_finite() {
            return None;
        }
        let ids = (0..interior.cells.len() as u32).map(CellId);
        let inside = ids.filter_map(|id| Some((self.room_around(interior, id, point)?, id)));
        let inside: Vec<(f64, CellId)> = inside.collect();
        if let Some(seen) = &self.seen {
            let may_be = with_beside(interior, point, &inside);
            let is_vague =
                |(_, id): &(f64, CellId)| interior.cells.get(id.0 as usize).is_some_and(is_loose);
            if may_be.len() > 1 && may_be.iter().any(is_vague) {
                return most_seen(interior, seen, point, &may_be);
            }
        }
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
    pub(super) fn room_around(&self, interior: &Interior, id: CellId, point: DVec3) -> Option<f64> {
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

/// Whether nothing but a cell's triangles says where it is.
pub(super) fn is_loose(cell: &Cell) -> bool {
    cell.floor.is_none() && matches!(cell.content, Content::Nodes(_))
}

/// Cells that have a point, and those that openings close to it join, as bounds end at the faces of walls:
/// each with something that grows with its size.
fn with_beside(interior: &Interior, point: DVec3, inside: &[(f64, CellId)]) -> Vec<(f64, CellId)> {
    let is_close = |portal: &&Portal| {
        let polygon = &portal.polygon;
        polygon.height(point).abs() <= BESIDE * polygon.size() && polygon.covers(point, 0.0)
    };
    let beside = interior.portals.iter().filter(is_close);
    let mut all = inside.to_vec();
    for id in beside.flat_map(|portal| portal.cells).flatten() {
        if !all.iter().any(|(_, known)| *known == id) {
            all.push((f64::INFINITY, id));
        }
    }
    all
}

/// Of several cells the one that a point is in, if more than half of what one sees from there says so:
/// a ray that passes a portal says the cell on the near side, others that of the first triangle. What is
/// of no cell, as a wall may be, says nothing.
fn most_seen(
    interior: &Interior,
    seen: &Seen,
    point: DVec3,
    may_be: &[(f64, CellId)],
) -> Option<CellId> {
    let is_of_any = |portal: &&Portal| {
        let mut cells = portal.cells.iter().flatten();
        cells.any(|cell| may_be.iter().any(|(_, id)| id == cell))
    };
    let portals: Vec<&Portal> = interior.portals.iter().filter(is_of_any).collect();
    let mut votes = vec![0_u32; may_be.len()];
    let mut told = 0;
    for i in 0..RAYS {
        // Evenly over the sphere.
        let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(RAYS);
        let (sin, cos) = (TURN * f64::from(i)).sin_cos();
        let ray = (1.0 - z * z).sqrt() * DVec3::new(cos, sin, 0.0) + z * DVec3::Z;
        let hit = seen.first(point, ray);
        let far = hit.map_or(f64::MAX, |(along, _)| along * (1.0 + IN_OPENING));
        let passed = portals.iter().filter_map(|p| passed(p, point, ray, far));
        let passed = passed.min_by(|a, b| a.0.total_cmp(&b.0));
        let is_said = |id: CellId| match (passed, hit) {
            (Some((_, side)), _) => side == Some(id),
            (None, Some((_, cells))) => cells.contains(&id),
            (None, None) => false,
        };
        let is_of_none = passed.is_none() && hit.is_some_and(|(_, cells)| cells.is_empty());
        told += u32::from(!is_of_none);
        for (vote, (_, id)) in votes.iter_mut().zip(may_be) {
            *vote += u32::from(is_said(*id));
        }
    }
    // Of cells one within the other, the smaller.
    let best = (0..may_be.len()).min_by(|a, b| {
        let smaller = may_be[*a].0.total_cmp(&may_be[*b].0);
        votes[*b].cmp(&votes[*a]).then(smaller)
    })?;
    (2 * votes[best] > told).then_some(may_be[best].1)
}

/// How far along a ray from a point a portal is passed, in lengths of the ray and no farther than
/// said, and what the point's side of it is.
fn passed(
    portal: &Portal,
    point: DVec3,
    ray: DVec3,
    farthest: f64,
) -> Option<(f64, Option<CellId>)> {
    let height = portal.polygon.height(point);
    let along = -height / ray.dot(portal.polygon.normal());
    // NaN within the portal's plane, and along it.
    let is_ahead = along >= 0.0 && along <= farthest;
    let is_passed = is_ahead && portal.polygon.covers(point + along * ray, 0.0);
    is_passed.then(|| (along, portal.cells[usize::from(height < 0.0)]))
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
