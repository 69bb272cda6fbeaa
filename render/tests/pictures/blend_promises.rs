//! What the blending field promises for any cameras at all.

use crate::blend::lumigraph;
use crate::common::{Random, pinhole};

use calibrate::{Distortion, Lens, Pixel, Rigid3, View};
use glam::{DVec2, DVec3};
use proptest::prelude::*;
use proxy::Plane;
use render::reference::blend_at;
use render::{
    Blend, FieldOptions, Frame, Lumigraph, MAX_CONTRIBUTORS, ProxyPoint, Resolution, Surface,
};

/// How a set of cameras is arranged to do harm.
#[derive(Clone, Copy, Debug)]
enum Arrangement {
    Random,
    Coincident,
    /// In a row through the desired camera: epipoles before and behind it, all at one place.
    CollinearAhead,
    /// In a row across the line of sight: epipoles at infinity.
    CollinearAcross,
    OnTheProxy,
    BehindTheViewer,
    /// On a circle around the line of sight: every difference the same.
    Ring,
    One,
    /// All see one point in a corner of their images, or just not.
    AtTheBorder,
}

const ARRANGEMENTS: [Arrangement; 9] = [
    Arrangement::Random,
    Arrangement::Coincident,
    Arrangement::CollinearAhead,
    Arrangement::CollinearAcross,
    Arrangement::OnTheProxy,
    Arrangement::BehindTheViewer,
    Arrangement::Ring,
    Arrangement::One,
    Arrangement::AtTheBorder,
];

/// The cameras of an arrangement and a desired view among them, in a world of size `scale`.
fn arranged(arrangement: Arrangement, random: &mut Random, scale: f64) -> (Lumigraph, View) {
    const SIZE: (u32, u32) = (64, 48);
    let plane = Plane::new(DVec3::ZERO, DVec3::Z).unwrap();
    let viewer = DVec3::new(0.0, 0.0, -4.0);
    let at = |center: DVec3| pinhole(center, center + DVec3::Z, 50.0, SIZE);
    let anywhere = |random: &mut Random| {
        let mut view = pinhole(
            viewer + random.vector(3.0),
            random.vector(1.0),
            random.within(20.0, 300.0),
            SIZE,
        );
        if random.below(3) == 0 {
            let fisheye = Distortion::Fisheye { k: [0.0; 4] };
            view.lens = Lens::new(DVec2::splat(20.0), view.lens.principal, fisheye);
        }
        view
    };
    let sixty = 1 + random.below(60);
    let views: Vec<View> = match arrangement {
        Arrangement::Random => (0..sixty).map(|_| anywhere(random)).collect(),
        Arrangement::Coincident => vec![at(viewer + random.vector(1.0)); 40],
        Arrangement::CollinearAhead => (0..12)
            .map(|i| at(viewer + DVec3::Z * (0.5 * f64::from(i) - 2.0)))
            .collect(),
        Arrangement::CollinearAcross => (0..12)
            .map(|i| at(viewer + DVec3::X * (0.25 * f64::from(i) - 1.0)))
            .collect(),
        Arrangement::OnTheProxy => (0..8)
            .map(|_| {
                let center = random.vector(2.0) * DVec3::new(1.0, 1.0, 0.0);
                pinhole(center, center + random.direction(), 30.0, SIZE)
            })
            .collect(),
        Arrangement::BehindTheViewer => (0..8)
            .map(|_| at(viewer - DVec3::Z * random.within(0.1, 20.0)))
            .collect(),
        Arrangement::Ring => (0..32)
            .map(|i| {
                let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 32.0).sin_cos();
                at(viewer + DVec3::new(cos, sin, 0.0))
            })
            .collect(),
        Arrangement::One => vec![anywhere(random)],
        Arrangement::AtTheBorder => (0..9)
            .map(|i| {
                let mut view = at(viewer + random.vector(0.3));
                let corner = view.project(DVec3::ZERO).unwrap();
                let off = [0.0, 1e-300, 1e-9, 0.5][i % 4];
                view.lens.principal += DVec2::new(off - corner.x, off - corner.y);
                view
            })
            .collect(),
    };
    // The desired camera: anywhere, exactly at a source's place, or in the proxy's plane.
    let desired = match random.below(4) {
        0 => anywhere(random),
        1 => views[random.below(views.len())].clone(),
        2 => at(viewer * DVec3::new(1.0, 1.0, [1.0, 0.0, -1e-9][random.below(3)])),
        _ => at(viewer),
    };
    let scaled = |view: View| View {
        camera_from_world: Rigid3 {
            translation: scale * view.camera_from_world.translation,
            ..view.camera_from_world
        },
        ..view
    };
    let views = views.into_iter().map(scaled).collect();
    (lumigraph(views, plane), scaled(desired))
}

