//! A smooth motion through given poses.

use super::Interpolation;
use calibrate::Rigid3;
use glam::{DQuat, DVec3};

/// Poses at increasing times, and what lies between them.
///
/// Spline: centres follow the Catmull–Rom spline whose knots are the times themselves
/// (Barry & Goldman 1988, "A recursive evaluation algorithm for a class of Catmull–Rom
/// splines"), so speeds are those that the times ask for. Rotations follow the cubic
/// Hermite curve of Kim, Kim & Shin 1995 ("A general construction scheme for unit
/// quaternion curves with simple high order derivatives", §4). In both, the velocity at a
/// keyframe is that of the parabola through it and its neighbours, but at most
/// [`MOST_SPEED`] times the slower of the mean speeds before and after it: beside a stretch
/// that asks for little motion a parabola runs far beyond, and a pause is no pause.
/// Velocities are continuous, angular ones as well.
#[derive(Clone, Debug)]
pub(crate) struct Curve {
    knots: Vec<Knot>,
    interpolation: Interpolation,
}

/// How fast a knot may be passed, in mean speeds of the slower stretch beside it. Up to this a
/// cubic between two values stays between them (Fritsch & Carlson 1980, "Monotone piecewise cubic
/// interpolation"). At times that are spaced evenly only stretches that are more than five times as
/// long as the one before or after are affected.
const MOST_SPEED: f64 = 3.0;

#[derive(Clone, Copy, Debug)]
struct Knot {
    t: f64,
    camera_from_world: Rigid3,
    center: DVec3,
    /// Per unit of time, in the world.
    velocity: DVec3,
    /// Per unit of time, in the camera's frame.
    angular_velocity: DVec3,
}

impl Curve {
    /// The curve through poses (`camera_from_world`) at strictly increasing times; at
    /// least one.
    pub(crate) fn new(poses: Vec<(f64, Rigid3)>, interpolation: Interpolation) -> Self {
        let knot = |&(t, camera_from_world): &(f64, Rigid3)| Knot {
            t,
            camera_from_world,
            center: camera_from_world.center(),
            velocity: DVec3::ZERO,
            angular_velocity: DVec3::ZERO,
        };
        let mut knots: Vec<Knot> = poses.iter().map(knot).collect();
        // The mean velocities from each knot to the next.
        let chords: Vec<(f64, DVec3, DVec3)> = knots
            .windows(2)
            .map(|pair| {
                let h = pair[1].t - pair[0].t;
                let turn = log(turn_between(&pair[0], &pair[1]));
                (h, (pair[1].center - pair[0].center) / h, turn / h)
            })
            .collect();
        for (i, knot) in knots.iter_mut().enumerate() {
            let before = i.checked_sub(1).and_then(|i| chords.get(i));
            (knot.velocity, knot.angular_velocity) = match (before, chords.get(i)) {
                (Some(a), Some(b)) => {
                    let share = a.0 / (a.0 + b.0);
                    let through = |a: DVec3, b: DVec3| {
                        let most = MOST_SPEED * a.length().min(b.length());
                        no_faster_than(most, a.lerp(b, share))
                    };
                    (through(a.1, b.1), through(a.2, b.2))
                }
                (Some(only), None) | (None, Some(only)) => (only.1, only.2),
                (None, None) => (DVec3::ZERO, DVec3::ZERO),
            };
        }
        Self {
            knots,
            interpolation,
        }
    }

    /// The knot at or before a time and how much of the way to the next has passed, 0…1.
    /// Times outside the curve are moved to its ends.
    pub(crate) fn locate(&self, t: f64) -> (usize, f64) {
        let before = self
            .knots
            .partition_point(|k| k.t <= t)
            .max(1)
            .min(self.knots.len())
            - 1;
        let Some(next) = self.knots.get(before + 1) else {
            return (before, 0.0);
        };
        let knot = &self.knots[before];
        (before, ((t - knot.t) / (next.t - knot.t)).clamp(0.0, 1.0))
    }

    /// The pose (`camera_from_world`) at a time.
    pub(crate) fn at(&self, t: f64) -> Rigid3 {
        let (before, u) = self.locate(t);
        let a = &self.knots[before];
        if u == 0.0 {
            return a.camera_from_world;
        }
        let b = &self.knots[before + 1];
        let h = b.t - a.t;
        let (center, turn) = match self.interpolation {
            Interpolation::Linear => (a.center.lerp(b.center, u), exp(log(turn_between(a, b)) * u)),
            Interpolation::Spline => {
                // Cubic Bézier curves, the inner points a third of the velocities away:
                // the basis functions summed up from the right.
                let v = 1.0 - u;
                let sums = [1.0 - v * v * v, u * u * (3.0 - 2.0 * u), u * u * u];
                let (first, last) = (a.velocity * (h / 3.0), b.velocity * (h / 3.0));
                let middle = b.center - a.center - first - last;
                let center = a.center + first * sums[0] + middle * sums[1] + last * sums[2];
                // The same for rotations, products in the place of sums.
                let first = a.angular_velocity * (h / 3.0);
                let last = b.angular_velocity * (h / 3.0);
                let middle = log(exp(-first) * turn_between(a, b) * exp(-last));
                let turn = exp(first * sums[0]) * exp(middle * sums[1]) * exp(last * sums[2]);
                (center, turn)
            }
        };
        let rotation = (turn.conjugate() * a.camera_from_world.rotation).normalize();
        Rigid3 {
            rotation,
            translation: -(rotation * center),
        }
    }
}

