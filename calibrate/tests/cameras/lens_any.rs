//! Any lens against itself: there and back, and its gradients.

use crate::lens::on_plane;
use calibrate::{Distortion, Lens, Pixel};
use glam::{DVec2, DVec3};
use proptest::prelude::*;
use std::f64::consts::{PI, TAU};

const CASES: u32 = 4000;

/// An image 1000 pixels wide and up to as high, seen at a width of 40° to 90°.
fn lens(distortion: impl Strategy<Value = Distortion>) -> impl Strategy<Value = Lens> {
    (
        500.0..1400.0,
        0.98..1.02,
        450.0..550.0,
        350.0..400.0,
        distortion,
    )
        .prop_map(|(focal, aspect, cx, cy, distortion)| {
            Lens::new(
                DVec2::new(focal, focal * aspect),
                DVec2::new(cx, cy),
                distortion,
            )
        })
}

fn radial() -> impl Strategy<Value = Distortion> {
    (-0.3..0.3, -0.1..0.1, -0.02..0.02).prop_map(|(k1, k2, k3)| Distortion::Rational {
        k: [k1, k2, k3, 0.0, 0.0, 0.0],
        p: [0.0; 2],
    })
}

fn brown_conrady() -> impl Strategy<Value = Distortion> {
    (
        [
            -0.3..0.3,
            -0.1..0.1,
            -0.02..0.02,
            -0.2..0.3,
            -0.05..0.2,
            -0.02..0.02,
        ],
        any::<bool>(),
        [-0.01..0.01, -0.01..0.01],
    )
        .prop_map(|(mut k, rational, p)| {
            if !rational {
                k[3..].fill(0.0);
            }
            Distortion::Rational { k, p }
        })
}

fn tilted() -> impl Strategy<Value = Distortion> {
    (
        [
            -0.3..0.3,
            -0.1..0.1,
            -0.02..0.02,
            0.0..0.3,
            0.0..0.2,
            0.0..0.02,
        ],
        [-0.01..0.01, -0.01..0.01],
        [-0.01..0.01, -0.003..0.003, -0.01..0.01, -0.003..0.003],
        [-0.12..0.12, -0.12..0.12],
        any::<bool>(),
    )
        .prop_map(|(k, p, s, tau, upright)| Distortion::Tilted {
            k,
            p,
            s,
            tau: if upright { [0.0; 2] } else { tau },
        })
}

fn fisheye() -> impl Strategy<Value = Distortion> {
    [-0.1..0.1, -0.05..0.05, -0.02..0.02, -0.005..0.005].prop_map(|k| Distortion::Fisheye { k })
}

fn skewed_fisheye() -> impl Strategy<Value = Distortion> {
    (fisheye(), -0.1..0.1).prop_map(|(fisheye, alpha)| match fisheye {
        Distortion::Fisheye { k } => Distortion::SkewedFisheye { k, alpha },
        other => other,
    })
}

fn thin_prism() -> impl Strategy<Value = Distortion> {
    (
        [-0.1..0.1, -0.05..0.05, -0.02..0.02, -0.005..0.005],
        [-0.01..0.01, -0.01..0.01],
        [-0.01..0.01, -0.01..0.01],
    )
        .prop_map(|(k, p, s)| Distortion::ThinPrismFisheye { k, p, s })
}

fn rad_tan_thin_prism() -> impl Strategy<Value = Distortion> {
    (
        [
            -0.1..0.1,
            -0.05..0.05,
            -0.02..0.02,
            -0.005..0.005,
            -0.001..0.001,
            -0.0001..0.0001,
        ],
        [-0.01..0.01, -0.01..0.01],
        [-0.01..0.01, -0.003..0.003, -0.01..0.01, -0.003..0.003],
    )
        .prop_map(|(k, p, s)| Distortion::RadTanThinPrismFisheye { k, p, s })
}

fn any_lens() -> impl Strategy<Value = Lens> {
    lens(prop_oneof![
        Just(Distortion::None),
        radial(),
        brown_conrady(),
        tilted(),
        fisheye(),
        skewed_fisheye(),
        thin_prism(),
        rad_tan_thin_prism(),
        (0.01..1.6).prop_map(|omega| Distortion::Fov { omega }),
        (-0.5..0.5).prop_map(|k| Distortion::Division { k }),
        // At its fold, beyond this image, pixels move infinitely far with a ray.
        (-0.1..0.5).prop_map(|k| Distortion::InverseRadial { k }),
        (0.0..1.0, 0.5..2.0).prop_map(|(alpha, beta)| Distortion::Eucm { alpha, beta }),
        Just(Distortion::Equirectangular),
    ])
}

