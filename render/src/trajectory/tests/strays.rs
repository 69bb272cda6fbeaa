//! Photos that are rolled, misplaced, shifted or of one place change no path that others make.

use super::*;
use glam::{DQuat, DVec2};

#[test]
fn paths_of_one_place_stand_still() {
    for apart in [0.0, 1e-9] {
        let poses = (0..9).map(|i| {
            let center = DVec3::X * (apart * f64::from(i));
            let ahead = DQuat::from_rotation_y(0.2 * f64::from(i - 4)) * DVec3::Z;
            Rigid3::looking_at(center, center + ahead, DVec3::NEG_Y)
        });
        let s = scene(poses.collect(), Vec::new(), DVec3::Z * 9.0);
        for kind in ALL {
            let frames = path(kind, &s).frames;
            let pose = frames[0].view.camera_from_world;
            let is_there = |f: &PathFrame| f.view.camera_from_world == pose;
            assert!(frames.iter().all(is_there), "{kind:?}: {apart}");
        }
    }
}

/// As cameras of a rig, and exposures of one motif.
#[test]
fn photos_of_one_place_count_as_one_place() {
    let one = grid();
    let rotation = |i: usize| DQuat::from_rotation_y(0.3 * (i % 4) as f64);
    let many = (0..4 * one.sources.len()).map(|i| {
        let pose = one.sources[i / 4].view.camera_from_world;
        source(i, Rigid3::new(rotation(i), DVec3::ZERO) * pose)
    });
    let many = Scene {
        sources: many.collect(),
        ..grid()
    };
    let wide = |s: &Scene| {
        let centers = centers(&path(Trajectory::Orbit, s));
        let off = centers.iter().map(|c| c.distance(centers[0]));
        off.fold(0.0, f64::max)
    };
    let (one, many) = (wide(&one), wide(&many));
    assert!(one > 1.0 && many > 0.7 * one, "{one} {many}");
    // All of them at one place, or at two.
    for apart in [0.0, 1.0] {
        let poses = (0..8).map(|i| {
            let side = f64::from(i % 2) * 2.0 - 1.0;
            let center = DVec3::X * apart * side;
            Rigid3::looking_at(center, center + DVec3::Z, DVec3::NEG_Y)
        });
        let few = scene(poses.collect(), Vec::new(), DVec3::Z * 12.0);
        for kind in ALL {
            let path = derive(kind, &few.sources, &[], &few.proxy, 10, 30.0);
            assert!(path.is_ok(), "{kind:?} {apart}: {path:?}");
        }
    }
}

/// A photo taken with the camera turned by so many quarters: of the same place, and as sharp.
fn rolled(source: &SourceView, quarters: u8) -> SourceView {
    let mut rolled = source.clone();
    for _ in 0..quarters {
        let view = &mut rolled.view;
        let turn = Rigid3::new(DQuat::from_rotation_z(PI / 2.0), DVec3::ZERO);
        view.camera_from_world = turn * view.camera_from_world;
        let principal = view.lens.principal;
        view.lens.principal = DVec2::new(f64::from(view.height) - principal.y, principal.x);
        (view.width, view.height) = (view.height, view.width);
    }
    rolled
}

#[test]
fn few_photos_that_are_rolled_change_no_path() {
    let eight = || {
        let poses = (0..8).map(|i| {
            let center = DVec3::new(f64::from(i), 0.2 * f64::from(i % 3), 0.0);
            Rigid3::looking_at(center, center + 8.0 * DVec3::Z, DVec3::NEG_Y)
        });
        let points = (0..50).map(|i| DVec3::new(f64::from(i % 9) - 1.0, f64::from(i % 5), 12.0));
        scene(poses.collect(), points.collect(), DVec3::Z * 12.0)
    };
    let mut cases: Vec<(Scene, Vec<usize>)> = (0..8).map(|i| (eight(), vec![i])).collect();
    for made in [ring(140), ring(360), grid()] {
        let half = (1..made.sources.len()).step_by(2).collect();
        cases.push((made, half));
    }
    for made in [ring(140), ring(360), walk(), grid()] {
        cases.push((made, vec![0, 3, 5]));
    }
    for (case, (straight, which)) in cases.iter().enumerate() {
        let quarters = [1, 2, 3][case % 3];
        let mixed = straight.sources.iter().enumerate().map(|(i, source)| {
            let turn = if which.contains(&i) { quarters } else { 0 };
            rolled(source, turn)
        });
        let mixed = Scene {
            sources: mixed.collect(),
            points: straight.points.clone(),
            proxy: straight.proxy.clone(),
        };
        for kind in ALL {
            let what = format!("{kind:?}, {case}, {quarters}");
            let (expected, found) = (path(kind, straight), path(kind, &mixed));
            assert_same_poses(&found, &expected, &what);
            for (a, b) in expected.frames.iter().zip(&found.frames) {
                assert_eq!(a.camera, b.camera, "{what}");
            }
        }
    }
}

#[test]
fn photos_that_are_all_rolled_have_paths_that_are() {
    let mut all = grid();
    all.sources = all.sources.iter().map(|s| rolled(s, 1)).collect();
    for kind in ALL {
        for frame in &path(kind, &all).frames {
            let up = all.sources[0].view.up();
            assert!(frame.view.up().dot(up) > 0.95, "{kind:?}");
            assert_eq!((frame.camera.width, frame.camera.height), (480, 640));
        }
    }
}

