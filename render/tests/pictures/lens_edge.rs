//! Photos that hold their lens's edge, beyond which there is nothing but black.

use crate::common::{METHODS, Shot, assert_close, by_all, by_reference};

use calibrate::{Distortion, Lens, Pixel, Rigid3, View};
use glam::{DQuat, DVec2, DVec3};
use image::{Rgba, RgbaImage};
use proxy::{Plane, Proxy};
use render::{FieldOptions, Frame, Lumigraph, PhotoStore, SourceView};

/// Turns back 52° from the axis, at 0.86 focal lengths.
const BARREL: Distortion = Distortion::Rational {
    k: [-0.2, 0.0, 0.0, 0.0, 0.0, 0.0],
    p: [0.0; 2],
};

/// From a place on the x axis along z.
fn view(x: f64, lens: Lens, [width, height]: [u32; 2]) -> View {
    View {
        lens,
        width,
        height,
        camera_from_world: Rigid3::new(DQuat::IDENTITY, DVec3::NEG_X * x),
    }
}

/// White where the lens sees, black beyond.
fn white(view: &View) -> RgbaImage {
    RgbaImage::from_fn(view.width, view.height, |x, y| {
        let ray = view.lens.unproject(Pixel::center_of(x, y));
        let value = if ray.is_some() { 255 } else { 0 };
        Rgba([value, value, value, 255])
    })
}

/// Two photos of a white wall, one of which ends within its picture.
#[test]
fn the_black_beyond_a_lens_does_not_bleed_into_pictures() {
    let round = Lens::new(DVec2::splat(80.0), DVec2::splat(80.0), BARREL);
    let straight = Lens::pinhole(DVec2::splat(80.0), DVec2::new(110.0, 80.0));
    let views = [
        view(0.0, round, [160, 160]),
        view(1.0, straight, [220, 160]),
    ];
    let photos: Vec<RgbaImage> = views.iter().map(white).collect();
    assert!(photos[0].pixels().any(|p| p.0[0] == 0));
    let named = |view: &View| SourceView {
        name: format!("{}.png", view.center().x),
        view: view.clone(),
        gain: [1.0; 3],
        time_s: None,
        quarters: 0,
    };
    let lumigraph = Lumigraph {
        points: Vec::new(),
        photos: PhotoStore::from_images(photos),
        sources: views.iter().map(named).collect(),
        proxy: Proxy::Plane(Plane::new(DVec3::Z * 4.0, DVec3::Z).unwrap()),
        visibility: None,
    };
    // Around the edge of what the first photo shows.
    let aside = Lens::pinhole(DVec2::splat(130.0), DVec2::new(-120.0, 24.0));
    let frame = Frame::new(
        &lumigraph,
        view(0.5, aside, [64, 48]),
        FieldOptions::default(),
    );
    let is_in_first = |x: u32| {
        let point = frame.proxy_point(Pixel::center_of(x, 24)).unwrap();
        frame.project(0, &point).is_some()
    };
    assert!(is_in_first(5) && !is_in_first(60));
    for method in METHODS {
        for (engine, picture) in by_all(&frame, method) {
            let darkest = picture
                .unwrap()
                .pixels()
                .map(|p| p.0[..3].iter().min().copied().unwrap_or(0).min(p.0[3]))
                .min()
                .unwrap();
            println!("{engine}, {method:?}: {darkest}");
            assert!(darkest >= 245, "{engine}, {method:?}: {darkest}");
        }
    }
}

#[test]
fn pictures_are_the_same_where_lenses_end_within_their_photos() {
    let principal = DVec2::new(81.0, 59.5);
    let tangential = Distortion::Rational {
        k: [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0],
        p: [0.002, -0.003],
    };
    let eucm = Distortion::Eucm {
        alpha: 0.62,
        beta: 1.1,
    };
    for (name, focal, distortion) in [
        ("barrel", DVec2::new(62.0, 60.0), BARREL),
        ("tangential", DVec2::splat(75.0), tangential),
        ("eucm", DVec2::splat(28.0), eucm),
    ] {
        let shot = Shot::of("shelf", 5, Some(Lens::new(focal, principal, distortion)));
        let mut lumigraph = shot.lumigraph();
        let mut photos = shot.photos.clone();
        for photo in &mut photos {
            // No matte: black, as cameras store it.
            photo.pixels_mut().for_each(|pixel| pixel.0[3] = 255);
        }
        lumigraph.photos = PhotoStore::from_images(photos);
        let between = shot.views[0].between(&shot.views[3], 0.4);
        let straight = Lens::pinhole(DVec2::splat(70.0), DVec2::new(80.0, 60.0));
        for (what, lens) in [("straight", straight), ("alike", between.lens)] {
            let desired = View {
                lens,
                ..between.clone()
            };
            let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
            for method in METHODS {
                let truth = by_reference(&frame, method).unwrap();
                for (engine, picture) in by_all(&frame, method).split_off(1) {
                    let what = format!("{name}, {what}, {engine}, {method:?}");
                    assert_close(&picture.unwrap(), &truth, &what);
                }
            }
        }
    }
}
