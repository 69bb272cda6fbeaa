//! What the lines of sight say about the tetrahedra that they cross.
//!
//! The visibility energy of Labatut, Pons and Keriven 2009, "Robust and efficient surface
//! reconstruction from range data", §4: a line that passes from free space into solid at a
//! facet pays c = 1 − exp(−d²/2σ²), d the facet's distance from the observed point; one
//! whose point has free space just behind it pays 1; a camera in solid pays everything.
//!
//! With x = 1 for solid, a crossing from N (towards the camera) to T (towards the point)
//! costs c·(1 − x_N)·x_T = c·x_T − c·x_N + c·x_N·(1 − x_T). Summed along a line, what is left
//! at each tetrahedron is the step from one c to the next, which is zero but close to the
//! point: the flow from the camera, which would have to be found along the whole line, has
//! been pushed already.

use super::delaunay::{Delaunay, INFINITE};
use super::lattice::vector;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// One line of sight's whole weight. Whole numbers add up to the same in any order.
pub(super) const UNIT: u32 = 256;
/// What a facet's quality costs at most, in lines.
pub(super) const MOST_QUALITY: u32 = 10_000;
/// More than this no cost of a label adds up to: an arc's, the one's the other way and the qualities of
/// their facet fit 32 bits together. It is four million lines through one facet.
const MOST: u32 = 1 << 30;
const _: () = assert!(2 * (MOST as u64 + MOST_QUALITY as u64 * UNIT as u64) <= u32::MAX as u64);
/// Beyond this many σ a facet counts as far from the point.
const FAR_SIGMAS: f64 = 6.0;
/// Chunks of vertices that are worked on at once.
const CHUNKS: usize = 64;

/// A point and the cameras that see it, as the lattice has them.
#[derive(Clone, Debug)]
pub(super) struct Sighting {
    /// The vertex of the observed point.
    pub(super) vertex: u32,
    /// Indices of the cameras that see it.
    pub(super) cameras: Vec<u32>,
}

/// Costs of the labels, in units of 1/[`UNIT`] line, none of which is more than [`MOST`].
#[derive(Debug)]
pub(super) struct Votes {
    /// For each arc `4 · tetrahedron + k`: if it is free and the one across is solid.
    pub(super) arcs: Vec<AtomicU32>,
    /// If it is solid.
    pub(super) free: Vec<AtomicU32>,
    /// If it is free.
    pub(super) solid: Vec<AtomicU32>,
}

impl Votes {
    fn new(tetrahedra: usize) -> Self {
        let zeros = |n: usize| (0..n).map(|_| AtomicU32::new(0)).collect::<Vec<_>>();
        Self {
            arcs: zeros(4 * tetrahedra),
            free: zeros(tetrahedra),
            solid: zeros(tetrahedra),
        }
    }

    fn limit(&mut self) {
        let [arcs, free, solid] = [&mut self.arcs, &mut self.free, &mut self.solid];
        for sum in arcs.iter_mut().chain(free).chain(solid) {
            let sum = sum.get_mut();
            *sum = MOST.min(*sum);
        }
    }
}

/// Adds a line's cost to a sum that may go a little beyond [`MOST`]. It is beyond in the end where the costs
/// are in any order: what is added once it is beyond is taken away again.
fn add(sum: &AtomicU32, cost: u32) {
    if sum.fetch_add(cost, Relaxed) > MOST {
        sum.fetch_sub(cost, Relaxed);
    }
}

/// How much of a line is believed where.
#[derive(Clone, Copy, Debug)]
pub(super) struct Softness {
    /// σ as a multiple of the distance from a point to its neighbours.
    pub(super) sigma: f64,
    /// How many σ behind the point solid is expected; 0 for just behind it.
    pub(super) behind: f64,
}

/// Corners other than k, so that with k first they are positively oriented.
pub(super) const OTHERS: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [3, 0, 1], [2, 1, 0]];

/// Follows all lines of sight. `is_point` tells observed points from other vertices.
pub(super) fn votes(
    delaunay: &Delaunay,
    sightings: &[Sighting],
    cameras: &[DVec3],
    is_point: impl Fn(u32) -> bool + Sync,
    softness: Softness,
) -> Votes {
    let mut votes = Votes::new(delaunay.finite);
    let of_vertex = delaunay.tetrahedron_of_vertex();
    let size = sightings.len().div_ceil(CHUNKS).max(1);
    sightings.par_chunks(size).for_each(|chunk| {
        let mut star = Star::new(delaunay);
        for sighting in chunk {
            star.gather(of_vertex[sighting.vertex as usize], sighting.vertex);
            let sigma = softness.sigma * star.spacing(&is_point);
            for &camera in &sighting.cameras {
                let towards = cameras[camera as usize] - star.center;
                in_front(&star, towards, sigma, &votes);
                behind(&star, -towards, sigma, softness.behind, &votes);
            }
        }
    });
    votes.limit();
    votes
}

