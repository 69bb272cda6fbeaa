//! The proxy made of sparse points for every view.

use crate::common;

use calibrate::{ImageId, View};
use common::{Shot, assert_close, gpu, psnr, psnr_covered, unmoved};
use glam::{DQuat, DVec3};
use image::RgbaImage;
use proxy::{Mesh, MeshKind, Proxy, Solid, SparsePoint};
use render::{FieldOptions, Frame, Lumigraph, Method, PhotoStore, Surface, cpu, reference};
use std::collections::BTreeSet;
use std::sync::Arc;

const METHODS: [Method; 2] = [Method::Exact, Method::TRIANGULATED];

/// The sparse points, with the source views of the shot that observe them.
fn points(shot: &Shot) -> Vec<SparsePoint> {
    let model = &shot.dataset.reconstruction;
    let source_of = |id: &ImageId| {
        let name = &model.images[id].name;
        shot.dataset.photos.iter().position(|p| p.name == *name)
    };
    let points = model.points.values().map(|point| {
        let seen: BTreeSet<u32> = point
            .track
            .iter()
            .filter_map(|(id, _)| Some(source_of(id)? as u32))
            .collect();
        SparsePoint {
            position: point.position,
            seen_by: seen.into_iter().collect(),
        }
    });
    points.collect()
}

pub(crate) fn lumigraph(shot: &Shot) -> Lumigraph {
    Lumigraph {
        proxy: Proxy::Points { within: None },
        points: points(shot),
        ..shot.lumigraph()
    }
}

fn pictures(frame: &Frame<'_>, method: Method) -> Vec<(&'static str, RgbaImage)> {
    let mut pictures = vec![("cpu", cpu::render(frame, method).unwrap())];
    if let Some(mut gpu) = gpu() {
        pictures.push(("gpu", gpu.render(frame, method).unwrap()));
    }
    pictures
}

fn desired_views(shot: &Shot) -> Vec<(&'static str, View)> {
    let middle = shot.views[0].between(&shot.views[5], 0.45);
    let lens = calibrate::Lens::new(
        glam::DVec2::new(95.0, 96.0),
        glam::DVec2::new(81.0, 59.5),
        calibrate::Distortion::Fisheye {
            k: [0.02, -0.01, 0.002, 0.0],
        },
    );
    let nearer = calibrate::Rigid3::new(DQuat::IDENTITY, 0.2 * DVec3::NEG_Z);
    let near = View {
        camera_from_world: nearer * middle.camera_from_world,
        ..middle.clone()
    };
    let fisheye = View {
        lens,
        ..middle.clone()
    };
    vec![("between", middle), ("nearer", near), ("fisheye", fisheye)]
}

#[test]
fn every_engine_draws_the_same_picture() {
    let shot = Shot::of("shelf", 9, None);
    let lumigraph = lumigraph(&shot);
    for (name, desired) in desired_views(&shot) {
        let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
        assert!(matches!(frame.surface, Surface::Facets(_)), "{name}");
        let truth = reference::render_exact(&frame).unwrap();
        for (engine, picture) in pictures(&frame, Method::Exact) {
            assert_close(&picture, &truth, &format!("{name}, {engine}"));
        }
        for (engine, picture) in pictures(&frame, Method::TRIANGULATED) {
            let holes = picture.pixels().zip(truth.pixels());
            let holes = holes.filter(|(p, t)| p.0[3] != t.0[3]).count();
            assert!(
                holes * 500 <= (160 * 120),
                "{name}, {engine}: {holes} holes"
            );
            let db = psnr(&unmoved(&frame, &picture), &unmoved(&frame, &truth));
            println!("{name}, {engine}, triangulated against exact: {db:.1} dB");
            assert!(db >= 50.0, "{name}, {engine}: {db} dB");
        }
    }
}

