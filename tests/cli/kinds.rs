//! Captures, scenes and interiors are folders: what to do with another one than is expected.

use crate::interior::ROOMS;
use crate::run::{files, lumigraph, with_wall};

#[test]
fn captures_scenes_and_interiors_are_not_taken_for_each_other() {
    let folder = with_wall();
    let here = folder.path();
    let house = "generate house --rooms 2 --triangles 1 -o house";
    lumigraph(here, house).ok();
    lumigraph(here, "import wall -o scene").ok();
    std::fs::write(here.join("rooms.json"), ROOMS).unwrap();
    lumigraph(here, "interior house/house.glb --find -o found").ok();
    let before = files(here);
    let failed = |line: &str, said: &[&str]| {
        let error = lumigraph(here, line).error(1);
        assert!(said.iter().all(|s| error.contains(s)), "{line}: {error}");
    };
    // 1. Other things for an interior.
    let makes = "`lumigraph interior CAPTURE_OR_GLB -o DIR` makes one";
    for command in ["plan", "ldis", "walk -o out"] {
        for given in ["wall", "scene"] {
            let line = format!("{command} {given}");
            let none = format!("{given}: no interior, as it holds no interior.json");
            failed(&line, &[none.as_str(), makes]);
        }
        for given in ["house/house.glb", "rooms.json"] {
            let line = format!("{command} {given}");
            let none = format!("{given}: not an interior");
            failed(&line, &[none.as_str(), makes]);
        }
        failed(&format!("{command} nowhere"), &["check the path"]);
    }
    // 2. An interior for photos: as it was generated, with a plan that is a picture, and its file.
    for given in ["house", "found", "found/interior.json"] {
        let told = format!("{given}: this is an interior");
        let walk = format!("`lumigraph walk {given} -o FRAMES` is for it");
        for line in [
            format!("info {given}"),
            format!("render {given} --path orbit -o out"),
            format!("evaluate {given}"),
            format!("interior {given} -o out"),
            format!("import {given} -o out"),
        ] {
            failed(&line, &[told.as_str(), walk.as_str()]);
        }
    }
    // 3. A scene for a capture.
    failed(
        "import scene -o out",
        &["scene: a scene already (scene.json)"],
    );
    assert!(files(here) == before);
}
