use super::*;
use crate::{PlaneError, SparsePoint};
use calibrate::{Lens, Pixel, Rigid3, View};
use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;

fn view(center: DVec3, target: DVec3) -> View {
    View {
        lens: Lens::pinhole(DVec2::splat(100.0), DVec2::new(80.0, 60.0)),
        width: 160,
        height: 120,
        camera_from_world: Rigid3::looking_at(center, target, DVec3::NEG_Y),
    }
}

fn ahead(center: DVec3) -> View {
    view(center, center + DVec3::Z)
}

/// Numbers in [−1, 1) that are always the same.
fn noise(i: u32, k: u32) -> f64 {
    let mut h = (i * 7 + k).wrapping_mul(0x9e37_79b9) ^ 0x85eb_ca6b;
    h ^= h >> 16;
    h = h.wrapping_mul(0xc2b2_ae35);
    h ^= h >> 13;
    h = h.wrapping_mul(0x27d4_eb2f);
    f64::from(h ^ (h >> 15)) / 2_147_483_648.0 - 1.0
}

fn cloud(count: u32, size: f64) -> Vec<DVec3> {
    (0..count)
        .map(|i| size * DVec3::new(noise(i, 0), noise(i, 1), noise(i, 2)))
        .collect()
}

#[test]
fn focus_is_at_the_depth_of_the_points_near_the_pixel() {
    let view = ahead(DVec3::new(1.0, 2.0, 3.0));
    // The left half of the image at 4, the right half at 9, and one mismatch.
    let mut points = Vec::new();
    for i in 0..400 {
        let x = 80.0 * noise(i, 0);
        let depth = if x < 0.0 { 4.0 } else { 9.0 };
        let ray = DVec3::new(x / 100.0, 0.6 * noise(i, 1), 1.0);
        points.push(view.center() + depth * ray);
    }
    points.push(view.center() + 0.5 * DVec3::new(-0.4, 0.0, 1.0));
    for (x, depth) in [(40.0, 4.0), (120.0, 9.0)] {
        let plane = plane_focused_on(&view, Pixel::new(x, 60.0), &points).unwrap();
        assert!((plane.normal() - DVec3::Z).length() < 1e-12);
        assert!((plane.point().z - 3.0 - depth).abs() < 1e-9, "{plane:?}");
    }
}

#[test]
fn focus_needs_a_pixel_and_a_point() {
    let view = ahead(DVec3::ZERO);
    let outside = plane_focused_on(&view, Pixel::new(161.0, 3.0), &[DVec3::Z]).unwrap_err();
    assert!(matches!(outside, FocusError::Outside { width: 160, .. }));
    let nan = Pixel::new(f64::NAN, 3.0);
    assert!(plane_focused_on(&view, nan, &[DVec3::Z]).is_err());
    let pixel = Pixel::new(80.0, 60.0);
    for nothing in [DVec3::NEG_Z, DVec3::NAN, DVec3::INFINITY] {
        let error = plane_focused_on(&view, pixel, &[nothing]).unwrap_err();
        assert_eq!(error, FocusError::NoPoints { x: 80.0, y: 60.0 });
    }
    // One is enough, wherever it is in the image.
    let one = plane_focused_on(&view, pixel, &[DVec3::new(1.0, 1.0, 2.0)]).unwrap();
    assert_eq!(one.point().z, 2.0);
}

