//! Eight source views, or parts of the hierarchy, that are asked together.

use super::{Ball, GROUP, Measure, SLACK};
use glam::DVec3;
use std::array::from_fn;
use std::ops::BitAnd;

/// Of one view, or of all within a part of the hierarchy.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// In the desired camera's frame.
    pub(super) center: DVec3,
    pub(super) radius: f64,
    /// What they look along.
    pub(super) axis: DVec3,
    /// Cosine and sine of the angle from it within which all that they see lies; `None` where it
    /// is all around.
    pub(super) spread: Option<[f64; 2]>,
    pub(super) footprint_ratio: f64,
    /// How far from the viewer the farthest may be.
    pub(super) far: f64,
}

impl Bounds {
    /// Of all together; of one at least.
    pub(super) fn around(all: &[Self]) -> Self {
        // 1. Their sphere, around the middle of their box.
        let (least, most) = all.iter().fold(
            (DVec3::INFINITY, DVec3::NEG_INFINITY),
            |(least, most), one| {
                let radius = DVec3::splat(one.radius);
                (
                    least.min(one.center - radius),
                    most.max(one.center + radius),
                )
            },
        );
        let center = 0.5 * (least + most);
        let reach = all.iter().map(|b| b.center.distance(center) + b.radius);
        let radius = reach.fold(0.0, f64::max);
        // 2. Their cone: an angle from the common axis is at most that of their own axis and what they see
        // from that.
        let axis = all.iter().map(|b| b.axis).sum::<DVec3>();
        let axis = axis.normalize_or(DVec3::Z);
        let mut spread = Some([1.0, 0.0]);
        for one in all {
            let from_axis = one.spread.and_then(|[own_cos, own_sin]| {
                let (cos, sin) = (axis.dot(one.axis), axis.cross(one.axis).length());
                let sum = [cos * own_cos - sin * own_sin, sin * own_cos + cos * own_sin];
                // Beyond π the sine of the sum is negative.
                (sum[1] >= 0.0).then_some([sum[0] - 2.0 * SLACK, sum[1]])
            });
            spread = match (spread, from_axis) {
                (Some(widest), Some(own)) if own[0] >= widest[0] => Some(widest),
                (Some(_), own) => own,
                (None, _) => None,
            };
        }
        let ratios = all.iter().map(|b| b.footprint_ratio);
        Self {
            center,
            radius,
            axis,
            spread,
            footprint_ratio: ratios.fold(f64::INFINITY, f64::min),
            far: center.length() + radius,
        }
    }
}

/// Of angles of so many radians sines are little less: 2 per cent.
const SINES_TELL: f32 = 0.35;

/// What rounding to f32 may take off bounds, in shares of what they are computed from: of angles in radians, of
/// lengths in shares of how far from the viewer view and ball are together. More than ten times what it does.
const ROUNDING: f32 = 4e-6;

/// Distances whose squares f32 has.
const NEAREST: f32 = 1e-15;
const FARTHEST: f32 = 1e15;

/// A number of each.
type Each = [f32; GROUP];

/// All bits of a word, or none, for each.
#[derive(Clone, Copy)]
struct Mask([u32; GROUP]);

#[inline(always)]
fn mask(f: impl Fn(usize) -> bool) -> Mask {
    let mut all = [0; GROUP];
    for i in 0..GROUP {
        all[i] = if f(i) { u32::MAX } else { 0 };
    }
    Mask(all)
}

impl BitAnd for Mask {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        let mut both = [0; GROUP];
        for i in 0..GROUP {
            both[i] = self.0[i] & other.0[i];
        }
        Self(both)
    }
}

#[inline(always)]
fn each(f: impl Fn(usize) -> f32) -> Each {
    let mut all = [0.0; GROUP];
    for i in 0..GROUP {
        all[i] = f(i);
    }
    all
}

/// The bounds of eight, side by side. In f32, of which vectors hold eight: what that rounds is allowed for
/// when they are asked.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    center: [Each; 3],
    radius: Each,
    axis: [Each; 3],
    spread: [Each; 2],
    footprint_ratio: Each,
    far: Each,
}

/// What is asked.
pub(super) struct Query {
    /// The ball's middle, seen from the viewer.
    center: [f32; 3],
    /// The way there, of unit length.
    towards: [f32; 3],
    /// How far that is, and one over it.
    here: f32,
    by_here: f32,
    /// The ball's radius, and how far from it something is in sight.
    radius: f32,
    sight: f32,
    aside: f32,
    along: f32,
    by_length: bool,
    beta: f32,
    /// The ball's radius over how near it is to the viewer.
    per_far: f32,
    most: f32,
    /// What bounds are multiplied by: less than one, for rounding. Where the ball is around the viewer nothing is
    /// known, and it is zero.
    counts: f32,
}

