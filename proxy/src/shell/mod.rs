//! A closed shell around a capture: a distant dome, and the ground where there is one.

mod ground;

use crate::cloud::{isolated_points, median, middle};
use crate::order::in_own_order;
use crate::{Mesh, Plane, SparsePoint};
use calibrate::{View, outer, principal_axes};
use glam::{DMat3, DVec3};

/// The dome's radius as a multiple of how far nearly all points are from the cameras'
/// middle: what lies there moves against the horizon by 6° at most between any two of them.
const DOME: f64 = 10.0;
/// The share of points that are nearly all.
const NEARLY_ALL: f64 = 0.95;
/// A camera farther from the middle than this many times most cameras and nearly all points is
/// misplaced and says nothing of how far a capture reaches: by its measure all others would be in
/// one place, with the points on them.
const STRAY: f64 = 30.0;
/// Points are brought within this share of the dome's radius: its flat facets lie within.
const WITHIN: f64 = 0.8;
/// What is beyond even that, as a multiple of its radius.
const BEYOND: f64 = 1.1;
/// How often an icosahedron's sides are split in half: 10 242 vertices, 2° apart.
const SPLITS: u32 = 5;

/// A closed mesh around everything, for what no other surface covers: as seen from the
/// cameras' middle, the ground plane as far as a dome and the dome beyond. Without a ground
/// (a plane that many points lie on, few below, and all cameras above) it is the whole dome.
///
/// Counter-clockwise from within. Every ray from a camera meets it. Cameras and points that
/// are not finite do not count, nor do cameras that are misplaced by far, which may lie beyond
/// it; with nothing left it is a dome of radius 10 around the world's origin.
pub fn shell(views: &[View], points: &[SparsePoint]) -> Mesh {
    let around = Surroundings::of(views, points.iter().map(|p| p.position));
    let (directions, triangles) = around.icosphere(SPLITS);
    Mesh {
        positions: directions.into_iter().map(|d| around.shell(d)).collect(),
        triangles,
    }
}

/// How far a capture reaches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surroundings {
    /// The cameras' middle, their geometric median.
    pub(crate) center: DVec3,
    /// The dome's.
    pub(crate) radius: f64,
    /// A rotation whose columns follow the capture, however its world lies; what is made around it stands
    /// along them.
    pub(crate) axes: DMat3,
    /// Its normal upwards; below the middle.
    pub(crate) ground: Option<Plane>,
}

impl Surroundings {
    /// Of what is finite among cameras and points, in whatever order these come.
    pub(crate) fn of(views: &[View], points: impl Iterator<Item = DVec3>) -> Self {
        // 1. The cameras' middle.
        let finite = |v: &&View| v.center().is_finite();
        let mut views: Vec<View> = views.iter().filter(finite).cloned().collect();
        let points: Vec<DVec3> = points.filter(|p| p.is_finite()).collect();
        let isolated = isolated_points(&points);
        let kept = points.iter().zip(&isolated).filter(|(_, alone)| !**alone);
        let kept: Vec<DVec3> = kept.map(|(p, _)| *p).collect();
        let points = in_own_order(&kept);
        let centers: Vec<DVec3> = views.iter().map(View::center).collect();
        let of = if centers.is_empty() {
            &points
        } else {
            &centers
        };
        let center = middle(of.clone()).unwrap_or(DVec3::ZERO);

        // 2. How far nearly all points are from it, and the cameras that are not misplaced.
        let from_center = || centers.iter().map(|c| c.distance(center));
        let mut reach = 0.0;
        let mut limit = f64::INFINITY;
        let mut distances: Vec<f64> = points.iter().map(|p| p.distance(center)).collect();
        if !distances.is_empty() {
            let nearly_all = ((distances.len() - 1) as f64 * NEARLY_ALL) as usize;
            reach = *distances
                .select_nth_unstable_by(nearly_all, f64::total_cmp)
                .1;
            if !centers.is_empty() {
                limit = STRAY * median(from_center().collect()).max(reach);
            }
        }
        let counting = from_center().filter(|distance| *distance <= limit);
        reach = reach.max(2.0 * counting.fold(0.0, f64::max));

        // 3. The dome beyond both.
        let is_length = reach > 0.0 && (DOME * reach).is_finite();
        let radius = DOME * if is_length { reach } else { 1.0 };
        views.retain(|v| v.center().distance(center) <= radius);
        Self {
            center,
            radius,
            axes: axes(center, if points.is_empty() { &centers } else { &points }),
            ground: ground::ground(&views, &points, center),
        }
    }

    /// Whether a camera stands within the dome; one that does not is misplaced.
    pub(crate) fn holds(&self, camera_in_world: DVec3) -> bool {
        camera_in_world.distance(self.center) <= self.radius
    }

    /// A point, or where the line from the middle to it comes close to the dome.
    pub(crate) fn within(&self, point_in_world: DVec3) -> DVec3 {
        let offset = point_in_world - self.center;
        let farthest = WITHIN * self.radius;
        if offset.abs().max_element() > farthest || offset.length() > farthest {
            return self.center + direction(offset) * farthest;
        }
        point_in_world
    }