/// A box as a hull: what rays meet of it is held against the box itself.
#[test]
fn what_is_made_of_points_stays_within_the_hull() {
    let shot = Shot::of("shelf", 9, None);
    let free = lumigraph(&shot);
    let (_, between) = desired_views(&shot).swap_remove(0);
    let seen: Vec<DVec3> = {
        let frame = Frame::new(&free, between.clone(), FieldOptions::default());
        let pixels = (30..130).map(|x| calibrate::Pixel::center_of(x, 60));
        let point = |pixel| Some(in_world(&frame, &frame.proxy_point(pixel)?));
        pixels.filter_map(point).collect()
    };
    // Around some of what is in the middle, so that much is before it, behind it and beside it.
    let middle = seen.iter().sum::<DVec3>() / seen.len() as f64;
    let half = 0.2 * middle.distance(between.center()) * DVec3::new(1.0, 1.0, 0.3);
    let hull = Arc::new(Solid::new(MeshKind::Hull, box_around(middle, half)));
    let lumigraph = Lumigraph {
        proxy: Proxy::Points { within: Some(hull) },
        ..lumigraph(&shot)
    };
    for (name, desired) in desired_views(&shot) {
        let frame = Frame::new(&lumigraph, desired.clone(), FieldOptions::default());
        let unbounded = Frame::new(&free, desired.clone(), FieldOptions::default());
        let world_from_camera = desired.camera_from_world.rotation.conjugate();
        let Surface::Facets(map) = &frame.surface else {
            panic!("{name}");
        };
        let moved: Vec<bool> = map.moved().collect();
        // By whether the box was missed, the point was within, or was brought to its side.
        let mut counts = [0; 3];
        for i in 0..160 * 120 {
            let pixel = calibrate::Pixel::center_of(i % 160, i / 160);
            if moved[i as usize] {
                continue;
            }
            let ray = world_from_camera * desired.lens.unproject(pixel).unwrap();
            let range = through_box(desired.center() - middle, ray, half);
            let Some(point) = frame.proxy_point(pixel) else {
                assert!(
                    range.is_none_or(|[from, to]| to - from < 1e-6),
                    "{name} {pixel:?}"
                );
                counts[0] += 1;
                continue;
            };
            let [from, to] = range.unwrap_or_else(|| panic!("{name}: {pixel:?} misses the box"));
            let along = point.inverse_distance.recip();
            assert!(along > from - 1e-6 && along < to + 1e-6, "{name} {pixel:?}");
            let own = unbounded
                .proxy_point(pixel)
                .unwrap()
                .inverse_distance
                .recip();
            let expected = own.clamp(from, to);
            assert!(
                (along - expected).abs() < 1e-6 * to,
                "{name} {pixel:?}: {along} {expected}"
            );
            counts[1 + usize::from(along != own)] += 1;
        }
        assert!(
            counts.iter().all(|&count| count > 200),
            "{name}: {counts:?}"
        );
        let truth = reference::render_exact(&frame).unwrap();
        for (engine, picture) in pictures(&frame, Method::Exact) {
            assert_close(&picture, &truth, &format!("{name}, {engine}"));
        }
    }
}

fn in_world(frame: &Frame<'_>, point: &render::ProxyPoint) -> DVec3 {
    let rotation = frame.desired.camera_from_world.rotation.conjugate();
    frame.desired.center() + rotation * point.ray / point.inverse_distance
}

/// From where to where a ray is in a box around the origin.
fn through_box(from: DVec3, ray: DVec3, half: DVec3) -> Option<[f64; 2]> {
    let (a, b) = ((-half - from) / ray, (half - from) / ray);
    let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
    (near < far && far > 0.0).then_some([near, far])
}

fn box_around(middle: DVec3, half: DVec3) -> Mesh {
    let corner = |i: u32| {
        let side = |bit: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        middle + half * DVec3::new(side(0), side(1), side(2))
    };
    let faces = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    Mesh {
        positions: (0..8).map(corner).collect(),
        triangles: faces
            .into_iter()
            .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect(),
    }
}

/// Where a sliver of the view lies beyond all photos, a few pixels are moved into some photo's
/// border, and lie between all points that a triangle asks about.
#[test]
fn slivers_beyond_all_photos_are_painted_by_the_triangulated_field_too() {
    let shot = Shot::of("shelf", 4, None);
    let lumigraph = lumigraph(&shot);
    let middle = shot.views[0].between(&shot.views[3], 0.45);
    let mut moved = 0;
    for step in 0..24 {
        let angle = 0.02 * f64::from(step);
        let turned = DQuat::from_rotation_x(angle) * DQuat::from_rotation_z(0.5 * angle);
        let desired = View {
            camera_from_world: calibrate::Rigid3::new(turned, DVec3::ZERO)
                * middle.camera_from_world,
            ..middle.clone()
        };
        let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
        if let Surface::Facets(map) = &frame.surface {
            moved += usize::from(map.moved().any(|moved| moved));
        }
        let [exact, triangulated] = METHODS.map(|m| cpu::render(&frame, m).unwrap());
        let holes = exact.pixels().zip(triangulated.pixels());
        let holes = holes.filter(|(e, t)| e.0[3] > 0 && t.0[3] == 0).count();
        assert_eq!(holes, 0, "{angle}");
    }
    assert!(moved > 5, "{moved}");
}

