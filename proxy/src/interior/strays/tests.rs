//! What of an interior one line of sight moves.

use super::*;
use crate::interior::parse_rooms;
use crate::mesh::Mesh;
use std::path::Path;

/// Two rooms, and a doorway in the wall between them.
const ROOMS: &str = r#"{"version": 1, "rooms": [
    {"name": "west", "min": [0, 0, 0], "max": [4, 2.5, 3]},
    {"name": "east", "min": [4, 0, 0], "max": [8, 2.5, 3]}],
    "openings": [{"name": "door", "between": ["west", "east"],
        "polygon": [[4, 0, 1], [4, 0, 2], [4, 2, 2], [4, 2, 1]]}]}"#;
const WEST: CellId = CellId(0);
const EAST: CellId = CellId(1);
const REACH: f64 = 0.35;
const WITH: f64 = MARGIN * REACH;

fn rooms() -> Interior {
    let read = parse_rooms(Path::new("rooms.json"), ROOMS.as_bytes(), "m.glb");
    read.unwrap().0
}

/// A line of sight along x, where one room is all that is shown.
fn stray(shown: CellId, x: [f64; 2], [y, z]: [f64; 2]) -> Stray {
    let [eye, seen] = x.map(|x| DVec3::new(x, y, z));
    Stray {
        from: shown,
        eye,
        seen,
        shown: vec![shown],
    }
}

/// Fits one line of sight, of rooms as they were at first.
fn fit_one(interior: &mut Interior, stray: &Stray) -> Option<Fitted> {
    fit(interior, &widest(&rooms(), REACH), stray, REACH, WITH)
}

/// Walls, floor and ceiling around both rooms.
fn around_both() -> Model {
    let corner = |i: usize| {
        let at = |k: usize, far: f64| if i >> k & 1 == 1 { far } else { 0.0 };
        DVec3::new(at(0, 8.0), at(1, 2.5), at(2, 3.0))
    };
    let sides = [
        [0, 1, 3, 2],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 3, 7, 5],
    ];
    let triangles = sides.map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    Model {
        mesh: Mesh {
            positions: (0..8).map(corner).collect(),
            triangles: triangles.as_flattened().to_vec(),
        },
        ..Model::default()
    }
}

/// A solid, its triangles seen from the front from outside.
fn solid(min: DVec3, max: DVec3) -> Mesh {
    let corner = |i: usize| {
        let at = |k: usize| if i >> k & 1 == 1 { max[k] } else { min[k] };
        DVec3::new(at(0), at(1), at(2))
    };
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles = sides.map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    Mesh {
        positions: (0..8).map(corner).collect(),
        triangles: triangles.as_flattened().to_vec(),
    }
}

#[test]
fn nobody_stands_in_the_masonry_of_a_thick_wall() {
    for half in [0.2, 0.35, 0.4, 0.5] {
        let mut model = around_both();
        // Beside the doorway, and above it.
        for [y, z] in [
            [[0.0, 2.5], [0.0, 1.0]],
            [[0.0, 2.5], [2.0, 3.0]],
            [[2.0, 2.5], [1.0, 2.0]],
        ] {
            let corner = |x: f64, i: usize| DVec3::new(4.0 + x, y[i], z[i]);
            let wall = solid(corner(-half, 0), corner(half, 1));
            model.mesh.append(&wall);
        }
        let strays = strays(&rooms(), &model).unwrap();
        assert!(strays.tried > 1000, "{half}: {}", strays.tried);
        assert_eq!(strays.found, [], "{half}");
    }
}

#[test]
fn where_too_many_ways_lead_on_fewer_places_are_looked_from() {
    let (interior, model) = (rooms(), around_both());
    let eye = DVec3::new(2.0, 1.0, 1.5);
    let portals = PortalsByCell::new(&interior);
    assert_eq!(all_around(&interior, &portals, WEST, eye, 0), None);
    let (visibility, looked_at) = all_around(&interior, &portals, WEST, eye, 1).unwrap();
    assert_eq!((visibility.cells.len(), looked_at), (2, 1));
    let (contents, _) = Contents::new(&interior, &model).unwrap();
    let seen = Seen::new(&model, &contents.triangles, &contents.elsewhere);
    let all = look(&interior, &contents, &seen, PORTALS);
    assert_eq!((all.is_cut, all.cut_warning()), (false, None));
    assert_eq!(all, look(&interior, &contents, &seen, usize::MAX));
    // From both sides of the door, and from both rooms, each eye looks at the door alone.
    let few = look(&interior, &contents, &seen, 8);
    assert!(few.is_cut && few.looked_at <= 4 * 8 && few.looked_at < all.looked_at);
    assert!(0 < few.tried && few.tried < all.tried);
    let told = InteriorWarning::SightsCut(few.tried);
    assert_eq!(few.cut_warning(), Some(told));
}

#[test]
fn what_passes_beside_a_portal_widens_it_once() {
    let mut interior = rooms();
    let beside = stray(WEST, [2.0, 20.0], [1.0, 2.1]);
    let fitted = fit_one(&mut interior, &beside).unwrap();
    assert_eq!(fitted.cell, None);
    assert!((fitted.farther - 0.1 - WITH).abs() < 1e-9, "{fitted:?}");
    let high = interior.portals[0].polygon.corners().iter();
    let high = high.fold(f64::MIN, |high, p| high.max(p.z));
    assert!((high - 2.1 - WITH).abs() < 1e-9, "{high}");
    // But for rounding that is all, whatever else hides it.
    for _ in 0..10 {
        let again = fit_one(&mut interior, &beside);
        assert!(again.is_none_or(|one| one.farther < 1e-12), "{again:?}");
    }
    let before = interior.clone();
    let within = stray(WEST, [2.0, 20.0], [1.0, 1.5]);
    assert_eq!(fit_one(&mut interior, &within), None);
    assert_eq!(interior, before);
}

#[test]
fn a_portal_is_not_widened_for_who_is_behind_it() {
    // The eye is in a part of the eastern room that lies around the western one.
    for z in [1.5, 2.1] {
        let mut interior = rooms();
        let behind = stray(EAST, [2.0, 20.0], [1.0, z]);
        assert_eq!(fit_one(&mut interior, &behind), None);
        assert_eq!(interior, rooms());
    }
}

#[test]
fn what_ends_beside_a_box_makes_it_larger_once() {
    let mut interior = rooms();
    let ends = stray(WEST, [2.0, 4.2], [1.0, 0.5]);
    let fitted = fit_one(&mut interior, &ends).unwrap();
    assert_eq!(fitted.cell, Some(WEST));
    assert!((fitted.farther - 0.2 - WITH).abs() < 1e-9, "{fitted:?}");
    assert_eq!(fit_one(&mut interior, &ends), None);
}

#[test]
fn a_box_is_not_carried_on_step_by_step() {
    // Floor beyond a gap that is no portal: each place is near to where the one before made the box end.
    let mut interior = rooms();
    for step in 1..=24 {
        let x = 4.0 + 0.15 * f64::from(step);
        fit_one(&mut interior, &stray(WEST, [2.0, x], [1.0, 0.5]));
    }
    let room = interior.cell(WEST).content.room().unwrap();
    assert!((room.max.x - 5.35 - WITH).abs() < 1e-9, "{room:?}");
    assert_eq!(interior.portals, rooms().portals);
}