impl Query {
    pub(super) fn new(ball: &Ball, measure: Measure, most: f64) -> Self {
        let here = ball.center.length();
        let in_f32 = |v: DVec3| v.to_array().map(|x| x as f32);
        // No less than it is.
        let above = |x: f64| x as f32 * (1.0 + ROUNDING);
        let least_here = here as f32 * (1.0 - ROUNDING) - above(ball.radius);
        Self {
            center: in_f32(ball.center),
            towards: in_f32(ball.center / here),
            here: here as f32,
            by_here: (1.0 / here) as f32,
            radius: above(ball.radius),
            sight: above(ball.sight),
            aside: above(ball.apart.aside),
            along: above(ball.apart.along),
            by_length: measure.by_length,
            beta: measure.beta as f32,
            per_far: above(ball.radius) / least_here,
            most: above(most),
            counts: if least_here > 0.0 {
                1.0 - ROUNDING
            } else {
                0.0
            },
        }
    }
}

impl Group {
    /// Of one to eight; in place of those that are missing the last.
    pub(super) fn new(bounds: &[Bounds]) -> Self {
        let all: [Bounds; GROUP] = from_fn(|i| bounds[i.min(bounds.len() - 1)]);
        // All around: half a turn.
        let spread = all.map(|b| b.spread.unwrap_or([-1.0, 0.0]));
        let of = |number: &dyn Fn(&Bounds) -> f64| all.each_ref().map(|b| number(b) as f32);
        Self {
            center: [0, 1, 2].map(|axis| of(&|b| b.center[axis])),
            radius: of(&|b| b.radius),
            axis: [0, 1, 2].map(|axis| of(&|b| b.axis[axis])),
            spread: [0, 1].map(|k| spread.map(|s| s[k] as f32)),
            footprint_ratio: of(&|b| b.footprint_ratio),
            far: of(&|b| b.far),
        }
    }

    /// Takes over one of another group.
    #[inline(always)]
    pub(super) fn put(&mut self, lane: usize, from: &Self, of: usize) {
        for axis in 0..3 {
            self.center[axis][lane] = from.center[axis][of];
            self.axis[axis][lane] = from.axis[axis][of];
        }
        for k in 0..2 {
            self.spread[k][lane] = from.spread[k][of];
        }
        self.radius[lane] = from.radius[of];
        self.footprint_ratio[lane] = from.footprint_ratio[of];
        self.far[lane] = from.far[of];
    }

    /// Which of them can differ by as little as is asked for and may see something.
    #[inline(always)]
    pub(super) fn may_matter(&self, query: &Query) -> [bool; GROUP] {
        self.bounded(query).0
    }

