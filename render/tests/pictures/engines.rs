//! The three engines against each other, against the photos and against the truth.

use crate::common::{METHODS, Shot, assert_close, by_all, by_reference, psnr, psnr_covered};

use calibrate::{Distortion, Lens, Rigid3, View};
use glam::{DQuat, DVec2, DVec3};
use image::RgbaImage;
use proxy::{Plane, Proxy};
use render::{
    Blend, FieldOptions, Frame, Lumigraph, Method, PhotoStore, Resolution, SourceView, cpu,
    reference,
};

pub(crate) fn options(blend: Blend, resolution: Resolution) -> FieldOptions {
    FieldOptions {
        blend,
        resolution,
        ..FieldOptions::default()
    }
}

fn fisheye() -> Lens {
    let k = [0.02, -0.01, 0.002, 0.0];
    Lens::new(
        DVec2::new(95.0, 96.0),
        DVec2::new(81.0, 59.5),
        Distortion::Fisheye { k },
    )
}

fn full_opencv() -> Lens {
    let k = [-0.12, 0.05, 0.01, 0.02, 0.01, 0.005];
    let p = [0.002, -0.003];
    Lens::new(
        DVec2::new(150.0, 152.0),
        DVec2::new(78.0, 61.0),
        Distortion::Rational { k, p },
    )
}

/// The same place, looking elsewhere: turned about its own x axis, then y.
pub(crate) fn turned(view: &View, about_x: f64, about_y: f64) -> View {
    let turn = DQuat::from_rotation_x(about_x) * DQuat::from_rotation_y(about_y);
    View {
        camera_from_world: Rigid3::new(turn, DVec3::ZERO) * view.camera_from_world,
        ..view.clone()
    }
}

/// The same view from elsewhere, by an offset in its own frame.
pub(crate) fn moved(view: &View, offset: DVec3) -> View {
    View {
        camera_from_world: Rigid3::new(DQuat::IDENTITY, -offset) * view.camera_from_world,
        ..view.clone()
    }
}

// ------------------------------------------------------------------- Epipole consistency

#[test]
fn a_view_at_a_photos_own_pose_gives_that_photo_back() {
    for (name, lens) in [
        ("SIMPLE_RADIAL", None),
        ("OPENCV_FISHEYE", Some(fisheye())),
        ("FULL_OPENCV", Some(full_opencv())),
    ] {
        let shot = Shot::of("shelf", 9, lens);
        let lumigraph = shot.lumigraph();
        for i in [0, 4, 7] {
            let frame = Frame::new(&lumigraph, shot.views[i].clone(), FieldOptions::default());
            for method in METHODS {
                for (engine, picture) in by_all(&frame, method) {
                    let picture = picture.unwrap();
                    let covered = picture.pixels().filter(|p| p.0[3] > 0).count();
                    let db = psnr_covered(&picture, &shot.photos[i]);
                    println!("{name}, photo {i}, {engine} {method:?}: {db:.1} dB, {covered} px");
                    assert!(covered > 160 * 120 / 2, "{name} {i} {engine}: {covered}");
                    assert!(
                        db >= 50.0,
                        "{name}, photo {i}, {engine} {method:?}: {db} dB"
                    );
                }
            }
        }
    }
}

/// Where as many photos look from one place as contribute, none is nearer than the others: all share.
#[test]
fn photos_of_one_place_share_in_every_engine() {
    let shot = Shot::of("shelf", 9, None);
    let mut lumigraph = shot.lumigraph();
    let first = shot.views[4].clone();
    for (i, (x, y)) in [(0.1, 0.3), (-0.2, 0.1), (0.05, -0.3)]
        .into_iter()
        .enumerate()
    {
        lumigraph.sources[i].view = turned(&first, x, y);
    }
    for (name, desired) in [
        ("a photo's own", first.clone()),
        ("turned", turned(&first, 0.02, 0.15)),
    ] {
        for k in [1, 2, 3, 5] {
            for method in METHODS {
                let options = FieldOptions {
                    k,
                    ..FieldOptions::default()
                };
                let frame = Frame::new(&lumigraph, desired.clone(), options);
                let truth = by_reference(&frame, method).unwrap();
                for (engine, picture) in by_all(&frame, method).split_off(1) {
                    let what = format!("{name}, k = {k}, {engine}, {method:?}");
                    assert_close(&picture.unwrap(), &truth, &what);
                }
            }
        }
    }
}

// ---------------------------------------------------------------- Engine against engine

