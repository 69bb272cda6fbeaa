//! Which photos are decoded for a picture, and what becomes of those that cannot be.

use crate::common::{METHODS, Shot, by_all, by_reference, gpu};
use crate::engines::{moved, turned};

use glam::DVec3;
use image::RgbaImage;
use render::field::FieldEntry;
use render::{
    FieldOptions, FieldRows, Frame, Lumigraph, Method, PhotoError, PhotoStore, RenderError,
    TriangulatedField, cpu,
};
use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};

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
            Method::Exact => (FieldRows::new(&frame, None).all(), None),
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

#[test]
fn all_photos_that_a_picture_asks_for_in_vain_are_told_at_once() {
    let shot = Shot::of("shelf", 12, None);
    let desired = shot.views[0].between(&shot.views[1], 0.3);
    // What is decoded, and what is told, of photos some of which cannot be decoded.
    let drawn = |method, by_gpu: bool, broken: &[usize]| {
        let mut lumigraph = shot.lumigraph();
        let (store, decoded) = watched(&shot.photos, broken);
        lumigraph.photos = store;
        let frame = Frame::new(&lumigraph, desired.clone(), FieldOptions::default());
        let drawn = match by_gpu {
            true => gpu().unwrap().render(&frame, method),
            false => cpu::render(&frame, method),
        };
        let missed = lumigraph.photos.take_missed();
        let missed: BTreeSet<usize> = missed.iter().map(|error| error.source_idx).collect();
        assert_eq!(drawn.is_ok(), missed.is_empty());
        let decoded = decoded.lock().unwrap().clone();
        (decoded, missed)
    };
    let all: Vec<usize> = (0..12).collect();
    for by_gpu in [false, true] {
        if by_gpu && gpu().is_none() {
            continue;
        }
        for method in METHODS {
            let (asked, missed) = drawn(method, by_gpu, &[]);
            assert!(asked.len() > 2 && missed.is_empty(), "{asked:?}");
            assert_eq!(drawn(method, by_gpu, &all).1, asked, "{method:?}");
        }
    }
}
