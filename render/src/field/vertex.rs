//! The field at the vertices of the triangulation.

use crate::blend::{Candidate, Contributor, blend};
use crate::frame::{Frame, ProxyPoint};
use crate::reference::candidate;
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
    /// By source view; empty where the lens has no ray.
    pub(super) sources: Vec<VertexSource>,
    /// The exact blend, by source view.
    pub(super) weights: Vec<Contributor>,
}

pub(super) struct VertexSource {
    pub(super) diff: f64,
    /// Where the proxy point falls in the photo or outside it.
    pub(super) pixel: Option<Pixel>,
}

impl Vertex {
    pub(super) fn new(frame: &Frame<'_>, at: DVec2) -> Self {
        let point = point_at(frame, at);
        let sources = point.map_or_else(Vec::new, |point| sources_at(frame, &point));
        let candidates = point.map_or_else(Vec::new, |point| {
            candidates(frame, &point, &sources).collect()
        });
        Self {
            at,
            point,
            sources,
            weights: blend(&candidates, &frame.options),
        }
    }
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

/// What every source view makes of a proxy point.
pub(super) fn sources_at(frame: &Frame<'_>, point: &ProxyPoint) -> Vec<VertexSource> {
    (0..frame.sources.len())
        .map(|source_idx| VertexSource {
            diff: frame.difference(source_idx, point),
            pixel: frame.project(source_idx, point),
        })
        .collect()
}

/// The source views that see a proxy point.
pub(super) fn candidates<'f>(
    frame: &'f Frame<'_>,
    point: &'f ProxyPoint,
    sources: &'f [VertexSource],
) -> impl Iterator<Item = Candidate> + 'f {
    sources
        .iter()
        .enumerate()
        .filter_map(|(source_idx, source)| {
            candidate(frame, source_idx, point, source.pixel?, || source.diff)
        })
}
