//! What is odd of an interior is told.

use crate::interior::{TWO_ROOMS, rooms, two_rooms};
use crate::interior_nodes::{nodes_of_quads, wall};

use glam::DVec3;
use proxy::interior::{Contents, Interior, InteriorWarning, Polygon, interior_from_nodes};

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
fn a_cell_that_holds_photos_out_is_told() {
    let mut interior = two_rooms();
    interior.held_out = vec!["b.jpg".to_owned()];
    assert_eq!(interior.check().unwrap(), []);
    let names = serde_json::from_str(r#"["b.jpg"]"#).unwrap();
    interior.cells[1].other.insert("held_out".to_owned(), names);
    let warnings = interior.check().unwrap();
    assert_eq!(warnings, [InteriorWarning::HeldOut("east".to_owned())]);
    let said = "cell `east` has a `held_out`, which counts for the whole file alone";
    assert!(warnings[0].to_string().starts_with(said), "{}", warnings[0]);
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
