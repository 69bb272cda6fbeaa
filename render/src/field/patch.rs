//! What is seen between the corners of a triangle.

use super::vertex::Vertex;
use crate::cpu::lanes::vectorised;
use crate::frame::{Frame, FrameSource, ProxyPoint};
use crate::view_tree::{Apart, Ball};
use crate::visibility::{DistanceMap, TOLERANCE, visible};
use calibrate::{Distortion, Pixel};
use glam::{DVec2, DVec3};

/// Steps between points that are spread over a triangle, along each side.
const STEPS: usize = 4;

/// The proxy points seen at points spread over a triangle, row after row parallel to its third
/// side, the first row being the longest.
pub(super) struct Patch {
    points: Vec<Option<ProxyPoint>>,
    /// Whether pixels at some of them look at what was moved into some photo.
    pub(super) is_moved: bool,
    /// Where they are all about as far as the corners say: nothing juts out between those.
    smooth: Option<Spread>,
}

impl Patch {
    pub(super) fn new(frame: &Frame<'_>, corners: [&Vertex; 3]) -> Self {
        let [a, b, c] = corners.map(|corner| corner.at);
        let places = steps().map(|(i, j)| a + share(i) * (b - a) + share(j) * (c - a));
        let pixels: Vec<Pixel> = places.map(|at: DVec2| Pixel::new(at.x, at.y)).collect();
        let points: Vec<Option<ProxyPoint>> =
            pixels.iter().map(|p| frame.proxy_point(*p)).collect();
        let is_smooth = is_smooth(&points, corners.map(|corner| corner.point));
        Self {
            smooth: is_smooth.then(|| Spread::of(&points)).flatten(),
            points,
            is_moved: pixels.iter().any(|p| frame.surface.is_moved_at(*p)),
        }
    }

    /// Whether they are all about as far as the corners say: nothing juts out between those.
    pub(super) fn is_smooth(&self) -> bool {
        self.smooth.is_some()
    }

    /// The points at which there is something.
    fn points(&self) -> impl Iterator<Item = ProxyPoint> {
        self.points.iter().flatten().copied()
    }

    /// Of these, all but the corners.
    pub(super) fn inner(&self) -> impl Iterator<Item = ProxyPoint> {
        let is_corner = |k: usize| [at(0, 0), at(STEPS, 0), at(0, STEPS)].contains(&k);
        let points = self.points.iter().zip(0..);
        points.filter_map(move |(point, k)| point.filter(|_| !is_corner(k)))
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
            apart: Apart::UNKNOWN,
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
        let Some(spread) = &self.smooth else {
            return false;
        };
        // 1. Where each point is in the photo, and its inverse distance from there.
        let Some(seen) = spread.seen_by(&frame.sources[source_idx]) else {
            return false;
        };
        let Seen { x, y, inverse } = &seen;
        // 2. Mostly nothing anywhere around is nearer than any of them.
        let all = seen.largest(map, 0..POINTS);
        let least = inverse.iter().copied().fold(f64::INFINITY, f64::min);
        if all * (1.0 - 0.5 * TOLERANCE) <= least {
            return true;
        }
        // 3. Each itself is seen.
        let is_hidden = |i: usize| {
            let nearest = map.inverse_distance(Pixel::new(x[i], y[i]));
            visible(inverse[i], nearest) < 1.0
        };
        if (0..POINTS).any(is_hidden) {
            return false;
        }
        // 4. Nothing may be much nearer than the nearest corner of each small triangle, wherever that
        // falls in the photo. Where nothing is anywhere around, triangles need not be asked.
        let most = |corners: [usize; 3]| {
            let [a, b, c] = corners.map(|i| inverse[i]);
            a.max(b).max(c) * (1.0 + 2.0 * TOLERANCE)
        };
        let is_open = |corners: &[usize; 3]| {
            let most = most(*corners);
            all <= most || seen.largest(map, *corners) <= most
        };
        TRIANGLES.iter().all(is_open)
    }
}

/// The points of a patch, as numbers of which several are worked on at once.
struct Spread {
    /// x, y and z.
    ray: [[f64; PADDED]; 3],
    inverse_distance: [f64; PADDED],
}

/// Where a photo has them.
struct Seen {
    /// In pixels.
    x: [f64; PADDED],
    y: [f64; PADDED],
    /// One over their distances from there.
    inverse: [f64; PADDED],
}