    /// Where the shell lies in a direction (a unit vector) from the middle.
    fn shell(&self, direction: DVec3) -> DVec3 {
        let sinks = |ground: Plane| ground.inverse_distance_from(self.center);
        let inverse = self
            .ground
            .and_then(sinks)
            .map_or(0.0, |q| q.dot(direction));
        self.center + direction / inverse.max(1.0 / self.radius)
    }

    /// A dome beyond the shell, counter-clockwise from within.
    pub(crate) fn beyond(&self) -> Mesh {
        let (directions, triangles) = self.icosphere(3);
        let place = |d: DVec3| self.center + BEYOND * self.radius * d;
        Mesh {
            positions: directions.into_iter().map(place).collect(),
            triangles,
        }
    }

    /// Vertices spread over the shell, about 9° apart.
    pub(crate) fn vertices(&self) -> Vec<DVec3> {
        let (directions, _) = self.icosphere(3);
        directions.into_iter().map(|d| self.shell(d)).collect()
    }

    /// An [`icosphere`] that stands as the capture does.
    fn icosphere(&self, splits: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let (mut directions, triangles) = icosphere(splits);
        directions.iter_mut().for_each(|d| *d = self.axes * *d);
        (directions, triangles)
    }
}

/// Principal axes of the directions from a place to points, as columns, the longest first and right-handed;
/// the first two have the directions' mean on their side. Of directions, as a few far points would have it all
/// their way.
fn axes(center: DVec3, points: &[DVec3]) -> DMat3 {
    let (mut spread, mut mean) = (DMat3::ZERO, DVec3::ZERO);
    for point in points {
        let d = direction(*point - center);
        spread += outer(d);
        mean += d;
    }
    let [x, y, _] =
        principal_axes(spread).map(|(_, axis)| if axis.dot(mean) < 0.0 { -axis } else { axis });
    DMat3::from_cols(x, y, x.cross(y))
}

/// The unit vector along an offset; zero of none.
fn direction(offset: DVec3) -> DVec3 {
    // Divided first: offsets may be too long to square.
    (offset / offset.abs().max_element()).normalize_or_zero()
}

/// Unit vectors and triangles, counter-clockwise from within; each split takes every side in
/// half.
fn icosphere(splits: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let mut directions = Vec::new();
    for (one, phi) in [
        (1.0, golden),
        (-1.0, golden),
        (1.0, -golden),
        (-1.0, -golden),
    ] {
        directions.push(DVec3::new(0.0, one, phi));
        directions.push(DVec3::new(one, phi, 0.0));
        directions.push(DVec3::new(phi, 0.0, one));
    }
    let mut triangles = Vec::new();
    let near = |a: DVec3, b: DVec3| (a.distance(b) - 2.0).abs() < 1e-9;
    for a in 0..12u32 {
        for b in 0..a {
            for c in 0..b {
                let [p, q, r] = [a, b, c].map(|i| directions[i as usize]);
                if near(p, q) && near(q, r) && near(r, p) {
                    let inwards = p.cross(q).dot(r) < 0.0;
                    triangles.push(if inwards { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    directions.iter_mut().for_each(|d| *d = d.normalize());
    for _ in 0..splits {
        let mut middles = std::collections::BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let sum = directions[a as usize] + directions[b as usize];
                directions.push(sum.normalize());
                directions.len() as u32 - 1
            })
        };
        let mut split = Vec::new();
        for [a, b, c] in triangles {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            split.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = split;
    }
    (directions, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::order::tests::in_other_orders;
    use calibrate::{Lens, Rigid3};
    use glam::DVec2;

    /// Every other point is on the ground: one in two of them, by their places in the list, would be all or none.
    #[test]
    fn the_order_of_points_decides_neither_the_ground_nor_the_rest() {
        let view = |i: u32| {
            let (sin, cos) = (0.7 * f64::from(i)).sin_cos();
            let center = DVec3::new(4.0 * cos, 4.0 * sin, 1.6);
            View {
                lens: Lens::pinhole(DVec2::splat(100.0), DVec2::splat(50.0)),
                width: 100,
                height: 100,
                camera_from_world: Rigid3::looking_at(center, DVec3::Z, DVec3::Z),
            }
        };
        let views: Vec<View> = (0..9).map(view).collect();
        let part = |i: u32, factor: f64| (f64::from(i) * factor).fract();
        let point = |i: u32| {
            let across = [part(i, 0.754_877_666), part(i, 0.569_840_291)];
            let [x, y] = across.map(|share| 6.0 * share - 3.0);
            let above = 0.2 + 2.0 * part(i * i, 0.618_033_989);
            DVec3::new(x, y, if i.is_multiple_of(2) { 0.0 } else { above })
        };
        let points: Vec<DVec3> = (0..3000).map(point).collect();
        let expected = Surroundings::of(&views, points.iter().copied());
        let ground = expected.ground.unwrap();
        assert!(ground.normal().distance(DVec3::Z) < 1e-6, "{ground:?}");
        assert!(ground.signed_distance(DVec3::ZERO).abs() < 1e-6);
        for other in in_other_orders(&points) {
            let found = Surroundings::of(&views, other.into_iter());
            assert_eq!(found.ground, expected.ground);
            assert_eq!(found.axes, expected.axes);
            assert_eq!(
                (found.center, found.radius),
                (expected.center, expected.radius)
            );
        }
    }
}
