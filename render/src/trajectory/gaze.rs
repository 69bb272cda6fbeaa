//! Where photos look whose principal point is off their middle: cropped ones, and those through shifted lenses.

use calibrate::{Pixel, View};
use glam::{DQuat, DVec2, DVec3};

/// A principal point that is off the middle by no more than this, in shares of the longer side, is what lenses
/// have: such photos look along their optical axes.
const OFF: f64 = 0.05;

/// The ray through the middle of a photo, of unit length in its camera's frame; `None` where it looks along its
/// optical axis.
fn aside(view: &View) -> Option<DVec3> {
    let middle = 0.5 * DVec2::new(f64::from(view.width), f64::from(view.height));
    let off = view.lens.principal.distance(middle);
    if off <= OFF * 2.0 * middle.max_element() {
        return None;
    }
    view.lens.unproject(Pixel::new(middle.x, middle.y))
}

/// The direction in which a photo looks, in the world.
pub(super) fn ahead(view: &View) -> DVec3 {
    let ray = aside(view).unwrap_or(DVec3::Z);
    view.camera_from_world.rotation.conjugate() * ray
}

/// A photo's rotation (`camera_from_world`, about its optical axis turned in any way), turned as little as makes
/// z what it looks along: that of a camera that shows the same with its principal point in the middle.
pub(super) fn centered(view: &View, rotation: DQuat) -> DQuat {
    if aside(view).is_none() {
        return rotation;
    }
    let ray = (rotation * ahead(view)).normalize();
    (DQuat::from_rotation_arc(ray, DVec3::Z) * rotation).normalize()
}

/// Pixels per radian in the middle of a photo: the geometric mean along all directions.
pub(super) fn mean_focal(view: &View) -> f64 {
    let there = aside(view).and_then(|ray| view.lens.project_with_gradients(ray));
    let focal = there.map(|there| {
        let [x, y] = there.gradients;
        x.cross(y).length().sqrt()
    });
    let is_sound = |focal: &f64| focal.is_finite() && *focal > 0.0;
    focal
        .filter(is_sound)
        .unwrap_or_else(|| view.lens.mean_focal())
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Lens, Rigid3};

    fn view(principal: DVec2) -> View {
        View {
            lens: Lens::pinhole(DVec2::splat(100.0), principal),
            width: 160,
            height: 120,
            camera_from_world: Rigid3::new(DQuat::from_rotation_y(0.4), DVec3::X),
        }
    }

    #[test]
    fn a_principal_point_near_the_middle_turns_nothing() {
        for principal in [DVec2::new(80.0, 60.0), DVec2::new(74.0, 64.0)] {
            let view = view(principal);
            let rotation = view.camera_from_world.rotation;
            assert_eq!(centered(&view, rotation), rotation);
            assert_eq!(ahead(&view), view.forward());
            assert_eq!(mean_focal(&view), 100.0);
        }
    }

    #[test]
    fn cropped_photos_look_through_their_middles() {
        let view = view(DVec2::new(-20.0, 60.0));
        let rotation = centered(&view, view.camera_from_world.rotation);
        let ahead = ahead(&view);
        assert!((rotation * ahead).distance(DVec3::Z) < 1e-12);
        // 45° to the right, neither up nor down.
        let expected = DVec3::new(1.0, 0.0, 1.0).normalize();
        let own = view.camera_from_world.rotation;
        assert!((own * ahead).distance(expected) < 1e-12);
        let up = rotation.conjugate() * DVec3::NEG_Y;
        assert!(up.distance(DVec3::NEG_Y) < 1e-12);
        // By the cosine of that, twice across and once along.
        let expected = 100.0 * 2.0_f64.powf(0.75);
        assert!((mean_focal(&view) - expected).abs() < 1e-9);
    }
}
