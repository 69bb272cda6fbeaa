//! Interiors on a graphics device, against the CPU.

use crate::house;

use calibrate::View;
use glam::DVec3;
use house::{Pixels, small_house, view, viewpoint};
use image::RgbaImage;
use proxy::interior::{Contents, Interior, parse_rooms};
use proxy::mesh::{Material, Mesh, Model, ModelNode, Part, Texture, Wrap};
use render::DeviceChoice;
use render::gpu::DeviceLimits;
use render::interior::{Painter, PortalFill, Target, Walk, WalkOptions};
use std::path::Path;

/// A painter with a device; none, said aloud, where no driver answers.
fn painter(model: &Model) -> Option<Painter> {
    let painter = Painter::open(DeviceChoice::Gpu, model);
    if painter.description() == "CPU" {
        let notes = painter.notes().join("; ");
        let is_required = std::env::var("LUMIGRAPH_REQUIRE_GPU").as_deref() == Ok("1");
        assert!(!is_required, "LUMIGRAPH_REQUIRE_GPU is 1, but: {notes}");
        eprintln!("SKIPPED: tests on the graphics device: {notes}");
        return None;
    }
    Some(painter)
}

/// The pictures of both.
fn both(
    interior: &Interior,
    contents: &Contents,
    model: &Model,
    views: &[(View, PortalFill)],
) -> Option<Vec<[Target; 2]>> {
    let options = WalkOptions::default();
    let mut by_gpu = Walk::with(painter(model)?, interior, contents, model, options);
    let mut by_cpu = Walk::new(interior, contents, model, options);
    let draw = |walk: &mut Walk<'_>, (view, fill): &(View, PortalFill)| {
        walk.draw(view, *fill).unwrap();
        walk.picture().clone()
    };
    let pictures = views
        .iter()
        .map(|v| [draw(&mut by_gpu, v), draw(&mut by_cpu, v)]);
    let pictures = pictures.collect();
    assert_eq!(by_gpu.painter().notes(), [""; 0]);
    Some(pictures)
}

/// The edges of a view that is drawn many times as large, where pixels miss what is thin.
fn fine(interior: &Interior, contents: &Contents, model: &Model, view: &View) -> Pixels {
    let mut walk = Walk::new(interior, contents, model, WalkOptions::default());
    let large = view.resized(FINE * view.width, FINE * view.height);
    walk.draw(&large, PortalFill::Geometry).unwrap();
    Pixels::of(walk.picture())
}

const FINE: u32 = 8;

/// Asserts that at most one pixel in a thousand differs by more than 2, and depths by more than
/// 1e-4, and only within 1.5 pixels of an edge.
fn assert_alike(
    pictures: &[[Target; 2]],
    what: &str,
    views: &[(View, PortalFill)],
    fine: impl Fn(&View) -> Pixels,
) {
    let (mut wrong, mut deep, mut pixels, mut same) = (0, 0, 0, 0);
    for ([ours, theirs], (view, _)) in pictures.iter().zip(views) {
        let truth = Pixels::of(theirs);
        let count = ours.color.len();
        let color = |i: &usize| {
            let (a, b) = (ours.color[*i], theirs.color[*i]);
            (0..4).any(|k| a[k].abs_diff(b[k]) > 2)
        };
        let depth = |i: &usize| {
            let (a, b) = (ours.inverse_depth[*i], theirs.inverse_depth[*i]);
            (a - b).abs() > 1e-4 * b
        };
        let differ: Vec<usize> = (0..count).filter(|i| color(i) || depth(i)).collect();
        let off: Vec<&usize> = differ.iter().filter(|i| !truth.is_edge(**i)).collect();
        if !off.is_empty() {
            let fine = fine(view);
            for i in off {
                let at = [*i as u32 % view.width, *i as u32 / view.width];
                assert!(fine.has_edge_around(at, FINE), "{what}: {at:?}");
            }
        }
        wrong += differ.iter().filter(|i| color(i)).count();
        deep += differ.iter().filter(|i| depth(i)).count();
        same += ours
            .color
            .iter()
            .zip(&theirs.color)
            .filter(|(a, b)| a == b)
            .count();
        pixels += count;
    }
    eprintln!(
        "{what}: of {pixels} pixels {wrong} differ by more than 2, {deep} in depth, all of them at \
         edges; {:.3} % are the same",
        100.0 * same as f64 / pixels as f64
    );
    assert!(wrong * 1000 <= pixels, "{what}: {wrong} of {pixels}");
    assert!(deep * 1000 <= pixels, "{what}: {deep} of {pixels}");
}

