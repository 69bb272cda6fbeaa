use super::*;
use crate::frame::{Frame, FrameSource};
use crate::lumigraph::{Lumigraph, SourceView};
use crate::options::FieldOptions;
use crate::surface::Surface;
use calibrate::{Lens, Rigid3};
use glam::DVec2;
use image::{GrayImage, RgbaImage};
use proxy::{Mesh, MeshKind, Proxy, Solid};
use std::sync::Arc;

const SIZE: (u32, u32) = (80, 60);
/// How far the board is, and from where to where it reaches.
const BOARD: f64 = 2.0;
const LEFT: f64 = 0.2;
const RIGHT: f64 = 0.8;

/// Looks along z from a place on the x axis, 45° to either side.
fn view(x: f64) -> View {
    let center = DVec3::X * x;
    View {
        lens: Lens::pinhole(DVec2::splat(40.0), DVec2::new(40.0, 30.0)),
        width: SIZE.0,
        height: SIZE.1,
        camera_from_world: Rigid3::looking_at(center, center + DVec3::Z, DVec3::Y),
    }
}

/// A board before a far wall, which photos from these places see.
fn board(places: &[f64]) -> Lumigraph {
    let board = |left: f64, right: f64, high: f64, z: f64| Mesh {
        positions: [(left, -high), (right, -high), (right, high), (left, high)]
            .map(|(x, y)| DVec3::new(x, y, z))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    };
    let mut mesh = board(-200.0, 200.0, 200.0, 40.0);
    mesh.append(&board(LEFT, RIGHT, 9.0, BOARD));
    let proxy = Proxy::Mesh(Arc::new(Solid::new(MeshKind::Mesh, mesh)));
    let source = |x: &f64| SourceView {
        name: format!("{x}.png"),
        view: view(*x),
        gain: [1.0; 3],
        time_s: None,
        quarters: 0,
    };
    let sources: Vec<SourceView> = places.iter().map(source).collect();
    let photo = RgbaImage::new(SIZE.0, SIZE.1);
    Lumigraph {
        visibility: Visibility::of(&proxy, &sources),
        photos: PhotoStore::from_images(vec![photo; places.len()]),
        sources,
        proxy,
        points: Vec::new(),
    }
}

/// Of each pixel of the middle row, from the place 0: the tangent of its ray, and the depth it sees.
fn seen(lumigraph: &Lumigraph) -> Vec<(f64, f64)> {
    let frame = Frame::new(lumigraph, view(0.0), FieldOptions::default());
    let Surface::Facets(map) = &frame.surface else {
        panic!("facets")
    };
    let row = (0..SIZE.0 as usize).map(|x| (x, SIZE.1 as usize / 2));
    let of_pixel = |(x, y)| {
        let (ray, s) = look(map, &frame.desired, None, x, y).unwrap();
        let in_world = frame.desired.camera_from_world.rotation.conjugate() * ray;
        (in_world.x / in_world.z, in_world.z / s)
    };
    row.map(of_pixel).collect()
}

#[test]
fn what_all_photos_have_something_before_moves_to_where_one_looks_past() {
    // The photo's own ray to the point of the wall at tangent t passes the board's plane at 1 + 2 (t − 1/40).
    let behind = |place: f64, t: f64, z: f64| place + BOARD * (t - place / z);
    let hides = |x: f64| (LEFT..=RIGHT).contains(&x);
    let mut moved = 0;
    for (t, z) in seen(&board(&[1.0])) {
        let on_board = hides(BOARD * t);
        if on_board {
            assert_eq!(z, BOARD, "{t}");
            continue;
        }
        // Texels are two pixels, or 0.1 on the board. One may be half on it, one beside it is its rim in the
        // map, and one beside that is here.
        let by = 0.36;
        let at_wall = behind(1.0, t, 40.0);
        if t < -0.97 {
            // The photo does not have it in its image.
            continue;
        }
        if !(LEFT - by..RIGHT + by).contains(&at_wall) {
            assert!((z - 40.0).abs() < 1e-9, "{t}: {z}");
        } else if hides(at_wall) {
            moved += 1;
            // It looks past, and by no more than it must.
            let x = behind(1.0, t, z);
            assert!(z < 40.0 && (x - LEFT).abs() < by, "{t}: {z}, {x}");
        }
    }
    assert!(moved > 8, "{moved}");
}

#[test]
fn what_another_photo_shows_stays() {
    let far = |places: &[f64]| {
        let seen = seen(&board(places));
        seen.iter().filter(|(_, z)| *z > 39.0).count()
    };
    let (one, both) = (far(&[1.0]), far(&[1.0, -1.0]));
    // The board takes twelve of the 80, and hides as many from either photo.
    assert!(one < 58 && both == 68, "{one}, {both}");
}

