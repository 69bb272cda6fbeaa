//! The nodes' triangulation in the chart.

use super::Node;
use glam::DVec2;
use rayon::prelude::*;
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};

/// A vertex of the triangulation.
struct Vertex {
    at: Point2<f64>,
    /// Index of its node.
    index: u32,
}

impl HasPosition for Vertex {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.at
    }
}

impl Vertex {
    fn new(node: &Node, index: usize) -> Self {
        let at = lattice(node);
        Self {
            at: Point2::new(at.x, at.y),
            index: index as u32,
        }
    }
}

/// The chart's lattice: whole numbers keep the triangulation's predicates exact and apart.
const LATTICE: f64 = (1 << 22) as f64;

fn lattice(node: &Node) -> DVec2 {
    (node.chart() * LATTICE).round()
}

/// The first node of each place on the lattice.
pub(super) fn distinct(nodes: Vec<Node>) -> Vec<Node> {
    let place = |(node, index): (&Node, u32)| {
        let at = lattice(node);
        ([at.x as i64, at.y as i64], index)
    };
    let mut places: Vec<([i64; 2], u32)> = nodes.iter().zip(0..).map(place).collect();
    places.par_sort_unstable();
    let mut is_first = vec![true; nodes.len()];
    for pair in places.windows(2) {
        is_first[pair[1].1 as usize] = pair[0].0 != pair[1].0;
    }
    let all = nodes.into_iter().zip(is_first);
    all.filter_map(|(node, is_first)| is_first.then_some(node))
        .collect()
}

/// The Delaunay triangulation of nodes.
pub(super) struct Chart {
    triangulation: DelaunayTriangulation<Vertex>,
}

impl Chart {
    /// Nodes must be [`distinct`]. `None` where they cannot be triangulated.
    pub(super) fn new(nodes: &[Node]) -> Option<Self> {
        let vertices = nodes.iter().enumerate();
        let vertices = vertices.map(|(index, node)| Vertex::new(node, index));
        let triangulation = DelaunayTriangulation::bulk_load_stable(vertices.collect()).ok()?;
        Some(Self { triangulation })
    }

    /// Adds a node, of that index. `None` where it has no place.
    pub(super) fn insert(&mut self, node: &Node, index: usize) -> Option<()> {
        self.triangulation.insert(Vertex::new(node, index)).ok()?;
        Some(())
    }

    /// The triangles, and the sides that have no triangle beyond them, each in its triangle's direction.
    pub(super) fn triangles(&self) -> (Vec<[u32; 3]>, Vec<[u32; 2]>) {
        let faces = self.triangulation.inner_faces();
        let triangles = faces
            .map(|face| face.vertices().map(|v| v.data().index))
            .collect();
        // They come with what is beyond to their left.
        let hull = self.triangulation.convex_hull();
        let rim = hull
            .map(|side| side.rev().vertices().map(|v| v.data().index))
            .collect();
        (triangles, rim)
    }
}
