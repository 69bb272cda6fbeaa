//! Fewer triangles, by contracting edges in the order of quadric errors (Garland and
//! Heckbert 1997).
//!
//! Instead of one queue there are passes: in each, the cheapest edges of all are contracted,
//! cheapest first, as long as none touches another's triangles. Costs are computed by all
//! threads, and the result is the same for any number of them.

use super::Mesh;
use super::quadric::Quadric;
use glam::DVec3;
use rayon::prelude::*;

/// The share of edges that a pass considers: with more, dear edges would go while cheap ones
/// next to contracted ones wait. It grows where few of the cheapest can go.
const SHARE: f64 = 0.3;
/// A pass that removes less than this share of the triangles achieved little.
const LITTLE: f64 = 0.02;
/// The weight of planes that hold borders in place, in squares of the border's edges.
const BORDER_WEIGHT: f64 = 4.0;
/// Triangles may turn by up to the angle with this cosine.
const MIN_COS: f64 = 0.3;

impl Mesh {
    /// The mesh with at most about `max_triangles`, as few as its shape allows; borders stay
    /// where they are, and pieces and holes stay what they are. Corners far from one another
    /// are never joined.
    #[must_use]
    pub fn simplified(&self, max_triangles: usize) -> Self {
        // Near the origin quadrics keep their digits.
        let origin = self
            .bounds()
            .map_or(DVec3::ZERO, |(low, high)| low.midpoint(high));
        let mut mesh = self.clone();
        mesh.positions.iter_mut().for_each(|p| *p -= origin);
        mesh.triangles
            .retain(|[a, b, c]| a != b && b != c && c != a);
        let mut quadrics = quadrics(&mesh);
        let mut share = SHARE;
        while mesh.triangles.len() > max_triangles {
            let before = mesh.triangles.len();
            pass(&mut mesh, &mut quadrics, max_triangles, share);
            let removed = (before - mesh.triangles.len()) as f64 / before as f64;
            if removed < LITTLE {
                if share >= 1.0 {
                    break;
                }
                share *= 2.0;
            }
        }
        mesh.drop_unused();
        mesh.positions.iter_mut().for_each(|p| *p += origin);
        mesh
    }
}

/// The triangles' sides, ascending; those of an edge are one after the other.
fn sides(mesh: &Mesh) -> Vec<Side> {
    let mut all = vec![Side(0); 3 * mesh.triangles.len()];
    let of_triangles = all.par_chunks_exact_mut(3).zip(&mesh.triangles);
    of_triangles.for_each(|(sides, t)| {
        for k in 0..3 {
            sides[k] = Side::between(t[k], t[(k + 1) % 3]);
        }
    });
    all.par_sort_unstable();
    all
}

/// Both ends of a triangle's side as one number, which is sorted sooner: the lesser one first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Side(u64);

impl Side {
    fn between(a: u32, b: u32) -> Self {
        Self(u64::from(a.min(b)) << 32 | u64::from(a.max(b)))
    }

    fn ends(self) -> [u32; 2] {
        [(self.0 >> 32) as u32, self.0 as u32]
    }
}

fn quadrics(mesh: &Mesh) -> Vec<Quadric> {
    let mut quadrics = vec![Quadric::default(); mesh.positions.len()];
    for (i, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = mesh.corners(i);
        let across = (b - a).cross(c - a);
        if let Some(normal) = across.try_normalize() {
            let quadric = Quadric::plane(normal, a, 0.5 * across.length());
            triangle
                .iter()
                .for_each(|i| quadrics[*i as usize] += quadric);
        }
    }
    // Planes across the surface along its borders.
    let sides = sides(mesh);
    let edges = sides.chunk_by(|a, b| a == b);
    let border: Vec<Side> = edges
        .filter(|sides| sides.len() == 1)
        .map(|sides| sides[0])
        .collect();
    drop(sides);
    for (i, triangle) in mesh.triangles.iter().enumerate() {
        let corners = mesh.corners(i);
        for k in 0..3 {
            let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
            if border.binary_search(&Side::between(a, b)).is_err() {
                continue;
            }
            let (from, to) = (corners[k], corners[(k + 1) % 3]);
            let normal = (to - from)
                .cross(corners[(k + 2) % 3] - from)
                .cross(to - from);
            if let Some(normal) = normal.try_normalize() {
                let weight = BORDER_WEIGHT * from.distance_squared(to);
                let quadric = Quadric::plane(normal, from, weight);
                quadrics[a as usize] += quadric;
                quadrics[b as usize] += quadric;
            }
        }
    }
    quadrics
}

/// The triangles around each corner.
struct Around {
    first: Vec<u32>,
    triangles: Vec<u32>,
}

impl Around {
    fn new(mesh: &Mesh) -> Self {
        let mut first = vec![0_u32; mesh.positions.len() + 1];
        for i in mesh.triangles.as_flattened() {
            first[*i as usize + 1] += 1;
        }
        for i in 1..first.len() {
            first[i] += first[i - 1];
        }
        let mut next = first.clone();
        let mut triangles = vec![0; 3 * mesh.triangles.len()];
        for (t, i) in mesh
            .triangles
            .iter()
            .enumerate()
            .flat_map(|(t, c)| c.map(|i| (t, i)))
        {
            triangles[next[i as usize] as usize] = t as u32;
            next[i as usize] += 1;
        }
        Self { first, triangles }
    }

    fn of(&self, corner: u32) -> &[u32] {
        let [from, to] = [0, 1].map(|k| self.first[corner as usize + k] as usize);
        &self.triangles[from..to]
    }
}

