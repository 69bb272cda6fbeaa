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