/// What is moved ends near some photo's border, where rounding must not take it out again.
#[test]
fn what_is_moved_into_a_photo_is_painted_by_every_engine() {
    let shot = Shot::of("shelf", 4, None);
    let lumigraph = lumigraph(&shot);
    let middle = shot.views[0].between(&shot.views[3], 0.45);
    let distance = lumigraph.points[0].position.distance(middle.center());
    let (mut count, mut holes) = (0, Vec::new());
    for step in 0..16 {
        // From farther back than all photos more is seen of what surrounds the shelf.
        let angle = 0.4 * f64::from(step);
        let back = 0.4 + 0.01 * f64::from(step);
        let place = DVec3::new(0.1 * angle.cos(), 0.1 * angle.sin(), back) * distance;
        let turned = DQuat::from_rotation_z(0.03 * f64::from(step));
        let desired = View {
            camera_from_world: calibrate::Rigid3::new(turned, place) * middle.camera_from_world,
            ..middle.clone()
        };
        let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
        let Surface::Facets(map) = &frame.surface else {
            panic!("{step}");
        };
        let moved: Vec<bool> = map.moved().collect();
        count += moved.iter().filter(|moved| **moved).count();
        let truth = reference::render_exact(&frame).unwrap();
        for (engine, picture) in pictures(&frame, Method::Exact) {
            let both = picture.pixels().zip(truth.pixels());
            for (i, (painted, expected)) in both.enumerate().filter(|(i, _)| moved[*i]) {
                if painted.0[3] == 0 && expected.0[3] > 0 {
                    holes.push((engine, step, i));
                }
            }
        }
    }
    assert!(count > 3_000, "{count}");
    assert!(holes.is_empty(), "{holes:?}");
}

#[test]
fn a_view_at_a_photos_own_pose_gives_that_photo_back() {
    let shot = Shot::of("shelf", 9, None);
    let lumigraph = lumigraph(&shot);
    for i in [0, 4, 7] {
        let frame = Frame::new(&lumigraph, shot.views[i].clone(), FieldOptions::default());
        for method in METHODS {
            for (engine, picture) in pictures(&frame, method) {
                assert!(picture.pixels().all(|p| p.0[3] == 255), "{i}, {engine}");
                let db = psnr_covered(&picture, &shot.photos[i]);
                assert!(db >= 50.0, "{i}, {engine}, {method:?}: {db} dB");
            }
        }
    }
}

#[test]
fn it_shows_what_no_plane_can() {
    let shot = Shot::of("shelf", 9, None);
    let desired = shot.views[0].between(&shot.views[5], 0.45);
    let truth = datasets::render_view(&shot.dataset.scene, &desired, 2);
    let score = |lumigraph: &Lumigraph| {
        let frame = Frame::new(lumigraph, desired.clone(), FieldOptions::default());
        psnr(&cpu::render(&frame, Method::Exact).unwrap(), &truth)
    };
    let (plane, points) = (score(&shot.lumigraph()), score(&lumigraph(&shot)));
    println!("plane {plane:.2} dB, points {points:.2} dB");
    // The shelf suits the plane: most of it is a back wall.
    assert!(points > plane + 0.5, "{points} dB, {plane} dB");
}

#[test]
fn neither_the_worlds_place_nor_any_order_matters() {
    let shot = Shot::of("shelf", 9, None);
    let before = lumigraph(&shot);
    let desired = shot.views[0].between(&shot.views[5], 0.45);
    let render = |lumigraph: &Lumigraph, desired: &View| {
        let frame = Frame::new(lumigraph, desired.clone(), FieldOptions::default());
        cpu::render(&frame, Method::Exact).unwrap()
    };
    let picture = render(&before, &desired);

    // 1. A world turned, made larger, and far away.
    let rotation = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 2.0);
    let place = |p: DVec3| rotation * (p * 1e3) + DVec3::new(4e5, -5e6, 3e3);
    let moved_view = |view: &View| {
        let turned = view.camera_from_world.rotation * rotation.conjugate();
        View {
            camera_from_world: calibrate::Rigid3::new(turned, -(turned * place(view.center()))),
            ..view.clone()
        }
    };
    let mut moved = lumigraph(&shot);
    moved
        .points
        .iter_mut()
        .for_each(|p| p.position = place(p.position));
    moved
        .sources
        .iter_mut()
        .for_each(|s| s.view = moved_view(&s.view));
    assert_close(&render(&moved, &moved_view(&desired)), &picture, "moved");

    // 2. Photos and points in the opposite order.
    let count = shot.views.len() as u32;
    let mut reversed = lumigraph(&shot);
    reversed.sources.reverse();
    reversed.photos = PhotoStore::from_images(shot.photos.iter().rev().cloned().collect());
    reversed.points.reverse();
    for point in &mut reversed.points {
        point.seen_by.iter_mut().for_each(|i| *i = count - 1 - *i);
    }
    assert_close(&render(&reversed, &desired), &picture, "reversed");
}
