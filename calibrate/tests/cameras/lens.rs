//! Lenses against COLMAP's own numbers, and against themselves.

use calibrate::{Camera, Distortion, Lens, ModelKind, Pixel};
use glam::{DVec2, DVec3};
use proptest::prelude::*;
use serde_json::Value;
use std::f64::consts::{PI, TAU};
use std::fs;

const CAMERA_MODELS: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../shared/captures/camera-models.json"
);

const CASES: u32 = 4000;

fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    let numbers: Vec<f64> = value
        .as_array()?
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect();
    Some(numbers.try_into().unwrap())
}

/// Points that we refuse lie beyond the lens' one-to-one range: COLMAP's formula gives
/// those a pixel, but some nearer point falls on it too.
#[test]
fn every_model_projects_and_unprojects_as_colmap_does() {
    let Ok(text) = fs::read_to_string(CAMERA_MODELS) else {
        eprintln!("SKIPPED: {CAMERA_MODELS} is absent");
        return;
    };
    let json: Value = serde_json::from_str(&text).unwrap();
    let mut met = 0;
    for entry in json["models"].as_array().unwrap() {
        let Some(model) = ModelKind::from_name(entry["model"].as_str().unwrap()) else {
            continue;
        };
        let number = |key: &str| entry[key].as_u64().unwrap() as u32;
        assert_eq!(model.colmap_id(), Some(number("model_id") as i32));
        let params = entry["params"].as_array().unwrap();
        let camera = Camera {
            model,
            width: number("width"),
            height: number("height"),
            params: params.iter().map(|v| v.as_f64().unwrap()).collect(),
        };
        let lens = camera.lens().unwrap();
        let (mut refused, mut worst_px, mut worst_ray) = (0, 0.0_f64, 0.0_f64);
        let samples = entry["samples"].as_array().unwrap();
        for sample in samples {
            let point = DVec3::from_array(numbers(&sample["xyz"]).unwrap());
            let projected = lens.project(point);
            let Some([x, y]) = numbers(&sample["pixel"]) else {
                // COLMAP lets most cameras not look back; our wide ones see beyond 90°.
                assert!(point.z <= 0.0, "{}: {point}", model.name());
                assert!(
                    projected.is_none() || looks_back(&lens),
                    "{}: {point}",
                    model.name()
                );
                continue;
            };
            let pixel = Pixel::new(x, y);
            let Some(projected) = projected else {
                refused += 1;
                let radius = point.truncate().length();
                let beyond = if on_plane(&lens) {
                    radius > lens.limit() * point.z
                } else {
                    radius.atan2(point.z) > lens.limit()
                };
                assert!(beyond, "{}: {point}", model.name());
                continue;
            };
            worst_px = worst_px.max(projected.distance(pixel) / (1.0 + 1e-3 * x.hypot(y)));
            let ray = DVec3::from_array(numbers(&sample["ray"]).unwrap());
            worst_ray = worst_ray.max((lens.unproject(pixel).unwrap() - ray).length());
        }
        let pixel_samples = entry["pixel_samples"].as_array().unwrap();
        for sample in pixel_samples {
            let [x, y] = numbers(&sample["pixel"]).unwrap();
            let ray = DVec3::from_array(numbers(&sample["ray"]).unwrap());
            let Some(found) = lens.unproject(Pixel::new(x, y)) else {
                refused += 1;
                continue;
            };
            worst_ray = worst_ray.max((found - ray).length());
        }
        println!(
            "{}: {} samples, {refused} refused, worst {worst_px:.1e} px, ray {worst_ray:.1e}",
            model.name(),
            samples.len() + pixel_samples.len(),
        );
        // 1e-9 px, or 1e-12 of the pixel's coordinates.
        assert!(worst_px < 1e-9, "{}", model.name());
        assert!(worst_ray < 1e-9, "{}", model.name());
        assert!(refused <= 2, "{}", model.name());
        met += 1;
    }
    let colmaps = ModelKind::ALL.iter().filter(|m| m.colmap_id().is_some());
    assert_eq!(met, colmaps.count());
}

/// Whether the limit is a radius on the plane z = 1, not an angle.
fn on_plane(lens: &Lens) -> bool {
    matches!(
        lens.distortion(),
        Distortion::None | Distortion::Rational { .. } | Distortion::Tilted { .. }
    )
}

