//! Ignore masks: what they hide stays hidden, what they show stays as it was, by every engine.

use crate::common::{
    METHODS, Random, Shot, assert_close, by_all, by_reference, differing, psnr, psnr_covered,
};

use calibrate::{Pixel, View};
use image::{GrayImage, Luma, RgbaImage};
use proxy::Proxy;
use render::blend::{Candidate, blend};
use render::{
    FieldOptions, Frame, Lumigraph, Mask, PhotoError, PhotoStore, Pyramid, RenderError,
    TriangulatedField, cpu,
};

pub(crate) const SIZE: (u32, u32) = (160, 120);

/// How much of a passer-by stands in a pixel of photo `i`: 1 within, 0 outside, soft over
/// a pixel.
fn passer_by(i: usize, x: u32, y: u32) -> f64 {
    let center = (30.0 + 12.5 * i as f64, 60.0 + 4.0 * ((i * 5) % 9) as f64);
    let (dx, dy) = (f64::from(x) - center.0, f64::from(y) - center.1);
    (15.0 * (1.0 - (dx / 13.0).hypot(dy / 34.0))).clamp(0.0, 1.0)
}

/// The photos with a passer-by in each.
fn crowded(photos: &[RgbaImage]) -> Vec<RgbaImage> {
    let mut photos = photos.to_vec();
    for (i, photo) in photos.iter_mut().enumerate() {
        for (x, y, pixel) in photo.enumerate_pixels_mut() {
            let (share, coat) = (passer_by(i, x, y), [250.0, 20.0, 240.0]);
            for c in 0..3 {
                let clean = f64::from(pixel.0[c]);
                pixel.0[c] = (clean + share * (coat[c] - clean)).round() as u8;
            }
        }
    }
    photos
}

/// Hides every pixel that a passer-by touches.
fn hides_passer_by(i: usize) -> GrayImage {
    GrayImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        Luma([if passer_by(i, x, y) > 0.0 { 0 } else { 255 }])
    })
}

pub(crate) fn store(photos: Vec<RgbaImage>, masks: Vec<Option<GrayImage>>) -> PhotoStore {
    let masked: Vec<bool> = masks.iter().map(Option::is_some).collect();
    let load = move |i: usize| masks[i].clone().ok_or("no mask is asked for".to_owned());
    PhotoStore::from_images(photos).with_masks(&masked, load)
}

/// A scene seen past passers-by, with masks against them for the photos that `masked` names.
fn scene_with(shot: &Shot, masked: impl Fn(usize) -> bool) -> Lumigraph {
    let count = shot.photos.len();
    let masks = (0..count).map(|i| masked(i).then(|| hides_passer_by(i)));
    Lumigraph {
        photos: store(crowded(&shot.photos), masks.collect()),
        ..shot.lumigraph()
    }
}

pub(crate) fn frame<'a>(lumigraph: &'a Lumigraph, desired: &View) -> Frame<'a> {
    Frame::new(lumigraph, desired.clone(), FieldOptions::default())
}

/// Between the photos, nearer, coarser than the photos, and at one of them.
fn desired_views(shot: &Shot) -> Vec<(&'static str, View)> {
    let middle = shot.views[0].between(&shot.views[5], 0.45);
    let (right, ahead) = (middle.forward().cross(middle.up()), middle.forward());
    let distance = shot.plane.signed_distance(middle.center()).abs();
    let moved = |offset: glam::DVec3| View {
        camera_from_world: calibrate::Rigid3::new(
            middle.camera_from_world.rotation,
            -(middle.camera_from_world.rotation * (middle.center() + offset)),
        ),
        ..middle.clone()
    };
    vec![
        ("nearer", moved(0.3 * distance * ahead)),
        (
            "farther",
            moved(-0.8 * distance * ahead + 0.1 * distance * right),
        ),
        ("small", middle.resized(67, 50)),
        ("at a photo", shot.views[4].clone()),
        ("between", middle),
    ]
}

