//! Rooms found in models, against what is known of them.

use crate::common;
use crate::house::small_house;

use glam::{DMat4, DQuat, DVec3};
use proxy::Mesh;
use proxy::interior::find::{
    Evidence, FindError, FindOptions, FoundInterior, Place, find_interior,
};
use proxy::interior::{CellId, Content, Contents, RoomBox, compare};
use proxy::mesh::Model;

pub(crate) fn find(mesh: &Mesh, options: &FindOptions) -> Result<FoundInterior, FindError> {
    let evidence = Evidence {
        mesh,
        cameras: &[],
        sights: &[],
    };
    find_interior(&evidence, "model.glb", options)
}

pub(crate) fn bounds(found: &FoundInterior, cell: usize) -> RoomBox {
    match found.interior.cells[cell].content {
        Content::Box(room) => room,
        _ => panic!("found cells are boxes"),
    }
}

/// For looking at, where a folder is named.
pub(crate) fn look_at(found: &FoundInterior, name: &str) {
    if let Ok(folder) = std::env::var("FLOOR_PLANS") {
        let path = format!("{folder}/{name}.png");
        found.picture().save(path).unwrap();
    }
}

#[test]
fn rooms_and_openings_of_procedural_houses_are_found() {
    for (rooms, seed) in [(2, 1), (5, 2), (9, 3), (19, 1)] {
        let (house, _) = small_house(rooms, seed);
        let found = find(&house.model.mesh, &FindOptions::default()).unwrap();
        look_at(&found, &format!("house-{rooms}"));
        let compared = compare(&house.interior, &found.interior, 0.2, 1.0);
        let iou = || compared.cells.iter().map(|c| c.iou);
        let worst = iou().fold(1.0, f64::min);
        let mean = iou().sum::<f64>() / rooms as f64;
        eprintln!("{rooms} rooms: IoU {mean:.3}, least {worst:.3}");
        assert!(worst > 0.93, "{compared}");
        assert!(compared.portals.iter().all(|p| p.is_found), "{compared}");
        assert!(compared.extra_cells.is_empty(), "{compared}");
        assert!(compared.extra_portals.is_empty(), "{compared}");
        assert_eq!(found.warnings, []);
        let svg = found.svg();
        assert!(svg.starts_with("<svg ") && svg.contains("room 2"));
    }
}

#[test]
fn turning_and_shifting_the_world_turns_and_shifts_the_rooms() {
    let (house, _) = small_house(5, 4);
    let there = DMat4::from_rotation_translation(
        DQuat::from_euler(glam::EulerRot::XYZ, 0.9, 0.5, -0.7),
        DVec3::new(310.0, -40.0, 95.0),
    );
    let mut mesh = house.model.mesh.clone();
    mesh.transform(&there);
    // Up is not known, and y is not it.
    let found = find(&mesh, &FindOptions::default()).unwrap();
    let up = there.transform_vector3(DVec3::Y);
    assert!(found.interior.up.dot(up) > 0.99999, "{}", found.interior.up);
    assert_eq!(found.interior.cells.len(), 5);
    let back = there.inverse();
    let mut left: Vec<DVec3> = house
        .interior
        .portals
        .iter()
        .map(|p| p.polygon.center())
        .collect();
    for portal in &found.interior.portals {
        let center = back.transform_point3(portal.polygon.center());
        let near = left.iter().position(|c| c.distance(center) < 0.15);
        left.remove(near.unwrap_or_else(|| panic!("{} at {center}", portal.name)));
    }
    assert!(left.is_empty(), "{left:?}");
    // Outlines, and boxes around them.
    for cell in &found.interior.cells {
        assert!(cell.floor.is_some(), "{}", cell.name);
    }
    // Another scale, said to be one.
    let mut mesh = house.model.mesh.clone();
    mesh.transform(&DMat4::from_scale(DVec3::splat(40.0)));
    let options = FindOptions {
        meter: 40.0,
        ..FindOptions::default()
    };
    let larger = find(&mesh, &options).unwrap();
    assert_eq!(larger.interior.cells.len(), 5);
    assert_eq!(larger.interior.portals.len(), house.interior.portals.len());
}

