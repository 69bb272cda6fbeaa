//! The blending field against a second, plain implementation, and what it promises for any
//! cameras at all.

use crate::common;

use calibrate::{Distortion, Lens, Pixel, Rigid3, View};
use common::{Random, pinhole};
use glam::{DVec2, DVec3, Vec3Swizzles};
use proptest::prelude::*;
use proxy::{Plane, Proxy};
use render::blend::Contributor;
use render::reference::blend_at;
use render::{
    Blend, FieldOptions, Frame, Lumigraph, MAX_CONTRIBUTORS, PhotoStore, ProxyPoint, Resolution,
    SourceView, Surface,
};

fn lumigraph(views: Vec<View>, plane: Plane) -> Lumigraph {
    let source = |(i, view): (usize, View)| SourceView {
        name: format!("{i}"),
        view,
        gain: [1.0; 3],
        time_s: None,
        quarters: 0,
    };
    Lumigraph {
        points: Vec::new(),
        photos: PhotoStore::new(views.len(), |i| Err(format!("{i} is not needed"))),
        sources: views.into_iter().enumerate().map(source).collect(),
        proxy: Proxy::Plane(plane),
        visibility: None,
    }
}

/// A contributor's weight for every source view.
fn dense(contributors: &[Contributor], count: usize) -> Vec<f64> {
    let mut weights = vec![0.0; count];
    for c in contributors {
        weights[c.source_idx] = c.weight;
    }
    weights
}

// ---------------------------------------------------------------- The second implementation

/// The weights of all source views at a point p of the world, from the formulas as the
/// design has them: lengths and angles in the world, t by bisection.
fn plain_weights(
    lumigraph: &Lumigraph,
    desired: &View,
    p: DVec3,
    options: &FieldOptions,
) -> Vec<f64> {
    let views = lumigraph.sources.iter().map(|s| &s.view);
    let longest = views.clone().map(|v| v.lens.mean_focal());
    let focal = desired.lens.mean_focal().min(longest.fold(0.0, f64::max));
    let terms: Vec<(f64, f64)> = views
        .map(|view| {
            let a = plain_fov_blend(view, p, options.feather);
            (
                a,
                plain_difference(view, desired.center(), focal, p, options),
            )
        })
        .collect();
    let t = match options.blend {
        Blend::Consistent => plain_threshold(&terms, options.k as f64 / 3.0),
        Blend::Paper => nth_smallest(&terms, options.k),
    };
    let relevance = |&(a, diff): &(f64, f64)| {
        let paper = a * (1.0 - diff / t).max(0.0);
        match options.blend {
            Blend::Consistent => paper / diff,
            Blend::Paper => paper,
        }
    };
    let mut weights: Vec<f64> = terms.iter().map(relevance).collect();
    if terms.iter().any(|(a, _)| *a > 0.0) && weights.iter().all(|w| !(*w > 0.0)) {
        // 0/0: one view alone at the threshold.
        let nearest = nth_smallest(&terms, 1);
        let at_it = |&(a, diff): &(f64, f64)| if diff == nearest { a } else { 0.0 };
        weights = terms.iter().map(at_it).collect();
    }
    let sum: f64 = weights.iter().sum();
    if sum > 0.0 {
        weights.iter_mut().for_each(|w| *w /= sum);
    }
    weights
}

fn plain_fov_blend(view: &View, p: DVec3, feather: f64) -> f64 {
    let Some(pixel) = view.project(p) else {
        return 0.0;
    };
    let (width, height) = (f64::from(view.width), f64::from(view.height));
    let sides = [pixel.x, width - pixel.x, pixel.y, height - pixel.y];
    let border = sides.into_iter().fold(f64::INFINITY, f64::min);
    if border < 0.0 {
        return 0.0;
    }
    let feather_px = feather * width.min(height);
    if border >= feather_px {
        return 1.0;
    }
    let x = border / feather_px;
    3.0 * x.powi(2) - 2.0 * x.powi(3)
}

fn plain_difference(view: &View, d: DVec3, focal: f64, p: DVec3, options: &FieldOptions) -> f64 {
    let (to_d, to_c) = (d - p, view.center() - p);
    let ang_diff = to_d.cross(to_c).length().atan2(to_d.dot(to_c));
    let res_diff = match options.resolution {
        Resolution::Footprint => {
            (to_c.length() / view.lens.mean_focal()) / (to_d.length() / focal) - 1.0
        }
        Resolution::Distance => to_c.length() / to_d.length() - 1.0,
        Resolution::Length => to_c.length() - to_d.length(),
    };
    ang_diff + options.beta * res_diff.max(0.0)
}

