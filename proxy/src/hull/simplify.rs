//! Fewer faces around at least as much: progressive hulls (Sander, Gu, Gortler, Hoppe and
//! Snyder 2000, "Silhouette Clipping", §3.2).
//!
//! An edge collapses to a vertex v that lies on or beyond the planes of all faces f around
//! its ends. The surface then changes by the boundary of the tetrahedra (v, f), none of which
//! has a negative volume, so no point's winding number falls: what was inside stays inside,
//! even where parts of the surface meet that are not neighbours. That holds for any closed
//! surface and any two vertices, so the surface's topology may change: cavities, tunnels and
//! slots that become flat are closed.

use super::closest::{HalfSpace, closest_point};
use crate::Mesh;
use glam::DVec3;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// How strongly a new vertex is held at its edge's middle: by this part of the edge's length,
/// as an area, times the square of how far it is away. Where faces are nearly flat, all
/// places on their plane add as little volume as any.
const HOLD: f64 = 0.2;
/// What a collapse may add at most, as parts of the volume: cheap folds come before costly
/// collapses without, and few faces are worth less than the shape.
const MOST_ADDED: [f64; 4] = [1e-5, 1e-4, 1e-3, 1e-2];
/// After so many of the faces have gone, edges that could not collapse are tried again.
const ROUND: f64 = 0.6;
/// A new face may turn by so much from the one it takes the place of (cosine). Folds do no
/// harm but to the mesh's looks: they come when nothing else is left at the price.
const MOST_TURNED: [f64; 3] = [0.2, -0.5, -2.0];

/// Collapses edges, those first that add least volume, until so many faces are left, or until
/// any more would add over a hundredth of the volume.
///
/// The mesh must be closed, winding counter-clockwise from outside. The result is, too, and
/// contains whatever the mesh contains. Where it closed a hole, more than two faces may share
/// an edge. Deterministic.
pub fn simplify(mesh: &Mesh, faces: usize) -> Mesh {
    let mut surface = Surface::new(mesh);
    let volume = mesh.volume().abs();
    let stages = MOST_ADDED
        .iter()
        .flat_map(|part| MOST_TURNED.map(|turned| (part, turned)));
    for (part, most_turned) in stages {
        while surface.alive_faces > faces {
            let before = surface.alive_faces;
            let round = faces.max((ROUND * before as f64) as usize);
            surface.collapse_edges(round, part * volume, most_turned);
            if surface.alive_faces == before {
                break;
            }
        }
    }
    surface.into_mesh()
}

/// A closed mesh on its way to fewer faces.
struct Surface {
    positions: Vec<DVec3>,
    /// Counts the changes around a vertex.
    stamps: Vec<u32>,
    triangles: Vec<Option<[u32; 3]>>,
    /// The triangles around each vertex.
    around: Vec<Vec<u32>>,
    alive_faces: usize,
}

/// What becomes of an edge.
struct Collapse {
    /// The vertex that takes its place.
    position: DVec3,
    /// The added volume, and what holds the vertex.
    cost: f64,
}

/// An edge in the queue, the cheapest first.
struct Candidate {
    cost: f64,
    /// The lower vertex first.
    edge: [u32; 2],
    stamps: [u32; 2],
}

impl Surface {
    fn new(mesh: &Mesh) -> Self {
        let mut around = vec![Vec::new(); mesh.positions.len()];
        for (i, triangle) in mesh.triangles.iter().enumerate() {
            for vertex in triangle {
                around[*vertex as usize].push(i as u32);
            }
        }
        Self {
            positions: mesh.positions.clone(),
            stamps: vec![0; mesh.positions.len()],
            triangles: mesh.triangles.iter().copied().map(Some).collect(),
            around,
            alive_faces: mesh.triangles.len(),
        }
    }

