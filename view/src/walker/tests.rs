use super::*;
use datasets::house::{HouseOptions, house};
use proptest::prelude::*;
use proxy::interior::{Portal, RoomBox};
use proxy::mesh::Mesh;
use std::sync::OnceLock;

/// A house, and what is in the way there.
pub(super) struct Place {
    pub(super) interior: Interior,
    pub(super) contents: Contents,
    pub(super) model: Model,
    pub(super) obstacles: Obstacles,
}

/// One of three rooms; in the middle of the first stands a table, and a bowl on it.
pub(super) fn place() -> &'static Place {
    static PLACE: OnceLock<Place> = OnceLock::new();
    PLACE.get_or_init(|| {
        let options = HouseOptions {
            rooms: 3,
            triangles: Some(1),
            ..HouseOptions::default()
        };
        let made = house(&options).unwrap();
        let (interior, model) = (made.interior, made.model);
        let contents = Contents::new(&interior, &model).unwrap().0;
        let obstacles = Obstacles::new(&interior, &contents, &model);
        Place {
            interior,
            contents,
            model,
            obstacles,
        }
    })
}

/// Over the middle of a cell, at eye height.
pub(super) fn middle(place: &Place, id: CellId) -> DVec3 {
    let room = place.contents.bounds[id.0 as usize].unwrap();
    place
        .obstacles
        .at_eye_height(Some(id), room.min.midpoint(room.max))
}

/// A door between two cells.
fn door(place: &Place) -> &Portal {
    let obstacles = &place.obstacles;
    let sill = |p: &Portal| {
        let heights = p.polygon.corners().iter().map(|c| c.dot(obstacles.up));
        heights.fold(f64::INFINITY, f64::min)
    };
    let is_door = |p: &&Portal| {
        p.cells.iter().all(Option::is_some) && sill(p) < obstacles.floors[0].height + 0.1
    };
    place.interior.portals.iter().find(is_door).unwrap()
}

#[test]
fn doorways_let_one_through() {
    let place = place();
    let portal = door(place);
    let center = place
        .obstacles
        .at_eye_height(portal.cells[0], portal.polygon.center());
    let normal = portal.polygon.normal();
    let from = center + 0.4 * normal;
    let cell = |p| place.contents.locate(&place.interior, p);
    let to = place.obstacles.walk(cell(from), from, -0.8 * normal);
    assert_eq!((cell(from), cell(to)), (portal.cells[0], portal.cells[1]));
    assert!(to.distance(center - 0.4 * normal) < 1e-9);
}

#[test]
fn walls_stop_one_and_one_slides_along_them() {
    let place = place();
    let portal = door(place);
    let (up, normal) = (place.interior.up, portal.polygon.normal());
    let along = up.cross(normal);
    let center = place
        .obstacles
        .at_eye_height(portal.cells[0], portal.polygon.center());
    // Against the wall beside the door, at a slant.
    let from = center + 0.6 * normal + along * (0.5 * portal.width(up) + 0.5);
    let cell = |p| place.contents.locate(&place.interior, p);
    let straight = place.obstacles.walk(cell(from), from, -5.0 * normal);
    assert_eq!(cell(straight), portal.cells[0]);
    let height = portal.polygon.height(straight);
    assert!(height > place.obstacles.radius * 0.9, "{height}");
    let aslant = -along * 0.2 - normal;
    let aslant = place.obstacles.walk(cell(straight), straight, aslant);
    assert!((aslant - straight).dot(-along) > 0.15);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn no_way_leads_out_of_the_house_or_into_things(
        ways in prop::collection::vec((0.0..std::f64::consts::TAU, 0.0..6.0), 1..12)
    ) {
        let place = place();
        let obstacles = &place.obstacles;
        let Place { interior, contents, model, .. } = place;
        let over_table = middle(place, CellId(0));
        let stands = obstacles.standing_near(interior, contents, model, CellId(0), over_table);
        let mut at = stands.unwrap();
        let height = at.dot(obstacles.up);
        for (angle, length) in ways {
            let motion = (obstacles.axes[0] * f64::cos(angle)
                + obstacles.axes[1] * f64::sin(angle)) * length;
            let before = obstacles.seen_from_above(at);
            let room = nearest(&obstacles.floors[0].squares, before);
            let cell = place.contents.locate(&place.interior, at);
            let next = obstacles.walk(cell, at, motion);
            prop_assert!(next.is_finite() && (next.dot(obstacles.up) - height).abs() < 1e-9);
            prop_assert!(next.distance(at) <= length * 1.5 + obstacles.radius);
            let after = nearest(&obstacles.floors[0].squares, obstacles.seen_from_above(next));
            let least = room.map_or(f64::INFINITY, |r| r.1).min(0.98 * obstacles.radius);
            prop_assert!(after.is_none_or(|a| a.1 >= least));
            at = next;
        }
        // Doors to the outside are as open as others.
        let is_in = place.contents.locate(&place.interior, at).is_some();
        let left_by_door = place.interior.portals.iter().any(|p| p.cells.contains(&None));
        prop_assert!(is_in || left_by_door);
    }
}

