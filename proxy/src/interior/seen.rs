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

/// Triangles that rays meet, each with the cells that have it.
#[derive(Debug, PartialEq)]
pub(super) struct Seen {
    solid: Solid,
    /// By triangle of `solid`, where its cells begin; and where the last one's end.
    begins: Vec<u32>,
    cells: Vec<CellId>,
}

impl Seen {
    /// Of a model's triangles those of its cells, in their order, and others that are of none, but hide
    /// what is behind them.
    pub(super) fn new(model: &Model, by_cell: &[Vec<u32>], others: &[u32]) -> Self {
        let all = in_reach(model, by_cell, others);
        let triangles = all.chunk_by(|a, b| a.0 == b.0);
        let triangles = triangles.map(|same| model.mesh.triangles[same[0].0 as usize]);
        let mut mesh = Mesh {
            positions: model.mesh.positions.clone(),
            triangles: triangles.collect(),
        };
        mesh.drop_unused();
        let mut seen = Self {
            solid: Solid::new(MeshKind::Mesh, mesh),
            begins: Vec::new(),
            cells: Vec::new(),
        };
        seen.share_out(&all);
        seen
    }

    /// The same triangles with other cells: all of `others` that have one now, and the other way round.
    pub(super) fn regroup(&mut self, model: &Model, by_cell: &[Vec<u32>], others: &[u32]) {
        self.share_out(&in_reach(model, by_cell, others));
    }

    fn share_out(&mut self, all: &[(u32, Option<CellId>)]) {
        self.begins = vec![0];
        self.cells.clear();
        for same in all.chunk_by(|a, b| a.0 == b.0) {
            self.cells.extend(same.iter().filter_map(|(_, id)| *id));
            self.begins.push(self.cells.len() as u32);
        }
    }

    /// How far along a ray its first triangle is, in lengths of the ray, and the cells that have that.
    pub(super) fn first(&self, from: DVec3, ray: DVec3) -> Option<(f64, &[CellId])> {
        if !(from.abs().max_element() < FARTHEST) {
            return None;
        }
        let hit = self.solid.first_hit(from, ray)?;
        let i = hit.triangle_idx as usize;
        let [begin, end] = [i, i + 1].map(|k| self.begins[k] as usize);
        Some((hit.along, &self.cells[begin..end]))
    }
}

/// Triangles that rays may meet, in order, with each cell that has them.
fn in_reach(model: &Model, by_cell: &[Vec<u32>], others: &[u32]) -> Vec<(u32, Option<CellId>)> {
    let is_in_reach = |i: u32| {
        let corners = model.mesh.corners(i as usize);
        corners.iter().all(|p| p.abs().max_element() < FARTHEST)
    };
    let ids = (0..).map(|i| Some(CellId(i)));
    let of_cells = ids.zip(by_cell);
    let of_cells = of_cells.flat_map(|(id, list)| list.iter().map(move |i| (*i, id)));
    let of_none = others.iter().map(|i| (*i, None));
    let all = of_cells.chain(of_none).filter(|(i, _)| is_in_reach(*i));
    let mut all: Vec<(u32, Option<CellId>)> = all.collect();
    all.sort_unstable();
    all
}
