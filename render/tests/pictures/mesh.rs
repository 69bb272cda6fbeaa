//! Meshes as proxies, and what hides what from a photo.

use crate::common;

use calibrate::{Distortion, Lens, Pixel, View};
use common::{METHODS, Shot, assert_close, by_all, pinhole, psnr, psnr_covered, unmoved};
use glam::{DVec2, DVec3};
use image::{Rgba, RgbaImage};
use proxy::{Mesh, MeshKind, Proxy, Solid};
use rayon::prelude::*;
use render::gpu::{DeviceLimits, Gpu, ShadeBy};
use render::{
    FieldOptions, Frame, Lumigraph, Method, Moment, Part, PhotoStore, SourceView, Surface,
    Visibility, cpu, reference,
};
use std::sync::Arc;
use std::time::Duration;

fn quad(corners: [DVec3; 4]) -> Mesh {
    Mesh {
        positions: corners.to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}

/// A wall with a pillar before it: a box of 1 × 2 × 0.3 in the middle, 1.5 off the wall.
pub(crate) fn pillar() -> Mesh {
    let mut mesh = wall();
    let corner = |x: f64, y: f64, z: f64| DVec3::new(0.5 * x, y, 2.35 + 0.15 * z);
    for (a, b, c) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
        for side in [-1.0, 1.0] {
            let at = |u: f64, v: f64| {
                let mut p = [0.0; 3];
                (p[a], p[b], p[c]) = (side, u, v);
                corner(p[0], p[1], p[2])
            };
            mesh.append(&quad([
                at(-1.0, -1.0),
                at(1.0, -1.0),
                at(1.0, 1.0),
                at(-1.0, 1.0),
            ]));
        }
    }
    mesh
}

fn wall() -> Mesh {
    let corner = |x: f64, y: f64| DVec3::new(6.0 * x, 4.0 * y, 4.0);
    quad([
        corner(-1.0, -1.0),
        corner(1.0, -1.0),
        corner(1.0, 1.0),
        corner(-1.0, 1.0),
    ])
}

/// Smooth colours, the pillar's unlike the wall's.
fn color(p: DVec3) -> [f64; 3] {
    let wave = |v: f64| 0.5 + 0.3 * (3.0 * v).sin();
    if p.z > 3.9 {
        [wave(p.x), wave(p.y + 1.0), 0.2]
    } else {
        [0.1, 0.2 * wave(2.0 * p.y), wave(p.x + p.y)]
    }
}

/// What a camera sees of the mesh, 4 × 4 rays a pixel.
fn photo(solid: &Solid, view: &View) -> RgbaImage {
    let world_from_camera = view.camera_from_world.rotation.conjugate();
    let center = view.center();
    RgbaImage::from_fn(view.width, view.height, |x, y| {
        let mut sum = DVec3::ZERO;
        for k in 0..16 {
            let at = |i: u32, k: u32| f64::from(i) + (f64::from(k) + 0.5) / 4.0;
            let ray = view
                .lens
                .unproject(Pixel::new(at(x, k % 4), at(y, k / 4)))
                .unwrap();
            let ray = world_from_camera * ray;
            if let Some(hit) = solid.first_hit(center, ray) {
                sum += DVec3::from_array(color(center + ray * hit.along));
            }
        }
        let [r, g, b] = (sum / 16.0 * 255.0).to_array().map(|v| v.round() as u8);
        Rgba([r, g, b, 255])
    })
}

/// Cameras along a line, all looking straight ahead.
fn views() -> Vec<View> {
    let view = |i: i32| {
        let center = DVec3::new(0.5 * f64::from(i - 3), 0.1 * f64::from(i % 3), 0.0);
        pinhole(center, center + DVec3::Z, 110.0, (160, 120))
    };
    (0..7).map(view).collect()
}

pub(crate) fn lumigraph(mesh: Mesh, kind: MeshKind) -> Lumigraph {
    let solid = Arc::new(Solid::new(kind, mesh));
    lumigraph_of(&solid, |view| photo(&solid, view))
}

