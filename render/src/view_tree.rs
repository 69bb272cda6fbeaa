//! The source views that can matter around a point of the proxy, without looking at all.
//!
//! A hierarchy of spheres around the source views' centres, each with the cone of what its
//! views look at. A sphere is passed over when no view in it can differ from the desired one
//! by as little as is asked for, or none has the point in its image. The bound is the angle
//! between the ray and the sphere, less what sphere and point subtend, plus β times the least
//! excess of footprint. What is found is therefore *all* that lies within a difference, and a few
//! more; `near.rs` has how an exact field comes of it.
//!
//! Neighbours are in groups of eight, eight such groups in one of the next level, and so on: the eight of a
//! group are asked together ([`Group`]), and where a group is follows from its number.

mod group;

use crate::cpu::lanes::in_vectors;
use crate::frame::{FrameSource, ProxyPoint};
use crate::planted::{Fault, is_planted};
use calibrate::{Lens, Pixel};
use glam::DVec3;
use group::{Bounds, Group, Query};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Views of a group, and groups of the one above.
const GROUP: usize = 8;
/// Levels that so many views have, at most: indices have 32 bits.
const LEVELS: usize = 11;
/// More views than this are worth a thread.
const ALONE: usize = 1024;
/// With fewer views than this, asking each is faster.
const FEWEST: usize = 48;
/// Radians by which bounds are lowered, and lengths by which radii are raised, relative to what
/// they are computed from: more than rounding can take.
pub(crate) const SLACK: f64 = 1e-9;

/// A part of space around the proxy, in the desired camera's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ball {
    pub center: DVec3,
    /// Within it, a view may differ little.
    pub radius: f64,
    /// Within it, a view may see something; infinite for anywhere.
    pub sight: f64,
    /// How far from its middle what it is around lies, seen from the viewer.
    pub apart: Apart,
}

/// By how much points differ from another, as the viewer sees them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Apart {
    /// In direction, at most: radians.
    pub aside: f64,
    /// In distance, at most.
    pub along: f64,
}

impl Apart {
    /// Anything.
    pub(crate) const UNKNOWN: Self = Self {
        aside: f64::INFINITY,
        along: f64::INFINITY,
    };
}

impl Ball {
    /// For the differences at a point, of views that may see something within a distance of it;
    /// `None` at infinity.
    pub(crate) fn around(point: &ProxyPoint, sight: f64) -> Option<Self> {
        let center = point.ray / point.inverse_distance;
        center.is_finite().then_some(Self {
            center,
            radius: 0.0,
            sight,
            apart: Apart::UNKNOWN,
        })
    }
}

/// What differences are made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measure {
    pub beta: f64,
    pub by_length: bool,
}

/// The source views that take part in a frame.
#[derive(Clone, Debug)]
pub(crate) struct ViewTree {
    /// The views' indices, group by group.
    views: Vec<u32>,
    /// Of the views, of groups of them, of groups of those, up to a single one; of the views alone where
    /// asking each is faster.
    levels: Vec<Vec<Group>>,
}

impl ViewTree {
    /// With a hierarchy where that is faster than asking each view, and `may_skip`.
    pub(crate) fn new(sources: &[FrameSource], may_skip: bool) -> Self {
        let taking_part = sources.iter().zip(0..).filter(|(s, _)| s.takes_part());
        let mut order: Vec<(DVec3, u32)> = taking_part.map(|(s, i)| (s.center, i)).collect();
        let has_levels = may_skip && order.len() >= FEWEST;
        if has_levels {
            arrange(&mut order);
        }
        let views: Vec<u32> = order.into_iter().map(|(_, i)| i).collect();
        // The views.
        let of_some = |views: &[u32]| {
            let mut last: Option<(Lens, [f64; 2], Option<[f64; 2]>)> = None;
            let of_view = |i: &u32| {
                let source = &sources[*i as usize];
                // Most photos share their lens.
                let spread = match last {
                    Some((lens, size, spread)) if lens == source.lens && size == source.size => {
                        spread
                    }
                    _ => cosine_and_sine(widest(&source.lens, source.size)),
                };
                last = Some((source.lens, source.size, spread));
                Bounds {
                    center: source.center,
                    radius: 0.0,
                    axis: source.rotation.row(2),
                    spread,
                    footprint_ratio: source.footprint_ratio,
                    far: source.center.length(),
                }
            };
            views.iter().map(of_view).collect::<Vec<Bounds>>()
        };
        let bounds: Vec<Bounds> = views.par_chunks(ALONE).flat_map_iter(of_some).collect();
        let mut levels = vec![in_groups(&bounds)];
        // What is above them.
        let mut below = bounds;
        while has_levels && below.len() > GROUP {
            let around = below.par_chunks(GROUP).with_min_len(ALONE / GROUP);
            below = around.map(Bounds::around).collect();
            levels.push(in_groups(&below));
        }
        Self { views, levels }
    }

