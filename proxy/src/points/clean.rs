//! Points that spoil a desired view's surface.

use super::Node;
use super::chart::Chart;
use super::nearest::Nearest;
use rayon::prelude::*;

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

/// Takes out those that stick out of all their neighbours in the triangulation.
pub(super) fn drop_spikes(chart: &mut Chart) {
    for _ in 0..ROUNDS {
        let of = |(index, node, [least, most]): (usize, Node, [f64; 2])| {
            let own = node.inverse_distance;
            let left = 1.0 - smoothstep(SPIKE, (own / most).max(least / own));
            (index, weighted(node, left))
        };
        let changed: Vec<(usize, Node)> = chart.around().map(of).collect();
        chart.change(changed);
    }
}

/// Takes out those that lie behind what is around them: points of another side of a building, say,
/// that only views from there observe.
pub(super) fn drop_hidden(chart: &mut Chart) {
    let left: Vec<Node> = chart.left().collect();
    let nearest = Nearest::new(&left);
    let of = |(index, node): (usize, Node)| {
        let (mut nearer, mut all) = (0.0, 0.0);
        for (share, other) in nearest.around(&node, NEIGHBOURS) {
            nearer += share * smoothstep(NEARER, other.inverse_distance / node.inverse_distance);
            all += share;
        }
        let left = if all > 0.0 {
            1.0 - smoothstep(HIDING, nearer / all)
        } else {
            1.0
        };
        (index, weighted(node, left))
    };
    let changed: Vec<(usize, Node)> = chart.indexed().into_par_iter().map(of).collect();
    chart.change(changed);
}

/// Brings what is there only in part to where the surface would about be without it.
pub(super) fn fade(chart: &mut Chart) {
    let left: Vec<Node> = chart.left().collect();
    let nearest = Nearest::new(&left);
    let of = |(index, node): (usize, Node)| {
        if node.weight >= 1.0 {
            return (index, node);
        }
        let (mut sum, mut all) = (0.0, 0.0);
        for (share, other) in nearest.around(&node, NEIGHBOURS) {
            sum += share * other.inverse_distance;
            all += share;
        }
        let without = if all > 0.0 {
            sum / all
        } else {
            node.inverse_distance
        };
        let inverse_distance = without + node.weight * (node.inverse_distance - without);
        let faded = Node {
            inverse_distance,
            ..node
        };
        (index, faded)
    };
    let changed: Vec<(usize, Node)> = chart.indexed().into_par_iter().map(of).collect();
    chart.change(changed);
}

/// A node with a part of its weight.
fn weighted(node: Node, left: f64) -> Node {
    Node {
        weight: node.weight * left,
        ..node
    }
}
