//! The field at the vertices of the triangulation.

use crate::blend::{Candidate, Contributor, blend};
use crate::frame::{Frame, ProxyPoint};
use calibrate::Pixel;
use glam::DVec2;

/// The field at a vertex.
pub(super) struct Vertex {
    /// In pixels of the desired image.
    pub(super) at: DVec2,
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
        let sources = sources_at(frame, at);
        let candidates: Vec<Candidate> = sources
            .iter()
            .enumerate()
            .filter_map(|(source_idx, source)| {
                let fov = frame.fov_blend(source_idx, source.pixel?);
                (fov >= 0.0).then_some(Candidate {
                    source_idx,
                    diff: source.diff,
                    fov,
                })
            })
            .collect();
        Self {
            at,
            sources,
            weights: blend(&candidates, &frame.options),
        }
    }
}

/// What every source view makes of the proxy point at a position in the desired image;
/// empty where the lens has no ray.
pub(super) fn sources_at(frame: &Frame<'_>, at: DVec2) -> Vec<VertexSource> {
    let Some(ray) = frame.desired.lens.unproject(Pixel::new(at.x, at.y)) else {
        return Vec::new();
    };
    // Snapping may have put a vertex of the horizon a little beyond it.
    let plane = frame
        .surface
        .plane_at(Pixel::new(at.x, at.y))
        .unwrap_or_default();
    let inverse_distance = plane.dot(ray).max(0.0);
    let point = ProxyPoint {
        ray,
        inverse_distance,
        plane,
    };
    (0..frame.sources.len())
        .map(|source_idx| VertexSource {
            diff: frame.difference(source_idx, &point),
            pixel: frame.project(source_idx, &point),
        })
        .collect()
}