#[test]
fn the_dominant_plane_is_found_among_as_many_other_points() {
    let far = Rigid3::new(DQuat::from_rotation_x(1.1), DVec3::new(3e5, -5e6, 200.0));
    for (world, scale) in [
        (Rigid3::IDENTITY, 1.0),
        (far, 1.0),
        (Rigid3::IDENTITY, 1e-5),
    ] {
        let normal = DVec3::new(0.2, 0.9, -0.4).normalize();
        let (u, v) = normal.any_orthonormal_pair();
        let mut points = cloud(400, 3.0);
        for i in 0..300 {
            let slip = 0.002 * noise(i, 9);
            points.push(2.0 * normal + 2.0 * (noise(i, 7) * u + noise(i, 8) * v) + slip * normal);
        }
        points.push(DVec3::splat(1e9));
        points.push(DVec3::NAN);
        let points: Vec<DVec3> = points.iter().map(|p| world * (*p * scale)).collect();
        let found = dominant_plane(&points).unwrap();
        assert!((300..330).contains(&found.inliers), "{found:?}");
        let along = (world.rotation * normal).dot(found.plane.normal()).abs();
        assert!(along > 1.0 - 1e-6, "{found:?}");
        let distance = found.plane.signed_distance(world * (2.0 * scale * normal));
        assert!(distance.abs() < 1e-3 * scale + 1e-8, "{distance}");
        assert_eq!(dominant_plane(&points), Ok(found), "twice the same");
    }
}

#[test]
fn where_no_plane_prevails_there_is_none() {
    use DominantPlaneError::{Collinear, NonePrevails, TooFewPoints};
    assert_eq!(dominant_plane(&[]), Err(TooFewPoints { found: 0 }));
    assert_eq!(
        dominant_plane(&[DVec3::NAN; 9]),
        Err(TooFewPoints { found: 0 })
    );
    let line: Vec<DVec3> = (0..50).map(|i| DVec3::ONE * f64::from(i)).collect();
    assert_eq!(dominant_plane(&line), Err(Collinear));
    assert_eq!(dominant_plane(&[DVec3::ONE; 50]), Err(Collinear));
    let ball: Vec<DVec3> = cloud(3000, 1.0)
        .into_iter()
        .filter(|p| p.length() < 1.0)
        .collect();
    let error = dominant_plane(&ball).unwrap_err();
    assert!(matches!(error, NonePrevails { .. }), "{error:?}");
    // Five points on a plane are one.
    let five: Vec<DVec3> = cloud(5, 1.0).iter().map(|p| p.with_z(3.0)).collect();
    let found = dominant_plane(&five).unwrap();
    assert_eq!(found.inliers, 5);
    assert!(found.plane.normal().z.abs() > 1.0 - 1e-9);
}

fn seen(positions: impl IntoIterator<Item = DVec3>) -> Vec<SparsePoint> {
    positions
        .into_iter()
        .map(|position| SparsePoint {
            position,
            seen_by: vec![0, 1],
        })
        .collect()
}

fn sources() -> Vec<View> {
    vec![ahead(DVec3::X), ahead(DVec3::NEG_X)]
}

/// The inverse distance of a plane along a view's ray through a pixel.
fn inverse_distance(plane: &crate::Plane, view: &View, x: f64, y: f64) -> f64 {
    let ray = view.lens.unproject(Pixel::new(x, y)).unwrap().normalize();
    let q = plane.inverse_distance_from(view.center()).unwrap();
    q.dot(view.camera_from_world.rotation.conjugate() * ray)
}

#[test]
fn points_of_a_plane_give_that_plane_whatever_else_is_about() {
    let mut points: Vec<DVec3> = (0..300)
        .map(|i| {
            let (x, y) = (4.0 * noise(i, 0), 3.0 * noise(i, 1));
            DVec3::new(x, y, 5.0 + 0.3 * x - 0.2 * y)
        })
        .collect();
    points.extend((0..60).map(|i| DVec3::new(0.4 * noise(i, 4), 0.4 * noise(i, 5), 1.2)));
    points.extend([DVec3::splat(1e9), DVec3::NAN, DVec3::INFINITY, DVec3::ZERO]);
    let desired = ahead(DVec3::new(0.1, 0.2, -0.3));
    let plane = fit_plane_for_view(&desired, &sources(), &seen(points)).unwrap();
    for (x, y) in [(0.0, 0.0), (160.0, 0.0), (80.0, 60.0), (30.0, 120.0)] {
        let found = 1.0 / inverse_distance(&plane, &desired, x, y);
        let ray = desired
            .lens
            .unproject(Pixel::new(x, y))
            .unwrap()
            .normalize();
        let truth = crate::Plane::through([
            DVec3::new(0.0, 0.0, 5.0),
            DVec3::new(1.0, 0.0, 5.3),
            DVec3::new(0.0, 1.0, 4.8),
        ]);
        let hit = truth.unwrap().intersect(desired.center(), ray).unwrap();
        let expected = hit.distance(desired.center());
        assert!(
            (found / expected - 1.0).abs() < 0.04,
            "{x}, {y}: {found} {expected}"
        );
    }
}

