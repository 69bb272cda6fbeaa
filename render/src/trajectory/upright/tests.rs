use super::*;
use calibrate::{Lens, Rigid3};
use glam::DVec2;
use std::f64::consts::TAU;

fn view(camera_from_world: Rigid3) -> View {
    View {
        lens: Lens::pinhole(DVec2::splat(50.0), DVec2::new(32.0, 24.0)),
        width: 64,
        height: 48,
        camera_from_world,
    }
}

/// Side by side.
fn row(count: usize) -> Vec<View> {
    let pose = |i: usize| {
        let center = DVec3::X * i as f64;
        Rigid3::looking_at(center, center + DVec3::Z, DVec3::NEG_Y)
    };
    (0..count).map(|i| view(pose(i))).collect()
}

/// Around the origin, so many radians above the level of y = 0, over a part of a turn.
fn ring(count: usize, elevation: f64, turn: f64) -> Vec<View> {
    let pose = |i: usize| {
        let azimuth = turn * i as f64 / count as f64;
        let level = DVec3::new(azimuth.cos(), 0.0, azimuth.sin());
        let center = 4.0 * (level * elevation.cos() + DVec3::NEG_Y * elevation.sin());
        Rigid3::looking_at(center, DVec3::ZERO, DVec3::NEG_Y)
    };
    (0..count).map(|i| view(pose(i))).collect()
}

/// Of photos whose cameras say nothing.
fn stand(views: &[View]) -> Standing {
    upright(&views.iter().map(|view| (view, 0)).collect::<Vec<_>>())
}

fn all(views: &[View]) -> Vec<Upright> {
    stand(views).photos
}

fn roll(views: &mut [View], which: impl IntoIterator<Item = usize>, quarters: u8) {
    for i in which {
        let pose = &mut views[i].camera_from_world;
        let turn = DQuat::from_rotation_z(f64::from(quarters) * FRAC_PI_2);
        *pose = Rigid3::new(turn, DVec3::ZERO) * *pose;
    }
}

/// As the photos are.
fn unturned(views: &[View]) -> Vec<Upright> {
    let as_it_is = |view: &View| Upright {
        rotation: view.camera_from_world.rotation,
        sides_exchanged: false,
    };
    views.iter().map(as_it_is).collect()
}

#[track_caller]
fn assert_alike(found: &[Upright], views: &[View], what: &str) {
    for (i, (found, view)) in found.iter().zip(views).enumerate() {
        let same = found.rotation.dot(view.camera_from_world.rotation).abs();
        assert!((same - 1.0).abs() < 1e-12, "{what}: {i}");
    }
}

#[test]
fn photos_that_all_lie_on_their_side_stand_as_their_cameras_say() {
    for quarters in 0..4 {
        let straight = ring(12, 0.3, TAU);
        let mut stored = straight.clone();
        // Shown clockwise turned: stored counter-clockwise.
        roll(&mut stored, 0..12, (4 - quarters) % 4);
        let said: Vec<(&View, u8)> = stored.iter().map(|view| (view, quarters)).collect();
        assert_stand(&upright(&said), &straight, quarters);
        // One of them is wrong about itself.
        let mut wrong = said.clone();
        wrong[5].1 = (quarters + 1) % 4;
        assert_stand(&upright(&wrong), &straight, quarters);
    }
}

fn assert_stand(standing: &Standing, straight: &[View], quarters: u8) {
    assert_alike(&standing.photos, straight, &format!("{quarters}"));
    let up = standing.up.unwrap();
    assert!(up.distance(DVec3::NEG_Y) < 1e-6, "{quarters}: {up}");
    let exchanged = !quarters.is_multiple_of(2);
    assert!(
        standing
            .photos
            .iter()
            .all(|photo| photo.sides_exchanged == exchanged)
    );
}

#[test]
fn few_that_are_rolled_are_turned_back() {
    let mut captures = vec![row(8), ring(14, 0.2, 2.4)];
    for elevation in [0.0, 0.5, 1.0] {
        captures.extend([ring(14, elevation, TAU), ring(14, elevation, 2.4)]);
    }
    for (c, straight) in captures.iter().enumerate() {
        for which in [vec![0], vec![4], vec![7], vec![0, 3, 5]] {
            for quarters in 1..4 {
                let mut views = straight.clone();
                roll(&mut views, which.iter().copied(), quarters);
                let found = all(&views);
                assert_alike(&found, straight, &format!("{c}, {which:?}, {quarters}"));
                for (i, one) in found.iter().enumerate() {
                    let odd = which.contains(&i) && quarters % 2 == 1;
                    assert_eq!(one.sides_exchanged, odd, "{c}: {i}");
                }
                // Those that stand as most do stay as they are, to the bit.
                let own = unturned(&views);
                assert!((0..views.len()).all(|i| which.contains(&i) || found[i] == own[i]));
            }
        }
    }
}

/// Photos that look down on something from a part of all around it lean to one side together.
#[test]
fn up_is_across_what_is_level_in_photos() {
    for turn in [0.3 * TAU, 0.6 * TAU, TAU] {
        for elevation in [0.1, 0.6, 1.0] {
            let straight = ring(24, elevation, turn);
            let mut held = straight.clone();
            // Not quite level: by up to 4°.
            for (i, view) in held.iter_mut().enumerate() {
                let lean = DQuat::from_rotation_z(0.07 * (2.4 * i as f64).sin());
                view.camera_from_world = Rigid3::new(lean, DVec3::ZERO) * view.camera_from_world;
            }
            let off = |views: &[View]| {
                let up = stand(views).up.unwrap();
                up.angle_between(DVec3::NEG_Y).to_degrees()
            };
            // The mean of their ups is some 50° off in the worst of these.
            for views in [&straight, &held] {
                assert!(off(views) < 3.5, "{turn} {elevation}: {}", off(views));
            }
        }
    }
    assert_eq!(upright(&[]).up, None);
}

