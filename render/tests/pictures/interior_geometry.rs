//! Interiors drawn as geometry: what rays see, whatever was culled.

use crate::house;

use glam::DVec3;
use house::{Pixels, drawn, small_house, view as view_of, viewpoint};
use image::RgbaImage;
use proxy::interior::{Contents, Region, visible};
use proxy::mesh::Model;
use rayon::prelude::*;
use render::interior::{CellGeometry, DrawOptions, Pinhole, Raster, Runs, Target, Window};

/// The picture of some triangles, drawn part by part, those that others hide, too, or not.
fn draw(model: &Model, parts: &[Runs<'_>], view: &calibrate::View, all: bool) -> Target {
    let camera = Pinhole::new(view).unwrap();
    let mut raster = Raster::default();
    raster.clear(&camera);
    let window = Window::whole(view.width, view.height);
    let options = DrawOptions {
        all,
        ..DrawOptions::default()
    };
    for runs in parts {
        let part = (runs.clone(), window.clone());
        let met = raster.draw(&[part], &camera, &options);
        assert!(!all || met.tried == runs.count());
    }
    let mut target = Target::new(view.width, view.height);
    raster.shade(model, &camera, &mut target, |_, _| true);
    target
}

/// All triangles of a model.
fn all_of(model: &Model) -> CellGeometry {
    let all: Vec<u32> = (0..model.mesh.triangles.len() as u32).collect();
    CellGeometry::of(model, &all)
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
    let all = all_of(&house.model);
    let (mut pixels, mut wrong, mut off) = (0, 0, 0);
    for seed in 0..40 {
        let (eye, target) = viewpoint(&house.interior, seed);
        let view = view_of(eye, target, [160, 120]);
        let (truth, depths) = datasets::house::render(house, &view);
        let ours = draw(&house.model, &[all.all()], &view, false);
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
    let all = all_of(&house.model);
    let count = house.model.mesh.triangles.len();
    let share = |i: u64| {
        let (eye, target) = viewpoint(&house.interior, u64::from(seed) * 10_000 + i);
        let view = view_of(eye, target, [64, 48]);
        let whole = draw(&house.model, &[all.all()], &view, true);
        let runs = drawn(&house.interior, &contents, &geometry, &view);
        let some = draw(&house.model, std::slice::from_ref(&runs), &view, false);
        assert!(
            whole == some,
            "{rooms} rooms, viewpoint {i}: {eye} {target}"
        );
        assert!(whole.color.iter().all(|c| c[3] == 255), "a house is closed");
        [runs.asked, runs.count()].map(|n| n as f64 / count as f64)
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
    let view = view_of(eye, target, [96, 64]);
    let all: Vec<u32> = (0..house.model.mesh.triangles.len() as u32).collect();
    let once = draw(&house.model, &[all_of(&house.model).all()], &view, true);
    let parts = |model: &Model| -> Vec<CellGeometry> {
        let mut reversed = all.clone();
        reversed.reverse();
        let part = |part: &[u32]| CellGeometry::of(model, part);
        reversed.chunks(1000).map(part).collect()
    };
    let geometry = parts(&house.model);
    let runs: Vec<Runs<'_>> = geometry.iter().map(CellGeometry::all).collect();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    assert!(once == pool.install(|| draw(&house.model, &runs, &view, false)));
    // Far from the world's origin they are the same but for rounding.
    let far = DVec3::new(4e6, -7e5, 300.0);
    let mut moved = house.model.clone();
    moved.mesh.positions.iter_mut().for_each(|p| *p += far);
    let geometry = parts(&moved);
    let runs: Vec<Runs<'_>> = geometry.iter().map(CellGeometry::all).collect();
    let there = draw(
        &moved,
        &runs,
        &view_of(eye + far, target + far, [96, 64]),
        false,
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
    let view = view_of(DVec3::ZERO, DVec3::X, [8, 6]);
    let target = draw(&model, &[], &view, false);
    assert!(target.color.iter().all(|c| *c == [0; 4]));
    let geometry = CellGeometry::new(&model, &Contents::default());
    let runs = geometry.seen(DVec3::ZERO, &Default::default(), &Region::ALL);
    assert_eq!(runs.count(), 0);
}