#[test]
fn the_device_draws_what_the_cpu_draws() {
    let (house, contents) = small_house(5, 2);
    for fill in [PortalFill::Geometry, PortalFill::Warp2, PortalFill::Texture] {
        let view = |seed: u64| {
            let (eye, target) = viewpoint(&house.interior, seed);
            (view(eye, target, [160, 120]), fill)
        };
        let views: Vec<_> = (0..24).map(view).collect();
        let Some(pictures) = both(&house.interior, &contents, &house.model, &views) else {
            return;
        };
        if fill == PortalFill::Geometry {
            // A house is closed.
            let holes = pictures.iter().flat_map(|p| &p[0].color);
            assert_eq!(holes.filter(|c| c[3] != 255).count(), 0);
        }
        let fine = |view: &View| fine(&house.interior, &contents, &house.model, view);
        assert_alike(&pictures, fill.name(), &views, fine);
    }
}

#[test]
fn culling_changes_no_byte_on_the_device() {
    for (rooms, seed) in [(2, 1), (9, 3)] {
        let (house, contents) = small_house(rooms, seed);
        let walk = |whole_cells: bool| {
            let options = WalkOptions {
                whole_cells,
                ..WalkOptions::default()
            };
            let painter = painter(&house.model)?;
            Some(Walk::with(
                painter,
                &house.interior,
                &contents,
                &house.model,
                options,
            ))
        };
        let (Some(mut some), Some(mut whole)) = (walk(false), walk(true)) else {
            return;
        };
        let (mut tried, mut all) = (0, 0);
        for i in 0..40 {
            let (eye, target) = viewpoint(&house.interior, 500 * u64::from(seed) + i);
            let view = view(eye, target, [96, 72]);
            for fill in [PortalFill::Geometry, PortalFill::Warp1] {
                tried += some.draw(&view, fill).unwrap().triangles_tried;
                all += whole.draw(&view, fill).unwrap().triangles_tried;
                assert!(some.picture() == whole.picture(), "{rooms} rooms, {i}");
            }
        }
        assert!(tried < all);
    }
}

/// A square of a checkered, coloured texture, `repeats` times across, with a room around it.
fn textured(wrap: [Wrap; 2], repeats: f32, to_world: impl Fn(DVec3) -> DVec3) -> Model {
    let corners = [(-2.0, -1.5), (2.0, -1.5), (2.0, 1.5), (-2.0, 1.5)];
    let positions = corners.map(|(x, y)| to_world(DVec3::new(x, y, 0.0)));
    let uv = |(x, y): (f64, f64)| [x as f32 * repeats, -y as f32 * repeats];
    let texture = RgbaImage::from_fn(7, 5, |x, y| {
        image::Rgba([
            (37 * x) as u8,
            (50 * y) as u8,
            (90 * (x + y) % 256) as u8,
            255,
        ])
    });
    Model {
        mesh: Mesh {
            positions: positions.to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        },
        uvs: corners.map(uv).to_vec(),
        colors: vec![
            [255; 4],
            [200, 255, 255, 255],
            [255, 120, 255, 255],
            [90, 90, 90, 255],
        ],
        parts: vec![Part {
            triangles: 0..2,
            node_idx: 0,
            material_idx: 0,
        }],
        nodes: vec![ModelNode {
            name: String::new(),
            parent_idx: None,
        }],
        materials: vec![Material {
            base_color: [0.9, 0.8, 1.0],
            texture_idx: Some(0),
            wrap,
        }],
        textures: vec![Texture::new(texture)],
    }
}

