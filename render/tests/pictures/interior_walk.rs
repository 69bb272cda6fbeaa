//! Walks: reference images, their warp, and what portals are filled with.

use crate::house;

use calibrate::{Lens, Rigid3, View};
use glam::{DVec2, DVec3};
use house::{random, room, small_house, view, viewpoint};
use proxy::interior::{
    CellId, Contents, Interior, PortalId, SemicircleOptions, SemicircleView, parse_rooms,
    semicircles,
};
use proxy::mesh::Model;
use render::interior::{
    CellGeometry, Pinhole, PortalFill, Reference, Splat, Target, Walk, WalkOptions, Warp, Window,
    texture, warp,
};
use render::score::score;
use std::path::Path;

/// A house, and what its semicircles see, some of them.
struct Set {
    house: &'static datasets::house::House,
    references: Vec<Reference>,
}

fn set() -> Set {
    let (house, contents) = small_house(3, 4);
    let geometry = CellGeometry::new(&house.model, &contents);
    let options = SemicircleOptions {
        views: 5,
        ..SemicircleOptions::default()
    };
    let places = semicircles(&house.interior, &contents, &options);
    let make =
        |p: &SemicircleView| Reference::new(&house.interior, &house.model, &geometry, p, [96, 96]);
    let references = places.iter().step_by(3).take(12).map(make).collect();
    Set { house, references }
}

/// The point of the world that a pixel of a reference image shows.
fn point(reference: &Reference, x: u32, y: u32) -> Option<DVec3> {
    let s = f64::from(reference.seen.inverse_depth[(y * reference.seen.width + x) as usize]);
    let camera = &reference.camera;
    let ray = camera.ray(x, y);
    (s > 0.0).then(|| camera.center + camera.rotation.transpose() * (ray / s))
}

#[test]
fn reference_images_show_what_is_beyond_the_portal_and_nothing_else() {
    let set = set();
    for reference in &set.references {
        let place = &reference.place;
        let portal = set.house.interior.portal(place.portal);
        let (mut shown, mut pixels) = (0, 0);
        for y in 0..96 {
            for x in 0..96 {
                let eye = reference.camera.center;
                let ray = reference.camera.rotation.transpose() * reference.camera.ray(x, y);
                let normal = portal.polygon.normal();
                let along = -portal.polygon.height(eye) / normal.dot(ray);
                let foot = eye + along * ray;
                let is_through = along > 0.0 && portal.polygon.covers(foot, 0.0);
                pixels += usize::from(is_through);
                let Some(p) = point(reference, x, y) else {
                    continue;
                };
                shown += 1;
                assert!(portal.polygon.covers(foot, 1e-6), "{place:?}");
                // On the other side of the portal.
                let height = portal.polygon.height(p) * portal.polygon.height(eye);
                assert!(height < 1e-5, "{height}");
                // What a ray from the portal on meets.
                let start = foot + 1e-7 * ray;
                if let Some(hit) = set.house.first_hit(start, ray) {
                    let error = (start + hit.along * ray).distance(p);
                    assert!(error < 1e-4 || hit.along < 1e-5, "{error}");
                }
            }
        }
        // A house is closed. The portal fills the image.
        assert_eq!(shown, pixels);
        assert!(pixels > 96 * 96 / 2, "{pixels}");
    }
}

#[test]
fn samples_land_where_their_points_are_seen() {
    let set = set();
    let (mut worst, mut count) = (0.0_f64, 0);
    for (k, reference) in set.references.iter().enumerate() {
        let mut r = random(k as u64);
        let place = &reference.place;
        let portal = set.house.interior.portal(place.portal);
        for _ in 0..4 {
            let offset = 0.6 * (DVec3::new(r(), r(), r()) - 0.5);
            let desired = view(
                reference.camera.center + offset,
                portal.polygon.center(),
                [320, 240],
            );
            let warp = Warp::new(&reference.camera, &Pinhole::new(&desired).unwrap());
            for y in 0..96 {
                for x in 0..96 {
                    let Some(p) = point(reference, x, y) else {
                        continue;
                    };
                    let i = (y * 96 + x) as usize;
                    let s = f64::from(reference.seen.inverse_depth[i]);
                    let at = warp.at(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5), s);
                    match (at, desired.project(p)) {
                        (Some(at), Some(pixel)) => {
                            let off = at.pixel.distance(DVec2::new(pixel.x, pixel.y));
                            let z = (desired.camera_from_world * p).z;
                            assert!((at.inverse_depth * z - 1.0).abs() < 1e-6);
                            worst = worst.max(off);
                            count += 1;
                        }
                        (None, None) => {}
                        other => panic!("{other:?}"),
                    }
                }
            }
        }
    }
    eprintln!("{count} samples, at most {worst:.1e} px off");
    assert!(count > 100_000 && worst < 0.01, "{worst}");
}

