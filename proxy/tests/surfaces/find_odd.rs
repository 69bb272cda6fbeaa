//! Rooms found in houses that are built or written otherwise than most, and what is told of them.

use crate::common;
use crate::find::{bounds, find, look_at, open_box};
use crate::house::small_house;

use glam::DVec3;
use proxy::Mesh;
use proxy::interior::find::{FindError, FindOptions};
use proxy::interior::{InteriorWarning, RoomBox};

/// Two rooms of 4 × 6 m with a door between them, under a roof that slopes from a ridge at 3.2 m down to both
/// sides at a height.
fn attic(eaves: f64) -> Mesh {
    let mut mesh = Mesh::default();
    let mut add = |min: [f64; 3], max: [f64; 3], faces: &[usize]| {
        let [min, max] = [min, max].map(DVec3::from_array);
        mesh.append(&open_box(min, max, faces));
    };
    add([0.0, 0.0, 0.0], [8.0, 3.2, 6.0], &[0, 1, 2, 4, 5]);
    add([3.9, 0.0, 0.0], [4.1, 3.2, 2.5], &[0, 1, 5]);
    add([3.9, 2.0, 2.5], [4.1, 3.2, 3.5], &[0, 1, 2]);
    add([3.9, 0.0, 3.5], [4.1, 3.2, 6.0], &[0, 1, 4]);
    for side in [0.0, 6.0] {
        let first = mesh.positions.len() as u32;
        let corner = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        mesh.positions.extend([
            corner(0.0, eaves, side),
            corner(8.0, eaves, side),
            corner(8.0, 3.2, 3.0),
            corner(0.0, 3.2, 3.0),
        ]);
        let triangles = [[0, 1, 2], [0, 2, 3]];
        mesh.triangles
            .extend(triangles.map(|t| t.map(|i| first + i)));
    }
    mesh
}

#[test]
fn rooms_under_sloped_ceilings_are_found() {
    for eaves in [1.0, 1.5, 1.9] {
        let found = find(&attic(eaves), &FindOptions::default()).unwrap();
        look_at(&found, &format!("attic-{eaves}"));
        assert_eq!(found.interior.cells.len(), 2, "{eaves}");
        assert_eq!(found.interior.portals.len(), 1, "{eaves}");
        let door = found.interior.portals[0].polygon.center();
        assert!(door.with_y(0.0).distance(DVec3::new(4.0, 0.0, 3.0)) < 0.2);
        // As far as one can crouch: where the roof is 1.3 m high; or up to the eaves, where some of what is there
        // can be seen.
        let reach = 3.0 * ((1.3 - eaves) / (3.2 - eaves)).max(0.0);
        for i in 0..2 {
            let RoomBox { min, max } = bounds(&found, i);
            let is_right = |off: f64| off > -0.2 && off < reach + 0.2;
            assert!(
                is_right(min.z) && is_right(6.0 - max.z),
                "{eaves}: {min} {max}"
            );
        }
    }
    // A roof over a floor, without walls, encloses nothing.
    let size = DVec3::new(8.0, 2.6, 6.0);
    let shelter = open_box(DVec3::ZERO, size, &[2, 3]);
    let error = find(&shelter, &FindOptions::default()).unwrap_err();
    assert_eq!(error, FindError::NoRooms(1.5, 1.0));
}

#[test]
fn doorways_in_thick_walls_are_found_and_hollows_are_no_rooms() {
    for thick in [0.3, 0.5, 0.6, 0.8] {
        let mut mesh = Mesh::default();
        let [from, to] = [4.0 - 0.5 * thick, 4.0 + 0.5 * thick];
        let mut add = |min: [f64; 3], max: [f64; 3], faces: &[usize]| {
            let [min, max] = [min, max].map(DVec3::from_array);
            mesh.append(&open_box(min, max, faces));
        };
        add([0.0, 0.0, 0.0], [8.0, 2.5, 5.0], &[0, 1, 2, 3, 4, 5]);
        add([from, 0.0, 0.0], [to, 2.5, 1.0], &[0, 1, 5]);
        add([from, 2.0, 1.0], [to, 2.5, 1.9], &[0, 1, 2]);
        add([from, 0.0, 1.9], [to, 2.5, 5.0], &[0, 1, 4]);
        let found = find(&mesh, &FindOptions::default()).unwrap();
        look_at(&found, &format!("thick-{thick}"));
        assert_eq!(found.warnings, [], "{thick}");
        assert_eq!(found.interior.cells.len(), 2, "{thick}");
        assert_eq!(found.interior.portals.len(), 1, "{thick}");
        let door = &found.interior.portals[0];
        let off = door.polygon.center() - DVec3::new(4.0, 1.0, 1.45);
        assert!(off.abs().max_element() < 0.1, "{thick}: {off}");
        assert!((door.width(DVec3::Y) - 0.9).abs() < 0.15, "{thick}");
        // Both rooms reach to it.
        let x = door.polygon.center().x;
        assert!(bounds(&found, 0).max.x > x - 0.03, "{thick}");
        assert!(bounds(&found, 1).min.x < x + 0.03, "{thick}");
    }
}

