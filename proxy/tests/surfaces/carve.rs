//! Carving as a whole: against exact rooms, on captures, and on input that is no good.

#[allow(dead_code, unreachable_pub)]
use crate::room;

use calibrate::{Pixel, Rigid3, View, colmap};
use glam::{DQuat, DVec3};
use proxy::carve::{self, CarveError, Options};
use proxy::{Mesh, MeshKind, Solid, SparsePoint, shell};
use room::{Random, Room};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;
use std::path::Path;

fn carved(views: &[View], points: &[SparsePoint]) -> Mesh {
    let surface = carve::surface(views, points, &Options::default());
    surface.unwrap().mesh
}

/// Each side of a triangle is the other way round in another: no holes, one orientation.
fn assert_closed(mesh: &Mesh) {
    let mut sides: BTreeMap<(u32, u32), i32> = BTreeMap::new();
    for t in &mesh.triangles {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            *sides.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
        }
    }
    assert!(!mesh.triangles.is_empty());
    assert!(sides.values().all(|&sum| sum == 0));
    assert!(mesh.positions.iter().all(|p| p.is_finite()));
}

/// The nearest hit of a ray, as a multiple of its vector, and whether it is on the outside.
fn hit(mesh: &Mesh, origin: DVec3, ray: DVec3) -> Option<(f64, bool)> {
    let meet = |t: usize| {
        let [a, b, c] = mesh.corners(t).map(|p| p - origin);
        let [u, v, w] = [b.cross(c), c.cross(a), a.cross(b)].map(|n| n.dot(ray));
        let inside = u.min(v).min(w) >= 0.0 || u.max(v).max(w) <= 0.0;
        let normal = (b - a).cross(c - a);
        let along = normal.dot(a) / normal.dot(ray);
        (inside && along > 0.0).then_some((along, normal.dot(ray) < 0.0))
    };
    let hits = (0..mesh.triangles.len()).filter_map(meet);
    hits.min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Rays through an even grid of a view's pixels, corners included.
fn rays(view: &View, steps: u32) -> Vec<DVec3> {
    let mut rays = Vec::new();
    for y in 0..=steps {
        for x in 0..=steps {
            let share = |i: u32, size: u32| f64::from(i) / f64::from(steps) * f64::from(size);
            let pixel = Pixel::new(share(x, view.width), share(y, view.height));
            if let Some(ray) = view.lens.unproject(pixel) {
                rays.push(view.camera_from_world.rotation.conjugate() * ray);
            }
        }
    }
    rays
}

fn assert_covers(mesh: &Mesh, views: &[View], steps: u32) {
    for view in views {
        for ray in rays(view, steps) {
            let (_, outside) = hit(mesh, view.center(), ray).expect("every pixel hits something");
            assert!(outside, "free space is on the outside");
        }
    }
}

/// Mean and 95 % of what is far from the truth where photos look, and the share of it within
/// a limit.
fn errors(room: &Room, mesh: &Mesh, limit: f64) -> (f64, f64, f64) {
    let mut off = Vec::new();
    let mut near = 0;
    for view in &room.views {
        for ray in rays(view, 16) {
            let (along, _) = hit(mesh, view.center(), ray).unwrap();
            off.push(room.off_surface(view.center() + ray * along));
            let truth = room.distance(view.center(), ray);
            near += usize::from((along - truth).abs() * ray.length() < limit);
        }
    }
    off.sort_by(f64::total_cmp);
    let mean = off.iter().sum::<f64>() / off.len() as f64;
    (
        mean,
        off[off.len() * 95 / 100],
        near as f64 / off.len() as f64,
    )
}

#[test]
fn a_room_of_exact_points_is_that_room() {
    let room = Room::new(16);
    let mesh = carved(&room.views, &room.points(3000, 0.0, &mut Random(1)));
    assert_closed(&mesh);
    assert_covers(&mesh, &room.views, 6);
    let (mean, most, complete) = errors(&room, &mesh, 0.1);
    println!("exact: mean {mean:.4} m, 95 % {most:.4} m, within 0.1 m {complete:.3}");
    assert!(
        mean < 0.02 && most < 0.09 && complete > 0.9,
        "{mean} {most} {complete}"
    );
}

#[test]
fn triangles_follow_one_another_as_they_lie_in_space() {
    let room = Room::new(16);
    let mesh = carved(&room.views, &room.points(3000, 0.0, &mut Random(1)));
    let count = mesh.triangles.len();
    let middle = |i: usize| mesh.corners(i).into_iter().sum::<DVec3>() / 3.0;
    // A few far ones, of the dome, are apart anyhow.
    let median = |mut apart: Vec<f64>| {
        apart.sort_by(f64::total_cmp);
        apart[count / 2]
    };
    let next = median(
        (1..=count)
            .map(|i| middle(i - 1).distance(middle(i % count)))
            .collect(),
    );
    let any = median(
        (0..count)
            .map(|i| middle(i).distance(middle(i * 7919 % count)))
            .collect(),
    );
    assert!(next < 0.1 * any, "{next} {any}");
}

#[test]
fn a_view_from_what_nothing_carved_looks_out_of_the_shell() {
    let room = Room::new(16);
    let solid = Solid::new(
        MeshKind::Carved,
        carved(&room.views, &room.points(500, 0.0, &mut Random(3))),
    );
    let far = solid.mesh().positions.iter().map(|p| p.length());
    let far = far.fold(0.0, f64::max);
    for direction in [DVec3::X, DVec3::NEG_Y, DVec3::new(1.0, 2.0, -3.0)] {
        let direction = direction.normalize();
        let center = 0.5 * far * direction;
        for ray in [direction, -direction, direction.any_orthogonal_vector()] {
            assert!(solid.first_hit(center, ray).is_some(), "{center} {ray}");
        }
    }
}

#[test]
fn noise_and_mismatches_do_little_harm() {
    let room = Room::new(16);
    let mut random = Random(2);
    let mut points = room.points(3000, 0.01, &mut random);
    // One point in twenty is anywhere along a line of sight of its first photo.
    for i in (0..points.len()).step_by(20) {
        let center = room.views[points[i].seen_by[0] as usize].center();
        let along = 0.2 + 2.0 * random.unit();
        points[i].position = center.lerp(points[i].position, along);
        points[i].seen_by.truncate(2);
    }
    let surface = carve::surface(&room.views, &points, &Options::default()).unwrap();
    // What is anywhere is not on the surface, most of the rest is.
    let share_on = |is_anywhere: bool| {
        let which = (0..points.len()).filter(|i| (i % 20 == 0) == is_anywhere);
        let on: Vec<bool> = which.map(|i| surface.on_surface[i]).collect();
        on.iter().filter(|on| **on).count() as f64 / on.len() as f64
    };
    let (anywhere, rest) = (share_on(true), share_on(false));
    println!("on the surface: {anywhere:.3} of what is anywhere, {rest:.3} of the rest");
    assert!(anywhere < 0.3 && rest > 0.8, "{anywhere} {rest}");
    let mesh = surface.mesh;
    assert_closed(&mesh);
    assert_covers(&mesh, &room.views, 6);
    let (mean, most, complete) = errors(&room, &mesh, 0.1);
    println!("noisy: mean {mean:.4} m, 95 % {most:.4} m, within 0.1 m {complete:.3}");
    assert!(
        mean < 0.05 && most < 0.2 && complete > 0.8,
        "{mean} {most} {complete}"
    );
}

/// As one that nothing placed is at the world's origin, a continent away.
#[test]
fn a_camera_that_is_misplaced_by_far_harms_nothing() {
    let mut room = Room::new(16);
    let points = room.points(1500, 0.0, &mut Random(8));
    let usual = shell(&room.views, &points);
    for far in [1e5, 1e12] {
        room.views[3].camera_from_world.translation = DVec3::new(far, 0.0, 0.0);
        let surface = carve::surface(&room.views, &points, &Options::default()).unwrap();
        let on = surface.on_surface.iter().filter(|on| **on).count();
        assert!(on > 1000, "{far:e}: {on} of 1500 points");
        let others: Vec<View> = [&room.views[..3], &room.views[4..]].concat();
        assert_closed(&surface.mesh);
        assert_covers(&surface.mesh, &others, 4);
        // Nor does what is around it all move away.
        let around = shell(&room.views, &points);
        for ray in [DVec3::X, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z] {
            let [now, before] =
                [&around, &usual].map(|mesh| hit(mesh, room.views[0].center(), ray).unwrap().0);
            assert!((now / before - 1.0).abs() < 0.2, "{ray}: {now} {before}");
        }
    }
}

#[test]
fn the_order_of_photos_and_the_number_of_threads_change_nothing() {
    let room = Room::new(6);
    let points = room.points(500, 0.01, &mut Random(3));
    let mesh = carved(&room.views, &points);
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        assert_eq!(pool.unwrap().install(|| carved(&room.views, &points)), mesh);
    }
    let mut turned = points.clone();
    for point in &mut turned {
        point.seen_by.iter_mut().for_each(|i| *i = 5 - *i);
    }
    let backwards: Vec<View> = room.views.iter().rev().cloned().collect();
    assert_eq!(carved(&backwards, &turned), mesh);
}