/// The n-th smallest difference among the views that see the point, or the largest.
fn nth_smallest(terms: &[(f64, f64)], n: usize) -> f64 {
    let seen = terms.iter().filter(|(a, _)| *a > 0.0);
    let mut diffs: Vec<f64> = seen.map(|(_, diff)| *diff).collect();
    diffs.sort_by(f64::total_cmp);
    let last = diffs.len();
    if last == 0 {
        0.0
    } else {
        diffs[n.min(last) - 1]
    }
}

/// t with Σ aᵢ·max(0, 1 − diffᵢ/t) = m by bisection; infinite where the sum never gets
/// there; at most the 17th smallest difference.
fn plain_threshold(terms: &[(f64, f64)], m: f64) -> f64 {
    let sum = |t: f64| -> f64 {
        let relevance = terms.iter().map(|(a, diff)| a * (1.0 - diff / t).max(0.0));
        relevance.sum()
    };
    let seen = terms.iter().filter(|(a, _)| *a > 0.0).count();
    let limit = if seen > MAX_CONTRIBUTORS {
        nth_smallest(terms, MAX_CONTRIBUTORS + 1)
    } else {
        f64::INFINITY
    };
    if terms.iter().map(|(a, _)| a).sum::<f64>() <= m {
        return limit;
    }
    let (mut low, mut high) = (0.0, 1.0);
    while sum(high) < m {
        high *= 2.0;
    }
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if sum(middle) < m {
            low = middle;
        } else {
            high = middle;
        }
    }
    high.min(limit)
}

/// Cameras of all kinds around the origin, which look roughly at it across a plane near it.
fn random_scene(random: &mut Random) -> (Lumigraph, View) {
    let mut view = |spread: f64| {
        let center = DVec3::new(0.0, 0.0, -4.0) + random.vector(spread);
        let size = (80 + random.below(200) as u32, 80 + random.below(200) as u32);
        let focal = random.within(80.0, 400.0);
        let mut view = pinhole(center, random.vector(0.7), focal, size);
        let k1 = random.within(-0.1, 0.1);
        let distortion = match random.below(4) {
            0 => Distortion::Rational {
                k: [k1, 0.01, 0.0, 0.02, 0.0, 0.0],
                p: [0.001, -0.002],
            },
            1 => Distortion::Fisheye {
                k: [0.3 * k1, 0.01, 0.0, 0.0],
            },
            _ => Distortion::None,
        };
        let aspect = DVec2::new(1.0, random.within(0.9, 1.1));
        view.lens = Lens::new(aspect * focal, view.lens.principal, distortion);
        view
    };
    let desired = view(1.5);
    let count = [1, 2, 3, 5, 8, 13, 24, 60];
    let views = (0..count[desired.width as usize % count.len()])
        .map(|_| view(2.0))
        .collect();
    let normal = DVec3::Z + random.vector(0.4);
    let plane = Plane::new(random.vector(0.3), normal).unwrap();
    (lumigraph(views, plane), desired)
}

fn random_options(random: &mut Random) -> FieldOptions {
    FieldOptions {
        k: 1 + random.below(16),
        beta: [0.0, 0.1, 0.1, 1.0][random.below(4)],
        blend: Blend::Consistent,
        resolution: [
            Resolution::Footprint,
            Resolution::Distance,
            Resolution::Length,
        ][random.below(3)],
        feather: [0.0, 0.02, 0.02, 0.3][random.below(4)],
    }
}

#[test]
fn both_blends_match_the_formulas_at_random_points() {
    let mut random = Random(1);
    let (mut compared, mut shared, mut capped) = (0, 0, 0);
    let mut worst = 0.0_f64;
    for _ in 0..400 {
        let (lumigraph, desired) = random_scene(&mut random);
        let count = lumigraph.sources.len();
        let options = random_options(&mut random);
        let pixels: Vec<Pixel> = (0..20)
            .map(|_| {
                let x = random.within(0.0, f64::from(desired.width));
                let y = random.within(0.0, f64::from(desired.height));
                Pixel::new(x, y)
            })
            .collect();
        for blend in [Blend::Consistent, Blend::Paper] {
            let options = FieldOptions { blend, ..options };
            let frame = Frame::new(&lumigraph, desired.clone(), options);
            for &pixel in &pixels {
                let plane = lumigraph.proxy.plane().unwrap();
                let world_from_camera = desired.camera_from_world.rotation.conjugate();
                let Some(ray) = desired.lens.unproject(pixel) else {
                    continue;
                };
                let hit = plane.intersect(desired.center(), world_from_camera * ray);
                let Some(p) = hit.filter(|p| p.length() < 50.0) else {
                    continue;
                };
                let point = frame.proxy_point(pixel).expect("the ray meets the plane");
                let ours = dense(&blend_at(&frame, &point), count);
                let plain = plain_weights(&lumigraph, &desired, p, &options);
                for i in 0..count {
                    let error = (ours[i] - plain[i]).abs();
                    worst = worst.max(error);
                    assert!(
                        error <= 1e-9,
                        "view {i} of {count}: {} instead of {}, {options:?}\n{ours:?}\n{plain:?}",
                        ours[i],
                        plain[i]
                    );
                }
                let contributors = plain.iter().filter(|w| **w > 0.0).count();
                compared += 1;
                shared += usize::from(contributors >= 2);
                capped += usize::from(contributors == MAX_CONTRIBUTORS);
            }
        }
    }
    println!("{compared} points, {shared} shared, {capped} at the cap; worst {worst:e}");
    assert!(compared > 8000 && shared > 4000, "{compared}, {shared}");
}

