//! Eight source views, or parts of the hierarchy, that are asked together.

use super::{Ball, GROUP, Measure, SLACK};
use glam::DVec3;
use pulp::Simd;
use std::array::from_fn;
use std::ops::{Add, Div, Mul, Sub};

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

    /// Which of them can differ by as little as is asked for and may see something, one for those and zero for the others;
    /// and by how much each differs at least: by nothing where that is no number.
    #[inline(always)]
    pub(super) fn bounded<S: Simd>(&self, simd: S, query: &Query) -> ([u32; GROUP], Each) {
        const { assert!(GROUP.is_multiple_of(S::F32_LANES), "whole vectors") };
        let (mut may, mut least) = ([0; GROUP], [0.0; GROUP]);
        let (may_parts, _) = S::as_mut_simd_u32s(&mut may);
        let (least_parts, _) = S::as_mut_simd_f32s(&mut least);
        let parts = may_parts.iter_mut().zip(least_parts).enumerate();
        for (part, (may, least)) in parts {
            let (matters, bound) = self.bounded_part(simd, part, query);
            *may = simd.select_u32s(matters, simd.splat_u32s(1), simd.splat_u32s(0));
            *least = bound.0;
        }
        (may, least)
    }

    /// The same of as many as a vector holds.
    #[inline(always)]
    fn bounded_part<S: Simd>(&self, simd: S, part: usize, query: &Query) -> (S::m32s, Many<S>) {
        let many = |of: &Each| Many(S::as_simd_f32s(of).0[part], simd);
        let all = |x: f32| Many(simd.splat_f32s(x), simd);
        let [zero, one] = [0.0, 1.0].map(all);
        let rounding_of_one = all(ROUNDING);
        let (here, by_here) = (all(query.here), all(query.by_here));
        let (query_radius, footprint_ratio) = (all(query.radius), many(&self.footprint_ratio));
        let [x, y, z] = [0, 1, 2].map(|axis| all(query.center[axis]) - many(&self.center[axis]));
        let distance = (x * x + y * y + z * z).sqrt();
        let far = many(&self.far);
        let rounding = rounding_of_one * (here + far);
        let own = many(&self.radius) + rounding;

        // 1. How little they can differ from the viewer: the angle at the ball's middle less what they
        // subtend. From elsewhere in the ball it differs by how much: the gradients of both the angle between viewer
        // and view and the logarithm of the ratio of their distances are as long as their distance over the
        // product of the two. Away from the viewer the angle's is only how far the view is from the line of
        // sight, over the square of its distance: less is lost where it is known that points are about in one
        // direction, and little aside: first away to where they are, then aside.
        let near = distance - own - query_radius;
        let [tx, ty, tz] = query.towards.map(all);
        let p = ty * z - tz * y;
        let q = tz * x - tx * z;
        let r = tx * y - ty * x;
        let across = (p * p + q * q + r * r).sqrt();
        let (vary, turn) = match query.radius > 0.0 {
            true => {
                let by_near = one / near;
                let vary = far * (all(query.per_far) * by_near) + rounding_of_one;
                let off = (across + own) * by_near;
                let turn = (off * all(query.along) + far * all(query.aside)) * by_near;
                let turn = turn + rounding_of_one;
                (vary, Many::either(turn.is_below(vary), turn, vary))
            }
            false => (rounding_of_one, rounding_of_one),
        };
        let towards = tx * x + ty * y + tz * z;
        let by_distance = one / distance;
        // At most the angle: its sine, or one where that is obtuse; where those are too little to tell,
        // a closer bound.
        let sine = across * by_distance;
        let angle = match query.most < SINES_TELL {
            true => {
                let obtuse = Many::either(towards.is_above(zero), zero, one);
                Many::either(sine.is_above(obtuse), sine, obtuse)
            }
            false => less_than_angle(sine, towards * by_distance),
        };
        let between = angle - more_than_asin(own * by_distance) - turn;
        let coarser = match query.by_length {
            true => near - here - query_radius,
            false => {
                let there = (distance - own) * by_here;
                footprint_ratio * there * (one - vary - rounding_of_one) - one
            }
        };
        let sum = between.at_least_0() + all(query.beta) * (coarser - rounding_of_one).at_least_0();
        let least = sum * all(query.counts);

        // 2. Where the ball lies: not in sight of what it is farther from the axis than they see, and it
        // subtends. The cosine and sine of what it subtends, and of the sum of both angles, all by the distance;
        // the sum is beyond π where its sine is negative.
        let reach = own + all(query.sight);
        let sharp = ((distance - reach) * (distance + reach))
            .at_least_0()
            .sqrt();
        let [cos, sin] = [0, 1].map(|k| many(&self.spread[k]));
        let sum_cos = cos * sharp - sin * reach;
        let sum_sin = sin * sharp + cos * reach;
        let [ax, ay, az] = [0, 1, 2].map(|axis| many(&self.axis[axis]));
        let before = ax * x + ay * y + az * z;

        // 3. What is no number, or not one that f32 has the square of, is kept.
        let and = |a: S::m32s, b: S::m32s| simd.and_m32s(a, b);
        let is_told = and(
            distance.is_above(all(NEAREST)),
            distance.is_below(all(FARTHEST)),
        );
        let is_apart = and(is_told, near.is_above(zero));
        let bound = Many::either(is_apart, least, zero).at_least_0();
        let is_much = bound.is_above(all(query.most));
        let is_within_half_a_turn = and(reach.is_below(distance), sum_sin.is_above(zero));
        let is_aside = before.is_below(sum_cos - rounding);
        let is_far = and(is_told, and(is_within_half_a_turn, is_aside));
        (simd.not_m32s(simd.or_m32s(is_much, is_far)), bound)
    }
}

