//! Where a survey is taken from, and the depths it writes.

use datasets::house::{House, HouseOptions, house};
use datasets::{Options, survey, write_survey};
use glam::DVec3;
use proxy::interior::{Cell, Content, Polygon, RoomBox};
use std::path::Path;

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

/// Gives a house another unit, of which so many are one of before.
fn change_unit(house: &mut House, units: f64) {
    for position in &mut house.model.mesh.positions {
        *position *= units;
    }
    let interior = &mut house.interior;
    interior.eye_height *= units;
    for cell in &mut interior.cells {
        if let Content::Box(room) = &mut cell.content {
            (room.min, room.max) = (units * room.min, units * room.max);
        }
    }
    for portal in &mut interior.portals {
        let corners = portal.polygon.corners().iter().map(|p| units * *p);
        portal.polygon = Polygon::new(corners.collect()).unwrap();
    }
}

/// Of a survey that is written: steps of depth to a world unit, and those of its photos' pixels.
fn depth_maps(house: &House, folder: &Path) -> (f64, Vec<u16>) {
    let options = Options {
        size: Some((40, 32)),
        views: Some(4),
        samples_per_side: Some(1),
    };
    let survey = survey(&house.interior, &house.model, &options).unwrap();
    write_survey(&survey, folder).unwrap();
    let mut steps: Vec<u16> = Vec::new();
    for photo in &survey.photos {
        let map = image::open(folder.join("depth").join(&photo.name)).unwrap();
        steps.extend(map.as_luma16().expect("16 bits").as_raw());
    }
    (survey.depth_steps_per_unit, steps)
}

#[test]
fn depth_maps_tell_millimetres_apart_whatever_a_world_unit_is() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut house = two_rooms();
    let mut units_before = 1.0;
    let (steps_per_meter, expected) = depth_maps(&house, &at("metres"));
    assert_eq!(steps_per_meter, 1000.0);
    assert!(expected.iter().filter(|steps| **steps > 500).count() > 2500);
    // Powers of two change no digits of where photos are taken.
    for (units, steps_per_unit, step) in [(128.0, 10.0, "0.1"), (1.0 / 1024.0, 1e6, "0.000001")] {
        let place = at(step);
        change_unit(&mut house, units / units_before);
        units_before = units;
        let (found, maps) = depth_maps(&house, &place);
        assert_eq!(found, steps_per_unit);
        let meters = |steps: u16, per_unit: f64| f64::from(steps) / per_unit;
        let is_same = |(a, b): (&u16, &u16)| {
            let found = meters(*a, steps_per_unit) / units;
            (found - meters(*b, steps_per_meter)).abs() < 0.002
        };
        let same = maps.iter().zip(&expected).filter(|pair| is_same(*pair));
        assert!(100 * same.count() > 99 * expected.len(), "{step}");
        let readme = std::fs::read_to_string(place.join("README.md")).unwrap();
        let said = format!("`import --depth-scale {step}`");
        assert!(readme.contains(&said), "{readme}");
    }
}
