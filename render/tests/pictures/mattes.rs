//! Object mattes: they become coverage, together with masks and over holes of one among them.

use crate::common::{METHODS, Shot, by_all};
use crate::masks::{SIZE, frame, store};

use calibrate::{Pixel, View};
use image::{GrayImage, Luma, Rgba, RgbaImage};
use render::{Lumigraph, Method, PhotoStore};

#[test]
fn mattes_become_coverage() {
    // A disc of the wall, cut out of every photo.
    let shot = Shot::of("wall", 9, None);
    let mut photos = shot.photos.clone();
    let middle = shot.plane.point();
    let distance = shot.plane.signed_distance(shot.views[0].center()).abs();
    let inside = |view: &View, x: u32, y: u32| {
        let ray = view.lens.unproject(Pixel::center_of(x, y)).unwrap();
        let world_from_camera = view.camera_from_world.inverse();
        let towards = world_from_camera * ray - view.center();
        let at = shot.plane.intersect(view.center(), towards);
        at.map_or(0.0, |at| {
            (60.0 * (0.2 - at.distance(middle) / distance)).clamp(0.0, 1.0)
        })
    };
    for (view, photo) in shot.views.iter().zip(&mut photos) {
        for (x, y, pixel) in photo.enumerate_pixels_mut() {
            pixel.0[3] = (255.0 * inside(view, x, y)).round() as u8;
        }
    }
    let lumigraph = Lumigraph {
        photos: PhotoStore::from_images(photos),
        ..shot.lumigraph()
    };
    let desired = shot.views[0].between(&shot.views[4], 0.5);
    for method in METHODS {
        for (engine, picture) in by_all(&frame(&lumigraph, &desired), method) {
            let mut error = 0.0;
            for (x, y, pixel) in picture.unwrap().enumerate_pixels() {
                error += (f64::from(pixel.0[3]) / 255.0 - inside(&desired, x, y)).abs();
            }
            let mean = error / f64::from(SIZE.0 * SIZE.1);
            println!("{engine}, {method:?}: coverage is off by {mean:.5}");
            assert!(mean < 0.01, "{engine}, {method:?}: {mean}");
        }
    }
}

#[test]
fn soft_mattes_and_masks_meet_in_one_photo() {
    // Half covered by its matte, and half of it ignored: what is left is half covered.
    let shot = Shot::of("wall", 2, None);
    let mut photos = shot.photos.clone();
    photos
        .iter_mut()
        .flat_map(RgbaImage::pixels_mut)
        .for_each(|p: &mut Rgba<u8>| p.0[3] = 128);
    let left = GrayImage::from_fn(SIZE.0, SIZE.1, |x, _| Luma([u8::from(x < 80) * 255]));
    let lumigraph = Lumigraph {
        photos: store(photos, vec![Some(left.clone()), Some(left)]),
        ..shot.lumigraph()
    };
    for (engine, picture) in by_all(&frame(&lumigraph, &shot.views[0]), Method::Exact) {
        let picture = picture.unwrap();
        assert_eq!(picture.get_pixel(40, 60).0[3], 128, "{engine}");
    }
}

#[test]
fn a_hole_in_one_matte_among_photos_that_show_the_object_is_no_hole_in_it() {
    // Midway between two photos, one of which shows nothing: it counts a quarter.
    let shot = Shot::of("wall", 2, None);
    let mut photos = shot.photos.clone();
    photos[0].pixels_mut().for_each(|p| p.0[3] = 0);
    let lumigraph = Lumigraph {
        photos: PhotoStore::from_images(photos),
        ..shot.lumigraph()
    };
    let desired = shot.views[0].between(&shot.views[1], 0.5);
    for method in METHODS {
        for (engine, picture) in by_all(&frame(&lumigraph, &desired), method) {
            let [.., alpha] = picture.unwrap().get_pixel(SIZE.0 / 2, SIZE.1 / 2).0;
            assert!(alpha.abs_diff(204) <= 2, "{engine}, {method:?}: {alpha}");
        }
    }
}
