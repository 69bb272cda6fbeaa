//! What of the model each cell has.

use super::locate::is_loose;
use super::rooms::CELL_NODE;
use super::seen::Seen;
use super::{
    CellId, Content, Interior, InteriorError, InteriorWarning, RoomBox, triangle_touches_box,
};
use crate::mesh::{Mesh, Model, PORTAL_NODE};
use glam::DVec3;
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::sync::Arc;

/// What f32 rounds coordinates by, in shares of the greatest; and how far a box takes in what lies beyond
/// it at most, in shares of its size: far from the origin models may have a frame that keeps their digits.
const ROUNDING: f64 = f32::EPSILON as f64;
const WIDEST: f64 = 1e-5;

/// The triangles of each cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contents {
    /// By [`CellId`](super::CellId), in order; a triangle may be in several cells. One that stands
    /// for an opening (`portal:A|B`) is in none.
    pub triangles: Vec<Vec<u32>>,
    /// By [`CellId`](super::CellId): the cell's box, or what its triangles span; none of a scene.
    pub bounds: Vec<Option<RoomBox>>,
    /// Triangles of no cell, in order: they are drawn whatever is visible. None stands for an
    /// opening.
    pub elsewhere: Vec<u32>,
    /// What a viewer sees of the cells, where bounds do not tell which of them it is in.
    pub(super) seen: Option<Arc<Seen>>,
    /// The sides of portals, by name and cell, before which the cell's triangles are far below.
    pub(super) aloft: BTreeSet<(String, CellId)>,
}

impl Contents {
    /// Finds what is in each cell, and what is odd about it.
    ///
    /// # Errors
    /// A cell shows a node that the model does not have.
    pub fn new(
        interior: &Interior,
        model: &Model,
    ) -> Result<(Self, Vec<InteriorWarning>), InteriorError> {
        let (mut contents, odd) = Self::listed(interior, model)?;
        contents.look_where_shared(interior, model);
        contents.find_aloft(interior, model);
        Ok((contents, odd))
    }

    /// Finds anew what is in some cells whose boxes have changed; as [`Self::new`] would.
    pub(super) fn refill(&mut self, interior: &Interior, model: &Model, ids: &BTreeSet<CellId>) {
        let is_opening = openings(model);
        for id in ids {
            let Some(room) = interior.cell(*id).content.room() else {
                continue;
            };
            let place = id.0 as usize;
            self.triangles[place] = touching(model, &room, &is_opening);
            self.bounds[place] = Some(room);
        }
        self.find_rest(is_opening);
        self.look_where_shared(interior, model);
        self.find_aloft(interior, model);
    }

    fn look_where_shared(&mut self, interior: &Interior, model: &Model) {
        self.seen = self.is_any_bounds_shared(interior).then(|| {
            let seen = Seen::new(model, &self.triangles, &self.elsewhere);
            Arc::new(seen)
        });
    }

    /// What is in no cell, but for what is taken already, by triangle.
    fn find_rest(&mut self, mut is_taken: Vec<bool>) {
        for i in self.triangles.iter().flatten() {
            is_taken[*i as usize] = true;
        }
        let all = 0..is_taken.len() as u32;
        self.elsewhere = all.filter(|i| !is_taken[*i as usize]).collect();
    }

    /// The same without what tells where a viewer is.
    pub(super) fn listed(
        interior: &Interior,
        model: &Model,
    ) -> Result<(Self, Vec<InteriorWarning>), InteriorError> {
        // 1. Cells, without what stands for openings: that is drawn nowhere.
        let is_opening = openings(model);
        let mut contents = Self::default();
        for cell in &interior.cells {
            let triangles = match &cell.content {
                Content::Scene { room: None, .. } => Vec::new(),
                Content::Scene {
                    room: Some(room), ..
                }
                | Content::Box(room) => touching(model, room, &is_opening),
                Content::Nodes(names) => {
                    let known = |name: &String| model.nodes.iter().any(|n| n.name == *name);
                    if let Some(node) = names.iter().find(|name| !known(name)) {
                        return Err(InteriorError::UnknownNode {
                            cell: cell.name.clone(),
                            node: node.clone(),
                            known: nodes_for_cells(model),
                        });
                    }
                    let mut triangles = below(model, |name| names.iter().any(|n| n == name));
                    triangles.retain(|i| !is_opening[*i as usize]);
                    triangles
                }
            };
            let bounds = match &cell.content {
                Content::Nodes(_) => span(model, &triangles),
                content => content.room(),
            };
            contents.triangles.push(triangles);
            contents.bounds.push(bounds);
        }
        // 2. The rest.
        contents.find_rest(is_opening);
        // 3. What is odd.
        let mut odd = Vec::new();
        for (cell, triangles) in interior.cells.iter().zip(&contents.triangles) {
            if triangles.is_empty() && !matches!(cell.content, Content::Scene { room: None, .. }) {
                odd.push(InteriorWarning::Empty(cell.name.clone()));
            }
        }
        if !interior.cells.iter().any(|c| c.content.room().is_some()) {
            // Where boxes tell, reading them did.
            let bounds = contents.bounds.iter().flatten().copied();
            odd.extend(interior.odd_eyes_in(bounds));
        }
        if !contents.elsewhere.is_empty() {
            odd.push(InteriorWarning::Elsewhere(contents.elsewhere.len()));
        }
        Ok((contents, odd))
    }

