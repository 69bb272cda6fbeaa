//! Source views through every kind of lens, with points that fall on their pixels: what
//! the engines' f32 projections are compared with the f64 one on.

use super::{Frame, FrameSource, ProxyPoint};
use crate::lumigraph::{Lumigraph, SourceView};
use crate::options::FieldOptions;
use crate::photos::PhotoStore;
use calibrate::{Camera, Distortion, Lens, ModelKind, Pixel, Rigid3, View};
use glam::{DVec2, DVec3};
use image::RgbaImage;
use proxy::{Plane, Proxy};
use std::f64::consts::PI;

/// How far from the f64 model, in pixels, a projection in f32 may be.
pub(crate) const TOLERANCE_PX: f64 = 0.02;

/// A lumigraph with a source view for each lens: as 1280 × 960, and four times as large.
pub(crate) fn lumigraph() -> Lumigraph {
    use ModelKind::*;
    let mut views = Vec::new();
    for (model, params) in [
        (Pinhole, vec![1011.2, 1017.9, 637.4, 483.1]),
        (SimpleRadial, vec![998.3, 640.0, 480.0, -0.1372]),
        (
            FullOpenCv,
            vec![
                1020.6, 1018.2, 633.5, 486.4, 0.1521, -0.0432, 0.00082, -0.00127, 0.0113, 0.2307,
                -0.0211, 0.0064,
            ],
        ),
        (
            OpenCvFisheye,
            vec![562.1, 563.4, 640.7, 481.9, -0.0237, 0.0118, -0.0073, 0.0015],
        ),
        // 185° across.
        (Fisheye, vec![400.0, 400.0, 640.0, 480.0]),
        (
            ThinPrismFisheye,
            vec![
                583.7, 585.2, 645.3, 474.6, 0.0213, -0.0087, 0.0041, -0.0063, 0.0031, -0.0009,
                0.0052, -0.0038,
            ],
        ),
        (
            RadTanThinPrismFisheye,
            vec![
                590.2, 590.2, 641.8, 479.3, 0.0871, -0.0314, 0.0083, -0.0027, 0.0006, -5e-5,
                0.0031, -0.0024, 0.0017, -0.0009, 0.0021, 0.0006,
            ],
        ),
        (Fov, vec![611.3, 609.8, 642.6, 477.2, 0.9231]),
        (Fov, vec![990.0, 995.0, 642.6, 477.2, 1e-3]),
        (Division, vec![933.1, 936.7, 643.9, 475.4, -0.1547]),
        (Division, vec![933.1, 936.7, 643.9, 475.4, 0.12]),
        // Beyond 90°.
        (Division, vec![500.0, 500.0, 643.9, 475.4, -0.6]),
        (Eucm, vec![603.8, 601.5, 639.2, 482.6, 0.5913, 1.0942]),
        (Eucm, vec![380.0, 380.0, 639.2, 482.6, 0.5, 1.1]),
        (Eucm, vec![380.0, 380.0, 639.2, 482.6, 0.62, 1.1]),
        (Eucm, vec![800.0, 800.0, 639.2, 482.6, 0.2, 1.3]),
        (Equirectangular, vec![1280.0, 960.0]),
        (InverseRadial, vec![931.4, 929.8, 640.0, 480.0, 0.2137]),
        (InverseRadial, vec![931.4, 929.8, 640.0, 480.0, -0.1463]),
        // OpenCV's 12 coefficients, and 14 with a tilt of several degrees.
        (
            OpenCvTilted,
            vec![
                1020.6, 1018.2, 633.5, 486.4, 0.1521, -0.0432, 0.00082, -0.00127, 0.0113, 0.2307,
                -0.0211, 0.0064, 0.0117, -0.0045, -0.0131, 0.0023, 0.0, 0.0,
            ],
        ),
        (
            OpenCvTilted,
            vec![
                1020.6, 1018.2, 633.5, 486.4, 0.1521, -0.0432, 0.00082, -0.00127, 0.0113, 0.2307,
                -0.0211, 0.0064, 0.0017, -0.0005, -0.0011, 0.0003, 0.0923, -0.1147,
            ],
        ),
        (
            OpenCvSkewedFisheye,
            vec![
                562.1, 563.4, 640.7, 481.9, -0.0237, 0.0118, -0.0073, 0.0015, 0.0231,
            ],
        ),
        // Those that end within their photos: a circular fisheye, and some that turn back.
        (
            OpenCvFisheye,
            vec![350.0, 350.0, 641.2, 478.3, -0.09, 0.0, 0.0, 0.0],
        ),
        (SimpleRadial, vec![530.0, 640.0, 480.0, -0.2]),
        (
            OpenCv,
            vec![545.0, 538.0, 640.0, 480.0, -0.2, 0.0, 0.0012, -0.0007],
        ),
        (Eucm, vec![240.0, 250.0, 639.2, 482.6, 0.62, 1.1]),
        (
            ThinPrismFisheye,
            vec![
                352.0, 352.0, 645.3, 474.6, -0.09, 0.0, 0.0011, -0.0008, 0.0, 0.0, 0.0009, -0.0006,
            ],
        ),
        (
            OpenCvTilted,
            vec![
                550.0, 547.0, 633.5, 486.4, -0.2, 0.0, 0.00082, -0.00127, 0.0, 0.0, 0.0, 0.0,
                0.0007, 0.0, -0.0011, 0.0, 0.0423, -0.0547,
            ],
        ),
        (
            OpenCvSkewedFisheye,
            vec![354.0, 354.0, 640.7, 481.9, -0.09, 0.0, 0.0, 0.0, 0.0231],
        ),
    ] {
        let (width, height) = (1280, 960);
        let camera = Camera {
            model,
            width,
            height,
            params,
        };
        let small = View {
            lens: camera.lens().unwrap(),
            width,
            height,
            // Beside the desired view, facing elsewhere.
            camera_from_world: Rigid3::looking_at(
                DVec3::new(0.4, -0.3, 0.1),
                DVec3::new(1.0, 0.5, 0.9),
                DVec3::new(0.1, -1.0, 0.2),
            ),
        };
        let large = small.resized(4 * width, 4 * height);
        views.extend(
            [("", small), (" × 4", large)].map(|(size, view)| SourceView {
                name: format!("{} {:?}{size}", model.name(), view.lens.distortion()),
                view,
                gain: [1.0; 3],
                time_s: None,
                quarters: 0,
            }),
        );
    }
    Lumigraph {
        points: Vec::new(),
        photos: PhotoStore::from_images(vec![RgbaImage::new(1, 1); views.len()]),
        sources: views,
        proxy: Proxy::Plane(Plane::new(DVec3::new(0.0, 0.0, 4.0), DVec3::Z).unwrap()),
        visibility: None,
    }
}