#[test]
fn where_half_are_rolled_all_stand_one_way() {
    for straight in [row(14), ring(14, 0.2, TAU), ring(14, 0.2, 2.4)] {
        for quarters in 1..4 {
            let mut views = straight.clone();
            roll(&mut views, (0..14).step_by(2), quarters);
            let found = all(&views);
            let mut other = straight.clone();
            roll(&mut other, 0..14, quarters);
            let turn = found[0]
                .rotation
                .dot(other[0].camera_from_world.rotation)
                .abs();
            // Photos side by side do not tell which half is upright; those that look at something do.
            let is_other = turn > 1.0 - 1e-9;
            assert!(!is_other || straight == row(14), "{quarters}");
            assert_alike(&found, if is_other { &other } else { &straight }, "half");
            // Whichever comes first.
            views.reverse();
            let mut back = all(&views);
            back.reverse();
            assert!(is_other || straight == row(14) || back == found);
        }
    }
}

#[test]
fn what_stands_alike_stays_as_it_is() {
    let mut captures = Vec::new();
    for quarters in 0..4 {
        for mut views in [row(8), ring(14, 0.2, TAU), ring(14, 0.9, 2.4)] {
            let count = views.len();
            roll(&mut views, 0..count, quarters);
            captures.push(views);
        }
    }
    // Held loosely.
    let leaning = row(9).into_iter().enumerate().map(|(i, mut view)| {
        let lean = DQuat::from_rotation_z(0.09 * (i as f64 - 4.0));
        view.camera_from_world = Rigid3::new(lean, DVec3::ZERO) * view.camera_from_world;
        view
    });
    captures.push(leaning.collect());
    captures.push(row(1));
    captures.push(Vec::new());
    for (i, views) in captures.iter().enumerate() {
        assert_eq!(all(views), unturned(views), "{i}");
    }
}

#[test]
fn from_above_headings_are_left_alone() {
    for count in [3, 4, 8, 14, 40] {
        let pose = |i: usize, heading: f64| {
            let center = DVec3::new(i as f64, 0.0, 9.0);
            let up = DVec3::new(heading.cos(), heading.sin(), 0.0);
            Rigid3::looking_at(center, center - DVec3::Z, up)
        };
        for turn in [0.0, TAU] {
            let heading = |i: usize| turn * i as f64 / count as f64;
            let views: Vec<View> = (0..count).map(|i| view(pose(i, heading(i)))).collect();
            assert_eq!(all(&views), unturned(&views), "{count} {turn}");
        }
    }
    // Those among others that look ahead are left alone, too.
    let mut views = ring(8, 0.3, TAU);
    for i in 0..6 {
        let up = DVec3::new((i as f64).cos(), 0.0, (i as f64).sin());
        views.push(view(Rigid3::looking_at(DVec3::NEG_Y, DVec3::ZERO, up)));
    }
    assert_eq!(all(&views), unturned(&views));
}

/// Straight down, in so many headings by turns, not quite held.
fn straight_down(count: usize, headings: usize) -> Vec<View> {
    let pose = |i: usize| {
        let center = DVec3::new((i % 6) as f64 - 2.5, -5.0, (i / 6) as f64 - 2.5);
        let heading = TAU * (i % headings) as f64 / headings as f64;
        let heading = heading + 0.05 * (7.0 * i as f64).sin();
        let up = DVec3::new(heading.cos(), 0.0, heading.sin());
        Rigid3::looking_at(center, center - DVec3::NEG_Y, up)
    };
    (0..count).map(|i| view(pose(i))).collect()
}

#[test]
fn photos_straight_down_overrule_no_vertical() {
    for elevation in [0.2, 0.5, 1.0] {
        for count in [6, 24, 36] {
            for headings in [1, 2, 4] {
                let mut straight = ring(24, elevation, TAU);
                straight.extend(straight_down(count, headings));
                let mut rolled = straight.clone();
                roll(&mut rolled, (0..24).step_by(5), 1);
                for views in [&straight, &rolled] {
                    let found = stand(views);
                    let what = format!("{elevation} {count} {headings}");
                    let off = found.up.unwrap().angle_between(DVec3::NEG_Y);
                    assert!(off.to_degrees() < 0.1, "{what}: {off}");
                    assert_alike(&found.photos, &straight, &what);
                }
            }
        }
    }
}

/// Ahead, and more than half as many to the side with the camera turned: those ahead look straight down as far
/// as these tell.
#[test]
fn what_looks_one_way_is_not_taken_to_look_down() {
    for (ahead, aside) in [(8, 7), (6, 4)] {
        let pose = |i: usize| {
            let center = DVec3::Z * i as f64;
            Rigid3::looking_at(center, center + DVec3::X, DVec3::NEG_Y)
        };
        let mut straight = row(ahead);
        straight.extend((0..aside).map(|i| view(pose(i))));
        for quarters in [1, 3] {
            let mut views = straight.clone();
            roll(&mut views, ahead..ahead + aside, quarters);
            assert_alike(&all(&views), &straight, &format!("{ahead} {quarters}"));
        }
    }
}
