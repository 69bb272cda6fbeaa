//! Where viewers are within an interior, and where cameras stand before its portals.

use crate::common;
use crate::interior::{TWO_ROOMS, rooms, two_rooms};
use crate::interior_nodes::{level, nodes_of_quads, wall};

use glam::DVec3;
use proxy::interior::{
    CellId, Contents, GivenRooms, SemicircleOptions, interior_from_nodes, read_rooms, semicircles,
};
use proxy::mesh::{self, Model};
use std::path::Path;

#[test]
fn viewers_are_found() {
    let interior = two_rooms();
    let [west, east] = [Some(CellId(0)), Some(CellId(1))];
    let at = DVec3::new;
    let (a, b) = (at(1.0, 1.0, 1.5), at(7.0, 1.0, 1.5));
    let (contents, _) = Contents::new(&interior, &Model::default()).unwrap();
    assert_eq!(contents.locate(&interior, a), west);
    assert_eq!(contents.locate(&interior, b), east);
    assert_eq!(contents.locate(&interior, at(9.0, 1.0, 1.0)), None);
    assert_eq!(contents.locate(&interior, DVec3::NAN), None);
    // Boxes that leave out the wall between them: in the doorway, on the same side.
    let thick = TWO_ROOMS
        .replace("\"max\": [4, 3, 4]", "\"max\": [3.9, 3, 4]")
        .replace("\"min\": [4, 0, 0]", "\"min\": [4.1, 0, 0]");
    let (thick, _) = rooms(&thick).unwrap();
    let (contents, _) = Contents::new(&thick, &Model::default()).unwrap();
    assert_eq!(contents.locate(&thick, at(3.95, 1.0, 1.5)), west);
    assert_eq!(contents.locate(&thick, at(4.05, 1.0, 1.5)), east);
    assert_eq!(contents.locate(&thick, at(4.05, 1.0, 3.5)), None);
    // Boxes that both have it: the same; beside the doorway, the smaller.
    let both = TWO_ROOMS
        .replace("\"max\": [4, 3, 4]", "\"max\": [4.1, 3, 4]")
        .replace("\"min\": [4, 0, 0]", "\"min\": [3.8, 0, 0]");
    let (both, _) = rooms(&both).unwrap();
    let (contents, _) = Contents::new(&both, &Model::default()).unwrap();
    assert_eq!(contents.locate(&both, at(3.95, 1.0, 1.5)), west);
    assert_eq!(contents.locate(&both, at(4.05, 1.0, 1.5)), east);
    assert_eq!(contents.locate(&both, at(4.05, 1.0, 3.5)), west);
}

#[test]
fn viewers_are_in_the_room_that_they_see_where_bounds_interlock() {
    // Two hooks, each in the other's bounds, and an opening at the end of the first.
    let hooks = [
        (
            "cell:a",
            [[[0.0, 6.0], [0.0, 2.0]], [[4.0, 6.0], [2.0, 4.0]]],
            vec![
                [6.0, 4.0],
                [6.0, 0.0],
                [0.0, 0.0],
                [0.0, 2.0],
                [4.0, 2.0],
                [4.0, 4.0],
            ],
        ),
        (
            "cell:b",
            [[[0.0, 6.0], [4.0, 6.0]], [[0.0, 2.0], [2.0, 4.0]]],
            vec![
                [4.0, 4.0],
                [2.0, 4.0],
                [2.0, 2.0],
                [0.0, 2.0],
                [0.0, 6.0],
                [6.0, 6.0],
                [6.0, 4.0],
            ],
        ),
    ];
    let mut quads = Vec::new();
    for (name, floors, walls) in &hooks {
        for [x, z] in floors {
            quads.extend([0.0, 2.5].map(|y| (*name, level(*x, *z, y))));
        }
        quads.extend(walls.windows(2).map(|ends| (*name, wall(ends[0], ends[1]))));
    }
    quads.push(("portal:a|b", wall([4.0, 4.0], [6.0, 4.0])));
    let model = nodes_of_quads(&quads);
    let (interior, warnings) = interior_from_nodes(&model, "m.glb", 1.0).unwrap();
    assert_eq!(warnings, []);
    let (contents, _) = Contents::new(&interior, &model).unwrap();
    let [a, b] = [Some(CellId(0)), Some(CellId(1))];
    for (x, z, cell) in [
        (1.0, 1.0, a),
        (3.0, 1.9, a),
        (5.0, 3.0, a),
        (5.0, 3.99, a),
        (5.0, 4.01, b),
        (3.0, 5.0, b),
        (1.0, 3.0, b),
        (1.9, 2.1, b),
        // Between the hooks, in the bounds of both: nobody knows.
        (3.0, 3.0, None),
        (7.0, 3.0, None),
    ] {
        let found = contents.locate(&interior, DVec3::new(x, 1.5, z));
        assert_eq!(found, cell, "{x} {z}");
    }
}

