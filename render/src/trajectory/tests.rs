//! Paths of captures of usual shapes.

mod aimed;
mod strays;

use super::*;
use calibrate::Lens;
use glam::{DQuat, DVec2};
use proxy::Plane;

const ALL: [Trajectory; 3] = [Trajectory::Orbit, Trajectory::Dolly, Trajectory::Sweep];

struct Scene {
    sources: Vec<SourceView>,
    points: Vec<DVec3>,
    proxy: Proxy,
}

fn source(i: usize, camera_from_world: Rigid3) -> SourceView {
    SourceView {
        name: format!("{i}.jpg"),
        view: View {
            lens: Lens::pinhole(DVec2::splat(500.0), DVec2::new(310.0, 245.0)),
            width: 640,
            height: 480,
            camera_from_world,
        },
        gain: [1.0; 3],
        time_s: None,
        quarters: 0,
    }
}

fn scene(poses: Vec<Rigid3>, points: Vec<DVec3>, wall: DVec3) -> Scene {
    let sources = poses.into_iter().enumerate();
    Scene {
        sources: sources.map(|(i, pose)| source(i, pose)).collect(),
        points,
        proxy: Proxy::Plane(Plane::new(wall, DVec3::Z).unwrap()),
    }
}

/// 7 × 5 cameras a unit apart that look along z; the scene 12 units ahead.
fn grid() -> Scene {
    let poses = (0..35).map(|i| {
        let center = DVec3::new(f64::from(i % 7), f64::from(i / 7), 0.1 * f64::from(i % 3));
        Rigid3::looking_at(center, center + 8.0 * DVec3::Z, DVec3::NEG_Y)
    });
    let points = (0..50).map(|i| DVec3::new(f64::from(i % 9) - 1.0, f64::from(i % 5), 12.0));
    scene(poses.collect(), points.collect(), DVec3::Z * 12.0)
}

/// Cameras all around a place, 10° apart, up and down a little.
fn ring(degrees: i32) -> Scene {
    let poses = (0..degrees / 10).map(|i| {
        let a = f64::from(i) * PI / 18.0;
        let center = DVec3::new(5.0 * a.cos(), -1.0 + 0.2 * (2.0 * a).sin(), 4.0 * a.sin());
        Rigid3::looking_at(center, DVec3::ZERO, DVec3::NEG_Y)
    });
    scene(poses.collect(), vec![DVec3::ZERO; 9], DVec3::ZERO)
}

/// Cameras around the origin, 4 units off, so many degrees above its level, evenly over a part of a turn.
fn ring_above(count: u32, elevation: f64, degrees: f64) -> Scene {
    let elevation = elevation.to_radians();
    let poses = (0..count).map(|i| {
        let azimuth = (degrees * f64::from(i) / f64::from(count)).to_radians();
        let level = DVec3::new(azimuth.cos(), 0.0, azimuth.sin());
        let center = 4.0 * (level * elevation.cos() + DVec3::NEG_Y * elevation.sin());
        Rigid3::looking_at(center, DVec3::ZERO, DVec3::NEG_Y)
    });
    scene(poses.collect(), vec![DVec3::ZERO; 9], DVec3::ZERO)
}

/// How far two photos that follow one another are apart.
fn step(s: &Scene) -> f64 {
    let [first, second] = [0, 1].map(|i| s.sources[i].view.center());
    first.distance(second)
}

/// Forwards along a gentle curve.
fn walk() -> Scene {
    let place = |i: i32| DVec3::new((0.1 * f64::from(i)).sin(), 0.0, 0.5 * f64::from(i));
    let poses = (0..40).map(|i| Rigid3::looking_at(place(i), place(i + 1), DVec3::NEG_Y));
    scene(poses.collect(), Vec::new(), DVec3::Z * 40.0)
}

fn path(kind: Trajectory, s: &Scene) -> CameraPath {
    derive(kind, &s.sources, &s.points, &s.proxy, 120, 30.0).unwrap()
}

fn centers(path: &CameraPath) -> Vec<DVec3> {
    path.frames.iter().map(|f| f.view.center()).collect()
}

