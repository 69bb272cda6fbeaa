use super::*;
use calibrate::{Lens, Rigid3};
use proptest::prelude::*;

fn view(center: DVec3) -> View {
    View {
        lens: Lens::pinhole(DVec2::splat(100.0), DVec2::new(80.0, 60.0)),
        width: 160,
        height: 120,
        camera_from_world: Rigid3::looking_at(center, center + DVec3::Z, DVec3::NEG_Y),
    }
}

/// Points all over a surface z(x, y), seen by views 0 and 1.
fn surface(z: impl Fn(f64, f64) -> f64) -> Vec<SparsePoint> {
    let along = |i: i32| f64::from(i) * 0.37;
    let at = |i: i32, j: i32| {
        let (x, y) = (
            along(i) + 0.01 * f64::from(j),
            along(j) - 0.02 * f64::from(i),
        );
        SparsePoint {
            position: DVec3::new(x, y, z(x, y)),
            seen_by: vec![0, 1],
        }
    };
    (-15..=15)
        .flat_map(|i| (-12..=12).map(move |j| at(i, j)))
        .collect()
}

fn sources() -> Vec<View> {
    vec![view(DVec3::X), view(DVec3::NEG_X)]
}

/// The distance of the surface along the ray through a pixel.
fn depth(facets: &Facets, desired: &View, x: f64, y: f64) -> Option<f64> {
    depth_at(facets, &facets.neighbours(), desired, x, y)
}

fn depth_at(
    facets: &Facets,
    neighbours: &[[u32; 3]],
    desired: &View,
    x: f64,
    y: f64,
) -> Option<f64> {
    let ray = desired.lens.unproject(Pixel::new(x, y))?;
    let facet = facets.locate(neighbours, ray, 0);
    Some(ray.z / facets.planes[facet as usize].dot(ray))
}

#[test]
fn a_plane_of_points_is_that_plane_all_over_the_image() {
    let points = surface(|x, y| 5.0 + 0.2 * x - 0.1 * y);
    let desired = view(DVec3::new(0.2, 0.1, -0.3));
    let facets = facets(&desired, &sources(), &points).unwrap();
    for (x, y) in [
        (0.5, 0.5),
        (159.5, 0.5),
        (80.0, 60.0),
        (31.0, 119.5),
        (159.5, 119.5),
    ] {
        let depth = depth(&facets, &desired, x, y).unwrap();
        let ray = desired.lens.unproject(Pixel::new(x, y)).unwrap();
        let at = desired.center() + ray / ray.z * depth;
        let expected = 5.0 + 0.2 * at.x - 0.1 * at.y;
        // The anchors only guess.
        let tolerance = if x == 80.0 { 1e-9 } else { 0.5 };
        assert!(
            (at.z - expected).abs() < tolerance,
            "{x}, {y}: {} {expected}",
            at.z
        );
    }
}

#[test]
fn every_pixel_of_any_lens_sees_a_facet() {
    let points = surface(|x, _| 4.0 + x.sin());
    let wide = View {
        lens: Lens::new(
            DVec2::splat(50.0),
            DVec2::new(80.0, 60.0),
            calibrate::Distortion::Fisheye { k: [0.0; 4] },
        ),
        ..view(DVec3::ZERO)
    };
    for desired in [view(DVec3::new(0.0, 0.3, 0.5)), wide] {
        let facets = facets(&desired, &sources(), &points).unwrap();
        let neighbours = facets.neighbours();
        let mut last = 0;
        for y in 0..desired.height {
            for x in 0..desired.width {
                let ray = desired.lens.unproject(Pixel::center_of(x, y)).unwrap();
                last = facets.locate(&neighbours, ray, last);
                let s = facets.planes[last as usize].dot(ray);
                let from_afar = facets.planes[facets.locate(&neighbours, ray, 0) as usize].dot(ray);
                assert!((s - from_afar).abs() < 1e-12, "{x}, {y}: {s}, {from_afar}");
                assert!(s > 0.0, "{x}, {y}: {s}");
            }
        }
    }
}

