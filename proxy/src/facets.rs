//! A surface as one viewer sees it: triangles over the sphere of directions.

use glam::{DMat3, DVec3};

/// Flat triangles that tile all directions around a viewer, a Delaunay triangulation of the
/// sphere, each with the part of the surface seen through it. Inverse distance is linear over a facet's plane, whatever the lens.
///
/// Everything is in the viewer's camera frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Facets {
    /// Unit vectors towards the corners.
    pub directions: Vec<DVec3>,
    /// 1/distance of the corners; positive.
    pub inverse_distances: Vec<f64>,
    /// Corners of each facet, so that det(a, b, c) > 0 but for rounding.
    pub triangles: Vec<[u32; 3]>,
    /// q of each facet's plane: a ray v meets it at v / s with s = q · v.
    pub planes: Vec<DVec3>,
}

impl Facets {
    /// Facets from corners and triangles, all oriented alike: det(a, b, c) > 0 for all but those
    /// that rounding has turned over. Triangles too thin to carry a plane take that of equal
    /// inverse distance, which is close to the same thing there.
    pub fn new(
        directions: Vec<DVec3>,
        inverse_distances: Vec<f64>,
        triangles: Vec<[u32; 3]>,
    ) -> Self {
        let corner = |i: u32| directions[i as usize];
        let planes = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(corner);
                let s = t.map(|i| inverse_distances[i as usize]);
                plane_through([a, b, c], s)
            })
            .collect();
        Self {
            directions,
            inverse_distances,
            triangles,
            planes,
        }
    }

    /// For each facet the one across the side that lies opposite each corner.
    ///
    /// # Panics
    /// If a side has no triangle beyond it: the sphere must be closed.
    pub fn neighbours(&self) -> Vec<[u32; 3]> {
        // The sides by where they start, each with its end and the facet to its left.
        let mut first = vec![0; self.directions.len() + 1];
        for corner in self.triangles.iter().flatten() {
            first[*corner as usize + 1] += 1;
        }
        for i in 1..first.len() {
            first[i] += first[i - 1];
        }
        let mut next = first.clone();
        let mut sides = vec![(0, 0); 3 * self.triangles.len()];
        for (facet, corners) in (0..).zip(&self.triangles) {
            for k in 0..3 {
                let place = &mut next[corners[k] as usize];
                sides[*place] = (corners[(k + 1) % 3], facet);
                *place += 1;
            }
        }
        let across = |from: u32, to: u32| {
            let from = from as usize;
            let here = &sides[first[from]..first[from + 1]];
            let found = here.iter().find(|side| side.0 == to);
            found.expect("the sphere must be closed").1
        };
        let of = |t: &[u32; 3]| [0, 1, 2].map(|k| across(t[(k + 2) % 3], t[(k + 1) % 3]));
        self.triangles.iter().map(of).collect()
    }

    /// The facet that a ray passes through, found by walking from facet `start` towards it over
    /// [`Self::neighbours`].
    pub fn locate(&self, neighbours: &[[u32; 3]], ray: DVec3, start: u32) -> u32 {
        let mut at = start;
        // A walk over a Delaunay triangulation never comes back (Edelsbrunner 1990); the
        // bound is for rounding.
        'walk: for step in 0..=self.triangles.len() {
            let corners = self.triangles[at as usize].map(|i| self.directions[i as usize]);
            // Which side is tried first alternates, so that rounding cannot lead in a circle.
            for k in 0..3 {
                let k = (k + step) % 3;
                let (from, to) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
                if from.cross(to).dot(ray) < 0.0 {
                    at = neighbours[at as usize][k];
                    continue 'walk;
                }
            }
            break;
        }
        at
    }
}

fn plane_through(directions: [DVec3; 3], inverse_distances: [f64; 3]) -> DVec3 {
    let [a, b, c] = directions;
    let s = DVec3::from_array(inverse_distances);
    let q = DMat3::from_cols(a, b, c).transpose().inverse() * s;
    let middle = (a + b + c).normalize_or(DVec3::Z);
    let mean = (s.x + s.y + s.z) / 3.0;
    if q.is_finite() { q } else { middle * mean }
}