fn farthest_from_sources(path: &CameraPath, s: &Scene) -> f64 {
    let nearest = |c: &DVec3| {
        let distances = s.sources.iter().map(|s| s.view.center().distance(*c));
        distances.fold(f64::INFINITY, f64::min)
    };
    centers(path).iter().map(nearest).fold(0.0, f64::max)
}

fn angle_off(frame: &PathFrame, target: DVec3) -> f64 {
    frame
        .view
        .forward()
        .angle_between(target - frame.view.center())
}

/// The poses of two paths are the same but for rounding.
#[track_caller]
fn assert_same_poses(found: &CameraPath, expected: &CameraPath, what: &str) {
    assert_eq!(found.frames.len(), expected.frames.len(), "{what}");
    for (a, b) in found.frames.iter().zip(&expected.frames) {
        let off = a.view.center().distance(b.view.center());
        assert!(off < 1e-6, "{what}: {off}");
        let (a, b) = (a.view.camera_from_world, b.view.camera_from_world);
        let turn = a.rotation.dot(b.rotation).abs();
        assert!((turn - 1.0).abs() < 1e-9, "{what}: {turn}");
    }
}

#[test]
fn steps_are_even_and_paths_closed() {
    for s in [grid(), ring(360), ring(200), walk()] {
        for kind in ALL {
            let path = path(kind, &s);
            assert_eq!(path.frames.len(), 120);
            let c = centers(&path);
            let steps: Vec<f64> = (0..120).map(|i| c[i].distance(c[(i + 1) % 120])).collect();
            let most = steps.iter().copied().fold(0.0, f64::max);
            let middle = capture::median(steps).unwrap();
            assert!(
                middle > 0.0 && most <= 3.0 * middle,
                "{kind:?}: {most} {middle}"
            );
            let turn = |i: usize| {
                let q = |i: usize| path.frames[i % 120].view.camera_from_world.rotation;
                q(i).angle_between(q(i + 1))
            };
            let most = (0..120).map(turn).fold(0.0, f64::max);
            assert!(most < 0.2, "{kind:?}: turns by {most}");
        }
    }
}

#[test]
fn no_two_frames_show_the_same_and_two_are_the_ends() {
    for s in [grid(), ring(360), ring(200), walk()] {
        for kind in ALL {
            for count in [2, 3, 4, 7, 30] {
                let path = derive(kind, &s.sources, &s.points, &s.proxy, count, 30.0).unwrap();
                let places = centers(&path);
                for (i, place) in places.iter().enumerate() {
                    let apart = places[..i].iter().map(|other| other.distance(*place));
                    let nearest = apart.fold(f64::INFINITY, f64::min);
                    assert!(nearest > 1e-3, "{kind:?}, {count}: {nearest} at {i}");
                }
            }
        }
    }
    let s = grid();
    for kind in [Trajectory::Dolly, Trajectory::Sweep] {
        let two = derive(kind, &s.sources, &s.points, &s.proxy, 2, 30.0).unwrap();
        let [from, to] = [0, 1].map(|i| centers(&two)[i]);
        let all = centers(&path(kind, &s));
        let far = |a: &DVec3| all.iter().map(|b| a.distance(*b)).fold(0.0, f64::max);
        let widest = all.iter().map(far).fold(0.0, f64::max);
        assert!(from.distance(to) > 0.99 * widest, "{kind:?}: {from} {to}");
    }
}

#[test]
fn paths_stay_near_the_cameras() {
    for (name, s, spacing) in [
        ("grid", grid(), 1.0),
        ("ring", ring(360), 0.9),
        ("arc", ring(200), 0.9),
        ("walk", walk(), 0.8),
    ] {
        for kind in ALL {
            let far = farthest_from_sources(&path(kind, &s), &s);
            // A dolly leaves the cameras' surface, by half their extent at most.
            let walked = name == "walk";
            let limit = if kind == Trajectory::Dolly && !walked {
                2.6
            } else {
                spacing
            };
            assert!(far <= limit, "{kind:?} of {name}: {far}");
        }
    }
}

