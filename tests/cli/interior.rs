//! Interiors: a house is generated, made an interior of anew, and planned.

use crate::run::{files, folder_with, lumigraph};
use glam::DVec3;
use proxy::interior::read_interior;
use proxy::mesh::{Mesh, model_to_glb, read_model};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use tempfile::TempDir;

/// A folder with a small house.
pub(crate) fn with_house() -> TempDir {
    folder_with("a small house", |folder| {
        let line = "generate house --rooms 2 --triangles 1 -o house";
        let ran = lumigraph(folder, line).ok();
        assert!(ran.stdout.starts_with("house: 2 cells, "), "{}", ran.stdout);
    })
}

pub(crate) fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let names = entries.map(|e| e.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.collect();
    names.sort();
    names
}

#[test]
fn a_house_is_generated_and_planned() {
    let folder = with_house();
    let here = folder.path();
    // Again, byte for byte, on one thread.
    let again = "--threads 1 generate house --rooms 2 --triangles 1 -o again";
    lumigraph(here, again).ok();
    for file in ["house.glb", "interior.json"] {
        let read = |folder: &str| std::fs::read(here.join(folder).join(file)).unwrap();
        assert!(read("house") == read("again"), "{file}");
    }
    // Another is another.
    let other = "generate house --rooms 2 --triangles 1 --seed 2 -o other";
    lumigraph(here, other).ok();
    let read = |folder: &str| std::fs::read(here.join(folder).join("interior.json")).unwrap();
    assert!(read("house") != read("other"));
    // Where to photograph it from.
    let file: Value = serde_json::from_slice(&read("house")).unwrap();
    let portals = file["portals"].as_array().unwrap().len();
    assert!((3..=5).contains(&portals), "{portals}");
    let ran = lumigraph(here, "plan house --json").ok();
    let poses: Vec<Value> = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!(poses.len(), portals * 2 * 13);
    for pose in &poses {
        let numbers = |key: &str| -> Vec<f64> {
            let list = pose[key].as_array().unwrap();
            list.iter().map(|x| x.as_f64().unwrap()).collect()
        };
        let (matrix, center) = (numbers("camera_from_world"), numbers("center"));
        assert_eq!(matrix[12..], [0.0, 0.0, 0.0, 1.0]);
        for row in 0..3 {
            let at: f64 = (0..3).map(|k| matrix[4 * row + k] * center[k]).sum();
            assert!((at + matrix[4 * row + 3]).abs() < 1e-9);
        }
        assert!((center[1] - 1.6).abs() < 1e-9);
    }
    let ran = lumigraph(here, "plan house --views 1 --span 90").ok();
    let note = "note: --span changes nothing: a single camera stands in the middle";
    assert!(ran.stderr.contains(note), "{}", ran.stderr);
    let ran = lumigraph(here, "plan house/interior.json --views 3 --span 90").ok();
    assert_eq!(ran.stdout.lines().count(), 1 + portals * 2 * 3);
    assert!(ran.stdout.contains("-45.0°"), "{}", ran.stdout);
}

pub(crate) const ROOMS: &str = r#"{"version": 1,
    "rooms": [{"name": "all", "min": [-1, -1, -1], "max": [60, 5, 60]}]}"#;

#[test]
fn an_interior_is_made_of_a_model() {
    let folder = with_house();
    let here = folder.path();
    std::fs::write(here.join("rooms.json"), ROOMS).unwrap();
    let line = "interior house/house.glb --rooms rooms.json -o one";
    // The second time it takes the first one's place, where it is told to.
    for more in ["", " --force"] {
        let ran = lumigraph(here, &format!("{line}{more}")).ok();
        assert_eq!(ran.stderr, "");
        let said = "one: 1 cells, 0 portals, ";
        assert!(ran.stdout.contains(said), "{}", ran.stdout);
    }
    assert_eq!(names(&here.join("one")), ["house.glb", "interior.json"]);
    assert_eq!(lumigraph(here, "plan one --json").stdout, "[]\n");
    // What is there and no interior stays.
    std::fs::create_dir(here.join("mine")).unwrap();
    std::fs::write(here.join("mine/thesis.txt"), "…").unwrap();
    let failed = |line: &str, said: &str| {
        let error = lumigraph(here, line).error(1);
        assert!(error.contains(said), "{error}");
    };
    let mine = "interior house/house.glb --rooms rooms.json -o mine";
    for more in ["", " --force"] {
        failed(&format!("{mine}{more}"), "mine: the folder is not empty");
    }
    // What is wrong is said, and nothing is left behind.
    for (rooms, said) in [
        ("{", "rooms.json: not a list of rooms"),
        (
            r#"{"version": 1, "rooms": []}"#,
            "rooms.json: there are no cells",
        ),
    ] {
        std::fs::write(here.join("rooms.json"), rooms).unwrap();
        failed("interior house/house.glb --rooms rooms.json -o two", said);
    }
    let lost = "interior house/house.glb --meter 1000 -o two";
    failed(lost, "house/house.glb: no rooms");
    std::fs::write(here.join("empty.glb"), "").unwrap();
    failed("interior empty.glb -o two", "empty.glb: not a glTF file");
    let left = ["empty.glb", "house", "mine", "one", "rooms.json"];
    assert_eq!(names(here), left);
    failed("plan nowhere", "nowhere: there is no such");
    failed("interior nope.glb -o two", "nope.glb: there is no such");
    failed("interior nope -o two", "nope: there is no such");
}

