use super::*;
use crate::order::tests::in_other_orders;
use calibrate::colmap::read_model;
use calibrate::{Reconstruction, View};
use proptest::prelude::*;
use std::path::PathBuf;

/// Views and points of a capture, or a loud `None`.
fn capture(name: &str) -> Option<(Vec<View>, Vec<DVec3>)> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/captures");
    let model = folder.join(name).join("sparse/0");
    if !model.is_dir() {
        eprintln!("SKIPPED: {} is absent", model.display());
        return None;
    }
    Some(views_and_points(&read_model(&model).unwrap()))
}

fn views_and_points(whole: &Reconstruction) -> (Vec<View>, Vec<DVec3>) {
    let view = |image: &calibrate::Image| {
        let camera = &whole.cameras[&image.camera_id];
        View {
            lens: camera.lens().unwrap(),
            width: camera.width,
            height: camera.height,
            camera_from_world: image.camera_from_world,
        }
    };
    let points = whole.points.values().map(|p| p.position);
    (whole.images.values().map(view).collect(), points.collect())
}

/// The synthetic hallway, small.
fn hallway() -> (Vec<View>, Vec<DVec3>) {
    let options = datasets::Options {
        size: Some((160, 120)),
        ..Default::default()
    };
    views_and_points(&datasets::hallway(&options).unwrap().reconstruction)
}

/// How far the walls of a tunnel fitted in a moved world are from the true ones, in shares of
/// the hallway's width: left, right, ceiling, floor, far end.
fn errors(tunnel: &Tunnel, world: Rigid3, scale: f64) -> [f64; 5] {
    let datasets::Room { min, max } = datasets::HALLWAY;
    let middle = 0.5 * (min + max);
    // The largest error at the four corners of each true wall that the walk passes by.
    let wall = |axis: usize, place: f64, of: &dyn Fn(DVec3) -> f64| {
        let mut worst: f64 = 0.0;
        for corner in 0..8 {
            let end = |k: usize| [min[k], max[k]][corner >> k & 1];
            let mut point = DVec3::new(end(0), end(1), end(2));
            point[axis] = place;
            // Not the corners themselves, where walls meet.
            point += 0.2 * (middle - point) * (1.0 - DVec3::AXES[axis]);
            let found = tunnel.tunnel_from_world * (world * (point * scale));
            worst = worst.max((of(found) / (scale * (max.x - min.x))).abs());
        }
        worst
    };
    let (low, high) = (tunnel.min, tunnel.max);
    [
        wall(0, min.x, &|p| p.x - low.x),
        wall(0, max.x, &|p| p.x - high.x),
        wall(1, max.y, &|p| p.y - low.y),
        wall(1, min.y, &|p| p.y - high.y),
        wall(2, min.z, &|p| p.z - high.z),
    ]
}

fn moved(views: &[View], points: &[DVec3], world: Rigid3, scale: f64) -> (Vec<View>, Vec<DVec3>) {
    let moved_view = |view: &View| {
        let camera = view.camera_from_world;
        let scaled = Rigid3 {
            translation: camera.translation * scale,
            ..camera
        };
        View {
            camera_from_world: scaled * world.inverse(),
            ..view.clone()
        }
    };
    let points = points.iter().map(|p| world * (*p * scale));
    (views.iter().map(moved_view).collect(), points.collect())
}

#[test]
fn a_hallway_has_its_true_walls_wherever_it_lies() {
    let (views, points) = hallway();
    let far = Rigid3::new(
        glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -1.9, 2.6),
        DVec3::new(3e5, -5e6, 200.0),
    );
    for (world, scale) in [
        (Rigid3::IDENTITY, 1.0),
        (far, 1.0),
        (Rigid3::IDENTITY, 1e-5),
    ] {
        let (views, points) = moved(&views, &points, world, scale);
        let tunnel = fit(&views, &points).unwrap();
        let errors = errors(&tunnel, world, scale);
        println!("{errors:.5?} {tunnel:?}");
        assert!(errors.iter().all(|e| *e < 0.01), "{errors:?}");
        assert!(tunnel.is_hallway(), "{tunnel:?}");
        assert!(views.iter().all(|v| tunnel.contains(v.center())));
    }
}

