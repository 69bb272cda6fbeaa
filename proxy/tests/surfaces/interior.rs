//! Interiors: files, what is said of bad ones, contents, cameras before portals.

use crate::common;

use glam::DVec3;
use proptest::prelude::*;
use proxy::interior::{
    CellId, Content, Contents, Interior, InteriorFileError, InteriorWarning, Polygon, PortalId,
    RoomBox, SemicircleOptions, interior_from_nodes, parse_interior, parse_rooms, read_rooms,
    semicircles, write_interior,
};
use proxy::mesh::{self, Mesh, Model, ModelNode, Part};
use std::path::Path;

/// Two rooms side by side along x, a door and a window.
const TWO_ROOMS: &str = r#"{
  "version": 1,
  "rooms": [
    {"name": "west", "min": [0, 0, 0], "max": [4, 3, 4]},
    {"name": "east", "min": [4, 0, 0], "max": [8, 3, 4]}
  ],
  "openings": [
    {"name": "door", "between": ["west", "east"],
     "polygon": [[4, 0, 1], [4, 0, 2], [4, 2, 2], [4, 2, 1]]},
    {"name": "window", "between": ["east", null], "radius": 0.7,
     "polygon": [[8, 1, 1], [8, 1, 3], [8, 2, 3], [8, 2, 1]]}
  ]
}"#;

fn two_rooms() -> Interior {
    let (interior, warnings) = rooms(TWO_ROOMS).unwrap();
    assert_eq!(warnings, []);
    interior
}

fn rooms(text: &str) -> Result<(Interior, Vec<InteriorWarning>), InteriorFileError> {
    parse_rooms(Path::new("rooms.json"), text.as_bytes(), "house.glb")
}

#[test]
fn an_interior_comes_back_from_its_file_to_the_last_digit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("interior.json");
    let mut interior = two_rooms();
    interior.eye_height = 1.0 / 3.0;
    interior.up = DVec3::new(0.1, 0.9, -0.2).normalize();
    interior.cells[0].content = Content::Scene {
        folder: "../west wing".to_owned(),
        room: None,
    };
    interior.cells[1].content = Content::Box(RoomBox {
        min: DVec3::new(4.0, 0.1 + 0.2, -1e-300),
        max: DVec3::new(5e6 + 0.1, 1.0 / 3.0, 7.0),
    });
    interior.cells[0].floor = Some(interior.portals[1].polygon.clone());
    let keep = |v: &str| serde_json::from_str(v).unwrap();
    interior.other.insert(
        "architect".to_owned(),
        keep(r#"{"name": [1, 2.5e-7, null]}"#),
    );
    interior.cells[1]
        .other
        .insert("paint".to_owned(), keep("true"));
    interior.portals[0]
        .other
        .insert("leaf".to_owned(), keep("\"oak\""));
    write_interior(&path, &interior).unwrap();
    let (back, _) = proxy::interior::read_interior(&path).unwrap();
    assert_eq!(back, interior);
    assert_eq!(back.cells[0].content.room(), None);
    assert_eq!(back.cells[1].content.scene(), None);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    // Again, byte for byte.
    let bytes = std::fs::read(&path).unwrap();
    write_interior(&path, &back).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), bytes);
    // Boxes that photos show, and those that have no say.
    let room = back.cells[1].content.room();
    let mut shown = back;
    shown.show_photos("../east wing");
    shown.held_out = vec!["a.jpg".to_owned()];
    assert_eq!(shown.cells[0].content.scene(), Some("../west wing"));
    assert_eq!(shown.cells[1].content.scene(), Some("../east wing"));
    assert_eq!(shown.cells[1].content.room(), room);
    write_interior(&path, &shown).unwrap();
    let (back, _) = proxy::interior::read_interior(&path).unwrap();
    assert_eq!(back, shown);
}

#[test]
fn what_editors_put_before_text_is_passed_over() {
    let (interior, _) = rooms(&format!("\u{feff}{TWO_ROOMS}")).unwrap();
    assert_eq!(interior, two_rooms());
}

/// What is said of an interior file.
fn message(text: &str) -> String {
    match parse_interior(Path::new("i.json"), text.as_bytes()) {
        Ok((interior, warnings)) => panic!("{interior:?} {warnings:?}"),
        Err(error) => error.to_string(),
    }
}

const TWO_PORTALS: &str = r#"
    {"name": "p", "cells": ["a", null], "polygon": [[1, 0, 0], [1, 1, 0], [1, 1, 1]]},
    {"name": "q", "cells": [null, "a"], "polygon": [[0, 0, 0], [0, 1, 0], [0, 1, 1]]}"#;