/// The same from the first so many of its cameras.
pub(crate) fn lumigraph_of_few(mesh: Mesh, kind: MeshKind, count: usize) -> Lumigraph {
    let solid = Arc::new(Solid::new(kind, mesh));
    let few = views().into_iter().take(count).collect();
    lumigraph_from(&solid, few, |view| photo(&solid, view))
}

fn lumigraph_of(solid: &Arc<Solid>, photo: impl Fn(&View) -> RgbaImage) -> Lumigraph {
    lumigraph_from(solid, views(), photo)
}

fn lumigraph_from(
    solid: &Arc<Solid>,
    views: Vec<View>,
    photo: impl Fn(&View) -> RgbaImage,
) -> Lumigraph {
    let photos = views.iter().map(photo).collect();
    let source = |(i, view): (usize, View)| SourceView {
        name: format!("{i}.png"),
        view,
        gain: [1.0; 3],
        time_s: None,
        quarters: 0,
    };
    let sources: Vec<SourceView> = views.into_iter().enumerate().map(source).collect();
    let proxy = Proxy::Mesh(Arc::clone(solid));
    Lumigraph {
        visibility: Visibility::of(&proxy, &sources),
        sources,
        photos: PhotoStore::from_images(photos),
        proxy,
        points: Vec::new(),
    }
}

pub(crate) fn solid_of(lumigraph: &Lumigraph) -> &Solid {
    match &lumigraph.proxy {
        Proxy::Mesh(solid) => solid,
        _ => panic!("a mesh"),
    }
}

/// Between two photos, and nearer; through another lens, too.
pub(crate) fn desired_views() -> Vec<(&'static str, View)> {
    let from = |x: f64, z: f64| {
        let center = DVec3::new(x, 0.05, z);
        pinhole(center, center + DVec3::Z, 110.0, (160, 120))
    };
    let fisheye = Distortion::Fisheye {
        k: [0.02, -0.01, 0.002, 0.0],
    };
    let lens = Lens::new(DVec2::splat(95.0), DVec2::new(81.0, 59.5), fisheye);
    vec![
        ("between", from(0.25, 0.0)),
        ("aside", from(-0.8, 0.0)),
        ("nearer", from(0.3, 0.5)),
        (
            "fisheye",
            View {
                lens,
                ..from(0.25, 0.0)
            },
        ),
    ]
}

#[test]
fn every_engine_draws_the_same_picture() {
    engines_agree(&lumigraph(pillar(), MeshKind::Mesh));
}

/// Of photos so large that a texel of their distance maps is four pixels across.
#[test]
fn every_engine_draws_the_same_picture_of_large_photos() {
    let solid = Arc::new(Solid::new(MeshKind::Mesh, pillar()));
    let large = |view: View| View {
        lens: Lens::pinhole(DVec2::new(2200.0, 44.0), DVec2::new(1600.0, 24.0)),
        width: 3200,
        height: 48,
        ..view
    };
    let views = views().into_iter().step_by(2).map(large).collect();
    engines_agree(&lumigraph_from(&solid, views, |view| photo(&solid, view)));
}

fn engines_agree(lumigraph: &Lumigraph) {
    for (name, desired) in desired_views() {
        let frame = Frame::new(lumigraph, desired, FieldOptions::default());
        let exact = reference::render_exact(&frame).unwrap();
        for (engine, picture) in by_all(&frame, Method::Exact) {
            assert_close(&picture.unwrap(), &exact, &format!("{name}, {engine}"));
        }
        for (engine, picture) in by_all(&frame, Method::TRIANGULATED) {
            let picture = picture.unwrap();
            let holes = picture.pixels().zip(exact.pixels());
            let holes = holes.filter(|(p, e)| p.0[3] != e.0[3]).count();
            assert!(
                holes * 500 <= (160 * 120),
                "{name}, {engine}: {holes} holes"
            );
            let db = psnr(&unmoved(&frame, &picture), &unmoved(&frame, &exact));
            println!("{name}, {engine}, triangulated against exact: {db:.1} dB");
            assert!(db >= 40.0, "{name}, {engine}: {db} dB");
        }
    }
}

