//! Where a survey is taken from.

use datasets::house::{House, HouseOptions, house};
use datasets::{Options, survey};
use glam::DVec3;
use proxy::interior::{Cell, Content, RoomBox};

fn two_rooms() -> House {
    let options = HouseOptions {
        rooms: 2,
        triangles: Some(1),
        ..HouseOptions::default()
    };
    house(&options).unwrap()
}

/// The different places that 96 photos are taken from, eight each.
fn places(house: &House) -> Vec<DVec3> {
    let options = Options {
        size: Some((80, 64)),
        views: Some(96),
        ..Options::default()
    };
    let survey = survey(&house.interior, &house.model, &options).unwrap();
    let mut places: Vec<DVec3> = Vec::new();
    for photo in &survey.photos {
        let center = photo.view.camera_from_world.inverse() * DVec3::ZERO;
        if places.iter().all(|place| place.distance(center) > 1e-6) {
            places.push(center);
        }
    }
    places
}

#[test]
fn rooms_without_a_place_to_stand_take_none_from_the_others() {
    let mut house = two_rooms();
    let furnished = places(&house);
    assert_eq!(furnished.len(), 12);
    for i in 0..6 {
        let min = DVec3::new(1000.0 + 10.0 * f64::from(i), 0.0, 0.0);
        house.interior.cells.push(Cell {
            name: format!("empty {i}"),
            content: Content::Box(RoomBox {
                min,
                max: min + 4.0,
            }),
            floor: None,
            other: Default::default(),
        });
    }
    assert_eq!(places(&house), furnished);
}