/// One cell and what is given.
fn with(cells: &str, portals: &str) -> String {
    format!(
        r#"{{"version": 1, "model": "m.glb", "up": [0, 1, 0], "eye_height": 1.6,
            "cells": [{{"name": "a", "box": {{"min": [0, 0, 0], "max": [1, 1, 1]}}}}{cells}],
            "portals": [{portals}]}}"#
    )
}

#[test]
fn what_is_wrong_is_said() {
    let portal = |polygon: &str, cells: &str| {
        with(
            "",
            &format!(r#"{{"name": "p", "polygon": {polygon}, "cells": {cells}}}"#),
        )
    };
    let square = "[[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]]";
    for (text, said) in [
        ("{", "not an interior: EOF"),
        (
            r#"{"version": 2}"#,
            "version 2; this program reads version 1",
        ),
        (r#"{"version": 1}"#, "missing field `up`"),
        (
            &portal("[[0, 0, 0], [0, 1, 0]]", r#"["a", null]"#),
            "portal `p`: it has 2 corners; give 3 to 256",
        ),
        (
            &portal("[[0, 0, 0], [0, 1, 0], [0, 2, 0]]", r#"["a", null]"#),
            "portal `p`: its corners lie on a line",
        ),
        (
            &portal(
                "[[0, 0, 0], [0, 1, 0], [0.1, 1, 1], [0, 0, 1]]",
                r#"["a", null]"#,
            ),
            "off the plane of the others",
        ),
        (
            &portal(square, r#"["a", "b"]"#),
            "portal `p` leads to the cell `b`; there are: a",
        ),
        (&portal(square, r#"["a", "a"]"#), "leads from `a` to `a`"),
        (
            &portal(square, r#"["a", null, "b"]"#),
            "not an interior: invalid length 3, expected an array of length 2",
        ),
        (
            &portal("[[0, 0, 0], [0, 1, 0, 0], [0, 1, 1]]", r#"["a", null]"#),
            "invalid length 4, expected an array of length 3",
        ),
        (
            &with("", "").replace("[0, 1, 0]", "[0, 1, 0, 0]"),
            "invalid length 4, expected an array of length 3",
        ),
        (
            &with("", "").replace("[0, 1, 0]", "[0, 1]"),
            "invalid length 2, expected an array of length 3",
        ),
        (&portal(square, "[null, null]"), "leads from null to null"),
        (
            &portal("[[0, 0, NaN], [0, 1, 0], [0, 1, 1]]", r#"["a", null]"#),
            "not an interior: expected value",
        ),
        (
            &portal("[[0, 0, 1e999], [0, 1, 0], [0, 1, 1]]", r#"["a", null]"#),
            "number out of range",
        ),
        (
            &with(r#", {"name": "a", "nodes": ["x"]}"#, ""),
            "two cells are called `a`",
        ),
        // Before what portals make of them.
        (
            &with(r#", {"name": "a", "nodes": ["x"]}"#, TWO_PORTALS)
                .replace(r#"[null, "a"]"#, r#"[null, "b"]"#),
            "two cells are called `a`",
        ),
        (
            &with("", TWO_PORTALS).replace(r#"{"name": "a", "box""#, r#"{"name": "", "box""#),
            "a cell has no name",
        ),
        (
            r#"{"version": 1, "up": [0, 1, 0], "eye_height": 1, "cells": [], "portals": [
                {"name": "p", "cells": ["a", null], "polygon": [[1, 0, 0], [1, 1, 0], [1, 1, 1]]}]}"#,
            "there are no cells",
        ),
        (
            &with(r#", {"name": "", "nodes": ["x"]}"#, ""),
            "a cell has no name",
        ),
        (
            &with(r#", {"name": "b"}"#, ""),
            "cell `b` must have one of `box`, `nodes` and `scene`, or `scene` and `box`, and has 0",
        ),
        (
            &with(r#", {"name": "b", "nodes": [], "scene": "s"}"#, ""),
            "and has 2",
        ),
        (
            &with(
                r#", {"name": "b", "box": {"min": [0, 0, 0], "max": [1, 0, 1]}}"#,
                "",
            ),
            "the box of cell `b` is empty",
        ),
        (
            &with(r#", {"name": "b", "scene": "s", "floor": [[0, 0, 0]]}"#, ""),
            "the floor of cell `b`: it has 1 corners",
        ),
        (
            &with(
                r#", {"name": "b", "scene": "s", "floor": [[0, 0, 0], [0, 0, 1], [0, 0, 2]]}"#,
                "",
            ),
            "the floor of cell `b`: its corners lie on a line; give an outline that encloses something",
        ),
        (
            &with(
                r#", {"name": "b", "scene": "s", "floor": [[0, 0, 0], [0, 0, 1], [1, 0, 2, 3]]}"#,
                "",
            ),
            "invalid length 4",
        ),
        (
            r#"{"version": 1, "up": [0, 0, 0], "eye_height": 1, "cells": [], "portals": []}"#,
            "`up` is [0.0, 0.0, 0.0]",
        ),
        (
            r#"{"version": 1, "up": [0, 0, 2], "eye_height": -1, "cells": [], "portals": []}"#,
            "`eye_height` is -1; expected a positive number",
        ),
        (
            r#"{"version": 1, "up": [0, 0, 2], "eye_height": 1, "cells": [], "portals": []}"#,
            "there are no cells",
        ),
        (
            r#"{"version": 1, "up": [0, 0, 2], "eye_height": 1,
                "cells": [{"name": "a", "nodes": ["x"]}], "portals": []}"#,
            "no `model` is named",
        ),
    ] {
        let found = message(text);
        assert!(found.starts_with("i.json: "), "{found}");
        assert!(found.contains(said), "{found} does not say {said}");
    }
    // In memory, too.
    let mut interior = two_rooms();
    interior.portals[0].radius = Some(f64::NAN);
    let error = interior.check().unwrap_err().to_string();
    assert_eq!(
        error,
        "the radius of portal `door` is NaN; expected a positive number"
    );
    interior.portals[0].radius = None;
    interior.portals[0].cells[1] = Some(CellId(7));
    assert!(interior.check().is_err());
}

#[test]
fn numbers_of_which_nothing_can_be_computed_are_refused() {
    let huge = |change: &dyn Fn(&mut Interior)| {
        let mut interior = two_rooms();
        change(&mut interior);
        interior.check().unwrap_err().to_string()
    };
    let square = |x: f64| {
        let corners = [[0.0, 0.0, 0.0], [x, 0.0, 0.0], [x, 0.0, x], [0.0, 0.0, x]];
        Polygon::new(corners.map(DVec3::from_array).to_vec()).unwrap()
    };
    let room = RoomBox {
        min: DVec3::ZERO,
        max: DVec3::new(4.0, 3.0, 1e300),
    };
    for (found, said) in [
        (huge(&|i| i.eye_height = 1e308), "`eye_height`: 1e308"),
        (
            huge(&|i| i.cells[1].content = Content::Box(room)),
            "the box of cell `east`: 1e300",
        ),
        (
            huge(&|i| i.cells[0].floor = Some(square(2e12))),
            "the floor of cell `west`: 2e12",
        ),
        (
            huge(&|i| i.portals[1].radius = Some(1e200)),
            "the radius of portal `window`: 1e200",
        ),
        (
            huge(&|i| i.portals[0].polygon = square(3e20)),
            "the outline of portal `door`: 3e20",
        ),
    ] {
        let expected = format!(
            "{said} is too large; expected no more than 1e12 world units: correct it, or scale the model"
        );
        assert_eq!(found, expected);
    }
    // Of a file as well, which is named.
    let text = with("", TWO_PORTALS).replace("1.6", "1e308");
    let said = "i.json: `eye_height`: 1e308 is too large";
    assert!(message(&text).starts_with(said), "{}", message(&text));
    let far = TWO_ROOMS.replace("[8, 3, 4]", "[8, 3, 1e300]");
    assert!(rooms(&far).is_err());
}

#[test]
fn what_is_odd_is_told() {
    let odd = |text: &str| {
        let (_, warnings) = rooms(text).unwrap();
        let said: Vec<String> = warnings.iter().map(|w| w.to_string()).collect();
        said.join("\n")
    };
    let overlapping = TWO_ROOMS.replace("\"max\": [4, 3, 4]", "\"max\": [4.5, 3, 4]");
    let said = odd(&overlapping);
    assert!(
        said.contains("the boxes of cells `west` and `east` overlap"),
        "{said}"
    );
    let apart = TWO_ROOMS.replace("[\"west\", \"east\"]", "[null, \"east\"]");
    assert!(odd(&apart).contains("cell `west` has no portal"));
    let far = TWO_ROOMS.replace(
        "\"min\": [0, 0, 0], \"max\": [4, 3, 4]",
        "\"min\": [-9, 0, 0], \"max\": [-5, 3, 4]",
    );
    assert!(odd(&far).contains("portal `door` is 9 away from the box of its cell `west`"));
    // Names do not end lines, nor command the terminal.
    let named = apart.replace("west", "we\\u001b[31mst\\n");
    let said = odd(&named);
    assert!(
        said.contains(r"cell `we\u{1b}[31mst\n` has no portal"),
        "{said}"
    );
    let lost = TWO_ROOMS.replace("\"name\": \"west\"", "\"name\": \"we\\u001bst\"");
    let error = rooms(&lost).unwrap_err().to_string();
    assert!(
        error.contains(r"`west`; there are: east, we\u{1b}st"),
        "{error}"
    );
    // Rooms' outlines are turned the right way; an interior's are believed, and doubted.
    let mut interior = two_rooms();
    assert!((interior.portals[0].polygon.normal() + DVec3::X).length() < 1e-12);
    interior.portals[0].polygon = interior.portals[0].polygon.clone().reversed();
    let warnings = interior.check().unwrap();
    assert_eq!(warnings, [InteriorWarning::Turned("door".to_owned())]);
}

#[test]
fn eyes_over_all_ceilings_or_on_the_floor_are_told() {
    // Both rooms are 3 high.
    for (eye_height, is_told) in [
        (1600.0, true),
        (160.0, true),
        (3.1, true),
        (2.9, false),
        (0.2, false),
        (0.0016, true),
    ] {
        let text = format!(r#"{{"version": 1, "eye_height": {eye_height},"#);
        let text = TWO_ROOMS.replacen("{\n  \"version\": 1,", &text, 1);
        let (interior, warnings) = rooms(&text).unwrap();
        assert_eq!(interior.eye_height, eye_height);
        let told = is_told.then_some(InteriorWarning::EyeHeight {
            eye_height,
            least: 3.0,
            most: 3.0,
        });
        assert_eq!(warnings, Vec::from_iter(told), "{eye_height}");
        // Of cells that are nodes, what they span tells.
        let model = nodes_of_quads(&[
            ("cell:a", wall([0.0, 0.0], [4.0, 0.0])),
            ("cell:b", wall([4.0, 0.0], [8.0, 0.0])),
        ]);
        let (interior, _) = interior_from_nodes(&model, "m.glb", eye_height / 1.6).unwrap();
        let (_, warnings) = Contents::new(&interior, &model).unwrap();
        let is_of_eyes = |w: &InteriorWarning| matches!(w, InteriorWarning::EyeHeight { .. });
        let is_over = is_told || eye_height > 2.5;
        assert_eq!(warnings.iter().any(is_of_eyes), is_over, "{eye_height}");
    }
    let mut interior = two_rooms();
    interior.eye_height = 160.0;
    assert_eq!(
        interior.odd_eye_height().unwrap().to_string(),
        "`eye_height` is 160, and the cells are 3 to 3 high: eyes see nothing of them, or little; it is in \
         world units as boxes are: correct it"
    );
}

#[test]
fn floors_outside_their_boxes_are_told() {
    // The west room is 4 × 3 × 4.
    let with_floor = |[x, to_x]: [f64; 2], y: f64| {
        let mut interior = two_rooms();
        let corners = [[x, y, 0.0], [x, y, 4.0], [to_x, y, 4.0], [to_x, y, 0.0]];
        let floor = Polygon::new(corners.map(DVec3::from_array).to_vec());
        interior.cells[0].floor = Some(floor.unwrap());
        interior
    };
    let own = [0.0, 4.0];
    for (x, y, distance) in [
        // In it, or where eyes are in it.
        (own, 0.0, None),
        (own, 1.0, None),
        (own, -0.5, None),
        ([3.0, 8.0], 0.0, None),
        // Over it, and under it.
        (own, 50.0, Some(47.0)),
        (own, -2.0, Some(2.0)),
        // The next room's, and farther.
        ([4.0, 8.0], 0.0, Some(0.0)),
        ([20.0, 24.0], 0.0, Some(16.0)),
    ] {
        let told = distance.map(|distance| InteriorWarning::FloorAway {
            cell: "west".to_owned(),
            distance,
        });
        let warnings = with_floor(x, y).check().unwrap();
        assert_eq!(warnings, Vec::from_iter(told), "{x:?} {y}");
    }
    let said = |interior: &Interior| interior.check().unwrap()[0].to_string();
    let at = with_floor([20.0, 24.0], 0.0);
    assert!(said(&at).contains("outside the cell's box, 16 away: eyes"));
    let at = with_floor([4.0, 8.0], 0.0);
    assert!(said(&at).contains("outside the cell's box, which it only touches: eyes"));
    // In it, with eyes 1.6 above it that are not.
    let high = InteriorWarning::FloorHigh("west".to_owned());
    let mut at = with_floor(own, 2.0);
    assert_eq!(at.check().unwrap(), [high]);
    assert!(said(&at).contains("`west` is so high that eyes over it"));
    at.eye_height = 0.9;
    assert_eq!(at.check().unwrap(), []);
    // On a wall of it, or anywhere, as walls are: what is said is how it stands.
    for x in [0.0, 2.0, 4.0, 50.0] {
        let mut interior = two_rooms();
        let corners = [[x, 0.0, 0.0], [x, 0.0, 4.0], [x, 3.0, 4.0]];
        let wall = Polygon::new(corners.map(DVec3::from_array).to_vec()).unwrap();
        interior.cells[0].floor = Some(wall);
        let steep = InteriorWarning::FloorSteep("west".to_owned());
        assert_eq!(interior.check().unwrap(), [steep]);
        let said = said(&interior);
        assert!(
            said.starts_with("the floor of cell `west` is as steep as a wall: "),
            "{said}"
        );
    }
    // Whichever way is up.
    for (y, is_told) in [(0.0, false), (50.0, true)] {
        let mut interior = with_floor(own, y);
        interior.up = DVec3::new(0.1, 0.9, -0.2).normalize();
        let warnings = interior.check().unwrap();
        let is_of_floor = |w: &InteriorWarning| matches!(w, InteriorWarning::FloorAway { .. });
        assert_eq!(warnings.iter().any(is_of_floor), is_told, "{warnings:?}");
    }
}

/// A model of single triangles.
fn model(triangles: &[[[f64; 3]; 3]], nodes: &[&str]) -> Model {
    let corners: Vec<DVec3> = triangles
        .as_flattened()
        .iter()
        .map(|p| DVec3::from_array(*p))
        .collect();
    let count = triangles.len() as u32;
    let name = |i: u32| nodes.get(i as usize).copied().unwrap_or("thing").to_owned();
    Model {
        uvs: vec![[0.0; 2]; corners.len()],
        colors: vec![[255; 4]; corners.len()],
        mesh: Mesh {
            triangles: (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            positions: corners,
        },
        parts: (0..count)
            .map(|i| Part {
                triangles: i..i + 1,
                node_idx: i,
                material_idx: 0,
            })
            .collect(),
        nodes: (0..count)
            .map(|i| ModelNode {
                name: name(i),
                parent_idx: None,
            })
            .collect(),
        materials: vec![mesh::Material::default()],
        textures: Vec::new(),
    }
}

/// A triangle around a place.
fn around([x, y, z]: [f64; 3], size: f64) -> [[f64; 3]; 3] {
    [
        [x - size, y, z - size],
        [x + size, y, z - size],
        [x, y, z + size],
    ]
}

#[test]
fn cells_have_what_touches_them() {
    let model = model(
        &[
            around([1.0, 1.0, 1.0], 0.1),
            around([4.0, 1.0, 1.0], 0.1),
            around([7.0, 1.0, 1.0], 0.1),
            around([7.0, 9.0, 1.0], 0.1),
        ],
        &[],
    );
    let interior = two_rooms();
    let (contents, warnings) = Contents::new(&interior, &model).unwrap();
    assert_eq!(contents.triangles, [vec![0, 1], vec![1, 2]]);
    assert_eq!(contents.elsewhere, [3]);
    assert_eq!(warnings, [InteriorWarning::Elsewhere(1)]);
    // Of an empty model there is nothing to see, and everything else works.
    let (empty, warnings) = Contents::new(&interior, &Model::default()).unwrap();
    assert_eq!(warnings.len(), 2);
    assert_eq!(empty.locate(&interior, DVec3::ONE), Some(CellId(0)));
}

#[test]
fn nodes_name_cells_and_portals() {
    let mut model = model(
        &[
            around([1.0, 1.0, 1.0], 1.0),
            around([5.0, 1.0, 1.0], 1.0),
            [[3.0, 0.0, 0.0], [3.0, 0.0, 2.0], [3.0, 2.0, 2.0]],
            [[3.0, 0.0, 0.0], [3.0, 2.0, 2.0], [3.0, 2.0, 0.0]],
        ],
        &["cell:a", "cell:b", "portal:a|b"],
    );
    model.parts[3].node_idx = 2;
    let (interior, warnings) = interior_from_nodes(&model, "m.glb", 1.0).unwrap();
    assert_eq!(warnings, []);
    assert_eq!(interior.eye_height, 1.6);
    let portal = interior.portal(PortalId(0));
    assert_eq!(portal.cells, [Some(CellId(0)), Some(CellId(1))]);
    assert_eq!(portal.polygon.corners().len(), 4);
    assert!((portal.polygon.normal() + DVec3::X).length() < 1e-12);
    let (contents, warnings) = Contents::new(&interior, &model).unwrap();
    assert_eq!(contents.triangles, [vec![0], vec![1]]);
    assert_eq!((contents.elsewhere.len(), warnings.len()), (0, 0));
    // In centimetres.
    let (fine, _) = interior_from_nodes(&model, "m.glb", 100.0).unwrap();
    assert_eq!(fine.eye_height, 160.0);
    assert!(interior_from_nodes(&model, "m.glb", f64::NAN).is_err());
    // What is not there.
    let mut unknown = interior.clone();
    unknown.cells[0].content = Content::Nodes(vec!["moon".to_owned()]);
    let error = Contents::new(&unknown, &model).unwrap_err().to_string();
    assert_eq!(
        error,
        "cell `a` shows the node `moon`, which the model does not have; correct its `nodes`; there are: cell:a, cell:b"
    );
    // Of many, some.
    let node = |i: usize| ModelNode {
        name: format!("part {i:02}"),
        parent_idx: None,
    };
    let parts = Model {
        nodes: (0..30).map(node).collect(),
        ..Model::default()
    };
    let error = Contents::new(&unknown, &parts).unwrap_err().to_string();
    assert!(error.contains("there are: part 00, part 01, "), "{error}");
    assert!(error.ends_with(", part 19, and 10 more"), "{error}");
    let error = Contents::new(&unknown, &Model::default()).unwrap_err();
    let error = error.to_string();
    assert!(error.ends_with("there are: none with a name"), "{error}");
    // Names that are not quite as they should be.
    for (i, name, said) in [
        (2, "portal:a", "expected `portal:A|B`, or `portal:A|` for"),
        (2, "Portal:a|b", "names of rooms begin with `cell:`"),
        (1, "Cell:b", "names of rooms begin with `cell:`"),
    ] {
        let mut odd = model.clone();
        odd.nodes[i].name = name.to_owned();
        let error = interior_from_nodes(&odd, "m.glb", 1.0).unwrap_err();
        let said = format!("node `{name}`: {said}");
        assert!(error.to_string().starts_with(&said), "{error}");
    }
    model.nodes[2].name = "portal:a|c".to_owned();
    let error = interior_from_nodes(&model, "m.glb", 1.0)
        .unwrap_err()
        .to_string();
    assert!(error.contains("leads to the cell `c`"), "{error}");
    model.parts[3].node_idx = 0;
    model.parts[2].node_idx = 0;
    model.nodes[2].name = "portal:a|b".to_owned();
    let error = interior_from_nodes(&model, "m.glb", 1.0)
        .unwrap_err()
        .to_string();
    assert!(error.contains("it has no triangles"), "{error}");
    for node in &mut model.nodes {
        node.name.clear();
    }
    assert!(interior_from_nodes(&model, "m.glb", 1.0).is_err());
}

/// An L-shaped corridor, a room in its crook, and what opens between them.
fn room_in_the_crook(polygon: &str) -> String {
    format!(
        r#"{{"version": 1,
            "rooms": [
              {{"name": "corridor", "min": [0, 0, 0], "max": [6, 3, 6],
               "floor": [[0, 0, 0], [6, 0, 0], [6, 0, 1.5], [1.5, 0, 1.5], [1.5, 0, 6], [0, 0, 6]]}},
              {{"name": "room", "min": [1.6, 0, 1.6], "max": [3, 3, 3]}}
            ],
            "openings": [{{"name": "door", "between": ["corridor", "room"], "polygon": {polygon}}}]}}"#
    )
}

#[test]
fn a_door_has_its_sides_where_a_room_goes_around_the_next() {
    // The corridor's middle lies beyond the room's, as seen from the door.
    for polygon in [
        "[[1.5, 0, 2], [1.5, 0, 2.8], [1.5, 2, 2.8], [1.5, 2, 2]]",
        "[[1.5, 2, 2], [1.5, 2, 2.8], [1.5, 0, 2.8], [1.5, 0, 2]]",
    ] {
        let (mut interior, warnings) = rooms(&room_in_the_crook(polygon)).unwrap();
        assert_eq!(warnings, []);
        let door = &mut interior.portals[0].polygon;
        assert!((door.normal() + DVec3::X).length() < 1e-12);
        *door = door.clone().reversed();
        let warnings = interior.check().unwrap();
        assert_eq!(warnings, [InteriorWarning::Turned("door".to_owned())]);
    }
    // A window out of a U into its own yard.
    let yard = r#"{"version": 1,
        "rooms": [{"name": "u", "min": [0, 0, 0], "max": [6, 3, 6],
          "floor": [[0, 0, 0], [6, 0, 0], [6, 0, 6], [4.5, 0, 6], [4.5, 0, 1.5], [1.5, 0, 1.5],
                    [1.5, 0, 6], [0, 0, 6]]}],
        "openings": [{"name": "window", "between": ["u", null],
          "polygon": [[2.5, 1, 1.5], [3.5, 1, 1.5], [3.5, 2, 1.5], [2.5, 2, 1.5]]}]}"#;
    let (interior, warnings) = rooms(yard).unwrap();
    assert_eq!(warnings, []);
    assert!((interior.portals[0].polygon.normal() + DVec3::Z).length() < 1e-12);
}

#[test]
fn an_outline_is_believed_where_both_cells_are_on_both_sides() {
    let both = TWO_ROOMS
        .replace("\"max\": [4, 3, 4]", "\"max\": [8, 3, 4]")
        .replace("\"min\": [4, 0, 0]", "\"min\": [0, 0, 0]")
        .replace("\"max\": [8, 3, 4]", "\"max\": [9, 3, 4]");
    let (mut interior, warnings) = rooms(&both).unwrap();
    let is_turned = |warning: &InteriorWarning| matches!(warning, InteriorWarning::Turned(_));
    assert!(!warnings.iter().any(is_turned), "{warnings:?}");
    let door = &mut interior.portals[0].polygon;
    assert!((door.normal() + DVec3::X).length() < 1e-12);
    *door = door.clone().reversed();
    assert!(!interior.check().unwrap().iter().any(is_turned));
}

/// Flat, four-sided pieces of named nodes.
fn nodes_of_quads(quads: &[(&str, [[f64; 3]; 4])]) -> Model {
    let triangles: Vec<[[f64; 3]; 3]> = quads
        .iter()
        .flat_map(|(_, [a, b, c, d])| [[*a, *b, *c], [*a, *c, *d]])
        .collect();
    let mut names: Vec<&str> = quads.iter().map(|(name, _)| *name).collect();
    names.dedup();
    let mut model = model(&triangles, &names);
    for (i, part) in model.parts.iter_mut().enumerate() {
        let name = quads[i / 2].0;
        part.node_idx = names.iter().position(|n| *n == name).unwrap() as u32;
    }
    model
}

/// A piece of floor or ceiling.
fn level([x0, x1]: [f64; 2], [z0, z1]: [f64; 2], y: f64) -> [[f64; 3]; 4] {
    [[x0, y, z0], [x1, y, z0], [x1, y, z1], [x0, y, z1]]
}

/// A wall from one place to another.
fn wall([x0, z0]: [f64; 2], [x1, z1]: [f64; 2]) -> [[f64; 3]; 4] {
    [[x0, 0.0, z0], [x1, 0.0, z1], [x1, 2.5, z1], [x0, 2.5, z0]]
}

#[test]
fn openings_may_be_copies_and_have_faces_on_both_sides() {
    let door = wall([3.0, 0.5], [3.0, 1.5]);
    let [a, b, c, d] = door;
    let mut quads = vec![
        ("cell:a", level([0.0, 3.0], [0.0, 4.0], 0.0)),
        ("cell:b.007", level([3.0, 6.0], [0.0, 4.0], 0.0)),
        ("portal:a|b.007", door),
        ("portal:a|b.007.001", wall([3.0, 2.5], [3.0, 3.5])),
        ("portal:a|.002", wall([0.0, 1.0], [0.0, 2.0])),
    ];
    // Split into triangles as the front is, and the other way.
    for back in [[a, d, c, b], [d, c, b, a]] {
        quads.insert(3, ("portal:a|b.007", back));
        let model = nodes_of_quads(&quads);
        let (interior, warnings) = interior_from_nodes(&model, "m.glb", 1.0).unwrap();
        assert_eq!(warnings, []);
        let [a, b] = [Some(CellId(0)), Some(CellId(1))];
        let cells: Vec<_> = interior.portals.iter().map(|p| p.cells).collect();
        assert_eq!(cells, [[a, b], [a, b], [a, None]]);
        let names: Vec<&str> = interior.portals.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["a|b.007", "a|b.007.001", "a|.002"]);
        let corners = interior.portals[0].polygon.corners();
        let is_there = |p: &[f64; 3]| corners.contains(&DVec3::from_array(*p));
        assert!(corners.len() == 4 && door.iter().all(is_there));
        quads.remove(3);
    }
    // A number that is none, and what is no copy.
    for name in ["portal:a|b.1", "portal:a|b.x01", "portal:a|c.001"] {
        let mut quads = quads.clone();
        quads.push((name, door));
        let error = interior_from_nodes(&nodes_of_quads(&quads), "m.glb", 1.0).unwrap_err();
        let said = format!(
            "leads to the cell `{}`",
            name.trim_start_matches("portal:a|")
        );
        assert!(error.to_string().contains(&said), "{error}");
    }
}

#[test]
fn nodes_of_a_door_have_their_sides_where_a_room_goes_around_the_next() {
    let mut quads = Vec::new();
    for y in [0.0, 2.5] {
        quads.push(("cell:corridor", level([0.0, 6.0], [0.0, 1.5], y)));
        quads.push(("cell:corridor", level([0.0, 1.5], [1.5, 6.0], y)));
    }
    for (from, to) in [
        ([0.0, 0.0], [6.0, 0.0]),
        ([0.0, 0.0], [0.0, 6.0]),
        ([0.0, 6.0], [1.5, 6.0]),
        ([6.0, 0.0], [6.0, 1.5]),
        ([1.5, 1.5], [6.0, 1.5]),
        ([1.5, 1.5], [1.5, 2.0]),
        ([1.5, 3.0], [1.5, 6.0]),
    ] {
        quads.push(("cell:corridor", wall(from, to)));
    }
    for y in [0.0, 2.5] {
        quads.push(("cell:room", level([1.5, 3.5], [1.5, 3.5], y)));
    }
    for (from, to) in [
        ([1.5, 1.5], [3.5, 1.5]),
        ([3.5, 1.5], [3.5, 3.5]),
        ([1.5, 3.5], [3.5, 3.5]),
    ] {
        quads.push(("cell:room", wall(from, to)));
    }
    // Its outline may go either way round, and either side may be named first.
    let door = wall([1.5, 2.0], [1.5, 3.0]);
    let [a, b, c, d] = door;
    for (name, outline, into_first) in [
        ("portal:corridor|room", door, DVec3::NEG_X),
        ("portal:corridor|room", [d, c, b, a], DVec3::NEG_X),
        ("portal:room|corridor", door, DVec3::X),
        ("portal:room|corridor", [d, c, b, a], DVec3::X),
    ] {
        let all = [quads.as_slice(), &[(name, outline)]].concat();
        let (interior, warnings) =
            interior_from_nodes(&nodes_of_quads(&all), "m.glb", 1.0).unwrap();
        assert_eq!(warnings, []);
        let normal = interior.portals[0].polygon.normal();
        assert!((normal - into_first).length() < 1e-12, "{name}: {normal}");
    }
}

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
            // At eye height over the floor of the viewer's cell; outside, over the portal's foot.
            let floor = if view.from.is_some() { 0.0 } else { 1.0 };
            assert!((eye.y - floor - 1.6).abs() < 1e-9);
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
    let (interior, warnings) = read_rooms(&path, "house.glb", 1.0).unwrap();
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

proptest! {
    #[test]
    fn broken_files_are_errors_and_no_panics(
        changes in prop::collection::vec((0_usize..2000, prop::sample::select(b"0-9e[]{},:\"na.".to_vec())), 1..4),
    ) {
        for text in [TWO_ROOMS.to_owned(), with("", TWO_PORTALS)] {
            let mut bytes = text.into_bytes();
            for (at, byte) in &changes {
                let at = at % bytes.len();
                bytes[at] = *byte;
            }
            if let Ok((interior, _)) = parse_rooms(Path::new("r.json"), &bytes, "m.glb") {
                prop_assert!(interior.check().is_ok());
                let (contents, _) = Contents::new(&interior, &Model::default()).unwrap();
                let views = semicircles(&interior, &contents, &SemicircleOptions::default());
                prop_assert!(views.iter().all(|v| v.camera_from_world.is_finite()));
            }
            if let Err(error) = parse_interior(Path::new("i.json"), &bytes) {
                prop_assert!(error.to_string().starts_with("i.json: "));
            }
        }
    }

    #[test]
    fn anything_that_is_read_is_written_and_read_the_same(
        x in -1e7..1e7, y in 0.1..1e3, tilt in -1.0..1.0, eye in 1e-3..1e3,
    ) {
        let text = with("", &format!(
            r#"{{"name": "p", "cells": ["a", null],
                "polygon": [[{x}, 0, 0], [{x}, {y}, {tilt}], [{x}, {y}, 5], [{x}, 0, 5]]}}"#
        )).replace("1.6", &format!("{eye}"));
        let (interior, _) = parse_interior(Path::new("i.json"), text.as_bytes()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("i.json");
        write_interior(&path, &interior).unwrap();
        prop_assert_eq!(proxy::interior::read_interior(&path).unwrap().0, interior);
    }
}
