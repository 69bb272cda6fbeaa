//! Moving a camera by hand: functions from pose to pose, and the motion between two views.

use calibrate::{Rigid3, View};
use glam::{DMat3, DQuat, DVec3};

/// How near the line of sight may come to straight up or down, in radians.
const LEAST_TILT: f64 = 0.05;

/// A pose of a rotation and a centre.
pub(crate) fn pose_of(camera_from_world: DQuat, center_in_world: DVec3) -> Rigid3 {
    let rotation = camera_from_world.normalize();
    Rigid3 {
        rotation,
        translation: -(rotation * center_in_world),
    }
}

/// The angle between two directions, in radians, however small.
pub(crate) fn angle_between(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

/// The pose after going around `pivot_in_world`, which stays where it is in the picture:
/// by `yaw` radians about `up` (positive: the camera goes to the right, what it sees to the left)
/// and by `pitch` about its own right axis (positive: upwards), as far as the line of sight stays off `up`.
pub(crate) fn orbited(
    pose: &Rigid3,
    pivot_in_world: DVec3,
    up: DVec3,
    yaw: f64,
    pitch: f64,
) -> Rigid3 {
    let world_from_camera = pose.rotation.conjugate();
    let (right, forward) = (world_from_camera * DVec3::X, world_from_camera * DVec3::Z);
    // From straight up. Turning about `right` by a positive angle lowers the line of sight.
    let tilt = forward.angle_between(up);
    let most = std::f64::consts::PI - LEAST_TILT;
    let pitch = match (LEAST_TILT..=most).contains(&tilt) {
        true => (tilt + pitch).clamp(LEAST_TILT, most) - tilt,
        // Beyond: only back.
        false if (tilt < LEAST_TILT) == (pitch > 0.0) => pitch,
        false => 0.0,
    };
    let turn = DQuat::from_axis_angle(up, yaw) * DQuat::from_axis_angle(right, -pitch);
    let center = pivot_in_world + turn * (pose.center() - pivot_in_world);
    let turned = pose_of((turn * world_from_camera).conjugate(), center);
    if turned.is_finite() { turned } else { *pose }
}

/// The pose after looking aside, on the spot: positive `yaw` looks right, positive `pitch` down.
pub(crate) fn turned(pose: &Rigid3, up: DVec3, yaw: f64, pitch: f64) -> Rigid3 {
    orbited(pose, pose.center(), up, -yaw, pitch)
}

/// The pose after a motion along the camera's own axes (x right, y down, z forward), in world
/// units.
pub(crate) fn moved(pose: &Rigid3, motion_in_camera: DVec3) -> Rigid3 {
    let moved = Rigid3 {
        rotation: pose.rotation,
        translation: pose.translation - motion_in_camera,
    };
    if moved.is_finite() { moved } else { *pose }
}

/// The pose after going a share of the way to a point, which stays where it is in the picture;
/// negative shares lead away. Never quite there.
pub(crate) fn zoomed(pose: &Rigid3, point_in_world: DVec3, share: f64) -> Rigid3 {
    let center = pose.center().lerp(point_in_world, share.min(0.95));
    let zoomed = pose_of(pose.rotation, center);
    if zoomed.is_finite() { zoomed } else { *pose }
}

/// Where a camera's forward axis and right axis lead on level ground: unit vectors, or zero for
/// one that looks straight down.
pub(crate) fn level_axes(pose: &Rigid3, up: DVec3) -> (DVec3, DVec3) {
    let world_from_camera = DMat3::from_quat(pose.rotation.conjugate());
    let level = |axis: DVec3| (axis - up * axis.dot(up)).normalize_or_zero();
    (
        level(world_from_camera.z_axis),
        level(world_from_camera.x_axis),
    )
}

/// A smooth motion from one view to another.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Glide {
    from: View,
    to: View,
    /// Seconds since it began.
    elapsed_s: f64,
    duration_s: f64,
}

impl Glide {
    /// A motion that takes so many seconds.
    pub(crate) fn new(from: View, to: View, duration_s: f64) -> Self {
        Self {
            from,
            to,
            elapsed_s: 0.0,
            duration_s: duration_s.max(1e-3),
        }
    }

