//! How high eyes are over an interior's floors.

use crate::interior::with_house;
use crate::run::lumigraph;
use proxy::interior::read_interior;

#[test]
fn eyes_over_the_ceiling_are_told_and_no_smaller_semicircle_advised() {
    let folder = with_house();
    let here = folder.path();
    let file = here.join("house/interior.json");
    let text = std::fs::read_to_string(&file).unwrap();
    let of_metres = "\"eye_height\": 1.6";
    assert!(text.contains(of_metres), "{text}");
    let of_mm = text.replace(of_metres, "\"eye_height\": 1600");
    std::fs::write(&file, of_mm).unwrap();
    let said = lumigraph(here, "plan house").ok().stderr;
    assert!(said.contains("`eye_height` is 1600, and"), "{said}");
    let advised = "cameras stand outside their cell; correct `eye_height` in house/interior.json";
    assert!(said.contains(advised), "{said}");
    let said = lumigraph(here, "walk house --frames 2 --size 16x12 -o out").ok();
    let said = said.stderr;
    assert!(said.contains("`eye_height` is 1600, and"), "{said}");
    let empty = "2 of 2 frames show nothing: their eyes are in no cell; is the interior's \
                 `eye_height` right?";
    assert!(said.contains(empty), "{said}");
}

#[test]
fn a_metre_says_how_high_eyes_are_in_given_rooms_that_do_not_say() {
    let folder = with_house();
    let here = folder.path();
    for (file, eye_height, more, expected) in [
        ("plain.json", "", "", 1.6),
        ("plain.json", "", " --meter 1000", 1600.0),
        (
            "own.json",
            r#" "eye_height": 1500,"#,
            " --meter 1000",
            1500.0,
        ),
    ] {
        let rooms = format!(
            r#"{{"version": 1,{eye_height}
                "rooms": [{{"name": "all", "min": [0, 0, 0], "max": [9000, 2600, 9000]}}]}}"#
        );
        std::fs::write(here.join(file), rooms).unwrap();
        let line = format!("interior house/house.glb --rooms {file} -o made --force{more}");
        let said = lumigraph(here, &line).ok().stderr;
        let (made, _) = read_interior(&here.join("made/interior.json")).unwrap();
        assert_eq!(made.eye_height, expected);
        // In millimetres eyes in metres are on the floor.
        let is_told = said.contains("`eye_height` is 1.6, and");
        assert_eq!(is_told, expected < 2.0, "{said}");
    }
}
