//! Where pictures show nothing: beyond lenses and photos, and where these are transparent.

use crate::common::{METHODS, Shot, assert_close, by_all, by_reference, pinhole, psnr};
use crate::engines::{moved, turned};

use calibrate::{Distortion, Lens, Pixel, Rigid3, View};
use glam::{DQuat, DVec2, DVec3};
use image::{Rgba, RgbaImage};
use proxy::{Mesh, MeshKind, Proxy, Solid};
use render::{FieldOptions, Frame, Lumigraph, Method, PhotoStore, Surface};
use std::sync::Arc;

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