    /// Whether so many views take part that a list of all of them costs more than finding those
    /// that can count.
    pub(crate) fn is_large(&self) -> bool {
        self.views.len() >= FEWEST
    }

    /// The views, by index, that may differ by `most` or less somewhere in a ball and may have
    /// something in their images that is in sight of it. All that do are among them; in order.
    pub(crate) fn within(&self, ball: &Ball, measure: Measure, most: f64, found: &mut Vec<u32>) {
        found.clear();
        let query = Query::new(ball, measure, most);
        self.visit(&query, |group, may| {
            let views = self.views[GROUP * group..].iter().zip(may);
            found.extend(views.filter_map(|(view, may)| (may != 0).then_some(*view)));
        });
        self.sort(found);
    }

    /// The views that [`Self::within`] finds, with what is known of them.
    pub(crate) fn around(&self, ball: &Ball, measure: Measure, most: f64, found: &mut Around) {
        found.views.clear();
        found.groups.clear();
        let query = Query::new(ball, measure, most);
        self.visit(&query, |group, may| {
            let views = self.views[GROUP * group..].iter();
            for (lane, (view, may)) in views.zip(may).enumerate() {
                if may != 0 {
                    found.put(*view, &self.levels[0][group], lane);
                }
            }
        });
    }

    /// Goes through the groups of views of which some may matter, and a few more: of which are ones.
    fn visit(&self, query: &Query, with: impl FnMut(usize, [u32; GROUP])) {
        in_vectors(Visit {
            tree: self,
            query,
            with,
        });
    }

    fn sort(&self, found: &mut Vec<u32>) {
        found.sort_unstable();
        if self.levels.len() > 1 && is_planted(Fault::DroppedView) {
            found.pop();
        }
    }
}

/// The views that may matter around a part of the proxy: side by side, so that parts of it can ask which of
/// them may matter there.
#[derive(Clone, Debug, Default)]
pub(crate) struct Around {
    views: Vec<u32>,
    /// Of each eight of them; of the last eight some may be missing.
    groups: Vec<Group>,
}

impl Around {
    #[inline(always)]
    fn put(&mut self, view: u32, group: &Group, lane: usize) {
        let at = self.views.len() % GROUP;
        if at == 0 {
            self.groups.push(*group);
        }
        let last = self.groups.last_mut().expect("one was added for the first");
        last.put(at, group, lane);
        self.views.push(view);
    }

    /// [`ViewTree::within`] a smaller ball inside of the one they were found for, and a difference of that or
    /// less: by how much each view differs at least, and its index. Those that may differ least come
    /// first.
    pub(crate) fn within(
        &self,
        ball: &Ball,
        measure: Measure,
        most: f64,
        found: &mut Vec<(f32, u32)>,
    ) {
        found.clear();
        let query = Query::new(ball, measure, most);
        in_vectors(Within {
            around: self,
            query: &query,
            found: &mut *found,
        });
        found.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
    }
}

/// What is left to ask of a hierarchy: see [`ViewTree::visit`].
struct Visit<'a, F> {
    tree: &'a ViewTree,
    query: &'a Query,
    with: F,
}

