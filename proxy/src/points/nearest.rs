//! Neighbours in the chart.
//!
//! Nodes lie in strips of equally many, from left to right, and from the bottom to the top of each: of what is in a
//! circle each strip has a run. However nodes crowd somewhere, a circle around some of them meets few
//! strips and little beside it.

use super::Node;
use glam::DVec2;
use rayon::prelude::*;

/// The nodes by their place in the chart.
pub(super) struct Nearest<'a> {
    nodes: &'a [Node],
    /// Strip by strip, from the bottom to the top.
    order: Vec<u32>,
    /// In that order.
    places: Vec<DVec2>,
    weights: Vec<f64>,
    /// Nodes in a strip; in the last there may be fewer.
    in_strip: usize,
    /// Of each strip the least and the greatest x.
    strips: Vec<[f64; 2]>,
}

/// A node near a place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbour {
    /// Which node.
    pub(super) index: usize,
    /// From the place, in the chart.
    pub(super) offset: DVec2,
    /// How much it is there, times what falls from 1 at the place to 0 where neighbours end.
    pub(super) share: f64,
}

/// What is used again for every place that is asked about.
#[derive(Default)]
pub(super) struct Asked {
    /// The squared radius to begin with: time depends on it, and rounding.
    squared: f64,
    met: Vec<Met>,
}

/// A node within a circle.
#[derive(Clone, Copy)]
struct Met {
    /// Its place in the order.
    at: u32,
    /// From the middle, squared.
    squared: f64,
    /// How much of it is there, 0…1.
    part: f64,
}

/// More nodes than this are not asked, however little they count together.
const MOST: usize = 512;
/// How many of a strip's nodes are about as far apart as it is wide: a circle with the neighbours of a node
/// in it meets four strips.
const WIDTH: f64 = 1.5;
/// Over what the last place needed.
const ROOM: f64 = 1.2;
/// By how much a circle's area grows where too little is in it, at least and at most.
const WIDER: [f64; 2] = [1.3, 16.0];
/// Nodes that are asked about one after the other.
const RUN: usize = 128;

