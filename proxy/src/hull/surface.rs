//! The surface through the finest cells: marching cubes (Lorensen and Cline 1987).
//!
//! All cells that the surface crosses are of one level, so there are no cracks to close. A
//! vertex lies on an edge of the lattice whose ends are on different sides. On a face of a
//! cell with two corners inside that are not neighbours, these are kept apart, as both cells
//! at the face see it: the surface closes, and as every vertex lies within four cells, each
//! with one polygon through it, no vertex or edge is shared by more than it should be.

use super::octree::{Level, bits};
use super::witness::Witness;
use crate::Mesh;
use glam::{DVec3, UVec3};
use rayon::prelude::*;

/// Steps of the search for the surface along an edge, by Illinois' false position.
const STEPS: usize = 6;
/// Vertices keep so much of an edge's length away from its ends, or faces would vanish.
const CLEAR: f64 = 0.02;

/// The surface between the points of positive and of negative depth. Closed, winding
/// counter-clockwise as seen from outside.
pub(super) fn extract(level: &Level, witnesses: &[Witness]) -> Mesh {
    // 1. On which side is each corner?
    let cells = &level.cells;
    let corner_keys = (0..cells.len() * 8)
        .into_par_iter()
        .map(|slot| key(cells[slot / 8].at + bits((slot % 8) as u32)));
    let corners = Shared::new(corner_keys.collect());
    let depths_px: Vec<f64> = corners
        .firsts
        .par_iter()
        .map(|slot| {
            let cell = &cells[*slot as usize / 8];
            let at = cell.at + bits(slot % 8);
            level.depth_px(cell, witnesses, level.corner(at))
        })
        .collect();
    let depth_of =
        |cell: usize, corner: u32| depths_px[corners.of[8 * cell + corner as usize] as usize];
    let configurations: Vec<u8> = (0..cells.len())
        .into_par_iter()
        .map(|cell| {
            (0..8)
                .filter(|corner| depth_of(cell, *corner) > 0.0)
                .fold(0, |all, corner| all | 1 << corner)
        })
        .collect();

    // 2. A vertex on each edge that the surface crosses.
    let crossed: Vec<(u32, u8)> = configurations
        .iter()
        .enumerate()
        .flat_map(|(cell, inside)| {
            (0..12)
                .filter(|edge| crosses(*edge, *inside))
                .map(move |edge| (cell as u32, edge))
        })
        .collect();
    let edge_key = |(cell, edge): &(u32, u8)| {
        let (low, _) = ends(*edge);
        key(cells[*cell as usize].at + bits(low)) << 2 | u64::from(edge / 4)
    };
    let vertices = Shared::new(crossed.par_iter().map(edge_key).collect());
    let mut positions: Vec<DVec3> = vertices
        .firsts
        .par_iter()
        .map(|slot| {
            let (cell, edge) = crossed[*slot as usize];
            let (low, high) = ends(edge);
            let at = cells[cell as usize].at;
            let [a, b] = [low, high].map(|c| level.corner(at + bits(c)));
            let depth = |t: f64| level.depth_px(&cells[cell as usize], witnesses, a.lerp(b, t));
            let [da, db] = [low, high].map(|c| depth_of(cell as usize, c));
            a.lerp(b, crossing(da, db, depth).clamp(CLEAR, 1.0 - CLEAR))
        })
        .collect();

    // 3. The polygons of each cell, as triangles.
    let table = Table::new();
    let mut triangles = Vec::new();
    let mut slot = 0;
    for inside in configurations {
        let mut vertex_of = [0_u32; 12];
        for edge in (0..12).filter(|edge| crosses(*edge, inside)) {
            vertex_of[usize::from(edge)] = vertices.of[slot];
            slot += 1;
        }
        for polygon in &table.0[usize::from(inside)] {
            let around: Vec<u32> = polygon
                .edges
                .iter()
                .map(|edge| vertex_of[usize::from(*edge)])
                .collect();
            if polygon.fan {
                let pairs = around[1..].windows(2);
                triangles.extend(pairs.map(|pair| [around[0], pair[0], pair[1]]));
                continue;
            }
            let middle = positions.len() as u32;
            let sum: DVec3 = around.iter().map(|i| positions[*i as usize]).sum();
            positions.push(sum / around.len() as f64);
            let next = around.iter().cycle().skip(1);
            triangles.extend(around.iter().zip(next).map(|(a, b)| [middle, *a, *b]));
        }
    }
    Mesh {
        positions,
        triangles,
    }
}

/// Where on [0, 1] a function with these values at the ends, of different signs, is zero.
fn crossing(at_0: f64, at_1: f64, value: impl Fn(f64) -> f64) -> f64 {
    // What photos don't see has no slope.
    let bounded = |v: f64| v.clamp(-4.0, 4.0);
    let (mut a, mut va) = (0.0, bounded(at_0));
    let (mut b, mut vb) = (1.0, bounded(at_1));
    for _ in 0..STEPS {
        let t = (a * vb - b * va) / (vb - va);
        let v = bounded(value(t));
        if v.abs() < 1e-3 {
            return t;
        }
        if (v > 0.0) == (vb > 0.0) {
            (b, vb) = (t, v);
            va *= 0.5;
        } else {
            (a, va) = (t, v);
            vb *= 0.5;
        }
    }
    (a * vb - b * va) / (vb - va)
}