#[test]
fn samples_come_in_an_order_that_needs_no_depths() {
    // As points: what is drawn last must be what is nearest.
    let set = set();
    let (mut wrong, mut oblique, mut all) = (0, 0, 0);
    for (k, reference) in set.references.iter().enumerate() {
        let mut r = random(50 + k as u64);
        let portal = set.house.interior.portal(reference.place.portal);
        let toward = portal.polygon.center() - reference.camera.center;
        // In front of it, behind it, and beside.
        for along in [0.3, -0.3, 0.0] {
            let aside = DVec3::new(r() - 0.5, 0.3 * (r() - 0.5), r() - 0.5);
            let eye = reference.camera.center + along * toward + 0.5 * aside;
            let desired = view(eye, portal.polygon.center(), [200, 150]);
            let camera = Pinhole::new(&desired).unwrap();
            let mut target = Target::new(200, 150);
            let window = Window::whole(200, 150);
            warp(reference, &camera, &window, Splat::Fixed(1), &mut target);
            let mut nearest = vec![0.0_f32; 200 * 150];
            let warp = Warp::new(&reference.camera, &camera);
            for y in 0..96 {
                for x in 0..96 {
                    let s = reference.seen.inverse_depth[(y * 96 + x) as usize];
                    let pixel = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                    let at = match s > 0.0 {
                        true => warp.at(pixel, f64::from(s)),
                        false => None,
                    };
                    let Some(at) = at else { continue };
                    let (u, v) = ((at.pixel.x - 1.0).ceil(), (at.pixel.y - 1.0).ceil());
                    if (0.0..200.0).contains(&u) && (0.0..150.0).contains(&v) {
                        let i = v as usize * 200 + u as usize;
                        nearest[i] = nearest[i].max(at.inverse_depth as f32);
                    }
                }
            }
            for (ours, nearest) in target.inverse_depth.iter().zip(&nearest) {
                assert_eq!(*ours > 0.0, *nearest > 0.0);
                all += usize::from(*nearest > 0.0);
                // Two samples of one oblique surface may share a pixel.
                wrong += usize::from(*ours < 0.9 * nearest);
                oblique += usize::from(*ours < 0.99 * nearest);
            }
        }
    }
    eprintln!("{wrong} ({oblique}) of {all} pixels show what is behind");
    assert!(all > 20_000 && wrong * 1000 < all, "{wrong} of {all}");
}

#[test]
fn at_its_own_camera_a_reference_image_is_itself() {
    let set = set();
    for reference in &set.references {
        let seen = &reference.seen;
        let window = Window::whole(seen.width, seen.height);
        for splat in [Splat::Fixed(1), Splat::Footprint] {
            let mut target = Target::new(seen.width, seen.height);
            warp(reference, &reference.camera, &window, splat, &mut target);
            let same = target.color.iter().zip(&seen.color).filter(|(a, b)| a == b);
            let share = same.count() as f64 / seen.color.len() as f64;
            // Splats reach a little over their pixel's sides.
            assert!(
                share
                    > if splat == Splat::Fixed(1) {
                        0.9999
                    } else {
                        0.97
                    },
                "{share}"
            );
        }
    }
}

fn walk_of<'a>(house: &'a datasets::house::House, contents: &'a Contents) -> Walk<'a> {
    Walk::new(
        &house.interior,
        contents,
        &house.model,
        WalkOptions::default(),
    )
}

/// Before a portal, at an angle, two widths off, looking at it.
fn before(
    interior: &Interior,
    contents: &Contents,
    place: &SemicircleView,
    angle: f64,
    size: [u32; 2],
) -> View {
    let portal = interior.portal(place.portal);
    let center = portal.polygon.center();
    let options = SemicircleOptions {
        views: 3,
        span: 2.0 * angle.abs().max(1e-3),
    };
    let mut wide = interior.clone();
    wide.portals[place.portal.0 as usize].radius = Some(2.0 * portal.width(interior.up));
    let all = semicircles(&wide, contents, &options);
    let is_meant = |s: &&SemicircleView| {
        (s.portal, s.from) == (place.portal, place.from) && (s.angle - angle).abs() < 1e-2
    };
    let found = all.iter().find(is_meant).expect("it is there");
    view(found.camera_from_world.center(), center, size)
}

