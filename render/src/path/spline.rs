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
/// keyframe is that of the parabola through it and its neighbours. Velocities are
/// continuous, angular ones as well.
#[derive(Clone, Debug)]
pub(crate) struct Curve {
    knots: Vec<Knot>,
    interpolation: Interpolation,
}

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
                    (a.1.lerp(b.1, share), a.2.lerp(b.2, share))
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
}
