//! Outlines that are drawn of several samples a pixel.

use crate::{common, mesh};

use calibrate::{Distortion, Lens, View};
use common::{METHODS, assert_close, pinhole};
use glam::{DVec2, DVec3};
use image::{Rgba, RgbaImage};
use mesh::{desired_views, lumigraph, pillar, solid_of, within_the_photos};
use proxy::MeshKind;
use render::{DeviceChoice, Engine, FieldOptions, Frame, Lumigraph, Method, Prepared};
use std::f64::consts::TAU;

fn frame<'a>(lumigraph: &'a Lumigraph, desired: &View) -> Frame<'a> {
    Frame::new(lumigraph, desired.clone(), FieldOptions::default())
}

fn open() -> Engine {
    Engine::open(DeviceChoice::Cpu).unwrap()
}

/// Each pixel the mean of 2 × 2 of a picture twice as large.
fn halved(fine: &RgbaImage) -> RgbaImage {
    RgbaImage::from_fn(fine.width() / 2, fine.height() / 2, |x, y| {
        let mut sum = [0_u32; 4];
        for k in 0..4 {
            let pixel = fine.get_pixel(2 * x + k % 2, 2 * y + k / 2);
            (0..4).for_each(|c| sum[c] += u32::from(pixel.0[c]));
        }
        Rgba(sum.map(|sum| ((sum + 2) / 4) as u8))
    })
}

#[test]
fn outlines_are_those_of_a_larger_picture_and_all_else_is_as_without() {
    let lumigraph = lumigraph(pillar(), MeshKind::Mesh);
    let mut engine = open();
    for (name, desired) in within_the_photos() {
        // Its pixels are no larger than the photos', so that in the larger picture photos weigh alike.
        let (width, height) = (desired.width, desired.height);
        let larger = desired.resized(2 * width, 2 * height);
        let larger = frame(&lumigraph, &larger);
        let expected = halved(&engine.render(&larger, Method::Exact).unwrap());
        let frame = frame(&lumigraph, &desired);
        let without = engine.render(&frame, Method::Exact).unwrap();
        let mut smooth = without.clone();
        let count = engine
            .smooth(&frame, &Prepared::Exact, 2, &mut smooth)
            .unwrap();
        // The pillar's outlines, each two pixels wide.
        assert!((200..1200).contains(&count), "{name}: {count}");
        let changed = without.pixels().zip(smooth.pixels()).zip(expected.pixels());
        let changed: Vec<_> = changed.filter(|((a, b), _)| a != b).collect();
        assert!(
            (count / 2..=count).contains(&changed.len()),
            "{name}: {count}"
        );
        let is_off = |a: &Rgba<u8>, b: &Rgba<u8>| (0..4).any(|c| a.0[c].abs_diff(b.0[c]) > 3);
        let off = changed.iter().filter(|((_, b), e)| is_off(b, e)).count();
        println!("{name}: {off} of {} pixels", changed.len());
        assert!(
            50 * off <= changed.len(),
            "{name}: {off} of {}",
            changed.len()
        );
    }
}

#[test]
fn where_a_photo_was_taken_its_pixels_stay() {
    let lumigraph = lumigraph(pillar(), MeshKind::Mesh);
    let desired = lumigraph.sources[2].view.clone();
    let frame = frame(&lumigraph, &desired);
    let mut engine = open();
    let mut picture = engine.render(&frame, Method::Exact).unwrap();
    assert_eq!(
        engine
            .smooth(&frame, &Prepared::Exact, 2, &mut picture)
            .unwrap(),
        0
    );
}