/// The same in a world that is scaled, turned and moved.
fn elsewhere(
    views: &[View],
    points: &[SparsePoint],
    (scale, turn, shift): (f64, DQuat, DVec3),
) -> (Vec<View>, Vec<SparsePoint>) {
    let place = |p: DVec3| turn * (p * scale) + shift;
    let view = |view: &View| {
        let rotation = view.camera_from_world.rotation * turn.conjugate();
        let center = place(view.center());
        View {
            camera_from_world: Rigid3::new(rotation, -(rotation * center)),
            ..view.clone()
        }
    };
    let point = |p: &SparsePoint| SparsePoint {
        position: place(p.position),
        ..p.clone()
    };
    (
        views.iter().map(view).collect(),
        points.iter().map(point).collect(),
    )
}

/// It leaves none of the world's axes where it was.
fn some_turn() -> DQuat {
    DQuat::from_euler(glam::EulerRot::XYZ, 2.1, -0.4, 0.9)
}

#[test]
fn turning_the_world_turns_the_shell() {
    let room = Room::new(12);
    let points = room.points(900, 0.002, &mut Random(9));
    let around = shell(&room.views, &points);
    for turn in [
        some_turn(),
        DQuat::from_rotation_z(0.3),
        DQuat::from_rotation_x(PI),
    ] {
        let (views, turned) = elsewhere(&room.views, &points, (1.0, turn, DVec3::ZERO));
        let other = shell(&views, &turned);
        assert_eq!(other.triangles, around.triangles);
        for (there, here) in other.positions.iter().zip(&around.positions) {
            let expected = turn * *here;
            assert!(there.distance(expected) < 1e-6, "{there} {expected}");
        }
    }
}