/// Points of the proxy that are as likely as any to make trouble.
fn points(frame: &Frame<'_>, random: &mut Random) -> Vec<ProxyPoint> {
    let (width, height) = (
        f64::from(frame.desired.width),
        f64::from(frame.desired.height),
    );
    let mut pixels = vec![
        Pixel::new(0.0, 0.0),
        Pixel::new(0.5 * width, 0.5 * height),
        Pixel::new(width, height),
    ];
    let anywhere = |_| Pixel::new(random.within(0.0, width), random.within(0.0, height));
    pixels.extend((0..5).map(anywhere));
    // Epipoles, and where source cameras stand or look.
    let lens = &frame.desired.lens;
    for source in frame.sources.iter().take(8) {
        pixels.extend(lens.project(source.center));
        pixels.extend(lens.project(-source.center));
    }
    let mut points: Vec<ProxyPoint> = pixels
        .into_iter()
        .filter_map(|pixel| frame.proxy_point(pixel))
        .collect();
    // The horizon; and rays of other lengths.
    if let Surface::Plane(q) = frame.surface {
        let along = q.normalize().any_orthonormal_vector();
        let beside = q.normalize().cross(along);
        let on_the_horizon = [along, -along, beside, -beside].map(|ray| ProxyPoint {
            ray,
            inverse_distance: 0.0,
            plane: q,
        });
        points.extend(on_the_horizon);
    }
    let longer = |point: &ProxyPoint, factor: f64| ProxyPoint {
        ray: factor * point.ray,
        inverse_distance: factor * point.inverse_distance,
        plane: point.plane,
    };
    let scaled: Vec<ProxyPoint> = points
        .iter()
        .flat_map(|point| [longer(point, 1e-3), longer(point, 1e3)])
        .collect();
    points.extend(scaled);
    points
}

/// Weights are finite and positive, come in the order of the views, at most sixteen, and
/// sum to one wherever any photo sees the point; elsewhere there are none.
fn check_promises(frame: &Frame<'_>, point: &ProxyPoint) -> Result<(), TestCaseError> {
    let contributors = blend_at(frame, point);
    let seen = (0..frame.sources.len()).any(|i| {
        let view = &frame.lumigraph.sources[i].view;
        let pixel = frame.project(i, point);
        pixel.is_some_and(|pixel| view.contains(pixel))
    });
    prop_assert_eq!(!contributors.is_empty(), seen, "{:?}", contributors);
    prop_assert!(contributors.len() <= MAX_CONTRIBUTORS);
    for c in &contributors {
        prop_assert!(c.weight.is_finite() && c.weight > 0.0, "{:?}", contributors);
    }
    for pair in contributors.windows(2) {
        prop_assert!(pair[0].source_idx < pair[1].source_idx);
    }
    let sum: f64 = contributors.iter().map(|c| c.weight).sum();
    prop_assert!(!seen || (sum - 1.0).abs() <= 1e-12, "they sum to {}", sum);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(3000) })]

    #[test]
    fn weights_keep_their_promises_for_any_cameras(
        arrangement in proptest::sample::select(&ARRANGEMENTS[..]),
        seed: u64,
        exponent in -6..=6,
        k in 1..=16_usize,
        beta in proptest::sample::select(&[0.0, 0.1, 10.0][..]),
        feather in proptest::sample::select(&[0.0, 0.02, 0.5][..]),
        paper: bool,
        resolution in 0..3_usize,
    ) {
        let mut random = Random(seed);
        let (lumigraph, desired) = arranged(arrangement, &mut random, 10.0_f64.powi(exponent));
        let resolutions = [Resolution::Footprint, Resolution::Distance, Resolution::Length];
        let options = FieldOptions {
            k,
            beta,
            blend: if paper { Blend::Paper } else { Blend::Consistent },
            resolution: resolutions[resolution],
            feather,
        };
        let frame = Frame::new(&lumigraph, desired, options);
        for point in points(&frame, &mut random) {
            check_promises(&frame, &point)?;
        }
    }
}