/// They go around what photos go around, not over it, and lie as the photos do.
#[test]
fn paths_around_something_lie_where_all_photos_do() {
    for straight in [ring(140), ring(360)] {
        for quarters in [1, 3] {
            let lying = Scene {
                // A few the other way, as of a camera that an arm carries over the top.
                sources: (0..)
                    .zip(&straight.sources)
                    .map(|(i, source)| match i % 3 {
                        1 => rolled(source, 4 - quarters),
                        _ => rolled(source, quarters),
                    })
                    .collect(),
                points: straight.points.clone(),
                proxy: straight.proxy.clone(),
            };
            let turn = DQuat::from_rotation_z(PI / 2.0 * f64::from(quarters));
            for kind in ALL {
                let what = format!("{kind:?}, {quarters}");
                let (mut expected, found) = (path(kind, &straight), path(kind, &lying));
                for frame in &mut expected.frames {
                    let pose = &mut frame.view.camera_from_world;
                    *pose = Rigid3::new(turn, DVec3::ZERO) * *pose;
                }
                assert_same_poses(&found, &expected, &what);
                for frame in &found.frames {
                    assert_eq!((frame.camera.width, frame.camera.height), (480, 640));
                }
            }
        }
    }
}

/// Moves a camera that stays turned as it is.
fn moved(source: &SourceView, by: DVec3) -> SourceView {
    let mut moved = source.clone();
    let pose = &mut moved.view.camera_from_world;
    *pose = Rigid3::new(
        pose.rotation,
        -(pose.rotation * (source.view.center() + by)),
    );
    moved
}

#[test]
fn cameras_that_are_misplaced_by_far_change_no_path() {
    let captures: [fn() -> Scene; 4] = [grid, || ring(360), || ring(200), walk];
    for made in captures {
        for which in [vec![4], vec![0, 7, 9]] {
            for by in [300.0, 5e6] {
                let (mut without, mut with) = (made(), made());
                for &i in which.iter().rev() {
                    without.sources.remove(i);
                    let by = DVec3::new(0.8, 0.1 * i as f64, -0.6) * by;
                    with.sources[i] = moved(&with.sources[i], by);
                }
                for kind in ALL {
                    let what = format!("{kind:?}, {which:?}, {by}");
                    assert_same_poses(&path(kind, &with), &path(kind, &without), &what);
                }
            }
        }
    }
}

/// Most photos of one place, and a few of another: those are no strays.
#[test]
fn photos_beside_a_tripod_count() {
    let poses = (0..12).map(|i| {
        let aside = if i < 10 { 1e-5 * f64::from(i) } else { 2.0 };
        Rigid3::looking_at(DVec3::X * aside, DVec3::Z * 12.0, DVec3::NEG_Y)
    });
    let s = scene(poses.collect(), Vec::new(), DVec3::Z * 12.0);
    let places = centers(&path(Trajectory::Sweep, &s));
    let most = places.iter().map(|c| c.x).fold(0.0, f64::max);
    assert!(most > 1.5, "{most}");
}

/// A photo that shows much the same through a part of the lens aside of its axis: that is turned away by as much.
fn shifted(source: &SourceView, ray: DVec3) -> SourceView {
    let mut shifted = source.clone();
    let view = &mut shifted.view;
    let middle = DVec2::new(f64::from(view.width), f64::from(view.height)) * 0.5;
    view.lens.principal = middle - view.lens.focal * ray.truncate() / ray.z;
    let turn = DQuat::from_rotation_arc(DVec3::Z, ray.normalize());
    view.camera_from_world = Rigid3::new(turn, DVec3::ZERO) * view.camera_from_world;
    shifted
}

#[test]
fn photos_with_principal_points_off_the_middle_have_the_same_paths() {
    for ray in [
        DVec3::new(0.3, -0.2, 1.0),
        DVec3::new(0.6, 0.0, 1.0),
        DVec3::new(0.0, -0.4, 1.0),
    ] {
        for made in [grid(), walk()] {
            let off = made.sources.iter().enumerate().map(|(i, source)| {
                let quarters = u8::from([0, 3, 5].contains(&i));
                rolled(&shifted(source, ray), quarters)
            });
            let off = Scene {
                sources: off.collect(),
                points: made.points.clone(),
                proxy: made.proxy.clone(),
            };
            for kind in ALL {
                let what = format!("{kind:?}, {ray}");
                let (expected, found) = (path(kind, &made), path(kind, &off));
                assert_same_poses(&found, &expected, &what);
                let camera = &found.frames[0].camera;
                assert_eq!((camera.width, camera.height), (640, 480), "{what}");
                assert_eq!(camera.params[2..], [320.0, 240.0], "{what}");
                let focal = 500.0 * ray.length().powf(1.5);
                assert!((camera.params[0] - focal).abs() < 1e-6, "{what}");
            }
        }
        let mut around = ring(360);
        around.sources = around.sources.iter().map(|s| shifted(s, ray)).collect();
        for frame in &path(Trajectory::Orbit, &around).frames {
            assert!(angle_off(frame, DVec3::ZERO) < 1e-6, "{ray}");
        }
    }
}
