//! What nobody knows, drawn softly.

use crate::{common, mesh, points};

use calibrate::{Distortion, Lens, Rigid3, View};
use common::{Shot, assert_close, by_reference, psnr, unmoved};
use glam::{DQuat, DVec2, DVec3};
use image::RgbaImage;
use mesh::meshed;
use points::lumigraph;
use proxy::MeshKind;
use render::{
    DeviceChoice, Engine, FieldOptions, Frame, Lumigraph, Method, Prepared, Softened, Surface, cpu,
    soften,
};
use std::f64::consts::{PI, TAU};

/// From farther back than all photos, and aside.
fn desired_views(shot: &Shot, lumigraph: &Lumigraph) -> Vec<View> {
    let middle = shot.views[0].between(&shot.views[3], 0.45);
    let distance = lumigraph.points[0].position.distance(middle.center());
    let view = |step: i32| {
        let angle = 0.4 * f64::from(step);
        let place = DVec3::new(0.1 * angle.cos(), 0.1 * angle.sin(), 0.4) * distance;
        let turned = DQuat::from_rotation_z(0.03 * f64::from(step));
        View {
            camera_from_world: Rigid3::new(turned, place) * middle.camera_from_world,
            ..middle.clone()
        }
    };
    (0..12).step_by(3).map(view).collect()
}

fn frame<'a>(lumigraph: &'a Lumigraph, desired: &View) -> Frame<'a> {
    Frame::new(lumigraph, desired.clone(), FieldOptions::default())
}

fn moved(frame: &Frame<'_>) -> Vec<bool> {
    match &frame.surface {
        Surface::Facets(map) => map.moved().collect(),
        _ => panic!("points are facets"),
    }
}

/// The picture as it is drawn, and with soft guesses; how many there are.
fn drawn(frame: &Frame<'_>) -> (RgbaImage, RgbaImage, usize) {
    let sharp = cpu::render(frame, Method::Exact).unwrap();
    let mut soft = sharp.clone();
    let count = soften(frame, None, &mut soft);
    assert_eq!(count.contradicted, 0);
    (sharp, soft, count.guessed)
}

#[test]
fn soft_guesses_are_nearer_to_the_truth_and_all_else_stays() {
    let shot = Shot::of("shelf", 4, None);
    let lumigraph = lumigraph(&shot);
    let scene = shot.dataset.scene_of(&shot.dataset.photos[0]);
    for (i, desired) in desired_views(&shot, &lumigraph).into_iter().enumerate() {
        let frame = frame(&lumigraph, &desired);
        let moved = moved(&frame);
        let (sharp, soft, count) = drawn(&frame);
        assert_eq!(count, moved.iter().filter(|is_moved| **is_moved).count());
        assert!(count > 300, "{i}: {count}");
        let truth = datasets::render_view(&scene, &desired, 2);
        let mut off = [0.0; 2];
        for (k, is_moved) in moved.into_iter().enumerate() {
            let (x, y) = (k as u32 % sharp.width(), k as u32 / sharp.width());
            let [sharp, soft, truth] = [&sharp, &soft, &truth].map(|p| p.get_pixel(x, y).0);
            assert_eq!(sharp[3], soft[3], "{i}: {x}, {y}");
            assert!(is_moved || sharp == soft, "{i}: {x}, {y}");
            if is_moved {
                for (off, drawn) in off.iter_mut().zip([sharp, soft]) {
                    let step = |c: usize| f64::from(drawn[c]) - f64::from(truth[c]);
                    *off += (0..3).map(|c| step(c).powi(2)).sum::<f64>();
                }
            }
        }
        println!("{i}: {count} guesses, {:.3}", off[1] / off[0]);
        assert!(off[1] < 0.95 * off[0], "{i}: {off:?}");
    }
}

/// How soft a guess is follows what is to be seen, not the pixels.
#[test]
fn guesses_are_as_soft_in_larger_pictures() {
    let shot = Shot::of("shelf", 4, None);
    let lumigraph = lumigraph(&shot);
    let desired = &desired_views(&shot, &lumigraph)[1];
    let (_, small, _) = drawn(&frame(&lumigraph, desired));
    let (width, height) = (desired.width, desired.height);
    let large = frame(&lumigraph, &desired.resized(3 * width, 3 * height));
    let (sharp, soft, _) = drawn(&large);
    let reduced = |picture: &RgbaImage| {
        RgbaImage::from_fn(width, height, |x, y| {
            let mut sum = [0_u32; 4];
            for k in 0..9 {
                let pixel = picture.get_pixel(3 * x + k % 3, 3 * y + k / 3).0;
                (0..4).for_each(|c| sum[c] += u32::from(pixel[c]));
            }
            image::Rgba(sum.map(|sum| ((sum + 4) / 9) as u8))
        })
    };
    let [sharp, soft] = [&sharp, &soft].map(|large| psnr(&reduced(large), &small));
    println!("{sharp:.1}, {soft:.1} dB");
    assert!(soft > sharp, "{sharp} {soft}");
}

