//! What of the model each cell has.

use super::{Content, Interior, InteriorError, InteriorWarning, RoomBox, triangle_touches_box};
use crate::mesh::Model;
use glam::DVec3;
use rayon::prelude::*;

/// The triangles of each cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contents {
    /// By [`CellId`](super::CellId), in order; a triangle may be in several cells.
    pub triangles: Vec<Vec<u32>>,
    /// By [`CellId`](super::CellId): the cell's box, or what its triangles span; none of a scene.
    pub bounds: Vec<Option<RoomBox>>,
    /// Triangles of no cell, in order: they are drawn whatever is visible.
    pub elsewhere: Vec<u32>,
}

/// What the names of nodes begin with that stand for openings, and are not drawn.
pub(super) const PORTAL_NODE: &str = "portal:";

impl Contents {
    /// Finds what is in each cell, and what is odd about it.
    ///
    /// # Errors
    /// A cell shows a node that the model does not have.
    pub fn new(
        interior: &Interior,
        model: &Model,
    ) -> Result<(Self, Vec<InteriorWarning>), InteriorError> {
        // 1. Cells.
        let mut contents = Self::default();
        for cell in &interior.cells {
            let (triangles, bounds) = match &cell.content {
                Content::Scene { room: None, .. } => (Vec::new(), None),
                Content::Scene {
                    room: Some(room), ..
                }
                | Content::Box(room) => (touching(model, room), Some(*room)),
                Content::Nodes(names) => {
                    let known = |name: &String| model.nodes.iter().any(|n| n.name == *name);
                    if let Some(node) = names.iter().find(|name| !known(name)) {
                        return Err(InteriorError::UnknownNode {
                            cell: cell.name.clone(),
                            node: node.clone(),
                        });
                    }
                    let triangles = below(model, |name| names.iter().any(|n| n == name));
                    let bounds = span(model, &triangles);
                    (triangles, bounds)
                }
            };
            contents.triangles.push(triangles);
            contents.bounds.push(bounds);
        }
        // 2. The rest.
        let mut is_taken = vec![false; model.mesh.triangles.len()];
        let openings = below(model, |name| name.starts_with(PORTAL_NODE));
        for i in contents.triangles.iter().flatten().chain(&openings) {
            is_taken[*i as usize] = true;
        }
        let all = 0..model.mesh.triangles.len() as u32;
        contents.elsewhere = all.filter(|i| !is_taken[*i as usize]).collect();
        // 3. What is odd.
        let mut odd = Vec::new();
        for (cell, triangles) in interior.cells.iter().zip(&contents.triangles) {
            if triangles.is_empty() && !matches!(cell.content, Content::Scene { room: None, .. }) {
                odd.push(InteriorWarning::Empty(cell.name.clone()));
            }
        }
        if !contents.elsewhere.is_empty() {
            odd.push(InteriorWarning::Elsewhere(contents.elsewhere.len()));
        }
        Ok((contents, odd))
    }
}

fn touching(model: &Model, room: &RoomBox) -> Vec<u32> {
    let is_in = |i: &u32| triangle_touches_box(model.mesh.corners(*i as usize), room);
    let all = 0..model.mesh.triangles.len() as u32;
    all.into_par_iter().filter(is_in).collect()
}

/// The triangles of nodes of some names, and of all below them.
pub(super) fn below(model: &Model, is_meant: impl Fn(&str) -> bool) -> Vec<u32> {
    // Parents come first.
    let mut is_below = Vec::with_capacity(model.nodes.len());
    for node in &model.nodes {
        let above = node.parent_idx.and_then(|p| is_below.get(p as usize));
        is_below.push(above == Some(&true) || is_meant(&node.name));
    }
    let parts = model.parts.iter();
    let meant = parts.filter(|part| is_below.get(part.node_idx as usize) == Some(&true));
    meant.flat_map(|part| part.triangles.clone()).collect()
}

fn span(model: &Model, triangles: &[u32]) -> Option<RoomBox> {
    let corners = triangles
        .iter()
        .flat_map(|i| model.mesh.corners(*i as usize));
    let all = |(low, high): (DVec3, DVec3), p: DVec3| (low.min(p), high.max(p));
    let (min, max) = corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), all);
    min.is_finite().then_some(RoomBox { min, max })
}