#[test]
fn what_only_one_photo_has_between_the_corners_of_triangles_is_no_hole() {
    // 1. A post so thin that no corner of a grid of eight cells sees it. The photo that has it has nothing of the
    // wall that those see.
    let post = |x: f64, y: f64| DVec3::new(0.5 / 110.0 * (10.0 + 1.5 * x), y, 0.5);
    let mut mesh = wall();
    mesh.append(&quad([
        post(-1.0, -0.5),
        post(1.0, -0.5),
        post(1.0, 0.5),
        post(-1.0, 0.5),
    ]));
    let solid = Arc::new(Solid::new(MeshKind::Mesh, mesh));
    let size = (160, 120);
    let aside = DVec3::new(-1.5, 0.0, 0.1);
    let views = vec![
        pinhole(DVec3::X * 2.5, DVec3::Z * 4.0, 110.0, size),
        pinhole(DVec3::X * 2.4, DVec3::Z * 4.0, 110.0, size),
        pinhole(aside, post(0.0, 0.0), 220.0, size),
    ];
    let lumigraph = lumigraph_from(&solid, views, |view| photo(&solid, view));
    // 2. It is drawn all the same.
    let desired = pinhole(DVec3::ZERO, DVec3::Z, 110.0, size);
    let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
    let exact = reference::render_exact(&frame).unwrap();
    let is_post = |x: u32| (88..92).contains(&x);
    let of_post = exact.enumerate_pixels().filter(|(x, ..)| is_post(*x));
    assert!(of_post.filter(|(.., p)| p.0[3] > 0).count() > 300);
    let method = Method::Triangulated { cells_across: 8 };
    for (engine, picture) in by_all(&frame, method) {
        let picture = picture.unwrap();
        for ((x, y, p), e) in picture.enumerate_pixels().zip(exact.pixels()) {
            assert_eq!(p.0[3], e.0[3], "{engine}, {x}, {y}");
        }
    }
}

/// The wall as so many squares, a little bent.
fn bent_wall(across: u32) -> Mesh {
    let side = across + 1;
    let at = |i: u32| {
        let [x, y] = [i % side, i / side].map(|k| f64::from(k) / f64::from(across) * 2.0 - 1.0);
        DVec3::new(
            6.0 * x,
            4.0 * y,
            4.0 + 0.2 * (5.0 * x).sin() * (4.0 * y).cos(),
        )
    };
    let square = |i: u32| {
        let [a, b, c, d] = [i, i + 1, i + side + 1, i + side];
        [[a, b, c], [a, c, d]]
    };
    let corners = (0..across * side).filter(|i| i % side < across);
    Mesh {
        positions: (0..side * side).map(at).collect(),
        triangles: corners.flat_map(square).collect(),
    }
}

#[test]
fn colours_by_fragments_and_by_workgroups_have_the_same_bytes() {
    if common::gpu().is_none() {
        return;
    }
    let open = |shade_by| {
        let limits = DeviceLimits {
            shade_by: Some(shade_by),
            ..DeviceLimits::default()
        };
        Gpu::open_within(limits).unwrap()
    };
    let [mut fragments, mut workgroups] = [ShadeBy::Fragments, ShadeBy::Workgroups].map(open);
    // Of few facets, and of more than pixels.
    for mesh in [pillar(), bent_wall(200)] {
        let lumigraph = lumigraph(mesh, MeshKind::Mesh);
        for (name, view) in desired_views() {
            // No multiple of a workgroup's side.
            let desired = View {
                width: 157,
                height: 117,
                ..view
            };
            let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
            for method in METHODS {
                let [a, b] = [&mut fragments, &mut workgroups]
                    .map(|gpu| gpu.render(&frame, method).unwrap());
                assert!(a.pixels().any(|p| p.0[3] > 0), "{name}");
                assert!(a == b, "{name}, {method:?}");
            }
        }
    }
}

/// Those that see no more than the photos do together.
pub(crate) fn within_the_photos() -> Vec<(&'static str, View)> {
    let all = desired_views().into_iter();
    all.filter(|(name, _)| *name != "fisheye").collect()
}

