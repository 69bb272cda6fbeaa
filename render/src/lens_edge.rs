//! Where a lens ends within its photo: circular fisheyes, and distortion that turns back.

use crate::lumigraph::SourceView;
use crate::sensor::focal_and_sensor;
use calibrate::{Lens, Pixel};
use glam::DVec2;

/// The least distance from a lens's edge in pixels. What the lens sees beyond the circle that stands for its
/// edge counts by this where no other photo has it, more than what is on the very border.
pub(crate) const LEAST_PX: f32 = 1e-4;

/// The edge of a lens within its photo, as engines fade the photo out there: the largest circle in bent
/// coordinates (those that focal lengths and principal point turn into pixels) within what the lens sees. Of a
/// lens without tangential or prism terms, on an upright sensor, it is the edge itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LensEdge {
    /// Principal point, in pixels.
    pub(crate) principal: DVec2,
    /// Focal lengths in pixels, with a tilted sensor's scales.
    pub(crate) focal: DVec2,
    /// Of the circle, in bent coordinates.
    pub(crate) radius: f64,
}

impl LensEdge {
    /// `None` where the lens sees all of its photo.
    pub(crate) fn within(lens: &Lens, [width, height]: [f64; 2]) -> Option<Self> {
        let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)];
        let is_beyond = |(x, y): (f64, f64)| {
            let bent = (DVec2::new(x, y) - lens.principal) / lens.focal;
            // Sooner found than the ray, which few corners lack.
            bent.length() > lens.edge() && lens.unproject(Pixel::new(x, y)).is_none()
        };
        if !corners.into_iter().any(is_beyond) {
            return None;
        }
        let (focal, _) = focal_and_sensor(lens);
        Some(Self {
            principal: lens.principal,
            focal,
            radius: lens.edge() / (focal / lens.focal).max_element(),
        })
    }

    /// A lower bound of a pixel's distance from the edge, in pixels: where focal lengths are equal, its distance
    /// from the circle. [`LEAST_PX`] or more.
    pub(crate) fn distance_px(&self, pixel: Pixel) -> f64 {
        let bent = (DVec2::new(pixel.x, pixel.y) - self.principal) / self.focal;
        let distance_px = (self.radius - bent.length()) * self.pixels_per_unit();
        distance_px.max(f64::from(LEAST_PX))
    }

    /// The least number of pixels that a unit of bent coordinates is.
    pub(crate) fn pixels_per_unit(&self) -> f64 {
        self.focal.abs().min_element()
    }
}

/// Those of all source views, in order.
pub(crate) fn lens_edges(sources: &[SourceView]) -> impl Iterator<Item = Option<LensEdge>> {
    let mut last: Option<(Lens, [f64; 2], Option<LensEdge>)> = None;
    sources.iter().map(move |source| {
        let view = &source.view;
        let (lens, size) = (view.lens, [view.width, view.height].map(f64::from));
        // Most photos share their lens.
        let edge = match last {
            Some((of, at, edge)) if of == lens && at == size => edge,
            _ => LensEdge::within(&lens, size),
        };
        last = Some((lens, size, edge));
        edge
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::every_lens;
    use std::f64::consts::TAU;

    #[test]
    fn only_photos_that_hold_their_lenses_edge_have_one() {
        let lumigraph = every_lens::lumigraph();
        let edges: Vec<_> = lens_edges(&lumigraph.sources).collect();
        for (source, edge) in lumigraph.sources.iter().zip(&edges) {
            let view = &source.view;
            let (width, height) = (f64::from(view.width), f64::from(view.height));
            let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)];
            let sees = |(x, y)| view.lens.unproject(Pixel::new(x, y)).is_some();
            let ends = !corners.into_iter().all(sees);
            assert_eq!(edge.is_some(), ends, "{}", source.name);
        }
        let count = edges.iter().flatten().count();
        assert!(count >= 12 && count < edges.len() - 12, "{count}");
    }

    #[test]
    fn the_distance_is_a_lower_bound() {
        let lumigraph = every_lens::lumigraph();
        for source in &lumigraph.sources {
            let view = &source.view;
            let size = [view.width, view.height].map(f64::from);
            let Some(edge) = LensEdge::within(&view.lens, size) else {
                continue;
            };
            // Along rays from the principal point the lens sees on for as far as it says.
            for i in 0..40 {
                let along = DVec2::from_angle(TAU * f64::from(i) / 40.0);
                let at = |px: f64| {
                    let at = view.lens.principal + px * along;
                    Pixel::new(at.x, at.y)
                };
                for px in [0.0, 50.0, 200.0, 400.0] {
                    let left = edge.distance_px(at(px));
                    // Its circle is found in 64 directions.
                    let last = px + 0.99 * left;
                    let sees = view.lens.unproject(at(last)).is_some();
                    assert!(sees || left < 5.0, "{}: {px} px, {left}", source.name);
                }
            }
        }
    }

    /// Weights rise from next to nothing at the edge to one within, by no jumps.
    #[test]
    fn a_photo_fades_out_towards_its_lenses_edge() {
        let lumigraph = every_lens::lumigraph();
        let frame = every_lens::frame(&lumigraph);
        let mut asked = 0;
        for (source, view) in frame.sources.iter().zip(&lumigraph.sources) {
            let Some(edge) = source.lens_edge else {
                continue;
            };
            let step = 0.1;
            // Along the photo's longer side, where its own border is farthest.
            let along = |px: f64| Pixel::new(edge.principal.x + px, edge.principal.y);
            let radius = edge.radius * edge.focal.x;
            if edge.principal.x + radius > source.size[0] - 2.0 * source.feather_px {
                continue;
            }
            asked += 1;
            let beyond = source.fov_blend(along(radius + 0.01));
            assert!(beyond > 0.0 && beyond < 1e-8, "{}: {beyond}", view.name);
            let (mut px, mut before) = (radius, beyond);
            while px > radius - 1.5 * source.feather_px {
                let weight = source.fov_blend(along(px));
                let most = 1.6 * step / source.feather_px;
                assert!(weight >= before && weight - before < most, "{}", view.name);
                (px, before) = (px - step, weight);
            }
            assert_eq!(before, 1.0, "{}", view.name);
        }
        assert!(asked >= 4, "{asked}");
    }
}
