//! A closed shell around a capture: a distant dome, and the ground where there is one.

use crate::cloud::{isolated_points, median};
use calibrate::View;
use glam::DVec3;

/// The dome's radius as a multiple of how far nearly all points are from the cameras'
/// middle: what lies there moves against the horizon by 6° at most between any two of them.
const DOME: f64 = 10.0;
/// The share of points that are nearly all.
const NEARLY_ALL: f64 = 0.95;
/// Points are brought within this share of the dome's radius: its flat facets lie within.
const WITHIN: f64 = 0.8;

/// How far a capture reaches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surroundings {
    /// The cameras' middle.
    pub(crate) center: DVec3,
    /// The dome's.
    pub(crate) radius: f64,
}

impl Surroundings {
    /// Of cameras at finite places and finite points.
    pub(crate) fn of(views: &[View], points: impl Iterator<Item = DVec3>) -> Self {
        let centers: Vec<DVec3> = views.iter().map(View::center).collect();
        let axis = |k: usize| median(centers.iter().map(|c| c[k]).collect());
        let center = DVec3::new(axis(0), axis(1), axis(2));
        let farthest = centers.iter().map(|c| c.distance(center)).fold(0.0, f64::max);
        let points: Vec<DVec3> = points.collect();
        let isolated = isolated_points(&points);
        let kept = points.iter().zip(&isolated).filter(|(_, alone)| !**alone);
        let mut distances: Vec<f64> = kept.map(|(p, _)| p.distance(center)).collect();
        let mut reach = 2.0 * farthest;
        if !distances.is_empty() {
            let nearly_all = (distances.len() - 1) as f64 * NEARLY_ALL;
            let (_, far, _) =
                distances.select_nth_unstable_by(nearly_all as usize, f64::total_cmp);
            reach = reach.max(*far);
        }
        if !(reach > 0.0) {
            reach = 1.0;
        }
        Self {
            center,
            radius: DOME * reach,
        }
    }

    /// A point, or where the line from the middle to it comes close to the dome.
    pub(crate) fn within(&self, point_in_world: DVec3) -> DVec3 {
        let offset = point_in_world - self.center;
        let scale = (WITHIN * self.radius / offset.length()).min(1.0);
        if scale < 1.0 { self.center + offset * scale } else { point_in_world }
    }

    /// The dome's vertices: an icosahedron's sides split twice.
    pub(crate) fn dome(&self) -> Vec<DVec3> {
        let (directions, _) = icosphere(2);
        directions.into_iter().map(|d| self.center + d * self.radius).collect()
    }
}

/// Unit vectors and triangles, counter-clockwise from within; each split takes every side in
/// half.
fn icosphere(splits: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let mut directions = Vec::new();
    for (one, phi) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
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
