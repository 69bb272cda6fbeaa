//! Sweeps of photos that all look at one thing, and of those that do not.

use super::*;
use glam::DQuat;

/// Photos of the origin from 4 units off, unevenly over a dome about it that begins at its level and ends so high, in
/// shares of the radius. y is down.
fn dome(count: u32, top: f64) -> Scene {
    let poses = (0..count).map(|i| {
        let i = f64::from(i);
        let height = top * ((i + 0.5) / f64::from(count)).powf(1.5);
        let azimuth = 2.4 * i + 0.4 * (3.0 * i).sin();
        let level = DVec3::new(azimuth.cos(), 0.0, azimuth.sin());
        let center = 4.0 * (level * (1.0 - height * height).sqrt() + DVec3::NEG_Y * height);
        Rigid3::looking_at(center, DVec3::ZERO, DVec3::NEG_Y)
    });
    scene(poses.collect(), vec![DVec3::ZERO; 9], DVec3::ZERO)
}

/// Means of their gazes meet nothing, those of their places go over the top, or lie within the dome.
#[test]
fn a_sweep_of_photos_all_over_a_dome_looks_at_what_they_do() {
    for (count, top) in [(40, 0.7), (40, 1.0), (100, 0.5), (100, 1.0), (300, 0.85)] {
        let what = format!("{count} {top}");
        let along = path(Trajectory::Sweep, &dome(count, top));
        for frame in &along.frames {
            // A sixteenth of the picture's width is 0.08.
            let off = angle_off(frame, DVec3::ZERO);
            assert!(off < 0.02, "{what}: {off}");
            let distance = frame.view.center().length();
            assert!(distance > 3.5 && distance < 4.5, "{what}: {distance}");
            let right = frame.view.camera_from_world.rotation.conjugate() * DVec3::X;
            assert!(right.y.abs() < 0.01, "{what}: {}", right.y);
        }
        let rotations = along.frames.iter();
        let rotations = rotations.map(|frame| frame.view.camera_from_world.rotation);
        let rotations: Vec<DQuat> = rotations.collect();
        let turns = rotations
            .windows(2)
            .map(|pair| pair[0].angle_between(pair[1]));
        let most = turns.fold(0.0, f64::max);
        assert!(most < 0.15, "{what}: turns by {most}");
        let places = centers(&along);
        let wide = places[0].distance(places[60]);
        assert!(wide > 4.8, "{what}: {wide}");
    }
}

/// From one side of the origin to the other, over it: there is no way around that photos show.
#[test]
fn a_sweep_of_photos_over_the_top_of_something_stays_where_they_are() {
    let center = |i: u32| {
        let angle = (5.0 + 170.0 * f64::from(i) / 39.0).to_radians();
        4.0 * DVec3::new(angle.cos(), -angle.sin(), 0.0)
    };
    let pose = |i: u32| Rigid3::looking_at(center(i), DVec3::ZERO, DVec3::NEG_Y);
    let over = scene(
        (0..40).map(pose).collect(),
        vec![DVec3::ZERO; 9],
        DVec3::ZERO,
    );
    for place in centers(&path(Trajectory::Sweep, &over)) {
        assert!(place.z.abs() < 0.5 && place.y < 0.0, "{place}");
    }
}

/// Each to the right of the origin, by as many degrees.
#[test]
fn a_sweep_of_photos_that_look_past_something_does_so() {
    let off = |degrees: f64| {
        let turn = Rigid3::new(DQuat::from_rotation_y(degrees.to_radians()), DVec3::ZERO);
        let mut s = ring_above(36, 0.0, 360.0);
        for source in &mut s.sources {
            source.view.camera_from_world = turn * source.view.camera_from_world;
        }
        let frames = path(Trajectory::Sweep, &s).frames;
        let offs = frames.iter().map(|frame| angle_off(frame, DVec3::ZERO));
        let (least, most) = (f64::INFINITY, 0.0);
        offs.fold((least, most), |(least, most): (f64, f64), off| {
            (least.min(off), most.max(off))
        })
    };
    let (_, most) = off(5.0);
    assert!(most < 0.01, "{most}");
    let (least, _) = off(20.0);
    assert!(least > 0.25, "{least}");
}