#[test]
fn noise_and_mismatches_hardly_move_it() {
    let (views, mut points) = hallway();
    for (i, point) in points.iter_mut().enumerate() {
        let r = |k: usize| ((i * 37 + k * 101) as f64 * 0.754_877_666).fract() - 0.5;
        *point += 0.02 * DVec3::new(r(0), r(1), r(2));
        if i % 10 == 0 {
            *point = 8.0 * DVec3::new(r(3), r(4), r(5));
        }
    }
    for odd in [
        DVec3::splat(1e9),
        DVec3::NAN,
        DVec3::INFINITY,
        DVec3::splat(-1e300),
    ] {
        points.insert(5, odd);
    }
    let tunnel = fit(&views, &points).unwrap();
    let errors = errors(&tunnel, Rigid3::IDENTITY, 1.0);
    println!("{errors:.5?}");
    assert!(errors.iter().all(|e| *e < 0.02), "{errors:?}");
    assert!(tunnel.is_hallway(), "{tunnel:?}");
}

/// Every other point is on a wall: one in two of them, by their places in the list, would be all or none.
#[test]
fn the_order_of_points_changes_nothing() {
    let (views, walls) = hallway();
    let noise = |i: usize, k: usize| ((i * 37 + k * 101) as f64 * 0.754_877_666).fract() - 0.5;
    let furnished = |(i, wall): (usize, &DVec3)| {
        let aside = DVec3::new(noise(i, 0), noise(i, 1), noise(i, 2));
        [*wall, 0.6 * *wall + aside]
    };
    let some = walls.iter().step_by(3).enumerate();
    let points: Vec<DVec3> = some.flat_map(furnished).collect();
    assert!((1201..2400).contains(&points.len()), "{}", points.len());
    let expected = fit(&views, &points).unwrap();
    for other in in_other_orders(&points) {
        assert_eq!(fit(&views, &other), Ok(expected));
    }
}

/// Most photos are a panorama of a tripod's, where the walk begins.
#[test]
fn a_panorama_does_not_cut_off_the_walk() {
    let (mut views, points) = hallway();
    let walk = fit(&views, &points).unwrap();
    let tripod = vec![views[0].clone(); views.len() + 1];
    views.extend(tripod);
    let tunnel = fit(&views, &points).unwrap();
    assert!(tunnel.is_hallway(), "{tunnel:?}");
    assert!(views.iter().all(|v| tunnel.contains(v.center())));
    let walked = tunnel.walked / walk.walked;
    assert!((walked - 1.0).abs() < 0.02, "{walked}");
    let errors = errors(&tunnel, Rigid3::IDENTITY, 1.0);
    assert!(errors.iter().all(|e| *e < 0.02), "{errors:?}");
    // One that is lost is not what the box is laid around.
    let mut lost = views[0].clone();
    lost.camera_from_world.translation.z += 1e9;
    views.push(lost);
    let found = fit(&views, &points).unwrap();
    assert!(found.length() < 2.0 * tunnel.length(), "{found:?}");
}

#[test]
fn every_ray_from_inside_meets_a_triangle_that_faces_it() {
    let (views, points) = hallway();
    let tunnel = fit(&views, &points).unwrap();
    let mesh = tunnel.mesh();
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (8, 12));
    let solid = crate::Solid::new(crate::MeshKind::Tunnel, mesh.clone());
    for view in views.iter().step_by(9) {
        for i in 0..500 {
            let r = |k: usize| ((i * 3 + k) as f64 * 0.569_840_290_998).fract() - 0.5;
            let direction = DVec3::new(r(0), r(1), r(2)).normalize();
            let hit = solid.first_hit(view.center(), direction).unwrap();
            let at = view.center() + hit.along * direction;
            assert!(tunnel.distance(at) < 1e-9 * tunnel.length());
            let [a, b, c] = mesh.corners(hit.triangle_idx as usize);
            assert!((b - a).cross(c - a).dot(direction) < 0.0, "faces away");
        }
    }
}

/// What a corridor is, seen in drawings of its points from above and along the way: 2.6 wide,
/// 3.8 high in its own units, its far end 16 from where the walk begins. Many of its points
/// are of plants, and many photos at the end of the walk are misplaced, so few walls are all
/// that most points agree on.
#[test]
fn a_real_corridor_needs_no_help() {
    let Some((views, points)) = capture("corridor") else {
        return;
    };
    let tunnel = fit(&views, &points).unwrap();
    println!("{tunnel:?}");
    let near = |found: f64, expected: f64| (found / expected - 1.0).abs() < 0.1;
    assert!(near(tunnel.width(), 2.65), "{}", tunnel.width());
    assert!(near(tunnel.height(), 3.8), "{}", tunnel.height());
    let first = views
        .iter()
        .map(|v| (tunnel.tunnel_from_world * v.center()).z);
    let ahead = tunnel.max.z - first.fold(f64::INFINITY, f64::min);
    assert!(near(ahead, 16.4), "{ahead}");
    assert!(tunnel.is_hallway());
    let held = views.iter().filter(|v| tunnel.contains(v.center())).count();
    assert!(held * 10 > 8 * views.len(), "{held} of {}", views.len());
}