#[test]
fn nothing_is_shown_right_beside_what_is_before_it() {
    // Four pixels of the photo are 1/160 of it.
    let mut lumigraph = board(&[1.0]);
    lumigraph.sources[0].view = view(1.0).resized(640, 480);
    let visibility = Visibility::of(&lumigraph.proxy, &lumigraph.sources).unwrap();
    let desired = view(0.0);
    let sources = [FrameSource::of(&lumigraph.sources[0].view, &desired)];
    let views = Views::new(&sources);
    let asked = Asked::new(&views, &visibility, &lumigraph.photos);
    // Past the board's left edge by so many pixels, at some depth.
    let at = |past_px: f64, z: f64| {
        let tangent = (LEFT - 1.0) / BOARD - past_px / 320.0;
        let point = DVec3::new(1.0 + tangent * z, 0.0, z);
        desired.camera_from_world.rotation * point
    };
    let shows = |past_px: f64, z: f64| asked.shows(0, at(past_px, z), 1.0);
    let seen = |past_px: f64, z: f64| asked.says(0, at(past_px, z), 1.0) == Says::Seen;
    assert!(!shows(3.0, 2.4) && shows(12.0, 2.4));
    // There it is seen, but nothing moves there. What is hardly farther than the board may be a part of it.
    assert!(seen(3.0, 2.4) && shows(3.0, 2.1));
}

#[test]
fn what_a_mask_ignores_shows_nothing() {
    let mut lumigraph = board(&[1.0, -1.0]);
    let far = |lumigraph: &Lumigraph| {
        let seen = seen(lumigraph);
        seen.iter().filter(|(_, z)| *z > 39.0).count()
    };
    let one = far(&board(&[1.0]));
    let nothing = GrayImage::new(SIZE.0, SIZE.1);
    let photos = std::mem::replace(&mut lumigraph.photos, PhotoStore::from_images(Vec::new()));
    lumigraph.photos = photos.with_masks(&[false, true], move |_| Ok(nothing.clone()));
    // As if there were the first photo alone, but for what only the other has in its image.
    let masked = far(&lumigraph);
    assert!(masked >= one && masked < one + 4, "{masked}, {one}");
}

#[test]
fn all_moves_that_nobody_sees_and_that_is_shown_before() {
    let lumigraph = board(&[1.0, 0.8, 300.0, -300.0]);
    let visibility = lumigraph.visibility.as_ref().unwrap();
    let desired = view(0.0);
    let places = lumigraph
        .sources
        .iter()
        .map(|s| FrameSource::of(&s.view, &desired));
    let sources: Vec<FrameSource> = places.collect();
    let Proxy::Mesh(solid) = &lumigraph.proxy else {
        panic!("a mesh")
    };
    let rays = Rays::of(&desired.lens, SIZE);
    let map = FacetMap::of_mesh(solid, &desired, rays.as_ref());
    let photos = &lumigraph.photos;
    let views = Views::new(&sources);
    let asked = Asked::new(&views, visibility, photos);
    let moved = hidden(&map, &desired, rays.as_ref(), &views, visibility, photos);
    let is_seen = |x: usize, y: usize| {
        let (ray, s) = look(&map, &desired, rays.as_ref(), x, y).unwrap();
        let all = || (0..sources.len()).map(|view| asked.says(view, ray, s));
        let is_seen = all().any(|says| says == Says::Seen);
        (is_seen || !all().any(|says| says == Says::Hidden), s)
    };
    let (mut count, mut nearest, mut stays) = (0, 0, 0);
    for (y, row) in moved.iter().enumerate() {
        for x in 0..SIZE.0 as usize {
            let (ray, s) = look(&map, &desired, rays.as_ref(), x, y).unwrap();
            let corner = [x, y].map(|at| at / BLOCK * BLOCK);
            let (first, first_s) = is_seen(corner[0], corner[1]);
            let beside = [[0, 0], [BLOCK, 0], [0, BLOCK], [BLOCK, BLOCK]];
            let beside = beside.map(|[right, below]| [corner[0] + right, corner[1] + below]);
            let mut beside = beside
                .iter()
                .filter(|[x, y]| *x < SIZE.0 as usize && *y < SIZE.1 as usize);
            let are_alike = beside.all(|[x, y]| is_seen(*x, *y).0 == first);
            let is_seen = match are_alike && are_near(s, first_s) {
                true => first,
                false => is_seen(x, y).0,
            };
            let shown = |s: f64| (0..sources.len()).find(|view| asked.shows(*view, ray, s));
            let first = (1..=STEPS).find(|k| shown(s * factor(*k)).is_some());
            let found = row.iter().find(|moved| moved.x == x);
            let moves = !is_seen && first.is_some();
            assert!(moves || found.is_none(), "{x} {y}");
            // It may stay as one beside it does.
            stays += usize::from(moves && found.is_none());
            if let Some((moved, k)) = found.zip(first) {
                // It may move as others beside it do.
                let at = moved.plane.dot(ray);
                assert!(at > s * factor(k - 1), "{x} {y}");
                nearest += usize::from(at < s * factor(k + 3));
                let view = moved.source_idx as usize;
                assert!(asked.shows(view, ray, 1.001 * at) || asked.shows(view, ray, 0.999 * at));
                count += 1;
            }
        }
    }
    assert!(count > 100 && nearest > count * 3 / 4, "{count}, {nearest}");
    assert!(stays < count / 50, "{count}, {stays}");
}