    /// Collapses edges until so many faces are left or every collapse would cost more than
    /// `most`.
    fn collapse_edges(&mut self, faces: usize, most: f64, most_turned: f64) {
        let edges = self.edges();
        let costs: Vec<Option<f64>> = edges
            .par_iter()
            .map(|edge| Some(self.collapse(*edge, most_turned)?.cost))
            .collect();
        let mut heap: BinaryHeap<Candidate> = edges
            .into_iter()
            .zip(costs)
            .filter_map(|(edge, cost)| Some(self.candidate(edge, cost?)))
            .collect();
        while self.alive_faces > faces {
            let Some(Candidate { edge, stamps, .. }) = heap.pop() else {
                break;
            };
            if !self.joined(edge) {
                continue;
            }
            let Some(collapse) = self.collapse(edge, most_turned) else {
                continue;
            };
            // Something around it may have changed since it was queued.
            let stale = stamps != edge.map(|v| self.stamps[v as usize]);
            if collapse.cost > most {
                continue;
            }
            if stale && heap.peek().is_some_and(|next| next.cost < collapse.cost) {
                heap.push(self.candidate(edge, collapse.cost));
                continue;
            }
            for vertex in self.apply(edge, &collapse) {
                for neighbour in self.neighbours(vertex) {
                    let edge = [vertex.min(neighbour), vertex.max(neighbour)];
                    if let Some(collapse) = self.collapse(edge, most_turned) {
                        heap.push(self.candidate(edge, collapse.cost));
                    }
                }
            }
        }
    }

    fn edges(&self) -> Vec<[u32; 2]> {
        let each = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
        let directed = self.triangles.iter().flatten().flat_map(each);
        // In a closed mesh every edge runs both ways, some more than once.
        let mut edges: Vec<[u32; 2]> = directed.filter(|[a, b]| a < b).collect();
        edges.sort_unstable();
        edges.dedup();
        edges
    }

    fn candidate(&self, edge: [u32; 2], cost: f64) -> Candidate {
        Candidate {
            cost,
            edge,
            stamps: edge.map(|v| self.stamps[v as usize]),
        }
    }

    fn triangle(&self, face: u32) -> [u32; 3] {
        self.triangles[face as usize].expect("faces around a vertex are alive")
    }

