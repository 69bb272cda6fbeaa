//! What one sees of a model's cells: which of them has the first triangle along a ray.

use super::CellId;
use crate::mesh::{Mesh, Model};
use crate::{Hit, MeshKind, Solid};
use glam::DVec3;
use std::collections::HashMap;

/// From one ray to the next around an axis, in radians, so that many are spread evenly: the golden
/// angle, (3 − √5) π.
pub(super) const TURN: f64 = 2.399_963_229_728_653;
/// What is farther from the world's origin is not looked at: squares of it must fit into f32.
const FARTHEST: f64 = 1e15;
/// The place of a triangle that rays do not meet.
const NOT_SEEN: u32 = u32::MAX;

/// Triangles that rays meet, each with the cells that have it.
#[derive(Debug, PartialEq)]
pub(super) struct Seen {
    solid: Solid,
    /// By triangle of the model, which of `solid` it is, where those with the same corners are one; [`NOT_SEEN`] of
    /// others.
    places: Vec<u32>,
    /// By triangle of `solid`, where its cells begin; and where the last one's end.
    begins: Vec<u32>,
    cells: Vec<CellId>,
}

impl Seen {
    /// Of a model's triangles those of its cells, in their order, and others that are of none, but hide
    /// what is behind them.
    pub(super) fn new(model: &Model, by_cell: &[Vec<u32>], others: &[u32]) -> Self {
        let mut is_there = vec![false; model.mesh.triangles.len()];
        for i in by_cell.iter().flatten().chain(others) {
            is_there[*i as usize] = is_in_reach(&model.mesh, *i);
        }
        let mut places = vec![NOT_SEEN; is_there.len()];
        let mut triangles = Vec::new();
        for (i, first) in firsts(&model.mesh, &is_there).into_iter().enumerate() {
            if !is_there[i] {
                continue;
            }
            if first as usize == i {
                places[i] = triangles.len() as u32;
                triangles.push(model.mesh.triangles[i]);
            } else {
                places[i] = places[first as usize];
            }
        }
        let count = triangles.len();
        let mut mesh = Mesh {
            positions: model.mesh.positions.clone(),
            triangles,
        };
        mesh.drop_unused();
        let mut seen = Self {
            solid: Solid::new(MeshKind::Mesh, mesh),
            places,
            begins: vec![0; count + 1],
            cells: Vec::new(),
        };
        seen.regroup(by_cell);
        seen
    }

    /// The same triangles with other cells: those that are in none now hide what is behind them all the same.
    pub(super) fn regroup(&mut self, by_cell: &[Vec<u32>]) {
        // 1. Where each cell's are: what it has twice counts once, and what one of which is in none is in none.
        let mut is_in_none = vec![true; self.places.len()];
        for i in by_cell.iter().flatten() {
            is_in_none[*i as usize] = false;
        }
        let mut is_left_out = vec![false; self.begins.len() - 1];
        for (place, is_in_none) in self.places.iter().zip(is_in_none) {
            if *place != NOT_SEEN && is_in_none {
                is_left_out[*place as usize] = true;
            }
        }
        let listed = by_cell.iter().map(|list| {
            let places = list.iter().map(|i| self.places[*i as usize]);
            let places = places.filter(|place| *place != NOT_SEEN);
            let places = places.map(|place| place as usize);
            let mut places: Vec<usize> = places.filter(|place| !is_left_out[*place]).collect();
            places.sort_unstable();
            places.dedup();
            places
        });
        let by_cell: Vec<Vec<usize>> = listed.collect();
        // 2. How many cells each has; where they begin.
        self.begins.fill(0);
        for place in by_cell.iter().flatten() {
            self.begins[*place + 1] += 1;
        }
        let mut total = 0;
        for begin in &mut self.begins {
            total += *begin;
            *begin = total;
        }
        // 3. Which.
        let mut next = self.begins.clone();
        self.cells.clear();
        self.cells.resize(total as usize, CellId(0));
        for (id, list) in (0..).map(CellId).zip(&by_cell) {
            for place in list {
                self.cells[next[*place] as usize] = id;
                next[*place] += 1;
            }
        }
    }

