//! Outlines that are drawn of several samples a pixel.

use crate::{common, mesh};

use calibrate::View;
use common::{METHODS, assert_close, by_all, pinhole, psnr};
use glam::DVec3;
use image::RgbaImage;
use mesh::{desired_views, lumigraph, photo, pillar, solid_of, within_the_photos};
use proxy::MeshKind;
use render::{DeviceChoice, Edges, Engine, FieldOptions, Frame, Lumigraph, Method};

fn frame<'a>(lumigraph: &'a Lumigraph, desired: &View) -> Frame<'a> {
    Frame::new(lumigraph, desired.clone(), FieldOptions::default())
}

fn open() -> Engine {
    Engine::open(DeviceChoice::Cpu).unwrap()
}

#[test]
fn outlines_are_nearer_the_truth_and_all_else_is_as_without() {
    let lumigraph = lumigraph(pillar(), MeshKind::Mesh);
    let mut engine = open();
    for (name, desired) in within_the_photos() {
        let truth = photo(solid_of(&lumigraph), &desired);
        let frame = frame(&lumigraph, &desired);
        for method in METHODS {
            let without = engine.render(&frame, method).unwrap();
            let mut smooth = without.clone();
            let count = engine.smooth(&frame, 2, &mut smooth).unwrap();
            let [before, after] = [&without, &smooth].map(|picture| psnr(picture, &truth));
            println!("{name}, {method:?}: {before:.2} -> {after:.2} dB, {count} pixels");
            assert!(after > before + 0.5, "{name}: {before}, {after}");
            // The pillar's outlines, each two pixels wide.
            assert!((200..1200).contains(&count), "{name}: {count}");
            let changed = without.pixels().zip(smooth.pixels());
            let changed = changed.filter(|(a, b)| a != b).count();
            assert!(changed <= count, "{name}: {changed}, {count}");
        }
    }
}

#[test]
fn every_engine_draws_the_same_outlines() {
    let lumigraph = lumigraph(pillar(), MeshKind::Mesh);
    for (name, desired) in desired_views() {
        let frame = frame(&lumigraph, &desired);
        let mut smooth = Vec::new();
        for (engine, picture) in by_all(&frame, Method::Exact) {
            let mut picture = picture.unwrap();
            let edges = Edges::of(&frame, &picture, 2).unwrap();
            let samples = by_all(&edges.samples, Method::Exact);
            let samples = samples.into_iter().find(|(other, _)| *other == engine);
            edges.put(&samples.unwrap().1.unwrap(), &mut picture);
            smooth.push((engine, picture));
        }
        let (_, reference) = smooth.remove(0);
        for (engine, picture) in smooth {
            assert_close(&picture, &reference, &format!("{name}, {engine}"));
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
        engine.smooth(&frame, across, &mut picture).unwrap();
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
        assert_eq!(engine.smooth(frame, across, &mut picture).unwrap(), 0);
        assert!(picture == without);
    };
    same(&mut engine, &frame(&lumigraph, &desired), 1);
    // Up against the wall, beyond the pillar.
    let center = DVec3::new(0.0, 0.0, 3.0);
    let beyond = pinhole(center, center + DVec3::Z, 110.0, (160, 120));
    same(&mut engine, &frame(&lumigraph, &beyond), 4);
}