#[test]
fn moving_scaling_and_turning_the_world_does_the_same_to_the_surface() {
    let room = Room::new(8);
    let points = room.points(800, 0.0, &mut Random(4));
    let mesh = carved(&room.views, &points);
    for (scale, turn, shift) in [
        (1.0, DQuat::IDENTITY, DVec3::new(5e5, 5.4e6, 300.0)),
        (1e-6, DQuat::IDENTITY, DVec3::ZERO),
        (1e6, DQuat::IDENTITY, DVec3::ZERO),
        (1.0, some_turn(), DVec3::ZERO),
        (3.0, some_turn(), DVec3::new(-70.0, 20.0, 5.0)),
    ] {
        let (views, moved) = elsewhere(&room.views, &points, (scale, turn, shift));
        let other = carved(&views, &moved);
        assert_closed(&other);
        // Rounding to the lattice may differ, and with it a few facets.
        let mut same = 0;
        for ray in rays(&room.views[0], 12) {
            let here = hit(&mesh, room.views[0].center(), ray).unwrap().0;
            let there = hit(&other, views[0].center(), turn * ray).unwrap().0 / scale;
            same += usize::from((there / here - 1.0).abs() < 1e-3);
        }
        assert!(same > 160, "{same} of 169");
    }
}

#[test]
fn a_camera_farther_off_than_numbers_reach_is_told() {
    let room = Room::new(5);
    let points = room.points(100, 0.0, &mut Random(5));
    for far in [1e160, 1e300] {
        let mut views = room.views.clone();
        let mut stray = views[0].clone();
        stray.camera_from_world.translation = DVec3::X * far;
        views.push(stray);
        match carve::surface(&views, &points, &Options::default()) {
            Ok(surface) => assert_closed(&surface.mesh),
            Err(error) => assert_eq!(error, CarveError::TooFar, "{far}"),
        }
    }
}

