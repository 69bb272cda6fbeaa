//! The field at the vertices of the triangulation.

use crate::blend::{Contributor, blend};
use crate::frame::{Frame, ProxyPoint};
use crate::near::Near;
use calibrate::Pixel;
use glam::DVec2;

/// How far short of the plane's horizon vertices on it are evaluated: the sine of the angle.
const SHORT_OF_HORIZON: f64 = 1e-6;

/// The field at a vertex.
pub(super) struct Vertex {
    /// In pixels of the desired image.
    pub(super) at: DVec2,
    /// `None` where the lens has no ray.
    pub(super) point: Option<ProxyPoint>,
    /// The source views that matter there, and in about the triangles around it.
    pub(super) near: Near,
    /// The exact blend, by source view.
    pub(super) weights: Vec<Contributor>,
}

impl Vertex {
    /// The triangles around it are about the size of a `cell`, in pixels. The guess is of the
    /// difference that matters; see [`Frame::near`].
    pub(super) fn new(frame: &Frame<'_>, at: DVec2, cell: DVec2, guess: &mut f64) -> Self {
        let point = point_at(frame, at);
        let near = point.map_or_else(Near::default, |point| {
            frame.near(&point, extent(frame, at, cell, &point), guess)
        });
        Self {
            at,
            point,
            weights: blend(&near.candidates, &frame.options),
            near,
        }
    }
}

/// How far the corners of the cells around a vertex lie from it, if they are in its plane; within
/// half its distance from the viewer.
fn extent(frame: &Frame<'_>, at: DVec2, cell: DVec2, point: &ProxyPoint) -> f64 {
    let here = point.ray / point.inverse_distance;
    let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
    let offset = |(x, y): (f64, f64)| {
        let there = at + cell * DVec2::new(x, y);
        let ray = frame.desired.lens.unproject(Pixel::new(there.x, there.y))?;
        let s = point.plane.dot(ray);
        (s > 0.0).then(|| (ray / s).distance(here))
    };
    let farthest = corners.into_iter().filter_map(offset).fold(0.0, f64::max);
    farthest.min(0.5 * here.length())
}

/// The proxy point at a position in the desired image; `None` where the lens has no ray.
pub(super) fn point_at(frame: &Frame<'_>, at: DVec2) -> Option<ProxyPoint> {
    let pixel = Pixel::new(at.x, at.y);
    let ray = frame.desired.lens.unproject(pixel)?;
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