#[test]
fn what_sticks_out_and_what_is_hidden_does_not_count() {
    let clean = surface(|_, _| 5.0);
    let desired = view(DVec3::ZERO);
    let mut spoilt = clean.clone();
    let seen_by = vec![0, 1];
    for (i, position) in [
        DVec3::new(0.1, 0.05, 1.0),
        DVec3::new(-0.3, 0.4, 40.0),
        DVec3::new(1.0, -1.0, 9.0),
        DVec3::new(1.1, -1.0, 9.1),
        DVec3::new(0.0, 0.0, 1e9),
        DVec3::new(0.0, 0.0, -3.0),
    ]
    .into_iter()
    .enumerate()
    {
        let seen_by = seen_by.clone();
        spoilt.insert(17 * i, SparsePoint { position, seen_by });
    }
    let facets = facets(&desired, &sources(), &spoilt).unwrap();
    for (x, y) in [
        (80.0, 60.0),
        (82.0, 61.0),
        (76.0, 66.0),
        (91.0, 49.0),
        (40.0, 30.0),
    ] {
        let depth = depth(&facets, &desired, x, y).unwrap();
        assert!((depth - 5.0).abs() < 1e-6, "{x}, {y}: {depth}");
    }
}

#[test]
fn only_the_views_most_alike_give_their_points() {
    // Seven views beside the desired one see a wall; one far off to the side, which sees
    // as many points, another.
    let mut points = surface(|_, _| 5.0);
    let mut sources: Vec<View> = (0..7)
        .map(|i| view(DVec3::X * 0.1 * f64::from(i)))
        .collect();
    sources.push(view(DVec3::new(30.0, 0.0, 4.0)));
    for point in &mut points {
        point.seen_by = (0..7).collect();
    }
    let mut other = surface(|_, _| 4.5);
    other.iter_mut().for_each(|p| p.seen_by = vec![7]);
    points.extend(other);
    let desired = view(DVec3::ZERO);
    let facets = facets(&desired, &sources, &points).unwrap();
    let depth = depth(&facets, &desired, 80.0, 60.0).unwrap();
    assert!((depth - 5.0).abs() < 1e-9, "{depth}");
}

#[test]
fn a_side_of_the_picture_has_the_views_most_alike_there() {
    // Seven views beside the desired one see most of it, and one more the left.
    let mut points = surface(|x, _| if x > -1.5 { 5.0 } else { 5.4 });
    let mut sources: Vec<View> = (0..7)
        .map(|i| view(DVec3::X * 0.1 * f64::from(i)))
        .collect();
    sources.push(view(DVec3::X * -0.1));
    for point in &mut points {
        let is_right = point.position.x > -1.5;
        point.seen_by = if is_right { (0..7).collect() } else { vec![7] };
    }
    let desired = view(DVec3::ZERO);
    let facets = facets(&desired, &sources, &points).unwrap();
    for (x, expected) in [(20.0, 5.4), (130.0, 5.0)] {
        let depth = depth(&facets, &desired, x, 60.0).unwrap();
        assert!((depth - expected).abs() < 0.03, "{x}: {depth}");
    }
}

/// A thousand points in a corner, say of a plant, do not outvote the rest of the picture.
#[test]
fn parts_of_the_picture_are_shared_and_not_points() {
    let mut points = surface(|_, _| 5.0);
    let mut sources: Vec<View> = (0..6)
        .map(|i| view(DVec3::X * 0.1 * f64::from(i)))
        .collect();
    sources.extend((0..6).map(|i| view(DVec3::X * (1.0 + 0.1 * f64::from(i)))));
    for point in &mut points {
        point.seen_by = (0..6).collect();
    }
    let plant = |i: i32| SparsePoint {
        position: DVec3::new(
            0.3 + 0.001 * f64::from(i % 40),
            0.3 + 0.001 * f64::from(i / 40),
            5.0,
        ),
        seen_by: (6..12).collect(),
    };
    points.extend((0..1600).map(plant));
    let desired = view(DVec3::ZERO);
    let facets = facets(&desired, &sources, &points).unwrap();
    // The wall's points are there: were they not, there would be no facets all over it.
    let wall = points.iter().filter(|p| p.seen_by[0] == 0).count();
    assert!(facets.triangles.len() > wall, "{}", facets.triangles.len());
}

/// As from a tripod, or in a burst: which of them is the seventh is a matter of rounding.
#[test]
fn any_number_of_views_of_one_place_give_their_points() {
    let mut points = surface(|_, _| 5.0);
    points
        .iter_mut()
        .for_each(|p| p.seen_by = (0..40).collect());
    let sources = vec![view(DVec3::X); 40];
    let facets = facets(&view(DVec3::ZERO), &sources, &points).unwrap();
    let depth = depth(&facets, &view(DVec3::ZERO), 80.0, 60.0).unwrap();
    assert!((depth - 5.0).abs() < 1e-9, "{depth}");
}