// ------------------------------------------------------------------- Adversarial cameras

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

// --------------------------------------------------------------------- Named properties

/// Cameras in a grid before a wall, all alike.
fn grid(columns: i32, rows: i32) -> Lumigraph {
    let mut views = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let (x, y) = (f64::from(column), f64::from(row));
            let nudge = DVec3::new((2.3 * y).sin(), (1.7 * x).cos(), (x + 3.1 * y).sin());
            let center = DVec3::new(0.4 * x, 0.35 * y, -3.0) + 0.1 * nudge;
            let target = DVec3::new(center.x, center.y, 0.0) + 0.3 * nudge.yzx();
            views.push(pinhole(center, target, 120.0, (160, 120)));
        }
    }
    lumigraph(
        views,
        Plane::new(DVec3::ZERO, DVec3::new(0.1, -0.05, 1.0)).unwrap(),
    )
}

#[test]
fn a_view_from_a_source_camera_is_that_camera_alone() {
    let lumigraph = grid(4, 3);
    for (i, source) in lumigraph.sources.iter().enumerate() {
        let frame = Frame::new(&lumigraph, source.view.clone(), FieldOptions::default());
        for (x, y) in [(0, 0), (80, 60), (159, 119), (3, 117)] {
            let point = frame.proxy_point(Pixel::center_of(x, y)).unwrap();
            let alone = Contributor {
                source_idx: i,
                weight: 1.0,
            };
            assert_eq!(blend_at(&frame, &point), [alone]);
        }
    }
}

#[test]
fn coincident_cameras_share_and_the_lowest_indices_go_first() {
    let view = pinhole(DVec3::new(0.0, 0.0, -3.0), DVec3::ZERO, 100.0, (80, 60));
    let plane = Plane::new(DVec3::ZERO, DVec3::Z).unwrap();
    let lumigraph = lumigraph(vec![view.clone(); 40], plane);
    let beside = pinhole(DVec3::new(0.4, 0.0, -3.0), DVec3::ZERO, 100.0, (80, 60));
    for desired in [view, beside] {
        for blend in [Blend::Consistent, Blend::Paper] {
            let options = FieldOptions {
                blend,
                ..FieldOptions::default()
            };
            let frame = Frame::new(&lumigraph, desired.clone(), options);
            let point = frame.proxy_point(Pixel::new(40.0, 30.0)).unwrap();
            let expected: Vec<Contributor> = (0..MAX_CONTRIBUTORS)
                .map(|source_idx| Contributor {
                    source_idx,
                    weight: 1.0 / MAX_CONTRIBUTORS as f64,
                })
                .collect();
            assert_eq!(blend_at(&frame, &point), expected, "{blend:?}");
        }
    }
}

#[test]
fn no_more_than_sixteen_contribute() {
    let lumigraph = grid(8, 8);
    for blend in [Blend::Consistent, Blend::Paper] {
        let options = FieldOptions {
            k: 16,
            blend,
            ..FieldOptions::default()
        };
        let desired = pinhole(
            DVec3::new(1.3, 1.2, -8.0),
            DVec3::new(1.3, 1.2, 0.0),
            200.0,
            (64, 48),
        );
        let frame = Frame::new(&lumigraph, desired, options);
        let mut most = 0;
        for x in 0..64 {
            let point = frame.proxy_point(Pixel::center_of(x, 24)).unwrap();
            most = most.max(blend_at(&frame, &point).len());
        }
        // The paper's k-th itself has no weight.
        let expected = match blend {
            Blend::Consistent => 16,
            Blend::Paper => 15,
        };
        assert_eq!(most, expected, "{blend:?}");
    }
}

