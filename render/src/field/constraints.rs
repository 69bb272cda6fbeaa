//! What the triangulation of the image plane must respect: epipoles and the horizon.

use crate::blend::{Candidate, SAME_RAY};
use crate::frame::{Frame, ProxyPoint};
use crate::near::wider;
use crate::reference::candidate;
use crate::surface::Surface;
use crate::triangulation::Grid;
use crate::view_tree::Ball;
use calibrate::Lens;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::cmp::Ordering;

/// Epipoles that become vertices in one cell of the grid, at most.
const EPIPOLES_PER_CELL: usize = 4;

/// The epipoles worth a vertex: inside the image, their view among the first two of the
/// field there, the nearest few of each cell.
///
/// A view behind the desired one has its epipole where the line through both centres
/// meets the image: the difference of angles vanishes there as well.
pub(super) fn epipole_vertices(frame: &Frame<'_>, grid: Grid) -> Vec<(usize, DVec2)> {
    let (width, height) = (
        f64::from(frame.desired.width),
        f64::from(frame.desired.height),
    );
    let cells = DVec2::new(
        f64::from(grid.columns) / width,
        f64::from(grid.rows) / height,
    );
    let epipole = |source_idx: usize| {
        let center = frame.sources[source_idx].center;
        let lens = &frame.desired.lens;
        let ahead = lens.project(center).or_else(|| lens.project(-center))?;
        let inside = (0.0..=width).contains(&ahead.x) && (0.0..=height).contains(&ahead.y);
        let point = inside.then(|| frame.proxy_point(ahead)).flatten()?;
        let at = DVec2::new(ahead.x, ahead.y);
        let cell = (at * cells).floor();
        Some(Epipole {
            own: candidate_at(frame, source_idx, &point)?,
            distance: center.length(),
            cell: cell.y as u32 * (grid.columns + 1) + cell.x as u32,
            point,
            at,
        })
    };
    let sources = (0..frame.sources.len()).into_par_iter();
    let epipoles: Vec<Epipole> = sources.filter_map(epipole).collect();
    let mut places: Vec<(u32, u32)> = epipoles.iter().map(|e| e.cell).zip(0..).collect();
    places.sort_unstable();
    let of_cell = |places: &[(u32, u32)]| {
        let epipoles = places.iter().map(|(_, i)| &epipoles[*i as usize]);
        let mut epipoles: Vec<&Epipole> = epipoles.collect();
        epipoles.sort_unstable_by(|x, y| x.order(y));
        let mut nearer = Vec::new();
        let strong = epipoles
            .iter()
            .filter(|e| !is_behind_two(frame, e, &mut nearer));
        let few = strong.take(EPIPOLES_PER_CELL);
        few.map(|e| (e.own.source_idx, e.at)).collect::<Vec<_>>()
    };
    let by_cell: Vec<&[(u32, u32)]> = places.chunk_by(|x, y| x.0 == y.0).collect();
    by_cell.into_par_iter().flat_map_iter(of_cell).collect()
}

/// Where a source view's centre, or what lies opposite to it, appears in the desired image.
struct Epipole {
    own: Candidate,
    /// Of the view from the viewer.
    distance: f64,
    /// Row by row. On the image's right border it is one of its own.
    cell: u32,
    point: ProxyPoint,
    at: DVec2,
}

impl Epipole {
    /// The view that differs least first; of those on the line of sight, the nearest.
    fn order(&self, other: &Self) -> Ordering {
        let diff = |epipole: &Self| epipole.own.diff.max(SAME_RAY);
        diff(self)
            .total_cmp(&diff(other))
            .then_with(|| self.distance.total_cmp(&other.distance))
            .then_with(|| self.own.source_idx.cmp(&other.own.source_idx))
    }
}

fn candidate_at(frame: &Frame<'_>, source_idx: usize, point: &ProxyPoint) -> Option<Candidate> {
    let pixel = frame.project(source_idx, point)?;
    let diff = || frame.difference(source_idx, point);
    candidate(frame, source_idx, point, pixel, diff)
}

/// Whether two source views count more at an epipole than its own: they differ less and see the
/// point no less. `known` are views that are asked first: those that did at an epipole nearby, and in the end
/// those that do here.
fn is_behind_two(frame: &Frame<'_>, epipole: &Epipole, known: &mut Vec<u32>) -> bool {
    let Epipole { own, point, .. } = epipole;
    if own.diff <= SAME_RAY {
        return false;
    }
    let counts_more = |i: &u32| {
        let other = candidate_at(frame, *i as usize, point);
        other.is_some_and(|c| {
            c.diff < own.diff && c.fov >= own.fov && c.fov * c.mask >= own.fov * own.mask
        })
    };
    if known.iter().filter(|i| counts_more(i)).nth(1).is_some() {
        return true;
    }
    let ball = Ball::around(point, 0.0);
    let mut nearer = Vec::new();
    // Mostly there are two that differ by much less than its own.
    let mut within = frame.first_guess().min(own.diff);
    loop {
        frame.views_within(ball.as_ref(), within, &mut nearer);
        let two: Vec<u32> = nearer.iter().copied().filter(counts_more).take(2).collect();
        if two.len() == 2 {
            *known = two;
            return true;
        }
        if within >= own.diff {
            return false;
        }
        within = wider(within).min(own.diff);
    }
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
