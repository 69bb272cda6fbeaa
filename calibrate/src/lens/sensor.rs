//! Sensors that do not stand upright behind the lens: homographies of distorted coordinates.

use glam::{DMat2, DMat3, DVec2, DVec3};

/// From the plane z = 1 to a sensor turned by (τx, τy): OpenCV's
/// `computeTiltProjectionMatrix`, multiplied out and divided by cos τx·cos τy. The axis stays
/// where it is.
pub(super) fn tilt([x, y]: [f64; 2]) -> DMat3 {
    let (tan_x, tan_y) = (x.tan(), y.tan());
    let (sec_x, sec_y) = (1.0 / x.cos(), 1.0 / y.cos());
    DMat3::from_cols(
        DVec3::new(sec_y, -tan_x * tan_y, tan_y * sec_x),
        DVec3::new(0.0, sec_x, -tan_x),
        DVec3::Z,
    )
}

/// To axes of which y leans towards x.
pub(super) fn skew(alpha: f64) -> DMat3 {
    DMat3::from_cols(DVec3::X, DVec3::new(alpha, 1.0, 0.0), DVec3::Z)
}

/// The point that a homography maps another to, and the Jacobian. `None` on and beyond its
/// horizon: a sensor's tilted plane is not met from behind.
pub(super) fn apply(homography: DMat3, point: DVec2) -> Option<(DVec2, DMat2)> {
    let h = homography * point.extend(1.0);
    let mapped = h.truncate() / h.z;
    let column = |axis: DVec3| (axis.truncate() - mapped * axis.z) / h.z;
    let jacobian = DMat2::from_cols(column(homography.x_axis), column(homography.y_axis));
    (h.z > 0.0).then_some((mapped, jacobian))
}

#[cfg(test)]
mod tests {
    use super::super::difference;
    use super::*;

    /// The definition: turn the plane, then project along its normal's own axis.
    fn tilt_by_definition([x, y]: [f64; 2]) -> DMat3 {
        let turned = (DMat3::from_rotation_x(x) * DMat3::from_rotation_y(y)).transpose();
        let r = turned.z_axis;
        let onto_sensor = DMat3::from_cols(
            DVec3::new(r.z, 0.0, 0.0),
            DVec3::new(0.0, r.z, 0.0),
            DVec3::new(-r.x, -r.y, 1.0),
        );
        onto_sensor * turned
    }

    #[test]
    fn a_tilt_is_what_opencv_defines() {
        for tau in [
            [0.0, 0.0],
            [0.1, -0.2],
            [-0.3, 0.05],
            [0.0, 0.7],
            [1.1, 0.0],
        ] {
            let expected = tilt_by_definition(tau);
            let expected = expected * (1.0 / expected.z_axis.z);
            let off = (tilt(tau) - expected).to_cols_array();
            assert!(off.iter().all(|e| e.abs() < 1e-15), "{tau:?}: {off:?}");
        }
        assert_eq!(tilt([0.0; 2]), DMat3::IDENTITY);
        assert_eq!(skew(0.0), DMat3::IDENTITY);
    }

    #[test]
    fn derivatives_meet_finite_differences_and_the_inverse_leads_back() {
        for homography in [tilt([0.2, -0.3]), skew(0.1)] {
            for (x, y) in [(0.0, 0.0), (0.4, -0.9), (-1.2, 0.3)] {
                let at = DVec2::new(x, y);
                let (mapped, jacobian) = apply(homography, at).unwrap();
                let expected = difference(|point| apply(homography, point).unwrap().0, at);
                let off = (jacobian - expected).to_cols_array();
                assert!(off.iter().all(|e| e.abs() < 1e-8), "{at}: {off:?}");
                let (back, _) = apply(homography.inverse(), mapped).unwrap();
                assert!((back - at).length() < 1e-14, "{at}: {back}");
            }
        }
    }

    #[test]
    fn nothing_lies_beyond_the_horizon() {
        // 1 + y·tan(-τx) = 0 at y = 1/tan τx.
        let homography = tilt([0.25_f64.atan(), 0.0]);
        assert!(apply(homography, DVec2::new(0.0, 3.999)).is_some());
        assert_eq!(apply(homography, DVec2::new(0.0, 4.001)), None);
        assert_eq!(apply(homography, DVec2::NAN), None);
    }
}