impl<'a> Nearest<'a> {
    pub(super) fn new(nodes: &'a [Node]) -> Self {
        let mut placed: Vec<(DVec2, u32)> = nodes.iter().map(Node::chart).zip(0..).collect();
        let in_strip = (WIDTH * (nodes.len() as f64).sqrt()).ceil().max(1.0) as usize;
        let by = |axis: usize| {
            move |a: &(DVec2, u32), b: &(DVec2, u32)| {
                a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1))
            }
        };
        placed.par_sort_unstable_by(by(0));
        let strip = |placed: &mut [(DVec2, u32)]| {
            let bounds = [placed[0].0.x, placed[placed.len() - 1].0.x];
            placed.sort_unstable_by(by(1));
            bounds
        };
        let strips = placed.par_chunks_mut(in_strip).map(strip).collect();
        Self {
            nodes,
            in_strip,
            strips,
            weights: placed
                .iter()
                .map(|(_, i)| nodes[*i as usize].weight)
                .collect(),
            order: placed.iter().map(|(_, i)| *i).collect(),
            places: placed.into_iter().map(|(at, _)| at).collect(),
        }
    }

    /// What becomes of each node, in their order, by what is around it.
    pub(super) fn changed(&self, changed: impl Fn(Node, &mut Asked) -> Node + Sync) -> Vec<Node> {
        // Neighbours one after the other: each has about the circle of the one before.
        let of_run = |run: &[u32]| {
            let mut asked = Asked::default();
            let of = |i: &u32| changed(self.nodes[*i as usize], &mut asked);
            run.iter().map(of).collect::<Vec<Node>>()
        };
        let by_run: Vec<Vec<Node>> = self.order.par_chunks(RUN).map(of_run).collect();
        let mut nodes = self.nodes.to_vec();
        for (i, node) in self.order.iter().zip(by_run.into_iter().flatten()) {
            nodes[*i as usize] = node;
        }
        nodes
    }

    /// Nodes around a place, but for what is at the place itself: as far off as their shares add up to
    /// so much, or all, or the nearest [`MOST`]. A node of such a weight, or more, is there; of others a part is.
    /// However many there are that have hardly any of it, they change hardly anything.
    pub(super) fn around<'s>(
        &'s self,
        at: DVec2,
        weight: f64,
        shares: f64,
        asked: &'s mut Asked,
    ) -> impl Iterator<Item = Neighbour> + use<'s, 'a> {
        let end = self.meet(at, weight, shares, asked);
        asked.squared = end;
        let met = asked.met.drain(..).filter(move |met| met.squared < end);
        met.map(move |met| Neighbour {
            index: self.order[met.at as usize] as usize,
            offset: self.places[met.at as usize] - at,
            share: met.part * (1.0 - met.squared / end),
        })
    }

    /// Meets all nodes within some circle, and finds the squared radius D² at which their shares, w (1 − d²/D²)
    /// of parts w that are nearer than D, add up to so much; infinite where those of all don't.
    fn meet(&self, at: DVec2, weight: f64, shares: f64, asked: &mut Asked) -> f64 {
        let mut squared = match asked.squared {
            known if known > 0.0 => ROOM * known,
            _ => self.first_guess(shares),
        };
        loop {
            let are_all = self.within(at, squared, weight, &mut asked.met);
            if are_all {
                squared = f64::INFINITY;
            }
            let met = &mut asked.met;
            let share = |met: &Met| met.part * (1.0 - met.squared / squared);
            let sum: f64 = met.iter().map(share).sum();
            let suffices = sum >= shares || are_all;
            if suffices || met.len() >= MOST {
                let end = if suffices {
                    end(met, squared, shares)
                } else {
                    f64::INFINITY
                };
                return end.min(farthest_of_most(met));
            }
            // Evenly spread, they add up to as much as the circle has area.
            let [least, most] = WIDER;
            squared *= (ROOM * shares / sum).clamp(least, most);
        }
    }

    /// Of a circle in which, if all nodes were there and evenly spread, there would be enough, the squared
    /// radius.
    fn first_guess(&self, shares: f64) -> f64 {
        let (Some([left, _]), Some([_, right])) = (self.strips.first(), self.strips.last()) else {
            return f64::INFINITY;
        };
        // Shares add up to half the number.
        let part = 2.0 * shares / self.nodes.len() as f64;
        let area = (right - left) * (right - left);
        (part * area / std::f64::consts::PI).max(f64::MIN_POSITIVE)
    }

    /// Meets all nodes nearer than a distance, but for what is at the place itself; from left to right, from the
    /// bottom to the top of each strip. Whether no other is anywhere.
    fn within(&self, at: DVec2, squared: f64, weight: f64, met: &mut Vec<Met>) -> bool {
        met.clear();
        let radius = squared.sqrt();
        let mut passed = 0;
        let first = self
            .strips
            .partition_point(|[_, most]| *most < at.x - radius);
        for (strip, [least, _]) in self.strips.iter().enumerate().skip(first) {
            if *least > at.x + radius {
                break;
            }
            let from = strip * self.in_strip;
            let places = &self.places[from..self.places.len().min(from + self.in_strip)];
            let low = places.partition_point(|place| place.y < at.y - radius);
            for (i, place) in places.iter().enumerate().skip(low) {
                if place.y > at.y + radius {
                    break;
                }
                let off = place.distance_squared(at);
                passed += usize::from(off < squared);
                if off > 0.0 && off < squared {
                    met.push(Met {
                        at: (from + i) as u32,
                        squared: off,
                        part: (self.weights[from + i] / weight).min(1.0),
                    });
                }
            }
        }
        passed == self.nodes.len()
    }
}

/// The squared distance of the last of the nearest [`MOST`]; infinite where there are fewer.
fn farthest_of_most(met: &[Met]) -> f64 {
    if met.len() < MOST {
        return f64::INFINITY;
    }
    let mut squares: Vec<f64> = met.iter().map(|met| met.squared).collect();
    *squares.select_nth_unstable_by(MOST - 1, f64::total_cmp).1
}

