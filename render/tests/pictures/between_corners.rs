//! Triangles that photos see all of by their corners, but not by what is seen between those.

use crate::common;

use calibrate::{Distortion, Lens, Rigid3, View};
use common::{assert_close, by_all, by_reference};
use glam::{DQuat, DVec2, DVec3};
use image::{Rgba, RgbaImage};
use proxy::{Mesh, MeshKind, Plane, Proxy, Solid};
use render::{
    FieldOptions, Frame, Lumigraph, Method, PhotoStore, SourceView, TriangulatedField, Visibility,
};
use std::sync::Arc;

/// From a place on the x axis along z.
fn view(x: f64, lens: Lens, [width, height]: [u32; 2]) -> View {
    View {
        lens,
        width,
        height,
        camera_from_world: Rigid3::new(DQuat::IDENTITY, DVec3::NEG_X * x),
    }
}

/// A red photo and a blue one, 160 × 120, so that colours tell who paints.
fn lumigraph(photos: [(f64, Lens); 2], proxy: Proxy) -> Lumigraph {
    let source = |(x, lens): (f64, Lens)| SourceView {
        name: format!("{x}.png"),
        view: view(x, lens, [160, 120]),
        gain: [1.0; 3],
        time_s: None,
        quarters: 0,
    };
    let sources = photos.map(source).to_vec();
    let photo = |color: [u8; 4]| RgbaImage::from_pixel(160, 120, Rgba(color));
    Lumigraph {
        visibility: Visibility::of(&proxy, &sources),
        photos: PhotoStore::from_images([[200, 30, 30, 255], [30, 30, 200, 255]].map(photo).into()),
        sources,
        proxy,
        points: Vec::new(),
    }
}

/// How many pixels one photo alone shows in triangles for which both have weight at all corners.
fn shown_by_one(frame: &Frame<'_>, field: &TriangulatedField) -> usize {
    let both_weigh = |triangle_idx: usize| {
        let entries = field.entries_of(triangle_idx);
        let mut weights = entries.iter().flat_map(|entry| entry.values);
        entries.len() == 2 && weights.all(|weight| weight > 0.0)
    };
    let triangles = field.triangles.iter().enumerate();
    let plain: Vec<[DVec2; 3]> = triangles
        .filter(|(i, triangle)| !triangle.bordered && both_weigh(*i))
        .map(|(_, triangle)| {
            triangle
                .corners
                .map(|corner| field.vertices[corner as usize])
        })
        .collect();
    let width = frame.desired.width as usize;
    let is_in_one = |at: DVec2| {
        plain.iter().any(|[a, b, c]| {
            let sides = [(a, b), (b, c), (c, a)];
            let is_inside = |(from, to): (&DVec2, &DVec2)| (to - from).perp_dot(at - from) > 0.0;
            sides.into_iter().all(is_inside)
        })
    };
    let contributors = field.contributors(frame);
    let pixels = contributors.iter().enumerate();
    let shown = pixels.filter(|(i, contributors)| {
        let at = DVec2::new((i % width) as f64, (i / width) as f64) + 0.5;
        contributors.len() == 1 && is_in_one(at)
    });
    shown.count()
}

/// That every engine leaves out what a photo does not show, at no fewer than `least` pixels.
fn check(lumigraph: &Lumigraph, desired: View, cells_across: u32, least: usize) {
    let frame = Frame::new(lumigraph, desired, FieldOptions::default());
    let field = TriangulatedField::new(&frame, cells_across).unwrap();
    let count = shown_by_one(&frame, &field);
    assert!(count >= least, "{count}");
    let method = Method::Triangulated { cells_across };
    let truth = by_reference(&frame, method).unwrap();
    for (engine, picture) in by_all(&frame, method).split_off(1) {
        assert_close(&picture.unwrap(), &truth, engine);
    }
}

/// A pole between a triangle's corners, which see the wall behind, is so near that it lies beside one photo.
#[test]
fn what_stands_before_a_triangles_corners_is_painted_by_those_that_show_it() {
    let corners = |[left, right]: [f64; 2], half: f64, z: f64| {
        let corners = [(left, -half), (right, -half), (right, half), (left, half)];
        corners.map(|(x, y)| DVec3::new(x, y, z))
    };
    let wall = corners([-6.0, 6.0], 4.0, 4.0);
    let pole = corners([0.02, 0.1], 2.0, 1.4);
    let mesh = Mesh {
        positions: [wall, pole].concat(),
        triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
    };
    let lens = |middle: DVec2| Lens::pinhole(DVec2::splat(110.0), middle);
    let of_photos = lens(DVec2::new(80.0, 60.0));
    let proxy = Proxy::Mesh(Arc::new(Solid::new(MeshKind::Mesh, mesh)));
    let lumigraph = lumigraph([(-1.1, of_photos), (0.8, of_photos)], proxy);
    let desired = view(0.0, lens(DVec2::new(80.0, 40.0)), [160, 80]);
    check(&lumigraph, desired, 4, 300);
}

/// A straight line between two corners is bent beyond the border of a photo taken through a fisheye.
#[test]
fn what_lies_beyond_a_bent_border_is_painted_by_those_that_show_it() {
    let fisheye = |focal: f64| {
        let distortion = Distortion::Fisheye { k: [0.0; 4] };
        Lens::new(DVec2::splat(focal), DVec2::new(80.0, 60.0), distortion)
    };
    let plane = Plane::new(DVec3::Z * 4.0, DVec3::Z).unwrap();
    let photos = [(-0.2, fisheye(60.0)), (0.2, fisheye(45.0))];
    let lumigraph = lumigraph(photos, Proxy::Plane(plane));
    let lens = Lens::pinhole(DVec2::splat(24.0), DVec2::new(50.0, 40.0));
    check(&lumigraph, view(0.0, lens, [100, 80]), 1, 60);
}
