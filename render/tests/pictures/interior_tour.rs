//! Tours: through doors rather than windows, whatever says where the rooms are.

use crate::house;

use calibrate::{Camera, Lens, View};
use glam::{DVec2, DVec3};
use proxy::interior::find::{Evidence, FindOptions, find_interior};
use proxy::interior::{
    CellId, Contents, Interior, Polygon, PortalId, interior_from_nodes, parse_rooms,
};
use proxy::mesh::read_model;
use proxy::mesh::{Mesh, Model, ModelNode, Part};
use proxy::{MeshKind, Solid};
use render::interior::Tour;
use std::path::Path;

/// Rooms a, b and c in a row of squares around a corner: between a and b a window, from a to c
/// and from c to b doors. Boxes and outlines.
const BOXES: [(&str, [f64; 3], [f64; 3]); 3] = [
    ("a", [0.0, 0.0, 0.0], [4.0, 3.0, 4.0]),
    ("b", [4.0, 0.0, 0.0], [8.0, 3.0, 4.0]),
    ("c", [0.0, 0.0, 4.0], [8.0, 3.0, 8.0]),
];
const OPENINGS: [(&str, [[f64; 3]; 4]); 3] = [
    (
        "a|b",
        [
            [4.0, 1.0, 1.0],
            [4.0, 1.0, 3.0],
            [4.0, 2.0, 3.0],
            [4.0, 2.0, 1.0],
        ],
    ),
    (
        "a|c",
        [
            [1.0, 0.0, 4.0],
            [2.0, 0.0, 4.0],
            [2.0, 2.0, 4.0],
            [1.0, 2.0, 4.0],
        ],
    ),
    (
        "c|b",
        [
            [6.0, 0.0, 4.0],
            [7.0, 0.0, 4.0],
            [7.0, 2.0, 4.0],
            [6.0, 2.0, 4.0],
        ],
    ),
];

/// A model whose nodes say all of it: a diagonal of each room, and the openings.
fn model() -> Model {
    let mut model = Model::default();
    let mut add = |name: String, corners: &[DVec3]| {
        let first = model.mesh.positions.len() as u32;
        let triangles = model.mesh.triangles.len() as u32;
        model.mesh.positions.extend(corners);
        let fan = (1..corners.len() as u32 - 1).map(|i| [first, first + i, first + i + 1]);
        model.mesh.triangles.extend(fan);
        model.parts.push(Part {
            triangles: triangles..model.mesh.triangles.len() as u32,
            node_idx: model.nodes.len() as u32,
            material_idx: 0,
        });
        model.nodes.push(ModelNode {
            name,
            parent_idx: None,
        });
    };
    for (name, min, max) in BOXES {
        let [min, max] = [min, max].map(DVec3::from_array);
        add(format!("cell:{name}"), &[min, max, min.with_y(max.y)]);
    }
    for (name, outline) in OPENINGS {
        add(format!("portal:{name}"), &outline.map(DVec3::from_array));
    }
    model.uvs = vec![[0.0; 2]; model.mesh.positions.len()];
    model.colors = vec![[255; 4]; model.mesh.positions.len()];
    let mesh: &Mesh = &model.mesh;
    assert_eq!(mesh.triangles.len(), 3 + 6);
    model
}

