//! Interiors whose rooms are nodes of a model.

use crate::interior::with_house;
use crate::run::lumigraph;
use proxy::interior::{Content, Interior, Polygon, read_interior, write_interior};
use std::path::Path;
use tempfile::TempDir;

/// A folder with a small house, whose interior has its rooms by the model's nodes.
fn with_nodes() -> TempDir {
    let folder = with_house();
    change(folder.path(), |interior| {
        for cell in &mut interior.cells {
            cell.content = Content::Nodes(vec![cell.name.clone()]);
        }
    });
    folder
}

fn change(here: &Path, how: impl FnOnce(&mut Interior)) {
    let file = here.join("house/interior.json");
    let (mut interior, _) = read_interior(&file).unwrap();
    how(&mut interior);
    write_interior(&file, &interior).unwrap();
}

#[test]
fn cameras_are_planned_over_the_floors_of_rooms_that_are_nodes() {
    let folder = with_nodes();
    let here = folder.path();
    // An opening over a sill.
    change(here, |interior| {
        let portal = &mut interior.portals[0];
        let corners = portal.polygon.corners().iter();
        let corners = corners.map(|p| p.with_y(p.y.max(1.0))).collect();
        portal.polygon = Polygon::new(corners).unwrap();
    });
    let poses = lumigraph(here, "plan house --json").ok().json();
    let poses = poses.as_array().unwrap();
    assert!(poses.len() >= 3 * 2 * 13);
    for pose in poses {
        let height = pose["center"][1].as_f64().unwrap();
        assert!((height - 1.6).abs() < 1e-9, "{pose}");
    }
}

#[test]
fn what_of_the_model_is_missing_is_said_with_the_interiors_file() {
    let folder = with_nodes();
    let here = folder.path();
    let failed = |said: &str| {
        for line in ["plan house", "walk house --frames 1 -o out", "ldis house"] {
            let error = lumigraph(here, line).error(1);
            let begin = format!("house/interior.json: {said}");
            assert!(error.starts_with(&begin), "{error}");
        }
    };
    // 1. A node.
    let mut name = String::new();
    change(here, |interior| {
        name.clone_from(&interior.cells[0].name);
        interior.cells[0].content = Content::Nodes(vec!["attic".to_owned()]);
    });
    failed(&format!(
        "cell `{name}` shows the node `attic`, which the model does not have; correct its `nodes`; there are: "
    ));
    // 2. The file: it was renamed, is a folder, nothing, or of another kind.
    for (model, said) in [
        (
            "nope.glb",
            "there is no file house/nope.glb, which its `model` names; put the model there",
        ),
        (".", "there is no file house/., which its `model` names"),
        ("", "there is no file house/, which its `model` names"),
        (
            "interior.json",
            "its `model`: house/interior.json: textured models are read from .glb and .gltf",
        ),
    ] {
        change(here, |interior| interior.model = Some(model.to_owned()));
        failed(said);
    }
}
