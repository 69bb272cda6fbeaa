//! The source views that can matter around a point of the proxy, without looking at all.
//!
//! A hierarchy of spheres around the source views' centres, each with the cone of what its
//! views look at. A sphere is passed over when no view in it can differ from the desired one
//! by as little as is asked for, or none has the point in its image. The bound is the angle
//! between the ray and the sphere, less what sphere and point subtend, plus β times the least
//! excess of footprint. What is found is therefore *all* that lies within a difference, and a few
//! more; `near.rs` has how an exact field comes of it.

use crate::frame::{FrameSource, ProxyPoint};
use crate::planted::{Fault, is_planted};
use calibrate::{Lens, Pixel};
use glam::DVec3;
use std::f64::consts::PI;

/// Views of a leaf, at most.
const LEAF: usize = 6;
/// More views than this are worth a thread.
const ALONE: usize = 1024;
/// With fewer views than this, asking each is faster.
const FEWEST: usize = 48;
/// Radians by which bounds are lowered, and lengths by which radii are raised, relative to what
/// they are computed from: more than rounding can take.
const SLACK: f64 = 1e-9;

/// A part of space around the proxy, in the desired camera's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ball {
    pub center: DVec3,
    /// Within it, a view may differ little.
    pub radius: f64,
    /// Within it, a view may see something; infinite for anywhere.
    pub sight: f64,
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
        })
    }
}

/// Of one view, or of all within a node.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    /// In the desired camera's frame.
    center: DVec3,
    radius: f64,
    /// What they look along.
    axis: DVec3,
    /// Cosine and sine of the angle from it within which all that they see lies; `None` where it
    /// is all around.
    spread: Option<[f64; 2]>,
    footprint_ratio: f64,
    /// How far from the viewer the farthest may be.
    far: f64,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Bounds,
    /// Its views' places in the order.
    start: u32,
    end: u32,
    /// How far behind it its other half is; its first half follows it. Zero for leaves.
    second: u32,
}

/// The source views that take part in a frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct ViewTree {
    nodes: Vec<Node>,
    /// The views in the order of the nodes, and their indices.
    views: Vec<(Bounds, u32)>,
}

/// What is asked of the tree.
struct Query<'a> {
    ball: &'a Ball,
    measure: Measure,
    most: f64,
    /// From the viewer to the ball's middle, and one over it.
    here: f64,
    by_here: f64,
}

/// What differences are made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measure {
    pub beta: f64,
    pub by_length: bool,
}

impl ViewTree {
    /// With a hierarchy where that is faster than asking each view, and `may_skip`.
    pub(crate) fn new(sources: &[FrameSource], may_skip: bool) -> Self {
        let mut last: Option<(Lens, [f64; 2], f64)> = None;
        let mut views: Vec<(Bounds, u32)> = Vec::with_capacity(sources.len());
        for (i, source) in sources.iter().enumerate() {
            if !source.takes_part() {
                continue;
            }
            // Most photos share their lens.
            let spread = match last {
                Some((lens, size, spread)) if lens == source.lens && size == source.size => spread,
                _ => widest(&source.lens, source.size),
            };
            last = Some((source.lens, source.size, spread));
            let bounds = Bounds {
                center: source.center,
                radius: 0.0,
                axis: source.rotation.row(2),
                spread: cosine_and_sine(spread),
                footprint_ratio: source.footprint_ratio,
                far: source.center.length(),
            };
            views.push((bounds, i as u32));
        }
        let mut nodes = Vec::new();
        if may_skip && views.len() >= FEWEST {
            let mut order: Vec<(DVec3, u32)> = views
                .iter()
                .zip(0..)
                .map(|(view, i)| (view.0.center, i))
                .collect();
            arrange(&mut order);
            views = order.iter().map(|(_, i)| views[*i as usize]).collect();
            add_nodes(&views, 0, &mut nodes);
        }
        Self { nodes, views }
    }