#[test]
fn an_orbit_looks_at_the_focus_and_goes_all_around() {
    let s = ring(360);
    let around = path(Trajectory::Orbit, &s);
    // The cameras aim at the origin.
    for frame in &around.frames {
        assert!(angle_off(frame, DVec3::ZERO) < 1e-6);
        assert!(frame.view.up().y < -0.9);
    }
    let sum = centers(&around).iter().sum::<DVec3>() / 120.0;
    assert!(DVec3::new(sum.x, 0.0, sum.z).length() < 0.5, "{sum}");

    // Of an arc it keeps to the part that was taken: y is up and down, z ≥ 0 but for 10°.
    let half = path(Trajectory::Orbit, &ring(200));
    assert!(centers(&half).iter().all(|c| c.z > -0.2));

    let small = path(Trajectory::Orbit, &grid());
    let focus = DVec3::new(3.0, 2.0, 12.0);
    for frame in &small.frames {
        assert!(angle_off(frame, focus) < 0.02);
    }
    let widest = centers(&small)
        .iter()
        .map(|c| (c.x - 3.0).abs())
        .fold(0.0, f64::max);
    assert!(widest > 1.0 && widest < 1.9, "{widest}");
}

/// Photos that look down on it steeply are less than 120° apart, seen from it.
#[test]
fn an_orbit_goes_around_what_photos_look_down_on() {
    // The widest gap between azimuths.
    let widest = |path: &CameraPath| {
        let mut azimuths: Vec<f64> = centers(path).iter().map(|c| c.z.atan2(c.x)).collect();
        azimuths.sort_by(f64::total_cmp);
        let around = azimuths[0] + TAU - azimuths[119];
        let between = azimuths.windows(2).map(|pair| pair[1] - pair[0]);
        between.fold(around, f64::max)
    };
    for elevation in [0.0, 29.0, 31.0, 45.0, 60.0, 72.0] {
        for count in [8, 16, 36] {
            let s = ring_above(count, elevation, 360.0);
            let around = path(Trajectory::Orbit, &s);
            let gap = widest(&around);
            assert!(gap < 0.06, "{elevation} {count}: {gap}");
            let far = farthest_from_sources(&around, &s) / step(&s);
            assert!(far < 0.53, "{elevation} {count}: {far}");
        }
        // Of an arc it keeps to what was taken.
        let s = ring_above(20, elevation, 200.0);
        let arc = path(Trajectory::Orbit, &s);
        let taken = TAU - widest(&arc);
        assert!(taken > 2.4 && taken < 2.9, "{elevation}: {taken}");
        let far = farthest_from_sources(&arc, &s) / step(&s);
        assert!(far < 0.7, "{elevation}: {far}");
    }
    // Less of it is looked at from one side.
    for elevation in [0.0, 45.0, 60.0] {
        let small = path(Trajectory::Orbit, &ring_above(12, elevation, 110.0));
        assert!(TAU - widest(&small) < 1.0, "{elevation}");
    }
}

/// The photo in the middle leans towards what it looks down on, and those beside it would lean to a side.
#[test]
fn a_small_orbit_is_as_level_as_its_photos() {
    let leans_by = |s: &Scene| {
        let lean = |frame: &PathFrame| {
            let right = frame.view.camera_from_world.rotation.conjugate() * DVec3::X;
            right.y.abs().asin().to_degrees()
        };
        let frames = path(Trajectory::Orbit, s).frames;
        frames.iter().map(lean).fold(0.0, f64::max)
    };
    for down in [0.0_f64, 15.0, 45.0, 63.0] {
        // From a circle outwards.
        let (below, ahead) = down.to_radians().sin_cos();
        let looks = (0..24).map(|i| {
            let (sin, cos) = (TAU * f64::from(i) / 24.0).sin_cos();
            let center = DVec3::new(cos, 0.0, sin);
            (center, center + 4.0 * (center * ahead + DVec3::Y * below))
        });
        let pose = |(center, target)| Rigid3::looking_at(center, target, DVec3::NEG_Y);
        let targets = looks.clone().map(|(_, target)| target).collect();
        let outwards = scene(looks.map(pose).collect(), targets, DVec3::Z * 12.0);
        let lean = leans_by(&outwards);
        assert!(lean < 0.1, "{down}: {lean}");
        // Of photos that look much the same way what is level in them tells less. It was up to 10°.
        let lean = leans_by(&ring_above(11, down, 110.0));
        assert!(lean < 1.5, "{down}: {lean}");
    }
}