fn looks_back(lens: &Lens) -> bool {
    !on_plane(lens) && lens.limit() > 0.5 * PI
}

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

/// Lenses as they are calibrated: every pixel of the image has its ray.
#[test]
fn realistic_lenses_unproject_every_pixel() {
    let focal = DVec2::splat(1000.0);
    let center = DVec2::new(500.0, 375.0);
    for distortion in [
        Distortion::Rational {
            k: [-0.3, 0.1, 0.0, 0.0, 0.0, 0.0],
            p: [0.01, -0.01],
        },
        Distortion::Rational {
            k: [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0],
            p: [0.0; 2],
        },
        Distortion::Rational {
            k: [0.3, -0.1, 0.02, 0.2, 0.05, 0.01],
            p: [-0.01, 0.01],
        },
        Distortion::Fisheye {
            k: [-0.02, 0.01, -0.007, 0.0015],
        },
        Distortion::ThinPrismFisheye {
            k: [0.02, -0.009, 0.003, -0.001],
            p: [0.0004, -0.0006],
            s: [0.0005, -0.0004],
        },
        Distortion::RadTanThinPrismFisheye {
            k: [0.087, -0.031, 0.008, -0.0027, 0.0006, -5e-5],
            p: [0.0003, -0.0002],
            s: [0.0002, -0.0001, 0.0002, 0.0001],
        },
        Distortion::Tilted {
            k: [0.3, -0.1, 0.02, 0.2, 0.05, 0.01],
            p: [-0.001, 0.002],
            s: [0.01, -0.004, -0.013, 0.002],
            tau: [0.09, -0.11],
        },
        Distortion::SkewedFisheye {
            k: [-0.02, 0.01, -0.007, 0.0015],
            alpha: 0.02,
        },
        Distortion::InverseRadial { k: 0.2 },
        Distortion::InverseRadial { k: -0.2 },
        Distortion::Fov { omega: 0.92 },
        Distortion::Division { k: -0.18 },
        Distortion::Division { k: 0.1 },
        Distortion::Eucm {
            alpha: 0.59,
            beta: 1.09,
        },
        Distortion::Equirectangular,
    ] {
        let lens = Lens::new(focal, center, distortion);
        for row in (0..=750).step_by(25) {
            for column in (0..=1000).step_by(25) {
                let pixel = Pixel::new(f64::from(column), f64::from(row));
                let ray = lens.unproject(pixel);
                let again = ray
                    .and_then(|ray| lens.project(ray))
                    .map(|p| p.distance(pixel));
                assert!(
                    again.is_some_and(|distance| distance < 1e-9),
                    "{distortion:?}, {pixel:?}: {again:?}"
                );
            }
        }
    }
}

#[test]
fn nothing_is_seen_behind_or_beyond_the_fold() {
    let barrel = Distortion::Rational {
        k: [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0],
        p: [0.0; 2],
    };
    let lens = Lens::new(DVec2::splat(1000.0), DVec2::ZERO, barrel);
    // r(1 − 0.3r²) turns back at r = 1/√0.9.
    let fold = 1.0 / 0.9_f64.sqrt();
    assert!((lens.limit() - fold).abs() < 1e-6);
    assert!(lens.project(DVec3::new(fold - 1e-6, 0.0, 1.0)).is_some());
    assert!(lens.project(DVec3::new(fold + 1e-6, 0.0, 1.0)).is_none());
    let farthest = 1000.0 * fold * 2.0 / 3.0;
    assert!(lens.unproject(Pixel::new(farthest - 1e-6, 0.0)).is_some());
    assert!(lens.unproject(Pixel::new(farthest + 1e-6, 0.0)).is_none());

    for distortion in [Distortion::None, barrel] {
        let lens = Lens::new(DVec2::splat(1000.0), DVec2::ZERO, distortion);
        for point in [DVec3::ZERO, DVec3::X, DVec3::NEG_Z, DVec3::NAN] {
            assert_eq!(lens.project(point), None, "{distortion:?}, {point}");
        }
        assert_eq!(lens.unproject(Pixel::new(f64::NAN, 0.0)), None);
        assert_eq!(lens.unproject(Pixel::new(f64::INFINITY, 0.0)), None);
    }
    // A fisheye sees sideways and somewhat back.
    let fisheye = Lens::new(
        DVec2::splat(300.0),
        DVec2::ZERO,
        Distortion::Fisheye { k: [0.0; 4] },
    );
    let pixel = fisheye.project(DVec3::new(2.0, 0.0, -2.0)).unwrap();
    assert!((pixel.x - 300.0 * 0.75 * std::f64::consts::PI).abs() < 1e-9);
    for point in [DVec3::ZERO, DVec3::NEG_Z, DVec3::NAN] {
        assert_eq!(fisheye.project(point), None, "{point}");
    }
}

