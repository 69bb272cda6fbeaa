//! What one sees of a model's cells: which of them has the first triangle along a ray.

use super::CellId;
use crate::mesh::{Mesh, Model};
use crate::{MeshKind, Solid};
use glam::DVec3;

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
    /// By triangle of the model, which of `solid` it is; [`NOT_SEEN`] of others.
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
        let mut count = 0;
        let mut place = |is_there: bool| {
            count += u32::from(is_there);
            if is_there { count - 1 } else { NOT_SEEN }
        };
        let places: Vec<u32> = is_there.iter().map(|is| place(*is)).collect();
        let triangles = model.mesh.triangles.iter().zip(&is_there);
        let triangles = triangles.filter(|(_, is_there)| **is_there);
        let mut mesh = Mesh {
            positions: model.mesh.positions.clone(),
            triangles: triangles.map(|(triangle, _)| *triangle).collect(),
        };
        mesh.drop_unused();
        let mut seen = Self {
            solid: Solid::new(MeshKind::Mesh, mesh),
            places,
            begins: vec![0; count as usize + 1],
            cells: Vec::new(),
        };
        seen.regroup(by_cell);
        seen
    }

    /// The same triangles with other cells: those that are in none now hide what is behind them all the same.
    pub(super) fn regroup(&mut self, by_cell: &[Vec<u32>]) {
        let listed = by_cell.iter().map(|list| {
            let places = list.iter().map(|i| self.places[*i as usize]);
            let places = places.filter(|place| *place != NOT_SEEN);
            places.map(|place| place as usize).collect()
        });
        let by_cell: Vec<Vec<usize>> = listed.collect();
        // 1. How many cells each has; where they begin.
        self.begins.fill(0);
        for place in by_cell.iter().flatten() {
            self.begins[*place + 1] += 1;
        }
        let mut total = 0;
        for begin in &mut self.begins {
            total += *begin;
            *begin = total;
        }
        // 2. Which.
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
        if !(from.abs().max_element() < FARTHEST) {
            return None;
        }
        let hit = self.solid.first_hit(from, ray)?;
        Some((hit.along, self.cells_of(hit.triangle_idx)))
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

    /// Of one of `solid`'s triangles.
    fn cells_of(&self, triangle_idx: u32) -> &[CellId] {
        let i = triangle_idx as usize;
        let [begin, end] = [i, i + 1].map(|k| self.begins[k] as usize);
        &self.cells[begin..end]
    }
}

fn is_in_reach(mesh: &Mesh, triangle_idx: u32) -> bool {
    let corners = mesh.corners(triangle_idx as usize);
    corners.iter().all(|p| p.abs().max_element() < FARTHEST)
}