    /// The vertices joined to one, in order.
    fn neighbours(&self, vertex: u32) -> Vec<u32> {
        let mut found: Vec<u32> = self.around[vertex as usize]
            .iter()
            .flat_map(|face| self.triangle(*face))
            .filter(|v| *v != vertex)
            .collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Where an edge may go and what that costs; `None` where it cannot collapse.
    fn collapse(&self, edge: [u32; 2], most_turned: f64) -> Option<Collapse> {
        let [a, b] = edge;
        // 1. The planes to stay beyond, and the volume added beyond them:
        // Σ area·(n·v − d)/3.
        let mut faces = self.around[a as usize].clone();
        faces.extend(
            self.around[b as usize]
                .iter()
                .filter(|face| !self.triangle(**face).contains(&a)),
        );
        let ends = edge.map(|v| self.positions[v as usize]);
        let middle = 0.5 * (ends[0] + ends[1]);
        let length = ends[0].distance(ends[1]);
        let mut beyond: Vec<HalfSpace> = Vec::with_capacity(faces.len());
        let (mut gradient, mut volume_at_middle) = (DVec3::ZERO, 0.0);
        for face in &faces {
            let [p, q, r] = self
                .triangle(*face)
                .map(|v| self.positions[v as usize] - middle);
            let across = (q - p).cross(r - p);
            // Faces without an area bound no volume.
            let Some(normal) = across.try_normalize() else {
                continue;
            };
            gradient += across / 6.0;
            volume_at_middle -= across.dot(p) / 6.0;
            beyond.push(HalfSpace {
                normal,
                offset: normal.dot(p),
            });
        }
        // 2. Least volume + ½·hold·|v − middle|²: the point of the polyhedron that is nearest
        // to the one that is best without it.
        let hold = HOLD * length;
        let best = if hold > 0.0 {
            -gradient / hold
        } else {
            DVec3::ZERO
        };
        let moved = closest_point(&beyond, best)?;
        let position = middle + moved;
        if !position.is_finite() {
            return None;
        }
        // 3. No face may turn over.
        for face in &faces {
            let triangle = self.triangle(*face);
            if triangle.contains(&a) && triangle.contains(&b) {
                continue;
            }
            let corners = triangle.map(|v| self.positions[v as usize]);
            let new = triangle.map(|v| {
                if edge.contains(&v) {
                    position
                } else {
                    self.positions[v as usize]
                }
            });
            let normal = |[p, q, r]: [DVec3; 3]| (q - p).cross(r - p).normalize_or_zero();
            if !(normal(corners).dot(normal(new)) > most_turned) {
                return None;
            }
        }
        let added = (volume_at_middle + gradient.dot(moved)).max(0.0);
        let cost = added + 0.5 * hold * moved.length_squared();
        cost.is_finite().then_some(Collapse { position, cost })
    }

    /// Whether two vertices are joined by an edge.
    fn joined(&self, [a, b]: [u32; 2]) -> bool {
        let faces = &self.around[a as usize];
        faces.iter().any(|face| self.triangle(*face).contains(&b))
    }

    /// Moves the edge's first vertex to its new place and joins the other to it. Returns the
    /// vertices whose edges are new.
    fn apply(&mut self, edge: [u32; 2], collapse: &Collapse) -> Vec<u32> {
        let [a, b] = edge;
        let of_b = std::mem::take(&mut self.around[b as usize]);
        for face in of_b {
            let triangle = self.triangle(face);
            if triangle.contains(&a) {
                self.triangles[face as usize] = None;
                self.alive_faces -= 1;
                for vertex in triangle.into_iter().filter(|v| *v != b) {
                    self.around[vertex as usize].retain(|f| *f != face);
                }
            } else {
                self.triangles[face as usize] = Some(triangle.map(|v| if v == b { a } else { v }));
                self.around[a as usize].push(face);
            }
        }
        self.positions[a as usize] = collapse.position;
        self.stamps[a as usize] += 1;
        for vertex in self.neighbours(a) {
            self.stamps[vertex as usize] += 1;
        }
        let mut changed = self.cancel(a);
        let mut new = self.split(a);
        if !new.is_empty() {
            // Edges that many faces shared are shared by two now, so other vertices may part.
            let around = new.iter().chain([&a]);
            changed.extend(around.flat_map(|v| self.neighbours(*v)).collect::<Vec<_>>());
        }
        changed.sort_unstable();
        changed.dedup();
        for vertex in changed.into_iter().filter(|v| *v != a) {
            new.extend(self.split(vertex));
        }
        new.push(a);
        new
    }

    /// Takes out pairs of faces around a vertex that have the same corners and look opposite
    /// ways: they bound nothing any more. So cavities, tunnels and slots close. Returns the
    /// faces' corners.
    fn cancel(&mut self, vertex: u32) -> Vec<u32> {
        // Each face's corners in order, and whether it winds that way.
        let mut faces: Vec<([u32; 3], bool, u32)> = self.around[vertex as usize]
            .iter()
            .map(|face| {
                let [p, q, r] = self.triangle(*face);
                let mut sorted = [p, q, r];
                sorted.sort_unstable();
                let even = [[p, q, r], [q, r, p], [r, p, q]].contains(&sorted);
                (sorted, even, *face)
            })
            .collect();
        faces.sort_unstable();
        let mut corners = Vec::new();
        for same in faces.chunk_by(|a, b| a.0 == b.0) {
            let odd = same.partition_point(|face| !face.1);
            let pairs = odd.min(same.len() - odd);
            for (_, _, face) in same[..pairs].iter().chain(&same[same.len() - pairs..]) {
                for corner in self.triangle(*face) {
                    let around = &mut self.around[corner as usize];
                    around.retain(|f| f != face);
                    corners.push(corner);
                }
                self.triangles[*face as usize] = None;
                self.alive_faces -= 1;
            }
        }
        corners
    }

    /// Where the faces around a vertex fall into parts that do not meet at an edge, gives each
    /// part a vertex of its own, at the same place: they may go different ways from now on.
    /// Returns the new vertices.
    fn split(&mut self, vertex: u32) -> Vec<u32> {
        let faces = std::mem::take(&mut self.around[vertex as usize]);
        let beside = self.beside(vertex, &faces);
        let mut seen = vec![false; faces.len()];
        let mut parts: Vec<Vec<u32>> = Vec::new();
        for first in 0..faces.len() {
            let mut part = Vec::new();
            let mut next = vec![first];
            while let Some(i) = next.pop() {
                if !std::mem::replace(&mut seen[i], true) {
                    part.push(faces[i]);
                    next.extend(&beside[i]);
                }
            }
            if !part.is_empty() {
                parts.push(part);
            }
        }
        let mut parts = parts.into_iter();
        self.around[vertex as usize] = parts.next().unwrap_or_default();
        let mut new = Vec::new();
        for part in parts {
            let copy = self.positions.len() as u32;
            for face in &part {
                let triangle = self.triangle(*face);
                let moved = triangle.map(|v| if v == vertex { copy } else { v });
                self.triangles[*face as usize] = Some(moved);
            }
            self.positions.push(self.positions[vertex as usize]);
            self.stamps.push(0);
            self.around.push(part);
            new.push(copy);
        }
        new
    }

    /// For each of the faces around a vertex, which ones continue the surface there. Where more
    /// than two share an edge these are the two with the same part of the outside between them.
    fn beside(&self, vertex: u32, faces: &[u32]) -> Vec<Vec<usize>> {
        // Each face has an edge that leaves the vertex and one that comes back: the other end,
        // whether it leaves, the corner across.
        let mut edges: Vec<(u32, bool, u32, usize)> = Vec::new();
        for (i, face) in faces.iter().enumerate() {
            let [p, q, r] = self.triangle(*face);
            let (next, last) = match () {
                () if p == vertex => (q, r),
                () if q == vertex => (r, p),
                () => (p, q),
            };
            edges.push((next, true, last, i));
            edges.push((last, false, next, i));
        }
        edges.sort_unstable();
        let mut beside = vec![Vec::new(); faces.len()];
        for same in edges.chunk_by(|a, b| a.0 == b.0) {
            let mut around: Vec<(f64, bool, usize)> = same
                .iter()
                .map(|(end, leaves, across, i)| {
                    let angle = if same.len() > 2 {
                        self.angle_around(vertex, *end, *across)
                    } else {
                        0.0
                    };
                    (angle, *leaves, *i)
                })
                .collect();
            around.sort_by(|a, b| a.0.total_cmp(&b.0));
            // The outside follows a face whose edge leaves, in the sense of growing angles, up
            // to one whose edge comes back.
            while around.len() >= 2 {
                let count = around.len();
                let found = (0..count).find(|k| around[*k].1 && !around[(k + 1) % count].1);
                let Some(k) = found else {
                    break;
                };
                let (i, j) = (around[k].2, around[(k + 1) % count].2);
                beside[i].push(j);
                beside[j].push(i);
                around.remove(k.max((k + 1) % count));
                around.remove(k.min((k + 1) % count));
            }
        }
        beside
    }

    /// The angle of a point around an edge, counter-clockwise where the edge comes towards one.
    fn angle_around(&self, start: u32, end: u32, point: u32) -> f64 {
        let [start, end, point] = [start, end, point].map(|v| self.positions[v as usize]);
        let axis = (end - start).normalize_or(DVec3::Z);
        let (x, y) = axis.any_orthonormal_pair();
        let away = point - start;
        away.dot(y).atan2(away.dot(x))
    }

    /// What is left, vertices that nothing uses left out.
    fn into_mesh(self) -> Mesh {
        let mut moved_to = vec![u32::MAX; self.positions.len()];
        let mut positions = Vec::new();
        for (i, position) in self.positions.iter().enumerate() {
            if !self.around[i].is_empty() {
                moved_to[i] = positions.len() as u32;
                positions.push(*position);
            }
        }
        let triangles = self.triangles.into_iter().flatten();
        Mesh {
            positions,
            triangles: triangles.map(|t| t.map(|v| moved_to[v as usize])).collect(),
        }
    }
}

impl Ord for Candidate {
    /// The greatest is the cheapest; ties go to the lower edge.
    fn cmp(&self, other: &Self) -> Ordering {
        let by_cost = other.cost.total_cmp(&self.cost);
        by_cost
            .then_with(|| other.edge.cmp(&self.edge))
            .then_with(|| other.stamps.cmp(&self.stamps))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}