/// Such a fold lies where next to nothing is seen, but what is beyond it would come back into the
/// image's middle.
#[test]
fn nothing_is_seen_beyond_a_fold_close_to_90_degrees() {
    let lens = |k1: f64, p1: f64| {
        let distortion = Distortion::Rational {
            k: [k1, 0.0, 0.0, 0.0, 0.0, 0.0],
            p: [p1, 0.0],
        };
        Lens::new(DVec2::splat(1000.0), DVec2::ZERO, distortion)
    };
    // r(1 − k·r²) turns back at r = 1/√(3k); at 1/√k it is back at 0.
    for k in [1e-4_f64, 1e-6, 1e-12] {
        let barrel = lens(-k, 0.0);
        let fold = 1.0 / (3.0 * k).sqrt();
        assert!((barrel.limit() / fold - 1.0).abs() < 1e-9, "{k}");
        assert!(barrel.project(DVec3::new(0.99 * fold, 0.0, 1.0)).is_some());
        assert_eq!(barrel.project(DVec3::new(1.01 * fold, 0.0, 1.0)), None);
        let middle = DVec3::new(1.0 / k.sqrt(), 0.0, 1.0);
        assert_eq!(barrel.project(middle), None, "{k}");
    }
    // 6·p·r = 1.
    let tangential = lens(0.0, 1e-6).limit();
    assert!((tangential * 6e-6 - 1.0).abs() < 1e-9, "{tangential}");
    // Nothing folds where the radius grows throughout.
    assert!(lens(1e-4, 0.0).limit().is_infinite());
    assert!(lens(1e-4, 1e-6).limit().is_infinite());
}

/// Newton's method crept away from the pole that ends this lens' range in steps too small
/// to notice, and its starting point was taken for the answer.
#[test]
fn a_pole_at_the_end_of_the_range_is_not_an_answer() {
    let distortion = Distortion::Rational {
        k: [0.182, 0.041, 0.0, 0.0454, 0.0175, -0.0172],
        p: [0.0; 2],
    };
    let lens = Lens::new(DVec2::splat(500.0), DVec2::ZERO, distortion);
    assert!(lens.limit() < 2.2);
    let pixel = lens.project(DVec3::new(1.5, 0.0, 1.0)).unwrap();
    let ray = lens.unproject(pixel).unwrap();
    assert!((ray / ray.z - DVec3::new(1.5, 0.0, 1.0)).length() < 1e-9);
}

/// Its radial terms hardly grow at a radius of 1.3, where the tangential ones fold it.
#[test]
fn tangential_terms_end_the_range_too() {
    let k = [-0.1951, -0.045, 0.01945, 0.0, 0.0, 0.0];
    let limit = |p| Lens::new(DVec2::ONE, DVec2::ZERO, Distortion::Rational { k, p }).limit();
    assert!(limit([0.0; 2]).is_infinite());
    assert!(limit([0.002, 0.0]) < 1.4);
}

