//! Visual hulls: of a car whose silhouettes and geometry are exact, and of what is no object.

use calibrate::{Distortion, Lens, Rigid3, View};
use datasets::{Dataset, Options as Scene, render_depth};
use glam::{DQuat, DVec2, DVec3};
use proxy::Mesh;
use proxy::hull::{Hull, HullError, Options, Silhouette, carve, measure, outline, simplify};
use std::collections::BTreeMap;
use std::sync::LazyLock;

pub(crate) struct Capture {
    pub(crate) views: Vec<View>,
    pub(crate) silhouettes: Vec<Silhouette>,
}

pub(crate) static CAR: LazyLock<(Dataset, Capture)> = LazyLock::new(|| car((640, 480), 36));
static CAR_HULL: LazyLock<Hull> = LazyLock::new(|| {
    let options = Options {
        faces: None,
        ..Options::default()
    };
    carve(&CAR.1.views, &CAR.1.silhouettes, &options).unwrap()
});

/// The car's exact silhouettes: pixels whose centre's ray meets it.
fn car(size: (u32, u32), photos: usize) -> (Dataset, Capture) {
    let scene = Scene {
        size: Some(size),
        views: Some(photos),
        samples_per_side: Some(1),
    };
    let dataset = datasets::by_name("car", &scene).unwrap();
    let views: Vec<View> = dataset.photos.iter().map(|p| p.view.clone()).collect();
    let silhouettes = views.iter().map(|view| seen(&dataset, view)).collect();
    (dataset, Capture { views, silhouettes })
}

fn seen(dataset: &Dataset, view: &View) -> Silhouette {
    let depth = render_depth(&dataset.scene, view);
    let inside = depth.iter().map(|z| z.is_finite()).collect();
    Silhouette::new(view.width, view.height, inside).unwrap()
}

/// Every edge is run along as often one way as the other.
pub(crate) fn is_closed(mesh: &Mesh) -> bool {
    let mut runs: BTreeMap<(u32, u32), i32> = BTreeMap::new();
    for [a, b, c] in &mesh.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let one_way = if from < to { 1 } else { -1 };
            *runs.entry((*from.min(to), *from.max(to))).or_default() += one_way;
        }
    }
    !mesh.triangles.is_empty() && runs.values().all(|balance| *balance == 0)
}

