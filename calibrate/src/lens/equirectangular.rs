//! The whole sphere by azimuth and elevation.

use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// (atan2(x, z), atan2(y, √(x² + z²))) and its gradients; those are not finite on the
/// vertical axis. `None` at the centre.
pub(super) fn angles(point: DVec3) -> Option<(DVec2, [DVec3; 2])> {
    let DVec3 { x, y, z } = point;
    let level = x.hypot(z);
    if !(level > 0.0 || y != 0.0) {
        return None;
    }
    let azimuth = DVec3::new(z, 0.0, -x) / (level * level);
    let elevation = DVec3::new(-x * y / level, level, -z * y / level) / point.length_squared();
    Some((DVec2::new(x.atan2(z), y.atan2(level)), [azimuth, elevation]))
}

/// The ray at a pair of angles; `None` outside the image, which repeats itself there.
pub(super) fn ray(angles: DVec2) -> Option<DVec3> {
    // The image's borders themselves, whatever the rounding of its size.
    const SLACK: f64 = 1.0 + 4.0 * f64::EPSILON;
    if angles.x.abs() > PI * SLACK || angles.y.abs() > FRAC_PI_2 * SLACK {
        return None;
    }
    let (sin_azimuth, cos_azimuth) = angles.x.clamp(-PI, PI).sin_cos();
    let (sin, cos) = angles.y.clamp(-FRAC_PI_2, FRAC_PI_2).sin_cos();
    Some(DVec3::new(cos * sin_azimuth, sin, cos * cos_azimuth))
}
