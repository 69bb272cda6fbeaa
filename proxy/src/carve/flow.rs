//! The minimum s-t cut of a graph of tetrahedra (Boykov and Kolmogorov 2004, "An
//! experimental comparison of min-cut/max-flow algorithms for energy minimization in
//! vision").
//!
//! Two trees of unsaturated arcs grow, one from the source and one into the sink; where they
//! touch, the path between them is saturated, and what that cuts off looks for a new parent.
//! Capacities are whole numbers, so the cut is the same on every machine.

use std::collections::VecDeque;

const NONE: u32 = u32::MAX;
/// The parent of a tree's node that hangs from its terminal.
const TERMINAL: u32 = u32::MAX - 1;
/// Of a node that lost its parent.
const ORPHAN: u32 = u32::MAX - 2;

/// A graph whose nodes have four neighbours each, and a capacity for each direction.
#[derive(Clone, Debug)]
pub(super) struct Graph<'a> {
    /// For each arc `4 · node + k`, the arc the other way; nodes beyond [`Self::nodes`] are not
    /// part of the graph.
    pub(super) across: &'a [[u32; 4]],
    /// How many nodes.
    pub(super) nodes: usize,
    /// What can flow along each arc. An arc and the one the other way must not exceed
    /// `u32::MAX` together.
    pub(super) capacity: Vec<u32>,
    /// What can flow from the source into each node; where negative, from it into the sink.
    pub(super) terminal: Vec<i64>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Tree {
    Free,
    Source,
    Sink,
}

/// Which nodes are on the source's side of the minimum cut; where several are minimal, that
/// with the fewest nodes there.
pub(super) fn source_side(graph: Graph<'_>) -> Vec<bool> {
    let mut flow = Flow::new(graph);
    flow.run();
    flow.tree.iter().map(|&tree| tree == Tree::Source).collect()
}

struct Flow<'a> {
    graph: Graph<'a>,
    tree: Vec<Tree>,
    /// The arc from each node to its parent, or one of the constants above.
    parent: Vec<u32>,
    /// When a node's distance to its terminal was last known, and that distance.
    known_at: Vec<u32>,
    distance: Vec<u32>,
    time: u32,
    active: VecDeque<u32>,
    is_active: Vec<bool>,
    orphans: VecDeque<u32>,
}

impl<'a> Flow<'a> {
    fn new(graph: Graph<'a>) -> Self {
        let n = graph.nodes;
        let mut flow = Self {
            tree: vec![Tree::Free; n],
            parent: vec![NONE; n],
            known_at: vec![0; n],
            distance: vec![0; n],
            time: 0,
            active: VecDeque::new(),
            is_active: vec![false; n],
            orphans: VecDeque::new(),
            graph,
        };
        for node in 0..n {
            let terminal = flow.graph.terminal[node];
            if terminal != 0 {
                flow.tree[node] = if terminal > 0 {
                    Tree::Source
                } else {
                    Tree::Sink
                };
                flow.parent[node] = TERMINAL;
                flow.distance[node] = 1;
                flow.activate(node as u32);
            }
        }
        flow
    }

    fn run(&mut self) {
        while let Some(node) = self.active.front().copied() {
            if self.tree[node as usize] == Tree::Free {
                self.pass_on(node);
                continue;
            }
            let Some(bridge) = self.grow(node) else {
                self.pass_on(node);
                continue;
            };
            // The node stays in front: it may touch the other tree elsewhere, too.
            self.time += 1;
            self.augment(bridge);
            while let Some(orphan) = self.orphans.pop_front() {
                self.adopt(orphan);
            }
        }
    }

    fn activate(&mut self, node: u32) {
        if !self.is_active[node as usize] {
            self.is_active[node as usize] = true;
            self.active.push_back(node);
        }
    }

    /// Takes the first node out of the queue.
    fn pass_on(&mut self, node: u32) {
        self.active.pop_front();
        self.is_active[node as usize] = false;
    }

    fn twin(&self, arc: u32) -> u32 {
        self.graph.across[arc as usize >> 2][arc as usize & 3]
    }