    /// Whether so many views take part that a list of all of them costs more than finding those
    /// that can count.
    pub(crate) fn is_large(&self) -> bool {
        self.views.len() >= FEWEST
    }

    /// The views, by index, that may differ by `most` or less somewhere in a ball and may have
    /// something in their images that is in sight of it. All that do are among them.
    pub(crate) fn within(&self, ball: &Ball, measure: Measure, most: f64, found: &mut Vec<u32>) {
        found.clear();
        let here = ball.center.length();
        let query = &Query {
            ball,
            measure,
            most,
            here,
            by_here: 1.0 / here,
        };
        let near = |views: &[(Bounds, u32)], found: &mut Vec<u32>| {
            let near = views.iter().filter(|v| v.0.may_matter(query));
            found.extend(near.map(|(_, i)| *i));
        };
        if self.nodes.is_empty() {
            near(&self.views, found);
            return;
        }
        let drops_one = is_planted(Fault::DroppedView);
        let mut stack = Vec::with_capacity(32);
        stack.push(0_u32);
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            if !node.bounds.may_matter(query) {
                continue;
            }
            if node.second == 0 {
                near(&self.views[node.start as usize..node.end as usize], found);
            } else {
                stack.push(index + node.second);
                stack.push(index + 1);
            }
        }
        found.sort_unstable();
        if drops_one {
            found.pop();
        }
    }
}