/// Whether every photo that sees the proxy point at a pixel has someone in front of it.
fn nobody_sees(frame: &Frame<'_>, x: u32, y: u32) -> bool {
    let Some(point) = frame.proxy_point(Pixel::center_of(x, y)) else {
        return true;
    };
    (0..frame.sources.len()).all(|i| {
        let pixel = frame.project(i, &point);
        let view = &frame.lumigraph.sources[i].view;
        pixel.filter(|p| view.contains(*p)).is_none_or(|p| {
            let (x, y) = (p.x.min(159.0) as u32, p.y.min(119.0) as u32);
            passer_by(i, x, y) > 0.0
        })
    })
}

#[test]
fn masked_passers_by_are_not_there() {
    let shot = Shot::of("wall", 9, None);
    let clean = shot.lumigraph();
    let masked = scene_with(&shot, |_| true);
    let unmasked = scene_with(&shot, |_| false);
    for (name, desired) in desired_views(&shot) {
        for method in METHODS {
            let truth = by_reference(&frame(&clean, &desired), method).unwrap();
            let crowd = by_reference(&frame(&unmasked, &desired), method).unwrap();
            let without = psnr_covered(&crowd, &truth);
            let frame = frame(&masked, &desired);
            for (engine, picture) in by_all(&frame, method) {
                let picture = picture.unwrap();
                let with = psnr_covered(&picture, &truth);
                println!("{name}, {engine}, {method:?}: {with:.1} dB, unmasked {without:.1} dB");
                assert!(with >= 45.0, "{name}, {engine}, {method:?}: {with} dB");
                assert!(without < with - 15.0, "{name}, {method:?}: {without} dB");
                // Holes are where all photos that see the place have someone there.
                for (x, y, pixel) in picture.enumerate_pixels() {
                    let hole = pixel.0[3] == 0 && truth.get_pixel(x, y).0[3] > 0;
                    assert!(
                        !hole || nobody_sees(&frame, x, y),
                        "{name}, {engine}: {x}, {y}"
                    );
                }
            }
        }
    }
}

#[test]
fn at_a_photos_own_place_all_that_its_mask_shows_is_that_photo() {
    let shot = Shot::of("shelf", 9, None);
    let lumigraph = scene_with(&shot, |_| true);
    let photos = crowded(&shot.photos);
    for i in [0, 4, 7] {
        let mask = hides_passer_by(i);
        for method in METHODS {
            for (engine, picture) in by_all(&frame(&lumigraph, &shot.views[i]), method) {
                let picture = picture.unwrap();
                let mut worst = 0;
                let mut shown = 0;
                for (x, y, pixel) in picture.enumerate_pixels() {
                    let coat = pixel.0[0] > 200 && pixel.0[1] < 60 && pixel.0[2] > 200;
                    assert!(!coat, "photo {i}, {engine}, {method:?}: {x}, {y}");
                    // The feather leaves the photo's margin to the others.
                    let margin = x.min(159 - x).min(y).min(119 - y) < 4;
                    if mask.get_pixel(x, y).0[0] == 255 && !margin && pixel.0[3] > 0 {
                        let photo = photos[i].get_pixel(x, y);
                        let off = (0..4).map(|c| pixel.0[c].abs_diff(photo.0[c])).max();
                        worst = worst.max(off.unwrap());
                        shown += 1;
                    }
                }
                assert!(shown > 160 * 120 / 2, "{shown}");
                assert!(worst <= 2, "photo {i}, {engine}, {method:?}: {worst}");
            }
        }
    }
}

/// A shelf whose photos have hard, soft and no masks.
fn assorted() -> (Shot, Lumigraph) {
    let shot = Shot::of("shelf", 9, None);
    let masks = (0..9).map(|i| match i % 3 {
        0 => Some(hides_passer_by(i)),
        1 => Some(GrayImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            let wave = (f64::from(x) * 0.07 + i as f64).sin() * (f64::from(y) * 0.09).cos();
            Luma([(400.0 * wave + 160.0).clamp(0.0, 255.0) as u8])
        })),
        _ => None,
    });
    let mut photos = crowded(&shot.photos);
    // One has a matte besides.
    for (x, y, pixel) in photos[3].enumerate_pixels_mut() {
        let radius = (f64::from(x) - 80.0).hypot(f64::from(y) - 60.0);
        pixel.0[3] = (20.0 * (70.0 - radius)).clamp(0.0, 255.0) as u8;
    }
    let lumigraph = Lumigraph {
        photos: store(photos, masks.collect()),
        ..shot.lumigraph()
    };
    (shot, lumigraph)
}