#[test]
fn a_view_at_a_photos_own_pose_has_no_guesses() {
    let shot = Shot::of("shelf", 4, None);
    let lumigraph = lumigraph(&shot);
    for view in &shot.views {
        let (sharp, soft, count) = drawn(&frame(&lumigraph, view));
        assert_eq!((count, soft), (0, sharp));
    }
}

/// Around what hides something the photo's own distance map may hide its rim from it, too.
#[test]
fn nor_has_one_of_what_hides_a_part_of_itself() {
    // What is beside the pillar for one is behind it for the other.
    let lumigraph = mesh::lumigraph_of_few(mesh::pillar(), MeshKind::Mesh, 2);
    let mut moved_anywhere = 0;
    for source in &lumigraph.sources {
        let frame = frame(&lumigraph, &source.view);
        moved_anywhere += moved(&frame).iter().filter(|is_moved| **is_moved).count();
        let (sharp, soft, count) = drawn(&frame);
        assert_eq!((count, soft), (0, sharp), "{}", source.name);
        // A little aside, what is moved little is a guess by little.
        let mut beside = source.view.clone();
        beside.camera_from_world.translation.x += 1e-6;
        let beside = self::frame(&lumigraph, &beside);
        let (sharp, soft, _) = drawn(&beside);
        assert_close(&soft, &sharp, &source.name);
    }
    assert!(moved_anywhere > 0);
}

/// What an engine makes of a picture.
fn softened(by: DeviceChoice, frame: &Frame<'_>, mut picture: RgbaImage) -> (RgbaImage, Softened) {
    let prepared = Prepared::new(frame, Method::TRIANGULATED).unwrap();
    let mut engine = Engine::open(by).unwrap();
    let count = engine.soften(frame, &prepared, &mut picture).unwrap();
    (picture, count)
}

/// A wall whose proxy is so much nearer to the photos as it is far, and reaches as many times as far to all sides.
fn wall(shot: &Shot, nearer: f64, reach: f64) -> Lumigraph {
    let (point, center) = (shot.plane.point(), shot.views[0].center());
    let off = shot.plane.normal() * (center - point).dot(shot.plane.normal());
    meshed(shot, point + nearer * off, reach * off.length())
}

#[test]
fn what_photos_contradict_each_other_of_is_drawn_softly() {
    let shot = Shot::of("wall", 6, None);
    let scene = shot.dataset.scene_of(&shot.dataset.photos[0]);
    let desired = shot.views[0].between(&shot.views[3], 0.4);
    let truth = datasets::render_view(&scene, &desired, 2);
    // Where they agree, all stays.
    let right = wall(&shot, 0.0, 20.0);
    let right = frame(&right, &desired);
    let sharp = cpu::render(&right, Method::TRIANGULATED).unwrap();
    let (soft, count) = softened(DeviceChoice::Cpu, &right, sharp.clone());
    assert_eq!(count.contradicted, 0);
    assert!(unmoved(&right, &soft) == unmoved(&right, &sharp));
    // Of another place they show different things.
    let wrong = wall(&shot, 0.4, 20.0);
    let wrong = frame(&wrong, &desired);
    let sharp = cpu::render(&wrong, Method::TRIANGULATED).unwrap();
    let (soft, count) = softened(DeviceChoice::Cpu, &wrong, sharp.clone());
    let of = psnr(&sharp, &truth);
    let with = psnr(&soft, &truth);
    println!("{count:?}: {of:.2}, {with:.2} dB");
    assert!(count.contradicted > 1000, "{count:?}");
    assert!(with > of + 0.05, "{of} {with}");
    let alpha = |picture: &RgbaImage| picture.pixels().map(|p| p.0[3]).collect::<Vec<u8>>();
    assert_eq!(alpha(&sharp), alpha(&soft));
    // The specification finds the same.
    let sharp = by_reference(&wrong, Method::TRIANGULATED).unwrap();
    let (by_reference, _) = softened(DeviceChoice::Reference, &wrong, sharp);
    assert_close(&soft, &by_reference, "reference");
}