/// Formulas go on beyond what a camera sees; numbers do not.
#[test]
fn new_models_see_as_far_as_their_formula_is_one_to_one() {
    let lens = |distortion| Lens::new(DVec2::splat(300.0), DVec2::ZERO, distortion);
    let at = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        DVec3::new(sin, 0.0, cos)
    };
    for (distortion, sees, does_not, too_far) in [
        // π/2ω
        (Distortion::Fov { omega: 0.9 }, 89.999, 90.001, 1.7454),
        // tan θ = 1/(2√k), at 1/√k
        (Distortion::Division { k: 0.25 }, 44.999, 45.001, 2.0001),
        // tan θ = 2/3 at 1/√(−3k)
        (
            Distortion::InverseRadial { k: -1.0 / 3.0 },
            33.69,
            33.691,
            1.0001,
        ),
        // At 1/√(2α − 1), tan θ = −√(2α − 1)/(1 − α)
        (
            Distortion::Eucm {
                alpha: 0.75,
                beta: 1.0,
            },
            109.47,
            109.48,
            1.41422,
        ),
        (
            Distortion::Eucm {
                alpha: 1.0,
                beta: 1.0,
            },
            89.99,
            90.01,
            1.0001,
        ),
    ] {
        let lens = lens(distortion);
        assert!(lens.project(at(sees)).is_some(), "{distortion:?}");
        assert_eq!(lens.project(at(does_not)), None, "{distortion:?}");
        assert_eq!(
            lens.unproject(Pixel::new(300.0 * too_far, 0.0)),
            None,
            "{distortion:?}"
        );
        let last = Pixel::new(300.0 * 0.999 * too_far, 0.0);
        assert!(lens.unproject(last).is_some(), "{distortion:?}");
    }
    for distortion in [
        Distortion::Division { k: -0.2 },
        Distortion::Eucm {
            alpha: 0.5,
            beta: 1.0,
        },
        Distortion::Equirectangular,
    ] {
        let lens = lens(distortion);
        let pixel = lens.project(at(179.0)).unwrap();
        assert!((lens.unproject(pixel).unwrap() - at(179.0)).length() < 1e-9);
        assert_eq!(lens.project(DVec3::ZERO), None);
        assert_eq!(lens.project(DVec3::NAN), None);
        assert_eq!(lens.unproject(Pixel::new(f64::NAN, 0.0)), None);
    }
    // The sphere ends where its image does: the same rays again would lie beyond.
    let sphere = lens(Distortion::Equirectangular);
    assert!(
        sphere
            .unproject(Pixel::new(300.0 * PI, -150.0 * PI))
            .is_some()
    );
    assert_eq!(sphere.unproject(Pixel::new(300.1 * PI, 0.0)), None);
    assert_eq!(sphere.unproject(Pixel::new(0.0, 150.1 * PI)), None);
}

/// What bends too little to matter is a pinhole, whatever its name.
#[test]
fn parameters_that_bend_nothing_make_a_pinhole() {
    for distortion in [
        Distortion::Fov { omega: 0.0 },
        Distortion::Division { k: 0.0 },
        Distortion::InverseRadial { k: 0.0 },
        Distortion::Eucm {
            alpha: 0.0,
            beta: 2.0,
        },
        Distortion::Tilted {
            k: [0.0; 6],
            p: [0.0; 2],
            s: [0.0; 4],
            tau: [0.0; 2],
        },
    ] {
        let lens = Lens::new(DVec2::ONE, DVec2::ZERO, distortion);
        assert_eq!(lens, Lens::pinhole(DVec2::ONE, DVec2::ZERO));
    }
    // Weak ones are close to it.
    let point = DVec3::new(0.5, -0.4, 1.0);
    for distortion in [
        Distortion::Fov { omega: 1e-5 },
        Distortion::Division { k: 1e-10 },
        Distortion::InverseRadial { k: 1e-10 },
        Distortion::InverseRadial { k: -1e-10 },
        Distortion::Eucm {
            alpha: 1e-10,
            beta: 2.0,
        },
    ] {
        let lens = Lens::new(DVec2::ONE, DVec2::ZERO, distortion);
        let pixel = lens.project(point).unwrap();
        assert!(
            pixel.distance(Pixel::new(0.5, -0.4)) < 1e-9,
            "{distortion:?}"
        );
        assert!(!lens.is_wide(), "{distortion:?}");
    }
}

#[test]
fn parameters_out_of_their_range_are_refused_by_name() {
    let error = |model, params: &[f64]| {
        let camera = Camera {
            model,
            width: 10,
            height: 10,
            params: params.to_vec(),
        };
        camera.lens().unwrap_err().to_string()
    };
    assert_eq!(
        error(ModelKind::Eucm, &[1.0, 1.0, 0.0, 0.0, 1.5, 1.0]),
        "parameter alpha of EUCM is 1.5; it must be between 0 and 1"
    );
    assert_eq!(
        error(ModelKind::Eucm, &[1.0, 1.0, 0.0, 0.0, 0.5, 0.0]),
        "parameter beta of EUCM is 0; it must be positive"
    );
    assert_eq!(
        error(ModelKind::Fov, &[1.0, 1.0, 0.0, 0.0, 3.2]),
        "parameter omega of FOV is 3.2; it must be an angle in radians between −π and π"
    );
    let mut tilted = [0.0; 18];
    (tilted[0], tilted[1], tilted[17]) = (1.0, 1.0, -1.6);
    assert_eq!(
        error(ModelKind::OpenCvTilted, &tilted),
        "parameter tauY of OPENCV_TILTED is -1.6; it must be an angle in radians between −π/2 \
         and π/2"
    );
    assert_eq!(
        error(ModelKind::Equirectangular, &[0.0, 10.0]),
        "parameter w of EQUIRECTANGULAR is 0; it must be the image's size, which is positive"
    );
}