/// How often a closed mesh winds around a point (van Oosterom and Strackee 1983).
fn winding(mesh: &Mesh, point: DVec3) -> f64 {
    let solid_angle = |i: usize| {
        let [a, b, c] = mesh.corners(i).map(|p| p - point);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        2.0 * a.dot(b.cross(c)).atan2(below)
    };
    (0..mesh.triangles.len()).map(solid_angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

/// The distance from a point to a mesh.
fn distance(mesh: &Mesh, point: DVec3) -> f64 {
    let to_triangle = |i: usize| {
        let [a, b, c] = mesh.corners(i);
        let to_edge = |a: DVec3, b: DVec3| {
            let along = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            point.distance(a.lerp(b, along))
        };
        let n = (b - a).cross(c - a).normalize_or_zero();
        let over = [(a, b), (b, c), (c, a)]
            .iter()
            .all(|(a, b)| n.dot((*b - *a).cross(point - *a)) >= 0.0);
        if over && n != DVec3::ZERO {
            n.dot(point - a).abs()
        } else {
            to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
        }
    };
    (0..mesh.triangles.len())
        .map(to_triangle)
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn the_cars_hull_fills_its_silhouettes_and_is_closed() {
    let hull = &*CAR_HULL;
    assert!(hull.carved.coverage >= 0.999, "{:?}", hull.carved);
    assert!(hull.carved.iou >= 0.97, "{:?}", hull.carved);
    assert!(is_closed(&hull.mesh));
    assert!(hull.mesh.volume() > 0.0);
    assert_eq!(
        measure(&hull.mesh, &CAR.1.views, &CAR.1.silhouettes),
        hull.carved
    );
}

/// A visual hull contains its object: within a pixel or two, no point of the car sticks out.
#[test]
fn the_hull_contains_the_car_and_little_else() {
    let (dataset, _) = &*CAR;
    let hull = &*CAR_HULL;
    let pixel = 0.85 / 960.0;
    let points = dataset.reconstruction.points.values().step_by(23);
    for point in points {
        let inside = winding(&hull.mesh, point.position) > 0.5;
        let off = distance(&hull.mesh, point.position);
        assert!(
            inside || off < 1.5 * pixel,
            "{} is {off} outside",
            point.position
        );
    }
    // No photo shows the underside: there the hull stands off.
    let near = hull.mesh.positions.iter().step_by(101);
    let mut off: Vec<f64> = near.map(|p| dataset.scene.distance_to(*p)).collect();
    off.sort_by(f64::total_cmp);
    let median = off[off.len() / 2];
    assert!(
        median < 5.0 * pixel,
        "half the surface is {median} or more from the car's"
    );
}

#[test]
fn simplified_to_500_faces_it_contains_all_it_contained() {
    let (_, capture) = &*CAR;
    let whole = &CAR_HULL.mesh;
    let simple = simplify(whole, 500);
    assert!(simple.triangles.len() <= 500);
    assert!(is_closed(&simple));
    for point in whole.positions.iter().step_by(29) {
        let inside = winding(&simple, *point) > 0.5;
        assert!(
            inside || distance(&simple, *point) < 1e-7,
            "{point} sticks out"
        );
    }
    let measures = measure(&simple, &capture.views, &capture.silhouettes);
    assert!(
        measures.coverage >= CAR_HULL.carved.coverage,
        "{measures:?}"
    );
    assert!(measures.iou >= 0.9, "{measures:?}");
    // And by default.
    let hull = carve(&capture.views, &capture.silhouettes, &Options::default()).unwrap();
    assert!(hull.measures.faces <= 500 && is_closed(&hull.mesh));
    assert!(
        hull.measures.coverage >= hull.carved.coverage,
        "{:?}",
        hull.measures
    );
    assert!(hull.measures.iou >= 0.9, "{:?}", hull.measures);
}

#[test]
fn tolerance_and_misses_only_grow_a_hull() {
    let (_, capture) = car((160, 120), 12);
    let volume = |tolerance_px: f64, misses: u16| {
        let options = Options {
            tolerance_px,
            misses,
            least_coverage: 0.0,
            faces: None,
            ..Options::default()
        };
        let hull = carve(&capture.views, &capture.silhouettes, &options).unwrap();
        assert!(is_closed(&hull.mesh));
        hull.mesh.volume()
    };
    let volumes = [
        volume(0.0, 0),
        volume(1.0, 0),
        volume(1.0, 1),
        volume(2.0, 2),
    ];
    assert!(volumes.is_sorted(), "{volumes:?}");
}

/// A mask that is wrong in one photo cuts a hole, unless one photo may be wrong; that it may
/// is found out.
#[test]
fn a_miss_mends_a_wrong_mask() {
    let (_, mut capture) = car((320, 240), 24);
    let (width, height) = capture.silhouettes[5].size();
    let mut inside = capture.silhouettes[5].inside().to_vec();
    for (i, inside) in inside.iter_mut().enumerate() {
        *inside &= (i as u32 % width) < width / 2;
    }
    capture.silhouettes[5] = Silhouette::new(width, height, inside).unwrap();
    let coverage = |misses: u16| {
        let options = Options {
            misses,
            least_coverage: 0.0,
            faces: None,
            ..Options::default()
        };
        let hull = carve(&capture.views, &capture.silhouettes, &options).unwrap();
        assert_eq!(hull.misses, misses);
        hull.carved.coverage
    };
    assert!(coverage(0) < 0.9, "{}", coverage(0));
    assert!(coverage(1) > 0.998, "{}", coverage(1));
    let hull = carve(&capture.views, &capture.silhouettes, &Options::default()).unwrap();
    assert_eq!((hull.misses, hull.tolerance_px), (1, 1.0));
    assert!(hull.carved.coverage > 0.998, "{:?}", hull.carved);
}

/// The world's scale, place and orientation, the photos' order and the number of threads
/// change nothing else.
#[test]
fn a_hull_follows_its_world_and_is_the_same_every_time() {
    let (_, capture) = car((160, 120), 12);
    let options = Options {
        faces: None,
        ..Options::default()
    };
    let hull = carve(&capture.views, &capture.silhouettes, &options).unwrap();
    let threads = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let again = threads.install(|| carve(&capture.views, &capture.silhouettes, &options));
    assert_eq!(again.unwrap(), hull);
    for (scale, shift) in [(1e-4, 0.0), (1e4, 0.0), (1.0, 1e4)] {
        let turn = DQuat::from_axis_angle(DVec3::new(0.3, -0.8, 0.5).normalize(), 2.0);
        let moved = |view: &View| {
            let rotation = view.camera_from_world.rotation * turn.conjugate();
            let center = scale * (turn * view.center()) + shift;
            View {
                camera_from_world: Rigid3::new(rotation, -(rotation * center)),
                ..view.clone()
            }
        };
        let views: Vec<View> = capture.views.iter().map(moved).rev().collect();
        let silhouettes: Vec<Silhouette> = capture.silhouettes.iter().cloned().rev().collect();
        let other = carve(&views, &silhouettes, &options).unwrap();
        assert!(is_closed(&other.mesh));
        let ratio = other.mesh.volume() / scale.powi(3) / hull.mesh.volume();
        assert!((ratio - 1.0).abs() < 0.03, "{scale}, {shift}: {ratio}");
    }
}

/// Any lens: the same car through strong barrels and fisheyes.
#[test]
fn lenses_with_distortion_carve_as_well() {
    let (dataset, capture) = car((320, 240), 18);
    for distortion in [
        Distortion::Rational {
            k: [-0.25, 0.0, 0.0, 0.0, 0.0, 0.0],
            p: [0.0; 2],
        },
        Distortion::Fisheye {
            k: [0.1, 0.0, 0.0, 0.0],
        },
    ] {
        let through = |view: &View| View {
            lens: Lens::new(view.lens.focal, view.lens.principal, distortion),
            ..view.clone()
        };
        let views: Vec<View> = capture.views.iter().map(through).collect();
        let silhouettes: Vec<Silhouette> = views.iter().map(|v| seen(&dataset, v)).collect();
        let hull = carve(&views, &silhouettes, &Options::default()).unwrap();
        assert!(is_closed(&hull.mesh));
        assert!(hull.carved.coverage >= 0.999, "{:?}", hull.carved);
        assert!(hull.carved.iou >= 0.94, "{:?}", hull.carved);
        assert!(hull.measures.coverage >= hull.carved.coverage);
    }
}

/// A mesh's outline is where its object's rays meet it.
#[test]
fn outlines_are_those_of_rays() {
    let view = &car((80, 60), 2).1.views[1];
    let p = |x: f64, y: f64, z: f64| 0.1 * DVec3::new(x, y, z);
    let tetrahedron = Mesh {
        positions: vec![
            p(1.0, 1.0, 1.0),
            p(-1.0, -1.0, 1.0),
            p(-1.0, 1.0, -1.0),
            p(1.0, -1.0, -1.0),
        ],
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    };
    let drawn = outline(&tetrahedron, view);
    for row in 0..60 {
        for column in 0..80 {
            let ray = view
                .lens
                .unproject(calibrate::Pixel::center_of(column, row))
                .unwrap();
            let direction = view.camera_from_world.rotation.conjugate() * ray;
            // In front of all planes that face it last, behind those it leaves by.
            let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
            for i in 0..4 {
                let [a, b, c] = tetrahedron.corners(i);
                let mut n = (b - a).cross(c - a);
                n *= n.dot(a).signum();
                let t = n.dot(a - view.center()) / n.dot(direction);
                if n.dot(direction) < 0.0 {
                    enter = enter.max(t);
                } else {
                    leave = leave.min(t);
                }
            }
            let inside = drawn.inside()[(row * 80 + column) as usize];
            assert_eq!(inside, enter < leave, "{column}, {row}");
        }
    }
    assert!(drawn.area() > 50);
}

#[test]
fn what_bounds_no_object_is_refused() {
    let (_, capture) = car((80, 60), 8);
    let carve_with = |views: &[View], masks: &[Silhouette]| {
        carve(views, masks, &Options::default()).map(|hull| hull.measures)
    };
    let all = |value: u8| Silhouette::from_values(80, 60, &[value; 4800]).unwrap();
    let (views, masks) = (&capture.views, &capture.silhouettes);
    // Black, white, of another size, not as many.
    let error = carve_with(views, &vec![all(0); 8]).unwrap_err();
    assert_eq!(
        error,
        HullError::NoSilhouettes {
            photos: 8,
            empty: 8,
            full: 0
        }
    );
    let error = carve_with(views, &vec![all(255); 8]).unwrap_err();
    assert_eq!(
        error,
        HullError::NoSilhouettes {
            photos: 8,
            empty: 0,
            full: 8
        }
    );
    let mut wrong = masks.clone();
    wrong[2] = Silhouette::from_values(60, 80, &[255; 4800]).unwrap();
    assert_eq!(
        carve_with(views, &wrong).unwrap_err().to_string(),
        "the mask of photo 2 is 60 × 80 pixels and the photo 80 × 60; masks must be as large \
         as their photos"
    );
    assert!(matches!(
        carve_with(&views[1..], masks),
        Err(HullError::Count { .. })
    ));
    assert!(matches!(
        carve_with(&[], &[]),
        Err(HullError::NoSilhouettes { .. })
    ));
    // One that failed is left out.
    let mut failed = masks.clone();
    failed[5] = all(0);
    let hull = carve(views, &failed, &Options::default()).unwrap();
    assert_eq!(hull.left_out, [5]);
    // Inverted masks reach every border.
    let inverted: Vec<Silhouette> = masks
        .iter()
        .map(|m| Silhouette::new(80, 60, m.inside().iter().map(|i| !i).collect()).unwrap())
        .collect();
    assert!(matches!(
        carve_with(views, &inverted),
        Err(HullError::Unbounded { .. } | HullError::Contradiction { .. })
    ));
    // Cameras on top of each other, and poses that are none.
    let same = vec![views[0].clone(); 8];
    let error = carve_with(&same, &vec![masks[0].clone(); 8]).unwrap_err();
    assert!(matches!(error, HullError::NoParallax { .. }), "{error}");
    let mut lost = views.clone();
    lost[1].camera_from_world.translation.x = f64::NAN;
    assert_eq!(carve_with(&lost, masks), Err(HullError::Pose { photo: 1 }));
    // What can be done where nothing is left.
    assert_eq!(
        HullError::Contradiction { photos: 8 }.to_string(),
        "the silhouettes of 8 photos have no point in common; check that masks and cameras belong \
         together, leave out photos where they do not (`--hold-out`), or try the proxy `points` \
         or `carved`, which need no masks"
    );
    // Masks of other photos.
    let turned: Vec<Silhouette> = (0..8).map(|i| masks[(i * 3 + 1) % 8].clone()).collect();
    if let Ok(measures) = carve_with(views, &turned) {
        assert!(measures.iou.is_finite());
    }
}

#[test]
fn two_photos_bound_an_object() {
    let (_, capture) = car((160, 120), 4);
    let hull = carve(
        &capture.views[..2],
        &capture.silhouettes[..2],
        &Options::default(),
    )
    .unwrap();
    assert!(is_closed(&hull.mesh));
    assert!(hull.carved.coverage > 0.99, "{:?}", hull.carved);
}

/// A camera among what it looks at sees only a part of it: the others bound the hull.
#[test]
fn a_camera_inside_the_hull_does_no_harm() {
    let (dataset, mut capture) = car((160, 120), 12);
    let center = DVec3::new(0.3, 0.05, 0.0);
    capture.views.push(View {
        lens: Lens::pinhole(DVec2::splat(40.0), DVec2::new(80.0, 60.0)),
        camera_from_world: Rigid3::looking_at(center, DVec3::new(0.0, 0.05, 0.0), DVec3::Y),
        ..capture.views[0].clone()
    });
    let inside = DVec3::new(0.0, 0.09, 0.0);
    capture.views.push(View {
        lens: Lens::pinhole(DVec2::splat(40.0), DVec2::new(80.0, 60.0)),
        camera_from_world: Rigid3::looking_at(inside, DVec3::new(1.0, 0.6, 0.0), DVec3::Y),
        ..capture.views[0].clone()
    });
    for view in &capture.views[12..] {
        capture.silhouettes.push(seen(&dataset, view));
    }
    // Half of what the camera inside sees is not masked.
    let halved = capture.silhouettes[13].inside().iter().enumerate();
    let halved = halved.map(|(i, inside)| *inside && i % 160 < 80).collect();
    capture.silhouettes[13] = Silhouette::new(160, 120, halved).unwrap();
    let hull = carve(&capture.views, &capture.silhouettes, &Options::default()).unwrap();
    assert!(is_closed(&hull.mesh));
    assert!(hull.mesh.positions.iter().all(|p| p.is_finite()));
}
