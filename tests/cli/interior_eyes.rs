//! How high eyes are over an interior's floors.

use crate::interior::with_house;
use crate::run::lumigraph;
use glam::DVec3;
use proxy::interior::read_interior;
use proxy::mesh::{Mesh, Model, model_to_glb};

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
        let idle =
            "note: --meter changes nothing: own.json says how high eyes are (\"eye_height\")";
        let is_idle = said.lines().any(|line| line == idle);
        assert_eq!(is_idle, file == "own.json", "{said}");
    }
}

#[test]
fn where_cameras_stand_is_told_to_a_thousandth_of_the_eyes_height() {
    let folder = tempfile::tempdir().unwrap();
    for (unit, expected) in [
        (1.0, ["2.500", "1.600", "1.500"]),
        (0.001, ["0.002500", "0.001600", "0.001500"]),
        (1000.0, ["2500", "1600", "1500"]),
    ] {
        let [eye, width, high, long] = [1.6, 1.0, 2.0, 4.0].map(|x| x * unit);
        let [far, top, deep] = [8.0, 2.5, 3.0].map(|x| x * unit);
        let text = format!(
            r#"{{"version": 1, "model": "house.glb", "up": [0, 1, 0], "eye_height": {eye},
                "cells": [
                    {{"name": "hall", "box": {{"min": [0, 0, 0], "max": [{long}, {top}, {deep}]}}}},
                    {{"name": "study", "box": {{"min": [{long}, 0, 0], "max": [{far}, {top}, {deep}]}}}}],
                "portals": [
                    {{"name": "door", "cells": ["hall", "study"], "polygon": [[{long}, 0, {width}],
                        [{long}, 0, {high}], [{long}, {high}, {high}], [{long}, {high}, {width}]]}}]}}"#
        );
        std::fs::write(folder.path().join("interior.json"), text).unwrap();
        let told = lumigraph(folder.path(), "plan interior.json --views 3")
            .ok()
            .stdout;
        let mut places = told.lines().map(|line| {
            let words: Vec<&str> = line.split_whitespace().collect();
            words[words.len() - 3..].to_vec()
        });
        assert!(places.any(|place| place == expected), "{told}");
    }
}

#[test]
fn a_box_that_is_too_low_for_eyes_is_named_and_no_smaller_semicircle_advised() {
    let folder = tempfile::tempdir().unwrap();
    let said = |top: f64, radius: f64| {
        let text = format!(
            r#"{{"version": 1, "model": "house.glb", "up": [0, 1, 0], "eye_height": 1.6,
                "cells": [
                    {{"name": "hall", "box": {{"min": [0, 0, 0], "max": [4, {top}, 3]}}}},
                    {{"name": "study", "box": {{"min": [4, 0, 0], "max": [8, 2.5, 3]}}}}],
                "portals": [
                    {{"name": "door", "cells": ["hall", "study"], "radius": {radius},
                        "polygon": [[4, 0, 1], [4, 0, 2], [4, 2, 2], [4, 2, 1]]}}]}}"#
        );
        std::fs::write(folder.path().join("interior.json"), text).unwrap();
        lumigraph(folder.path(), "plan interior.json").ok().stderr
    };
    assert_eq!(said(2.5, 1.5), "");
    let low = "correct the `box` of `hall` (eyes are above or below)";
    let told = said(1.0, 1.5);
    let advised = format!("13 of 26 cameras stand outside their cell; {low} in interior.json");
    assert!(told.contains(&advised), "{told}");
    let told = said(1.0, 9.0);
    let advised = format!(
        "26 of 26 cameras stand outside their cell; {low}, and give portals a smaller \
         `radius` in interior.json"
    );
    assert!(told.contains(&advised), "{told}");
}

#[test]
fn before_a_gallery_cameras_are_over_the_floor_of_the_hall_as_the_model_tells() {
    let folder = tempfile::tempdir().unwrap();
    let text = r#"{"version": 1, "model": "house.glb", "up": [0, 1, 0], "eye_height": 1.6,
        "cells": [
            {"name": "hall", "box": {"min": [0, 0, 0], "max": [6, 5, 4]}},
            {"name": "gallery", "box": {"min": [6, 2.5, 0], "max": [10, 5, 4]}}],
        "portals": [{"name": "rail", "cells": ["hall", "gallery"], "radius": 2.5,
            "polygon": [[6, 2.5, 0.5], [6, 2.5, 3.5], [6, 4.5, 3.5], [6, 4.5, 0.5]]}]}"#;
    std::fs::write(folder.path().join("interior.json"), text).unwrap();
    let heights = || -> Vec<String> {
        let told = lumigraph(folder.path(), "plan interior.json --views 1").ok();
        let lines = told.stdout.lines().skip(1);
        let height = |line: &str| line.split_whitespace().rev().nth(1).unwrap().to_owned();
        lines.map(height).collect()
    };
    // Without the model there might be stairs in the hall.
    assert_eq!(heights(), ["4.100", "4.100"]);
    let corners = [[0.0, 0.0], [6.0, 0.0], [6.0, 4.0], [0.0, 4.0]];
    let floor = Mesh {
        positions: corners.map(|[x, z]| DVec3::new(x, 0.0, z)).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    };
    let mut model = Model::default();
    model.append(&floor, "floor");
    let file = folder.path().join("house.glb");
    std::fs::write(file, model_to_glb(&model).unwrap()).unwrap();
    assert_eq!(heights(), ["1.600", "4.100"]);
}

#[test]
fn a_portal_that_is_turned_round_is_to_be_reversed_and_no_smaller_semicircle_advised() {
    let folder = tempfile::tempdir().unwrap();
    let said = |door: &str, gap: &str| {
        let text = format!(
            r#"{{"version": 1, "model": "house.glb", "up": [0, 1, 0], "eye_height": 1.6,
                "cells": [
                    {{"name": "hall", "box": {{"min": [0, 0, 0], "max": [4, 2.5, 3]}}}},
                    {{"name": "study", "box": {{"min": [4, 0, 0], "max": [8, 2.5, 3]}}}}],
                "portals": [
                    {{"name": "door", "polygon": [{door}], "cells": ["hall", "study"]}}{gap}]}}"#
        );
        std::fs::write(folder.path().join("interior.json"), text).unwrap();
        lumigraph(folder.path(), "plan interior.json").ok().stderr
    };
    let door = "[4, 0, 1], [4, 0, 2], [4, 2, 2], [4, 2, 1]";
    let turned = "[4, 0, 2], [4, 0, 1], [4, 2, 1], [4, 2, 2]";
    let gap = format!(
        r#", {{"name": "gap", "polygon": [{door}], "cells": ["hall", "study"], "radius": 9}}"#
    );
    assert_eq!(said(door, ""), "");
    for (door, gap, advised) in [
        (
            turned,
            "",
            "26 of 26 cameras stand outside their cell; reverse the `polygon` of `door` in",
        ),
        (
            door,
            gap.as_str(),
            "26 of 52 cameras stand outside their cell; give portals a smaller `radius` in",
        ),
        (
            turned,
            gap.as_str(),
            "52 of 52 cameras stand outside their cell; reverse the `polygon` of `door`, and give \
             other portals a smaller `radius` in",
        ),
    ] {
        let said = said(door, gap);
        assert!(said.contains(advised), "{said}");
        let is_told = said.contains("portal `door` seems to be turned round");
        assert_eq!(is_told, door == turned, "{said}");
    }
}
