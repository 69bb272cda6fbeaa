//! Of the photos of a lumigraph.

use super::*;
use std::sync::mpsc::channel;

#[test]
fn a_mask_that_cannot_be_decoded_ignores_all_and_tells() {
    let store = PhotoStore::new(3, |_| Ok(RgbaImage::new(4, 4)));
    let store = store.with_masks(&[true, false, true], |i| match i {
        0 => Ok(GrayImage::new(4, 3)),
        _ => Err("c.png: corrupt".to_owned()),
    });
    assert_eq!(
        (0..3).map(|i| store.is_masked(i)).collect::<Vec<_>>(),
        [true, false, true]
    );
    assert_eq!(store.check_masks(0..3), Ok(()));
    assert!(store.mask(1).is_none() && store.get(1).is_ok());
    assert_eq!(store.mask(2), Some(&Mask::nothing()));
    let expected = PhotoError {
        source_idx: 2,
        message: "c.png: corrupt".to_owned(),
    };
    assert_eq!(store.check_masks(0..3), Err(expected.clone()));
    assert_eq!(store.take_missed(), std::slice::from_ref(&expected));
    // It is no matter to those that do without.
    assert_eq!(store.check_masks(0..2), Ok(()));
    assert!(store.take_missed().is_empty());
    assert_eq!(store.get(2), Err(expected));
    assert_eq!(
        store.get(0).unwrap_err().to_string(),
        "the photo has 4 × 4 pixels and its ignore mask 4 × 3; make the mask as large as \
         the photo"
    );
}

#[test]
fn a_store_of_one_photo_less_goes_on_where_the_other_ended() {
    // 1. The second of five cannot be decoded, nor can the fourth; all but the last are masked.
    let images = |i: usize| match i {
        1 | 3 => Err(format!("{i}.png: corrupt")),
        _ => Ok(RgbaImage::new(4 + i as u32, 4)),
    };
    let mask = |i: usize| Ok(GrayImage::new(4 + i as u32, 4));
    let mut before = PhotoStore::new(5, images);
    before = before.with_masks(&[true, true, true, true, false], mask);
    before.set_budget(Some(1000));
    for i in [0, 1, 2, 3] {
        assert_eq!(before.get(i).is_ok(), i % 2 == 0);
    }
    let (counted, time) = (before.residency(), before.decode_time());
    assert_eq!((counted.loads, counted.peak), (4, counted.held));

    // 2. Without the second nothing that was decoded is decoded again.
    let others = |i: usize| i + usize::from(i > 0);
    let mut after = PhotoStore::new(4, move |i| match others(i) {
        4 => images(4),
        i => Err(format!("{i} was there")),
    });
    after = after.with_masks(&[true, true, true, false], |i| {
        Err(format!("{i} was there"))
    });
    after.go_on_from(before, &BTreeSet::from([1]));
    assert_eq!((after.residency(), after.decode_time()), (counted, time));
    assert_eq!(after.get(0).unwrap().levels[0].dimensions(), (4, 4));
    assert_eq!(after.get(1).unwrap().levels[0].dimensions(), (6, 4));
    let error = after.get(2).unwrap_err();
    assert_eq!((error.source_idx, &*error.message), (2, "3.png: corrupt"));
    assert_eq!(after.check_masks(0..4), Ok(()));
    assert!((0..2).all(|i| after.try_mask(i).is_ok()));

    // 3. What was not is counted on top.
    assert!(!after.was_decoded(3) && after.get(3).is_ok());
    assert_eq!((after.decoded(), after.residency().loads), (4, 5));

    // 4. Nor is it where several go at once.
    let mut last = PhotoStore::new(2, |i| Err(format!("{i} was there")));
    last = last.with_masks(&[true, false], |i| Err(format!("{i} was there")));
    last.go_on_from(after, &BTreeSet::from([1, 2]));
    assert_eq!(last.get(0).unwrap().levels[0].dimensions(), (4, 4));
    assert_eq!(last.get(1).unwrap().levels[0].dimensions(), (8, 4));
    assert!(last.try_mask(0).is_ok());
    assert_eq!(last.residency().loads, 5);
}

#[test]
fn what_drawings_ask_for_in_vain_is_told_once_in_order() {
    let store = PhotoStore::new(5, |i| match i {
        1 | 3 | 4 => Err(format!("{i}.png: corrupt")),
        _ => Ok(RgbaImage::new(4, 4)),
    });
    let error = |source_idx: usize| PhotoError {
        source_idx,
        message: format!("{source_idx}.png: corrupt"),
    };
    // 1. Who only looks into photos, or decodes ahead, draws nothing.
    assert_eq!(store.get(1), Err(error(1)));
    store.decode_ahead(4, [4, 4], &[false; 5]);
    assert!(store.take_missed().is_empty());
    // 2. What a drawing met, whichever it met first, and what it would have asked for then.
    for i in [3, 0, 1, 3] {
        assert_eq!(store.get_from_level(i, 0).is_ok(), i == 0);
    }
    assert_eq!(store.take_missed(), [error(1), error(3)]);
    store.find_missed(&[4, 2, 3]);
    assert_eq!(store.take_missed(), [error(3), error(4)]);
    assert!(store.take_missed().is_empty());
}

#[test]
fn what_is_decoded_ahead_stays_where_a_frame_begins_meanwhile() {
    let four = photo_bytes([4, 4], 0);
    // Room for both, and for one alone.
    for (budget, loads) in [(2 * four, 1), (four, 2)] {
        let (begun, begins) = channel();
        let (goes_on, going_on) = channel();
        let gates = Mutex::new((begun, going_on));
        let mut store = PhotoStore::new(2, move |i| {
            if i == 1 {
                let (begun, going_on) = &*lock(&gates);
                begun.send(()).unwrap();
                going_on.recv().unwrap();
            }
            Ok(RgbaImage::new(4, 4))
        });
        store.set_budget(Some(budget));
        std::thread::scope(|scope| {
            scope.spawn(|| store.decode_ahead(1, [4, 4], &[false; 2]));
            begins.recv().unwrap();
            store.make_room(&[0], [[4, 4]].into_iter(), 0, false);
            store.get_from_level(0, 0).unwrap();
            goes_on.send(()).unwrap();
        });
        goes_on.send(()).unwrap();
        store.get(1).unwrap();
        assert_eq!(store.residency().loads, 1 + loads, "{budget}");
    }
}

#[test]
fn photos_are_decoded_once_and_only_when_asked_for() {
    let store = PhotoStore::new(3, |i| match i {
        2 => Err("c.png: corrupt".to_owned()),
        _ => Ok(RgbaImage::new(4, 4)),
    });
    assert_eq!(store.decoded(), 0);
    store.get(1).unwrap();
    store.get(1).unwrap();
    assert_eq!(store.decoded(), 1);
    let error = store.get(2).unwrap_err();
    assert_eq!(
        error,
        PhotoError {
            source_idx: 2,
            message: "c.png: corrupt".to_owned()
        }
    );
}
