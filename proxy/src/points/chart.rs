//! The nodes' triangulation in the chart.

use super::Node;
use glam::DVec2;
use spade::handles::FixedVertexHandle;
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};
use std::collections::HashSet;

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
pub(super) fn distinct(mut nodes: Vec<Node>) -> Vec<Node> {
    let mut taken = HashSet::with_capacity(nodes.len());
    nodes.retain(|node| {
        let at = lattice(node);
        taken.insert((at.x as i64, at.y as i64))
    });
    nodes
}

/// Nodes, some of which are gone, and the Delaunay triangulation of those left: of nodes that go
/// one by one it is mended around them, not made anew.
pub(super) struct Chart {
    /// Those without any weight are gone.
    nodes: Vec<Node>,
    triangulation: DelaunayTriangulation<Vertex>,
}

impl Chart {
    /// Nodes must be [`distinct`]. `None` where they cannot be triangulated.
    pub(super) fn new(nodes: Vec<Node>) -> Option<Self> {
        let vertices = nodes.iter().enumerate();
        let vertices = vertices.map(|(index, node)| Vertex::new(node, index));
        let triangulation = DelaunayTriangulation::bulk_load_stable(vertices.collect()).ok()?;
        Some(Self {
            nodes,
            triangulation,
        })
    }

    /// The nodes that are not gone.
    pub(super) fn left(&self) -> impl Iterator<Item = Node> {
        self.nodes.iter().copied().filter(|n| n.weight > 0.0)
    }

    /// Changes the nodes left, one after the other; those that have no weight any more are gone.
    pub(super) fn change(&mut self, nodes: impl IntoIterator<Item = (usize, Node)>) {
        for (index, node) in nodes {
            self.nodes[index] = node;
        }
        let is_gone = |index: u32| self.nodes[index as usize].weight <= 0.0;
        let vertices = self.triangulation.vertices();
        let gone = vertices.filter(|v| is_gone(v.data().index));
        let gone: Vec<FixedVertexHandle> = gone.map(|vertex| vertex.fix()).collect();
        // The last takes the place of one that goes, so the last goes first.
        for vertex in gone.into_iter().rev() {
            self.triangulation.remove(vertex);
        }
    }

    /// The nodes left, by index.
    pub(super) fn indexed(&self) -> Vec<(usize, Node)> {
        let nodes = self.nodes.iter().copied().enumerate();
        nodes.filter(|(_, node)| node.weight > 0.0).collect()
    }

    /// Adds a node. `None` where it has no place.
    pub(super) fn insert(&mut self, node: Node) -> Option<()> {
        let vertex = Vertex::new(&node, self.nodes.len());
        self.nodes.push(node);
        self.triangulation.insert(vertex).ok()?;
        Some(())
    }

    /// All nodes, the triangles of those left, and the sides that have no triangle beyond them, each
    /// in its triangle's direction.
    pub(super) fn into_triangles(self) -> (Vec<Node>, Vec<[u32; 3]>, Vec<[u32; 2]>) {
        let faces = self.triangulation.inner_faces();
        let triangles = faces
            .map(|face| face.vertices().map(|v| v.data().index))
            .collect();
        // They come with what is beyond to their left.
        let hull = self.triangulation.convex_hull();
        let rim = hull
            .map(|side| side.rev().vertices().map(|v| v.data().index))
            .collect();
        (self.nodes, triangles, rim)
    }
}