#[test]
fn what_images_show_is_close_to_what_is_there() {
    let (house, contents) = small_house(4, 2);
    let mut walk = walk_of(house, &contents);
    let places = semicircles(
        &house.interior,
        &contents,
        &SemicircleOptions {
            views: 1,
            span: 1.0,
        },
    );
    let mut sums = [[0.0; 3]; PortalFill::ALL.len()];
    let mut count = 0.0;
    for place in places.iter().filter(|p| p.is_inside).take(6) {
        for angle in [0.0, 0.1, 0.6] {
            let desired = before(&house.interior, &contents, place, angle, [160, 128]);
            let Some(cell) = contents.locate(&house.interior, desired.center()) else {
                continue;
            };
            if Some(cell) != place.from {
                continue;
            }
            let (truth, _) = datasets::house::render(house, &desired);
            count += 1.0;
            for (k, fill) in PortalFill::ALL.into_iter().enumerate() {
                let cost = walk.draw(&desired, fill).unwrap();
                let picture = walk.picture().picture();
                let psnr = score(&picture, &truth).unwrap().psnr.min(60.0);
                sums[k][0] += psnr;
                sums[k][1] += cost.holes as f64 / (160.0 * 128.0);
                sums[k][2] += cost.filled as f64;
            }
        }
    }
    let mean = sums.map(|s| s.map(|v| v / count));
    for (fill, [psnr, holes, filled]) in PortalFill::ALL.iter().zip(mean) {
        let name = fill.name();
        eprintln!(
            "{name}: {psnr:.2} dB, {:.3} % holes, {filled:.2} portals",
            100.0 * holes
        );
    }
    assert!(count >= 8.0);
    let [geometry, texture, warp1, warp2, ldi] = mean;
    assert_eq!([geometry[0], geometry[1], geometry[2]], [60.0, 0.0, 0.0]);
    assert!(texture[0] > 15.0 && warp1[0] > 15.0 && warp2[0] > texture[0] + 2.0);
    assert!(warp1[1] < 0.06 && warp2[1] <= warp1[1]);
    assert!(ldi[0] > warp1[0].max(warp2[0]) && ldi[1] <= warp2[1]);
    assert!(texture[2] >= 1.0);
}

#[test]
fn columns_out_of_sight_are_missed_by_no_pixel() {
    let (house, contents) = small_house(5, 4);
    let mut walk = walk_of(house, &contents);
    let options = WalkOptions {
        whole_ldis: true,
        ..WalkOptions::default()
    };
    let mut whole = Walk::new(&house.interior, &contents, &house.model, options);
    let mut clipped = 0;
    for seed in 1..25 {
        let (eye, target) = viewpoint(&house.interior, seed);
        let desired = view(eye, target, [96, 72]);
        let some = walk.draw(&desired, PortalFill::Ldi).unwrap();
        let all = whole.draw(&desired, PortalFill::Ldi).unwrap();
        assert!(walk.picture() == whole.picture(), "{seed}");
        assert_eq!((all.samples_clipped, all.samples), (0, some.samples));
        clipped += some.samples_clipped;
    }
    assert!(clipped > 0);
}

#[test]
fn whole_cells_make_the_same_pictures() {
    let (house, contents) = small_house(4, 5);
    let mut walk = walk_of(house, &contents);
    let options = WalkOptions {
        whole_cells: true,
        ..WalkOptions::default()
    };
    let mut whole = Walk::new(&house.interior, &contents, &house.model, options);
    for seed in 1..20 {
        let (eye, target) = viewpoint(&house.interior, seed);
        let desired = view(eye, target, [80, 60]);
        for fill in [PortalFill::Geometry, PortalFill::Texture] {
            let some = walk.draw(&desired, fill).unwrap();
            let all = whole.draw(&desired, fill).unwrap();
            assert!(walk.picture() == whole.picture(), "{seed} {}", fill.name());
            assert_eq!(all.triangles_tried, all.triangles_in_cells);
            assert!(some.triangles_tried < all.triangles_tried);
        }
    }
}