#[test]
fn every_engine_draws_the_same_outlines() {
    let lumigraph = lumigraph(pillar(), MeshKind::Mesh);
    let mut engines = vec![DeviceChoice::Reference, DeviceChoice::Cpu];
    let gpu = common::gpu();
    engines.extend(gpu.is_some().then_some(DeviceChoice::Gpu));
    drop(gpu);
    let panorama = View {
        lens: Lens::new(
            DVec2::splat(320.0 / TAU),
            DVec2::new(160.0, 80.0),
            Distortion::Equirectangular,
        ),
        width: 320,
        height: 160,
        ..desired_views()[0].1.clone()
    };
    for (name, desired) in desired_views().into_iter().chain([("panorama", panorama)]) {
        let frame = frame(&lumigraph, &desired);
        for method in METHODS {
            let prepared = Prepared::new(&frame, method).unwrap();
            // Of one picture, as which pixels are edges is a matter of a step.
            let without = common::by_reference(&frame, method).unwrap();
            let smooth = engines.iter().map(|device| {
                let mut picture = without.clone();
                let mut engine = Engine::open(*device).unwrap();
                let count = engine.smooth(&frame, &prepared, 2, &mut picture).unwrap();
                assert!(count > 100, "{name}: {count}");
                picture
            });
            let smooth: Vec<RgbaImage> = smooth.collect();
            for (picture, device) in smooth.iter().zip(&engines).skip(1) {
                assert_close(
                    picture,
                    &smooth[0],
                    &format!("{name}, {method:?}, {device:?}"),
                );
            }
        }
    }
}

#[test]
fn coverage_at_a_silhouette_is_what_of_a_pixel_is_covered() {
    // The pillar alone, and who looks at it.
    let mut mesh = pillar();
    mesh.triangles.drain(..2);
    let lumigraph = lumigraph(mesh, MeshKind::Mesh);
    let desired = pinhole(
        DVec3::new(0.3, 0.05, 0.2),
        DVec3::new(0.1, 0.0, 2.4),
        90.0,
        (96, 128),
    );
    // What 16 × 16 samples say.
    let finer = desired.resized(16 * 96, 16 * 128);
    let solid = solid_of(&lumigraph);
    let world_from_camera = desired.camera_from_world.rotation.conjugate();
    let is_covered = |x: u32, y: u32| {
        let ray = finer
            .lens
            .unproject(calibrate::Pixel::center_of(x, y))
            .unwrap();
        let ray = world_from_camera * ray;
        solid.first_hit(desired.center(), ray).is_some()
    };
    let share = |x: u32, y: u32| {
        let samples = (0..256).filter(|k| is_covered(16 * x + k % 16, 16 * y + k / 16));
        samples.count() as f64 / 256.0
    };
    let frame = frame(&lumigraph, &desired);
    let mut engine = open();
    let without = engine.render(&frame, Method::Exact).unwrap();
    let mut off = |across: u32| -> f64 {
        let mut picture = without.clone();
        engine
            .smooth(&frame, &Prepared::Exact, across, &mut picture)
            .unwrap();
        let covered = picture.enumerate_pixels();
        let off = covered.map(|(x, y, p)| (f64::from(p.0[3]) / 255.0 - share(x, y)).powi(2));
        (off.sum::<f64>() / f64::from(96 * 128)).sqrt()
    };
    let [one, two, four] = [1, 2, 4].map(&mut off);
    println!("rms of coverage with 1, 2 and 4 samples across: {one:.4}, {two:.4}, {four:.4}");
    assert!(two < 0.6 * one, "{one}, {two}");
    assert!(four < 0.6 * two, "{two}, {four}");
}

#[test]
fn nothing_is_drawn_anew_where_nothing_jumps_or_nobody_asks() {
    let lumigraph = lumigraph(pillar(), MeshKind::Mesh);
    let mut engine = open();
    let (_, desired) = desired_views().remove(0);
    let same = |engine: &mut Engine, frame: &Frame<'_>, across: u32| {
        let without = engine.render(frame, Method::Exact).unwrap();
        let mut picture: RgbaImage = without.clone();
        assert_eq!(
            engine
                .smooth(frame, &Prepared::Exact, across, &mut picture)
                .unwrap(),
            0
        );
        assert!(picture == without);
    };
    same(&mut engine, &frame(&lumigraph, &desired), 1);
    // Up against the wall, beyond the pillar.
    let center = DVec3::new(0.0, 0.0, 3.0);
    let beyond = pinhole(center, center + DVec3::Z, 110.0, (160, 120));
    same(&mut engine, &frame(&lumigraph, &beyond), 4);
}