fn by_boxes() -> Interior {
    let rooms = BOXES
        .map(|(name, min, max)| format!(r#"{{"name": "{name}", "min": {min:?}, "max": {max:?}}}"#));
    let openings = OPENINGS.map(|(name, outline)| {
        let (a, b) = name.split_once('|').unwrap();
        format!(r#"{{"name": "{name}", "between": ["{a}", "{b}"], "polygon": {outline:?}}}"#)
    });
    let (rooms, openings) = (rooms.join(","), openings.join(","));
    let text = format!(r#"{{"version": 1, "rooms": [{rooms}], "openings": [{openings}]}}"#);
    let read = parse_rooms(Path::new("r.json"), text.as_bytes(), "m.glb");
    read.unwrap().0
}

#[test]
fn tours_go_through_doors_and_not_through_windows() {
    let model = model();
    let (by_nodes, _) = interior_from_nodes(&model, "m.glb", 1.0).unwrap();
    let camera = Camera::of(
        &Lens::pinhole(DVec2::splat(50.0), DVec2::splat(32.0)),
        64,
        64,
    );
    for interior in [by_boxes(), by_nodes] {
        let (contents, _) = Contents::new(&interior, &model).unwrap();
        let path = Tour::new(&interior, &contents, &model, &camera, 200, 15.0)
            .unwrap()
            .path;
        let eyes: Vec<DVec3> = path.frames.iter().map(|f| f.view.center()).collect();
        // At eye height over the floor everywhere.
        assert!(eyes.iter().all(|eye| (eye.y - 1.6).abs() < 1e-9));
        // Over the plane between a and b only in c.
        let crossings = eyes.windows(2).filter(|e| (e[0].x < 4.0) != (e[1].x < 4.0));
        let places: Vec<f64> = crossings.map(|e| e[0].z).collect();
        assert!(
            !places.is_empty() && places.iter().all(|z| *z > 4.0),
            "{places:?}"
        );
        // And all rooms are seen.
        for cell in 0..3 {
            let is_there =
                |eye: &DVec3| contents.locate(&interior, *eye).map(|c| c.0) == Some(cell);
            assert!(eyes.iter().any(is_there), "{cell}");
        }
    }
}

/// Steps of a tour that pass a triangle, and how many cells it comes to.
fn crossings(interior: &Interior, model: &Model) -> (usize, usize) {
    let (contents, _) = Contents::new(interior, model).unwrap();
    let camera = Camera::of(
        &Lens::pinhole(DVec2::splat(50.0), DVec2::splat(32.0)),
        64,
        64,
    );
    let path = Tour::new(interior, &contents, model, &camera, 1500, 15.0)
        .unwrap()
        .path;
    let solid = Solid::new(MeshKind::Mesh, model.mesh.clone());
    let eyes: Vec<DVec3> = path.frames.iter().map(|f| f.view.center()).collect();
    let passes = |e: &[DVec3]| {
        let hit = solid.first_hit(e[0], e[1] - e[0]);
        hit.is_some_and(|hit| hit.along <= 1.0)
    };
    let mut cells: Vec<_> = eyes
        .iter()
        .filter_map(|e| contents.locate(interior, *e))
        .collect();
    cells.sort_unstable();
    cells.dedup();
    (eyes.windows(2).filter(|e| passes(e)).count(), cells.len())
}

#[test]
fn tours_go_around_walls_and_furniture() {
    for (rooms, seed) in [(3, 2), (9, 6), (19, 1)] {
        let (house, _) = house::small_house(rooms, seed);
        let found = crossings(&house.interior, &house.model);
        assert_eq!(found, (0, rooms), "{rooms} rooms");
    }
    let captures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/captures");
    let file = captures.join("interior-house/house.glb");
    if !file.exists() {
        eprintln!("SKIPPED: {} is absent", file.display());
        return;
    }
    let (model, _) = read_model(&file).unwrap();
    let evidence = Evidence {
        mesh: &model.mesh,
        cameras: &[],
        sights: &[],
    };
    let found = find_interior(&evidence, "house.glb", &FindOptions::default()).unwrap();
    assert_eq!(crossings(&found.interior, &model), (0, 3));
}

#[test]
fn tours_turn_by_and_by_where_they_turn_back() {
    let lens = Lens::pinhole(DVec2::splat(50.0), DVec2::splat(32.0));
    let camera = Camera::of(&lens, 64, 64);
    for (rooms, seed) in [(3, 0), (7, 7), (9, 6), (13, 1)] {
        let (house, contents) = house::small_house(rooms, seed);
        let (interior, model) = (&house.interior, &house.model);
        let tour = Tour::new(interior, &contents, model, &camera, 2000, 15.0).unwrap();
        let views: Vec<&View> = tour.path.frames.iter().map(|f| &f.view).collect();
        let ahead = |view: &View| view.camera_from_world.rotation.conjugate() * DVec3::Z;
        let steps = views.windows(2).map(|pair| {
            let turn = ahead(pair[0]).angle_between(ahead(pair[1]));
            (turn, pair[0].center().distance(pair[1].center()))
        });
        let [turn, step] = steps.fold([0.0, 0.0], |[turn, step]: [f64; 2], (t, s)| {
            [turn.max(t), step.max(s)]
        });
        // Half a turn takes 1.2 eye heights of the way.
        let most = std::f64::consts::PI * step / (1.2 * interior.eye_height);
        assert!(turn <= 1.5 * most, "{rooms} rooms, {seed}: {turn} {most}");
    }
}

#[test]
fn tours_of_found_rooms_are_at_eye_height() {
    let (house, _) = house::small_house(3, 2);
    let evidence = Evidence {
        mesh: &house.model.mesh,
        cameras: &[],
        sights: &[],
    };
    let found = find_interior(&evidence, "house.glb", &FindOptions::default()).unwrap();
    let (contents, _) = Contents::new(&found.interior, &house.model).unwrap();
    let lens = Lens::pinhole(DVec2::splat(50.0), DVec2::splat(32.0));
    let camera = Camera::of(&lens, 64, 64);
    let tour = Tour::new(&found.interior, &contents, &house.model, &camera, 100, 15.0);
    // Rugs count as floor, too.
    for frame in tour.unwrap().path.frames {
        let eye = frame.view.center();
        assert!((eye.y - 1.6).abs() < 0.02, "{eye}");
    }
}

/// Walls from the floor to 3 m, along corners.
fn walls(model: &mut Model, corners: &[[f64; 2]]) {
    let mut mesh = Mesh::default();
    for pair in corners.windows(2) {
        let first = mesh.positions.len() as u32;
        let foot = pair.iter().map(|[x, z]| DVec3::new(*x, 0.0, *z));
        mesh.positions.extend(foot.clone());
        mesh.positions.extend(foot.map(|p| p.with_y(3.0)));
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| first + k);
        mesh.triangles.extend([[a, b, d], [a, d, c]]);
    }
    model.append(&mesh, "walls");
}

/// An L-shaped room, the middle of whose box is beyond its walls, and a square one behind a door.
fn around_a_corner(with_outline: bool, in_the_way: &[[[f64; 2]; 2]]) -> (Interior, Model) {
    let mut model = Model::default();
    let l = [
        [8.0, 1.0],
        [8.0, 0.0],
        [0.0, 0.0],
        [0.0, 8.0],
        [3.0, 8.0],
        [3.0, 3.0],
        [8.0, 3.0],
    ];
    walls(&mut model, &[&l[..], &[[8.0, 2.0]]].concat());
    walls(
        &mut model,
        &[
            [8.0, 1.0],
            [8.0, 0.0],
            [12.0, 0.0],
            [12.0, 4.0],
            [8.0, 4.0],
            [8.0, 2.0],
        ],
    );
    in_the_way.iter().for_each(|ends| walls(&mut model, ends));
    let text = r#"{"version": 1, "rooms": [
        {"name": "bend", "min": [0, 0, 0], "max": [8, 3, 8]},
        {"name": "end", "min": [8, 0, 0], "max": [12, 3, 4]}],
        "openings": [{"name": "door", "between": ["bend", "end"],
            "polygon": [[8, 0, 1], [8, 0, 2], [8, 2.2, 2], [8, 2.2, 1]]}]}"#;
    let read = parse_rooms(Path::new("r.json"), text.as_bytes(), "m.glb");
    let (mut interior, _) = read.unwrap();
    if with_outline {
        let l = [
            [8.0, 0.0],
            [0.0, 0.0],
            [0.0, 8.0],
            [3.0, 8.0],
            [3.0, 3.0],
            [8.0, 3.0],
        ];
        let corners = l.map(|[x, z]| DVec3::new(x, 0.0, z));
        interior.cells[0].floor = Some(Polygon::new(corners.to_vec()).unwrap());
    }
    (interior, model)
}

#[test]
fn tours_stay_within_rooms_that_go_around_a_corner() {
    for with_outline in [false, true] {
        let (interior, model) = around_a_corner(with_outline, &[]);
        assert_eq!(crossings(&interior, &model), (0, 2), "{with_outline}");
    }
}

/// What a tour leaves out, goes straight through, and which openings it finds shut.
fn amiss(interior: &Interior, model: &Model) -> (Vec<CellId>, Vec<CellId>, Vec<PortalId>) {
    let (contents, _) = Contents::new(interior, model).unwrap();
    let lens = Lens::pinhole(DVec2::splat(50.0), DVec2::splat(32.0));
    let camera = Camera::of(&lens, 64, 64);
    let tour = Tour::new(interior, &contents, model, &camera, 50, 15.0).unwrap();
    assert_eq!(tour.path.frames.len(), 50);
    (tour.left_out, tour.blocked, tour.shut)
}

#[test]
fn tours_say_where_something_is_in_the_way() {
    let (interior, model) = around_a_corner(false, &[]);
    assert_eq!(amiss(&interior, &model), (vec![], vec![], vec![]));
    // A closed door.
    let (interior, model) = around_a_corner(false, &[[[8.0, 1.0], [8.0, 2.0]]]);
    assert_eq!(amiss(&interior, &model).2, [PortalId(0)]);
    // A wall between the doors of the middle of three rooms.
    let text = r#"{"version": 1, "rooms": [
        {"name": "a", "min": [0, 0, 0], "max": [4, 3, 4]},
        {"name": "b", "min": [4, 0, 0], "max": [8, 3, 4]},
        {"name": "c", "min": [8, 0, 0], "max": [12, 3, 4]}],
        "openings": [
        {"name": "a|b", "between": ["a", "b"], "polygon": [[4, 0, 1], [4, 0, 2], [4, 2, 2], [4, 2, 1]]},
        {"name": "b|c", "between": ["b", "c"], "polygon": [[8, 0, 1], [8, 0, 2], [8, 2, 2], [8, 2, 1]]}]}"#;
    let (interior, _) = parse_rooms(Path::new("r.json"), text.as_bytes(), "m.glb").unwrap();
    let mut model = Model::default();
    walls(&mut model, &[[6.0, -0.5], [6.0, 4.5]]);
    assert_eq!(amiss(&interior, &model), (vec![], vec![CellId(1)], vec![]));
}

