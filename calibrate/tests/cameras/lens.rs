//! Lenses against COLMAP's own numbers, and what their parameters mean.

use calibrate::{Camera, Distortion, Lens, ModelKind, Pixel};
use glam::{DVec2, DVec3};
use serde_json::Value;
use std::f64::consts::PI;
use std::fs;

const CAMERA_MODELS: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../shared/captures/camera-models.json"
);

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
pub(crate) fn on_plane(lens: &Lens) -> bool {
    matches!(
        lens.distortion(),
        Distortion::None | Distortion::Rational { .. } | Distortion::Tilted { .. }
    )
}

fn looks_back(lens: &Lens) -> bool {
    !on_plane(lens) && lens.limit() > 0.5 * PI
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
