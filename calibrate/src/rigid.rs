use glam::{DMat3, DQuat, DVec3};
use std::ops::Mul;

/// A rotation followed by a translation, between two frames: `b_from_a * point_in_a` is
/// `point_in_b`.
///
/// Products read right to left and neighbouring frames must match:
/// `c_from_a = c_from_b * b_from_a`.
///
/// ```
/// use calibrate::Rigid3;
/// use glam::{DQuat, DVec3};
///
/// let camera_from_world =
///     Rigid3::new(DQuat::from_rotation_y(0.3), DVec3::new(1.0, 2.0, 3.0));
/// let point_in_world = DVec3::new(0.5, -0.25, 4.0);
/// let point_in_camera = camera_from_world * point_in_world;
/// let back = camera_from_world.inverse() * point_in_camera;
/// assert!((back - point_in_world).length() < 1e-14);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rigid3 {
    /// Unit quaternion.
    pub rotation: DQuat,
    /// Applied after the rotation, in the destination frame and its units.
    pub translation: DVec3,
}

impl Rigid3 {
    /// The motion that changes nothing.
    pub const IDENTITY: Self = Self {
        rotation: DQuat::IDENTITY,
        translation: DVec3::ZERO,
    };

    /// Normalises `rotation`, which must not be zero.
    pub fn new(rotation: DQuat, translation: DVec3) -> Self {
        Self {
            rotation: rotation.normalize(),
            translation,
        }
    }

    /// A camera at `center` that looks at `target`, its y axis as far down (against
    /// `up`) as that allows; any perpendicular will do where `up` is the line of sight.
    pub fn looking_at(center: DVec3, target: DVec3, up: DVec3) -> Self {
        let z = (target - center).normalize_or(DVec3::Z);
        let x = z.cross(up);
        let x = if x.length() > 1e-9 * up.length() {
            x.normalize()
        } else {
            z.any_orthonormal_vector()
        };
        let y = z.cross(x);
        // The camera's axes in the world are the columns of world_from_camera.
        let world_from_camera = DMat3::from_cols(x, y, z);
        let rotation = DQuat::from_mat3(&world_from_camera.transpose()).normalize();
        Self {
            rotation,
            translation: -(rotation * center),
        }
    }

    /// `a_from_b` of this `b_from_a`.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.conjugate();
        Self {
            rotation,
            translation: -(rotation * self.translation),
        }
    }

    /// Where the destination frame's origin lies in the source frame: of a
    /// `camera_from_world`, the camera's centre in the world.
    pub fn center(&self) -> DVec3 {
        -(self.rotation.conjugate() * self.translation)
    }

    /// The rotation as a matrix.
    pub fn matrix(&self) -> DMat3 {
        DMat3::from_quat(self.rotation)
    }

    /// The motion of a rotation matrix and a translation; `None` where the matrix is not
    /// a rotation to within `tolerance` in any entry of RᵀR − I, or mirrors.
    pub fn from_matrix(rotation: DMat3, translation: DVec3, tolerance: f64) -> Option<Self> {
        let ok = Self::deviation(rotation) <= tolerance
            && rotation.determinant() > 0.0
            && translation.is_finite();
        ok.then(|| Self::new(DQuat::from_mat3(&rotation), translation))
    }

    /// How far a matrix of finite numbers is from a rotation, or from a mirrored one: the largest entry of
    /// RᵀR − I, without its sign.
    pub fn deviation(rotation: DMat3) -> f64 {
        let should_be_zero = rotation.transpose() * rotation - DMat3::IDENTITY;
        should_be_zero
            .to_cols_array()
            .iter()
            .fold(0.0_f64, |worst, entry| worst.max(entry.abs()))
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.rotation.is_finite() && self.translation.is_finite()
    }
}

impl Mul<DVec3> for Rigid3 {
    type Output = DVec3;
    fn mul(self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }
}

impl Mul for Rigid3 {
    type Output = Rigid3;
    fn mul(self, a: Rigid3) -> Rigid3 {
        Rigid3 {
            rotation: (self.rotation * a.rotation).normalize(),
            translation: self.rotation * a.translation + self.translation,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looking_at_puts_the_target_on_the_axis_and_up_upwards() {
        let camera_from_world = Rigid3::looking_at(
            DVec3::new(1.0, 2.0, 3.0),
            DVec3::new(1.0, 2.0, 8.0),
            DVec3::Y,
        );
        let ahead = camera_from_world * DVec3::new(1.0, 2.0, 5.0);
        assert!((ahead - DVec3::new(0.0, 0.0, 2.0)).length() < 1e-12);
        let above = camera_from_world * DVec3::new(1.0, 3.0, 5.0);
        assert!(above.y < 0.0, "up in the world is −y in the camera");
        assert!((camera_from_world.center() - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
    }

    #[test]
    fn looking_along_up_is_still_a_rotation() {
        let pose = Rigid3::looking_at(DVec3::ZERO, DVec3::Y, DVec3::Y);
        assert!(pose.is_finite());
        assert!((pose.matrix().determinant() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_mirror_is_not_a_rotation() {
        let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
        assert!(Rigid3::from_matrix(mirror, DVec3::ZERO, 1e-6).is_none());
        assert!(Rigid3::from_matrix(DMat3::IDENTITY, DVec3::ZERO, 1e-6).is_some());
    }
}
