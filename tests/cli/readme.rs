//! What README.md gives to copy, and whether it explains what is printed.

use crate::interior::with_house;
use crate::run::{lumigraph, with_wall};
use proxy::interior::{parse_interior, parse_rooms};
use serde_json::Value;
use std::path::Path;

const README: &str = include_str!("../../README.md");

#[test]
fn examples_of_interiors_and_rooms_have_nothing_odd() {
    let blocks = README.split("```json\n").skip(1);
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

#[test]
fn reports_have_no_key_that_is_not_explained() {
    let unknown = |objects: &[&Value]| {
        let keys = objects.iter().flat_map(|o| o.as_object().unwrap().keys());
        let unknown = keys.filter(|key| !README.contains(&format!("`{key}`")));
        unknown.cloned().collect::<Vec<String>>()
    };
    let folder = with_wall();
    let line = "render wall --proxy plane --path sweep --frames 1 --size 24x18 --max-error 1 --json \
                -o out";
    let render = lumigraph(folder.path(), line).ok().json();
    let (frame, report) = (&render["frames"][0], &render["report"]);
    let all = [
        &render,
        frame,
        &frame["cost"],
        report,
        &report["stages"],
        &report["skipped"],
        &report["cpu_memory"],
        &report["max_error"],
    ];
    assert_eq!(unknown(&all), [""; 0]);

    let folder = with_house();
    let line = "walk house --frames 1 --size 16x12 --portals geometry,ldi --reference-size 8x8 \
                --json -o out";
    let walk = lumigraph(folder.path(), line).ok().json();
    let (kind, report) = (&walk["walks"][0], &walk["report"]);
    let all = [
        &walk,
        kind,
        &kind["frames"][0],
        report,
        &report["references_memory"],
    ];
    assert_eq!(unknown(&all), [""; 0]);
}
