//! Interiors of captures of which a part is damaged.

use crate::interior::HALVES;
use crate::run::{Ran, lumigraph, with_generated, with_wall};
use std::fs;
use std::path::Path;

const ROOMS: &str = r#"{"version": 1,
    "rooms": [{"name": "all", "min": [-99, -99, -99], "max": [99, 99, 99]}]}"#;

/// Cuts a picture's end off, of which its header tells nothing.
fn damage(picture: &Path) {
    let whole = fs::read(picture).unwrap();
    fs::write(picture, &whole[..whole.len() * 2 / 3]).unwrap();
}

/// Makes an interior of the one room.
fn interior(here: &Path, given: &str, out: &str) -> Ran {
    fs::write(here.join("rooms.json"), ROOMS).unwrap();
    lumigraph(
        here,
        &format!("interior {given} --rooms rooms.json -o {out}"),
    )
}

#[test]
fn photos_and_depth_maps_that_are_damaged_are_left_out_of_an_interior() {
    let folder = with_wall();
    let here = folder.path();
    let at = |kind: &str, i: u32| here.join(format!("wall/{kind}/{i:04}.png"));
    let told = |ran: &Ran| -> Vec<String> {
        let lines = ran.stderr.lines().filter(|line| line.contains("left out"));
        lines.map(str::to_owned).collect()
    };
    let whole = interior(here, "wall", "whole").ok();
    assert!(told(&whole).is_empty(), "{}", whole.stderr);
    // 1. One photo: its depth map counts, so the surface is the same.
    damage(&at("images", 4));
    let ran = interior(here, "wall", "photo").ok();
    let said = "warning: photo 0004.png is left out: cannot decode wall/images/0004.png: ";
    let lines = told(&ran);
    assert!(
        lines.len() == 1 && lines[0].starts_with(said),
        "{}",
        ran.stderr
    );
    assert_eq!(ran.stdout.replace("photo: ", "whole: "), whole.stdout);
    let read = |out: &str, file: &str| fs::read(here.join(out).join(file)).unwrap();
    assert!(read("whole", "interior.json") == read("photo", "interior.json"));
    // 2. A depth map as well.
    damage(&at("depth", 2));
    let ran = interior(here, "wall", "both").ok();
    let said =
        "note: the depth map of photo 0002.png is left out: cannot decode wall/depth/0002.png: ";
    let lines = told(&ran);
    assert!(
        lines.len() == 2 && lines[1].starts_with(said),
        "{}",
        ran.stderr
    );
    let said = "8 depth maps fused and coloured";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
    // 3. All depth maps.
    for i in [0, 1, 3, 4, 5, 6, 7, 8] {
        damage(&at("depth", i));
    }
    let error = interior(here, "wall", "none").error(1);
    let said = "; left out: the depth map of photo 0000.png: cannot decode wall/depth/0000.png: ";
    assert!(
        error.contains(said) && error.ends_with("; and 8 more"),
        "{error}"
    );
    assert!(!here.join("none").exists());
}

#[test]
fn one_photo_alone_colours_no_interior() {
    let folder = with_wall();
    let here = folder.path();
    for i in 0..8 {
        damage(&here.join(format!("wall/images/{i:04}.png")));
    }
    let error = interior(here, "wall", "none").error(1);
    let said = "wall: photo 0000.png: cannot decode wall/images/0000.png: ";
    assert!(
        error.starts_with(said) && error.ends_with("; and 7 more"),
        "{error}"
    );
    assert!(!here.join("none").exists());
}

#[test]
fn a_damaged_photo_is_left_out_where_the_mesh_is_the_scenes_own() {
    let folder = with_wall();
    let here = folder.path();
    fs::remove_dir_all(here.join("wall/depth")).unwrap();
    lumigraph(here, "import wall -o scene").ok();
    lumigraph(here, "proxy scene carved").ok();
    damage(&here.join("wall/images/0004.png"));
    let ran = interior(here, "scene", "own").ok();
    let said = "warning: photo 0004.png is left out: cannot decode ";
    assert_eq!(ran.stderr.matches(said).count(), 1, "{}", ran.stderr);
    let said = "the scene's own mesh, coloured";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
}

/// LDIs of views take far longer.
#[test]
fn that_no_depth_map_can_be_used_is_told_before_any_frame_is_drawn() {
    let folder = with_generated("hallway --size 96x72 -o hall");
    let here = folder.path();
    fs::write(here.join("halves.json"), HALVES).unwrap();
    lumigraph(here, "interior hall --rooms halves.json -o two").ok();
    for entry in fs::read_dir(here.join("hall/depth")).unwrap() {
        damage(&entry.unwrap().path());
    }
    let walk = "walk two --tour --frames 1 --size 48x32 --reference-size 16x16 \
                --reference-views 3 --portals ldi -o walk --resume";
    let said = "note: LDIs are made of views: the depth maps cannot be used: cannot decode ";
    // The second time there is none to draw.
    for from_before in [false, true] {
        let ran = lumigraph(here, walk).ok();
        assert_eq!(ran.stderr.matches(said).count(), 1, "{}", ran.stderr);
        let is_from_before = ran.stdout.contains("1 of them from before");
        assert_eq!(is_from_before, from_before, "{}", ran.stdout);
    }
}