fn quad(mesh: &mut Mesh, corners: [DVec3; 4]) {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(corners);
    let halves = [[0, 1, 2], [0, 2, 3]].map(|half| half.map(|i| first + i));
    mesh.triangles.extend(halves);
}

/// A stairwell of two storeys, and in its wall at x = 4 m a door to a room beside each of them.
fn stairwell() -> (Interior, Model) {
    let mut mesh = Mesh::default();
    // What is closed of the wall, from (y, z) to (y, z).
    for [[y, z], [top, end]] in [
        [[0.0, 0.0], [2.8, 0.5]],
        [[2.0, 0.5], [2.8, 1.5]],
        [[0.0, 1.5], [2.8, 4.0]],
        [[2.8, 0.0], [5.4, 2.5]],
        [[4.8, 2.5], [5.4, 3.5]],
        [[2.8, 3.5], [5.4, 4.0]],
    ] {
        let corners = [[y, z], [top, z], [top, end], [y, end]];
        quad(&mut mesh, corners.map(|[y, z]| DVec3::new(4.0, y, z)));
    }
    let mut model = Model::default();
    model.append(&mesh, "wall");
    let text = r#"{"version": 1, "rooms": [
        {"name": "stairwell", "min": [0, 0, 0], "max": [4, 5.4, 4]},
        {"name": "lower", "min": [4, 0, 0], "max": [9, 2.6, 4]},
        {"name": "upper", "min": [4, 2.8, 0], "max": [9, 5.4, 4]}],
        "openings": [
        {"name": "down", "between": ["stairwell", "lower"],
            "polygon": [[4, 0, 0.5], [4, 0, 1.5], [4, 2, 1.5], [4, 2, 0.5]]},
        {"name": "up", "between": ["stairwell", "upper"],
            "polygon": [[4, 2.8, 2.5], [4, 2.8, 3.5], [4, 4.8, 3.5], [4, 4.8, 2.5]]}]}"#;
    let read = parse_rooms(Path::new("r.json"), text.as_bytes(), "m.glb");
    (read.unwrap().0, model)
}

