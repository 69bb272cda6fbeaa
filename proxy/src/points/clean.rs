//! Points that spoil a desired view's surface.

use super::nearest::Nearest;
use super::{Node, delaunay};
use spade::Triangulation;

/// A point sticks out when its inverse distance is beyond that of all its neighbours by
/// this factor.
const SPIKE: f64 = 1.1;
/// Spikes hide behind spikes: the second round finds those.
const ROUNDS: usize = 2;
/// A point is taken to be hidden when this many of its nearest so many neighbours are
/// nearer by this factor.
const HIDING: usize = 6;
const NEIGHBOURS: usize = 12;
const NEARER: f64 = 1.2;

/// The nodes without those that stick out of all their neighbours in the triangulation.
pub(super) fn without_spikes(mut nodes: Vec<Node>) -> Vec<Node> {
    for _ in 0..ROUNDS {
        let Some(triangulation) = delaunay(&nodes) else {
            break;
        };
        let mut keep = vec![true; nodes.len()];
        for vertex in triangulation.vertices() {
            let around = vertex.out_edges().map(|edge| {
                let neighbour = edge.to().data().index;
                nodes[neighbour as usize].inverse_distance
            });
            let (least, most) = around.fold((f64::MAX, 0.0), |(least, most): (f64, f64), s| {
                (least.min(s), most.max(s))
            });
            let own = nodes[vertex.data().index as usize].inverse_distance;
            keep[vertex.data().index as usize] = own <= most * SPIKE && own * SPIKE >= least;
        }
        nodes = only(&nodes, &keep);
    }
    nodes
}

/// The nodes without those that lie behind what is around them: points of another side of
/// a building, say, that only views from there observe.
pub(super) fn without_hidden(nodes: Vec<Node>) -> Vec<Node> {
    let nearest = Nearest::new(&nodes);
    let in_the_open = |node: &Node| {
        // One more than asked for: the nearest is the point itself.
        let around = nearest.of(node.chart(), NEIGHBOURS + 1);
        let limit = NEARER * node.inverse_distance;
        let nearer = around.iter().filter(|(_, n)| n.inverse_distance > limit);
        nearer.count() < HIDING
    };
    let keep: Vec<bool> = nodes.iter().map(in_the_open).collect();
    only(&nodes, &keep)
}

fn only(nodes: &[Node], keep: &[bool]) -> Vec<Node> {
    let kept = nodes.iter().zip(keep).filter(|(_, keep)| **keep);
    kept.map(|(node, _)| *node).collect()
}