#[test]
fn too_little_is_no_surface() {
    let desired = view(DVec3::ZERO);
    assert_eq!(facets(&desired, &sources(), &[]), None);
    let behind = surface(|_, _| -5.0);
    assert_eq!(facets(&desired, &sources(), &behind), None);
    let one_place = vec![
        SparsePoint {
            position: DVec3::new(0.1, 0.2, 3.0),
            seen_by: vec![0],
        };
        50
    ];
    assert_eq!(facets(&desired, &sources(), &one_place), None);
    // In a row they are one, thanks to the anchors.
    let row: Vec<SparsePoint> = surface(|_, _| 5.0).into_iter().step_by(25).collect();
    assert!(facets(&desired, &sources(), &row).is_some());
}

#[test]
fn without_facets_a_plane_is_where_what_is_known_lies() {
    let desired = view(DVec3::ZERO);
    let depth = |sources: &[View], points: &[SparsePoint]| {
        assert_eq!(facets(&desired, sources, points), None);
        let plane = plane_without_facets(&desired, sources, points)?;
        let q = plane.inverse_distance_from(desired.center())?;
        Some(1.0 / q.z)
    };
    let moved = |offset: DVec3| {
        let mut points = surface(|_, _| 5.0);
        points.iter_mut().for_each(|p| p.position += offset);
        points
    };
    // 1. Points beside the image.
    let beside = depth(&sources(), &moved(DVec3::X * 40.0)).unwrap();
    assert!((beside - 5.0).abs() < 0.3, "{beside}");
    // 2. Points in front of the sources alone.
    let behind: Vec<View> = [-1.0, 0.0, 1.0]
        .map(|x| view(DVec3::new(x, 0.0, -9.0)))
        .into();
    let plane = depth(&behind, &moved(DVec3::NEG_Z * 6.0)).unwrap();
    assert!((plane + 1.0).abs() < 1e-9, "{plane}");
    // 3. No points: where the axes meet, if they do.
    assert_eq!(depth(&sources(), &[]), None);
    let turned = sources().into_iter().map(|source| View {
        camera_from_world: Rigid3::looking_at(source.center(), DVec3::Z * 4.0, DVec3::NEG_Y),
        ..source
    });
    let turned: Vec<View> = turned.collect();
    let axes = depth(&turned, &[]).unwrap();
    assert!((axes - 4.0).abs() < 1e-9, "{axes}");
    assert_eq!(depth(&[], &[]), None);
    // Whoever is said to see points need not be there.
    let mut points = moved(DVec3::ZERO);
    points.truncate(2);
    points.iter_mut().for_each(|p| p.seen_by = vec![]);
    assert_eq!(depth(&sources(), &points), None);
}

proptest! {
    /// Whatever the points, the walk finds a facet that holds the ray, and inverse distance
    /// there is positive and no larger than the largest of its corners'.
    #[test]
    fn the_walk_finds_what_holds_the_ray(
        positions in prop::collection::vec(prop::array::uniform3(-4.0..4.0_f64), 3..60),
        x in 0.0..160.0_f64,
        y in 0.0..120.0_f64,
    ) {
        let points: Vec<SparsePoint> = positions
            .into_iter()
            .map(|p| SparsePoint { position: DVec3::from(p), seen_by: vec![0] })
            .collect();
        let desired = view(DVec3::new(0.0, 0.0, -2.0));
        if let Some(facets) = facets(&desired, &sources(), &points) {
            let ray = desired.lens.unproject(Pixel::new(x, y)).unwrap().normalize();
            let facet = facets.locate(&facets.neighbours(), ray, 0);
            let corners = facets.triangles[facet as usize];
            let directions = corners.map(|i| facets.directions[i as usize]);
            for k in 0..3 {
                let side = directions[k].cross(directions[(k + 1) % 3]).dot(ray);
                prop_assert!(side >= 0.0, "{side}");
            }
            let s = facets.planes[facet as usize].dot(ray);
            prop_assert!(s > 0.0, "{s}");
        }
    }
}

