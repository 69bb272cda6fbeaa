//! The three engines against each other, against the photos and against the truth.

use crate::common;

use calibrate::{Distortion, Lens, Pixel, Rigid3, View, colmap};
use common::{METHODS, Shot, assert_close, by_all, by_reference, gpu, pinhole, psnr, psnr_covered};
use glam::{DQuat, DVec2, DVec3};
use image::{Rgba, RgbaImage};
use proxy::{Mesh, MeshKind, Plane, Proxy, Solid};
use render::field::FieldEntry;
use render::picture::contributors_exact;
use render::{
    Blend, FieldOptions, Frame, Lumigraph, Method, PhotoError, PhotoStore, RenderError, Resolution,
    SourceView, Surface, TriangulatedField, cpu, reference,
};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::{Arc, Mutex};

fn options(blend: Blend, resolution: Resolution) -> FieldOptions {
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
fn turned(view: &View, about_x: f64, about_y: f64) -> View {
    let turn = DQuat::from_rotation_x(about_x) * DQuat::from_rotation_y(about_y);
    View {
        camera_from_world: Rigid3::new(turn, DVec3::ZERO) * view.camera_from_world,
        ..view.clone()
    }
}

/// The same view from elsewhere, by an offset in its own frame.
fn moved(view: &View, offset: DVec3) -> View {
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

/// Where the desired lens ends within the picture, triangles that end with it reach beyond photos' borders.
#[test]
fn beyond_a_photos_border_it_shows_nothing_at_the_end_of_the_desired_lens() {
    let shot = Shot::of("shelf", 9, None);
    let lumigraph = shot.lumigraph();
    let bent = Distortion::Rational {
        k: [-0.6, 0.0, 0.0, 0.0, 0.0, 0.0],
        p: [0.0; 2],
    };
    let lens = Lens::new(DVec2::splat(130.0), DVec2::new(80.0, 60.0), bent);
    let mut without_ray = 0;
    for (x, y) in [(0.0, 0.0), (0.3, 0.2), (-0.2, 0.5), (0.5, -0.3)] {
        let desired = View {
            lens,
            ..turned(&shot.views[4], x, y)
        };
        let middle = (0..120).flat_map(|y| (0..160).map(move |x| Pixel::center_of(x, y)));
        without_ray += middle.filter(|p| lens.unproject(*p).is_none()).count();
        let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
        for method in METHODS {
            let truth = by_reference(&frame, method).unwrap();
            for (engine, picture) in by_all(&frame, method).split_off(1) {
                let what = format!("turned by {x}, {y}, {engine}, {method:?}");
                assert_close(&picture.unwrap(), &truth, &what);
            }
        }
    }
    assert!(without_ray > 1000, "{without_ray}");
}

/// There triangles show all that the lens sees, whatever their corners do.
#[test]
fn triangles_reach_to_the_end_of_the_desired_lens() {
    let shot = Shot::of("wall", 9, None);
    let wall = shot.dataset.scene.objects()[0].world_from_shape;
    let corner =
        |x: f64, y: f64| wall.translation + wall.rotation * DVec3::new(9.0 * x, 9.0 * y, 0.0);
    let mesh = Mesh {
        positions: vec![
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    };
    let meshed = Lumigraph {
        proxy: Proxy::Mesh(Arc::new(Solid::new(MeshKind::Mesh, mesh))),
        ..shot.lumigraph()
    };
    let folding = Distortion::Rational {
        k: [-2.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        p: [0.0; 2],
    };
    let lens = Lens::new(DVec2::splat(150.0), DVec2::new(80.0, 60.0), folding);
    for (name, lumigraph) in [("plane", shot.lumigraph()), ("mesh", meshed)] {
        for i in [1, 4] {
            let desired = View {
                lens,
                ..shot.views[i].clone()
            };
            let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
            let exact = by_reference(&frame, Method::Exact).unwrap();
            for (engine, picture) in by_all(&frame, Method::TRIANGULATED) {
                let picture = picture.unwrap();
                let pixels = exact.pixels().zip(picture.pixels());
                let holes = pixels.filter(|(e, p)| e.0[3] == 255 && p.0[3] < 128);
                assert_eq!(holes.count(), 0, "{name}, photo {i}, {engine}");
                let db = psnr(&picture, &exact);
                println!("{name}, photo {i}, {engine}: {db:.1} dB");
                assert!(db >= 35.0, "{name}, photo {i}, {engine}: {db} dB");
            }
        }
    }
}

// ---------------------------------------------------------------- Engine against engine

/// Desired views that try everything: between photos, nearer, farther than the photos
/// cover, coarser, through other lenses, with the horizon in the picture.
fn desired_views(shot: &Shot) -> Vec<(&'static str, View)> {
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

struct Mixed {
    lumigraph: Lumigraph,
    views: Vec<View>,
}

fn mixed() -> Mixed {
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

// ------------------------------------------------------------- Triangulated against exact

/// That the triangulated field's picture is at least 50 dB from the exact one, by every
/// engine.
fn check_triangulated(lumigraph: &Lumigraph, desired: View, options: FieldOptions, what: &str) {
    let frame = Frame::new(lumigraph, desired, options);
    let exact = reference::render_exact(&frame).unwrap();
    for (engine, picture) in by_all(&frame, Method::TRIANGULATED) {
        let db = psnr(&picture.unwrap(), &exact);
        println!("{what}, {engine}: {db:.1} dB");
        assert!(db >= 50.0, "{what}, {engine}: {db} dB");
    }
}

#[test]
fn triangulated_pictures_are_close_to_exact_ones() {
    let shot = Shot::of("shelf", 9, None);
    let lumigraph = shot.lumigraph();
    let views = &shot.views;
    let mut desired = desired_views(&shot);
    desired.push(("midway", views[1].between(&views[2], 0.5)));
    desired.push(("1 % off", views[4].between(&views[5], 0.01)));
    for (name, view) in desired {
        for blend in [Blend::Consistent, Blend::Paper] {
            let what = format!("{name}, {blend:?}");
            let options = options(blend, Resolution::Footprint);
            check_triangulated(&lumigraph, view.clone(), options, &what);
        }
    }
}

#[test]
fn triangulated_pictures_are_close_with_other_lenses_gains_and_alpha() {
    let shot = mixed();
    for (name, desired) in [
        ("midway", shot.views[3].between(&shot.views[6], 0.5)),
        ("1 % off", shot.views[4].between(&shot.views[0], 0.01)),
    ] {
        let options = FieldOptions::default();
        check_triangulated(&shot.lumigraph, desired, options, name);
    }
}

/// A capture folder of the project's shared ones, `None` where it is not there.
fn capture(name: &str) -> Option<Lumigraph> {
    let root = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../shared/captures"
    ));
    let folder = root.join(name);
    if !folder.is_dir() {
        eprintln!("SKIPPED: no capture {name} beside this repository");
        return None;
    }
    let model = colmap::read_model(&colmap::find_model(&folder).unwrap()).unwrap();
    let plane = proxy::fit_plane(&model).unwrap().plane;
    let mut images: Vec<_> = model.images.values().collect();
    images.sort_by(|a, b| a.name.cmp(&b.name));
    let sources = images.iter().map(|image| {
        let camera = &model.cameras[&image.camera_id];
        SourceView {
            name: image.name.clone(),
            view: View {
                lens: camera.lens().unwrap(),
                width: camera.width,
                height: camera.height,
                camera_from_world: image.camera_from_world,
            },
            gain: [1.0; 3],
            time_s: None,
            quarters: 0,
        }
    });
    let sources: Vec<SourceView> = sources.collect();
    let photos = capture::find_photos_folder(&folder).unwrap();
    let files: Vec<_> = sources.iter().map(|s| photos.join(&s.name)).collect();
    let load = move |i: usize| capture::decode(&files[i], None).map_err(|e| e.to_string());
    Some(Lumigraph {
        points: Vec::new(),
        photos: PhotoStore::new(sources.len(), load),
        sources,
        proxy: Proxy::Plane(plane),
        visibility: None,
    })
}

#[test]
fn triangulated_pictures_are_close_on_real_captures() {
    for name in ["desk-sweep", "sceaux-castle", "fern"] {
        let Some(lumigraph) = capture(name) else {
            continue;
        };
        // From a photo in the middle to the one nearest to it.
        let first = &lumigraph.sources[lumigraph.sources.len() / 2].view;
        let distance = |s: &&SourceView| s.view.center().distance(first.center());
        let others = lumigraph.sources.iter().filter(|s| distance(s) > 0.0);
        let nearest = others.min_by(|a, b| distance(a).total_cmp(&distance(b)));
        for share in [0.5, 0.01] {
            let desired = first.between(&nearest.unwrap().view, share);
            let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
            let exact = cpu::render(&frame, Method::Exact).unwrap();
            let triangulated = cpu::render(&frame, Method::TRIANGULATED).unwrap();
            let db = psnr(&triangulated, &exact);
            println!("{name}, {share} of the way: {db:.1} dB");
            assert!(db >= 50.0, "{name}, {share} of the way: {db} dB");
        }
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

// -------------------------------------------------------------------- Photos on demand

/// A store of the photos that notes which are decoded, and those in `broken` cannot be.
fn watched(photos: &[RgbaImage], broken: &[usize]) -> (PhotoStore, Arc<Mutex<BTreeSet<usize>>>) {
    let decoded = Arc::new(Mutex::new(BTreeSet::new()));
    let noted = Arc::clone(&decoded);
    let (photos, broken) = (photos.to_vec(), broken.to_vec());
    let store = PhotoStore::new(photos.len(), move |i| {
        noted.lock().unwrap().insert(i);
        if broken.contains(&i) {
            return Err(format!("photo-{i}.jpg: not a photo; take it out"));
        }
        Ok(photos[i].clone())
    });
    (store, decoded)
}

#[test]
fn only_photos_in_use_are_decoded_and_when_changes_nothing() {
    let shot = Shot::of("shelf", 12, None);
    let mut lumigraph = shot.lumigraph();
    // Two that look away from it all.
    for i in [3, 8] {
        lumigraph.sources[i].view = turned(&shot.views[i], 0.0, std::f64::consts::PI);
    }
    let desired = moved(&shot.views[0], DVec3::new(0.01, 0.02, 0.0));
    let options = FieldOptions {
        k: 2,
        ..FieldOptions::default()
    };
    for method in METHODS {
        // Who has a noticeable share of any pixel; and who is listed by any triangle, which
        // is what a device must have before it draws.
        let frame = Frame::new(&lumigraph, desired.clone(), options);
        let (everywhere, listed) = match method {
            Method::Exact => (contributors_exact(&frame), None),
            Method::Triangulated { cells_across } => {
                let field = TriangulatedField::new(&frame, cells_across).unwrap();
                let of_entry = |e: &FieldEntry| e.source_idx as usize;
                let listed: BTreeSet<usize> = field.entries.iter().map(of_entry).collect();
                (field.contributors(&frame), Some(listed))
            }
        };
        let noticeable: BTreeSet<usize> = everywhere
            .iter()
            .flatten()
            .filter(|c| c.weight > 1e-3)
            .map(|c| c.source_idx)
            .collect();
        assert!(noticeable.len() >= 2);
        let engines = by_all(&frame, method).len();
        for engine in 0..engines {
            // A fresh store for each engine, and one with all photos decoded beforehand.
            let draw = |lumigraph: &Lumigraph| {
                let frame = Frame::new(lumigraph, desired.clone(), options);
                match engine {
                    0 => by_reference(&frame, method).unwrap(),
                    1 => cpu::render(&frame, method).unwrap(),
                    _ => gpu().unwrap().render(&frame, method).unwrap(),
                }
            };
            let (store, decoded) = watched(&shot.photos, &[]);
            lumigraph.photos = store;
            let on_demand = draw(&lumigraph);
            let decoded = decoded.lock().unwrap().clone();
            println!("{method:?}, engine {engine}: {decoded:?}");
            assert_eq!(lumigraph.photos.decoded(), decoded.len());
            assert!(decoded.is_superset(&noticeable), "{noticeable:?}");
            assert!(!decoded.contains(&3) && !decoded.contains(&8));
            match &listed {
                Some(listed) if engine == 2 => assert_eq!(decoded, *listed),
                _ => assert!(decoded.len() < 10, "all that look this way"),
            }
            assert_eq!(draw(&lumigraph), on_demand, "drawn again");
            lumigraph.photos = watched(&shot.photos, &[]).0;
            for i in 0..shot.photos.len() {
                lumigraph.photos.get(i).unwrap();
            }
            assert_eq!(draw(&lumigraph), on_demand, "{method:?}, engine {engine}");
        }
    }
}

#[test]
fn a_device_that_holds_other_photos_draws_the_same_bytes() {
    if gpu().is_none() {
        return;
    }
    let shot = Shot::of("shelf", 12, None);
    let desired = shot.views[0].between(&shot.views[1], 0.3);
    for method in METHODS {
        let fresh = shot.lumigraph();
        let frame = Frame::new(&fresh, desired.clone(), FieldOptions::default());
        let first = gpu().unwrap().render(&frame, method).unwrap();
        // Photos arrive in another order, frame by frame.
        let toured = shot.lumigraph();
        let mut gpu = gpu().unwrap();
        for view in shot.views.iter().rev() {
            let frame = Frame::new(&toured, view.clone(), FieldOptions::default());
            gpu.render(&frame, method).unwrap();
        }
        let frame = Frame::new(&toured, desired.clone(), FieldOptions::default());
        assert_eq!(gpu.render(&frame, method).unwrap(), first, "{method:?}");
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

#[test]
fn a_photo_that_cannot_be_decoded_is_named_and_does_no_further_harm() {
    let shot = Shot::of("shelf", 9, None);
    let good = shot.lumigraph();
    let mut bad = shot.lumigraph();
    bad.photos = watched(&shot.photos, &[4]).0;
    let desired = moved(&shot.views[4], DVec3::new(0.01, 0.0, 0.0));
    let expected = RenderError::Photo(PhotoError {
        source_idx: 4,
        message: "photo-4.jpg: not a photo; take it out".to_owned(),
    });
    assert_eq!(
        expected.to_string(),
        "photo-4.jpg: not a photo; take it out",
        "the message alone"
    );
    for method in METHODS {
        let good_frame = Frame::new(&good, desired.clone(), FieldOptions::default());
        let bad_frame = Frame::new(&bad, desired.clone(), FieldOptions::default());
        let before = by_all(&good_frame, method);
        for _ in 0..2 {
            for (engine, result) in by_all(&bad_frame, method) {
                assert_eq!(result.unwrap_err(), expected, "{engine}, {method:?}");
            }
        }
        assert!(by_all(&good_frame, method) == before, "{method:?}");
    }
}

// ----------------------------------------------------------------------- Nothing to see

#[test]
fn what_no_photo_sees_is_transparent() {
    let shot = Shot::of("shelf", 9, None);
    let mut lumigraph = shot.lumigraph();
    let middle = shot.views[0].between(&shot.views[4], 0.5);
    let in_the_plane = {
        let plane = shot.plane;
        let center = middle.center() - plane.signed_distance(middle.center()) * plane.normal();
        pinhole(
            center,
            center + middle.up().cross(plane.normal()),
            100.0,
            (160, 120),
        )
    };
    let nowhere = RgbaImage::from_pixel(160, 120, Rgba([0; 4]));
    for (name, desired) in [
        (
            "away from the plane",
            turned(&middle, 0.0, std::f64::consts::PI),
        ),
        ("far beside the photos", moved(&middle, 1e4 * DVec3::X)),
    ] {
        for method in METHODS {
            let frame = Frame::new(&lumigraph, desired.clone(), FieldOptions::default());
            for (engine, picture) in by_all(&frame, method) {
                assert_eq!(picture.unwrap(), nowhere, "{name}, {engine}, {method:?}");
            }
        }
    }
    // Exactly in the plane.
    let edge_on = View {
        camera_from_world: Rigid3::new(DQuat::IDENTITY, -shot.plane.point()),
        ..middle.clone()
    };
    let frame = Frame::new(&lumigraph, edge_on, FieldOptions::default());
    assert_eq!(frame.surface, Surface::Nothing);
    for method in METHODS {
        for (engine, picture) in by_all(&frame, method) {
            assert_eq!(picture.unwrap(), nowhere, "edge on, {engine}, {method:?}");
        }
    }
    // Next to it, whatever there is to see, it is never a number that is none.
    for off in [0.0, 1e-300, 1e-16, 1e-9, 1e-3] {
        let desired = moved(&in_the_plane, off * DVec3::new(0.6, 0.8, 0.0));
        for method in METHODS {
            let frame = Frame::new(&lumigraph, desired.clone(), FieldOptions::default());
            for (engine, picture) in by_all(&frame, method) {
                let picture = picture.unwrap();
                let hollow = |p: &&Rgba<u8>| p.0[3] == 0 && p.0 != [0; 4];
                assert_eq!(picture.pixels().filter(hollow).count(), 0, "{off} {engine}");
            }
        }
    }
    // No photos at all.
    lumigraph.sources.clear();
    lumigraph.photos = PhotoStore::from_images(Vec::new());
    for method in METHODS {
        let frame = Frame::new(&lumigraph, middle.clone(), FieldOptions::default());
        for (engine, picture) in by_all(&frame, method) {
            assert_eq!(picture.unwrap(), nowhere, "{engine}, {method:?}");
        }
    }
}

#[test]
fn transparent_photos_make_transparent_pictures() {
    let shot = Shot::of("shelf", 4, None);
    let mut lumigraph = shot.lumigraph();
    let clear = vec![RgbaImage::from_pixel(160, 120, Rgba([90, 80, 70, 0])); 4];
    lumigraph.photos = PhotoStore::from_images(clear);
    let desired = shot.views[0].between(&shot.views[1], 0.5);
    let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
    for method in METHODS {
        for (engine, picture) in by_all(&frame, method) {
            let nothing = picture.unwrap().pixels().all(|p| p.0 == [0; 4]);
            assert!(nothing, "{engine}, {method:?}");
        }
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