#[test]
fn doors_of_an_upper_storey_are_passed_at_eye_height_over_its_floor() {
    let (interior, model) = stairwell();
    assert_eq!(crossings(&interior, &model), (0, 3));
    assert_eq!(amiss(&interior, &model), (vec![], vec![], vec![]));
    let (contents, _) = Contents::new(&interior, &model).unwrap();
    let lens = Lens::pinhole(DVec2::splat(50.0), DVec2::splat(32.0));
    let camera = Camera::of(&lens, 64, 64);
    let tour = Tour::new(&interior, &contents, &model, &camera, 400, 15.0).unwrap();
    let eyes: Vec<DVec3> = tour.path.frames.iter().map(|f| f.view.center()).collect();
    // In each door, and well into the room behind it.
    for (floor, middle) in [(0.0, 1.0), (2.8, 3.0)] {
        let is_passed = |e: &[DVec3]| {
            let [a, b] = [e[0], e[1]];
            let at = a.lerp(b, (4.0 - a.x) / (b.x - a.x));
            let off = DVec2::new(at.y - floor - 1.6, at.z - middle);
            (a.x < 4.0) != (b.x < 4.0) && off.abs().max_element() < 0.1
        };
        assert!(eyes.windows(2).any(is_passed), "{floor}");
        let is_behind = |eye: &DVec3| eye.x > 5.0 && (eye.y - floor - 1.6).abs() < 1e-9;
        assert!(eyes.iter().any(is_behind), "{floor}");
    }
    let behind = eyes.iter().filter(|eye| eye.x > 5.0);
    for eye in behind {
        let off = [1.6, 4.4].map(|height| (eye.y - height).abs());
        assert!(off[0].min(off[1]) < 1e-9, "{eye}");
    }
}