/// The mean relative change of depth over the image from one desired view to another.
fn change(a: &View, b: &View, sources: &[View], points: &[SparsePoint]) -> f64 {
    let [first, second] = [a, b].map(|view| facets(view, sources, points).unwrap());
    let [beside_first, beside_second] = [&first, &second].map(Facets::neighbours);
    let places = (0..16)
        .flat_map(|i| (0..12).map(move |j| (10.0 * f64::from(i) + 5.0, 10.0 * f64::from(j) + 5.0)));
    let changes = places.map(|(x, y)| {
        let (p, q) = (
            depth_at(&first, &beside_first, a, x, y).unwrap(),
            depth_at(&second, &beside_second, b, x, y).unwrap(),
        );
        (p / q).ln().abs()
    });
    changes.sum::<f64>() / 192.0
}

#[test]
fn points_that_hardly_count_change_hardly_anything() {
    // A wall with a step and a lone point before it; then many points at once of all depths, that begin
    // to come into sight.
    let at = |x: f64, y: f64, inverse_distance: f64, weight: f64| Node {
        direction: DVec3::new(x, y, 1.0).normalize(),
        inverse_distance,
        weight,
    };
    let wall = (0..400).map(|i| {
        let (x, y) = (f64::from(i % 20), f64::from(i / 20));
        let shift = 0.3 * (1.7 * x + 2.9 * y).sin();
        let s = if x < 11.0 { 0.2 } else { 0.23 + 0.002 * y };
        at(0.05 * (x + shift) - 0.5, 0.05 * (y - shift) - 0.5, s, 1.0)
    });
    let mut wall: Vec<Node> = wall.collect();
    wall.push(at(0.211, 0.137, 0.4, 1.0));
    let crowd = (0..3000).map(|i| {
        let [x, y, s] =
            [0.61803399, 0.75487767, 0.56984029].map(|step| (step * f64::from(i)).fract());
        at(x - 0.5, y - 0.5, 0.1 + 0.5 * s, 1e-9)
    });
    let with: Vec<Node> = wall.iter().copied().chain(crowd).collect();
    let with = distinct(with);
    let [alone, with] = [&wall, &with].map(|nodes| {
        let nodes = without_odd(nodes);
        faded(&nodes, &Nearest::new(&nodes))
    });
    // Some are gone.
    let weight = |nodes: &[Node], node: &Node| {
        let own = nodes.iter().find(|n| n.direction == node.direction);
        own.map_or(0.0, |n| n.weight)
    };
    for node in &wall {
        let [alone, with] = [&alone, &with].map(|nodes| weight(nodes, node));
        assert!((alone - with).abs() < 1e-4, "{node:?}: {alone}, {with}");
    }
    // Those that begin lie on what is there.
    let begins = |node: &&Node| !wall.iter().any(|w| w.direction == node.direction);
    for node in with.iter().filter(begins) {
        let s = node.inverse_distance;
        assert!((0.19..0.28).contains(&s), "{node:?}");
    }
}

#[test]
fn points_fade_in_and_out() {
    // Eleven views in a row that all see a plane, and each alone a few points before it.
    let sources: Vec<View> = (0..11)
        .map(|i| view(DVec3::X * (0.3 * f64::from(i))))
        .collect();
    let mut points = surface(|_, _| 5.0);
    for point in &mut points {
        point.position.x += 1.5;
        point.seen_by = (0..11).collect();
    }
    for i in 0..11 {
        points.extend((0..12).map(|j| SparsePoint {
            position: DVec3::new(
                0.31 * f64::from(j) + 0.17 * f64::from(i) - 1.0,
                0.23 * f64::from((5 * i + 7 * j) % 11) - 1.0,
                4.6,
            ),
            seen_by: vec![i as u32],
        }));
    }
    let at = |x: f64| view(DVec3::new(x, 0.02, 0.1));
    // Each step is halved towards the half that changes more: what is left is a jump.
    let mut worst: f64 = 0.0;
    for step in 0..20 {
        let (mut from, mut to) = (0.9 + 0.07 * f64::from(step), 0.97 + 0.07 * f64::from(step));
        for _ in 0..14 {
            let half = 0.5 * (from + to);
            let halves = [(from, half), (half, to)];
            let [first, second] = halves.map(|(a, b)| change(&at(a), &at(b), &sources, &points));
            (from, to) = halves[usize::from(second > first)];
        }
        worst = worst.max(change(&at(from), &at(to), &sources, &points));
    }
    println!("the depth jumps by {worst:.2e} at most");
    // Were they there at once, it would be 2.8e-3. What is left are triangles that flip where
    // points move past each other.
    assert!(worst < 1.5e-3, "{worst}");
}
