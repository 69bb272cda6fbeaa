//! What is seen between the corners of a triangle.

use super::vertex::Vertex;
use crate::frame::{Frame, ProxyPoint};
use crate::view_tree::Ball;
use crate::visibility::{DistanceMap, TOLERANCE, visible};
use calibrate::Pixel;
use glam::{DVec2, DVec3};

/// Steps between points that are spread over a triangle, along each side.
const STEPS: usize = 4;

/// The proxy points seen at points spread over a triangle, row after row parallel to its third
/// side, the first row being the longest.
pub(super) struct Patch {
    points: Vec<Option<ProxyPoint>>,
    /// Whether pixels at some of them look at what was moved into some photo.
    pub(super) is_moved: bool,
    /// Whether they are all about as far as the corners say: nothing juts out between those.
    is_smooth: bool,
}

impl Patch {
    pub(super) fn new(frame: &Frame<'_>, corners: [&Vertex; 3]) -> Self {
        let [a, b, c] = corners.map(|corner| corner.at);
        let places = steps().map(|(i, j)| a + share(i) * (b - a) + share(j) * (c - a));
        let pixels: Vec<Pixel> = places.map(|at: DVec2| Pixel::new(at.x, at.y)).collect();
        let points: Vec<Option<ProxyPoint>> =
            pixels.iter().map(|p| frame.proxy_point(*p)).collect();
        Self {
            is_smooth: is_smooth(&points, corners.map(|corner| corner.point)),
            points,
            is_moved: pixels.iter().any(|p| frame.surface.is_moved_at(*p)),
        }
    }

    /// The points at which there is something.
    pub(super) fn points(&self) -> impl Iterator<Item = ProxyPoint> {
        self.points.iter().flatten().copied()
    }

    /// Of these, one amid each side and some amid the triangle.
    pub(super) fn between(&self) -> impl Iterator<Item = ProxyPoint> {
        let amid = [(2, 0), (0, 2), (2, 2), (1, 1), (1, 2), (2, 1)];
        amid.into_iter().filter_map(|(i, j)| self.points[at(i, j)])
    }

    /// What holds them all; `None` where one is at infinity.
    pub(super) fn ball(&self) -> Option<Ball> {
        let places = || self.points().map(|p| p.ray / p.inverse_distance);
        let (least, most) = places().fold(
            (DVec3::INFINITY, DVec3::NEG_INFINITY),
            |(least, most), place| (least.min(place), most.max(place)),
        );
        let center = 0.5 * (least + most);
        let far = places().map(|place| place.distance(center));
        let radius = far.fold(0.0, f64::max);
        (center.is_finite() && radius.is_finite()).then_some(Ball {
            center,
            radius,
            sight: radius,
        })
    }

    /// Whether nothing hides any part of the triangle from a source view for sure, by its distance
    /// map. (What is so close before it that the map's tolerance may take it for the surface, or
    /// nearly, does not count.)
    pub(super) fn is_open_to(
        &self,
        frame: &Frame<'_>,
        source_idx: usize,
        map: &DistanceMap,
    ) -> bool {
        if !self.is_smooth {
            return false;
        }
        let source = &frame.sources[source_idx];
        // Where each is in the photo, and its inverse distance from there.
        let mut seen = [(DVec2::ZERO, 0.0); POINTS];
        for (seen, point) in seen.iter_mut().zip(&self.points) {
            let Some(point) = point else { return false };
            let Some(pixel) = frame.project(source_idx, point) else {
                return false;
            };
            let in_source =
                source.rotation * point.ray + source.translation * point.inverse_distance;
            let inverse_distance = point.inverse_distance / in_source.length();
            if visible(inverse_distance, map.inverse_distance(pixel)) < 1.0 {
                return false;
            }
            *seen = (DVec2::new(pixel.x, pixel.y), inverse_distance);
        }
        // Nothing may be much nearer than the nearest corner of each small triangle, wherever that
        // falls in the photo.
        let is_open = |corners: [usize; 3]| {
            let [a, b, c] = corners.map(|i| seen[i]);
            let (least, most) = (a.0.min(b.0).min(c.0), a.0.max(b.0).max(c.0));
            let nearest = a.1.max(b.1).max(c.1);
            let largest = map.largest_within(least.to_array(), most.to_array());
            largest <= nearest * (1.0 + 2.0 * TOLERANCE)
        };
        let below = |n: usize| (0..n).flat_map(move |i| (0..n - i).map(move |j| (i, j)));
        below(STEPS).all(|(i, j)| is_open([at(i, j), at(i + 1, j), at(i, j + 1)]))
            && below(STEPS - 1)
                .all(|(i, j)| is_open([at(i + 1, j + 1), at(i + 1, j), at(i, j + 1)]))
    }
}

/// Whether the points of a patch have, within the tolerance of distance maps, the inverse depths
/// that a plane through the corners' would.
fn is_smooth(points: &[Option<ProxyPoint>], corners: [Option<ProxyPoint>; 3]) -> bool {
    // By z, as that of a plane is linear in the image.
    let depth = |point: &ProxyPoint| point.inverse_distance / point.ray.z;
    let [Some(a), Some(b), Some(c)] = corners.map(|corner| corner.map(|p| depth(&p))) else {
        return false;
    };
    points.iter().zip(steps()).all(|(point, (i, j))| {
        let expected = a + share(i) * (b - a) + share(j) * (c - a);
        let off = point.map(|p| (depth(&p) - expected).abs());
        off.is_some_and(|off| off <= TOLERANCE * expected.abs())
    })
}

/// How many there are.
const POINTS: usize = (STEPS + 1) * (STEPS + 2) / 2;

/// Rows, and places in them, of all.
fn steps() -> impl Iterator<Item = (usize, usize)> {
    (0..=STEPS).flat_map(|i| (0..=STEPS - i).map(move |j| (i, j)))
}

/// Of a side of the triangle.
fn share(steps: usize) -> f64 {
    steps as f64 / STEPS as f64
}

/// The index of a row's j-th.
fn at(row: usize, j: usize) -> usize {
    row * (STEPS + 1) - row * row.saturating_sub(1) / 2 + j
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_points_follow_each_other() {
        let indices: Vec<usize> = steps().map(|(i, j)| at(i, j)).collect();
        assert_eq!(indices, (0..POINTS).collect::<Vec<_>>());
    }
}