/// D² from an upper bound, by Newton's method in 1/D²: the sum is convex and piecewise linear in that, so steps come
/// down on it and end exactly there.
fn end(met: &[Met], most: f64, shares: f64) -> f64 {
    let mut end = most;
    loop {
        let (mut parts, mut moments) = (0.0, 0.0);
        for met in met {
            let part = if met.squared < end { met.part } else { 0.0 };
            parts += part;
            moments += part * met.squared;
        }
        let next = moments / (parts - shares);
        if !(parts > shares && next < end) {
            return end;
        }
        end = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// Evenly in 0…1, by a number of a sequence and which of several.
    fn spread(i: usize, of: usize) -> f64 {
        ((i + 1) as f64 * (0.618_033_988_7 + 0.1 * (of as f64).sqrt())).fract()
    }

    /// Of many a third is crowded in one place and a third in line.
    fn nodes(count: usize) -> Vec<Node> {
        let node = |i: usize| {
            let at = DVec2::new(spread(i, 1), spread(i, 2)) - 0.5;
            let at = match i % 3 {
                0 => 1e-3 * at + 0.2,
                1 => DVec2::new(0.1, at.y),
                _ => at,
            };
            // As [`Node::chart`] has it, backwards.
            let squared = at.length_squared();
            let direction = (2.0 * at).extend(1.0 - squared) / (1.0 + squared);
            Node {
                direction: DVec3::normalize(direction),
                inverse_distance: 1.0,
                weight: spread(i, 3).powi(i as i32 % 7),
            }
        };
        (0..count).map(node).collect()
    }

    /// The nodes nearest to a place, sorted, and where they end.
    fn by_sorting(nodes: &[Node], at: DVec2, weight: f64, shares: f64) -> (Vec<f64>, f64) {
        let from = |node: &Node| {
            (
                node.chart().distance_squared(at),
                (node.weight / weight).min(1.0),
            )
        };
        let mut near: Vec<(f64, f64)> = nodes.iter().map(from).filter(|n| n.0 > 0.0).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let capped = near.len() >= MOST;
        let (mut parts, mut moments) = (0.0, 0.0);
        let mut end = if capped {
            near[MOST - 1].0
        } else {
            f64::INFINITY
        };
        for (i, (squared, part)) in near.iter().enumerate().take(MOST) {
            parts += part;
            moments += part * squared;
            let own = moments / (parts - shares);
            let next = near.get(i + 1).map_or(f64::INFINITY, |next| next.0);
            if parts > shares && own <= next {
                end = own.min(end);
                break;
            }
        }
        let within = near.iter().map(|n| n.0).filter(|squared| *squared < end);
        (within.collect(), end)
    }

    #[test]
    fn neighbours_are_those_that_sorting_finds() {
        for count in [1, 2, 9, 40, 511, 514, 3000] {
            let nodes = nodes(count);
            let nearest = Nearest::new(&nodes);
            let mut asked = Asked::default();
            for (i, node) in nodes.iter().enumerate().step_by(count.div_ceil(200)) {
                for (weight, shares) in [(1.0, 8.0), (node.weight, 8.0), (1.0, 4.5)] {
                    let at = node.chart();
                    let (within, end) = by_sorting(&nodes, at, weight, shares);
                    let near: Vec<_> = nearest.around(at, weight, shares, &mut asked).collect();
                    let mut squares: Vec<f64> =
                        near.iter().map(|n| n.offset.length_squared()).collect();
                    squares.sort_by(f64::total_cmp);
                    // Of what is as far as where neighbours end rounding decides.
                    let inner = |all: &[f64]| -> Vec<f64> {
                        let inner = all.iter().filter(|s| **s < end * (1.0 - 1e-9));
                        inner.copied().collect()
                    };
                    assert_eq!(inner(&squares), inner(&within), "{count}, {i}: {end}");
                    let sum: f64 = near.iter().map(|n| n.share).sum();
                    if within.len() < MOST - 1 && end < f64::INFINITY {
                        assert!((sum - shares).abs() < 1e-6, "{count}, {i}: {sum}");
                    }
                    // Whatever was asked before, but for rounding.
                    let mut anew = Asked::default();
                    let again = nearest.around(at, weight, shares, &mut anew);
                    let sum_again: f64 = again.map(|n| n.share).sum();
                    assert!((sum - sum_again).abs() < 1e-12, "{count}, {i}");
                }
            }
        }
    }
}