    /// Goes on for a while; the pose there, and whether that is the end of it.
    pub(crate) fn step(&mut self, seconds: f64) -> (Rigid3, bool) {
        self.elapsed_s += seconds.max(0.0);
        let share = (self.elapsed_s / self.duration_s).min(1.0);
        if share >= 1.0 {
            return (self.to.camera_from_world, true);
        }
        // From rest to rest.
        let eased = share * share * (3.0 - 2.0 * share);
        (self.from.between(&self.to, eased).camera_from_world, false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::Lens;
    use glam::DVec2;
    use proptest::prelude::*;

    fn pose() -> impl Strategy<Value = Rigid3> {
        (
            prop::array::uniform3(-5.0..5.0),
            prop::array::uniform3(-5.0..5.0),
        )
            .prop_map(|(c, t)| {
                let (c, t) = (DVec3::from(c), DVec3::from(t));
                Rigid3::looking_at(c, t + DVec3::new(0.01, 0.02, 0.03), DVec3::Y)
            })
    }

    fn direction(pose: &Rigid3, point: DVec3) -> DVec3 {
        (*pose * point).normalize_or_zero()
    }

    proptest! {
        #[test]
        fn the_pivot_stays_in_the_picture(
            pose in pose(), pivot in prop::array::uniform3(-9.0..9.0), yaw in -3.0..3.0, pitch in -2.0..2.0
        ) {
            let pivot = DVec3::from(pivot);
            let after = orbited(&pose, pivot, DVec3::Y, yaw, pitch);
            prop_assert!(((after * pivot) - (pose * pivot)).length() < 1e-9);
            // The horizon stays level.
            let right = after.rotation.conjugate() * DVec3::X;
            prop_assert!((right.y - (pose.rotation.conjugate() * DVec3::X).y).abs() < 1e-6);
        }

        #[test]
        fn zooming_keeps_the_direction(pose in pose(), share in -3.0..2.0) {
            let point = DVec3::new(7.0, 8.0, 9.0);
            let after = zoomed(&pose, point, share);
            prop_assert!((direction(&after, point) - direction(&pose, point)).length() < 1e-9);
            let (far, near) = (pose.center().distance(point), after.center().distance(point));
            prop_assert!((near < far) == (share > 0.0));
        }

        #[test]
        fn panning_moves_points_by_as_much(pose in pose(), x in -1.0..1.0, y in -1.0..1.0) {
            let point = DVec3::new(7.0, 8.0, 9.0);
            let motion = DVec3::new(x, y, 0.5);
            let after = moved(&pose, motion);
            prop_assert!(((pose * point) - (after * point) - motion).length() < 1e-9);
        }
    }

    #[test]
    fn signs_are_those_that_hands_expect() {
        // At the origin, looking along z with y down.
        let pose = Rigid3::looking_at(DVec3::ZERO, DVec3::Z, DVec3::NEG_Y);
        let up = DVec3::NEG_Y;
        let looked = turned(&pose, up, 0.1, 0.0);
        let forward = looked.rotation.conjugate() * DVec3::Z;
        assert!(forward.x > 0.05, "right");
        let looked = turned(&pose, up, 0.0, 0.1);
        let forward = looked.rotation.conjugate() * DVec3::Z;
        assert!(forward.y > 0.05, "down");
        let around = orbited(&pose, DVec3::new(0.0, 0.0, 4.0), up, 0.1, 0.0);
        assert!(around.center().x > 0.1, "the camera goes right");
        let around = orbited(&pose, DVec3::new(0.0, 0.0, 4.0), up, 0.0, 0.1);
        assert!(around.center().y < -0.1, "the camera goes up");
    }

    #[test]
    fn one_never_tips_over() {
        let pose = Rigid3::looking_at(DVec3::ZERO, DVec3::Z, DVec3::NEG_Y);
        for pitch in [9.0, -9.0] {
            let mut now = pose;
            for _ in 0..3 {
                now = turned(&now, DVec3::NEG_Y, 0.2, pitch);
            }
            let above = now.rotation.conjugate() * DVec3::NEG_Y;
            assert!(above.y < 0.0 && now.is_finite());
        }
    }

    #[test]
    fn a_glide_ends_where_it_should_at_rest() {
        let lens = Lens::pinhole(DVec2::splat(10.0), DVec2::splat(5.0));
        let view = |x: f64| View {
            lens,
            width: 10,
            height: 10,
            camera_from_world: Rigid3::looking_at(DVec3::X * x, DVec3::Z * 5.0, DVec3::NEG_Y),
        };
        let mut glide = Glide::new(view(0.0), view(1.0), 1.0);
        let mut last = 0.0;
        for i in 1..=10 {
            let (pose, is_done) = glide.step(0.1 + 1e-12);
            let x = pose.center().x;
            assert!(x >= last && x - last < 0.16, "{x}");
            assert_eq!(is_done, i == 10);
            last = x;
        }
        assert_eq!(glide.step(0.0), (view(1.0).camera_from_world, true));
    }
}
