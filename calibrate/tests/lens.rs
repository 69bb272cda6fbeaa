//! Lenses against COLMAP's own numbers, and against themselves.

use calibrate::{Camera, Distortion, Lens, ModelKind, Pixel};
use glam::{DVec2, DVec3};
use proptest::prelude::*;
use serde_json::Value;
use std::fs;

const CAMERA_MODELS: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../shared/captures/camera-models.json"
);

const CASES: u32 = 1000;

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
        assert_eq!(model.colmap_id() as u32, number("model_id"));
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
                // COLMAP lets no camera look back; our fisheyes see beyond 90°.
                let looks_back = matches!(lens.distortion(), Distortion::Fisheye { .. });
                assert!(point.z <= 0.0, "{}: {point}", model.name());
                assert!(
                    projected.is_none() || looks_back,
                    "{}: {point}",
                    model.name()
                );
                continue;
            };
            let pixel = Pixel::new(x, y);
            let Some(projected) = projected else {
                refused += 1;
                let radius = point.truncate().length();
                let beyond = match lens.distortion() {
                    Distortion::Fisheye { .. } => radius.atan2(point.z) > lens.limit(),
                    _ => radius > lens.limit() * point.z,
                };
                assert!(beyond, "{}: {point}", model.name());
                continue;
            };
            worst_px = worst_px.max(projected.distance(pixel));
            let ray = DVec3::from_array(numbers(&sample["ray"]).unwrap());
            worst_ray = worst_ray.max((lens.unproject(pixel).unwrap() - ray).length());
        }
        println!(
            "{}: {} samples, {refused} refused, worst {worst_px:.1e} px, ray {worst_ray:.1e}",
            model.name(),
            samples.len(),
        );
        assert!(worst_px < 1e-9, "{}", model.name());
        assert!(worst_ray < 1e-9, "{}", model.name());
        assert!(refused <= 2, "{}", model.name());
        met += 1;
    }
    assert_eq!(met, ModelKind::ALL.len());
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

fn fisheye() -> impl Strategy<Value = Distortion> {
    [-0.1..0.1, -0.05..0.05, -0.02..0.02, -0.005..0.005].prop_map(|k| Distortion::Fisheye { k })
}

fn any_lens() -> impl Strategy<Value = Lens> {
    lens(prop_oneof![
        Just(Distortion::None),
        radial(),
        brown_conrady(),
        fisheye()
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

    /// Unprojection answers truly or not at all.
    #[test]
    fn a_ray_falls_on_the_pixel_it_came_from(lens in any_lens()) {
        for pixel in grid() {
            let Some(ray) = lens.unproject(pixel) else { continue };
            prop_assert!((ray.length() - 1.0).abs() < 1e-14);
            let Some(again) = lens.project(ray) else {
                return Err(TestCaseError::fail(format!("{pixel:?} → {ray} → nothing")));
            };
            prop_assert!(again.distance(pixel) < 1e-9, "{:?} → {} → {:?}", pixel, ray, again);
        }
    }

    /// What lies within the one-to-one range is found again. At its very end two rays
    /// nearly fall on one pixel: there no answer is allowed.
    #[test]
    fn a_pixel_leads_back_to_its_point(
        lens in any_lens(),
        share in 0.0..0.9,
        around in 0.0..std::f64::consts::TAU,
        depth in 0.01..1e4,
    ) {
        let fisheye = matches!(lens.distortion(), Distortion::Fisheye { .. });
        // Up to 60° off the axis, 110° for a fisheye.
        let radius: f64 = share * lens.limit().min(if fisheye { 1.92 } else { 1.73 });
        let (sin, cos) = around.sin_cos();
        let ray = if fisheye {
            DVec3::new(cos * radius.sin(), sin * radius.sin(), radius.cos())
        } else {
            DVec3::new(cos * radius, sin * radius, 1.0).normalize()
        };
        let Some(pixel) = lens.project(ray * depth) else {
            return Err(TestCaseError::fail(format!("{ray} is not projected")));
        };
        let Some(again) = lens.unproject(pixel) else {
            return Err(TestCaseError::fail(format!("{ray} → {pixel:?} → nothing")));
        };
        prop_assert!((again - ray).length() < 1e-9, "{} → {:?} → {}", ray, pixel, again);
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