/// Numbers of as many as a vector holds.
#[derive(Clone, Copy)]
struct Many<S: Simd>(S::f32s, S);

impl<S: Simd> Add for Many<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.1.add_f32s(self.0, other.0), self.1)
    }
}

impl<S: Simd> Sub for Many<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.1.sub_f32s(self.0, other.0), self.1)
    }
}

impl<S: Simd> Mul for Many<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.1.mul_f32s(self.0, other.0), self.1)
    }
}

impl<S: Simd> Div for Many<S> {
    type Output = Self;

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(self.1.div_f32s(self.0, other.0), self.1)
    }
}

impl<S: Simd> Many<S> {
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.1.sqrt_f32s(self.0), self.1)
    }

    /// Not where one is no number.
    #[inline(always)]
    fn is_above(self, other: Self) -> S::m32s {
        self.1.greater_than_f32s(self.0, other.0)
    }

    /// Not where one is no number.
    #[inline(always)]
    fn is_below(self, other: Self) -> S::m32s {
        self.1.less_than_f32s(self.0, other.0)
    }

    #[inline(always)]
    fn either(holds: S::m32s, then: Self, otherwise: Self) -> Self {
        let simd = then.1;
        Self(simd.select_f32s(holds, then.0, otherwise.0), simd)
    }

    #[inline(always)]
    fn of(self, x: f32) -> Self {
        Self(self.1.splat_f32s(x), self.1)
    }

    /// Zero where it is less, or no number.
    #[inline(always)]
    fn at_least_0(self) -> Self {
        let zero = self.of(0.0);
        Self::either(self.is_above(zero), self, zero)
    }
}

/// At most the angle, up to π, of which these are sine and cosine: twice Shafer's bound of the arctangent,
/// 3τ / (1 + 2 √(1 + τ²)), for that of its half.
#[inline(always)]
fn less_than_angle<S: Simd>(sine: Many<S>, cosine: Many<S>) -> Many<S> {
    let more = (sine.of(1.0) + cosine).at_least_0();
    let bound = sine.of(6.0) * sine / (more + (sine.of(8.0) * more).sqrt());
    // What it tends to: near π rounding could make more of it.
    let most = sine.of(3.0);
    Many::either(bound.is_below(most), bound, most)
}

/// At least asin x, of 0…1.
#[inline(always)]
fn more_than_asin<S: Simd>(x: Many<S>) -> Many<S> {
    // x over asin x falls steadily.
    let steep = Many::either(x.is_below(x.of(0.5)), x.of(1.048), x.of(1.571));
    x * Many::either(x.is_below(x.of(0.25)), x.of(1.011), steep)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::Scalar;
    use std::f64::consts::PI;

    #[test]
    fn bounds_of_angles_are_below_them_and_near() {
        let near_pi = (0..60).map(|i| PI - 0.1 * 0.5_f64.powi(i));
        for angle in (0..=1000)
            .map(|i| PI * f64::from(i) / 1000.0)
            .chain(near_pi)
        {
            let (sine, cosine) = angle.sin_cos();
            let [sine, cosine] = [sine.max(0.0), cosine].map(|x| Many(x as f32, Scalar::new()));
            let bound = f64::from(less_than_angle(sine, cosine).0);
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