#[test]
fn a_sweep_covers_the_longest_direction() {
    let xs: Vec<f64> = centers(&path(Trajectory::Sweep, &grid()))
        .iter()
        .map(|c| c.x)
        .collect();
    assert!(
        (xs[0] - 0.6).abs() < 0.1 && (xs[60] - 5.4).abs() < 0.1,
        "{xs:?}"
    );
    let walked = centers(&path(Trajectory::Sweep, &walk()));
    assert!((walked[60].distance(walked[0]) - 0.8 * 19.5).abs() < 1.0);
}

/// The means of few photos around something lie within it.
#[test]
fn a_sweep_of_few_photos_around_something_stays_among_them() {
    for elevation in [0.0, 25.0, 45.0, 60.0] {
        for (count, degrees) in [
            (8, 360.0),
            (12, 360.0),
            (16, 360.0),
            (24, 360.0),
            (36, 360.0),
            (6, 200.0),
            (12, 200.0),
        ] {
            let s = ring_above(count, elevation, degrees);
            let along = path(Trajectory::Sweep, &s);
            let what = format!("{elevation} {count} {degrees}");
            let far = farthest_from_sources(&along, &s) / step(&s);
            assert!(far < 0.75, "{what}: {far}");
            // Half the view's width is 0.57.
            let off = along.frames.iter().map(|f| angle_off(f, DVec3::ZERO));
            let off = off.fold(0.0, f64::max);
            assert!(off < 0.15, "{what}: {off}");
            // It goes far along them, to their right.
            let places = centers(&along);
            let [from, to] = [places[0], places[60]];
            let wide = from.distance(to) / (4.0 * elevation.to_radians().cos());
            assert!(wide > 1.5, "{what}: {wide}");
            let right = along.frames[30].view.camera_from_world.rotation.conjugate() * DVec3::X;
            assert!(right.dot(to - from) > 0.0, "{what}");
        }
    }
}

/// 4.6° wide: neighbours are turned by more.
#[test]
fn a_sweep_of_long_lenses_looks_where_its_photos_do() {
    for count in [5, 7, 15] {
        for (aim, is_shared) in [(DVec3::ZERO, true), (DVec3::NEG_Z, false)] {
            let target = |center: DVec3| if is_shared { aim } else { center + aim };
            let poses = (0..count).map(|i| {
                let center = DVec3::new(
                    60.0 * f64::from(i) / f64::from(count - 1) - 30.0,
                    0.0,
                    100.0,
                );
                Rigid3::looking_at(center, target(center), DVec3::NEG_Y)
            });
            let mut s = scene(poses.collect(), Vec::new(), DVec3::ZERO);
            for source in &mut s.sources {
                source.view.lens = Lens::pinhole(DVec2::splat(8000.0), DVec2::new(320.0, 240.0));
            }
            let path = path(Trajectory::Sweep, &s);
            let off = |frame: &PathFrame| angle_off(frame, target(frame.view.center()));
            // A tenth of the view.
            let most = path.frames.iter().map(off).fold(0.0, f64::max);
            assert!(most < 0.008, "{count} {is_shared}: {most}");
            let places = centers(&path);
            assert!((places[0].x.abs() - 24.0).abs() < 1e-6, "{}", places[0]);
        }
    }
}

#[test]
fn a_dolly_keeps_its_distance_from_the_scene() {
    let mut s = grid();
    s.points.clear();
    s.proxy = Proxy::Plane(Plane::new(DVec3::new(0.0, 0.0, 2.0), DVec3::Z).unwrap());
    let c = centers(&path(Trajectory::Dolly, &s));
    let reach = c.iter().map(|c| c.z).fold(0.0, f64::max);
    assert!(reach > 0.4 && reach < 0.71, "{reach}");
}