/// A hall, a room over it that a hatch leads to, and one behind a door; and in the hatch a lid.
fn storeys(has_lid: bool) -> (Interior, Model) {
    let mut mesh = Mesh::default();
    // The ceiling around the hatch, from (x, z) to (x, z).
    let around = [
        [[0.0, 0.0], [1.0, 4.0]],
        [[2.0, 0.0], [6.0, 4.0]],
        [[1.0, 0.0], [2.0, 1.0]],
        [[1.0, 2.0], [2.0, 4.0]],
    ];
    let lid = [[0.9, 1.0], [2.0, 2.1]];
    for [[x, z], [end, far]] in around.into_iter().chain(has_lid.then_some(lid)) {
        let corners = [[x, z], [end, z], [end, far], [x, far]];
        quad(&mut mesh, corners.map(|[x, z]| DVec3::new(x, 2.6, z)));
    }
    let mut model = Model::default();
    model.append(&mesh, "ceiling");
    let text = r#"{"version": 1, "rooms": [
        {"name": "hall", "min": [0, 0, 0], "max": [6, 2.6, 4]},
        {"name": "upstairs", "min": [0, 2.6, 0], "max": [6, 5.2, 4]},
        {"name": "shed", "min": [6, 0, 0], "max": [10, 2.6, 4]}],
        "openings": [
        {"name": "hatch", "between": ["hall", "upstairs"],
            "polygon": [[1, 2.6, 1], [1, 2.6, 2], [2, 2.6, 2], [2, 2.6, 1]]},
        {"name": "door", "between": ["hall", "shed"],
            "polygon": [[6, 0, 1], [6, 0, 2], [6, 2, 2], [6, 2, 1]]}]}"#;
    let read = parse_rooms(Path::new("r.json"), text.as_bytes(), "m.glb");
    (read.unwrap().0, model)
}

#[test]
fn tours_go_straight_through_hatches_and_say_where_one_is_closed() {
    let (interior, model) = storeys(false);
    // Up, and down again to the door.
    assert_eq!(crossings(&interior, &model), (0, 3));
    assert_eq!(amiss(&interior, &model), (vec![], vec![], vec![]));
    let (contents, _) = Contents::new(&interior, &model).unwrap();
    let lens = Lens::pinhole(DVec2::splat(50.0), DVec2::splat(32.0));
    let camera = Camera::of(&lens, 64, 64);
    let tour = Tour::new(&interior, &contents, &model, &camera, 400, 15.0).unwrap();
    let eyes: Vec<DVec3> = tour.path.frames.iter().map(|f| f.view.center()).collect();
    let is_upstairs = |eye: &&DVec3| (eye.y - 4.2).abs() < 1e-9;
    let farthest = eyes.iter().filter(is_upstairs).map(|eye| eye.x);
    assert!(farthest.fold(0.0, f64::max) > 2.5);
    // Measured a centimetre askew, it is a hatch all the same.
    let mut askew = interior.clone();
    let raised = |p: &DVec3| *p + DVec3::Y * if p.x > 1.5 { 0.01 } else { 0.0 };
    let corners = interior.portals[0].polygon.corners().iter().map(raised);
    askew.portals[0].polygon = Polygon::new(corners.collect()).unwrap();
    assert_eq!(crossings(&askew, &model), (0, 3));
    assert_eq!(amiss(&askew, &model), (vec![], vec![], vec![]));
    // Through a lid.
    let (interior, model) = storeys(true);
    assert!(crossings(&interior, &model).0 > 0);
    let (_, blocked, _) = amiss(&interior, &model);
    assert!(blocked.contains(&CellId(0)), "{blocked:?}");
}