impl Spread {
    /// `None` where there is nothing at some point.
    fn of(points: &[Option<ProxyPoint>]) -> Option<Self> {
        let mut spread = Self {
            ray: [[0.0; PADDED]; 3],
            inverse_distance: [0.0; PADDED],
        };
        for k in 0..PADDED {
            let point = points[k.min(POINTS - 1)]?;
            for axis in 0..3 {
                spread.ray[axis][k] = point.ray[axis];
            }
            spread.inverse_distance[k] = point.inverse_distance;
        }
        Some(spread)
    }

    /// `None` where the source view's lens does not see one.
    fn seen_by(&self, source: &FrameSource) -> Option<Seen> {
        let [a, b, c] = source.rotation.to_cols_array_2d();
        let t = source.translation.to_array();
        let ([x, y, z], s) = (&self.ray, &self.inverse_distance);
        // In the source camera's frame, scaled as the rays are.
        let mut at = [[0.0; PADDED]; 3];
        let mut seen = Seen {
            x: [0.0; PADDED],
            y: [0.0; PADDED],
            inverse: [0.0; PADDED],
        };
        vectorised(
            #[inline(always)]
            || {
                for (axis, at) in at.iter_mut().enumerate() {
                    for k in 0..PADDED {
                        let turned = a[axis] * x[k] + b[axis] * y[k] + c[axis] * z[k];
                        at[k] = turned + t[axis] * s[k];
                    }
                }
                let [x, y, z] = &at;
                for k in 0..PADDED {
                    let length = (x[k] * x[k] + y[k] * y[k] + z[k] * z[k]).sqrt();
                    seen.inverse[k] = s[k] / length;
                    // As a pinhole has it: see [`calibrate::Lens::project`].
                    seen.x[k] = x[k] / z[k] * source.lens.focal.x + source.lens.principal.x;
                    seen.y[k] = y[k] / z[k] * source.lens.focal.y + source.lens.principal.y;
                }
            },
        );
        if source.lens.distortion() == Distortion::None {
            let is_seen =
                |k: usize| at[2][k] > 0.0 && seen.x[k].is_finite() && seen.y[k].is_finite();
            return (0..PADDED).all(is_seen).then_some(seen);
        }
        for k in 0..POINTS {
            let point = DVec3::new(at[0][k], at[1][k], at[2][k]);
            let pixel = source.lens.project(point)?;
            (seen.x[k], seen.y[k]) = (pixel.x, pixel.y);
        }
        Some(seen)
    }
}

impl Seen {
    /// The largest inverse distance that a map has around some of the points.
    fn largest(&self, map: &DistanceMap, points: impl IntoIterator<Item = usize>) -> f64 {
        let (mut least, mut most) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for i in points {
            let (x, y) = (self.x[i], self.y[i]);
            least = [least[0].min(x), least[1].min(y)];
            most = [most[0].max(x), most[1].max(y)];
        }
        map.largest_within(least, most)
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

/// How many there are, and so many that vectors have them all.
const POINTS: usize = (STEPS + 1) * (STEPS + 2) / 2;
const PADDED: usize = POINTS.next_multiple_of(4);

/// The small triangles between them.
const TRIANGLES: [[usize; 3]; STEPS * STEPS] = {
    let mut triangles = [[0; 3]; STEPS * STEPS];
    let (mut count, mut i) = (0, 0);
    while i < STEPS {
        let mut j = 0;
        while j < STEPS - i {
            triangles[count] = [at(i, j), at(i + 1, j), at(i, j + 1)];
            count += 1;
            if i + j + 1 < STEPS {
                triangles[count] = [at(i + 1, j + 1), at(i + 1, j), at(i, j + 1)];
                count += 1;
            }
            j += 1;
        }
        i += 1;
    }
    triangles
};

/// Rows, and places in them, of all.
fn steps() -> impl Iterator<Item = (usize, usize)> {
    (0..=STEPS).flat_map(|i| (0..=STEPS - i).map(move |j| (i, j)))
}

/// Of a side of the triangle.
fn share(steps: usize) -> f64 {
    steps as f64 / STEPS as f64
}

/// The index of a row's j-th.
const fn at(row: usize, j: usize) -> usize {
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
