//! The source views that can matter around a point of the proxy, without looking at all.
//!
//! A hierarchy of spheres around the source views' centres, each with the cone of what its
//! views look at. A sphere is passed over when no view in it can differ from the desired one
//! by as little as is asked for, or none has the point in its image. The bound is the angle
//! between the ray and the sphere, less what sphere and point subtend, plus β times the least
//! excess of footprint. What is found is therefore *all* that lies within a difference, and a few
//! more; `near.rs` has how an exact field comes of it.

use crate::frame::{FrameSource, ProxyPoint};
use calibrate::{Lens, Pixel};
use glam::DVec3;
use std::f64::consts::PI;

/// Views of a leaf, at most.
const LEAF: usize = 6;
/// With fewer views than this, asking each is faster.
const FEWEST: usize = 48;
/// Radians by which bounds are lowered, and lengths by which radii are raised, relative to what
/// they are computed from: more than rounding can take.
const SLACK: f64 = 1e-9;

/// A part of space around the proxy, in the desired camera's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ball {
    pub center: DVec3,
    pub radius: f64,
}

impl Ball {
    /// A point and what is within a distance of it; `None` at infinity.
    pub(crate) fn around(point: &ProxyPoint, radius: f64) -> Option<Self> {
        let center = point.ray / point.inverse_distance;
        (center.is_finite() && radius.is_finite()).then_some(Self { center, radius })
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
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Bounds,
    /// Its views' places in the order.
    start: u32,
    end: u32,
    /// The other half's index; its own first half follows it. Zero for leaves.
    second: u32,
}

/// The source views that take part in a frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct ViewTree {
    nodes: Vec<Node>,
    /// The views in the order of the nodes, and their indices.
    views: Vec<(Bounds, u32)>,
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
            };
            views.push((bounds, i as u32));
        }
        let mut tree = Self {
            nodes: Vec::with_capacity(2 * views.len() / LEAF + 1),
            views,
        };
        if may_skip && tree.is_large() {
            tree.split(0, tree.views.len());
        }
        tree
    }

    /// Whether so many views take part that a list of all of them costs more than finding those
    /// that can count.
    pub(crate) fn is_large(&self) -> bool {
        self.views.len() >= FEWEST
    }

    /// Makes the node of a part of the views and all below it.
    fn split(&mut self, start: usize, end: usize) {
        let index = self.nodes.len();
        let leaf = end - start <= LEAF;
        let of_each = self.views[start..end].iter().map(|v| v.0);
        let bounds = match leaf {
            true => of_each.reduce(Bounds::join),
            // Until its halves are known.
            false => None,
        };
        self.nodes.push(Node {
            bounds: bounds.unwrap_or(self.views[start].0),
            start: start as u32,
            end: end as u32,
            second: 0,
        });
        if leaf {
            return;
        }
        let (least, most) = extent(&self.views[start..end]);
        let axis = (0..3).fold(0, |best, k| {
            if most[k] - least[k] > most[best] - least[best] {
                k
            } else {
                best
            }
        });
        let middle = start + (end - start) / 2;
        self.views[start..end].select_nth_unstable_by(middle - start, |a, b| {
            let along = a.0.center[axis].total_cmp(&b.0.center[axis]);
            along.then(a.1.cmp(&b.1))
        });
        self.split(start, middle);
        let second = self.nodes.len();
        self.split(middle, end);
        self.nodes[index].second = second as u32;
        self.nodes[index].bounds = self.nodes[index + 1].bounds.join(self.nodes[second].bounds);
    }

    /// The views, by index, that may differ by `most` or less somewhere in a ball and may have
    /// some of it in their images. All that do are among them.
    pub(crate) fn within(&self, ball: &Ball, measure: Measure, most: f64, found: &mut Vec<u32>) {
        found.clear();
        let near = |views: &[(Bounds, u32)], found: &mut Vec<u32>| {
            let near = views.iter().filter(|v| v.0.may_matter(ball, measure, most));
            found.extend(near.map(|(_, i)| *i));
        };
        if self.nodes.is_empty() {
            near(&self.views, found);
            return;
        }
        let mut stack = Vec::with_capacity(32);
        stack.push(0_u32);
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            if !node.bounds.may_matter(ball, measure, most) {
                continue;
            }
            if node.second == 0 {
                near(&self.views[node.start as usize..node.end as usize], found);
            } else {
                stack.push(node.second);
                stack.push(index + 1);
            }
        }
        found.sort_unstable();
    }
}

fn extent(views: &[(Bounds, u32)]) -> (DVec3, DVec3) {
    let all = views.iter().map(|v| v.0.center);
    all.fold(
        (DVec3::INFINITY, DVec3::NEG_INFINITY),
        |(least, most), c| (least.min(c), most.max(c)),
    )
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
        }
    }

    fn may_matter(&self, ball: &Ball, measure: Measure, most: f64) -> bool {
        let away = ball.center - self.center;
        let distance = away.length();
        let here = ball.center.length();
        let reach = self.radius + ball.radius + SLACK * (here + self.center.length());
        let near = distance - reach;
        let least_here = here - ball.radius;
        if !(near > 0.0 && least_here > 0.0) {
            return true;
        }
        // 1. How little any of them can differ from the ball's middle, and by how much less from
        // elsewhere in it: the gradients of both the angle between viewer and view and the
        // logarithm of the ratio of their distances are as long as their distance over the
        // product of the two.
        let apart = self.center.length() + self.radius;
        let vary = ball.radius * apart / (near * least_here) + SLACK;
        let sine = ball.center.cross(away).length() / (here * distance);
        let between = less_than_angle(sine, ball.center.dot(away))
            - more_than_asin((reach - ball.radius) / distance)
            - vary;
        let coarser = if measure.by_length {
            near - here - ball.radius
        } else {
            self.footprint_ratio * ((near + ball.radius) / here) * (1.0 - vary) - 1.0
        };
        if between.max(0.0) + measure.beta * (coarser - SLACK).max(0.0) > most {
            return false;
        }
        // 2. Whether any of them can have it in its image: not where it is farther from what they
        // look along than they see, and it subtends.
        let Some([cos, sin]) = self.spread else {
            return true;
        };
        let blurred = reach / distance;
        let sharp = (1.0 - blurred * blurred).max(0.0).sqrt();
        // The sum of both angles is beyond π where its sine is negative.
        let (sum_cos, sum_sin) = (cos * sharp - sin * blurred, sin * sharp + cos * blurred);
        sum_sin <= 0.0 || self.axis.dot(away) >= (sum_cos - SLACK) * distance
    }
}