/// A room without ceiling or floor, as may be, from faces of a box.
pub(crate) fn open_box(min: DVec3, max: DVec3, faces: &[usize]) -> Mesh {
    let mut mesh = Mesh::default();
    for face in faces {
        let (axis, side) = (face / 2, face % 2);
        let corner = |u: bool, v: bool| {
            let mut p = if side == 0 { min } else { max };
            p[(axis + 1) % 3] = if u { max } else { min }[(axis + 1) % 3];
            p[(axis + 2) % 3] = if v { max } else { min }[(axis + 2) % 3];
            if side == 0 {
                p[axis] = min[axis];
            }
            p
        };
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([
            corner(false, false),
            corner(true, false),
            corner(true, true),
            corner(false, true),
        ]);
        mesh.triangles.push([first, first + 1, first + 2]);
        mesh.triangles.push([first, first + 2, first + 3]);
    }
    mesh
}

#[test]
fn one_room_is_one_cell_and_two_apart_are_two() {
    let size = DVec3::new(5.0, 2.6, 4.0);
    let one = open_box(DVec3::ZERO, size, &[0, 1, 2, 3, 4, 5]);
    let found = find(&one, &FindOptions::default()).unwrap();
    assert_eq!(found.interior.cells.len(), 1);
    assert_eq!(found.interior.portals.len(), 0);
    let room = bounds(&found, 0);
    for (a, b) in [(room.min, DVec3::ZERO), (room.max, size)] {
        assert!((a - b).abs().max_element() < 0.2, "{room:?}");
    }
    // Without a ceiling.
    let open = open_box(DVec3::ZERO, size, &[0, 1, 2, 4, 5]);
    let found = find(&open, &FindOptions::default()).unwrap();
    assert_eq!(found.interior.cells.len(), 1);
    // Apart.
    let mut two = one.clone();
    let shift = DVec3::X * 9.0;
    two.append(&open_box(shift, shift + size, &[0, 1, 2, 3, 4, 5]));
    let found = find(&two, &FindOptions::default()).unwrap();
    assert_eq!(found.interior.cells.len(), 2);
    assert_eq!(found.interior.portals.len(), 0);
}

#[test]
fn the_floor_of_found_rooms_is_where_one_stands() {
    // Their boxes begin lower; at any height, turned or not.
    let far = DVec3::new(30.0, -7.0, 12.0);
    for turn in [0.0, 0.5] {
        let there = DMat4::from_rotation_translation(DQuat::from_rotation_y(turn), far);
        let mut mesh = room_around_another();
        mesh.transform(&there);
        let found = find(&mesh, &FindOptions::default()).unwrap();
        let (contents, _) = Contents::new(&found.interior, &Model::default()).unwrap();
        assert_eq!(found.interior.cells.len(), 2);
        for i in 0..2 {
            let id = CellId(i as u32);
            let floor = contents.floor_of(&found.interior, id).unwrap();
            assert!((floor - far.y).abs() < 1e-6, "{floor}");
            assert!(bounds(&found, i).min.y < far.y - 0.05);
            let door = &found.interior.portals[0];
            let before = contents.floor_height(&found.interior, Some(id), door);
            assert_eq!(before, floor);
        }
    }
}

#[test]
fn rooms_of_a_modelled_house_are_where_its_description_says() {
    let Some(folder) = common::find_capture("interior-house") else {
        return;
    };
    let (model, _) = proxy::mesh::read_model(&folder.join("house.glb")).unwrap();
    let found = find(&model.mesh, &FindOptions::default()).unwrap();
    look_at(&found, "house");
    // Bedroom and study. Folding doors without panes and a balcony's open front part nothing.
    let said = [[-9.3, -3.1, -2.5, 1.5], [-9.3, 1.5, -2.5, 5.4]];
    for [x0, z0, x1, z1] in said {
        let is_there = (0..found.interior.cells.len()).any(|i| {
            let RoomBox { min, max } = bounds(&found, i);
            let off = [min.x - x0, min.z - z0, max.x - x1, max.z - z1];
            off.iter().all(|o| o.abs() < 0.2)
        });
        assert!(is_there, "{:?}", found.interior.cells);
    }
    // One sees from both into the living room.
    let doors = found.interior.portals.iter().filter(|p| {
        let at = p.polygon.center();
        (at.x + 2.5).abs() < 0.2 && at.z > -0.6 && at.z < 2.8
    });
    let width: f64 = doors.map(|p| p.width(found.interior.up)).sum();
    assert!((width - 3.4).abs() < 0.2, "{width}");
}

