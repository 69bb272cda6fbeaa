//! The blending field against a second, plain implementation, and for chosen cameras.

use crate::common::{Random, pinhole};

use calibrate::{Distortion, Lens, Pixel, View};
use glam::{DVec2, DVec3, Vec3Swizzles};
use proxy::{Plane, Proxy};
use render::blend::Contributor;
use render::reference::blend_at;
use render::{
    Blend, FieldOptions, Frame, Lumigraph, MAX_CONTRIBUTORS, PhotoStore, Resolution, SourceView,
};

pub(crate) fn lumigraph(views: Vec<View>, plane: Plane) -> Lumigraph {
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
pub(crate) fn dense(contributors: &[Contributor], count: usize) -> Vec<f64> {
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

// --------------------------------------------------------------------- Named properties

/// Cameras in a grid before a wall, all alike.
pub(crate) fn grid(columns: i32, rows: i32) -> Lumigraph {
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