#[test]
fn textures_are_the_same_anywhere_and_of_any_size() {
    let rooms = |low: DVec3, high: DVec3| {
        let (low, high) = (low.to_array(), high.to_array());
        let text = format!(
            r#"{{"version": 1, "rooms": [{{"name": "a", "min": {low:?}, "max": {high:?}}}]}}"#
        );
        parse_rooms(Path::new("r.json"), text.as_bytes(), "m.glb")
            .unwrap()
            .0
    };
    for (k, (scale, far)) in [
        (1.0, DVec3::ZERO),
        (1.0, DVec3::new(4e6, -7e5, 300.0)),
        (1e-6, DVec3::ZERO),
        (1e6, DVec3::new(0.0, 1e8, 0.0)),
    ]
    .into_iter()
    .enumerate()
    {
        let to_world = |p: DVec3| scale * p + far;
        let wrap = [
            [Wrap::Repeat, Wrap::Mirror],
            [Wrap::Clamp, Wrap::Repeat],
            [Wrap::Mirror, Wrap::Clamp],
        ][k % 3];
        let model = textured(wrap, 1.3 + 0.2 * k as f32, to_world);
        let interior = rooms(to_world(DVec3::splat(-9.0)), to_world(DVec3::splat(9.0)));
        let (contents, _) = Contents::new(&interior, &model).unwrap();
        let eyes = [
            DVec3::new(0.0, 0.0, 4.0),
            DVec3::new(1.0, 0.5, 0.3),
            // Grazing, and over an edge, so that a corner is behind.
            DVec3::new(-1.9, 0.0, 0.05),
            DVec3::new(0.5, -1.0, -0.4),
        ];
        let views = eyes.map(|eye| {
            let target = DVec3::new(0.3, 0.2, 0.0);
            (
                view(to_world(eye), to_world(target), [120, 90]),
                PortalFill::Geometry,
            )
        });
        let Some(pictures) = both(&interior, &contents, &model, &views) else {
            return;
        };
        let drawn = pictures.iter().flat_map(|p| &p[0].color);
        assert!(drawn.filter(|c| c[3] == 255).count() > 120 * 90);
        let what = format!("scale {scale}, {far}");
        let fine = |view: &View| fine(&interior, &contents, &model, view);
        assert_alike(&pictures, &what, &views, fine);
    }
}

#[test]
fn what_a_device_cannot_draw_the_cpu_draws_and_a_note_says_so() {
    let (house, contents) = small_house(2, 1);
    if painter(&house.model).is_none() {
        return;
    }
    let (eye, target) = viewpoint(&house.interior, 3);
    let view = view(eye, target, [80, 60]);
    let mut by_cpu = Walk::new(
        &house.interior,
        &contents,
        &house.model,
        WalkOptions::default(),
    );
    by_cpu.draw(&view, PortalFill::Geometry).unwrap();
    let within = |side: u32| {
        let limits = DeviceLimits {
            texture_side: Some(side),
            ..DeviceLimits::default()
        };
        let painter = Painter::open_within(DeviceChoice::Gpu, &house.model, &limits);
        let options = WalkOptions::default();
        Walk::with(painter, &house.interior, &contents, &house.model, options)
    };
    // A model that is too large.
    let mut small = within(16);
    assert_eq!(small.painter().description(), "CPU");
    let notes = small.painter().notes().join("");
    assert!(notes.contains("more than a texture holds"), "{notes}");
    small.draw(&view, PortalFill::Geometry).unwrap();
    assert!(small.picture() == by_cpu.picture());
    // A device that is lost.
    let mut lost = within(8192);
    lost.draw(&view, PortalFill::Geometry).unwrap();
    lost.painter_mut().lose();
    lost.draw(&view, PortalFill::Geometry).unwrap();
    let notes = lost.painter().notes().join("");
    assert!(notes.contains("the CPU goes on"), "{notes}");
    assert!(lost.picture() == by_cpu.picture());
    // Nothing at all.
    let empty = Model::default();
    let painter = painter(&empty).unwrap();
    let contents = Contents::default();
    let mut nothing = Walk::with(
        painter,
        &house.interior,
        &contents,
        &empty,
        WalkOptions::default(),
    );
    nothing.draw(&view, PortalFill::Warp2).unwrap();
    assert!(nothing.picture().color.iter().all(|c| *c == [0; 4]));
}
