//! OpenCV's lenses against a table that OpenCV computed.

use calibrate::{Camera, Distortion, Lens, Pixel};
use glam::{DMat3, DVec2, DVec3};
use serde_json::Value;
use std::path::Path;

fn numbers(value: &Value) -> Vec<f64> {
    let values = value.as_array().unwrap().iter();
    values.map(|v| v.as_f64().unwrap()).collect()
}

#[test]
fn opencv_projects_to_the_same_pixels() {
    let path = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../shared/captures/opencv-projection.json"
    ));
    if !path.is_file() {
        eprintln!("SKIPPED: {} is not there", path.display());
        return;
    }
    let table: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let cases = table["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 8);
    for case in cases {
        let name = case["variant"].as_str().unwrap();
        let k = numbers(&case["camera_matrix"]);
        let coefficients = numbers(&case["dist_coeffs"]);
        let distortion = if case["function"] == "cv2.fisheye.projectPoints" {
            Distortion::SkewedFisheye {
                k: coefficients.try_into().unwrap(),
                alpha: case["alpha"].as_f64().unwrap(),
            }
        } else {
            Distortion::of_opencv(&coefficients).unwrap()
        };
        let lens = Lens::new(
            DVec2::new(k[0], k[4]),
            DVec2::new(k[2], k[5]) + 0.5,
            distortion,
        );
        let r = numbers(&case["R_rowmajor"]);
        let camera_from_world = DMat3::from_cols_slice(&r).transpose();
        let translation = DVec3::from_slice(&numbers(&case["tvec"]));
        let (mut worst_px, mut worst_ray, mut refused) = (0.0_f64, 0.0_f64, 0);
        let samples = case["samples"].as_array().unwrap();
        for sample in samples {
            let world = DVec3::from_slice(&numbers(&sample["world"]));
            let pixel = DVec2::from_slice(&numbers(&sample["pixel"])) + 0.5;
            let pixel = Pixel::new(pixel.x, pixel.y);
            let Some(projected) = lens.project(camera_from_world * world + translation) else {
                refused += 1;
                continue;
            };
            worst_px = worst_px.max(projected.distance(pixel));
            let ray = lens.unproject(pixel).unwrap();
            let truth = DVec2::from_slice(&numbers(&sample["normalized_true"])).extend(1.0);
            worst_ray = worst_ray.max((ray - truth.normalize()).length());
        }
        println!(
            "{name}: {} samples, {refused} refused, worst {worst_px:.1e} px, ray {worst_ray:.1e}",
            samples.len()
        );
        assert!(worst_px < 1e-9, "{name}: {worst_px}");
        assert!(worst_ray < 1e-9, "{name}: {worst_ray}");
        assert_eq!(refused, 0, "{name}");
    }
}

fn with(distortion: Distortion) -> Lens {
    let focal = DVec2::new(812.4, 809.9);
    Lens::new(focal, DVec2::new(322.2, 243.7), distortion)
}

fn tilted_prism() -> Lens {
    let c = [
        0.2143, -0.0912, 0.0009, -0.0014, 0.0121, 0.3017, -0.0286, 0.0081, 0.0017, -0.0005,
        -0.0011, 0.0003, 0.0213, -0.0147,
    ];
    with(Distortion::of_opencv(&c).unwrap())
}

#[test]
fn every_pixel_of_an_image_has_its_ray() {
    let skewed = with(Distortion::SkewedFisheye {
        k: [-0.0213, 0.0092, -0.0047, 0.0011],
        alpha: 0.0031,
    });
    for lens in [tilted_prism(), skewed] {
        for row in (0..=480).step_by(20) {
            for column in (0..=640).step_by(20) {
                let pixel = Pixel::new(f64::from(column), f64::from(row));
                let ray = lens.unproject(pixel).unwrap();
                let again = lens.project(ray).unwrap();
                assert!(again.distance(pixel) < 1e-9, "{pixel:?} → {again:?}");
            }
        }
    }
}

#[test]
fn nothing_is_seen_behind() {
    for point in [DVec3::ZERO, DVec3::NEG_Z, DVec3::X, DVec3::NAN] {
        assert_eq!(tilted_prism().project(point), None, "{point}");
    }
    assert_eq!(tilted_prism().unproject(Pixel::new(f64::NAN, 0.0)), None);
}

/// The simplest of COLMAP's models that holds the coefficients, else ours.
#[test]
fn coefficients_that_are_zero_make_a_simpler_model() {
    let made = |c: &[f64]| Camera::of(&with(Distortion::of_opencv(c).unwrap()), 640, 480);
    assert_eq!(made(&[]).model.name(), "PINHOLE");
    assert_eq!(made(&[0.0; 14]).model.name(), "PINHOLE");
    assert_eq!(made(&[0.1, 0.0, 0.0, 0.0]).model.name(), "OPENCV");
    let mut c = [0.0; 14];
    c[7] = 0.1;
    let camera = made(&c);
    assert_eq!(camera.model.name(), "FULL_OPENCV");
    assert_eq!(camera.params[11], 0.1);
    c[13] = 0.01;
    let camera = made(&c);
    assert_eq!(camera.model.name(), "OPENCV_TILTED");
    assert_eq!(camera.params[4..], c);
    let skewed = |alpha| with(Distortion::SkewedFisheye { k: [0.1; 4], alpha });
    let name = |alpha| Camera::of(&skewed(alpha), 640, 480).model.name();
    assert_eq!(
        (name(0.0), name(0.1)),
        ("OPENCV_FISHEYE", "OPENCV_SKEWED_FISHEYE")
    );
    for count in [1, 2, 3, 6, 7, 9, 13, 15] {
        assert_eq!(Distortion::of_opencv(&vec![0.1; count]), None);
    }
}
