//! Neighbours in the chart.

use super::Node;
use glam::DVec2;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::num::NonZero;

/// The nodes by their place in the chart.
pub(super) struct Nearest<'a> {
    nodes: &'a [Node],
    tree: Option<ImmutableKdTree<f64, 2>>,
}

impl<'a> Nearest<'a> {
    pub(super) fn new(nodes: &'a [Node]) -> Self {
        let at: Vec<[f64; 2]> = nodes.iter().map(|n| n.chart().to_array()).collect();
        let tree = ImmutableKdTree::new_from_slice(&at).ok();
        Self { nodes, tree }
    }

    /// The `count` nodes nearest to a place, each with its squared distance; fewer where
    /// there are fewer.
    pub(super) fn of(&self, at: DVec2, count: usize) -> Vec<(f64, &'a Node)> {
        let wanted = NonZero::new(count.min(self.nodes.len()));
        let (Some(tree), Some(wanted)) = (&self.tree, wanted) else {
            return Vec::new();
        };
        let found = tree
            .query(&at.to_array())
            .nearest_n::<SquaredEuclidean<f64>>(wanted)
            .execute();
        found
            .iter()
            .map(|item| (item.distance, &self.nodes[item.item as usize]))
            .collect()
    }

    /// The `count` nodes nearest to a node but itself, each with its weight times a share that
    /// falls to zero where the next one lies, so that nothing jumps when another comes nearer.
    pub(super) fn around(
        &self,
        node: &Node,
        count: usize,
    ) -> impl Iterator<Item = (f64, &'a Node)> {
        // The nearest is the node itself, and the farthest only says where shares end.
        let near = self.of(node.chart(), count + 2);
        let end = near.iter().map(|(squared, _)| *squared).fold(0.0, f64::max);
        let own = *node;
        near.into_iter().filter_map(move |(squared, other)| {
            let share = 1.0 - squared / end;
            (*other != own && share > 0.0).then_some((share * other.weight, other))
        })
    }

    /// The mean inverse distance of the `count` nodes nearest to a place, by the inverse
    /// squares of their distances there.
    pub(super) fn inverse_distance(&self, at: DVec2, count: usize) -> f64 {
        let near = self.of(at, count);
        let share = |squared: f64| 1.0 / squared.max(f64::MIN_POSITIVE.sqrt());
        let sum: f64 = near.iter().map(|(squared, _)| share(*squared)).sum();
        let weighted = near
            .iter()
            .map(|(squared, node)| share(*squared) * node.inverse_distance);
        weighted.sum::<f64>() / sum
    }
}
