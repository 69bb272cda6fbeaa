//! How high eyes are over an interior's floors.

use crate::interior::with_house;
use crate::run::lumigraph;

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
