//! The field at the vertices of the triangulation.

use crate::blend::{Contributor, blend};
use crate::frame::{Frame, ProxyPoint};
use crate::near::Near;
use crate::planted::{Fault, is_planted};
use crate::surface::{NO_FACET, Surface};
use calibrate::Pixel;
use glam::{DVec2, DVec3};
use std::sync::OnceLock;

/// How far short of the plane's horizon vertices on it are evaluated: the sine of the angle.
const SHORT_OF_HORIZON: f64 = 1e-6;

/// The field at a vertex.
pub(super) struct Vertex {
    /// In pixels of the desired image.
    pub(super) at: DVec2,
    /// `None` where nothing is near, and where no triangle needs it.
    pub(super) point: Option<ProxyPoint>,
    /// Whether the lens has no ray there: the point is one that it sees nearby.
    pub(super) is_beyond_lens: bool,
    /// The source views that matter there, and in about the triangles around it.
    pub(super) near: Near,
    /// Made when first asked for.
    weights: OnceLock<Vec<Contributor>>,
}

impl Vertex {
    /// One that no triangle needs.
    pub(super) fn unused(at: DVec2) -> Self {
        Self {
            at,
            point: None,
            is_beyond_lens: false,
            near: Near::default(),
            weights: OnceLock::new(),
        }
    }

    /// The triangles around it are about the size of a `cell`, in pixels. The guess is of the
    /// difference that matters; see [`Frame::near`].
    pub(super) fn new(frame: &Frame<'_>, at: DVec2, cell: DVec2, guess: f64) -> Self {
        let seen_at = match is_planted(Fault::ShiftedField) {
            true => at + DVec2::new(0.5, 0.0),
            false => at,
        };
        let ray = frame
            .desired
            .lens
            .unproject(Pixel::new(seen_at.x, seen_at.y));
        let point = point_at(frame, seen_at, ray, cell);
        let mut near = point.map_or_else(Near::default, |point| {
            frame.near(&point, extent(frame, at, cell, &point), guess)
        });
        near.let_go();
        Self {
            at,
            point,
            is_beyond_lens: ray.is_none(),
            weights: OnceLock::new(),
            near,
        }
    }

    /// The exact blend, by source view.
    pub(super) fn weights(&self, frame: &Frame<'_>) -> &[Contributor] {
        self.weights
            .get_or_init(|| blend(&self.near.candidates, &frame.options))
    }
}

/// How far the corners of the cells around a vertex lie from it, if they are in its plane: infinite
/// where that meets no ray through one.
fn extent(frame: &Frame<'_>, at: DVec2, cell: DVec2, point: &ProxyPoint) -> f64 {
    let here = point.ray / point.inverse_distance;
    let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
    let offset = |(x, y): (f64, f64)| {
        let there = at + cell * DVec2::new(x, y);
        let ray = frame.desired.lens.unproject(Pixel::new(there.x, there.y));
        let along = ray.map(|ray| (ray, point.plane.dot(ray)));
        along
            .filter(|(_, s)| *s > 0.0)
            .map_or(f64::INFINITY, |(ray, s)| (ray / s).distance(here))
    };
    corners.into_iter().map(offset).fold(0.0, f64::max)
}

/// The ray through a position in the desired image. Where the lens has none, as it ends before, the one where
/// it ends on the way from its middle, within so many pixels; `None` if it does not.
pub(super) fn ray_within(frame: &Frame<'_>, at: DVec2, reach: f64) -> Option<DVec3> {
    let lens = &frame.desired.lens;
    let to_middle = lens.principal - at;
    let steps = reach.min(to_middle.length()).ceil() as usize;
    let step = to_middle.normalize_or_zero();
    (0..=steps).find_map(|i| {
        let there = at + i as f64 * step;
        lens.unproject(Pixel::new(there.x, there.y))
    })
}

/// The proxy point at a position in the desired image, through which this `ray` is. Where the lens has none, or
/// nothing is there, what is nearest to it in the image, within a `cell` of it, goes on, if anything is.
fn point_at(frame: &Frame<'_>, at: DVec2, ray: Option<DVec3>, cell: DVec2) -> Option<ProxyPoint> {
    let pixel = Pixel::new(at.x, at.y);
    if let Surface::Facets(map) = &frame.surface
        && (ray.is_none() || map.facet_at(pixel) == NO_FACET)
    {
        let beside = map.nearest(pixel, cell.max_element().ceil() as i64)?;
        let beside = frame.proxy_point(beside)?;
        let Some(ray) = ray else {
            return Some(beside);
        };
        let by_length = beside.inverse_distance * ray.length() / beside.ray.length();
        return Some(ProxyPoint {
            ray,
            inverse_distance: by_length,
            plane: ray * (by_length / ray.length_squared()),
        });
    }
    let ray = ray.or_else(|| ray_within(frame, at, cell.length()))?;
    let plane = frame.surface.plane_at(pixel).unwrap_or_default();
    // Snapping may have put a vertex of the horizon a little beyond it. On it every view's
    // angle is zero and they all tie; just short of it they don't, and that is what the
    // triangles below it show.
    let least = SHORT_OF_HORIZON * plane.length() * ray.length();
    Some(ProxyPoint {
        ray,
        inverse_distance: plane.dot(ray).max(least),
        plane,
    })
}