#[test]
fn files_that_tell_of_rooms_are_read_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    // No model and no photos, which would be said later.
    std::fs::write(here.join("empty.glb"), "").unwrap();
    std::fs::create_dir(here.join("hall")).unwrap();
    std::fs::write(here.join("bad.json"), "{").unwrap();
    for given in ["empty.glb", "hall"] {
        for (option, expected) in [
            ("--rooms", "expected a file of rooms and openings"),
            ("--compare", "or an interior's folder"),
        ] {
            let line = |file: &str| format!("interior {given} {option} {file} -o two");
            let ran = lumigraph(here, &line("nosuch.json"));
            assert_eq!(ran.code, 2, "{}", ran.stderr);
            let said = format!("{option} nosuch.json: there is no such file; ");
            let is_said = ran.stderr.contains(&said) && ran.stderr.contains(expected);
            assert!(is_said, "{}", ran.stderr);
            let error = lumigraph(here, &line("bad.json")).error(1);
            assert!(
                error.starts_with("bad.json: not a list of rooms"),
                "{error}"
            );
        }
        let line = format!("interior {given} --compare hall -o two");
        let error = lumigraph(here, &line).error(1);
        assert!(error.starts_with("--compare: hall: no interior"), "{error}");
    }
    assert_eq!(names(here), ["bad.json", "empty.glb", "hall"]);
}

#[test]
fn that_rooms_are_to_be_found_is_said_to_change_nothing_where_they_are_anyway() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    std::fs::write(here.join("empty.glb"), "").unwrap();
    std::fs::create_dir(here.join("hall")).unwrap();
    for (given, why) in [
        ("hall --find", Some("photos have no nodes that name rooms")),
        (
            "empty.glb --find --up 0,1,0",
            Some("with --up rooms are found anyway"),
        ),
        ("empty.glb --find", None),
        ("empty.glb --up 0,1,0", None),
        ("hall", None),
    ] {
        let ran = lumigraph(here, &format!("interior {given} -o two"));
        let notes = ran.stderr.lines().filter(|line| line.contains("nothing: "));
        let notes: Vec<&str> = notes.collect();
        let why = why.map(|why| format!("note: --find changes nothing: {why}"));
        assert_eq!(notes, Vec::from_iter(why), "{given}: {}", ran.stderr);
    }
}

#[test]
fn rooms_that_nobody_names_are_found() {
    let folder = with_house();
    let here = folder.path();
    let line = "interior house/house.glb -o found";
    // The second time it takes the first one's place, where it is told to, byte for byte.
    let ran = lumigraph(here, line).ok();
    let first = std::fs::read(here.join("found/interior.json")).unwrap();
    assert!(ran.stdout.contains("found: 2 cells, "), "{}", ran.stdout);
    assert!(
        ran.stderr.contains("found/floor-plan.svg"),
        "{}",
        ran.stderr
    );
    lumigraph(here, &format!("--threads 1 {line} --force")).ok();
    assert!(std::fs::read(here.join("found/interior.json")).unwrap() == first);
    let files = [
        "floor-plan.png",
        "floor-plan.svg",
        "house.glb",
        "interior.json",
    ];
    assert_eq!(names(&here.join("found")), files);
    // It can be walked through at once.
    let walk = "walk found --tour --frames 2 --size 32x24 -o out";
    lumigraph(here, walk).ok();
}