/// Desired views that try everything: between photos, nearer, farther than the photos
/// cover, coarser, through other lenses, with the horizon in the picture.
pub(crate) fn desired_views(shot: &Shot) -> Vec<(&'static str, View)> {
    let middle = shot.views[0].between(&shot.views[5], 0.5);
    let distance = shot.plane.signed_distance(middle.center()).abs();
    let wide = View {
        lens: Lens::pinhole(DVec2::splat(60.0), DVec2::new(80.0, 60.0)),
        ..middle.clone()
    };
    vec![
        ("between", middle.clone()),
        ("nearer", moved(&middle, 0.4 * distance * DVec3::Z)),
        ("farther", moved(&middle, -1.5 * distance * DVec3::Z)),
        ("small", middle.resized(61, 47)),
        ("horizon", turned(&wide, 1.0, 0.4)),
        (
            "fisheye",
            View {
                lens: fisheye(),
                ..middle.clone()
            },
        ),
        (
            "full opencv",
            View {
                lens: full_opencv(),
                ..middle
            },
        ),
    ]
}

#[test]
fn exact_pictures_are_the_same_from_every_engine() {
    let shot = Shot::of("shelf", 9, None);
    let lumigraph = shot.lumigraph();
    for (name, desired) in desired_views(&shot) {
        for blend in [Blend::Consistent, Blend::Paper] {
            for resolution in [
                Resolution::Footprint,
                Resolution::Distance,
                Resolution::Length,
            ] {
                let options = options(blend, resolution);
                let frame = Frame::new(&lumigraph, desired.clone(), options);
                let truth = reference::render_exact(&frame).unwrap();
                for (engine, picture) in by_all(&frame, Method::Exact).split_off(1) {
                    let what = format!("{name}, {blend:?}, {resolution:?}, {engine}");
                    assert_close(&picture.unwrap(), &truth, &what);
                }
            }
        }
    }
}

#[test]
fn exact_pictures_are_the_same_whatever_the_photos_lenses() {
    // One of each kind of lens, of several sizes, focal lengths and exposures, and photos
    // with transparent parts.
    let shot = mixed();
    let lumigraph = shot.lumigraph;
    for (name, desired) in [
        ("between", shot.views[0].between(&shot.views[3], 0.4)),
        ("at a fisheye", shot.views[1].clone()),
        ("turned", turned(&shot.views[2], 0.1, -0.2)),
    ] {
        for method in METHODS {
            let frame = Frame::new(&lumigraph, desired.clone(), FieldOptions::default());
            let truth = by_reference(&frame, method).unwrap();
            for (engine, picture) in by_all(&frame, method).split_off(1) {
                let what = format!("{name}, {engine}, {method:?}");
                assert_close(&picture.unwrap(), &truth, &what);
            }
        }
    }
}

pub(crate) struct Mixed {
    pub(crate) lumigraph: Lumigraph,
    pub(crate) views: Vec<View>,
}

pub(crate) fn mixed() -> Mixed {
    let shot = Shot::of("shelf", 9, None);
    let lenses = [shot.views[0].lens, fisheye(), full_opencv()];
    let views: Vec<View> = (0..9)
        .map(|i| {
            let view = View {
                lens: lenses[i % 3],
                ..shot.views[i].clone()
            };
            if i % 2 == 0 {
                view
            } else {
                view.resized(119, 93)
            }
        })
        .collect();
    let photos = views.iter().enumerate().map(|(i, view)| {
        let mut photo = datasets::render_view(&shot.dataset.scene, view, 1);
        if i % 4 == 0 {
            let (cx, cy) = (0.5 * f64::from(view.width), 0.5 * f64::from(view.height));
            for (x, y, pixel) in photo.enumerate_pixels_mut() {
                let radius = (f64::from(x) - cx).hypot(f64::from(y) - cy) / cy;
                let alpha = (4.0 * (1.3 - radius)).clamp(0.0, 1.0);
                pixel.0[3] = (alpha * 255.0).round() as u8;
            }
        }
        photo
    });
    let photos: Vec<RgbaImage> = photos.collect();
    let mut sources = shot.sources();
    for (i, source) in sources.iter_mut().enumerate() {
        source.view = views[i].clone();
        let g = i as f64;
        source.gain = [1.0 + 0.03 * g, 1.1 - 0.02 * g, 0.9 + 0.02 * g];
    }
    Mixed {
        lumigraph: Lumigraph {
            points: Vec::new(),
            sources,
            photos: PhotoStore::from_images(photos),
            proxy: Proxy::Plane(shot.plane),
            visibility: None,
        },
        views,
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let mixed = mixed();
    let desired = mixed.views[0].between(&mixed.views[5], 0.3);
    for method in METHODS {
        let with_threads = |count: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build();
            pool.unwrap().install(|| {
                let frame = Frame::new(&mixed.lumigraph, desired.clone(), FieldOptions::default());
                let plain = by_reference(&frame, method).unwrap();
                (plain, cpu::render(&frame, method).unwrap())
            })
        };
        assert!(with_threads(1) == with_threads(4), "{method:?}");
    }
}