/// Equal keys found in many places, and the places that have the same.
struct Shared {
    /// For each place, which of the different keys it has.
    of: Vec<u32>,
    /// For each different key, in order, the first place that has it.
    firsts: Vec<u32>,
}

impl Shared {
    fn new(keys: Vec<u64>) -> Self {
        let mut sorted: Vec<(u64, u32)> = keys.into_iter().zip(0..).collect();
        sorted.par_sort_unstable();
        let mut of = vec![0; sorted.len()];
        let mut firsts = Vec::new();
        let mut last = None;
        for (key, place) in sorted {
            if last != Some(key) {
                firsts.push(place);
                last = Some(key);
            }
            of[place as usize] = firsts.len() as u32 - 1;
        }
        Self { of, firsts }
    }
}

/// A corner of the lattice as a number; 20 bits a coordinate.
fn key(at: UVec3) -> u64 {
    u64::from(at.z) << 40 | u64::from(at.y) << 20 | u64::from(at.x)
}

/// The corners at an edge's ends, the lower first. Edges 0 to 3 lie along x, 4 to 7 along y,
/// 8 to 11 along z.
fn ends(edge: u8) -> (u32, u32) {
    let (axis, i) = (u32::from(edge / 4), u32::from(edge % 4));
    // The two bits of i are the corner's on the other two axes.
    let low = match axis {
        0 => i << 1,
        1 => (i & 1) | (i & 2) << 1,
        _ => i,
    };
    (low, low | 1 << axis)
}

fn crosses(edge: u8, inside: u8) -> bool {
    let (low, high) = ends(edge);
    (inside >> low & 1) != (inside >> high & 1)
}

/// For each set of corners inside, the polygons that part them from the others.
struct Table(Vec<Vec<Polygon>>);

struct Polygon {
    /// The edges whose vertices it joins, counter-clockwise from outside.
    edges: Vec<u8>,
    /// Whether it can be cut into a fan around its first vertex without an edge on a face of
    /// the cell, where the cell beyond might have the same one.
    fan: bool,
}

impl Table {
    fn new() -> Self {
        Self((0..=255_u8).map(polygons).collect())
    }
}

fn polygons(inside: u8) -> Vec<Polygon> {
    // 1. Around each face, counter-clockwise from outside the cell, every run of corners
    // inside is cut off by a line from the edge where it begins to the one where it ends.
    // An edge begins a run on one of its faces and ends one on the other.
    let mut next: [Option<u8>; 12] = [None; 12];
    for face in faces() {
        let edge_at = |i: usize| edge_between(face[i % 4], face[(i + 1) % 4]);
        let is_inside = |i: usize| inside >> face[i % 4] & 1 == 1;
        for begin in 0..4 {
            if is_inside(begin) || !is_inside(begin + 1) {
                continue;
            }
            let end = (begin + 1..begin + 4).find(|i| !is_inside(i + 1));
            next[usize::from(edge_at(begin))] = end.map(edge_at);
        }
    }
    // 2. The lines join to polygons.
    let mut found = Vec::new();
    for first in 0..12 {
        let mut edges = Vec::new();
        let mut edge = first;
        while let Some(then) = next[usize::from(edge)].take() {
            edges.push(edge);
            edge = then;
        }
        if edges.is_empty() {
            continue;
        }
        let count = edges.len();
        let start = (0..count).find(|start| {
            (2..count - 1).all(|k| !share_face(edges[*start], edges[(start + k) % count]))
        });
        edges.rotate_left(start.unwrap_or(0));
        found.push(Polygon {
            edges,
            fan: start.is_some(),
        });
    }
    found
}

/// The corners of each face, counter-clockwise as seen from outside the cell.
fn faces() -> [[u32; 4]; 6] {
    [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ]
}

fn edge_between(a: u32, b: u32) -> u8 {
    (0..12)
        .find(|edge| ends(*edge) == (a.min(b), a.max(b)))
        .unwrap_or(0)
}

fn share_face(a: u8, b: u8) -> bool {
    faces().iter().any(|face| {
        [a, b].iter().all(|edge| {
            let (low, high) = ends(*edge);
            face.contains(&low) && face.contains(&high)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every line of a polygon on a face is drawn the other way round by the cell beyond,
    /// which has the same corners there.
    #[test]
    fn polygons_of_neighbouring_cells_fit() {
        for inside in 0..=255_u8 {
            let lines = polygons(inside);
            let edges: Vec<u8> = lines.iter().flat_map(|p| p.edges.clone()).collect();
            let crossed: Vec<u8> = (0..12).filter(|e| crosses(*e, inside)).collect();
            let mut sorted = edges.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, crossed, "{inside:08b}");
            for polygon in &lines {
                assert!(polygon.edges.len() >= 3, "{inside:08b}");
            }
        }
    }

    #[test]
    fn a_corner_inside_is_wrapped_outwards() {
        let one = &polygons(1)[0];
        let at = |edge: u8| {
            let (low, high) = ends(edge);
            0.5 * (bits(low) + bits(high)).as_dvec3()
        };
        let [a, b, c] = [0, 1, 2].map(|i| at(one.edges[i]));
        assert!((b - a).cross(c - a).dot(DVec3::ONE) > 0.0);
    }
}
