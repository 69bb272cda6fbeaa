//! The ground under a capture: a plane that many points lie on, few lie below, and all
//! cameras are above.

use crate::Plane;
use crate::cloud::median;
use crate::condition::thinnest;
use crate::order::spread_over;
use calibrate::View;
use glam::DVec3;

/// Below this length of the mean upward axis the cameras agree on no up.
const COMMON_UP: f64 = 0.3;
/// Cosine of the widest angle between the ground's normal and the cameras' mean up: 35°,
/// since photos that look down have their upward axes tilted.
const NEAR_UP: f64 = 0.82;
/// Points this near to the plane lie on it, as a share of the points' median distance from
/// the cameras' middle.
const THICKNESS: f64 = 0.01;
/// The most points that may lie below it, farther than three times its thickness.
const BELOW: f64 = 0.03;
/// The fewest that must lie on it: a share of all, and a number.
const ON: f64 = 0.04;
const FEWEST: usize = 12;
/// The points on it must spread at least this much across as along; a strip along the foot of
/// a wall could tilt any way.
const WIDTH: f64 = 0.1;
/// Planes tried (Fischler and Bolles 1981): where one point in ten is on the ground, one of
/// these has three such points with a chance of 98 %, and triples of near points are tried
/// more often than chance would.
const TRIALS: usize = 4000;
/// Points that judge each plane tried, at most; all judge the one that is found.
const JUDGES: usize = 2000;

/// The ground, its normal upwards; `None` where there is no such plane. The points stand in their
/// [own order](crate::order::in_own_order).
pub(super) fn ground(views: &[View], points: &[DVec3], center: DVec3) -> Option<Plane> {
    let up = views.iter().map(View::up).sum::<DVec3>() / views.len().max(1) as f64;
    if up.length() < COMMON_UP || points.len() < FEWEST {
        return None;
    }
    let up = up.normalize();
    let thickness = THICKNESS * median(points.iter().map(|p| p.distance(center)).collect());
    let judges = spread_over(points, JUDGES);

    // 1. The plane through three points that most others lie on.
    let mut random = Random(0x1234_5678);
    let mut best: Option<(usize, Plane)> = None;
    for _ in 0..TRIALS {
        let [a, b, c] = [0; 3].map(|_| judges[random.below(judges.len())]);
        let Ok(plane) = Plane::new(a, upwards((b - a).cross(c - a), up)) else {
            continue;
        };
        let on = judge(&plane, up, views, &judges, thickness);
        if let Some(on) = on
            && best.is_none_or(|(most, _)| on > most)
        {
            best = Some((on, plane));
        }
    }

    // 2. The plane of least squares through those.
    let (_, mut plane) = best?;
    for _ in 0..3 {
        let on = points
            .iter()
            .filter(|p| plane.signed_distance(**p).abs() <= thickness);
        let on: Vec<DVec3> = on.copied().collect();
        let middle = on.iter().map(|p| *p - center).sum::<DVec3>() / on.len() as f64;
        let normal = thinnest(on.iter().copied())?.direction;
        plane = Plane::new(center + middle, upwards(normal, up)).ok()?;
        if !is_wide(&on, center + middle, plane.normal()) {
            return None;
        }
    }
    judge(&plane, up, views, points, thickness).map(|_| plane)
}

fn upwards(normal: DVec3, up: DVec3) -> DVec3 {
    if normal.dot(up) < 0.0 {
        -normal
    } else {
        normal
    }
}

/// How many points lie on a plane; `None` where it cannot be the ground.
fn judge(
    plane: &Plane,
    up: DVec3,
    views: &[View],
    points: &[DVec3],
    thickness: f64,
) -> Option<usize> {
    let level = plane.normal().dot(up) >= NEAR_UP;
    if !level
        || views
            .iter()
            .any(|v| plane.signed_distance(v.center()) <= thickness)
    {
        return None;
    }
    let (mut on, mut below) = (0, 0);
    for point in points {
        let height = plane.signed_distance(*point);
        on += usize::from(height.abs() <= thickness);
        below += usize::from(height < -3.0 * thickness);
    }
    let count = points.len() as f64;
    let holds = on >= FEWEST && on as f64 >= ON * count && below as f64 <= BELOW * count;
    holds.then_some(on)
}

/// Whether points on a plane spread across as well as along it.
fn is_wide(points: &[DVec3], middle: DVec3, normal: DVec3) -> bool {
    let (x, y) = normal.any_orthonormal_pair();
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for point in points {
        let offset = *point - middle;
        let (a, b) = (offset.dot(x), offset.dot(y));
        (xx, xy, yy) = (xx + a * a, xy + a * b, yy + b * b);
    }
    let (mean, apart) = (
        (xx + yy) / 2.0,
        (((xx - yy) / 2.0).powi(2) + xy * xy).sqrt(),
    );
    mean - apart >= WIDTH * WIDTH * (mean + apart) && mean > 0.0
}

/// Numbers that look random and are always the same (Knuth's MMIX generator).
struct Random(u64);

impl Random {
    fn below(&mut self, count: usize) -> usize {
        let next = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = next.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % count
    }
}