// -------------------------------------------------------------------------- The truth

#[test]
fn the_true_plane_gives_the_true_picture_and_a_wrong_one_does_not() {
    let shot = Shot::of("wall", 9, None);
    let mut lumigraph = shot.lumigraph();
    let desired = shot.views[0].between(&shot.views[4], 0.5);
    let truth = datasets::render_view(&shot.dataset.scene, &desired, 2);
    let wrong = Plane::new(
        shot.plane.point() + 0.3 * shot.plane.normal(),
        shot.plane.normal(),
    );
    let scores = [shot.plane, wrong.unwrap()].map(|plane| {
        lumigraph.proxy = Proxy::Plane(plane);
        let frame = Frame::new(&lumigraph, desired.clone(), FieldOptions::default());
        METHODS.map(|method| psnr_covered(&by_reference(&frame, method).unwrap(), &truth))
    });
    println!(
        "wall: true plane {:?} dB, wrong plane {:?} dB",
        scores[0], scores[1]
    );
    for (of_true, of_wrong) in scores[0].into_iter().zip(scores[1]) {
        assert!(of_true >= 30.0, "{of_true} dB");
        assert!(of_wrong < of_true - 3.0, "{of_wrong} dB, {of_true} dB");
    }
}

// ---------------------------------------------------------------------- Odd photo sets

/// A wall taken 150 times in small pictures, and some of these again from the same places;
/// the proxy is a little off, so that it shows who paints. Seen from afar, more borders of
/// photos cross a triangle than it lists.
fn crowd() -> (Lumigraph, View) {
    let options = datasets::Options {
        size: Some((40, 30)),
        views: Some(150),
        samples_per_side: Some(1),
    };
    let wall = datasets::by_name("wall", &options).unwrap();
    let mut views: Vec<View> = wall.photos.iter().map(|p| p.view.clone()).collect();
    views.extend_from_within(..20);
    let photo = |view: &View| datasets::render_view(&wall.scene, view, 1);
    let photos = views.iter().map(photo).collect();
    let placed = wall.scene.objects()[0].world_from_shape;
    let normal = placed.rotation * DVec3::Z;
    let plane = Plane::new(placed.translation + 0.05 * normal, normal).unwrap();
    let source = |(i, view): (usize, &View)| SourceView {
        name: format!("{i}"),
        view: view.clone(),
        gain: [1.0; 3],
        time_s: None,
        quarters: 0,
    };
    let desired = views[0].between(&views[4], 0.3).resized(101, 75);
    let lumigraph = Lumigraph {
        points: Vec::new(),
        sources: views.iter().enumerate().map(source).collect(),
        photos: PhotoStore::from_images(photos),
        proxy: Proxy::Plane(plane),
        visibility: None,
    };
    (lumigraph, desired)
}

#[test]
fn many_photos_and_every_k_look_the_same_from_every_engine() {
    let (lumigraph, near) = crowd();
    let far = moved(&near, DVec3::new(0.3, -0.2, -4.0));
    for (name, desired) in [("near", near), ("far", far)] {
        for blend in [Blend::Consistent, Blend::Paper] {
            for k in [1, 5, 16] {
                let options = FieldOptions {
                    k,
                    blend,
                    ..FieldOptions::default()
                };
                let frame = Frame::new(&lumigraph, desired.clone(), options);
                let [exact, triangulated] = METHODS.map(|method| {
                    let truth = by_reference(&frame, method).unwrap();
                    for (engine, picture) in by_all(&frame, method).split_off(1) {
                        let what = format!("{name}, {blend:?}, k = {k}, {engine}, {method:?}");
                        assert_close(&picture.unwrap(), &truth, &what);
                    }
                    truth
                });
                let db = psnr(&triangulated, &exact);
                println!("{name}, {blend:?}, k = {k}: {db:.1} dB");
                assert!(db >= 50.0, "{name}, {blend:?}, k = {k}: {db} dB");
            }
        }
    }
}

#[test]
fn pictures_of_any_size_can_be_drawn() {
    let shot = Shot::of("shelf", 4, None);
    let lumigraph = shot.lumigraph();
    let middle = shot.views[0].between(&shot.views[1], 0.5);
    for (width, height) in [(1, 1), (1, 50), (33, 1), (31, 7), (65, 64)] {
        let desired = middle.resized(width, height);
        let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
        for method in [
            Method::Exact,
            Method::Triangulated { cells_across: 1 },
            Method::TRIANGULATED,
        ] {
            let truth = by_reference(&frame, method).unwrap();
            for (engine, picture) in by_all(&frame, method).split_off(1) {
                let what = format!("{width} × {height}, {engine}, {method:?}");
                assert_close(&picture.unwrap(), &truth, &what);
            }
        }
    }
}