impl<F: FnMut(usize, [u32; GROUP])> WithSimd for Visit<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let levels = &self.tree.levels;
        if levels.len() == 1 {
            for (i, group) in levels[0].iter().enumerate() {
                (self.with)(i, group.bounded(simd, self.query).0);
            }
            return;
        }
        // Groups that are yet to be asked, by level and number; of each level at most seven beside the one
        // that is gone into.
        let mut open = [(0_u32, 0_u32); GROUP * LEVELS + 1];
        let mut count = 1;
        open[0] = (levels.len() as u32 - 1, 0);
        while count > 0 {
            count -= 1;
            let (level, group) = (open[count].0 as usize, open[count].1 as usize);
            let (may, _) = levels[level][group].bounded(simd, self.query);
            if level == 0 {
                (self.with)(group, may);
                continue;
            }
            let first = GROUP * group;
            // The last group may have less than eight. No branch here: which go on nobody can foretell.
            let groups = (levels[level - 1].len() - first).min(GROUP);
            for (lane, may) in may[..groups].iter().enumerate() {
                open[count] = (level as u32 - 1, (first + lane) as u32);
                count += *may as usize;
            }
        }
    }
}

/// What is left to ask of views that were found: see [`Around::within`].
struct Within<'a> {
    around: &'a Around,
    query: &'a Query,
    found: &'a mut Vec<(f32, u32)>,
}

impl WithSimd for Within<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Around { views, groups } = self.around;
        for (group, views) in groups.iter().zip(views.chunks(GROUP)) {
            let (may, least) = group.bounded(simd, self.query);
            let all = views.iter().zip(least).zip(may);
            let within =
                all.filter_map(|((view, least), may)| (may != 0).then_some((least, *view)));
            self.found.extend(within);
        }
    }
}

fn in_groups(bounds: &[Bounds]) -> Vec<Group> {
    let groups = bounds.par_chunks(GROUP).with_min_len(ALONE / GROUP);
    groups.map(Group::new).collect()
}

/// Sorts views such that each group of eight, eight such groups, and so on are near one another: parts are
/// halved across their longest side, the first half having as many as a power of two.
fn arrange(views: &mut [(DVec3, u32)]) {
    if views.len() <= GROUP {
        return;
    }
    let (least, most) = views.iter().fold(
        (DVec3::INFINITY, DVec3::NEG_INFINITY),
        |(least, most), (center, _)| (least.min(*center), most.max(*center)),
    );
    let wide = most - least;
    let axis = if wide.x >= wide.y && wide.x >= wide.z {
        0
    } else if wide.y >= wide.z {
        1
    } else {
        2
    };
    let middle = views.len().next_power_of_two() / 2;
    views.select_nth_unstable_by(middle, |a, b| {
        a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1))
    });
    let (first, second) = views.split_at_mut(middle);
    if first.len() > ALONE {
        rayon::join(|| arrange(first), || arrange(second));
    } else {
        arrange(first);
        arrange(second);
    }
}

/// The angle from the axis within which all of a photo lies; more than π where its lens does
/// not say.
pub(crate) fn widest(lens: &Lens, [width, height]: [f64; 2]) -> f64 {
    const STEPS: u32 = 16;
    /// The border between two steps may bulge.
    const MARGIN: f64 = 1.05;
    let mut widest = 0.0_f64;
    for i in 0..=STEPS {
        let share = f64::from(i) / f64::from(STEPS);
        let (x, y) = (share * width, share * height);
        for (x, y) in [(x, 0.0), (x, height), (0.0, y), (width, y)] {
            let Some(ray) = lens.unproject(Pixel::new(x, y)) else {
                return 2.0 * PI;
            };
            widest = widest.max(ray.truncate().length().atan2(ray.z));
        }
    }
    widest * MARGIN
}

fn cosine_and_sine(angle: f64) -> Option<[f64; 2]> {
    (angle < PI).then(|| [angle.cos() - SLACK, angle.sin()])
}

#[cfg(test)]
mod tests;