#[test]
fn corridors_as_wide_as_their_mouths_are_rooms() {
    // A hall, and out of its wall a corridor 1.4 m wide; no lintel, no bottleneck.
    let mut mesh = Mesh::default();
    let mut wall = |from: [f64; 2], to: [f64; 2]| {
        let [a, b] = [from, to].map(|[x, z]| DVec3::new(x, 0.0, z));
        let first = mesh.positions.len() as u32;
        let up = DVec3::Y * 2.6;
        mesh.positions.extend([a, b, b + up, a + up]);
        mesh.triangles
            .extend([[0, 1, 2], [0, 2, 3]].map(|t| t.map(|i| first + i)));
    };
    let corners = [
        [0.0, 0.0],
        [6.0, 0.0],
        [6.0, 5.0],
        [4.4, 5.0],
        [4.4, 9.0],
        [3.0, 9.0],
        [3.0, 5.0],
        [0.0, 5.0],
    ];
    for i in 0..8 {
        wall(corners[i], corners[(i + 1) % 8]);
    }
    for (min, max) in [([0.0, 0.0], [6.0, 5.0]), ([3.0, 5.0], [4.4, 9.0])] {
        let [a, b] = [min, max].map(|[x, z]: [f64; 2]| DVec3::new(x, 0.0, z));
        mesh.append(&open_box(a, b + DVec3::Y * 2.6, &[2, 3]));
    }
    let found = find(&mesh, &FindOptions::default()).unwrap();
    assert_eq!(found.interior.cells.len(), 2, "{:?}", found.interior.cells);
    let mouth = &found.interior.portals[0];
    assert!(mouth.polygon.center().distance(DVec3::new(3.7, 1.3, 5.0)) < 0.2);
    assert!((mouth.width(DVec3::Y) - 1.4).abs() < 0.2);
}

/// A room that goes around a smaller one in two arms, and a door between them.
pub(crate) fn room_around_another() -> Mesh {
    let mut mesh = Mesh::default();
    let mut add = |min: [f64; 3], max: [f64; 3], faces: &[usize]| {
        let [min, max] = [min, max].map(DVec3::from_array);
        mesh.append(&open_box(min, max, faces));
    };
    // Floor and ceiling, and the ends and outer sides of both arms.
    add([0.0, 0.0, 0.0], [12.0, 2.5, 12.0], &[0, 2, 3, 4]);
    add([0.0, 0.0, 0.0], [3.0, 2.5, 12.0], &[5]);
    add([0.0, 0.0, 0.0], [12.0, 2.5, 3.0], &[1]);
    // Their inner sides, one of them with a door.
    add([3.0, 0.0, 3.0], [3.1, 2.5, 3.8], &[0, 1, 4, 5]);
    add([3.0, 0.0, 4.8], [3.1, 2.5, 12.0], &[0, 1, 4, 5]);
    add([3.0, 2.0, 3.8], [3.1, 2.5, 4.8], &[0, 1, 2, 4, 5]);
    add([3.1, 0.0, 3.0], [12.0, 2.5, 3.1], &[0, 1, 4, 5]);
    // The smaller one's other walls.
    add([5.5, 0.0, 3.1], [5.6, 2.5, 5.5], &[0, 1, 4, 5]);
    add([3.1, 0.0, 5.5], [5.6, 2.5, 5.6], &[0, 1, 4, 5]);
    mesh
}

#[test]
fn a_door_has_its_sides_where_a_room_goes_around_the_next() {
    let found = find(&room_around_another(), &FindOptions::default()).unwrap();
    look_at(&found, "around");
    assert_eq!(found.warnings, []);
    assert_eq!(found.interior.cells.len(), 2);
    assert_eq!(found.interior.portals.len(), 1);
    let portal = &found.interior.portals[0];
    let (contents, _) = Contents::new(&found.interior, &Model::default()).unwrap();
    for (side, cell) in [1.0, -1.0].into_iter().zip(portal.cells) {
        let beside = portal.polygon.center() + 0.4 * side * portal.polygon.normal();
        assert_eq!(contents.locate(&found.interior, beside), cell);
    }
}