#[test]
fn degenerate_points_give_a_closed_surface() {
    let room = Room::new(5);
    let seen = |position: DVec3| SparsePoint {
        position,
        seen_by: (0..5).collect(),
    };
    let middle = DVec3::new(5.0, 4.0, 0.9);
    let line: Vec<_> = (0..50)
        .map(|i| seen(middle + DVec3::X * 0.01 * f64::from(i)))
        .collect();
    let plane: Vec<_> = (0..400)
        .map(|i| seen(middle + 0.01 * DVec3::new(f64::from(i % 20), f64::from(i / 20), 0.0)))
        .collect();
    let mut wild = plane.clone();
    for bad in [
        f64::NAN,
        f64::INFINITY,
        1e9,
        -1e9,
        1e300,
        f64::MAX,
        f64::MIN_POSITIVE,
    ] {
        wild.push(seen(DVec3::splat(bad)));
        wild.push(seen(DVec3::new(bad, 1.0, 2.0)));
    }
    let cases = [
        vec![seen(middle)],
        vec![seen(middle); 100],
        line[..5].to_vec(),
        line,
        plane,
        wild,
    ];
    for points in cases {
        let count = points.len();
        // Only photos that look that way see any of it.
        let mesh = carved(&room.views, &points);
        assert_closed(&mesh);
        println!("{count} points: {} facets", mesh.triangles.len());
        assert_covers(&mesh, &room.views, 4);
        let around = shell(&room.views, &points);
        assert_closed(&around);
    }
    // A camera on a point, and all cameras in one place.
    let mut points = room.points(100, 0.0, &mut Random(5));
    points[0].position = room.views[0].center();
    assert_closed(&carved(&room.views, &points));
    let same = vec![room.views[0].clone(); 5];
    let mesh = carved(&same, &points);
    assert_closed(&mesh);
    assert_covers(&mesh, &same[..1], 4);
}

#[test]
fn one_line_of_each_point_is_enough_to_carve_with() {
    let room = Room::new(5);
    let points = room.points(300, 0.0, &mut Random(5));
    for lines_per_point in [0, 1, 2] {
        let options = Options {
            lines_per_point,
            ..Options::default()
        };
        let mesh = carve::surface(&room.views, &points, &options).unwrap().mesh;
        assert_closed(&mesh);
        assert_covers(&mesh, &room.views, 4);
    }
}

#[test]
fn what_cannot_be_carved_is_an_error_that_says_why() {
    let room = Room::new(2);
    let options = Options::default();
    let point = |position, seen_by| SparsePoint { position, seen_by };
    let text = |views: &[View], points: &[SparsePoint]| {
        carve::surface(views, points, &options)
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        text(&[], &[]),
        "there are no photos, so no lines of sight to carve with"
    );
    assert_eq!(
        text(
            &room.views,
            &[point(DVec3::NAN, vec![0]), point(DVec3::ZERO, vec![])]
        ),
        "of 2 sparse points none is finite and in front of a photo that sees it; try another \
         proxy, such as a plane"
    );
    assert_eq!(
        text(
            &room.views,
            &[DVec3::ZERO, DVec3::ONE].map(|at| point(at, vec![]))
        ),
        "no photo sees any of the 2 sparse points, so there are no lines of sight to carve with; try \
         another proxy, such as a plane"
    );
    assert_eq!(
        text(&room.views, &[point(DVec3::ONE, vec![1, 2])]),
        "point 0 is seen by photo 2 (both counting from 0), but there are 2 photos"
    );
    let mut lost = room.views.clone();
    lost[1].camera_from_world.translation = DVec3::NAN;
    assert!(matches!(
        carve::surface(&lost, &[], &options),
        Err(CarveError::Camera { view: 1, .. })
    ));
}