#[test]
fn what_is_not_walked_through_is_no_hallway() {
    for name in [
        "fern",
        "sceaux-castle",
        "south-building",
        "temple-ring",
        "lego",
        "desk-sweep",
        "can-orbit",
        "opencv-chessboard",
    ] {
        let Some((views, points)) = capture(name) else {
            return;
        };
        let tunnel = fit(&views, &points).unwrap();
        assert!(!tunnel.is_hallway(), "{name}: {tunnel:?}");
    }
}

#[test]
fn degenerate_input_is_an_error_or_a_box() {
    let (views, points) = hallway();
    assert_eq!(fit(&[], &points), Err(TunnelError::NoViews));
    let mut lost = views[0].clone();
    lost.camera_from_world.translation = DVec3::NAN;
    assert_eq!(fit(&[lost.clone()], &points), Err(TunnelError::NoViews));
    let few = |found| {
        Err(TunnelError::TooFewPoints {
            found,
            expected: 12,
        })
    };
    assert_eq!(fit(&views, &[]), few(0));
    assert_eq!(fit(&views, &points[..5]), few(5));
    assert_eq!(fit(&views, &[DVec3::NAN; 50]), few(0));
    let along: Vec<DVec3> = (0..50)
        .map(|i| views[0].center() + views[0].forward() * f64::from(i))
        .collect();
    let on_axis = fit(&views[..1], &along);
    assert_eq!(on_axis, Err(TunnelError::NoWalls));

    // Anything else is a box around the cameras, whether or not it means much.
    let flat: Vec<DVec3> = points.iter().map(|p| p.with_y(0.0)).collect();
    let line: Vec<DVec3> = (0..50)
        .map(|i| DVec3::new(0.1 * f64::from(i), 0.3, -2.0))
        .collect();
    let one_place = vec![DVec3::new(0.3, 1.0, -2.0); 50];
    let on_top = vec![views[0].clone(); 7];
    let with_lost = [&views[..], &[lost]].concat();
    for (views, points) in [
        (&views, &flat),
        (&views, &line),
        (&views, &one_place),
        (&on_top, &points),
        (&views[..2].to_vec(), &points),
        (&views[..1].to_vec(), &points),
        (&with_lost, &points),
    ] {
        let tunnel = fit(views, points).unwrap();
        let corners = [tunnel.min, tunnel.max];
        assert!(corners.iter().all(|c| c.is_finite()), "{tunnel:?}");
        assert!((tunnel.max - tunnel.min).min_element() > 0.0, "{tunnel:?}");
        let inside = views.iter().filter(|v| v.center().is_finite());
        assert!(
            inside.clone().all(|v| tunnel.contains(v.center())),
            "{tunnel:?}"
        );
        assert!(tunnel.share_on_walls.is_finite());
        assert_eq!(fit(views, points), Ok(tunnel), "twice the same");
    }
    assert!(!fit(&on_top, &points).unwrap().is_hallway());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    /// Whatever the points and the cameras, the box is finite and its shares are shares.
    #[test]
    fn any_points_and_cameras_give_a_box_or_an_error(
        positions in prop::collection::vec(prop::array::uniform3(-4.0..4.0_f64), 0..60),
        centers in prop::collection::vec(prop::array::uniform3(-2.0..2.0_f64), 1..9),
        flat in 0..8_usize,
    ) {
        let keep = |p: [f64; 3]| {
            let flattened = DVec3::new(f64::from(flat & 1 == 0), f64::from(flat & 2 == 0), f64::from(flat & 4 == 0));
            DVec3::from(p) * flattened
        };
        let points: Vec<DVec3> = positions.into_iter().map(keep).collect();
        let view = View {
            lens: calibrate::Lens::pinhole(glam::DVec2::splat(100.0), glam::DVec2::splat(50.0)),
            width: 100,
            height: 100,
            camera_from_world: Rigid3::IDENTITY,
        };
        let views: Vec<View> = centers
            .into_iter()
            .map(|c| View {
                camera_from_world: Rigid3::looking_at(DVec3::from(c), DVec3::Z, DVec3::Y),
                ..view.clone()
            })
            .collect();
        if let Ok(tunnel) = fit(&views, &points) {
            prop_assert!(tunnel.min.is_finite() && tunnel.max.is_finite());
            prop_assert!((tunnel.max - tunnel.min).min_element() > 0.0, "{:?}", tunnel);
            prop_assert!((0.0..=1.0).contains(&tunnel.share_on_walls));
        }
    }
}