#[test]
fn windows_in_thick_walls_are_found_though_no_floor_runs_on_below_them() {
    for (thick, head, width) in [
        (0.3, 1.9, 0.9),
        (0.5, 1.9, 0.9),
        (0.6, 1.8, 0.9),
        (0.6, 1.9, 3.4),
        (0.8, 1.9, 0.9),
    ] {
        let mut mesh = Mesh::default();
        let [from, to] = [4.0 - 0.5 * thick, 4.0 + 0.5 * thick];
        let mut add = |min: [f64; 3], max: [f64; 3], faces: &[usize]| {
            let [min, max] = [min, max].map(DVec3::from_array);
            mesh.append(&open_box(min, max, faces));
        };
        add([0.0, 0.0, 0.0], [from, 2.5, 5.0], &[0, 2, 3, 4, 5]);
        add([to, 0.0, 0.0], [8.0, 2.5, 5.0], &[1, 2, 3, 4, 5]);
        add([from, 0.0, 0.0], [to, 2.5, 1.0], &[0, 1, 5]);
        let end = 1.0 + width;
        add([from, head, 1.0], [to, 2.5, end], &[0, 1, 2]);
        add([from, 0.0, 1.0], [to, 1.0, end], &[0, 1, 3]);
        add([from, 0.0, end], [to, 2.5, 5.0], &[0, 1, 4]);
        let found = find(&mesh, &FindOptions::default()).unwrap();
        look_at(&found, &format!("thick-window-{thick}-{head}-{width}"));
        assert_eq!(found.interior.cells.len(), 2, "{thick} {head} {width}");
        assert_eq!(found.interior.portals.len(), 1, "{thick} {head} {width}");
        let window = &found.interior.portals[0];
        assert_eq!(window.name, "window 1");
        let middle = DVec3::new(4.0, 0.5 * (1.0 + head), 0.5 * (1.0 + end));
        let off = window.polygon.center() - middle;
        assert!(
            off.abs().max_element() < 0.1,
            "{thick} {head} {width}: {off}"
        );
        assert!(
            (window.width(DVec3::Y) - width).abs() < 0.15,
            "{thick} {head} {width}"
        );
        // Both rooms reach to it.
        let x = window.polygon.center().x;
        assert!(bounds(&found, 0).max.x > x - 0.03, "{thick} {head} {width}");
        assert!(bounds(&found, 1).min.x < x + 0.03, "{thick} {head} {width}");
    }
}

#[test]
fn doorways_of_less_than_half_a_metre_are_found_wherever_they_lie_on_the_grid() {
    for off in [0.01, 0.02, 0.03, 0.04] {
        let mut mesh = Mesh::default();
        let mut add = |min: [f64; 3], max: [f64; 3], faces: &[usize]| {
            let [min, max] = [min, max].map(DVec3::from_array);
            mesh.append(&open_box(min, max, faces));
        };
        let [from, to] = [2.0 + off, 2.4 + off];
        add([0.0, 0.0, 0.0], [8.0, 2.5, 5.0], &[0, 1, 2, 3, 4, 5]);
        add([3.95, 0.0, 0.0], [4.05, 2.5, from], &[0, 1, 5]);
        add([3.95, 2.0, from], [4.05, 2.5, to], &[0, 1, 2]);
        add([3.95, 0.0, to], [4.05, 2.5, 5.0], &[0, 1, 4]);
        let found = find(&mesh, &FindOptions::default()).unwrap();
        assert_eq!(found.interior.cells.len(), 2, "{off}");
        assert_eq!(found.interior.portals.len(), 1, "{off}");
    }
}

#[test]
fn another_storey_is_told() {
    let size = DVec3::new(6.0, 2.5, 4.0);
    let lower = open_box(DVec3::ZERO, size, &[0, 1, 2, 3, 4, 5]);
    let up = 2.7 * DVec3::Y;
    for (width, is_told) in [(5.0, true), (0.8, false)] {
        let mut both = lower.clone();
        let size = size.with_x(width);
        both.append(&open_box(up, up + size, &[0, 1, 2, 3, 4, 5]));
        let found = find(&both, &FindOptions::default()).unwrap();
        assert_eq!(found.interior.cells.len(), 1);
        let is_right = |warning: &InteriorWarning| match warning {
            InteriorWarning::Storey(height) => (height - 2.7).abs() < 0.1,
            _ => false,
        };
        assert_eq!(found.warnings.len(), usize::from(is_told));
        assert!(found.warnings.iter().all(is_right), "{:?}", found.warnings);
    }
}

