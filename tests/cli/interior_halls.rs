//! A house of hallways: parts without a door, and a world upside down.

use crate::interior::HALVES;
use crate::run::{lumigraph, with_generated};
use glam::{DQuat, DVec3};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// A hallway as a capture, its world turned and moved; `copies` of it, 40 m apart.
fn hallways(here: &Path, from: &str, to: &str, world: DQuat, copies: u32) {
    let read = |file: &str| here.join(from).join(file);
    let model = calibrate::colmap::read_model(&read("sparse/0")).unwrap();
    let mut whole = calibrate::Reconstruction {
        images: BTreeMap::new(),
        points: BTreeMap::new(),
        ..model.clone()
    };
    for folder in ["images", "depth", "sparse/0"] {
        std::fs::create_dir_all(here.join(to).join(folder)).unwrap();
    }
    for copy in 0..copies {
        let there = DVec3::new(40.0 * f64::from(copy), 3.0, 0.0);
        for image in model.images.values() {
            let mut image = image.clone();
            let name = format!("{copy}_{}", image.name);
            std::fs::copy(
                read("images").join(&image.name),
                here.join(to).join("images").join(&name),
            )
            .unwrap();
            let stem = |name: &str| Path::new(name).with_extension("png");
            std::fs::copy(
                read("depth").join(stem(&image.name)),
                here.join(to).join("depth").join(stem(&name)),
            )
            .unwrap();
            image.name = name;
            image.keypoints.clear();
            let pose = &mut image.camera_from_world;
            let rotation = pose.rotation * world.conjugate();
            pose.translation -= rotation * (world * there);
            pose.rotation = rotation;
            let id = calibrate::ImageId(whole.images.len() as u32 + 1);
            whole.images.insert(id, image);
        }
    }
    calibrate::colmap::write_binary(&whole, &here.join(to).join("sparse/0")).unwrap();
}

#[test]
fn one_room_parts_without_a_door_and_a_world_upside_down_are_toured() {
    let folder = with_generated("hallway --size 96x72 -o hall");
    let here = folder.path();
    // 1. One room.
    let ran = lumigraph(here, "interior hall -o one").ok();
    assert!(
        ran.stdout.contains("one: 1 cells, 0 portals"),
        "{}",
        ran.stdout
    );
    let walk = "--tour --frames 2 --size 32x24 --portals ldi";
    let ran = lumigraph(here, &format!("walk one {walk} -o walk-one")).ok();
    assert!(!ran.stderr.contains("leaves them out"), "{}", ran.stderr);
    // 2. The same, the world turned: the same room, whichever way up is.
    let turned = DQuat::from_euler(glam::EulerRot::XYZ, 2.1, -0.4, 0.9);
    hallways(here, "hall", "turned", turned, 1);
    let ran = lumigraph(here, "interior turned -o other").ok();
    assert!(
        ran.stdout.contains("other: 1 cells, 0 portals"),
        "{}",
        ran.stdout
    );
    let up = |folder: &str| -> DVec3 {
        let file = std::fs::read(here.join(folder).join("interior.json")).unwrap();
        let file: Value = serde_json::from_slice(&file).unwrap();
        let up = file["up"].as_array().unwrap();
        DVec3::from_array([0, 1, 2].map(|k| up[k].as_f64().unwrap()))
    };
    assert!((turned * up("one")).dot(up("other")) > 0.999);
    lumigraph(here, &format!("walk other {walk} -o walk-other")).ok();
    // 3. Two parts that nothing joins: the tour is in the first, and says so.
    hallways(here, "hall", "apart", DQuat::IDENTITY, 2);
    let ran = lumigraph(here, "interior apart -o two").ok();
    assert!(
        ran.stdout.contains("two: 2 cells, 0 portals"),
        "{}",
        ran.stdout
    );
    let ran = lumigraph(here, &format!("walk two {walk} -o walk-two")).ok();
    let said = "no opening leads to room 2; the tour leaves them out";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
    // 4. Known rooms, to compare with.
    std::fs::write(here.join("halves.json"), HALVES).unwrap();
    let ran = lumigraph(here, "interior hall --compare halves.json -o again").ok();
    assert!(
        ran.stdout.contains("1 of 2 rooms, 0 of 1 portals found"),
        "{}",
        ran.stdout
    );
}
