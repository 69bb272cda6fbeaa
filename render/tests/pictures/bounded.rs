//! Frames within a bound on their error.

use crate::common;

use common::Shot;
use image::RgbaImage;
use render::score::score;
use render::{
    Blend, Bounded, DeviceChoice, Engine, FieldOptions, Frame, GRIDS, Method, Prepared, Samples,
    TriangulatedField, cpu, prepare_within,
};

const NONE: f64 = f64::INFINITY;

/// Views between photos of scenes that are easy and hard on a coarse grid.
fn on_frames(mut look: impl FnMut(&str, &Frame<'_>)) {
    for (name, views) in [("wall", 9), ("hallway", 12), ("knick-knacks", 8)] {
        let shot = Shot::of(name, views, None);
        let lumigraph = shot.lumigraph();
        let first = views / 2;
        let desired = shot.views[first].between(&shot.views[first + 1], 0.5);
        let desired = desired.resized(240, 180);
        look(
            name,
            &Frame::new(&lumigraph, desired, FieldOptions::default()),
        );
    }
}

fn rms(frame: &Frame<'_>, chosen: &Bounded, exact: &RgbaImage) -> f64 {
    let mut engine = Engine::open(DeviceChoice::Cpu).unwrap();
    let picture = engine.draw(frame, &chosen.prepared).unwrap();
    255.0 * 10_f64.powf(-score(&picture, exact).unwrap().psnr / 20.0)
}

#[test]
fn frames_are_within_their_bounds_and_tighter_bounds_are_no_worse() {
    let mut taken = Vec::new();
    on_frames(|name, frame| {
        let exact = cpu::render(frame, Method::Exact).unwrap();
        let mut last = f64::INFINITY;
        for bound in [8.0, 1.0, 0.4, 0.2, 0.15, 0.1, 0.01] {
            let chosen = prepare_within(frame, bound).unwrap();
            let error = chosen.error.unwrap();
            assert!(
                error <= bound && error <= last,
                "{name}, {bound}: {error}, {last}"
            );
            assert_eq!(
                chosen.cells_across.is_none(),
                chosen.prepared.field().is_none()
            );
            last = error;
            let off = rms(frame, &chosen, &exact);
            assert!(
                off <= bound,
                "{name}, {bound}: {off}, {:?}",
                chosen.cells_across
            );
            taken.push(chosen.cells_across);
        }
    });
    for grid in [Some(GRIDS[0]), Some(GRIDS[1]), None] {
        assert!(taken.contains(&grid), "{grid:?} was never taken: {taken:?}");
    }
}

#[test]
fn no_bound_is_the_default_and_an_impossible_one_the_exact_field() {
    on_frames(|name, frame| {
        let free = prepare_within(frame, NONE).unwrap();
        let Prepared::Field(field) = &free.prepared else {
            panic!("{name}: exact")
        };
        assert_eq!(*field, TriangulatedField::new(frame, 32).unwrap());
        assert_eq!((free.cells_across, free.error), (Some(32), None));
        for bound in [0.0, -1.0, f64::NAN, f64::MIN_POSITIVE, 1e-6] {
            let chosen = prepare_within(frame, bound).unwrap();
            assert!(chosen.prepared.field().is_none(), "{name}, {bound}");
            assert_eq!(chosen.error, Some(0.0));
        }
    });
}

#[test]
fn samples_tell_the_whole_pictures_error() {
    on_frames(|name, frame| {
        let exact = cpu::render(frame, Method::Exact).unwrap();
        let samples = Samples::new(frame).unwrap();
        for grid in [8, 16, 32] {
            let field = TriangulatedField::new(frame, grid).unwrap();
            let error = samples.error_of(&field).unwrap();
            let chosen = Bounded {
                prepared: Prepared::Field(field),
                cells_across: Some(grid),
                error: None,
            };
            let (truth, told) = (rms(frame, &chosen, &exact), error.mean_square.sqrt());
            assert!(
                (told - truth).abs() <= 0.25 * truth.max(0.1),
                "{name}, {grid}: {told} for {truth}"
            );
        }
    });
}

#[test]
fn where_one_photo_paints_each_pixel_a_missed_one_is_off_by_far() {
    let wall = |views: usize| Shot::of("wall", views, None);
    let (many, two) = (wall(9), wall(2));
    for (shot, blend, k, is_far) in [
        (&many, Blend::Paper, 1, true),
        (&many, Blend::Paper, 2, true),
        (&many, Blend::Paper, 3, false),
        (&many, Blend::Consistent, 1, false),
        (&many, Blend::Consistent, 2, false),
        (&two, Blend::Paper, 5, true),
    ] {
        let lumigraph = shot.lumigraph();
        let desired = shot.views[0].between(&shot.views[1], 0.5);
        let options = FieldOptions {
            k,
            blend,
            ..FieldOptions::default()
        };
        let frame = Frame::new(&lumigraph, desired.resized(240, 180), options);
        let field = TriangulatedField::new(&frame, 32).unwrap();
        let samples = Samples::new(&frame).unwrap();
        let missed = samples.error_of(&field).unwrap().missed.sqrt();
        let expected = if is_far { 0.7..0.85 } else { 0.07..0.085 };
        assert!(expected.contains(&missed), "{blend:?} {k}: {missed}");
        if is_far {
            let chosen = prepare_within(&frame, 0.6).unwrap();
            assert_eq!((chosen.cells_across, chosen.error), (None, Some(0.0)));
        }
    }
}

#[test]
fn threads_and_what_was_decoded_before_change_nothing() {
    on_frames(|name, frame| {
        let choose = || {
            let chosen = prepare_within(frame, 0.4).unwrap();
            (chosen.cells_across, chosen.error.map(f64::to_bits))
        };
        let pool = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap().install(choose)
        };
        let expected = choose();
        assert_eq!([pool(1), pool(3)], [expected; 2], "{name}");
    });
}

#[test]
fn pictures_of_a_few_pixels_or_of_nothing_are_measured_too() {
    let shot = Shot::of("wall", 3, None);
    let lumigraph = shot.lumigraph();
    for (width, height) in [(1, 1), (1, 50), (7, 3)] {
        let desired = shot.views[1].resized(width, height);
        let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
        let chosen = prepare_within(&frame, 3.0).unwrap();
        assert!(chosen.error.unwrap().is_finite());
    }
    // Looking away from the wall.
    let mut away = shot.views[1].clone();
    let turn = glam::DQuat::from_rotation_y(std::f64::consts::PI);
    away.camera_from_world.rotation = turn * away.camera_from_world.rotation;
    away.camera_from_world.translation = turn * away.camera_from_world.translation;
    let frame = Frame::new(&lumigraph, away, FieldOptions::default());
    let chosen = prepare_within(&frame, 0.5).unwrap();
    assert_eq!(chosen.cells_across, Some(32));
}