    /// Whether a cell that is where its triangles are reaches into another's bounds.
    fn is_any_bounds_shared(&self, interior: &Interior) -> bool {
        let cells = interior.cells.iter().zip(&self.bounds);
        let cells = cells.filter_map(|(cell, bounds)| Some((is_loose(cell), (*bounds)?)));
        let cells: Vec<(bool, RoomBox)> = cells.collect();
        cells.iter().enumerate().any(|(i, (is_loose, a))| {
            let mut others = cells[..i].iter();
            others.any(|(is_other_loose, b)| (*is_loose || *is_other_loose) && a.overlaps(b))
        })
    }
}

/// For messages: the nodes of a model that are named as cells are, or where none is, all that have a name; the
/// first few.
fn nodes_for_cells(model: &Model) -> String {
    const FEW: usize = 20;
    let named = model.nodes.iter().map(|node| node.name.as_str());
    let named: BTreeSet<&str> = named.filter(|name| !name.is_empty()).collect();
    let cells = named.iter().filter(|name| name.starts_with(CELL_NODE));
    let mut found: Vec<&str> = cells.copied().collect();
    if found.is_empty() {
        found.extend(named);
    }
    let listed = found[..found.len().min(FEW)].join(", ");
    match found.len() {
        0 => "none with a name".to_owned(),
        count if count > FEW => format!("{listed}, and {} more", count - FEW),
        _ => listed,
    }
}

/// The surface of a model, without what stands for openings: doors are looked for in it.
pub fn surface_of(model: &Model) -> Cow<'_, Mesh> {
    let is_opening = openings(model);
    if !is_opening.contains(&true) {
        return Cow::Borrowed(&model.mesh);
    }
    let triangles = model.mesh.triangles.iter().zip(&is_opening);
    let walls = triangles.filter(|(_, is_opening)| !**is_opening);
    let mut mesh = Mesh {
        positions: model.mesh.positions.clone(),
        triangles: walls.map(|(triangle, _)| *triangle).collect(),
    };
    mesh.drop_unused();
    Cow::Owned(mesh)
}

/// By triangle: whether it stands for an opening.
fn openings(model: &Model) -> Vec<bool> {
    let mut is_opening = vec![false; model.mesh.triangles.len()];
    for i in below(model, |name| name.starts_with(PORTAL_NODE)) {
        is_opening[i as usize] = true;
    }
    is_opening
}

