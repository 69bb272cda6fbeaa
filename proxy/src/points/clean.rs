//! Points that spoil a desired view's surface.

use super::nearest::Nearest;
use super::{Node, delaunay};
use spade::Triangulation;

/// A point sticks out when its inverse distance is beyond that of all its neighbours by
/// this factor; it is gone at the second.
const SPIKE: [f64; 2] = [1.08, 1.12];
/// Spikes hide behind spikes: the second round finds those.
const ROUNDS: usize = 2;
/// A point is taken to be hidden when so large a share of its nearest so many neighbours is nearer
/// by about this factor: from the first number on in part, at the second altogether.
const NEIGHBOURS: usize = 12;
const HIDING: [f64; 2] = [0.28, 0.48];
const NEARER: [f64; 2] = [1.15, 1.25];

/// 0 up to the first number, 1 from the second on, smooth between.
fn smoothstep([from, to]: [f64; 2], value: f64) -> f64 {
    let s = ((value - from) / (to - from)).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

/// The nodes without those that stick out of all their neighbours in the triangulation.
pub(super) fn without_spikes(mut nodes: Vec<Node>) -> Vec<Node> {
    for _ in 0..ROUNDS {
        let Some(triangulation) = delaunay(&nodes) else {
            break;
        };
        let mut left = vec![1.0; nodes.len()];
        for vertex in triangulation.vertices() {
            let around = vertex.out_edges().map(|edge| {
                let neighbour = edge.to().data().index;
                nodes[neighbour as usize].inverse_distance
            });
            let (least, most) = around.fold((f64::MAX, 0.0), |(least, most): (f64, f64), s| {
                (least.min(s), most.max(s))
            });
            let index = vertex.data().index as usize;
            let own = nodes[index].inverse_distance;
            left[index] = 1.0 - smoothstep(SPIKE, (own / most).max(least / own));
        }
        nodes = weighted(nodes, &left);
    }
    nodes
}

/// The nodes without those that lie behind what is around them: points of another side of
/// a building, say, that only views from there observe.
pub(super) fn without_hidden(nodes: Vec<Node>) -> Vec<Node> {
    let nearest = Nearest::new(&nodes);
    let in_the_open = |node: &Node| {
        let (mut nearer, mut all) = (0.0, 0.0);
        for (share, other) in nearest.around(node, NEIGHBOURS) {
            nearer += share * smoothstep(NEARER, other.inverse_distance / node.inverse_distance);
            all += share;
        }
        if all > 0.0 {
            1.0 - smoothstep(HIDING, nearer / all)
        } else {
            1.0
        }
    };
    let left: Vec<f64> = nodes.iter().map(in_the_open).collect();
    weighted(nodes, &left)
}

/// Brings what is there only in part to where the surface would about be without it.
pub(super) fn faded(nodes: Vec<Node>) -> Vec<Node> {
    let nearest = Nearest::new(&nodes);
    let of = |node: &Node| {
        if node.weight >= 1.0 {
            return *node;
        }
        let (mut sum, mut all) = (0.0, 0.0);
        for (share, other) in nearest.around(node, NEIGHBOURS) {
            sum += share * other.inverse_distance;
            all += share;
        }
        let without = if all > 0.0 {
            sum / all
        } else {
            node.inverse_distance
        };
        Node {
            inverse_distance: without + node.weight * (node.inverse_distance - without),
            ..*node
        }
    };
    nodes.iter().map(of).collect()
}

/// The nodes with a part of their weights; those that have none left are gone.
fn weighted(mut nodes: Vec<Node>, left: &[f64]) -> Vec<Node> {
    nodes
        .iter_mut()
        .zip(left)
        .for_each(|(node, left)| node.weight *= left);
    nodes.retain(|node| node.weight > 0.0);
    nodes
}