#[test]
fn ground_around_a_house_takes_nothing_from_it() {
    let alone = find(&room_around_another(), &FindOptions::default()).unwrap();
    for reach in [30.0, 400.0, 1e6] {
        let mut mesh = room_around_another();
        let (min, max) = (DVec3::splat(-reach), DVec3::splat(reach));
        mesh.append(&open_box(min.with_y(-0.05), max.with_y(-0.05), &[2]));
        let found = find(&mesh, &FindOptions::default()).unwrap();
        look_at(&found, &format!("ground-{reach}"));
        assert_eq!(found.warnings, []);
        let compared = compare(&alone.interior, &found.interior, 0.1, 1.0);
        assert!(compared.cells.iter().all(|c| c.iou > 0.85), "{compared}");
        assert!(compared.portals.iter().all(|p| p.is_found), "{compared}");
        assert!(compared.extra_cells.is_empty(), "{compared}");
        assert!(compared.extra_portals.is_empty(), "{compared}");
    }
}

#[test]
fn what_was_not_seen_of_a_room_is_of_it() {
    // Who stands in one corner and looks into the opposite one sees neither of the others.
    let size = DVec3::new(6.0, 2.6, 4.0);
    let room = open_box(DVec3::ZERO, size, &[0, 1, 2, 3, 4, 5]);
    let eye = DVec3::new(0.5, 1.6, 0.5);
    let mut sights = Vec::new();
    for i in 0..200 {
        for j in 0..60 {
            let turn = 0.25 + 0.7 * f64::from(i) / 200.0;
            let ray = DVec3::new(turn.cos(), 0.02 * f64::from(j) - 0.6, turn.sin());
            let limits = [
                (size.x - eye.x) / ray.x,
                (size.z - eye.z) / ray.z,
                if ray.y > 0.0 { size.y - eye.y } else { -eye.y } / ray.y,
            ];
            let end = limits.into_iter().filter(|t| *t > 0.0).fold(1e9, f64::min);
            sights.push([eye, eye + end * ray]);
        }
    }
    let evidence = Evidence {
        mesh: &room,
        cameras: &[(eye, DVec3::Y)],
        sights: &sights,
    };
    let found = find_interior(&evidence, "model.glb", &FindOptions::default()).unwrap();
    assert_eq!(found.interior.cells.len(), 1);
    let of = bounds(&found, 0);
    let off = [of.min.x, of.min.z, of.max.x - size.x, of.max.z - size.z];
    // Nobody knows what is behind who looks.
    assert!(off[0] < 1.2 && off[1] < 1.0, "{of:?}");
    assert!(off[2].abs() < 0.2 && off[3].abs() < 0.2, "{of:?}");
}

#[test]
fn what_no_surface_is_in_is_no_room() {
    // A room, and a piece of floor far away.
    let size = DVec3::new(5.0, 2.6, 4.0);
    let mut mesh = open_box(DVec3::ZERO, size, &[0, 1, 2, 3, 4, 5]);
    let far = DVec3::new(29.0, 0.0, 0.0);
    mesh.append(&open_box(far, far + DVec3::new(1.0, 0.0, 6.0), &[2]));
    // Lines of sight over rectangles of the plan, by their least and greatest x and z.
    let found = |seen: &[[f64; 4]]| {
        let mut sights = Vec::new();
        for [x0, x1, z0, z1] in seen {
            for i in 0..=((z1 - z0) / 0.05) as usize {
                let z = z0 + 0.05 * i as f64;
                let at = |x: f64, y: f64| DVec3::new(x, y, z);
                sights.extend([1.52, 1.62].map(|y| [at(*x0, y), at(*x1, y)]));
            }
        }
        let evidence = Evidence {
            mesh: &mesh,
            cameras: &[(DVec3::new(2.5, 1.6, 2.0), DVec3::Y)],
            sights: &sights,
        };
        find_interior(&evidence, "model.glb", &FindOptions::default())
    };
    let own = [0.2, 4.8, 0.2, 3.8];
    let alone = found(&[own]).unwrap();
    assert_eq!(alone.interior.cells.len(), 1);
    // Beside it one looked over a place where there is nothing, which comes first in the plan.
    let beside = [8.0, 11.0, 2.0, 5.0];
    let with = found(&[own, beside]).unwrap();
    look_at(&with, "nothing-beside");
    assert_eq!(with.interior, alone.interior);
    assert_eq!(with.warnings, []);
    let is_of = |id: CellId| with.plan.places.contains(&Place::Room(id));
    assert!(is_of(CellId(0)) && !is_of(CellId(1)));
    // Over more such places than rooms.
    let error = found(&[own, beside, [14.0, 17.0, 2.0, 5.0]]).unwrap_err();
    assert_eq!(error, FindError::NoRooms(1.5, 1.0));
}