#[test]
fn near_a_portal_there_is_no_difference() {
    let (house, contents) = small_house(3, 1);
    let mut walk = walk_of(house, &contents);
    for portal in &house.interior.portals {
        for off in [0.9, 1e-3, 1e-9, 0.0, -1e-3, -0.9] {
            // One portal alone in sight: look through it, from its middle or from near it.
            let width = portal.width(DVec3::Y);
            let normal = portal.polygon.normal();
            let eye = portal.polygon.center() + off * width * normal;
            let ahead = if off > 0.0 { -normal } else { normal };
            let desired = view(eye, eye + ahead, [80, 60]);
            walk.draw(&desired, PortalFill::Geometry).unwrap();
            let truth = walk.picture().clone();
            for fill in [PortalFill::Texture, PortalFill::Warp2] {
                let cost = walk.draw(&desired, fill).unwrap();
                if cost.filled == 0 {
                    assert!(*walk.picture() == truth, "{} {off}", portal.name);
                }
            }
        }
    }
}

#[test]
fn nothing_pops_as_one_comes_nearer() {
    // Neither where images begin to be mixed in nor where they are all.
    let (house, contents) = small_house(2, 1);
    let mut walk = walk_of(house, &contents);
    let (id, portal) = (0..)
        .map(PortalId)
        .zip(&house.interior.portals)
        .next()
        .unwrap();
    let width = portal.width(DVec3::Y);
    let normal = portal.polygon.normal();
    for at in [1.0, 1.5] {
        let picture = |walk: &mut Walk<'_>, off: f64| {
            let eye = portal.polygon.center() + off * width * normal;
            let desired = view(eye, eye - normal, [80, 60]);
            walk.draw(&desired, PortalFill::Warp1).unwrap();
            walk.picture().picture()
        };
        let [a, b] = [at - 1e-6, at + 1e-6].map(|off| picture(&mut walk, off));
        // But for the last pixels of edges, which move on.
        let is_changed = |(p, q): &(&image::Rgba<u8>, &image::Rgba<u8>)| {
            let seen = |p: &image::Rgba<u8>, k: usize| u32::from(p.0[k]) * u32::from(p.0[3]) / 255;
            (0..3).any(|k| seen(p, k).abs_diff(seen(q, k)) > 1)
        };
        let changed = a.pixels().zip(b.pixels()).filter(is_changed).count();
        eprintln!("{changed} pixels change at {at} widths");
        assert!(changed <= 4, "portal {id:?} at {at} widths: {changed}");
    }
}

#[test]
fn holes_are_what_is_transparent_also_where_geometry_is_mixed_in() {
    let (house, contents) = small_house(2, 1);
    // Few samples, a pixel each.
    let mut options = WalkOptions {
        splat: Splat::Fixed(1),
        ..WalkOptions::default()
    };
    options.library.size = [8, 8];
    let mut walk = Walk::new(&house.interior, &contents, &house.model, options);
    let portal = &house.interior.portals[0];
    let away = portal.width(DVec3::Y) * portal.polygon.normal();
    // From 1.25 widths on images are mixed in, from 1.5 on they are alone.
    let mut before = 0;
    for off in [1.1, 1.3, 1.4, 1.499, 1.6] {
        let eye = portal.polygon.center() + off * away;
        let desired = view(eye, eye - away, [80, 60]);
        let holes = walk.draw(&desired, PortalFill::Warp1).unwrap().holes;
        let open = |color: &[u8; 4]| f64::from(255 - color[3]) / 255.0;
        let open: f64 = walk.picture().color.iter().map(open).sum();
        eprintln!("{off}: {holes} holes, {open:.1} pixels transparent");
        // Alpha is rounded.
        assert!((holes as f64 - open).abs() < 12.0, "{off}: {holes}, {open}");
        assert!(holes > before || off < 1.25, "{off}: {holes}");
        before = holes;
    }
    assert!(before > 2000, "{before}");
}

#[test]
fn frames_do_not_depend_on_threads_or_on_what_was_drawn_before() {
    let (house, contents) = small_house(4, 3);
    let mut first = walk_of(house, &contents);
    let mut other = walk_of(house, &contents);
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let seeds: Vec<u64> = (1..10).collect();
    let desired = |seed: u64| {
        let (eye, target) = viewpoint(&house.interior, seed);
        view(eye, target, [96, 72])
    };
    for fill in PortalFill::ALL {
        let draw = |walk: &mut Walk<'_>, seed: u64| {
            walk.draw(&desired(seed), fill).unwrap();
            walk.picture().clone()
        };
        let there: Vec<Target> = seeds.iter().map(|s| draw(&mut first, *s)).collect();
        for (i, seed) in seeds.iter().enumerate().rev() {
            let mut again = Target::default();
            one.install(|| again = draw(&mut other, *seed));
            assert!(again == there[i], "{} {seed}", fill.name());
        }
    }
}