#[test]
fn an_interior_corrected_by_hand_is_replaced_by_force_alone() {
    let folder = with_house();
    let here = folder.path();
    std::fs::write(here.join("rooms.json"), ROOMS).unwrap();
    let line = "interior house/house.glb --rooms rooms.json -o one";
    let replace = || {
        let error = lumigraph(here, line).error(1);
        assert!(error.contains("one: holds an interior"), "{error}");
        assert!(error.contains("--force"), "{error}");
    };
    lumigraph(here, line).ok();
    let file = here.join("one/interior.json");
    let mut text = std::fs::read_to_string(&file).unwrap();
    text.push('\n');
    std::fs::write(&file, &text).unwrap();
    let before = files(&here.join("one"));
    replace();
    assert!(files(&here.join("one")) == before);
    lumigraph(here, &format!("{line} --force")).ok();
    assert!(files(&here.join("one")) != before);
    // Whatever is in a file of that name.
    std::fs::remove_dir_all(here.join("one")).unwrap();
    std::fs::create_dir(here.join("one")).unwrap();
    std::fs::write(&file, "{").unwrap();
    replace();
    assert_eq!(names(&here.join("one")), ["interior.json"]);
}

#[test]
fn openings_that_nodes_name_are_no_walls() {
    let folder = with_house();
    let here = folder.path();
    // 1. The house, with a mesh in every doorway and window.
    let (interior, _) = read_interior(&here.join("house/interior.json")).unwrap();
    let (mut model, _) = read_model(&here.join("house/house.glb")).unwrap();
    for portal in &interior.portals {
        let positions = portal.polygon.corners().to_vec();
        let fan = 1..positions.len() as u32 - 1;
        let opening = Mesh {
            triangles: fan.map(|i| [0, i, i + 1]).collect(),
            positions,
        };
        model.append(&opening, &format!("portal:{}", portal.name));
    }
    std::fs::write(here.join("named.glb"), model_to_glb(&model).unwrap()).unwrap();
    // 2. Rooms and doors are found as without.
    lumigraph(here, "interior house/house.glb --find -o plain").ok();
    lumigraph(here, "interior named.glb --find -o named").ok();
    let plain = corners(&here.join("plain"));
    let named = corners(&here.join("named"));
    assert!(!plain[1].is_empty());
    for (plain, named) in plain.iter().zip(&named) {
        assert_eq!(plain.len(), named.len());
        for one in plain {
            assert!(named.iter().any(|other| apart(one, other) < 0.1));
        }
    }
    // 3. No cell shows them.
    std::fs::write(here.join("rooms.json"), ROOMS).unwrap();
    let triangles = |model: &str| {
        let line = format!("interior {model} --rooms rooms.json -o all --force");
        let said = lumigraph(here, &line).ok().stdout;
        said.lines().next().unwrap().to_owned()
    };
    assert_eq!(triangles("named.glb"), triangles("house/house.glb"));
}

#[test]
fn a_metre_says_how_high_eyes_are_where_nodes_name_the_rooms() {
    let folder = with_house();
    let here = folder.path();
    let (interior, _) = read_interior(&here.join("house/interior.json")).unwrap();
    let (mut model, _) = read_model(&here.join("house/house.glb")).unwrap();
    for node in &mut model.nodes {
        if interior.cells.iter().any(|cell| cell.name == node.name) {
            node.name.insert_str(0, "cell:");
        }
    }
    std::fs::write(here.join("cells.glb"), model_to_glb(&model).unwrap()).unwrap();
    for (more, eye_height) in [("", 1.6), (" --meter 100", 160.0)] {
        let line = format!("interior cells.glb -o made --force{more}");
        let ran = lumigraph(here, &line).ok();
        assert!(ran.stdout.contains("made: 2 cells, "), "{}", ran.stdout);
        let (made, _) = read_interior(&here.join("made/interior.json")).unwrap();
        assert_eq!(made.eye_height, eye_height);
    }
    // Which way is up they do not say: with that they are found, which is told where nobody asked for it.
    let note = "note: with --up rooms are found; those that the model's nodes name are not taken";
    for (model, more, is_told) in [
        ("cells.glb", "", false),
        ("cells.glb", " --up 0,1,0", true),
        ("cells.glb", " --up 0,1,0 --find", false),
        ("house/house.glb", " --up 0,1,0", false),
    ] {
        let said = lumigraph(here, &format!("interior {model} -o made --force{more}"));
        let said = said.ok().stderr;
        assert_eq!(said.lines().any(|line| line == note), is_told, "{said}");
    }
}

/// How far a box's or a polygon's sides are from another's, at most.
pub(crate) fn apart(a: &[DVec3], b: &[DVec3]) -> f64 {
    let extent = |corners: &[DVec3]| {
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let grown = |(l, h): (DVec3, DVec3), p: &DVec3| (l.min(*p), h.max(*p));
        corners.iter().fold(none, grown)
    };
    let ((l, h), (m, i)) = (extent(a), extent(b));
    (l - m).abs().max((h - i).abs()).max_element()
}