/// 1 − exp(−d²/2σ²), to within 1 %, from arithmetic that is the same everywhere.
fn soft(distance: f64, sigma: f64) -> u32 {
    if distance >= FAR_SIGMAS * sigma {
        return UNIT;
    }
    let u = 0.5 * (distance / sigma).powi(2);
    let e = 1.0 + u * (1.0 + u / 2.0 * (1.0 + u / 3.0 * (1.0 + u / 4.0 * (1.0 + u / 5.0))));
    (f64::from(UNIT) * (1.0 - 1.0 / e)).round() as u32
}

/// From the point to the camera.
fn in_front(star: &Star<'_>, towards: DVec3, sigma: f64, votes: &Votes) {
    let Some(mut walk) = Walk::start(star, towards) else {
        return;
    };
    let length = towards.length();
    let mut before = 0;
    loop {
        let along = walk.exit_along();
        // Where the line leaves beyond the camera, the camera is in here.
        let ends = !(along < 1.0) || walk.leaves_hull();
        let cost = if ends {
            UNIT
        } else {
            soft(along * length, sigma)
        }
        .max(before);
        // Nothing, but close to the point.
        if cost > before {
            add(&votes.free[walk.at as usize], cost - before);
        }
        if ends {
            return;
        }
        add(&votes.arcs[walk.exit_arc() as usize], cost);
        before = cost;
        if !walk.step() {
            return;
        }
    }
}

/// From the point away from the camera.
fn behind(star: &Star<'_>, away: DVec3, sigma: f64, sigmas: f64, votes: &Votes) {
    let Some(mut walk) = Walk::start(star, away) else {
        return;
    };
    let length = away.length();
    loop {
        let distance = walk.exit_along() * length;
        if !(distance < sigmas * sigma) || walk.leaves_hull() {
            break;
        }
        let (at, arc) = (walk.at, walk.exit_arc());
        if !walk.step() {
            walk.at = at;
            break;
        }
        add(&votes.arcs[arc as usize], soft(distance, sigma));
    }
    add(&votes.solid[walk.at as usize], UNIT);
}

/// The tetrahedra around a vertex.
struct Star<'a> {
    delaunay: &'a Delaunay,
    vertex: u32,
    center: DVec3,
    tetrahedra: Vec<u32>,
    /// Of each, in the same order, the facet across from the vertex.
    facets: Vec<Facet>,
    /// Which vertex last gathered a tetrahedron, plus one.
    seen: Vec<u32>,
}

/// The facet of a tetrahedron across from one of its corners.
#[derive(Clone, Copy)]
struct Facet {
    /// That corner, 0 to 3.
    opposite: usize,
    /// The others, and where they lie from it.
    vertices: [u32; 3],
    corners: [DVec3; 3],
    /// The normals of the planes through it and each two of them in turn.
    sides: [DVec3; 3],
}

impl<'a> Star<'a> {
    fn new(delaunay: &'a Delaunay) -> Self {
        Self {
            delaunay,
            vertex: INFINITE,
            center: DVec3::ZERO,
            tetrahedra: Vec::new(),
            facets: Vec::new(),
            seen: vec![0; delaunay.finite],
        }
    }

    fn gather(&mut self, first: u32, vertex: u32) {
        self.vertex = vertex;
        self.center = vector(self.delaunay.sites[vertex as usize]);
        self.tetrahedra.clear();
        self.tetrahedra.push(first);
        self.seen[first as usize] = vertex + 1;
        let mut done = 0;
        while let Some(&t) = self.tetrahedra.get(done) {
            done += 1;
            let corners = self.delaunay.tetrahedra[t as usize];
            for k in (0..4).filter(|&k| corners[k] != vertex) {
                let next = self.delaunay.across[t as usize][k] >> 2;
                if !self.delaunay.is_ghost(next) && self.seen[next as usize] != vertex + 1 {
                    self.seen[next as usize] = vertex + 1;
                    self.tetrahedra.push(next);
                }
            }
        }
        let facet = |&t: &u32| {
            let all = self.delaunay.tetrahedra[t as usize];
            let opposite = all.iter().position(|&v| v == vertex).unwrap_or(0);
            let vertices = OTHERS[opposite].map(|k| all[k]);
            let place = |v: u32| vector(self.delaunay.sites[v as usize]) - self.center;
            let [a, b, c] = vertices.map(place);
            Facet {
                opposite,
                vertices,
                corners: [a, b, c],
                sides: [a.cross(b), b.cross(c), c.cross(a)],
            }
        };
        self.facets.clear();
        self.facets.extend(self.tetrahedra.iter().map(facet));
    }