    /// The node's arcs within the graph, each with the one the other way.
    fn arcs(&self, node: u32) -> impl Iterator<Item = (u32, u32)> + use<> {
        let twins = self.graph.across[node as usize];
        let nodes = self.graph.nodes as u32;
        let all = (0..4).map(move |k| (4 * node + k, twins[k as usize]));
        all.filter(move |(_, twin)| twin >> 2 < nodes)
    }

    /// Whether something can still flow between a tree's node and a neighbour in the tree's
    /// direction: out of the node for the source's tree, into it for the sink's.
    fn open(&self, tree: Tree, arc: u32, twin: u32) -> bool {
        let along = if tree == Tree::Source { arc } else { twin };
        self.graph.capacity[along as usize] > 0
    }

    /// Takes in free neighbours; an arc from the source's tree to the sink's where they touch.
    fn grow(&mut self, node: u32) -> Option<u32> {
        let i = node as usize;
        let tree = self.tree[i];
        for (arc, twin) in self.arcs(node) {
            if !self.open(tree, arc, twin) {
                continue;
            }
            let j = twin as usize >> 2;
            if self.tree[j] == Tree::Free {
                self.tree[j] = tree;
                self.parent[j] = twin;
                self.known_at[j] = self.known_at[i];
                self.distance[j] = self.distance[i] + 1;
                self.activate(twin >> 2);
            } else if self.tree[j] != tree {
                return Some(if tree == Tree::Source { arc } else { twin });
            } else if self.known_at[j] <= self.known_at[i] && self.distance[j] > self.distance[i] {
                // A shorter way to the terminal.
                self.parent[j] = twin;
                self.known_at[j] = self.known_at[i];
                self.distance[j] = self.distance[i] + 1;
            }
        }
        None
    }

    /// Pushes all that fits along the path through an arc between the trees.
    fn augment(&mut self, bridge: u32) {
        let (from, to) = (bridge >> 2, self.twin(bridge) >> 2);
        // 1. The bottleneck.
        let mut room = i64::from(self.graph.capacity[bridge as usize]);
        for (end, tree) in [(from, Tree::Source), (to, Tree::Sink)] {
            let mut node = end;
            loop {
                let parent = self.parent[node as usize];
                if parent == TERMINAL {
                    room = room.min(self.graph.terminal[node as usize].abs());
                    break;
                }
                let twin = self.twin(parent);
                let along = if tree == Tree::Source { twin } else { parent };
                room = room.min(i64::from(self.graph.capacity[along as usize]));
                node = twin >> 2;
            }
        }
        // 2. Push. An arc's capacity bounds the room, unless both ends are roots: then the
        // bridge's does.
        let flow = room as u32;
        self.push(bridge, flow);
        for (end, tree) in [(from, Tree::Source), (to, Tree::Sink)] {
            let mut node = end;
            loop {
                let parent = self.parent[node as usize];
                if parent == TERMINAL {
                    let terminal = &mut self.graph.terminal[node as usize];
                    *terminal -= terminal.signum() * room;
                    if *terminal == 0 {
                        self.orphan(node, true);
                    }
                    break;
                }
                let twin = self.twin(parent);
                let along = if tree == Tree::Source { twin } else { parent };
                self.push(along, flow);
                if self.graph.capacity[along as usize] == 0 {
                    self.orphan(node, true);
                }
                node = twin >> 2;
            }
        }
    }

    fn push(&mut self, arc: u32, flow: u32) {
        let twin = self.twin(arc);
        self.graph.capacity[arc as usize] -= flow;
        self.graph.capacity[twin as usize] += flow;
    }

    fn orphan(&mut self, node: u32, first: bool) {
        self.parent[node as usize] = ORPHAN;
        if first {
            self.orphans.push_front(node);
        } else {
            self.orphans.push_back(node);
        }
    }