/// A room of 10 × 8 m under a flat ceiling, and so high a loft over that.
fn under_a_roof(ridge: f64) -> Mesh {
    let size = DVec3::new(10.0, 2.5, 8.0);
    let mut mesh = open_box(DVec3::ZERO, size, &[0, 1, 2, 3, 4, 5]);
    for eaves in [0.0, 8.0] {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([
            DVec3::new(0.0, 2.6, eaves),
            DVec3::new(10.0, 2.6, eaves),
            DVec3::new(10.0, 2.6 + ridge, 4.0),
            DVec3::new(0.0, 2.6 + ridge, 4.0),
        ]);
        let triangles = [[0, 1, 2], [0, 2, 3]];
        mesh.triangles
            .extend(triangles.map(|t| t.map(|i| first + i)));
    }
    mesh
}

#[test]
fn a_closed_loft_is_no_storey() {
    for ridge in [2.2, 2.6, 3.2] {
        let found = find(&under_a_roof(ridge), &FindOptions::default()).unwrap();
        assert_eq!(found.warnings, [], "{ridge}");
        assert_eq!(found.interior.cells.len(), 1, "{ridge}");
    }
    // With a ceiling below the ridge it is one.
    let mut mesh = under_a_roof(3.2);
    let [min, max] = [DVec3::new(0.0, 2.6, 2.5), DVec3::new(10.0, 4.6, 5.5)];
    mesh.append(&open_box(min, max, &[3]));
    let found = find(&mesh, &FindOptions::default()).unwrap();
    let [InteriorWarning::Storey(height)] = found.warnings[..] else {
        panic!("{:?}", found.warnings);
    };
    assert!((height - 2.5).abs() < 0.1, "{height}");
}

#[test]
fn a_house_that_may_lie_on_its_side_is_told() {
    // Z is up, as it is to some programs.
    let room = open_box(DVec3::ZERO, DVec3::new(10.0, 4.0, 2.5), &[0, 1, 2, 3, 4, 5]);
    let told = InteriorWarning::OnItsSide(DVec3::Z);
    let found = find(&room, &FindOptions::default()).unwrap();
    assert!(found.warnings.contains(&told), "{:?}", found.warnings);
    let said = "though more floor or wall lies across [0.00, 0.00, 1.00]: if";
    assert!(told.to_string().contains(said), "{told}");
    let options = FindOptions {
        up: Some(DVec3::Z),
        ..FindOptions::default()
    };
    assert_eq!(find(&room, &options).unwrap().warnings, []);
    // With a wall in the middle, which would be as high as a ceiling.
    let size = DVec3::new(12.0, 6.0, 2.5);
    let mut rooms = open_box(DVec3::ZERO, size, &[0, 1, 2, 3, 4, 5]);
    let [min, max] = [size.with_y(2.9).with_x(0.0).with_z(0.0), size.with_y(3.1)];
    rooms.append(&open_box(min, max, &[2, 3]));
    let found = find(&rooms, &FindOptions::default()).unwrap();
    assert!(found.warnings.contains(&told), "{:?}", found.warnings);
}

#[test]
fn a_house_that_may_be_upside_down_is_told() {
    // A room with a bed in its corner.
    let size = DVec3::new(6.0, 2.5, 5.0);
    let bed = DVec3::new(2.5, 0.5, 3.0);
    let mut room = open_box(DVec3::ZERO, size, &[0, 1, 2, 3, 4, 5]);
    room.append(&open_box(DVec3::ZERO, bed, &[0, 1, 2, 3, 4, 5]));
    let told = InteriorWarning::UpsideDown(DVec3::NEG_Y);
    let is_told = |mesh: &Mesh, up: Option<DVec3>| {
        let options = FindOptions {
            up,
            ..FindOptions::default()
        };
        find(mesh, &options).unwrap().warnings.contains(&told)
    };
    assert!(!is_told(&room, None));
    let turned = |mesh: &Mesh| {
        let mut mesh = mesh.clone();
        mesh.positions.iter_mut().for_each(|p| p.y = -p.y);
        mesh
    };
    assert!(is_told(&turned(&room), None));
    for up in [DVec3::Y, DVec3::NEG_Y] {
        assert!(!is_told(&turned(&room), Some(up)), "{up}");
    }
    let said = "say --up with [0.00, -1.00, 0.00]";
    assert!(told.to_string().ends_with(said), "{told}");
    for (rooms, seed) in [(2, 1), (5, 2)] {
        assert!(!is_told(&small_house(rooms, seed).0.model.mesh, None));
    }
}