#[test]
fn masked_pictures_are_the_same_from_every_engine() {
    let (shot, lumigraph) = assorted();
    for (name, desired) in desired_views(&shot) {
        for method in METHODS {
            let frame = frame(&lumigraph, &desired);
            let truth = by_reference(&frame, method).unwrap();
            for (engine, picture) in by_all(&frame, method).split_off(1) {
                let what = format!("{name}, {engine}, {method:?}");
                assert_close(&picture.unwrap(), &truth, &what);
            }
        }
    }
}

#[test]
fn triangulated_pictures_of_masked_scenes_are_close_to_exact_ones() {
    let (shot, soft) = assorted();
    let hard = scene_with(&shot, |i| i != 2);
    for (name, desired) in desired_views(&shot) {
        for (masks, lumigraph) in [("hard", &hard), ("assorted", &soft)] {
            let frame = frame(lumigraph, &desired);
            let [exact, triangulated] = METHODS.map(|method| by_reference(&frame, method).unwrap());
            let db = psnr(&triangulated, &exact);
            println!("{name}, {masks} masks: {db:.1} dB");
            assert!(db >= 50.0, "{name}, {masks} masks: {db} dB");
        }
    }
}

#[test]
fn only_triangles_that_a_border_crosses_pay_for_masks() {
    let shot = Shot::of("wall", 9, None);
    let desired = shot.views[4].clone();
    let bordered = |lumigraph: &Lumigraph| {
        let field = TriangulatedField::new(&frame(lumigraph, &desired), 32).unwrap();
        field.triangles.iter().filter(|t| t.bordered).count()
    };
    let clean = bordered(&shot.lumigraph());
    // A spot in a corner of one photo.
    let spot = GrayImage::from_fn(SIZE.0, SIZE.1, |x, y| Luma([u8::from(x.max(y) > 9) * 255]));
    let mut masks = vec![None; 9];
    masks[4] = Some(spot);
    let lumigraph = Lumigraph {
        photos: store(shot.photos.clone(), masks),
        ..shot.lumigraph()
    };
    let masked = bordered(&lumigraph);
    println!("{clean} bordered triangles, {masked} with a spot");
    assert!(masked < clean + 40, "{clean}, {masked}");
}

#[test]
fn what_every_photo_ignores_is_a_hole() {
    let shot = Shot::of("wall", 9, None);
    // The same patch of the wall, in every photo.
    let patch = shot.plane.point();
    let lens = |view: &View| {
        let center = view.camera_from_world * patch;
        view.lens.project(center).unwrap()
    };
    let masks = shot.views.iter().map(|view| {
        let Pixel { x: cx, y: cy } = lens(view);
        Some(GrayImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            let radius = (f64::from(x) + 0.5 - cx).hypot(f64::from(y) + 0.5 - cy);
            Luma([if radius < 25.0 { 0 } else { 255 }])
        }))
    });
    let lumigraph = Lumigraph {
        photos: store(shot.photos.clone(), masks.collect()),
        ..shot.lumigraph()
    };
    let desired = shot.views[0].between(&shot.views[4], 0.5);
    let Pixel { x: cx, y: cy } = lens(&desired);
    for method in METHODS {
        for (engine, picture) in by_all(&frame(&lumigraph, &desired), method) {
            for (x, y, pixel) in picture.unwrap().enumerate_pixels() {
                let radius = (f64::from(x) + 0.5 - cx).hypot(f64::from(y) + 0.5 - cy);
                let what = format!("{engine}, {method:?}, {x}, {y}: {pixel:?}");
                if radius < 12.0 {
                    assert_eq!(pixel.0, [0; 4], "{what}");
                } else if (45.0..55.0).contains(&radius) {
                    assert_eq!(pixel.0[3], 255, "{what}");
                }
            }
        }
    }
}