#[test]
fn what_is_hidden_from_a_photo_is_not_painted_with_what_hides_it() {
    let mut lumigraph = lumigraph(pillar(), MeshKind::Mesh);
    let truth: Vec<RgbaImage> = within_the_photos()
        .iter()
        .map(|(_, view)| photo(solid_of(&lumigraph), view))
        .collect();
    let scores = |lumigraph: &Lumigraph| -> Vec<f64> {
        let draw = |(_, desired): &(_, View)| {
            let frame = Frame::new(lumigraph, desired.clone(), FieldOptions::default());
            cpu::render(&frame, Method::Exact).unwrap()
        };
        let pictures: Vec<RgbaImage> = within_the_photos().iter().map(draw).collect();
        let scored = pictures.iter().zip(&truth);
        scored.map(|(p, t)| psnr_covered(p, t)).collect()
    };
    let with = scores(&lumigraph);
    lumigraph.visibility = None;
    let without = scores(&lumigraph);
    for (((name, _), with), without) in within_the_photos().iter().zip(&with).zip(&without) {
        println!("{name}: {with:.1} dB with visibility, {without:.1} without");
        assert!(*with > without + 5.0, "{name}: {with} against {without}");
        assert!(*with > 26.0, "{name}: {with}");
    }
}

#[test]
fn a_view_at_a_photos_own_pose_gives_that_photo_back() {
    let lumigraph = lumigraph(pillar(), MeshKind::Mesh);
    for (i, view) in views().into_iter().enumerate() {
        let frame = Frame::new(&lumigraph, view, FieldOptions::default());
        let own = lumigraph.photos.get(i).unwrap();
        for method in METHODS {
            for (engine, picture) in by_all(&frame, method) {
                let db = psnr_covered(&picture.unwrap(), &own.levels[0]);
                assert!(db >= 50.0, "{i}, {engine}, {method:?}: {db} dB");
            }
        }
    }
}

/// A shot with a square around a point for its proxy, half as wide as `reach`, parallel to its plane.
pub(crate) fn meshed(shot: &Shot, around: DVec3, reach: f64) -> Lumigraph {
    let across = shot.plane.normal().any_orthonormal_vector();
    let along = shot.plane.normal().cross(across);
    let corner = |x: f64, y: f64| around + reach * (x * across + y * along);
    let mesh = quad([
        corner(-1.0, -1.0),
        corner(1.0, -1.0),
        corner(1.0, 1.0),
        corner(-1.0, 1.0),
    ]);
    Lumigraph {
        proxy: Proxy::Mesh(Arc::new(Solid::new(MeshKind::Mesh, mesh))),
        ..shot.lumigraph()
    }
}

#[test]
fn a_flat_mesh_is_a_plane() {
    let shot = Shot::of("wall", 6, None);
    let flat = shot.lumigraph();
    let meshed = meshed(&shot, shot.plane.point(), 50.0);
    let desired = shot.views[0].between(&shot.views[3], 0.4);
    let of = |lumigraph: &Lumigraph, method| {
        let frame = Frame::new(lumigraph, desired.clone(), FieldOptions::default());
        cpu::render(&frame, method).unwrap()
    };
    for method in METHODS {
        // Where photos show the plane; a mesh is moved to where they show it elsewhere, too.
        let db = psnr_covered(&of(&flat, method), &of(&meshed, method));
        assert!(db >= 60.0, "{method:?}: {db} dB");
    }
}

