//! Points that spoil a desired view's surface.
//!
//! All that is asked of neighbours is asked in shares that fall with their weights, to nothing:
//! many points may come into sight at once that hardly count yet.

use super::Node;
use super::nearest::{Nearest, Neighbour};
use glam::{DMat2, DVec2};

/// What the shares of a point's neighbours add up to, as far as there are enough of them.
const NEIGHBOURS: f64 = 8.0;
/// A point sticks out of its neighbours when its inverse distance is beyond theirs by this factor; by
/// the second of all but so large a share of them it is gone.
const SPIKE: [f64; 2] = [1.08, 1.12];
const ALONE: f64 = 0.02;
/// A point is taken to be hidden when so large a share of its neighbours is nearer by about this factor:
/// from the first number on in part, at the second altogether.
const HIDING: [f64; 2] = [0.28, 0.48];
const NEARER: [f64; 2] = [1.15, 1.25];
/// How much a slope between neighbours must be worth, beside how they are spread.
const FLAT: f64 = 0.05;
/// As far as a slope goes beyond what it is of.
const BEYOND: f64 = 2.0;

/// 0 up to the first number, 1 from the second on, smooth between.
fn smoothstep([from, to]: [f64; 2], value: f64) -> f64 {
    let s = ((value - from) / (to - from)).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

/// Without those that stick out of all their neighbours, and those that lie behind what is around
/// them: points of another side of a building, say, that only views from there observe.
pub(super) fn without_odd(nodes: &[Node]) -> Vec<Node> {
    let nearest = Nearest::new(nodes);
    let mut left = nearest.changed(|node, asked| {
        // Among those that count as much: what counts little is not measured by what counts more.
        let near = nearest.around(node.chart(), node.weight, NEIGHBOURS, asked);
        Node {
            weight: node.weight * evenness(&node, nodes, near),
            ..node
        }
    });
    left.retain(|node| node.weight > 0.0);
    left
}

/// How much a point, 0…1, is where its neighbours let it be.
fn evenness(node: &Node, nodes: &[Node], near: impl Iterator<Item = Neighbour>) -> f64 {
    let own = node.inverse_distance;
    let (mut all, mut as_near, mut as_far, mut hiding) = (0.0, 0.0, 0.0, 0.0);
    for Neighbour { index, share, .. } in near {
        let ratio = nodes[index].inverse_distance / own;
        all += share;
        as_near += share * (1.0 - smoothstep(SPIKE, 1.0 / ratio));
        as_far += share * (1.0 - smoothstep(SPIKE, ratio));
        hiding += share * smoothstep(NEARER, ratio);
    }
    if !(all > 0.0) {
        return 1.0;
    }
    let [as_near, as_far] = [as_near, as_far].map(|like| (like / (ALONE * all)).min(1.0));
    as_near * as_far * (1.0 - smoothstep(HIDING, hiding / all))
}

/// Brings what is there only in part to where the surface would about be without it. `nearest` is of the nodes.
pub(super) fn faded(nodes: &[Node], nearest: &Nearest<'_>) -> Vec<Node> {
    nearest.changed(|node, asked| {
        if node.weight >= 1.0 {
            return node;
        }
        let near: Vec<_> = nearest
            .around(node.chart(), 1.0, NEIGHBOURS, asked)
            .collect();
        let without = without(nodes, &near).unwrap_or(node.inverse_distance);
        let inverse_distance = without + node.weight * (node.inverse_distance - without);
        Node {
            inverse_distance,
            ..node
        }
    })
}

/// The inverse distance at a place of the plane that fits its neighbours best.
fn without(nodes: &[Node], near: &[Neighbour]) -> Option<f64> {
    let inverse_distance = |near: &Neighbour| nodes[near.index].inverse_distance;
    // 1. Their mean.
    let (mut all, mut mean, mut middle) = (0.0, 0.0, DVec2::ZERO);
    for near in near {
        all += near.share;
        mean += near.share * inverse_distance(near);
        middle += near.share * near.offset;
    }
    if !(all > 0.0) {
        return None;
    }
    (mean, middle) = (mean / all, middle / all);
    // 2. The slope, less where they are about in line.
    let (mut spread, mut slope) = (DMat2::ZERO, DVec2::ZERO);
    for near in near {
        let off = near.offset - middle;
        spread += near.share * DMat2::from_cols(off.x * off, off.y * off);
        slope += near.share * (inverse_distance(near) - mean) * off;
    }
    let flat = FLAT * (spread.x_axis.x + spread.y_axis.y);
    if !(flat > 0.0) {
        return Some(mean);
    }
    let slope = (spread + DMat2::from_diagonal(DVec2::splat(flat))).inverse() * slope;
    let here = mean - slope.dot(middle);
    Some(here.clamp(mean / BEYOND, mean * BEYOND))
}
