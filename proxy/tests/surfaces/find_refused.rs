//! What is told where no rooms are found, or a plan is coarser than asked for.

use crate::find::{find, open_box, room_around_another};

use glam::{DMat4, DVec3};
use proxy::Mesh;
use proxy::interior::find::{Evidence, FindError, FindOptions, find_interior};

#[test]
fn what_is_no_room_is_told() {
    let none = find(&Mesh::default(), &FindOptions::default()).unwrap_err();
    assert_eq!(none, FindError::NoSurface);
    let triangle = Mesh {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::Z],
        triangles: vec![[0, 1, 2]],
    };
    let error = find(&triangle, &FindOptions::default()).unwrap_err();
    assert_eq!(error, FindError::NoRooms(1.5, 1.0));
    let nan = Mesh {
        positions: vec![DVec3::NAN, DVec3::X, DVec3::Z],
        triangles: vec![[0, 1, 2]],
    };
    assert_eq!(
        find(&nan, &FindOptions::default()).unwrap_err(),
        FindError::NoSurface
    );
    // A field is no room: nothing encloses it.
    let field = open_box(DVec3::ZERO, DVec3::new(30.0, 0.0, 30.0), &[2]);
    let error = find(&field, &FindOptions::default()).unwrap_err();
    assert_eq!(error, FindError::NoRooms(1.5, 1.0));
    let options = FindOptions {
        meter: 0.0,
        ..FindOptions::default()
    };
    assert_eq!(
        find(&field, &options).unwrap_err(),
        FindError::Option("the metre", 0.0)
    );
}

#[test]
fn how_to_say_the_scale_and_which_way_is_up_is_told_where_nothing_is_found() {
    // A room in kilometres, in which somebody stood.
    let size = DVec3::new(0.005, 0.0026, 0.004);
    let room = open_box(DVec3::ZERO, size, &[0, 1, 2, 3, 4, 5]);
    let eye = DVec3::new(0.002, 0.0016, 0.002);
    let evidence = Evidence {
        mesh: &room,
        cameras: &[(eye, DVec3::Y)],
        sights: &[],
    };
    let error = find_interior(&evidence, "model.glb", &FindOptions::default()).unwrap_err();
    assert_eq!(error, FindError::NoFloor(1.0));
    assert_eq!(
        error.to_string(),
        "no floor: nothing level lies below; is the scale right (--meter says how many world units a metre is; now \
         1), and which way is up (--up)? Else give the rooms by hand (--rooms)"
    );
    assert_eq!(
        FindError::NoRooms(1.5, 0.001).to_string(),
        "no rooms: over the floor nothing of 1.5 m² or more is free at eye height and enclosed; is the scale right \
         (--meter says how many world units a metre is; now 0.001), and which way is up (--up)?"
    );
}

#[test]
fn a_plan_coarser_than_asked_for_is_told() {
    let size = DVec3::new(5.0, 2.6, 4.0);
    let mut mesh = open_box(DVec3::ZERO, size, &[0, 1, 2, 3, 4, 5]);
    // A fence far away.
    let far = DVec3::X * 500.0;
    mesh.append(&open_box(far, far + DVec3::new(0.1, 2.0, 4.0), &[0, 1]));
    let found = find(&mesh, &FindOptions::default()).unwrap();
    let said: Vec<String> = found.warnings.iter().map(|w| w.to_string()).collect();
    assert_eq!(said.len(), 1, "{said:?}");
    let coarse = "the floor plan's squares are 0.06 m wide, not 0.05, as";
    assert!(said[0].starts_with(coarse), "{said:?}");
    assert_eq!(found.interior.cells.len(), 1);
}

#[test]
fn a_house_in_millimetres_is_told_soon_or_found_if_that_is_said() {
    let mut mesh = room_around_another();
    mesh.transform(&DMat4::from_scale(DVec3::splat(1000.0)));
    let error = find(&mesh, &FindOptions::default()).unwrap_err();
    assert_eq!(error, FindError::NoRooms(1.5, 1.0));
    let options = FindOptions {
        meter: 1000.0,
        ..FindOptions::default()
    };
    assert_eq!(find(&mesh, &options).unwrap().interior.cells.len(), 2);
}