#[test]
fn cameras_stand_on_semicircles_before_portals() {
    let interior = two_rooms();
    let (contents, _) = Contents::new(&interior, &Model::default()).unwrap();
    let views = semicircles(&interior, &contents, &SemicircleOptions::default());
    // Two sides of the door; the window from outside alone.
    assert_eq!(views.len(), 3 * 13);
    let sides: Vec<_> = views.chunks(13).map(|v| (v[0].from, v[0].into)).collect();
    let [west, east] = [CellId(0), CellId(1)];
    assert_eq!(
        sides,
        [(Some(west), east), (Some(east), west), (None, east)]
    );
    for (side, radius) in views.chunks(13).zip([1.5, 1.5, 0.7]) {
        let portal = interior.portal(side[0].portal);
        let center = portal.polygon.center();
        for (i, view) in side.iter().enumerate() {
            let eye = view.camera_from_world.center();
            let level = (eye - center).with_y(0.0);
            assert!((level.length() - radius).abs() < 1e-9);
            // At eye height over the floor of the viewer's cell; outside, over that of the cell within.
            assert!((eye.y - 1.6).abs() < 1e-9);
            // On the viewer's side.
            let height = portal.polygon.height(eye);
            assert_eq!(height > 0.0, portal.cells[0] == view.from);
            assert!(height.abs() > 0.49 * radius);
            assert!(view.is_inside);
            // Aimed at the portal's centre, upright.
            let target = view.camera_from_world * center;
            assert!(target.truncate().length() < 1e-9 && target.z > 0.0);
            let right = view.camera_from_world.rotation.conjugate() * DVec3::X;
            assert!(right.y.abs() < 1e-9);
            let angle = (i as f64 - 6.0) * 10.0;
            assert!((view.angle.to_degrees() - angle).abs() < 1e-9);
        }
        // From left to right as one looks at the portal.
        let middle = side[6].camera_from_world;
        let [first, last] = [&side[0], &side[12]].map(|v| v.camera_from_world.center());
        assert!((middle * first).x < 0.0 && (middle * last).x > 0.0);
    }
    let few = SemicircleOptions {
        views: 1,
        span: 1.0,
    };
    assert_eq!(semicircles(&interior, &contents, &few).len(), 3);
    let mut large = interior.clone();
    large.portals[0].radius = Some(5.0);
    let views = semicircles(&large, &contents, &few);
    let inside: Vec<bool> = views.iter().map(|v| v.is_inside).collect();
    assert_eq!(inside, [false, false, true]);
}

#[test]
fn the_captured_house_has_three_cells() {
    let Some(folder) = common::find_capture("interior-house") else {
        return;
    };
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/interior-house-rooms.json");
    let GivenRooms {
        interior, warnings, ..
    } = read_rooms(&path, "house.glb", 1.0).unwrap();
    assert_eq!(warnings, []);
    let (model, _) = mesh::read_model(&folder.join("house.glb")).unwrap();
    let (contents, warnings) = Contents::new(&interior, &model).unwrap();
    let count = model.mesh.triangles.len();
    let counts: Vec<usize> = contents.triangles.iter().map(Vec::len).collect();
    eprintln!("{count} triangles, {counts:?} in cells: {warnings:?}");
    assert!(counts.iter().all(|n| *n > 1000), "{counts:?}");
    assert!(contents.elsewhere.len() < count / 50, "{warnings:?}");
    assert_eq!(
        semicircles(&interior, &contents, &SemicircleOptions::default()).len(),
        4 * 13
    );
}
