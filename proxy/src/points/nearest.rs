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

/// A node near a place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbour<'a> {
    pub(super) node: &'a Node,
    /// From the place, in the chart.
    pub(super) offset: DVec2,
    /// How much it is there, times what falls from 1 at the place to 0 where neighbours end.
    pub(super) share: f64,
}

/// More nodes than this are not asked, however little they count together.
const MOST: usize = 512;

impl<'a> Nearest<'a> {
    pub(super) fn new(nodes: &'a [Node]) -> Self {
        let at: Vec<[f64; 2]> = nodes.iter().map(|n| n.chart().to_array()).collect();
        let tree = ImmutableKdTree::new_from_slice(&at).ok();
        Self { nodes, tree }
    }

    /// Nodes around a place, but for what is at the place itself: as far off as their shares add up to
    /// so much, or all, or [`MOST`]. A node of such a weight, or more, is there; of others a part is. However
    /// many there are that have hardly any of it, they change hardly anything.
    pub(super) fn around(&self, at: DVec2, weight: f64, shares: f64) -> Vec<Neighbour<'a>> {
        let part = |node: &Node| (node.weight / weight).min(1.0);
        // Shares of nodes that are all there, evenly spread, add up to half their number.
        let mut asked = 2 * shares.ceil() as usize + 2;
        let (near, end) = loop {
            let near = self.of(at, asked);
            let are_all = asked >= self.nodes.len();
            let parts = near.iter().map(|(squared, node)| (*squared, part(node)));
            if let Some(end) = end(parts, are_all, shares) {
                break (near, end);
            }
            if asked >= MOST {
                let end = near.last().map_or(f64::INFINITY, |(squared, _)| *squared);
                break (near, end);
            }
            asked = (2 * asked).min(MOST);
        };
        let neighbour = |(squared, node): (f64, &'a Node)| Neighbour {
            node,
            offset: node.chart() - at,
            share: part(node) * (1.0 - squared / end),
        };
        let all = near.into_iter().map(neighbour);
        all.filter(|near| near.share > 0.0).collect()
    }

    /// The `count` nodes nearest to a place, but for what is at the place itself, each with its squared
    /// distance; fewer where there are fewer.
    fn of(&self, at: DVec2, count: usize) -> Vec<(f64, &'a Node)> {
        let wanted = NonZero::new((count + 1).min(self.nodes.len()));
        let (Some(tree), Some(wanted)) = (&self.tree, wanted) else {
            return Vec::new();
        };
        let found = tree
            .query(&at.to_array())
            .nearest_n::<SquaredEuclidean<f64>>(wanted)
            .execute();
        let nodes = found
            .iter()
            .map(|item| (item.distance, &self.nodes[item.item as usize]));
        nodes.filter(|(d, _)| *d > 0.0).take(count).collect()
    }
}

/// The squared distance D² for which the sum of w (1 - d²/D²), over parts w nearer than D, is so much: of
/// the nearest, or all, sorted by their squared distances d². Infinite where all are not enough, `None`
/// where more must be known.
fn end(near: impl Iterator<Item = (f64, f64)>, are_all: bool, shares: f64) -> Option<f64> {
    let mut near = near.peekable();
    let beyond = are_all.then_some(f64::INFINITY);
    let (mut parts, mut moments) = (0.0, 0.0);
    while let Some((squared, part)) = near.next() {
        parts += part;
        moments += part * squared;
        // Of these and no more, if the next is farther.
        let end = moments / (parts - shares);
        let next = near.peek().map(|(squared, _)| *squared).or(beyond)?;
        if parts > shares && end <= next {
            return Some(end);
        }
    }
    beyond
}
