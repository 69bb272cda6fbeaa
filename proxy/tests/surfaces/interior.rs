//! Interiors: files, and what is said of bad ones.

use glam::DVec3;
use proptest::prelude::*;
use proxy::interior::{
    CellId, Content, Contents, Interior, InteriorFileError, InteriorWarning, Polygon, RoomBox,
    SemicircleOptions, parse_interior, parse_rooms, semicircles, write_interior,
};
use proxy::mesh::Model;
use std::path::Path;

/// Two rooms side by side along x, a door and a window.
pub(crate) const TWO_ROOMS: &str = r#"{
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

pub(crate) fn two_rooms() -> Interior {
    let (interior, warnings) = rooms(TWO_ROOMS).unwrap();
    assert_eq!(warnings, []);
    interior
}

pub(crate) fn rooms(text: &str) -> Result<(Interior, Vec<InteriorWarning>), InteriorFileError> {
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