#[test]
fn degenerate_captures_have_finite_paths() {
    let turned = |angle: f64| Rigid3::new(DQuat::from_rotation_y(angle), DVec3::ZERO);
    let far = DVec3::new(5e5, 5.4e6, 100.0);
    let looking = |c: DVec3, t: DVec3| Rigid3::looking_at(c, t, DVec3::NEG_Y);
    let captures = [
        vec![turned(0.3)],
        vec![turned(0.0); 5],
        (0..12).map(|i| turned(f64::from(i) * PI / 6.0)).collect(),
        vec![looking(far, far + DVec3::Z); 3],
        vec![turned(0.0), looking(DVec3::X, DVec3::new(1.0, 0.0, 1.0))],
        vec![
            looking(DVec3::X, DVec3::ZERO),
            looking(-DVec3::X, DVec3::ZERO),
        ],
        (0..9)
            .map(|i| looking(DVec3::Z * f64::from(i), DVec3::Z * 20.0))
            .collect(),
        (0..9)
            .map(|i| looking(DVec3::Y * f64::from(i), DVec3::Y * 20.0))
            .collect(),
    ];
    for poses in captures {
        // The last wall is seen edge on.
        for wall in [DVec3::Z * 5.0, DVec3::NEG_Z * 5.0, DVec3::ZERO] {
            let s = scene(poses.clone(), Vec::new(), wall);
            for kind in ALL {
                let path = path(kind, &s);
                let finite = |f: &PathFrame| f.view.camera_from_world.is_finite();
                assert!(path.frames.iter().all(finite));
                let far = farthest_from_sources(&path, &s);
                assert!(far <= 2.5, "{kind:?}: {far}");
            }
        }
    }
}

#[test]
fn moving_the_world_moves_the_path() {
    let old_from_new = Rigid3::new(
        DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 2.0),
        DVec3::new(-30.0, 200.0, 7.0),
    );
    for s in [grid(), ring(360), ring(200), walk()] {
        let new = |p: DVec3| old_from_new.inverse() * p;
        let mut moved = scene(
            Vec::new(),
            s.points.iter().copied().map(new).collect(),
            DVec3::ZERO,
        );
        let plane = s.proxy.plane().unwrap();
        let normal = old_from_new.inverse().rotation * plane.normal();
        moved.proxy = Proxy::Plane(Plane::new(new(plane.point()), normal).unwrap());
        for (i, old) in s.sources.iter().enumerate() {
            moved
                .sources
                .push(source(i, old.view.camera_from_world * old_from_new));
        }
        for kind in ALL {
            for (a, b) in path(kind, &s).frames.iter().zip(&path(kind, &moved).frames) {
                let back = b.view.camera_from_world * old_from_new.inverse();
                assert!(back.center().distance(a.view.center()) < 1e-6, "{kind:?}");
                let turn = back.rotation.dot(a.view.camera_from_world.rotation).abs();
                assert!((turn - 1.0).abs() < 1e-9, "{kind:?}");
            }
        }
    }
}

#[test]
fn the_camera_is_typical() {
    let mut s = grid();
    s.sources[0].view.width = 6400;
    s.sources[1].view.lens.focal = DVec2::splat(9.0);
    let path = path(Trajectory::Sweep, &s);
    let camera = &path.frames[7].camera;
    assert_eq!((camera.width, camera.height), (640, 480));
    assert_eq!(camera.params, [500.0, 500.0, 320.0, 240.0]);
    assert_eq!(path.frames[7].name, "frame_0007");
}

#[test]
fn what_has_no_path_is_an_error() {
    let s = grid();
    let go = |sources: &[SourceView], frames| {
        let path = derive(Trajectory::Orbit, sources, &[], &s.proxy, frames, 30.0);
        path.unwrap_err().to_string()
    };
    assert_eq!(go(&[], 5), "the capture has no source views");
    assert_eq!(go(&s.sources, 0), "the path has no frames");
    let mut bad = s.sources.clone();
    bad[3].view.camera_from_world.translation.x = f64::NAN;
    assert_eq!(go(&bad, 5), "the pose of 3.jpg is not finite");
}