/// Every model's lens becomes a camera of which the lens is the same.
#[test]
fn a_lens_becomes_a_camera_and_back() {
    for &model in ModelKind::ALL {
        let mut params: Vec<f64> = (0..model.parameter_names().len())
            .map(|i| 0.1 + 0.013 * i as f64)
            .collect();
        if model == ModelKind::Equirectangular {
            params = vec![1000.0, 500.0];
        }
        let camera = Camera {
            model,
            width: 1000,
            height: 500,
            params,
        };
        let lens = camera.lens().unwrap();
        let again = Camera::of(&lens, 1000, 500);
        assert_eq!(again.lens().unwrap(), lens, "{}", model.name());
        if model.colmap_id().is_none() {
            assert_eq!(again, camera);
        } else {
            assert!(again.model.colmap_id().is_some(), "{}", model.name());
        }
    }
}

/// A tilted sensor is a plane that rays meet from in front; the formula goes on behind it.
#[test]
fn a_tilted_sensor_is_not_seen_from_behind() {
    let tilted = Distortion::Tilted {
        k: [0.0; 6],
        p: [0.0; 2],
        s: [0.0; 4],
        tau: [0.0, 0.5_f64.atan()],
    };
    let lens = Lens::new(DVec2::splat(300.0), DVec2::ZERO, tilted);
    // 1 + x·tan τy vanishes at x = −2.
    assert!(lens.project(DVec3::new(-1.999, 0.3, 1.0)).is_some());
    assert_eq!(lens.project(DVec3::new(-2.001, 0.3, 1.0)), None);
    assert_eq!(
        lens.project_with_gradients(DVec3::new(-2.001, 0.3, 1.0)),
        None
    );
    // The sensor's own horizon: rays at right angles to the axis.
    let farthest = lens.project(DVec3::new(1e12, 0.0, 1.0)).unwrap().x;
    assert!(
        lens.unproject(Pixel::new(farthest * (1.0 - 1e-6), 0.0))
            .is_some()
    );
    assert_eq!(
        lens.unproject(Pixel::new(farthest * (1.0 + 1e-6), 0.0)),
        None
    );
}

/// A rounding error beside the image is nowhere, and a picture would show the gap.
#[test]
fn a_sphere_has_its_seam_and_its_poles_in_the_image() {
    for (width, height) in [(1024, 512), (1000, 500), (4096, 2048), (7777, 3331)] {
        let camera = Camera {
            model: ModelKind::Equirectangular,
            width,
            height,
            params: vec![f64::from(width), f64::from(height)],
        };
        let lens = camera.lens().unwrap();
        for x in [0.0, -0.0, 1e-300, -1e-300, 1e-17, -1e-17] {
            for y in [-1.0, -0.3, 0.0, 0.3, 1.0] {
                for z in [-1.0, 0.0] {
                    let Some(pixel) = lens.project(DVec3::new(x, y, z)) else {
                        assert!(x == 0.0 && y == 0.0 && z == 0.0);
                        continue;
                    };
                    let inside = (0.0..=f64::from(width)).contains(&pixel.x)
                        && (0.0..=f64::from(height)).contains(&pixel.y);
                    assert!(inside, "{width} × {height}: {x}, {y}, {z} → {pixel:?}");
                }
            }
        }
    }
}

/// Found by fuzzing: the square of such a pixel's distance is no number.
#[test]
fn pixels_too_far_out_have_no_ray() {
    let models = [
        Distortion::None,
        Distortion::Fov { omega: 0.5 },
        Distortion::Division { k: -0.1 },
        Distortion::Eucm {
            alpha: 0.3,
            beta: 1.0,
        },
    ];
    for distortion in models {
        let lens = Lens::new(DVec2::splat(1e-134), DVec2::splat(1e20), distortion);
        assert_eq!(
            lens.unproject(Pixel::new(0.25, 0.25)),
            None,
            "{distortion:?}"
        );
    }
}