/// Sorts views such that halves are apart, and halves of halves, as [`add_nodes`] takes them.
fn arrange(views: &mut [(DVec3, u32)]) {
    if views.len() <= LEAF {
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
    let middle = views.len() / 2;
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

/// Adds the node of some views, of which the first is at `start` in the order, and then all below
/// it.
fn add_nodes(views: &[(Bounds, u32)], start: usize, nodes: &mut Vec<Node>) {
    let index = nodes.len();
    let leaf = views.len() <= LEAF;
    let of_each = views.iter().map(|v| v.0);
    let bounds = match leaf {
        true => of_each.reduce(Bounds::join),
        // Until its halves are known.
        false => None,
    };
    nodes.push(Node {
        bounds: bounds.unwrap_or(views[0].0),
        start: start as u32,
        end: (start + views.len()) as u32,
        second: 0,
    });
    if leaf {
        return;
    }
    let middle = views.len() / 2;
    let (first, rest) = views.split_at(middle);
    let second;
    if middle > ALONE {
        let of_rest = || {
            let mut nodes = Vec::new();
            add_nodes(rest, start + middle, &mut nodes);
            nodes
        };
        let (rest, ()) = rayon::join(of_rest, || add_nodes(first, start, nodes));
        second = nodes.len();
        nodes.extend(rest);
    } else {
        add_nodes(first, start, nodes);
        second = nodes.len();
        add_nodes(rest, start + middle, nodes);
    }
    nodes[index].second = (second - index) as u32;
    nodes[index].bounds = nodes[index + 1].bounds.join(nodes[second].bounds);
}

/// The angle from the axis within which all of a photo lies; more than π where its lens does
/// not say.
fn widest(lens: &Lens, [width, height]: [f64; 2]) -> f64 {
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

/// The angle between two vectors.
fn angle(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

/// At least asin x, of 0…1.
fn more_than_asin(x: f64) -> f64 {
    // x over asin x falls steadily.
    x * if x < 0.25 {
        1.011
    } else if x < 0.5 {
        1.048
    } else {
        1.571
    }
}

/// At most the angle of which one has the sine and the sign of the cosine.
fn less_than_angle(sine: f64, cosine: f64) -> f64 {
    if cosine > 0.0 { sine } else { 1.0 }
}

fn cosine_and_sine(angle: f64) -> Option<[f64; 2]> {
    (angle < PI).then(|| [angle.cos() - SLACK, angle.sin()])
}

impl Bounds {
    /// Of both together.
    fn join(self, other: Self) -> Self {
        let away = other.center - self.center;
        let distance = away.length();
        let radius = (0.5 * (distance + self.radius + other.radius))
            .max(self.radius)
            .max(other.radius);
        let center = if distance > 0.0 {
            self.center + away * ((radius - self.radius) / distance).clamp(0.0, 1.0)
        } else {
            self.center
        };
        let radius = [self, other]
            .map(|half| half.center.distance(center) + half.radius)
            .into_iter()
            .fold(0.0, f64::max);
        let axis = (self.axis + other.axis).normalize_or(DVec3::Z);
        let spread = [self, other].map(|half| {
            let own = half.spread.map_or(PI, |[cos, sin]| sin.atan2(cos));
            angle(axis, half.axis) + own
        });
        Self {
            center,
            radius,
            axis,
            spread: cosine_and_sine(spread[0].max(spread[1])),
            footprint_ratio: self.footprint_ratio.min(other.footprint_ratio),
            far: center.length() + radius,
        }
    }

    fn may_matter(&self, query: &Query<'_>) -> bool {
        let away = query.ball.center - self.center;
        let distance = away.length();
        let slack = SLACK * (query.here + self.far);
        self.may_differ_by_so_little(query, away, distance, self.radius + slack)
            && self.may_see(away, distance, self.radius + slack + query.ball.sight)
    }

    /// Whether any of them can have in its image what is `away` and within a reach: not where it is
    /// farther from what they look along than they see, and it subtends.
    fn may_see(&self, away: DVec3, distance: f64, reach: f64) -> bool {
        let Some([cos, sin]) = self.spread.filter(|_| reach < distance) else {
            return true;
        };
        // The cosine and sine of what it subtends, and of the sum of both angles, which is beyond
        // π where its sine is negative; all by the distance.
        let sharp = ((distance - reach) * (distance + reach)).sqrt();
        let (sum_cos, sum_sin) = (cos * sharp - sin * reach, sin * sharp + cos * reach);
        sum_sin <= 0.0 || self.axis.dot(away) >= sum_cos - SLACK * distance
    }

    /// Whether any of them, within `own` of their middle, can differ by as little as is asked for
    /// within the ball's radius.
    fn may_differ_by_so_little(
        &self,
        query: &Query<'_>,
        away: DVec3,
        distance: f64,
        own: f64,
    ) -> bool {
        let (ball, measure) = (query.ball, query.measure);
        let near = distance - own - ball.radius;
        let least_here = query.here - ball.radius;
        if !(near > 0.0 && least_here > 0.0) {
            return true;
        }
        let across = ball.center.cross(away).length_squared();
        let along = ball.center.dot(away);
        // Most are too far aside, and for a point that takes no division: the angle is more than
        // its sine, and what they subtend less than 1.011 of its sine.
        let aside = query.here * (distance * (query.most + SLACK) + 1.011 * own);
        if ball.radius == 0.0
            && along > 0.0
            && own < 0.25 * distance
            && across > (aside * aside) * (1.0 + SLACK)
        {
            return false;
        }
        // How little any of them can differ from the ball's middle, and by how much less from
        // elsewhere in it: the gradients of both the angle between viewer and view and the
        // logarithm of the ratio of their distances are as long as their distance over the
        // product of the two.
        let vary = if ball.radius > 0.0 {
            ball.radius * self.far / (near * least_here) + SLACK
        } else {
            SLACK
        };
        let by_distance = 1.0 / distance;
        let sine = ball.center.cross(away).length() * (query.by_here * by_distance);
        let between =
            less_than_angle(sine, ball.center.dot(away)) - more_than_asin(own * by_distance) - vary;
        let coarser = if measure.by_length {
            near - query.here - ball.radius
        } else {
            self.footprint_ratio * ((distance - own) * query.by_here) * (1.0 - vary) - 1.0
        };
        let least = between.max(0.0) + measure.beta * (coarser - SLACK).max(0.0);
        // What is no number is kept.
        !(least > query.most)
    }
}