/// A velocity, slowed down to a speed if it is faster.
fn no_faster_than(most: f64, velocity: DVec3) -> DVec3 {
    let speed = velocity.length();
    // Untouched otherwise, to the last bit.
    if speed > most {
        velocity * (most / speed)
    } else {
        velocity
    }
}

/// From one knot's camera axes to the next one's, in the first camera's frame.
fn turn_between(a: &Knot, b: &Knot) -> DQuat {
    a.camera_from_world.rotation * b.camera_from_world.rotation.conjugate()
}

/// The rotation vector, of length at most π.
fn log(rotation: DQuat) -> DVec3 {
    let q = if rotation.w < 0.0 {
        -rotation
    } else {
        rotation
    };
    let axis = q.xyz();
    let sine = axis.length();
    if sine > 0.0 {
        axis * (2.0 * sine.atan2(q.w) / sine)
    } else {
        DVec3::ZERO
    }
}

/// The rotation about a vector by its length.
fn exp(vector: DVec3) -> DQuat {
    let angle = vector.length();
    let scale = if angle > 0.0 {
        (0.5 * angle).sin() / angle
    } else {
        0.5
    };
    DQuat::from_xyzw(
        vector.x * scale,
        vector.y * scale,
        vector.z * scale,
        (0.5 * angle).cos(),
    )
}

/// The weighted mean of rotations: the one that turns least, in the mean square, to reach
/// them all. Weights are not negative; `None` where they are all zero.
///
/// Iterated in the tangent space, from the rotation of largest weight.
pub(crate) fn mean_rotation(weighted: &[(f64, DQuat)]) -> Option<DQuat> {
    let heaviest = weighted
        .iter()
        .fold(None, |best: Option<&(f64, DQuat)>, w| match best {
            Some(b) if b.0 >= w.0 => best,
            _ => Some(w),
        })?;
    let sum: f64 = weighted.iter().map(|w| w.0).sum();
    if !(sum > 0.0) {
        return None;
    }
    let mut mean = heaviest.1;
    for _ in 0..20 {
        let offset = |w: &(f64, DQuat)| log(w.1 * mean.conjugate()) * w.0;
        let step = weighted.iter().map(offset).sum::<DVec3>() / sum;
        mean = (exp(step) * mean).normalize();
        if step.length() < 1e-14 {
            break;
        }
    }
    Some(mean)
}