    /// How far along a ray its first triangle is, in lengths of the ray, and the cells that have that.
    pub(super) fn first(&self, from: DVec3, ray: DVec3) -> Option<(f64, &[CellId])> {
        let hit = self.first_hit(from, ray)?;
        Some((hit.along, self.cells_of(hit.triangle_idx)))
    }

    /// Whether a ray's first triangle turns its back: its corners go round clockwise, as seen from there.
    pub(super) fn is_first_from_behind(&self, from: DVec3, ray: DVec3) -> Option<bool> {
        let hit = self.first_hit(from, ray)?;
        let [a, b, c] = self.solid.mesh().corners(hit.triangle_idx as usize);
        Some((b - a).cross(c - a).dot(ray) > 0.0)
    }

    /// Whether so it is with the cells of any triangle that a ray meets up to there, in lengths of the ray.
    pub(super) fn any_until(
        &self,
        from: DVec3,
        ray: DVec3,
        along: f64,
        is: impl Fn(&[CellId]) -> bool,
    ) -> bool {
        let met = self.solid.own_hits_until(from, ray, along);
        met.into_iter().any(|i| is(self.cells_of(i)))
    }

    /// None from where squares do not fit into f32.
    fn first_hit(&self, from: DVec3, ray: DVec3) -> Option<Hit> {
        let is_in_reach = from.abs().max_element() < FARTHEST;
        is_in_reach.then(|| self.solid.first_hit(from, ray))?
    }

    /// Of one of `solid`'s triangles.
    fn cells_of(&self, triangle_idx: u32) -> &[CellId] {
        let i = triangle_idx as usize;
        let [begin, end] = [i, i + 1].map(|k| self.begins[k] as usize);
        &self.cells[begin..end]
    }
}

/// By triangle, the first that is there and has the same corners, in whatever order: rooms may have a wall between
/// them each for itself.
fn firsts(mesh: &Mesh, is_there: &[bool]) -> Vec<u32> {
    let corners = |i: u32| {
        let mut corners = mesh.corners(i as usize);
        corners.sort_by(|a, b| {
            let by_axis = [0, 1, 2].map(|k| a[k].total_cmp(&b[k]));
            by_axis[0].then(by_axis[1]).then(by_axis[2])
        });
        corners.map(|p| p.to_array().map(f64::to_bits))
    };
    let mut known = HashMap::new();
    let first = |i: u32| match is_there[i as usize] {
        true => *known.entry(corners(i)).or_insert(i),
        false => i,
    };
    (0..mesh.triangles.len() as u32).map(first).collect()
}

fn is_in_reach(mesh: &Mesh, triangle_idx: u32) -> bool {
    let corners = mesh.corners(triangle_idx as usize);
    corners.iter().all(|p| p.abs().max_element() < FARTHEST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cells_have_each_for_itself_is_of_all_of_them() {
        // One triangle three times, the second the other way round; another behind it.
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let positions = [0.0, 0.0, 0.0, 1.0].map(|z| corners.map(|[x, y, _]| [x, y, z]));
        let model = Model {
            mesh: Mesh {
                positions: positions
                    .as_flattened()
                    .iter()
                    .map(|p| DVec3::from_array(*p))
                    .collect(),
                triangles: vec![[0, 1, 2], [4, 3, 5], [6, 7, 8], [9, 10, 11]],
            },
            ..Model::default()
        };
        let eye = DVec3::new(0.2, 0.2, -1.0);
        let [a, b, c] = [0, 1, 2].map(CellId);
        for (by_cell, others, expected) in [
            (vec![vec![0], vec![1], vec![2, 3]], vec![], vec![a, b, c]),
            // Twice in one cell.
            (vec![vec![0, 1], vec![2, 3]], vec![], vec![a, b]),
            // What is in none is drawn for all.
            (vec![vec![0, 3], vec![1]], vec![2], vec![]),
            (vec![vec![0, 3], vec![1]], vec![], vec![a, b]),
        ] {
            let seen = Seen::new(&model, &by_cell, &others);
            let (along, cells) = seen.first(eye, DVec3::Z).unwrap();
            assert_eq!((along, cells), (1.0, &expected[..]));
            for id in expected {
                let is = |cells: &[CellId]| cells.contains(&id);
                assert!(seen.any_until(eye, DVec3::Z, 1.0 + 1e-6, is));
            }
        }
    }
}