/// Where the mesh is moved to what photos see, too: not to what only others would.
#[test]
fn photos_of_other_moments_might_as_well_not_be_there() {
    let mut all = lumigraph(pillar(), MeshKind::Mesh);
    let times = (0..7).map(f64::from);
    let timed = all.sources.iter_mut().zip(times);
    timed.for_each(|(source, time_s)| source.time_s = Some(time_s));
    let photos = (0..3).map(|i| all.photos.get(i).unwrap().levels[0].clone());
    let sources = all.sources[..3].to_vec();
    let some = Lumigraph {
        visibility: Visibility::of(&all.proxy, &sources),
        photos: PhotoStore::from_images(photos.collect()),
        proxy: all.proxy.clone(),
        points: Vec::new(),
        sources,
    };
    let options = FieldOptions {
        k: 2,
        ..FieldOptions::default()
    };
    let moment = Moment {
        time_s: 1.0,
        period_s: None,
        window_s: Some(1.5),
    };
    let part = Part {
        moment: Some(moment),
        ..Part::default()
    };
    let mut moved = 0;
    for (name, desired) in desired_views() {
        let [of_all, of_some] =
            [&all, &some].map(|of| Frame::with(of, desired.clone(), options, &part));
        assert_eq!(of_all.taking_part().collect::<Vec<_>>(), [0, 1, 2]);
        if let Surface::Facets(map) = &of_all.surface {
            moved += map.moved().filter(|is_moved| *is_moved).count();
        }
        for method in METHODS {
            let pictures = by_all(&of_all, method)
                .into_iter()
                .zip(by_all(&of_some, method));
            for ((engine, a), (_, b)) in pictures {
                assert!(a.unwrap() == b.unwrap(), "{name}, {engine}, {method:?}");
            }
        }
    }
    assert!(moved > 1000, "{moved}");
}

/// Threads whose work others share take up work of theirs meanwhile, which may be to wait for what they make.
#[test]
fn distances_asked_for_on_many_threads_are_not_waited_for_in_a_circle() {
    let (done, is_done) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(16).build();
        let solid = Arc::new(Solid::new(MeshKind::Mesh, bent_wall(100)));
        let ask = |lumigraph: &Lumigraph| {
            let visibility = lumigraph.visibility.as_ref().unwrap();
            let asked = (0..700).into_par_iter().with_max_len(1);
            asked.for_each(|i| {
                visibility.map(i * 3 % 7);
            });
        };
        let pool = pool.unwrap();
        for _ in 0..100 {
            let lumigraph = lumigraph_of(&solid, |_| RgbaImage::new(160, 120));
            pool.install(|| ask(&lumigraph));
        }
        // Lenses that bend, each in its own way: their rays have to be found, too.
        for _ in 0..4 {
            let mut lumigraph = lumigraph_of(&solid, |_| RgbaImage::new(160, 120));
            for (i, source) in lumigraph.sources.iter_mut().enumerate() {
                let k1 = 0.01 * i as f64 - 0.1;
                let bent = Distortion::Rational {
                    k: [k1, 0.0, 0.0, 0.0, 0.0, 0.0],
                    p: [0.0; 2],
                };
                let view = source.view.resized(800, 600);
                let lens = Lens::new(view.lens.focal, view.lens.principal, bent);
                source.view = View { lens, ..view };
            }
            lumigraph.visibility = Visibility::of(&lumigraph.proxy, &lumigraph.sources);
            pool.install(|| ask(&lumigraph));
        }
        done.send(()).unwrap();
    });
    let waited = is_done.recv_timeout(Duration::from_secs(120));
    assert!(waited.is_ok(), "threads wait for one another");
}

#[test]
fn surfaces_that_cannot_hide_themselves_ask_for_no_distances() {
    let convex = lumigraph(wall(), MeshKind::Tunnel);
    assert!(convex.visibility.is_none());
    assert!(Visibility::of(&Proxy::Points { within: None }, &convex.sources).is_none());
}

#[test]
fn where_no_photo_sees_a_point_they_all_say_what_they_can() {
    // Between wall and pillar, looking at the wall from where no photo sees it.
    let lumigraph = lumigraph(pillar(), MeshKind::Mesh);
    let center = DVec3::new(0.0, 0.0, 2.6);
    let desired = pinhole(center, DVec3::new(0.0, 0.0, 4.0), 100.0, (80, 60));
    let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
    for (engine, picture) in by_all(&frame, Method::Exact) {
        let picture = picture.unwrap();
        let covered = picture.pixels().filter(|p| p.0[3] == 255).count();
        assert_eq!(covered, 80 * 60, "{engine}");
    }
}