#[test]
fn the_plane_of_a_view_moves_smoothly_with_it() {
    // A floor, a wall and rubbish, which come into the image and leave it.
    let mut points = cloud(200, 3.0);
    points.iter_mut().for_each(|p| p.z += 4.0);
    points.extend((0..400).map(|i| DVec3::new(5.0 * noise(i, 3), 1.0, 4.0 + 3.0 * noise(i, 4))));
    points.extend((0..400).map(|i| DVec3::new(5.0 * noise(i, 5), 2.0 * noise(i, 6), 7.0)));
    let points = seen(points);
    let at = |t: f64| {
        let center = DVec3::new(2.0 * t - 1.0, 0.2 * t, t - 0.5);
        view(center, DVec3::new(3.0 * t - 2.0, 0.3, 6.0))
    };
    let pixels = [(0.0, 0.0), (160.0, 0.0), (0.0, 120.0), (160.0, 120.0)];
    let corners = |t: f64| {
        let desired = at(t);
        let plane = fit_plane_for_view(&desired, &sources(), &points).unwrap();
        pixels.map(|(x, y)| inverse_distance(&plane, &desired, x, y))
    };
    let largest_step = |from: f64, to: f64, steps: u32| {
        let mut before = corners(from);
        let mut largest: f64 = 0.0;
        for i in 1..=steps {
            let now = corners(from + (to - from) * f64::from(i) / f64::from(steps));
            for (now, before) in now.iter().zip(before) {
                assert!(*now > 0.0, "every pixel sees the plane");
                largest = largest.max((now / before).ln().abs());
            }
            before = now;
        }
        largest
    };
    let coarse = largest_step(0.0, 1.0, 50);
    let fine = largest_step(0.0, 1.0, 500);
    println!("steps {coarse:.4}, ten times as fine {fine:.5}");
    assert!(coarse < 0.25, "{coarse}");
    // What jumps does not shrink with the step.
    assert!(fine < 0.2 * coarse, "{fine} {coarse}");
}

