//! What the triangulation of the image plane must respect: epipoles and the horizon.

use crate::blend::{Candidate, SAME_RAY};
use crate::frame::{Frame, ProxyPoint};
use crate::reference::candidate;
use crate::surface::Surface;
use crate::triangulation::Grid;
use crate::view_tree::Ball;
use calibrate::Lens;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Epipoles that become vertices in one cell of the grid, at most.
const EPIPOLES_PER_CELL: usize = 4;

/// The epipoles worth a vertex: inside the image, their view among the first two of the
/// field there, the strongest few of each cell.
///
/// A view behind the desired one has its epipole where the line through both centres
/// meets the image: the difference of angles vanishes there as well.
pub(super) fn epipole_vertices(frame: &Frame<'_>, grid: Grid) -> Vec<(usize, DVec2)> {
    let (width, height) = (
        f64::from(frame.desired.width),
        f64::from(frame.desired.height),
    );
    let candidate = |source_idx: usize| {
        let center = frame.sources[source_idx].center;
        let lens = &frame.desired.lens;
        let ahead = lens.project(center).or_else(|| lens.project(-center))?;
        let inside = (0.0..=width).contains(&ahead.x) && (0.0..=height).contains(&ahead.y);
        let point = inside.then(|| frame.proxy_point(ahead)).flatten()?;
        if is_behind_two(frame, source_idx, &point) {
            return None;
        }
        let field = frame.blend_at(&point);
        let own = field.iter().find(|c| c.source_idx == source_idx)?.weight;
        let stronger = field.iter().filter(|c| c.weight > own).count();
        (stronger < 2).then_some((source_idx, own, DVec2::new(ahead.x, ahead.y)))
    };
    let mut candidates: Vec<(usize, f64, DVec2)> = (0..frame.sources.len())
        .into_par_iter()
        .filter_map(candidate)
        .collect();
    candidates.sort_by(|x, y| y.1.total_cmp(&x.1).then(x.0.cmp(&y.0)));
    let cells = DVec2::new(
        f64::from(grid.columns) / width,
        f64::from(grid.rows) / height,
    );
    let mut taken = std::collections::BTreeMap::new();
    candidates.retain(|(_, _, at)| {
        let cell = (*at * cells).floor();
        let count = taken.entry((cell.x as i64, cell.y as i64)).or_insert(0);
        *count += 1;
        *count <= EPIPOLES_PER_CELL
    });
    candidates
        .into_iter()
        .map(|(source_idx, _, at)| (source_idx, at))
        .collect()
}

/// Whether two source views count more than a given one at a point for sure: they differ less and
/// see it no less. Found among those that differ less alone, of which there are mostly many.
fn is_behind_two(frame: &Frame<'_>, source_idx: usize, point: &ProxyPoint) -> bool {
    let as_candidate = |i: usize| {
        let pixel = frame.project(i, point)?;
        candidate(frame, i, point, pixel, || frame.difference(i, point))
    };
    let Some(own) = as_candidate(source_idx) else {
        return true;
    };
    if own.diff <= SAME_RAY {
        return false;
    }
    let mut nearer = Vec::new();
    frame.views_within(Ball::around(point, 0.0).as_ref(), own.diff, &mut nearer);
    let counts_more = |c: Candidate| {
        c.diff < own.diff && c.fov >= own.fov && c.fov * c.mask >= own.fov * own.mask
    };
    let before = nearer.iter().filter_map(|&i| as_candidate(i as usize));
    before.filter(|c| counts_more(*c)).nth(1).is_some()
}

/// The horizon of the plane in the desired image: where its inverse distance is zero.
pub(super) fn horizon(frame: &Frame<'_>) -> Vec<[DVec2; 2]> {
    let Surface::Plane(q) = frame.surface else {
        return Vec::new();
    };
    // The directions along the plane, by angle from the one that looks most forward.
    let normal = q.normalize();
    let forward = DVec3::Z - normal * normal.z;
    let Some(u) = forward.try_normalize() else {
        return Vec::new();
    };
    let v = normal.cross(u);
    let direction = |angle: f64| u * angle.cos() + v * angle.sin();
    let lens: &Lens = &frame.desired.lens;
    let project = |angle: f64| lens.project(direction(angle)).map(|p| DVec2::new(p.x, p.y));

    let near_image = |p: DVec2| {
        let size = DVec2::new(
            f64::from(frame.desired.width),
            f64::from(frame.desired.height),
        );
        p.cmpge(-size).all() && p.cmple(2.0 * size).all()
    };
    let mut edges = Vec::new();
    // Splits until straight within 1/16 px, where that matters.
    fn refine(
        from: (f64, DVec2),
        to: (f64, DVec2),
        depth: u32,
        project: &dyn Fn(f64) -> Option<DVec2>,
        near_image: &dyn Fn(DVec2) -> bool,
        edges: &mut Vec<[DVec2; 2]>,
    ) {
        let middle = 0.5 * (from.0 + to.0);
        if let Some(at) = project(middle) {
            let chord = to.1 - from.1;
            let off = chord.perp_dot(at - from.1).abs() / chord.length().max(1e-12);
            let relevant = near_image(from.1) || near_image(to.1) || near_image(at);
            if depth > 0 && off > 1.0 / 16.0 && relevant {
                refine(from, (middle, at), depth - 1, project, near_image, edges);
                refine((middle, at), to, depth - 1, project, near_image, edges);
                return;
            }
        }
        edges.push([from.1, to.1]);
    }
    const PIECES: i32 = 32;
    // Just short of ±π, and symmetric, so that a pinhole's ±π/2 is avoided.
    let angle_of = |i: i32| std::f64::consts::PI * (f64::from(i) + 0.5) / f64::from(PIECES);
    for i in -PIECES..PIECES {
        let (a, b) = (angle_of(i), angle_of(i + 1));
        if let (Some(from), Some(to)) = (project(a), project(b)) {
            refine((a, from), (b, to), 16, &project, &near_image, &mut edges);
        }
    }
    edges
}