    /// The median length of the edges to other points; of all edges where there is none.
    fn spacing(&self, is_point: impl Fn(u32) -> bool) -> f64 {
        let corners = self
            .tetrahedra
            .iter()
            .flat_map(|&t| self.delaunay.tetrahedra[t as usize]);
        let mut ends: Vec<u32> = corners.filter(|&v| v != self.vertex).collect();
        ends.sort_unstable();
        ends.dedup();
        let length = |&v: &u32| (vector(self.delaunay.sites[v as usize]) - self.center).length();
        let mut lengths: Vec<f64> = ends.iter().filter(|v| is_point(**v)).map(length).collect();
        if lengths.is_empty() {
            lengths = ends.iter().map(length).collect();
        }
        crate::cloud::median(lengths)
    }
}

/// A walk along a ray from a vertex, through one facet after the other.
struct Walk<'a> {
    delaunay: &'a Delaunay,
    origin: DVec3,
    ray: DVec3,
    /// The tetrahedron that the ray is in.
    at: u32,
    /// Its corner across from the facet where the ray leaves.
    exit: usize,
    /// The facet's corners, and where they lie from the origin; the ray passes them
    /// counter-clockwise.
    facet: [u32; 3],
    corners: [DVec3; 3],
}

/// The side of the line through a and b on which the ray passes; exactly the opposite for b
/// and a, so that neighbours never disagree.
fn side(a: DVec3, b: DVec3, ray: DVec3) -> f64 {
    a.cross(b).dot(ray)
}

impl<'a> Walk<'a> {
    fn start(star: &Star<'a>, ray: DVec3) -> Option<Self> {
        let mut all = star.tetrahedra.iter().zip(&star.facets);
        let through = |facet: &Facet| facet.sides.iter().all(|side| side.dot(ray) >= 0.0);
        let (&at, facet) = all.find(|(_, facet)| through(facet))?;
        Some(Self {
            delaunay: star.delaunay,
            origin: star.center,
            ray,
            at,
            exit: facet.opposite,
            facet: facet.vertices,
            corners: facet.corners,
        })
    }

    /// Where the ray leaves the tetrahedron, as a multiple of its vector.
    fn exit_along(&self) -> f64 {
        let [a, b, c] = self.corners;
        let normal = (b - a).cross(c - a);
        normal.dot(a) / normal.dot(self.ray)
    }

    fn exit_arc(&self) -> u32 {
        4 * self.at + self.exit as u32
    }

    fn leaves_hull(&self) -> bool {
        self.delaunay
            .is_ghost(self.delaunay.across[self.at as usize][self.exit] >> 2)
    }

    /// Goes on to the next tetrahedron, which must not be a ghost; `false` where rounding
    /// leaves no way out of it.
    fn step(&mut self) -> bool {
        let entry = self.delaunay.across[self.at as usize][self.exit];
        self.at = entry >> 2;
        let all = self.delaunay.tetrahedra[self.at as usize];
        let apex = all[entry as usize & 3];
        let d = vector(self.delaunay.sites[apex as usize]) - self.origin;
        let sides = self.corners.map(|x| side(x, d, self.ray));
        // The facet over the side from corner i to the next holds the ray; the third corner
        // goes.
        let Some(i) = (0..3).find(|&i| sides[i] <= 0.0 && sides[(i + 1) % 3] >= 0.0) else {
            return false;
        };
        let gone = (i + 2) % 3;
        let Some(exit) = all.iter().position(|&v| v == self.facet[gone]) else {
            return false;
        };
        self.exit = exit;
        self.facet[gone] = apex;
        self.corners[gone] = d;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_beyond_the_most_are_the_most_in_any_order() {
        let costs = |start: u32| {
            let mut votes = Votes::new(1);
            votes.arcs[2] = AtomicU32::new(start);
            (0..10_000_u32)
                .into_par_iter()
                .for_each(|i| add(&votes.arcs[2], i % (UNIT + 1)));
            votes.limit();
            votes.arcs[2].load(Relaxed)
        };
        let sum: u32 = (0..10_000).map(|i| i % (UNIT + 1)).sum();
        assert_eq!(costs(0), sum);
        for beyond in [0, 1, UNIT, sum - 1, sum] {
            assert_eq!(costs(MOST - sum + beyond), MOST);
        }
        assert_eq!(costs(MOST - sum - 1), MOST - 1);
    }
}