#[test]
fn few_points_still_give_a_plane_that_all_of_the_image_sees() {
    let desired = ahead(DVec3::ZERO);
    let none = |points: &[SparsePoint]| fit_plane_for_view(&desired, &sources(), points);
    assert_eq!(none(&[]), None);
    assert_eq!(none(&seen([DVec3::NEG_Z, DVec3::NAN, DVec3::ZERO])), None);
    let nobody = SparsePoint {
        position: DVec3::Z,
        seen_by: vec![7],
    };
    assert_eq!(none(&[nobody]), None);

    let one = none(&seen([DVec3::new(0.0, 0.0, 4.0)])).unwrap();
    assert!((one.normal().z.abs() - 1.0).abs() < 1e-9, "{one:?}");
    assert!((one.point().z - 4.0).abs() < 1e-6, "{one:?}");
    // Outside the image there is nothing else to go by.
    let aside = none(&seen([DVec3::new(9.0, 0.0, 4.0)])).unwrap();
    assert!(
        (aside.signed_distance(DVec3::ZERO).abs() - 4.0).abs() < 0.5,
        "{aside:?}"
    );
    let few = [
        vec![DVec3::new(0.1, 0.0, 2.0), DVec3::new(-0.3, 0.1, 3.0)],
        (0..5)
            .map(|i| DVec3::new(0.2 * f64::from(i) - 0.4, 0.0, 3.0 + 0.4 * f64::from(i)))
            .collect(),
        cloud(5, 1.0).iter().map(|p| *p + 2.0 * DVec3::Z).collect(),
        // A floor: its horizon would cross the image.
        (0..90)
            .map(|i| DVec3::new(3.0 * noise(i, 0), 1.0, 5.0 + 4.0 * noise(i, 1)))
            .collect(),
    ];
    for points in few {
        let plane = none(&seen(points)).unwrap();
        for (x, y) in [(0.0, 0.0), (160.0, 0.0), (0.0, 120.0), (160.0, 120.0)] {
            let s = inverse_distance(&plane, &desired, x, y);
            assert!(s > 0.0 && s.is_finite(), "{plane:?}");
        }
    }
    // Poses that are no poses.
    let lost = View {
        camera_from_world: Rigid3 {
            rotation: DQuat::IDENTITY,
            translation: DVec3::NAN,
        },
        ..desired.clone()
    };
    assert_eq!(
        fit_plane_for_view(&lost, &sources(), &seen([DVec3::Z])),
        None
    );
    assert!(matches!(
        plane_focused_on(&lost, Pixel::new(1.0, 1.0), &[DVec3::Z]),
        Err(FocusError::NoPoints { .. } | FocusError::Plane(PlaneError::NotFinite(..)))
    ));
}

/// Of these captures a facade and a sheet of squares are planes.
#[test]
fn a_facade_and_a_chessboard_have_a_dominant_plane() {
    for (name, least_share) in [("sceaux-castle", 0.2), ("opencv-chessboard", 0.9)] {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/captures");
        let model = std::path::Path::new(folder).join(name).join("sparse/0");
        if !model.is_dir() {
            eprintln!("SKIPPED: {} is absent", model.display());
            continue;
        }
        let whole = calibrate::colmap::read_model(&model).unwrap();
        let points: Vec<DVec3> = whole.points.values().map(|p| p.position).collect();
        let found = dominant_plane(&points).unwrap();
        println!("{name}: {found:?}");
        let share = found.inliers as f64 / found.points as f64;
        assert!(share > least_share, "{name}: {found:?}");
    }
}

proptest! {
    /// Whatever the points and wherever the view, all of its image sees its plane.
    #[test]
    fn any_points_in_front_give_a_plane_in_front(
        positions in prop::collection::vec(prop::array::uniform3(-4.0..4.0_f64), 1..40),
        size in -6..6_i32,
    ) {
        let positions: Vec<DVec3> = positions.into_iter().map(DVec3::from).collect();
        let scale = 10.0_f64.powi(size);
        let desired = ahead(DVec3::NEG_Z * scale);
        let points = seen(positions.iter().map(|p| *p * scale));
        let in_front = positions.iter().any(|p| p.z > -1.0);
        let plane = fit_plane_for_view(&desired, &sources(), &points);
        prop_assert_eq!(plane.is_some(), in_front);
        if let Some(plane) = plane {
            for (x, y) in [(0.0, 0.0), (160.0, 0.0), (0.0, 120.0), (160.0, 120.0)] {
                let s = inverse_distance(&plane, &desired, x, y);
                prop_assert!(s > 0.0 && s.is_finite(), "{:?} {}", plane, s);
            }
        }
        // Neither panics.
        let world: Vec<DVec3> = positions.iter().map(|p| *p * scale).collect();
        if let Ok(found) = dominant_plane(&world) {
            prop_assert!(found.inliers <= found.points && found.tolerance.is_finite());
        }
        let _ = plane_focused_on(&desired, Pixel::new(80.0, 60.0), &world);
    }
}