/// An edge that may go.
struct Candidate {
    cost: f64,
    ends: [u32; 2],
}

fn pass(mesh: &mut Mesh, quadrics: &mut [Quadric], max_triangles: usize, share: f64) {
    // 1. What each edge costs.
    let sides = sides(mesh);
    let mut is_border = vec![false; mesh.positions.len()];
    for edge in sides.chunk_by(|a, b| a == b).filter(|e| e.len() != 2) {
        let ends = edge[0].ends();
        ends.iter().for_each(|i| is_border[*i as usize] = true);
    }
    let candidate = |edge: &[Side]| {
        let ends = edge[0].ends();
        let [on_a, on_b] = ends.map(|i| is_border[i as usize]);
        // An edge across, from border to border, would pinch the surface.
        if edge.len() > 2 || (on_a && on_b && edge.len() == 2) {
            return None;
        }
        let (position, quadric) = contracted(mesh, quadrics, &is_border, ends);
        let [a, b] = ends.map(|i| mesh.positions[i as usize]);
        // Where all is flat, short edges go first.
        let cost = quadric.at(position) + 1e-9 * quadric.weight() * a.distance_squared(b);
        cost.is_finite().then_some(Candidate { cost, ends })
    };
    let edges = sides.par_chunk_by(|a, b| a == b);
    let mut candidates: Vec<Candidate> = edges.filter_map(candidate).collect();
    drop(sides);
    let order = |a: &Candidate, b: &Candidate| a.cost.total_cmp(&b.cost).then(a.ends.cmp(&b.ends));
    let considered = ((candidates.len() as f64 * share) as usize).max(64);
    if considered < candidates.len() {
        candidates.select_nth_unstable_by(considered, order);
        candidates.truncate(considered);
    }
    candidates.par_sort_unstable_by(order);
    // 2. The cheapest of them, apart from one another.
    let around = Around::new(mesh);
    let mut is_touched = vec![false; mesh.positions.len()];
    let mut left = mesh.triangles.len();
    let mut ring = Ring::default();
    for Candidate { ends, .. } in candidates {
        if left <= max_triangles {
            break;
        }
        let [a, b] = ends;
        if is_touched[a as usize] || is_touched[b as usize] {
            continue;
        }
        // Neither end was touched: it is where it was when the cost was found.
        let (position, _) = contracted(mesh, quadrics, &is_border, ends);
        if !ring.is_contractible(mesh, &around, ends, position) {
            continue;
        }
        let touched = ends.iter().chain(ring.next_to.iter().flatten());
        touched.for_each(|i| is_touched[*i as usize] = true);
        mesh.positions[a as usize] = position;
        let other = quadrics[b as usize];
        quadrics[a as usize] += other;
        for t in around.of(b) {
            let triangle = &mut mesh.triangles[*t as usize];
            left -= usize::from(triangle.contains(&a));
            triangle
                .iter_mut()
                .filter(|i| **i == b)
                .for_each(|i| *i = a);
        }
    }
    mesh.triangles
        .retain(|[a, b, c]| a != b && b != c && c != a);
}

/// Where both ends of an edge go, and what holds them.
fn contracted(
    mesh: &Mesh,
    quadrics: &[Quadric],
    is_border: &[bool],
    ends: [u32; 2],
) -> (DVec3, Quadric) {
    let [a, b] = ends.map(|i| mesh.positions[i as usize]);
    let mut quadric = quadrics[ends[0] as usize];
    quadric += quadrics[ends[1] as usize];
    let position = match ends.map(|i| is_border[i as usize]) {
        [true, false] => a,
        [false, true] => b,
        _ => quadric.least_near(a.midpoint(b)),
    };
    (position, quadric)
}

/// The corners next to both ends of an edge.
#[derive(Default)]
struct Ring {
    next_to: [Vec<u32>; 2],
}

impl Ring {
    /// Whether the edge can go: the surface stays what it is (Dey et al. 1999, the link condition), and no
    /// triangle turns over. If so, the corners next to it are found.
    fn is_contractible(
        &mut self,
        mesh: &Mesh,
        around: &Around,
        ends: [u32; 2],
        position: DVec3,
    ) -> bool {
        let mut shared = 0;
        for (k, next_to) in self.next_to.iter_mut().enumerate() {
            next_to.clear();
            let (here, there) = (ends[k], ends[1 - k]);
            for t in around.of(here) {
                let triangle = mesh.triangles[*t as usize];
                next_to.extend(triangle.iter().filter(|i| !ends.contains(i)));
                if triangle.contains(&there) {
                    shared += 1;
                    continue;
                }
                let corners = mesh.corners(*t as usize);
                let normal = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
                let mut moved = corners;
                for (corner, i) in moved.iter_mut().zip(triangle) {
                    if i == here {
                        *corner = position;
                    }
                }
                let (before, after) = (normal(corners), normal(moved));
                let is_turned = before.dot(after) < MIN_COS * before.length() * after.length();
                if is_turned || (after == DVec3::ZERO && before != DVec3::ZERO) {
                    return false;
                }
            }
            next_to.sort_unstable();
            next_to.dedup();
        }
        let [of_a, of_b] = &self.next_to;
        let common = of_a
            .iter()
            .filter(|i| of_b.binary_search(i).is_ok())
            .count();
        // Each triangle of the edge has one corner apart from it; half of them were counted twice.
        common == shared / 2
    }
}
