//! Which source views are most like a desired one, by part of its picture.

use super::{Node, SparsePoint};
use calibrate::View;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// How many of the source views most like the desired one give their points.
const VIEWS: usize = 6;
/// Added to how unlike views are before they are compared: below it, they are as good as equal, and
/// the number of shared points decides.
pub(crate) const EASY_ANGLE: f64 = 0.1;
/// Radians that a ratio of distances by the factor e is worth beside an angle.
const RATIO_WEIGHT: f64 = 0.3;
/// Likenesses that differ by less, relatively, are the same.
const TIED: f64 = 1e-9;
/// A view counts fully from so much more likeness on, relatively, than the first that does
/// not count.
const FADE: f64 = 0.1;
/// Points are counted by so many cells a side: where they are many each says less, as it is parts of
/// the picture that views share.
const CELLS: usize = 16;
/// Points come into sight over the outermost part of so large a share of the reach, which is beyond the
/// picture: a lone one decides about much.
const RIM: f64 = 0.1;
/// What points are worth at a corner of the picture though they are at the opposite one.
const ELSEWHERE: f64 = 0.05;

/// Points are asked in so many parts at most, as each has sums of its own for all views, and so many at least one
/// after the other.
const PARTS: usize = 16;
const PART: usize = 4096;

/// By corner of the picture, then by source view; and by source view in all.
type Likeness = (Vec<Vec<f64>>, Vec<f64>);

/// A source view of all that are most like the desired one has a weight, 0…1, at each corner of
/// its picture; between them weights are bilinear. One corner may show what the views most like the
/// desired one in all do not see.
pub(super) struct Alike {
    corners: Lattice,
    /// By corner, then by source view.
    weights: Vec<Vec<f64>>,
}

/// Square cells over all directions within a reach of the axis.
struct Lattice {
    /// Their corner farthest from the axis, in the chart, along either direction.
    extent: f64,
    cells: usize,
}

impl Lattice {
    fn new(reach: f64, cells: usize) -> Self {
        let extent = (0.5 * reach).tan();
        Self { extent, cells }
    }

    fn corner_count(&self) -> usize {
        (self.cells + 1) * (self.cells + 1)
    }

    /// How much in sight a direction is, 0…1.
    fn in_sight(&self, node: &Node) -> f64 {
        ((1.0 - node.chart().length() / self.extent) / RIM).clamp(0.0, 1.0)
    }

    /// The corners of the cell that a direction is in, and its bilinear weights, which add to 1.
    fn around(&self, node: &Node) -> [(usize, f64); 4] {
        let cells = self.cells as f64;
        let at = (0.5 * cells) * (node.chart() / self.extent + 1.0);
        let at = at.clamp(DVec2::ZERO, DVec2::splat(cells));
        let low = at.floor().min(DVec2::splat(cells - 1.0));
        let right = at - low;
        let left = 1.0 - right;
        let side = self.cells + 1;
        let first = low.y as usize * side + low.x as usize;
        [
            (first, left.x * left.y),
            (first + 1, right.x * left.y),
            (first + side, left.x * right.y),
            (first + side + 1, right.x * right.y),
        ]
    }
}

impl Alike {
    /// Those that share many points with a view at `center` and see them from about the same
    /// direction and distance; of points within `reach` of its axis, in radians.
    pub(super) fn new(
        center: DVec3,
        reach: f64,
        sources: &[View],
        in_sight: &[(Node, &SparsePoint)],
    ) -> Self {
        // 1. How many points there are around each.
        let cells = Lattice::new(reach, CELLS);
        let mut crowd = vec![0.0; cells.corner_count()];
        for (node, _) in in_sight {
            let there = cells.in_sight(node);
            for (corner, share) in cells.around(node) {
                crowd[corner] += share * there;
            }
        }

        // 2. How like each view is, at each corner and in all.
        let corners = Lattice::new(reach, 1);
        let centers: Vec<DVec3> = sources.iter().map(View::center).collect();
        let nothing = || {
            let of_corners = vec![vec![0.0; sources.len()]; corners.corner_count()];
            (of_corners, vec![0.0; sources.len()])
        };
        let add = |(likeness, in_all): &mut Likeness, (node, point): &(Node, &SparsePoint)| {
            let others = cells.around(node).map(|(c, share)| share * crowd[c]);
            let worth = cells.in_sight(node) / others.into_iter().sum::<f64>().max(1.0);
            let here = point.position - center;
            let around = corners.around(node);
            for &i in &point.seen_by {
                let i = i as usize;
                let there = point.position - centers[i];
                let own = worth / (EASY_ANGLE + unlikeness(here, there));
                in_all[i] += own;
                for (corner, share) in around {
                    likeness[corner][i] += share * own;
                }
            }
        };
        // The same parts, and sums, on any number of threads.
        let of_part = |part: &[(Node, &SparsePoint)]| {
            let mut sums = nothing();
            part.iter().for_each(|seen| add(&mut sums, seen));
            sums
        };
        let size = in_sight.len().div_ceil(PARTS).max(PART);
        let parts: Vec<Likeness> = in_sight.par_chunks(size).map(of_part).collect();
        let (mut likeness, mut in_all) = nothing();
        for (of_corners, all) in &parts {
            let sums = likeness.iter_mut().zip(of_corners);
            for (sums, part) in sums.chain([(&mut in_all, all)]) {
                sums.iter_mut().zip(part).for_each(|(sum, own)| *sum += own);
            }
        }

        // 3. The most like ones.
        for likeness in &mut likeness {
            for (own, all) in likeness.iter_mut().zip(&in_all) {
                *own += ELSEWHERE * all;
            }
        }
        let weights = likeness.iter().map(|l| most_like(l)).collect();
        Self { corners, weights }
    }

    /// How much a point counts: as much as the view that counts most of those that see it.
    pub(super) fn weight(&self, node: &Node, point: &SparsePoint) -> f64 {
        let around = self.corners.around(node);
        let of_view = |&i: &u32| {
            let at = around.map(|(corner, share)| share * self.weights[corner][i as usize]);
            at.into_iter().sum::<f64>()
        };
        point.seen_by.iter().map(of_view).fold(0.0, f64::max)
    }
}

/// How differently a point is seen from two places, as it lies from each: the angle between, in
/// radians, and what the ratio of the distances is worth.
#[inline]
pub(crate) fn unlikeness(here: DVec3, there: DVec3) -> f64 {
    let angle = there.cross(here).length().atan2(there.dot(here));
    angle + RATIO_WEIGHT * (there.length() / here.length()).ln().abs()
}

/// Weights of the few views of greatest likeness, 0…1, that fall to zero before another takes the
/// place of one.
fn most_like(likeness: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..likeness.len()).filter(|&i| likeness[i] > 0.0).collect();
    order.sort_by(|&i, &j| likeness[j].total_cmp(&likeness[i]).then(i.cmp(&j)));
    // Views of one place are alike to the last digits: none of them takes another's place.
    let last = order.get(VIEWS - 1).map_or(0.0, |&i| likeness[i]);
    let count = order.partition_point(|&i| likeness[i] > (1.0 - TIED) * last);
    let count = count.max(VIEWS.min(order.len()));
    let least = order.get(count).map_or(0.0, |&i| likeness[i]);
    order.truncate(count);
    let mut chosen = vec![0.0; likeness.len()];
    for i in order {
        chosen[i] = ((likeness[i] - least) / (FADE * likeness[i])).min(1.0);
    }
    chosen
}