#[test]
fn the_shell_is_the_ground_and_a_dome() {
    let mut room = Room::new(12);
    let all = room.points(2000, 0.002, &mut Random(6));
    let around = shell(&room.views, &all);
    assert_closed(&around);
    room.views.iter().for_each(|v| {
        assert_eq!(
            hit(&around, v.center(), v.forward()).map(|h| h.1),
            Some(true)
        )
    });
    let down = hit(&around, room.views[0].center(), DVec3::NEG_Z)
        .unwrap()
        .0;
    assert!(
        (down - 1.6).abs() < 0.02,
        "the floor is 1.6 m below, found {down}"
    );
    let up = hit(&around, room.views[0].center(), DVec3::Z).unwrap().0;
    assert!(up > 30.0, "the sky is far: {up}");
    // Cameras below it make it no ground.
    for view in &mut room.views[..1] {
        let rotation = view.camera_from_world.rotation;
        view.camera_from_world = Rigid3::new(rotation, -(rotation * DVec3::new(5.0, 4.0, -1.0)));
    }
    let around = shell(&room.views, &all);
    assert!(
        hit(&around, room.views[1].center(), DVec3::NEG_Z)
            .unwrap()
            .0
            > 10.0
    );
    // Nothing at all.
    assert_closed(&shell(&[], &[]));
}

#[test]
fn every_pixel_of_every_capture_hits_the_surface() {
    let captures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/captures");
    if !captures.is_dir() {
        eprintln!("SKIPPED: {} is absent", captures.display());
        return;
    }
    for name in ["fern", "opencv-chessboard", "house-walk"] {
        let model = colmap::read_model(&captures.join(name).join("sparse/0")).unwrap();
        let ids: Vec<_> = model.images.keys().copied().collect();
        let views: Vec<View> = model
            .images
            .values()
            .map(|image| {
                let camera = &model.cameras[&image.camera_id];
                View {
                    lens: camera.lens().unwrap(),
                    width: camera.width,
                    height: camera.height,
                    camera_from_world: image.camera_from_world,
                }
            })
            .collect();
        let points: Vec<SparsePoint> = model
            .points
            .values()
            .map(|point| {
                let seen = point
                    .track
                    .iter()
                    .map(|(id, _)| ids.binary_search(id).unwrap() as u32);
                SparsePoint {
                    position: point.position,
                    seen_by: seen.collect::<BTreeSet<_>>().into_iter().collect(),
                }
            })
            .collect();
        let mesh = carved(&views, &points);
        assert_closed(&mesh);
        assert_covers(&mesh, &views, 6);
    }
}

#[test]
fn the_shelf_is_carved_to_within_a_hundredth_of_its_distance() {
    let options = datasets::Options {
        size: Some((96, 72)),
        ..datasets::Options::default()
    };
    for name in ["shelf", "wall"] {
        let dataset = datasets::by_name(name, &options).unwrap();
        let views: Vec<View> = dataset.photos.iter().map(|p| p.view.clone()).collect();
        let points: Vec<SparsePoint> = dataset
            .reconstruction
            .points
            .values()
            .map(|p| SparsePoint {
                position: p.position,
                seen_by: p.track.iter().map(|(id, _)| id.0 - 1).collect(),
            })
            .collect();
        let mesh = carved(&views, &points);
        assert_closed(&mesh);
        let mut errors = Vec::new();
        for view in views.iter().step_by(4) {
            for ray in rays(view, 12) {
                let (along, _) = hit(&mesh, view.center(), ray).unwrap();
                if let Some(truth) = dataset.scene.distance(view.center(), ray) {
                    errors.push((truth / along - 1.0).abs());
                }
            }
        }
        errors.sort_by(f64::total_cmp);
        let [median, most] = [50, 95].map(|p| errors[errors.len() * p / 100]);
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        println!(
            "{name}: {} points, inverse depth off by mean {mean:.4}, median {median:.4}, 95 % {most:.4}",
            points.len()
        );
        assert!(median < 0.01 && most < 0.15, "{name}: {median} {most}");
    }
}
