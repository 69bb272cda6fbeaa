//! Interiors drawn as geometry: what rays see, whatever was culled.

use crate::house;

use glam::DVec3;
use house::{Pixels, drawn, small_house, view, viewpoint};
use image::RgbaImage;
use proxy::interior::{Contents, Region, visible};
use rayon::prelude::*;
use render::interior::{CellGeometry, Pinhole, Raster, Target, Window};

/// The picture of lists of triangles.
fn draw(model: &proxy::mesh::Model, lists: &[&[u32]], view: &calibrate::View) -> Target {
    let camera = Pinhole::new(view).unwrap();
    let mut raster = Raster::default();
    raster.clear(&camera);
    let window = Window::whole(view.width, view.height);
    raster.draw(model, lists, &camera, &window, None);
    let mut target = Target::new(view.width, view.height);
    raster.shade(model, &camera, &mut target, |_, _| true);
    target
}

/// How many pixels differ, and how many of them at no edge of the true picture.
fn compare(ours: &Target, truth: &RgbaImage, depths: &[f64]) -> (usize, usize) {
    let pixels = Pixels::of_rays(truth, depths);
    let differs = |(ours, theirs): (&[u8; 4], &image::Rgba<u8>)| {
        (0..4).any(|k| ours[k].abs_diff(theirs.0[k]) > 2)
    };
    let wrong = ours.color.iter().zip(truth.pixels()).map(differs);
    let wrong: Vec<usize> = (0..)
        .zip(wrong)
        .filter(|(_, is)| *is)
        .map(|(i, _)| i)
        .collect();
    let off = wrong.iter().filter(|i| !pixels.is_edge(**i)).count();
    (wrong.len(), off)
}

#[test]
fn pictures_of_triangles_are_those_of_rays() {
    let (house, _) = small_house(5, 2);
    let all: Vec<u32> = (0..house.model.mesh.triangles.len() as u32).collect();
    let (mut pixels, mut wrong, mut off) = (0, 0, 0);
    for seed in 0..40 {
        let (eye, target) = viewpoint(&house.interior, seed);
        let view = view(eye, target, [160, 120]);
        let (truth, depths) = datasets::house::render(&house, &view);
        let ours = draw(&house.model, &[&all], &view);
        let (w, o) = compare(&ours, &truth, &depths);
        pixels += depths.len();
        wrong += w;
        off += o;
        // Depth, too.
        let depth = |(s, z): (&f32, &f64)| ((1.0 / f64::from(*s) - z) / z).abs() > 1e-5;
        let deep = ours
            .inverse_depth
            .iter()
            .zip(&depths)
            .filter(|&p| depth(p))
            .count();
        assert!(deep <= 20, "seed {seed}: {deep} depths differ");
    }
    eprintln!("{wrong} of {pixels} pixels differ, {off} of them not at an edge");
    assert!(wrong * 1000 <= pixels, "{wrong} of {pixels}");
    assert_eq!(off, 0);
}

/// The share of triangles that is drawn; pictures with and without culling are the same.
fn culled(rooms: usize, seed: u32, views: u64) -> f64 {
    let (house, contents) = small_house(rooms, seed);
    let geometry = CellGeometry::new(&house.model, &contents);
    let all: Vec<u32> = (0..house.model.mesh.triangles.len() as u32).collect();
    let share = |i: u64| {
        let (eye, target) = viewpoint(&house.interior, u64::from(seed) * 10_000 + i);
        let view = view(eye, target, [64, 48]);
        let whole = draw(&house.model, &[&all], &view);
        let runs = drawn(&house.interior, &contents, &geometry, &view);
        let some = draw(&house.model, &runs.lists, &view);
        assert!(
            whole == some,
            "{rooms} rooms, viewpoint {i}: {eye} {target}"
        );
        assert!(whole.color.iter().all(|c| c[3] == 255), "a house is closed");
        [runs.asked, runs.count()].map(|n| n as f64 / all.len() as f64)
    };
    let shares: Vec<[f64; 2]> = (0..views).into_par_iter().map(share).collect();
    let mean = |k: usize| shares.iter().map(|s| s[k]).sum::<f64>() / views as f64;
    eprintln!(
        "{rooms} rooms: {:.1} % of the triangles in visible cells, {:.1} % drawn",
        100.0 * mean(0),
        100.0 * mean(1)
    );
    mean(1)
}

// 2000 viewpoints in all.

#[test]
fn culling_changes_no_pixel_of_two_rooms() {
    assert!(culled(2, 1, 400) < 0.9);
}

#[test]
fn culling_changes_no_pixel_of_five_rooms() {
    assert!(culled(5, 2, 500) < 0.6);
}

#[test]
fn culling_changes_no_pixel_of_nine_rooms() {
    assert!(culled(9, 3, 550) < 0.45);
}

#[test]
fn culling_changes_no_pixel_of_nineteen_rooms() {
    assert!(culled(19, 4, 550) < 0.3);
}

#[test]
fn pictures_do_not_depend_on_order_or_threads() {
    let (house, contents) = small_house(2, 3);
    let (eye, target) = viewpoint(&house.interior, 5);
    let view = view(eye, target, [96, 64]);
    let mut all: Vec<u32> = (0..house.model.mesh.triangles.len() as u32).collect();
    let once = draw(&house.model, &[&all], &view);
    all.reverse();
    let chunks: Vec<&[u32]> = all.chunks(1000).collect();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    assert!(once == pool.install(|| draw(&house.model, &chunks, &view)));
    // Far from the world's origin they are the same but for rounding.
    let far = DVec3::new(4e6, -7e5, 300.0);
    let mut moved = house.model.clone();
    moved.mesh.positions.iter_mut().for_each(|p| *p += far);
    let there = draw(
        &moved,
        &chunks,
        &self::view(eye + far, target + far, [96, 64]),
    );
    let same = once
        .color
        .iter()
        .zip(&there.color)
        .filter(|(a, b)| a == b)
        .count();
    assert!(same * 100 > 99 * once.color.len(), "{same}");
    let cell = contents.locate(&house.interior, eye);
    assert!(!visible(&house.interior, cell, &view).cells.is_empty());
}

#[test]
fn an_empty_model_is_an_empty_picture() {
    let model = proxy::mesh::Model::default();
    let view = view(DVec3::ZERO, DVec3::X, [8, 6]);
    let target = draw(&model, &[], &view);
    assert!(target.color.iter().all(|c| *c == [0; 4]));
    let geometry = CellGeometry::new(&model, &Contents::default());
    let runs = geometry.seen(DVec3::ZERO, &Default::default(), &Region::ALL);
    assert_eq!(runs.count(), 0);
}