/// The proxy's plane from the origin: q with s = q · ray.
pub(crate) const PLANE: DVec3 = DVec3::new(0.0, 0.0, 0.25);

/// Looks at them all from the origin.
pub(crate) fn frame(lumigraph: &Lumigraph) -> Frame<'_> {
    let desired = View {
        lens: Lens::pinhole(DVec2::splat(500.0), DVec2::splat(250.0)),
        width: 500,
        height: 500,
        camera_from_world: Rigid3::looking_at(DVec3::ZERO, DVec3::Z, DVec3::NEG_Y),
    };
    Frame::new(lumigraph, desired, FieldOptions::default())
}

/// Points that fall on a grid of 65 × 49 pixels of a source view, corners included, as f32
/// has them; and where in the photo f64 says that they fall.
pub(crate) fn points(frame: &Frame<'_>, source_idx: usize) -> Vec<([f32; 4], Pixel)> {
    let source = &frame.sources[source_idx];
    let mut points = Vec::new();
    for row in 0..=48 {
        for column in 0..=64 {
            let inset = 0.01;
            let at = |share: f64, size: f64| inset + (size - 2.0 * inset) * share;
            // Closer to each other at the top and the bottom, where a sphere's poles are.
            let share = 0.5 - 0.5 * (PI * f64::from(row) / 48.0).cos();
            let pixel = Pixel::new(
                at(f64::from(column) / 64.0, source.size[0]),
                at(share, source.size[1]),
            );
            let Some(ray) = source.lens.unproject(pixel) else {
                continue;
            };
            let distance = 1.5 + f64::from((7 * row + 3 * column) % 11);
            let point = source.rotation.transpose() * (ray * distance - source.translation);
            let s = 1.0 / point.length();
            let ray = (point * s).as_vec3();
            let point = [ray.x, ray.y, ray.z, s as f32];
            let rounded = ProxyPoint {
                ray: ray.as_dvec3(),
                inverse_distance: f64::from(point[3]),
                plane: PLANE,
            };
            if let Some(pixel) = frame.project(source_idx, &rounded) {
                points.push((point, pixel));
            }
        }
    }
    assert!(points.len() > 1000, "{}", points.len());
    points
}

/// That fovBlend is the f64 model's at the pixel where an engine sees a point.
pub(crate) fn check_fov(source: &FrameSource, [u, v]: [f32; 2], found: f32, name: &str) {
    // Less than nothing where it is beyond the border by rounding.
    let expected = source.fov_blend(Pixel::new(u.into(), v.into())).max(0.0);
    let error = (f64::from(found) - expected).abs();
    assert!(error < 1e-3, "{name}: {found} is not {expected}");
}

/// How far apart two pixels of a source view are.
///
/// A sphere's first and last pixels of a row are neighbours, and its row at a pole is one
/// point: so close to it that the digits of f32 do not tell its pixels apart (a five
/// hundredth of the height), what counts is the length on the sphere.
pub(crate) fn distance(source: &FrameSource, found: [f32; 2], expected: Pixel) -> f64 {
    let (mut dx, dy) = (
        f64::from(found[0]) - expected.x,
        f64::from(found[1]) - expected.y,
    );
    if source.lens.distortion() == Distortion::Equirectangular {
        let [width, height] = source.size;
        dx -= width * (dx / width).round();
        let from_pole = expected.y.min(height - expected.y) / height;
        if from_pole < 0.002 {
            dx *= (PI * from_pole).sin();
        }
    }
    dx.hypot(dy)
}

/// Directions that the lens does not see, if there are any.
pub(crate) fn unseen(frame: &Frame<'_>, source_idx: usize) -> Vec<[f32; 4]> {
    let source = &frame.sources[source_idx];
    let mut unseen = Vec::new();
    for step in 0..=36 {
        let (sin, cos) = (f64::from(step) * 5.0_f64.to_radians()).sin_cos();
        let point = source.rotation.transpose()
            * (DVec3::new(0.6 * sin, 0.8 * sin, cos) - source.translation);
        let s = 1.0 / point.length();
        let ray = (point * s).as_vec3();
        let rounded = ProxyPoint {
            ray: ray.as_dvec3(),
            inverse_distance: s,
            plane: PLANE,
        };
        let sees = frame.project(source_idx, &rounded);
        if sees.is_none_or(|pixel| frame.fov_blend(source_idx, pixel) < 0.0) {
            unseen.push([ray.x, ray.y, ray.z, s as f32]);
        }
    }
    unseen
}