#[test]
fn the_order_of_the_source_views_changes_nothing() {
    let mut random = Random(7);
    for _ in 0..100 {
        let (lumigraph, desired) = random_scene(&mut random);
        let mut order: Vec<usize> = (0..lumigraph.sources.len()).collect();
        random.shuffle(&mut order);
        let shuffled = Lumigraph {
            points: Vec::new(),
            sources: order
                .iter()
                .map(|&i| lumigraph.sources[i].clone())
                .collect(),
            photos: PhotoStore::from_images(Vec::new()),
            proxy: lumigraph.proxy.clone(),
            visibility: None,
        };
        for blend in [Blend::Consistent, Blend::Paper] {
            let options = FieldOptions {
                blend,
                ..random_options(&mut random)
            };
            let ours = Frame::new(&lumigraph, desired.clone(), options);
            let theirs = Frame::new(&shuffled, desired.clone(), options);
            for _ in 0..10 {
                let x = random.within(0.0, f64::from(desired.width));
                let y = random.within(0.0, f64::from(desired.height));
                let Some(point) = ours.proxy_point(Pixel::new(x, y)) else {
                    continue;
                };
                let count = order.len();
                let weights = dense(&blend_at(&ours, &point), count);
                let others = dense(&blend_at(&theirs, &point), count);
                for (there, &here) in order.iter().enumerate() {
                    assert!((weights[here] - others[there]).abs() <= 1e-12);
                }
            }
        }
    }
}

// -------------------------------------------------------------------------- Continuity

/// The largest jump of the weights (half the sum of their changes: the part of the total
/// that moves) left when the worst steps along a way through the picture are bisected to
/// nothing. Only where a photo sees the point at both ends.
fn largest_jump(at: impl Fn(f64) -> Vec<f64>) -> f64 {
    const STEPS: usize = 400;
    const WORST: usize = 12;
    let change = |a: &[f64], b: &[f64]| -> f64 {
        let covered = |w: &[f64]| w.iter().any(|w| *w > 0.0);
        if !covered(a) || !covered(b) {
            return 0.0;
        }
        0.5 * a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>()
    };
    let samples: Vec<Vec<f64>> = (0..=STEPS).map(|i| at(i as f64 / STEPS as f64)).collect();
    let mut steps: Vec<usize> = (0..STEPS).collect();
    steps.sort_by(|&i, &j| {
        let of = |i: usize| change(&samples[i], &samples[i + 1]);
        of(j).total_cmp(&of(i))
    });
    let mut largest = 0.0_f64;
    for &i in &steps[..WORST] {
        let (mut low, mut high) = (i as f64 / STEPS as f64, (i + 1) as f64 / STEPS as f64);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            let (a, m, b) = (at(low), at(middle), at(high));
            if change(&a, &m) >= change(&m, &b) {
                high = middle;
            } else {
                low = middle;
            }
        }
        largest = largest.max(change(&at(low), &at(high)));
    }
    largest
}

/// Over rows of the picture and over moves of the desired camera.
fn largest_jump_of(lumigraph: &Lumigraph, options: FieldOptions) -> f64 {
    let count = lumigraph.sources.len();
    let mut largest = 0.0_f64;
    for i in 0..5 {
        let y = 0.25 * f64::from(i);
        let desired = |x: f64| {
            pinhole(
                DVec3::new(x, y, -3.3 - y),
                DVec3::new(0.8, 0.5, 0.0),
                80.0,
                (160, 120),
            )
        };
        let field = |frame: &Frame<'_>, pixel: Pixel| {
            let point = frame
                .proxy_point(pixel)
                .expect("the wall fills the picture");
            dense(&blend_at(frame, &point), count)
        };
        let frame = Frame::new(lumigraph, desired(0.6), options);
        let along_a_row = |s: f64| field(&frame, Pixel::new(160.0 * s, 10.0 + 25.0 * f64::from(i)));
        let along_a_path = |s: f64| {
            let frame = Frame::new(lumigraph, desired(2.0 * s - 0.3), options);
            field(&frame, Pixel::new(20.0 + 30.0 * f64::from(i), 50.0))
        };
        largest = largest
            .max(largest_jump(along_a_row))
            .max(largest_jump(along_a_path));
    }
    largest
}

#[test]
fn weights_are_continuous_where_a_camera_leaves_the_field_of_view() {
    // Few cameras, of which some pixels see only one; and many. (The cap of sixteen does
    // jump, 9 % at k = 16; about k views contribute, so at the default it does nothing.)
    let lumigraph = grid(4, 3);
    let few = largest_jump_of(&lumigraph, FieldOptions::default());
    let many = largest_jump_of(&grid(8, 8), FieldOptions::default());
    let more = largest_jump_of(
        &grid(8, 8),
        FieldOptions {
            k: 3,
            ..FieldOptions::default()
        },
    );
    let paper = largest_jump_of(
        &lumigraph,
        FieldOptions {
            blend: Blend::Paper,
            ..FieldOptions::default()
        },
    );
    println!("largest jumps: {few:e} of few, {many:e} and {more:e} of many; paper {paper}");
    assert!(few.max(many).max(more) <= 0.002, "{few}, {many}, {more}");
    assert!(
        paper > 0.02,
        "the paper's form jumps, or this test finds no jumps: {paper}"
    );
}