    /// The same, and by how much each differs at least: by nothing where that is no number.
    #[inline(always)]
    pub(super) fn bounded(&self, query: &Query) -> ([bool; GROUP], [f32; GROUP]) {
        let (here, by_here) = (query.here, query.by_here);
        // One after the other: arrays of arrays go to memory and back.
        let [cx, cy, cz] = query.center;
        let x = each(|i| cx - self.center[0][i]);
        let y = each(|i| cy - self.center[1][i]);
        let z = each(|i| cz - self.center[2][i]);
        let distance = each(|i| (x[i] * x[i] + y[i] * y[i] + z[i] * z[i]).sqrt());
        let rounding = each(|i| ROUNDING * (here + self.far[i]));
        let own = each(|i| self.radius[i] + rounding[i]);

        // 1. How little they can differ from the viewer: the angle at the ball's middle less what they
        // subtend. From elsewhere in the ball it differs by how much: the gradients of both the angle between viewer
        // and view and the logarithm of the ratio of their distances are as long as their distance over the
        // product of the two. Away from the viewer the angle's is only how far the view is from the line of
        // sight, over the square of its distance: less is lost where it is known that points are about in one
        // direction, and little aside: first away to where they are, then aside.
        let near = each(|i| distance[i] - own[i] - query.radius);
        let [tx, ty, tz] = query.towards;
        let p = each(|i| ty * z[i] - tz * y[i]);
        let q = each(|i| tz * x[i] - tx * z[i]);
        let r = each(|i| tx * y[i] - ty * x[i]);
        let across = each(|i| (p[i] * p[i] + q[i] * q[i] + r[i] * r[i]).sqrt());
        let (vary, turn) = match query.radius > 0.0 {
            true => {
                let by_near = each(|i| 1.0 / near[i]);
                let vary = each(|i| self.far[i] * (query.per_far * by_near[i]) + ROUNDING);
                let turn = each(|i| {
                    let off = (across[i] + own[i]) * by_near[i];
                    (off * query.along + self.far[i] * query.aside) * by_near[i] + ROUNDING
                });
                (
                    vary,
                    each(|i| if turn[i] < vary[i] { turn[i] } else { vary[i] }),
                )
            }
            false => ([ROUNDING; GROUP], [ROUNDING; GROUP]),
        };
        let towards = each(|i| tx * x[i] + ty * y[i] + tz * z[i]);
        let by_distance = each(|i| 1.0 / distance[i]);
        // At most the angle: its sine, or one where that is obtuse; where those are too little to tell,
        // a closer bound.
        let sine = each(|i| across[i] * by_distance[i]);
        let angle = match query.most < SINES_TELL {
            true => {
                let obtuse = each(|i| if towards[i] > 0.0 { 0.0 } else { 1.0 });
                each(|i| sine[i].max(obtuse[i]))
            }
            false => each(|i| less_than_angle(sine[i], towards[i] * by_distance[i])),
        };
        let between = each(|i| angle[i] - more_than_asin(own[i] * by_distance[i]) - turn[i]);
        let coarser = match query.by_length {
            true => each(|i| near[i] - here - query.radius),
            false => each(|i| {
                let there = (distance[i] - own[i]) * by_here;
                self.footprint_ratio[i] * there * (1.0 - vary[i] - ROUNDING) - 1.0
            }),
        };
        let least = each(|i| {
            let sum = at_least_0(between[i]) + query.beta * at_least_0(coarser[i] - ROUNDING);
            sum * query.counts
        });

        // 2. Where the ball lies: not in sight of what it is farther from the axis than they see, and it
        // subtends. The cosine and sine of what it subtends, and of the sum of both angles, all by the distance;
        // the sum is beyond π where its sine is negative.
        let reach = each(|i| own[i] + query.sight);
        let sharp =
            each(|i| at_least_0((distance[i] - reach[i]) * (distance[i] + reach[i])).sqrt());
        let [cos, sin] = &self.spread;
        let sum_cos = each(|i| cos[i] * sharp[i] - sin[i] * reach[i]);
        let sum_sin = each(|i| sin[i] * sharp[i] + cos[i] * reach[i]);
        let [ax, ay, az] = &self.axis;
        let before = each(|i| ax[i] * x[i] + ay[i] * y[i] + az[i] * z[i]);

        // 3. What is no number, or not one that f32 has the square of, is kept. One comparison after the other:
        // what is put together of several is done one by one.
        let is_told = mask(|i| distance[i] > NEAREST) & mask(|i| distance[i] < FARTHEST);
        let is_apart = is_told & mask(|i| near[i] > 0.0);
        let bound = each(|i| at_least_0(if is_apart.0[i] != 0 { least[i] } else { 0.0 }));
        let is_much = mask(|i| bound[i] > query.most);
        let is_far = is_told
            & mask(|i| reach[i] < distance[i])
            & mask(|i| sum_sin[i] > 0.0)
            & mask(|i| before[i] < sum_cos[i] - rounding[i]);
        let mut may = [false; GROUP];
        for i in 0..GROUP {
            may[i] = (is_much.0[i] | is_far.0[i]) == 0;
        }
        (may, bound)
    }
}

/// Zero where it is less, or no number.
#[inline(always)]
fn at_least_0(x: f32) -> f32 {
    if x > 0.0 { x } else { 0.0 }
}

/// At most the angle, up to π, of which these are sine and cosine: twice Shafer's bound of the arctangent,
/// 3τ / (1 + 2 √(1 + τ²)), for that of its half.
#[inline(always)]
fn less_than_angle(sine: f32, cosine: f32) -> f32 {
    let more = at_least_0(1.0 + cosine);
    let bound = 6.0 * sine / (more + (8.0 * more).sqrt());
    // What it tends to: near π rounding could make more of it.
    if bound < 3.0 { bound } else { 3.0 }
}

/// At least asin x, of 0…1.
#[inline(always)]
fn more_than_asin(x: f32) -> f32 {
    // x over asin x falls steadily.
    let steep = if x < 0.5 { 1.048 } else { 1.571 };
    x * if x < 0.25 { 1.011 } else { steep }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn bounds_of_angles_are_below_them_and_near() {
        let near_pi = (0..60).map(|i| PI - 0.1 * 0.5_f64.powi(i));
        for angle in (0..=1000)
            .map(|i| PI * f64::from(i) / 1000.0)
            .chain(near_pi)
        {
            let (sine, cosine) = angle.sin_cos();
            let bound = f64::from(less_than_angle(sine.max(0.0) as f32, cosine as f32));
            assert!(
                bound <= angle + 0.1 * f64::from(ROUNDING),
                "{angle}: {bound}"
            );
            // At π rounding of the cosine takes the rest.
            let near = if angle < 1.6 { 0.997 } else { 0.85 };
            assert!(
                bound >= near * angle || angle > PI - 5e-4,
                "{angle}: {bound}"
            );
        }
    }
}
