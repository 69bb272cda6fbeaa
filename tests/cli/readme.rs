//! What README.md gives to copy.

use proxy::interior::{parse_interior, parse_rooms};
use std::path::Path;

#[test]
fn examples_of_interiors_and_rooms_have_nothing_odd() {
    let text = include_str!("../../README.md");
    let blocks = text.split("```json\n").skip(1);
    let blocks = blocks.map(|rest| rest.split("```").next().unwrap_or_default());
    let (mut interiors, mut rooms) = (0, 0);
    for block in blocks {
        let bytes = block.as_bytes();
        let read = if block.contains("\"portals\": [") {
            interiors += 1;
            parse_interior(Path::new("interior.json"), bytes)
        } else if block.contains("\"openings\": [") {
            rooms += 1;
            parse_rooms(Path::new("rooms.json"), bytes, "house.glb")
        } else {
            continue;
        };
        let (_, warnings) = read.unwrap();
        assert!(warnings.is_empty(), "{warnings:?}: {block}");
    }
    assert_eq!((interiors, rooms), (1, 1));
}