/// The corners of an interior's cells, then those of its portals.
pub(crate) fn corners(folder: &Path) -> [Vec<Vec<DVec3>>; 2] {
    let (interior, _) = read_interior(&folder.join("interior.json")).unwrap();
    let cells = interior.cells.iter().map(|cell| {
        let room = cell.content.room().unwrap();
        vec![room.min, room.max]
    });
    let portals = interior.portals.iter();
    let portals = portals.map(|p| p.polygon.corners().to_vec());
    [cells.collect(), portals.collect()]
}

#[test]
fn found_rooms_are_drawn_as_the_whole_model_is_and_what_given_ones_hide_is_told() {
    let folder = with_house();
    let here = folder.path();
    let ran = lumigraph(here, "interior house/house.glb --find -o found").ok();
    assert!(!ran.stderr.contains("lines of sight"), "{}", ran.stderr);
    let walk =
        "walk found --frames 24 --size 96x72 --portals geometry,whole --device cpu -o walked";
    lumigraph(here, walk).ok();
    let [culled, whole] = ["geometry", "whole"].map(|mode| files(&here.join("walked").join(mode)));
    let pictures = |files: BTreeMap<_, _>| -> BTreeMap<_, _> {
        let is_png = |path: &std::path::PathBuf| path.extension().is_some_and(|e| e == "png");
        files.into_iter().filter(|(path, _)| is_png(path)).collect()
    };
    let (culled, whole) = (pictures(culled), pictures(whole));
    assert_eq!(culled.len(), 24);
    assert!(culled == whole);

    // Two halves of the house with an opening of a hand's breadth between them.
    let (interior, _) = read_interior(&here.join("house/interior.json")).unwrap();
    let portal = interior
        .portals
        .iter()
        .find(|p| p.cells.iter().all(Option::is_some));
    let center = portal.unwrap().polygon.center();
    let across = interior.up.cross(portal.unwrap().polygon.normal());
    let corner = |u: f64, v: f64| (center + 0.05 * (u * across + v * interior.up)).to_array();
    let rooms = interior.cells.iter().map(|cell| {
        let room = cell.content.room().unwrap();
        serde_json::json!({"name": cell.name, "min": room.min.to_array(), "max": room.max.to_array()})
    });
    let between: Vec<&str> = interior
        .cells
        .iter()
        .map(|cell| cell.name.as_str())
        .collect();
    let rooms = serde_json::json!({"version": 1, "up": interior.up.to_array(),
        "eye_height": interior.eye_height, "rooms": rooms.collect::<Vec<_>>(),
        "openings": [{"name": "slit", "between": between,
            "polygon": [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]}]});
    std::fs::write(here.join("rooms.json"), rooms.to_string()).unwrap();
    let ran = lumigraph(here, "interior house/house.glb --rooms rooms.json -o slit").ok();
    let said = "lines of sight meet what portals hide";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
}

pub(crate) const HALVES: &str = r#"{"version": 1, "rooms": [
    {"name": "front", "min": [-9, -9, -99], "max": [9, 9, -2]},
    {"name": "back", "min": [-9, -9, -2], "max": [9, 9, 99]}],
    "openings": [{"name": "across", "between": ["front", "back"], "radius": 0.5,
        "polygon": [[-1, 0, -2], [1, 0, -2], [1, 2.4, -2], [-1, 2.4, -2]]}]}"#;

#[test]
fn usage_errors_exit_with_2() {
    let folder = tempfile::tempdir().unwrap();
    for (line, said) in [
        (
            "interior house.ply -o x",
            "interiors are made of .glb models",
        ),
        (
            "interior house.gltf -o x",
            "house.gltf: interiors are made of .glb models, or of folders of photos; export the model as .glb",
        ),
        (
            "interior house.glb --hold-out split.json -o x",
            "--hold-out is for captures",
        ),
        (
            "interior house.glb --rooms rooms.json --up 0,1,0 -o x",
            "cannot be used with",
        ),
        (
            "walk house --held-out --persist -o x",
            "cannot be used with",
        ),
        ("plan house --views 4", "an odd number"),
        ("plan house --span 180", "less than 180"),
        (
            "walk house --portals none -o x",
            "geometry, texture, warp1, warp2, ldi, whole, or all",
        ),
        ("walk house --reference-views 4 -o x", "an odd number"),
        ("walk house --near NaN -o x", "--near"),
        (
            "walk house --tour --path a.json -o x",
            "cannot be used with",
        ),
        ("generate house --rooms 1 -o x", "2 to 64"),
        ("generate house --size 8x8 -o x", "no photos"),
        ("generate shelf --rooms 3 -o x", "belong to `house`"),
    ] {
        let ran = lumigraph(folder.path(), line);
        assert_eq!(ran.code, 2, "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains(said), "{line}: {}", ran.stderr);
    }
}