    /// Finds an orphan a new parent in its tree, the one nearest to the terminal, or lets it
    /// and its children go.
    fn adopt(&mut self, node: u32) {
        let i = node as usize;
        let tree = self.tree[i];
        let mut best: Option<(u32, u32)> = None;
        for (arc, twin) in self.arcs(node) {
            let neighbour = twin >> 2;
            // Towards the node this time: the neighbour is to be the parent.
            if self.tree[neighbour as usize] != tree || !self.open(tree, twin, arc) {
                continue;
            }
            let Some(distance) = self.distance_to_terminal(neighbour) else {
                continue;
            };
            if best.is_none_or(|(least, _)| distance < least) {
                best = Some((distance, arc));
            }
        }
        if let Some((distance, arc)) = best {
            self.parent[i] = arc;
            self.known_at[i] = self.time;
            self.distance[i] = distance + 1;
            return;
        }
        for (arc, twin) in self.arcs(node) {
            let neighbour = twin >> 2;
            if self.tree[neighbour as usize] != tree {
                continue;
            }
            if self.open(tree, twin, arc) {
                self.activate(neighbour);
            }
            if self.parent[neighbour as usize] == twin {
                self.orphan(neighbour, false);
            }
        }
        self.tree[i] = Tree::Free;
        self.parent[i] = NONE;
    }

    /// How many arcs lead from a node to its terminal; `None` where an orphan is on the way.
    fn distance_to_terminal(&mut self, start: u32) -> Option<u32> {
        // 1. Up to a node whose distance is known now.
        let (mut node, mut steps) = (start, 0);
        let known = loop {
            let i = node as usize;
            if self.known_at[i] == self.time {
                break steps + self.distance[i];
            }
            match self.parent[i] {
                ORPHAN | NONE => return None,
                TERMINAL => {
                    self.known_at[i] = self.time;
                    self.distance[i] = 1;
                    break steps + 1;
                }
                parent => {
                    node = self.twin(parent) >> 2;
                    steps += 1;
                }
            }
        };
        // 2. Note it down along the way.
        let (mut node, mut distance) = (start, known);
        while self.known_at[node as usize] != self.time {
            self.known_at[node as usize] = self.time;
            self.distance[node as usize] = distance;
            distance -= 1;
            node = self.twin(self.parent[node as usize]) >> 2;
        }
        Some(known)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Node i's neighbours on a torus of `w` × `h`; arcs 0 and 2 go right and left, 1 and 3
    /// down and up.
    fn torus(w: usize, h: usize) -> Vec<[u32; 4]> {
        let at = |x: usize, y: usize| (y % h * w + x % w) as u32;
        (0..w * h)
            .map(|i| {
                let (x, y) = (i % w, i / w);
                [
                    4 * at(x + 1, y) + 2,
                    4 * at(x, y + 1) + 3,
                    4 * at(x + w - 1, y),
                    4 * at(x, y + h - 1) + 1,
                ]
            })
            .collect()
    }

    /// What a cut costs: full arcs out of the source's side, and terminals cut off.
    fn cost(graph: &Graph<'_>, source: &[bool]) -> i64 {
        let mut sum = 0;
        for i in 0..graph.nodes {
            let terminal = graph.terminal[i];
            if source[i] != (terminal > 0) {
                sum += terminal.abs();
            }
            for k in 0..4 {
                let j = graph.across[i][k] as usize >> 2;
                if source[i] && !source[j] {
                    sum += i64::from(graph.capacity[4 * i + k]);
                }
            }
        }
        sum
    }

    #[test]
    fn a_chain_is_cut_at_its_weakest_arc() {
        let across = torus(5, 2);
        let mut capacity = vec![0; 40];
        for i in 0..4 {
            capacity[4 * i] = [7, 3, 2, 5][i];
        }
        let mut terminal = vec![0; 10];
        (terminal[0], terminal[4]) = (10, -10);
        let graph = Graph {
            across: &across,
            nodes: 10,
            capacity,
            terminal,
        };
        let side = source_side(graph);
        assert_eq!(side[..5], [true, true, true, false, false]);
    }

    proptest! {
        #[test]
        fn no_other_cut_is_cheaper(
            capacity in prop::collection::vec(prop_oneof![Just(0u32), 0..9u32], 48),
            terminal in prop::collection::vec(-12..12i64, 12),
        ) {
            let across = torus(4, 3);
            let graph = Graph { across: &across, nodes: 12, capacity, terminal };
            let found = cost(&graph, &source_side(graph.clone()));
            for bits in 0..1 << 12 {
                let side: Vec<bool> = (0..12).map(|i| bits >> i & 1 == 1).collect();
                prop_assert!(cost(&graph, &side) >= found, "{side:?}");
            }
        }
    }
}