#[test]
fn a_house_of_which_rooms_have_little_is_said_to_lie_on_its_side() {
    let Some(folder) = common::find_capture("interior-house") else {
        return;
    };
    let (model, _) = proxy::mesh::read_model(&folder.join("house.glb")).unwrap();
    let is_told = |mesh: &Mesh| {
        let found = find(mesh, &FindOptions::default()).unwrap();
        let told = InteriorWarning::OnItsSide(DVec3::Z);
        found.warnings.contains(&told)
    };
    let mut mesh = model.mesh.clone();
    assert!(!is_told(&mesh));
    // Z up. Taken for a house with y up it has one room, between two walls.
    for position in &mut mesh.positions {
        *position = DVec3::new(position.x, -position.z, position.y);
    }
    assert!(is_told(&mesh));
}

#[test]
fn corridors_and_narrow_houses_are_not_said_to_lie_on_their_side() {
    for size in [[2.0, 3.0, 20.0], [2.4, 3.2, 20.0]] {
        let size = DVec3::from_array(size);
        let corridor = open_box(DVec3::ZERO, size, &[0, 1, 2, 3, 4, 5]);
        let found = find(&corridor, &FindOptions::default()).unwrap();
        assert_eq!(found.warnings, [], "{size}");
    }
    // Between two others, of three storeys.
    let size = DVec3::new(5.0, 8.1, 12.0);
    let mut house = open_box(DVec3::ZERO, size, &[0, 1, 2, 3, 4, 5]);
    for floor in [2.7, 5.4] {
        let min = DVec3::new(0.0, floor - 0.2, 0.0);
        house.append(&open_box(min, size.with_y(floor), &[2, 3]));
    }
    let found = find(&house, &FindOptions::default()).unwrap();
    let is_side = |warning: &InteriorWarning| matches!(warning, InteriorWarning::OnItsSide(_));
    assert!(!found.warnings.iter().any(is_side), "{:?}", found.warnings);
}

#[test]
fn units_that_are_no_metres_are_told() {
    // Half a metre, in inches.
    let room = open_box(
        DVec3::ZERO,
        DVec3::new(20.0, 98.0, 16.0),
        &[0, 1, 2, 3, 4, 5],
    );
    let options = FindOptions {
        up: Some(DVec3::Y),
        ..FindOptions::default()
    };
    let found = find(&room, &options).unwrap();
    assert_eq!(found.warnings, [InteriorWarning::TallWalls(6.0)]);
    let hall = open_box(
        DVec3::ZERO,
        DVec3::new(20.0, 5.0, 16.0),
        &[0, 1, 2, 3, 4, 5],
    );
    assert_eq!(find(&hall, &options).unwrap().warnings, []);
}

/// A hall of 56 × 56 m with three closets in it, so wide and 3.5 m long, each with a doorway.
fn hall_with_closets(width: f64) -> Mesh {
    let mut mesh = Mesh::default();
    let mut add = |min: [f64; 3], max: [f64; 3], faces: &[usize]| {
        let [min, max] = [min, max].map(DVec3::from_array);
        mesh.append(&open_box(min, max, faces));
    };
    add([0.0; 3], [56.0, 3.0, 56.0], &[0, 1, 2, 3, 4, 5]);
    for z in [28.0, 38.0, 48.0] {
        add(
            [28.0, 0.0, z],
            [28.0 + width, 3.0, z + 3.5],
            &[1, 2, 3, 4, 5],
        );
        for (low, from, to) in [(0.0, 0.0, 1.2), (2.1, 1.2, 2.1), (0.0, 2.1, 3.5)] {
            add([28.0, low, z + from], [28.0, 3.0, z + to], &[0]);
        }
    }
    mesh
}

#[test]
fn narrow_rooms_keep_their_width_where_the_grid_is_coarse() {
    // As coarse as it is where what stands there reaches over 700 m.
    let options = FindOptions {
        cell_size: 0.35,
        ..FindOptions::default()
    };
    for width in [1.0, 1.2, 1.4] {
        let found = find(&hall_with_closets(width), &options).unwrap();
        look_at(&found, &format!("closets-{width}"));
        for i in 0..found.interior.cells.len() {
            let RoomBox { min, max } = bounds(&found, i);
            let narrowest = (max - min).min_element();
            assert!(narrowest > 0.1, "{width}: {min} {max}");
        }
    }
}