/// Pixels from one edge of the image to the other, and somewhat beyond.
fn grid() -> impl Iterator<Item = Pixel> {
    (-2..=22).flat_map(|row| {
        (-2..=22).map(move |column| Pixel::new(f64::from(column) * 50.0, f64::from(row) * 37.5))
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(CASES) })]

    /// Unprojection answers truly or not at all. At a lens' fold, where a ray's rounding moves its pixel by the square
    /// root of that, as truly as can be.
    #[test]
    fn a_ray_falls_on_the_pixel_it_came_from(lens in any_lens()) {
        for pixel in grid() {
            let Some(ray) = lens.unproject(pixel) else { continue };
            prop_assert!((ray.length() - 1.0).abs() < 1e-14);
            let Some(again) = lens.project(ray) else {
                return Err(TestCaseError::fail(format!("{pixel:?} → {ray} → nothing")));
            };
            let aside = ray.truncate().length();
            let from_axis = if on_plane(&lens) { aside / ray.z } else { aside.atan2(ray.z) };
            let most = if lens.limit() - from_axis < 1e-8 { 1e-6 } else { 1e-9 };
            prop_assert!(again.distance(pixel) < most, "{:?} → {} → {:?}", pixel, ray, again);
        }
    }

    /// What lies within the one-to-one range is found again. At its very end two rays
    /// nearly fall on one pixel: there no answer is allowed.
    #[test]
    fn a_pixel_leads_back_to_its_point(
        lens in any_lens(),
        share in 0.0..0.9,
        around in 0.0..TAU,
        depth in 0.01..1e4,
    ) {
        // Up to 60° off the axis, 110° where lenses see that, 180° for the whole sphere.
        let (sin, cos) = around.sin_cos();
        let ray = if on_plane(&lens) {
            let radius: f64 = share * lens.limit().min(1.73);
            DVec3::new(cos * radius, sin * radius, 1.0).normalize()
        } else {
            let most = match lens.distortion() {
                Distortion::Equirectangular => PI,
                _ => 1.92,
            };
            let angle: f64 = share * lens.limit().min(most);
            DVec3::new(cos * angle.sin(), sin * angle.sin(), angle.cos())
        };
        let Some(pixel) = lens.project(ray * depth) else {
            return Err(TestCaseError::fail(format!("{ray} is not projected")));
        };
        let Some(again) = lens.unproject(pixel) else {
            return Err(TestCaseError::fail(format!("{ray} → {pixel:?} → nothing")));
        };
        prop_assert!((again - ray).length() < 1e-9, "{} → {:?} → {}", ray, pixel, again);
    }

    /// Gradients are central differences of the projection, wherever it is smooth.
    #[test]
    fn gradients_meet_finite_differences(
        lens in any_lens(),
        share in 0.0..0.8,
        around in 0.0..TAU,
        depth in 0.1..10.0,
    ) {
        let most = if on_plane(&lens) { lens.limit().atan().min(1.05) } else { lens.limit().min(1.92) };
        let angle: f64 = share * most;
        let (sin, cos) = around.sin_cos();
        let point = depth * DVec3::new(cos * angle.sin(), sin * angle.sin(), angle.cos());
        let projection = lens.project_with_gradients(point).unwrap();
        prop_assert!(projection.pixel.distance(lens.project(point).unwrap()) < 1e-9);
        let h: f64 = 1e-5 * depth;
        for (axis, step) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
            let central = |h: f64| {
                let [ahead, behind] = [1.0, -1.0].map(|sign| lens.project(point + sign * h * step));
                let (ahead, behind) = (ahead?, behind?);
                Some(DVec2::new(ahead.x - behind.x, ahead.y - behind.y) / (2.0 * h))
            };
            let (Some(whole), Some(half)) = (central(h), central(0.5 * h)) else { continue };
            // Without what goes with h², which is too much where the lens nearly is a pinhole and looks aside.
            let expected = (4.0 * half - whole) / 3.0;
            let found = DVec2::new(projection.gradients[0][axis], projection.gradients[1][axis]);
            let scale = lens.focal.x / depth;
            prop_assert!(
                found.distance(expected) < 1e-6 * scale,
                "{} by axis {}: {} instead of {}", point, axis, found, expected
            );
        }
    }
}
