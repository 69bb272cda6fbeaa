//! Fewer faces around at least as much: progressive hulls (Sander, Gu, Gortler, Hoppe and
//! Snyder 2000, "Silhouette Clipping", §3.2).
//!
//! An edge collapses to a vertex v that lies on or beyond the planes of all faces f around
//! its ends. The surface then changes by the boundary of the tetrahedra (v, f), none of which
//! has a negative volume, so no point's winding number falls: what was inside stays inside,
//! even where parts of the surface meet that are not neighbours.

use super::closest::{HalfSpace, closest_point};
use crate::Mesh;
use glam::DVec3;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// How strongly a new vertex is held at its edge's middle: by this part of the edge's length,
/// as an area, times the square of how far it is away. Where faces are nearly flat, all
/// places on their plane add as little volume as any.
const HOLD: f64 = 0.05;
/// A new face may turn by so much from the one it takes the place of (cosine).
const MOST_TURNED: f64 = 0.2;

/// Collapses edges, those first that add least volume, until so many faces are left or no
/// edge can.
///
/// The mesh must be closed, winding counter-clockwise from outside. The result is, too; it
/// contains whatever the mesh contains. Deterministic.
pub fn simplify(mesh: &Mesh, faces: usize) -> Mesh {
    let mut surface = Surface::new(mesh);
    let edges = surface.edges();
    let costs: Vec<Option<f64>> = edges
        .par_iter()
        .map(|edge| Some(surface.collapse(*edge)?.cost))
        .collect();
    let mut heap: BinaryHeap<Candidate> = edges
        .into_iter()
        .zip(costs)
        .filter_map(|(edge, cost)| Some(surface.candidate(edge, cost?)))
        .collect();
    while surface.alive_faces > faces {
        let Some(candidate) = heap.pop() else {
            break;
        };
        let edge = candidate.edge;
        if !edge.iter().all(|v| surface.alive[*v as usize]) {
            continue;
        }
        let fresh = candidate.stamps == edge.map(|v| surface.stamps[v as usize]);
        let Some(collapse) = surface.collapse(edge) else {
            continue;
        };
        if !fresh && heap.peek().is_some_and(|next| next.cost < collapse.cost) {
            heap.push(surface.candidate(edge, collapse.cost));
            continue;
        }
        surface.apply(edge, &collapse);
        for neighbour in surface.neighbours(edge[0]) {
            let edge = [edge[0].min(neighbour), edge[0].max(neighbour)];
            if let Some(collapse) = surface.collapse(edge) {
                heap.push(surface.candidate(edge, collapse.cost));
            }
        }
    }
    surface.into_mesh()
}

/// A closed mesh on its way to fewer faces.
struct Surface {
    positions: Vec<DVec3>,
    /// Whether a vertex is still used.
    alive: Vec<bool>,
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
            alive: around.iter().map(|faces| !faces.is_empty()).collect(),
            stamps: vec![0; mesh.positions.len()],
            triangles: mesh.triangles.iter().copied().map(Some).collect(),
            around,
            alive_faces: mesh.triangles.len(),
        }
    }

    fn edges(&self) -> Vec<[u32; 2]> {
        let each = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
        let directed = self.triangles.iter().flatten().flat_map(each);
        // In a closed mesh every edge runs both ways.
        directed.filter(|[a, b]| a < b).collect()
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
    fn collapse(&self, edge: [u32; 2]) -> Option<Collapse> {
        let [a, b] = edge;
        // 1. The surface must stay one: the ends share two neighbours, those across the
        // edge, and these have other faces, too (the link condition; Dey et al. 1999).
        let neighbours_of_b = self.neighbours(b);
        let mut shared = self.neighbours(a);
        shared.retain(|v| neighbours_of_b.binary_search(v).is_ok());
        let apart = shared.iter().all(|v| self.around[*v as usize].len() > 3);
        if shared.len() != 2 || !apart {
            return None;
        }
        // 2. The planes to stay beyond, and the volume added beyond them:
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
        // 3. Least volume + ½·hold·|v − middle|²: the point of the polyhedron that is nearest
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
        // 4. No face may turn over.
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
            if !(normal(corners).dot(normal(new)) > MOST_TURNED) {
                return None;
            }
        }
        let added = (volume_at_middle + gradient.dot(moved)).max(0.0);
        let cost = added + 0.5 * hold * moved.length_squared();
        cost.is_finite().then_some(Collapse { position, cost })
    }

    /// Moves the edge's first vertex to its new place and joins the other to it.
    fn apply(&mut self, edge: [u32; 2], collapse: &Collapse) {
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
        self.alive[b as usize] = false;
        self.positions[a as usize] = collapse.position;
        self.stamps[a as usize] += 1;
        for vertex in self.neighbours(a) {
            self.stamps[vertex as usize] += 1;
        }
    }

    /// What is left, vertices that nothing uses left out.
    fn into_mesh(self) -> Mesh {
        let mut moved_to = vec![u32::MAX; self.positions.len()];
        let mut positions = Vec::new();
        for (i, position) in self.positions.iter().enumerate() {
            if self.alive[i] {
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