/// A wall through the origin, aslant to the map's axes, so far on both sides.
fn wall(reach: f64) -> Obstacles {
    wall_between(reach, [0.0, 3.0], &[0.0])
}

/// One between two heights, with cells whose floors are so high.
pub(super) fn wall_between(reach: f64, [low, high]: [f64; 2], floors: &[f64]) -> Obstacles {
    obstacles_of(floors, |up, [x, y]| {
        let along = reach * (x + y);
        let (low, high) = (low * up, high * up);
        Mesh {
            positions: vec![low - along, low + along, high + along, high - along],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    })
}

/// A mesh, made for what is up and what lies across it, in each of some cells whose floors are so
/// high.
pub(super) fn obstacles_of(
    floors: &[f64],
    make: impl FnOnce(DVec3, [DVec3; 2]) -> Mesh,
) -> Obstacles {
    let mut interior = place().interior.clone();
    interior.portals.clear();
    interior.cells.truncate(floors.len());
    for cell in &mut interior.cells {
        cell.floor = None;
    }
    let up = interior.up;
    let across = up.any_orthonormal_vector();
    let model = Model {
        mesh: make(up, [across, up.cross(across)]),
        ..Model::default()
    };
    let triangles: Vec<u32> = (0..model.mesh.triangles.len() as u32).collect();
    let room = |floor: &f64| {
        Some(RoomBox {
            min: DVec3::new(-9.0, *floor, -9.0),
            max: DVec3::new(9.0, 3.0, 9.0),
        })
    };
    let mut contents = Contents::default();
    contents.triangles = floors.iter().map(|_| triangles.clone()).collect();
    contents.bounds = floors.iter().map(room).collect();
    Obstacles::new(&interior, &contents, &model)
}

#[test]
fn a_room_that_lies_a_few_steps_higher_closes_no_doorway() {
    // The top of a doorway, which would be in the way from the higher floor only.
    let obstacles = wall_between(5.0, [2.0, 3.0], &[0.0, 0.8]);
    let [x, y] = obstacles.axes;
    let eye = 2.0 * x + 1.6 * obstacles.up;
    let way = 2.0 * (y - x);
    let walk = |cell| obstacles.walk(cell, eye, way);
    assert!(walk(Some(CellId(0))).distance(eye + way) < 1e-9);
    for elsewhere in [Some(CellId(1)), None, Some(CellId(9))] {
        assert!(walk(elsewhere).distance(eye + way) > 0.5);
    }
}

#[test]
fn walls_of_any_length_stop_one() {
    // Of a house, of one in millimetres, and farther than squares can be numbered.
    for reach in [5.0, 5_000.0, 1e10] {
        let obstacles = wall(reach);
        let [x, y] = obstacles.axes;
        let eye = 2.0 * x + 1.6 * obstacles.up;
        let to = obstacles.walk(Some(CellId(0)), eye, -3.0 * x);
        let height = (to.dot(x) - to.dot(y)) / f64::sqrt(2.0);
        assert!(height > 0.9 * obstacles.radius, "{reach}: {height}");
        // It slides.
        assert!(to.distance(eye) > 1.0, "{reach}: {to}");
    }
}

#[test]
fn odd_motions_are_none() {
    let place = place();
    let eye = middle(place, CellId(0));
    for motion in [DVec3::ZERO, DVec3::NAN, place.interior.up] {
        assert_eq!(place.obstacles.walk(Some(CellId(0)), eye, motion), eye);
    }
    // Nothing to stand on: nothing in the way.
    let below = eye - 100.0 * place.interior.up;
    let motion = place.obstacles.axes[0];
    assert_eq!(place.obstacles.walk(None, below, motion), below + motion);
}