#[test]
fn photos_in_another_light_are_no_contradiction() {
    let mut shot = Shot::of("wall", 6, None);
    // Every other one is darker.
    for photo in shot.photos.iter_mut().step_by(2) {
        for pixel in photo.pixels_mut() {
            let [r, g, b, alpha] = pixel.0;
            let [r, g, b] = [r, g, b].map(|color| (0.6 * f32::from(color)).round() as u8);
            pixel.0 = [r, g, b, alpha];
        }
    }
    let desired = shot.views[0].between(&shot.views[3], 0.4);
    for (nearer, least, most) in [(0.0, 0, 0), (0.4, 1000, 160 * 120)] {
        let lumigraph = wall(&shot, nearer, 20.0);
        let frame = frame(&lumigraph, &desired);
        for by in [DeviceChoice::Cpu, DeviceChoice::Reference] {
            let picture = cpu::render(&frame, Method::TRIANGULATED).unwrap();
            let (_, count) = softened(by, &frame, picture);
            let count = count.contradicted;
            assert!((least..=most).contains(&count), "{nearer}: {count}");
        }
    }
}

/// Where the picture begins decides nothing.
#[test]
fn a_panorama_that_is_turned_is_softened_alike() {
    let shot = Shot::of("wall", 6, None);
    let wrong = wall(&shot, 0.4, 1.0);
    let (width, height) = (256, 128);
    let middle = 0.5 * DVec2::new(f64::from(width), f64::from(height));
    let focal = middle * DVec2::new(1.0, 2.0) / PI;
    let lens = Lens::new(focal, middle, Distortion::Equirectangular);
    let place = shot.views[0].between(&shot.views[3], 0.4);
    let pictures = [0.0, 0.5].map(|turn: f64| {
        let turned = Rigid3 {
            rotation: DQuat::from_rotation_y(TAU * turn),
            translation: DVec3::ZERO,
        };
        let desired = View {
            lens,
            width,
            height,
            camera_from_world: turned * place.camera_from_world,
        };
        let frame = frame(&wrong, &desired);
        let sharp = cpu::render(&frame, Method::Exact).unwrap();
        let (soft, count) = softened(DeviceChoice::Cpu, &frame, sharp.clone());
        assert!(count.guessed + count.contradicted > 500, "{count:?}");
        [sharp, soft]
    });
    let [ahead, behind] = &pictures;
    for (ahead, behind) in ahead.iter().zip(behind) {
        let turned = RgbaImage::from_fn(width, height, |x, y| {
            *behind.get_pixel((x + width / 2) % width, y)
        });
        assert_close(ahead, &turned, "turned");
    }
}

/// There the photo is all that counts, whatever the others show.
#[test]
fn a_view_at_a_photos_own_pose_has_no_contradictions() {
    let shot = Shot::of("wall", 4, None);
    let wrong = wall(&shot, 0.4, 20.0);
    for view in &shot.views {
        let frame = frame(&wrong, view);
        let sharp = cpu::render(&frame, Method::TRIANGULATED).unwrap();
        let (soft, count) = softened(DeviceChoice::Cpu, &frame, sharp.clone());
        assert_eq!(count, Softened::default());
        assert!(soft == sharp);
    }
}

#[test]
fn what_is_not_covered_is_not_drawn_softly() {
    let shot = Shot::of("wall", 6, None);
    let desired = shot.views[0].between(&shot.views[3], 0.4);
    let small = wall(&shot, 0.4, 0.1);
    let frame = frame(&small, &desired);
    let sharp = cpu::render(&frame, Method::TRIANGULATED).unwrap();
    let (soft, count) = softened(DeviceChoice::Cpu, &frame, sharp.clone());
    let covered = sharp.pixels().filter(|p| p.0[3] > 0).count();
    assert!(covered > 300 && covered < 10_000, "{covered}");
    assert!(count.contradicted > 100, "{count:?}");
    assert!(
        count.guessed + count.contradicted <= covered,
        "{count:?} {covered}"
    );
    let bare = sharp
        .pixels()
        .zip(soft.pixels())
        .filter(|(p, _)| p.0[3] == 0);
    assert!(bare.into_iter().all(|(a, b)| a == b));
}
