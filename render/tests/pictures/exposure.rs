//! Photos of different exposures in one frame.

use crate::common;

use common::{Shot, assert_close, by_all};
use image::{Rgba, RgbaImage};
use render::{FieldOptions, Frame, Lumigraph, Method, PhotoStore, seams};

/// A gain of each channel for the photo of an index, at most one so that nothing is clipped.
fn gain(i: usize) -> [f64; 3] {
    let g = i as f64;
    [1.0 - 0.06 * g, 0.6 + 0.04 * g, 0.8 + 0.02 * (g - 4.0).abs()]
}

/// A photo exposed by a gain.
fn exposed(photo: &RgbaImage, gain: [f64; 3]) -> RgbaImage {
    let mut photo = photo.clone();
    for pixel in photo.pixels_mut() {
        for c in 0..3 {
            pixel.0[c] = (f64::from(pixel.0[c]) * gain[c]).round().min(255.0) as u8;
        }
    }
    photo
}

/// The wall in light so poor that no photo's values reach the shoulder.
fn dim_wall() -> Shot {
    let mut shot = Shot::of("wall", 9, None);
    for photo in &mut shot.photos {
        *photo = exposed(photo, [0.25; 3]);
    }
    shot
}

/// The same places photographed with each photo's own gain, which is known if `known`.
fn altered(shot: &Shot, known: bool) -> Lumigraph {
    let mut lumigraph = shot.lumigraph();
    let photos = shot.photos.iter().enumerate();
    let photos = photos.map(|(i, photo)| exposed(photo, gain(i)));
    lumigraph.photos = PhotoStore::from_images(photos.collect());
    if known {
        let sources = lumigraph.sources.iter_mut().enumerate();
        sources.for_each(|(i, source)| source.gain = gain(i));
    }
    lumigraph
}

const METHODS: [Method; 2] = [Method::Exact, Method::Triangulated { cells_across: 16 }];

/// A frame by every engine at hand and both methods.
fn pictures(frame: &Frame<'_>) -> Vec<(&'static str, RgbaImage)> {
    let pictures = METHODS.into_iter().flat_map(|method| by_all(frame, method));
    pictures
        .map(|(name, picture)| (name, picture.unwrap()))
        .collect()
}

#[test]
fn a_frame_is_as_if_all_photos_had_its_exposure() {
    let shot = dim_wall();
    let (plain, known) = (shot.lumigraph(), altered(&shot, true));
    let options = FieldOptions::default();
    for share in [0.1, 0.5] {
        let desired = shot.views[3].between(&shot.views[4], share);
        let unaltered = pictures(&Frame::new(&plain, desired.clone(), options));
        let frame = Frame::new(&known, desired, options);
        // One exposure for the frame, between those of the photos in it.
        let of_frame = |i: usize, c: usize| frame.sources[i].exposure[c] * gain(i)[c];
        for c in 0..3 {
            assert!((1..9).all(|i| (of_frame(i, c) - of_frame(0, c)).abs() < 1e-12));
            let gains = || (0..9).map(|i| gain(i)[c]);
            let (low, high) = (
                gains().fold(f64::INFINITY, f64::min),
                gains().fold(0.0, f64::max),
            );
            assert!((low..=high).contains(&of_frame(0, c)));
        }
        let gain_of_frame = std::array::from_fn(|c| of_frame(0, c));
        for ((what, picture), (_, unaltered)) in pictures(&frame).iter().zip(&unaltered) {
            assert_close(picture, &exposed(unaltered, gain_of_frame), what);
        }
    }
}

#[test]
fn at_a_photos_own_place_its_exposure_is_kept() {
    let shot = Shot::of("wall", 9, None);
    let (known, unknown) = (altered(&shot, true), altered(&shot, false));
    for i in [0, 4, 8] {
        let desired = shot.views[i].clone();
        let frames = [&known, &unknown]
            .map(|lumigraph| Frame::new(lumigraph, desired.clone(), FieldOptions::default()));
        let [with, without] = frames.each_ref().map(pictures);
        for ((what, with), (_, without)) in with.iter().zip(&without) {
            assert!(with == without, "photo {i}, {what}");
        }
    }
}

/// All photos in one colour.
fn plain_wall(color: Rgba<u8>) -> Shot {
    let mut shot = Shot::of("wall", 9, None);
    for photo in &mut shot.photos {
        photo.pixels_mut().for_each(|pixel| *pixel = color);
    }
    shot
}

#[test]
fn seams_go_where_gains_are_known() {
    let seams_of = |shot: &Shot, lumigraph: &Lumigraph| {
        let desired = shot.views[3].between(&shot.views[4], 0.5);
        let frame = Frame::new(lumigraph, desired, FieldOptions::default());
        seams(&frame).unwrap().unwrap()
    };
    // Without details nothing but exposure is left to differ.
    let shot = plain_wall(Rgba([60, 60, 60, 255]));
    let of = |lumigraph: &Lumigraph| seams_of(&shot, lumigraph);
    let plain = of(&shot.lumigraph());
    let (known, unknown) = (of(&altered(&shot, true)), of(&altered(&shot, false)));
    assert!(plain < 1e-4 && known < 0.5, "{plain}, {known}");
    assert!(unknown > 5.0 * known, "{unknown}, {known}");
    // With them, what is left is what they leave between photos of one exposure.
    let shot = dim_wall();
    let of = |lumigraph: &Lumigraph| seams_of(&shot, lumigraph);
    let (plain, known) = (of(&shot.lumigraph()), of(&altered(&shot, true)));
    assert!(known < plain + 0.1, "{known}, {plain}");
}

#[test]
fn white_stays_white() {
    let shot = plain_wall(Rgba([255; 4]));
    let mut lumigraph = shot.lumigraph();
    let sources = lumigraph.sources.iter_mut().enumerate();
    sources.for_each(|(i, source)| source.gain = gain(i));
    let desired = shot.views[3].between(&shot.views[4], 0.5);
    let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
    assert!(frame.exposures_differ());
    for (what, picture) in pictures(&frame) {
        let seen = picture.pixels().filter(|p| p.0[3] == 255);
        assert!(seen.clone().count() > 10_000, "{what}");
        assert!(seen.into_iter().all(|p| p.0 == [255; 4]), "{what}");
    }
}