/// The triangles that touch a box, without what stands for openings. Models have f32: what lies in the plane of a
/// side touches it, however that is rounded.
fn touching(model: &Model, room: &RoomBox, is_opening: &[bool]) -> Vec<u32> {
    let farthest = room.min.abs().max(room.max.abs()).max_element();
    let size = (room.max - room.min).max_element();
    let margin = (ROUNDING * farthest).min(WIDEST * size);
    let room = RoomBox {
        min: room.min - margin,
        max: room.max + margin,
    };
    let is_in = |i: &u32| {
        let idx = *i as usize;
        triangle_touches_box(model.mesh.corners(idx), &room) && !is_opening[idx]
    };
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interior::{Cell, Extra};
    use crate::mesh::{ModelNode, Part};

    /// A cell's floor, and below its node an opening beside it, which reaches farther.
    fn with_opening() -> Model {
        let node = |name: &str, parent_idx| ModelNode {
            name: name.to_owned(),
            parent_idx,
        };
        let part = |i: u32| Part {
            triangles: i..i + 1,
            node_idx: i,
            material_idx: 0,
        };
        let corners = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 0.0],
            [1.0, 2.0, 0.0],
            [1.0, 2.0, 1.0],
        ];
        Model {
            mesh: Mesh {
                positions: corners.map(DVec3::from_array).to_vec(),
                triangles: vec![[0, 1, 2], [3, 4, 5]],
            },
            parts: vec![part(0), part(1)],
            nodes: vec![node("cell:a", None), node("portal:a|", Some(0))],
            ..Model::default()
        }
    }

    #[test]
    fn what_stands_for_an_opening_is_in_no_cell() {
        let model = with_opening();
        let room = RoomBox {
            min: DVec3::splat(-1.0),
            max: DVec3::splat(3.0),
        };
        let seen = |triangles: &[u32]| span(&model, triangles).unwrap();
        let scene = Content::Scene {
            folder: "hall".to_owned(),
            room: Some(room),
        };
        for (content, bounds) in [
            (Content::Nodes(vec!["cell:a".to_owned()]), seen(&[0])),
            (Content::Box(room), room),
            (scene, room),
        ] {
            let interior = Interior {
                model: None,
                up: DVec3::Y,
                eye_height: 1.6,
                cells: vec![Cell {
                    name: "a".to_owned(),
                    content,
                    floor: None,
                    other: Extra::new(),
                }],
                portals: Vec::new(),
                held_out: Vec::new(),
                other: Extra::new(),
            };
            let (contents, odd) = Contents::new(&interior, &model).unwrap();
            assert_eq!(contents.triangles, [[0]]);
            assert_eq!(contents.bounds, [Some(bounds)]);
            assert_eq!((contents.elsewhere.len(), odd.len()), (0, 0));
        }
    }

    #[test]
    fn a_wall_where_boxes_meet_is_in_both_cells_however_f32_rounds_its_plane() {
        // As f32 the first is less, the second more.
        for side in [4.1_f64, 4.3] {
            let x = f64::from(side as f32);
            let corners = [[x, 0.0, 0.0], [x, 2.5, 0.0], [x, 0.0, 3.0]];
            let model = Model {
                mesh: Mesh {
                    positions: corners.map(DVec3::from_array).to_vec(),
                    triangles: vec![[0, 1, 2]],
                },
                ..Model::default()
            };
            let room = |from: f64, to: f64| RoomBox {
                min: DVec3::new(from, 0.0, 0.0),
                max: DVec3::new(to, 2.5, 3.0),
            };
            for (from, to, count) in [(0.0, side, 1), (side, 8.0, 1), (side + 1e-5, 8.0, 0)] {
                let found = touching(&model, &room(from, to), &[false]);
                assert_eq!(found.len(), count, "{from} to {to}");
            }
        }
    }

    #[test]
    fn what_is_filled_anew_is_as_if_found_at_first() {
        let model = with_opening();
        let cell = |name: &str, min: f64, max: f64| Cell {
            name: name.to_owned(),
            content: Content::Box(RoomBox {
                min: DVec3::splat(min),
                max: DVec3::splat(max),
            }),
            floor: None,
            other: Extra::new(),
        };
        let mut interior = Interior {
            model: None,
            up: DVec3::Y,
            eye_height: 1.6,
            cells: vec![cell("a", 5.0, 6.0), cell("b", -1.0, 3.0)],
            portals: Vec::new(),
            held_out: Vec::new(),
            other: Extra::new(),
        };
        let (mut contents, _) = Contents::new(&interior, &model).unwrap();
        let mut seen = Seen::new(&model, &contents.triangles, &contents.elsewhere);
        // Both cells have the triangle; then only the first; then none.
        for (a, b) in [(-1.0, -1.0), (-1.0, 2.0), (5.0, 2.0)] {
            interior.cells = vec![cell("a", a, 6.0), cell("b", b, 3.0)];
            contents.refill(&interior, &model, &[0, 1].map(CellId).into());
            let (expected, _) = Contents::new(&interior, &model).unwrap();
            assert_eq!(contents, expected);
            seen.regroup(&contents.triangles);
            let anew = Seen::new(&model, &expected.triangles, &expected.elsewhere);
            assert_eq!(seen, anew);
            let (_, cells) = seen.first(DVec3::new(0.2, 1.0, 0.2), -DVec3::Y).unwrap();
            let ids = [(0, a), (1, b)].map(|(id, low)| (low < 0.0).then_some(CellId(id)));
            assert_eq!(cells, ids.into_iter().flatten().collect::<Vec<CellId>>());
        }
    }

    #[test]
    fn a_surface_has_no_openings() {
        let model = with_opening();
        let surface = surface_of(&model);
        assert_eq!(surface.triangles, [[0, 1, 2]]);
        assert_eq!(surface.positions, model.mesh.positions[..3]);
        // Without any it is the model's own.
        let mut plain = with_opening();
        plain.nodes[1].name = "door".to_owned();
        assert!(matches!(surface_of(&plain), Cow::Borrowed(_)));
    }
}