#[test]
fn a_mask_that_hides_nothing_changes_nothing_and_one_that_hides_all_removes_the_photo() {
    let shot = Shot::of("shelf", 9, None);
    let plain = shot.lumigraph();
    let constant = |value| Some(GrayImage::from_pixel(SIZE.0, SIZE.1, Luma([value])));
    let with_masks = |masks| Lumigraph {
        photos: store(shot.photos.clone(), masks),
        ..shot.lumigraph()
    };
    let white = with_masks(vec![constant(255); 9]);
    let mut masks = vec![None; 9];
    masks[4] = constant(0);
    let black = with_masks(masks);
    let mut sources = shot.sources();
    let mut photos = shot.photos.clone();
    sources.remove(4);
    photos.remove(4);
    let fewer = Lumigraph {
        points: Vec::new(),
        sources,
        photos: PhotoStore::from_images(photos),
        proxy: Proxy::Plane(shot.plane),
        visibility: None,
    };
    for (name, desired) in desired_views(&shot) {
        for method in METHODS {
            let pictures = |lumigraph| {
                let all = by_all(&frame(lumigraph, &desired), method);
                all.into_iter()
                    .map(|(engine, picture)| (engine, picture.unwrap()))
            };
            for ((engine, a), (_, b)) in pictures(&plain).zip(pictures(&white)) {
                let what = format!("{name}, {engine}, {method:?}");
                if engine == "gpu" {
                    // Another shader, and drivers round as they like.
                    assert_close(&a, &b, &what);
                } else {
                    assert!(a == b, "{what}");
                }
            }
            for ((engine, a), (_, b)) in pictures(&fewer).zip(pictures(&black)) {
                let what = format!("{name}, {engine}, {method:?}");
                assert_close(&a, &b, &what);
            }
        }
    }
}

#[test]
fn the_order_of_masked_photos_changes_nothing() {
    let (shot, lumigraph) = assorted();
    let mut random = Random(11);
    let mut order: Vec<usize> = (0..9).collect();
    random.shuffle(&mut order);
    let pyramids = order.iter().map(|&i| {
        let mask = lumigraph.photos.mask(i).map(|mask| mask.levels[0].clone());
        (crowded(&shot.photos)[i].clone(), mask)
    });
    let (mut photos, masks): (Vec<RgbaImage>, Vec<_>) = pyramids.unzip();
    let at = order.iter().position(|&i| i == 3).unwrap();
    for (x, y, pixel) in photos[at].enumerate_pixels_mut() {
        let radius = (f64::from(x) - 80.0).hypot(f64::from(y) - 60.0);
        pixel.0[3] = (20.0 * (70.0 - radius)).clamp(0.0, 255.0) as u8;
    }
    let reordered = Lumigraph {
        points: Vec::new(),
        photos: store(photos, masks),
        sources: order
            .iter()
            .map(|&i| lumigraph.sources[i].clone())
            .collect(),
        proxy: lumigraph.proxy.clone(),
        visibility: None,
    };
    for (name, desired) in desired_views(&shot) {
        for method in METHODS {
            let before = by_all(&frame(&lumigraph, &desired), method);
            let after = by_all(&frame(&reordered, &desired), method);
            for ((engine, before), (_, after)) in before.into_iter().zip(after) {
                let differing = differing(&before.unwrap(), &after.unwrap());
                let allowed = (desired.width * desired.height / 1000) as usize;
                let count = differing.len();
                assert!(count <= allowed, "{name}, {engine}, {method:?}: {count}");
            }
        }
    }
}