/// The rotation at place 0 by a line fitted to rotations at places along a way, (weight, place, rotation): as their
/// weighted mean is at their mean place, and as they turn from there on. Weights are not negative; `None` where
/// they are all zero.
pub(crate) fn fitted_rotation(placed: &[(f64, f64, DQuat)]) -> Option<DQuat> {
    // Farther from the mean place than so many standard deviations they do not tell how to turn on.
    const REACH: f64 = 2.0;
    let weighted: Vec<(f64, DQuat)> = placed.iter().map(|&(w, _, q)| (w, q)).collect();
    let mean = mean_rotation(&weighted)?;
    let sum: f64 = placed.iter().map(|one| one.0).sum();
    let middle = placed.iter().map(|one| one.0 * one.1).sum::<f64>() / sum;
    let (mut turn, mut squares) = (DVec3::ZERO, 0.0);
    for &(weight, place, rotation) in placed {
        let off = place - middle;
        turn += log(rotation * mean.conjugate()) * (weight * off);
        squares += weight * off * off;
    }
    let reach = REACH * (squares / sum).sqrt();
    let slope = turn / squares;
    // All at one place they do not tell, either.
    if !(slope.is_finite() && reach.is_finite()) {
        return Some(mean);
    }
    let step = slope * (-middle).clamp(-reach, reach);
    Some((exp(step) * mean).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn log_undoes_exp() {
        for v in [
            DVec3::ZERO,
            DVec3::new(1e-200, 0.0, 0.0),
            DVec3::new(1e-9, -2e-9, 0.0),
            DVec3::new(0.3, -0.2, 1.0),
            DVec3::new(0.0, PI - 1e-9, 0.0),
        ] {
            assert!((log(exp(v)) - v).length() <= 1e-15 * v.length().max(1.0) * 10.0);
            assert!((log(-exp(v)) - v).length() <= 1e-14);
        }
    }

    #[test]
    fn velocities_are_continuous() {
        let pose = |i: i32| {
            let (t, s) = (f64::from(i * i) * 0.3 + f64::from(i), f64::from(i));
            let rotation = exp(DVec3::new(s.sin(), 0.8 * s, (2.0 * s).cos()));
            (
                t,
                Rigid3::new(rotation, DVec3::new(s.cos(), s * s * 0.1, 2.0)),
            )
        };
        let poses: Vec<_> = (0..6).map(pose).collect();
        let curve = Curve::new(poses.clone(), Interpolation::Spline);
        const STEP: f64 = 1e-6;
        for &(t, key) in &poses[1..5] {
            assert_eq!(curve.at(t), key);
            let (before, after) = (curve.at(t - STEP), curve.at(t + STEP));
            let left = (key.center() - before.center()) / STEP;
            let right = (after.center() - key.center()) / STEP;
            assert!((left - right).length() < 1e-4 * left.length());
            let left = log(before.rotation * key.rotation.conjugate()) / STEP;
            let right = log(key.rotation * after.rotation.conjugate()) / STEP;
            assert!((left - right).length() < 1e-4 * left.length());
        }
    }

    fn at(t: f64, x: f64, turn: f64) -> (f64, Rigid3) {
        let rotation = exp(DVec3::new(0.3 * turn, turn, 0.0));
        let center = DVec3::new(x, 2.0 * x, 1.0);
        (t, Rigid3::new(rotation, -(rotation * center)))
    }

    #[test]
    fn between_two_keyframes_of_one_pose_the_camera_stands_still() {
        let (before, pause, after) = (at(0.0, 0.0, 0.0), at(1.0, 2.0, 1.2), at(6.0, 0.5, -0.7));
        let poses = vec![before, pause, (5.0, pause.1), after];
        let curve = Curve::new(poses, Interpolation::Spline);
        for i in 0..=400 {
            let pose = curve.at(1.0 + f64::from(i) / 100.0);
            assert!(pose.center().distance(pause.1.center()) < 1e-14);
            assert!(log(pose.rotation * pause.1.rotation.conjugate()).length() < 1e-14);
        }
        // It comes to rest and sets off without a jerk.
        const STEP: f64 = 1e-6;
        for t in [1.0 - STEP, 5.0 + STEP] {
            assert!(curve.at(t).center().distance(pause.1.center()) < 1e-10);
        }
    }

    #[test]
    fn keyframes_at_uneven_times_are_not_overshot() {
        for times in [[0.0, 0.1, 10.0], [0.0, 9.9, 10.0], [0.0, 1e-6, 1.0]] {
            let keys = [0.0, 1.0, 2.0];
            let key = |(t, x): (f64, f64)| at(t, x, 0.5 * x);
            let poses = times.into_iter().zip(keys).map(key).collect();
            let curve = Curve::new(poses, Interpolation::Spline);
            let (mut x, mut turn) = (0.0, 0.0);
            for i in 0..=1000 {
                let pose = curve.at(times[2] * f64::from(i) / 1000.0);
                let (next_x, next_turn) = (pose.center().x, log(pose.rotation).y);
                // Onwards all the time.
                assert!(next_x > x - 1e-12 && next_x < 2.0 + 1e-12, "{next_x}");
                assert!(next_turn > turn - 1e-12 && next_turn < 1.0 + 1e-12);
                (x, turn) = (next_x, next_turn);
            }
        }
    }

    #[test]
    fn a_velocity_that_is_slow_enough_stays_as_it_is() {
        let (a, b) = (DVec3::new(0.1, -0.7, 0.3), DVec3::new(0.9, 0.2, -0.1));
        let most = MOST_SPEED * a.length().min(b.length());
        for share in [0.0, 0.3, 0.5, 1.0] {
            let velocity = a.lerp(b, share);
            assert_eq!(no_faster_than(most, velocity), velocity);
        }
        assert_eq!(no_faster_than(0.0, b), DVec3::ZERO);
        assert!((no_faster_than(0.2, b).length() - 0.2).abs() < 1e-15);
    }

    #[test]
    fn a_mean_of_rotations_lies_between_them() {
        let about = |angle: f64| DQuat::from_rotation_y(angle);
        let mean = mean_rotation(&[(1.0, about(0.2)), (3.0, -about(0.6))]).unwrap();
        assert!(log(mean * about(0.5).conjugate()).length() < 1e-12);
        assert_eq!(mean_rotation(&[]), None);
        assert_eq!(mean_rotation(&[(0.0, about(1.0))]), None);
        let opposite = mean_rotation(&[(1.0, about(0.0)), (1.0, about(PI))]).unwrap();
        assert!(opposite.is_finite());
    }

    #[test]
    fn a_fit_of_rotations_that_turn_evenly_is_exact() {
        let at = |place: f64| exp(DVec3::new(0.1, 0.4, -0.2) * place) * exp(DVec3::X);
        let placed = [(0.5, 1.0), (2.0, 1.5), (1.0, -0.2), (0.1, 2.0)];
        let placed = placed.map(|(weight, place)| (weight, place, at(place)));
        let fitted = fitted_rotation(&placed).unwrap();
        assert!(log(fitted * at(0.0).conjugate()).length() < 1e-12);
        // At one place, the mean.
        let one = [(1.0, 0.7, at(0.2)), (1.0, 0.7, at(0.4))];
        let fitted = fitted_rotation(&one).unwrap();
        assert!(log(fitted * at(0.3).conjugate()).length() < 1e-12);
        assert_eq!(fitted_rotation(&[]), None);
    }
}