#[test]
fn whatever_the_place_there_is_a_picture() {
    let (house, contents) = small_house(3, 2);
    let interior = &house.interior;
    let mut walk = walk_of(house, &contents);
    let mut eyes: Vec<(DVec3, DVec3)> = (0..40).map(|s| viewpoint(interior, 8 * s)).collect();
    for portal in &interior.portals {
        // Edge on, on its corner and its side.
        let polygon = &portal.polygon;
        let [a, b] = [polygon.corners()[0], polygon.corners()[1]];
        let room = room(interior, portal.cells[0].unwrap().0 as usize);
        let inside = room.min.midpoint(room.max);
        let edge_on = inside - polygon.height(inside) * polygon.normal();
        for eye in [a, a.midpoint(b), edge_on, edge_on + 1e-9 * polygon.normal()] {
            eyes.push((eye, polygon.center()));
            eyes.push((eye, eye + polygon.normal()));
        }
    }
    // Outside of everything.
    eyes.push((DVec3::splat(-50.0), DVec3::ZERO));
    eyes.push((DVec3::new(3.0, 900.0, 3.0), DVec3::ZERO));
    for (eye, target) in eyes {
        let desired = view(eye, target, [40, 30]);
        for fill in PortalFill::ALL {
            let cost = walk.draw(&desired, fill).unwrap();
            assert_eq!(walk.picture().color.len(), 1200);
            assert!(walk.picture().inverse_depth.iter().all(|s| s.is_finite()));
            assert!(cost.holes <= 1200);
        }
    }
    let bad = View {
        lens: Lens::pinhole(DVec2::splat(f64::NAN), DVec2::ZERO),
        width: 4,
        height: 4,
        camera_from_world: Rigid3::IDENTITY,
    };
    assert!(walk.draw(&bad, PortalFill::Warp1).is_err());
}

#[test]
fn an_empty_model_and_cells_without_portals_are_no_trouble() {
    let text = r#"{"version": 1, "rooms": [
        {"name": "a", "min": [0, 0, 0], "max": [2, 2, 2]},
        {"name": "b", "min": [2, 0, 0], "max": [4, 2, 2]},
        {"name": "c", "min": [9, 0, 0], "max": [11, 2, 2]}],
        "openings": [{"name": "1", "between": ["a", "b"],
            "polygon": [[2, 0, 0.5], [2, 0, 1.5], [2, 2, 1.5], [2, 2, 0.5]]}]}"#;
    let (interior, _) = parse_rooms(Path::new("r.json"), text.as_bytes(), "m.glb").unwrap();
    let model = Model::default();
    let (contents, _) = Contents::new(&interior, &model).unwrap();
    let mut walk = Walk::new(&interior, &contents, &model, WalkOptions::default());
    for x in [0.1, 1.0, 2.0, 3.0, 10.0, 50.0] {
        let desired = view(DVec3::new(x, 1.0, 1.0), DVec3::new(2.5, 1.0, 1.2), [32, 24]);
        for fill in PortalFill::ALL {
            walk.draw(&desired, fill).unwrap();
            assert!(walk.picture().color.iter().all(|c| c[3] == 0));
        }
    }
    let cost = walk
        .draw(
            &view(DVec3::new(10.0, 1.0, 1.0), DVec3::ZERO, [8, 8]),
            PortalFill::Warp1,
        )
        .unwrap();
    assert_eq!((cost.cell, cost.portals), (Some(CellId(2)), 0));
}

#[test]
fn a_texture_is_right_where_it_was_made() {
    let (house, contents) = small_house(2, 1);
    let geometry = CellGeometry::new(&house.model, &contents);
    let places = semicircles(
        &house.interior,
        &contents,
        &SemicircleOptions {
            views: 1,
            span: 1.0,
        },
    );
    let reference = Reference::new(
        &house.interior,
        &house.model,
        &geometry,
        &places[0],
        [64, 64],
    );
    let portal = house.interior.portal(places[0].portal);
    let camera = &reference.camera;
    let away = -portal.polygon.height(camera.center).signum() * portal.polygon.normal();
    let plane = render::interior::Beyond::new(camera, portal.polygon.center(), away);
    let mut target = Target::new(64, 64);
    let drawn = texture(
        &reference,
        &plane,
        camera,
        &Window::whole(64, 64),
        &mut target,
    );
    assert!(drawn > 2500, "{drawn}");
    for (ours, theirs) in target.color.iter().zip(&reference.seen.color) {
        assert!(theirs[3] == 0 || ours == theirs);
    }
}