#[test]
fn the_weight_fades_steadily_across_a_masks_edge() {
    // Along a line on the wall, in small steps.
    let shot = Shot::of("wall", 9, None);
    let lumigraph = scene_with(&shot, |i| i == 4);
    let desired = shot.views[4].between(&shot.views[0], 0.3);
    let frame = frame(&lumigraph, &desired);
    let mut last: Option<f64> = None;
    let mut seen = (f64::INFINITY, 0.0_f64);
    for step in 0..48_000 {
        let point = frame.proxy_point(Pixel::new(20.0 + f64::from(step) / 400.0, 66.0));
        let field = render::reference::blend_at(&frame, &point.unwrap());
        let share = field
            .iter()
            .find(|c| c.source_idx == 4)
            .map_or(0.0, |c| c.weight);
        if let Some(last) = last {
            assert!((share - last).abs() < 0.05, "{step}: {last}, {share}");
        }
        seen = (seen.0.min(share), seen.1.max(share));
        last = Some(share);
    }
    assert!(seen.0 == 0.0 && seen.1 > 0.3, "{seen:?}");
}

#[test]
fn a_mask_that_cannot_be_decoded_is_an_error_and_never_a_picture() {
    let shot = Shot::of("shelf", 9, None);
    let mut masked = [false; 9];
    masked[4] = true;
    let broken = PhotoStore::from_images(shot.photos.clone());
    let lumigraph = Lumigraph {
        photos: broken.with_masks(&masked, |_| Err("masks/4.png: damaged".to_owned())),
        ..shot.lumigraph()
    };
    let expected = RenderError::Photo(PhotoError {
        source_idx: 4,
        message: "masks/4.png: damaged".to_owned(),
    });
    for method in METHODS {
        for _ in 0..2 {
            for (engine, result) in by_all(&frame(&lumigraph, &shot.views[3]), method) {
                assert_eq!(result.unwrap_err(), expected, "{engine}, {method:?}");
            }
        }
    }
}

#[test]
fn masks_are_decoded_for_photos_in_sight_alone() {
    let shot = Shot::of("shelf", 9, None);
    let mut lumigraph = scene_with(&shot, |_| true);
    // One looks the other way.
    let away = glam::DQuat::from_rotation_y(std::f64::consts::PI);
    let turn = calibrate::Rigid3::new(away, glam::DVec3::ZERO);
    let view = &mut lumigraph.sources[8].view;
    view.camera_from_world = turn * view.camera_from_world;
    let desired = shot.views[0].between(&shot.views[4], 0.5);
    for method in METHODS {
        cpu::render(&frame(&lumigraph, &desired), method).unwrap();
    }
    let bytes: usize = (0..8)
        .map(|i| {
            let mask = Mask::new(hides_passer_by(i));
            let photo = Pyramid::masked(shot.photos[i].clone(), &mask);
            mask.bytes() + photo.bytes()
        })
        .sum();
    assert!(lumigraph.photos.bytes() <= bytes, "no more than eight");
    assert!(lumigraph.photos.decoded() <= 8);
}

#[test]
fn masked_out_candidates_are_none_and_feathered_out_ones_are_the_last_resort() {
    let candidate = |source_idx, diff, fov, mask| Candidate {
        source_idx,
        diff,
        fov,
        mask,
    };
    let shares = |candidates: &[Candidate]| {
        let field = blend(candidates, &FieldOptions::default());
        field
            .iter()
            .map(|c| (c.source_idx, c.weight))
            .collect::<Vec<_>>()
    };
    assert_eq!(shares(&[candidate(0, 0.1, 1.0, 0.0)]), []);
    assert_eq!(
        shares(&[candidate(0, 0.1, 1.0, 0.0), candidate(1, 0.3, 0.5, 0.1)]),
        [(1, 1.0)]
    );
    // What is masked out does not keep the others feathered out.
    assert_eq!(
        shares(&[candidate(0, 0.1, 1.0, 0.0), candidate(1, 0.3, 0.0, 1.0)]),
        [(1, 1.0)]
    );
    // Tied ones share by mask.
    let tied = [candidate(0, 0.0, 0.0, 0.25), candidate(1, 0.0, 0.0, 0.75)];
    assert_eq!(shares(&tied), [(0, 0.25), (1, 0.75)]);
}
