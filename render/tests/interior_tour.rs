//! Tours: through doors rather than windows, whatever says where the rooms are.

mod house;

use calibrate::{Camera, Lens};
use glam::{DVec2, DVec3};
use proxy::interior::find::{Evidence, FindOptions, find_interior};
use proxy::interior::{Contents, Interior, interior_from_nodes, parse_rooms};
use proxy::mesh::read_model;
use proxy::mesh::{Mesh, Model, ModelNode, Part};
use proxy::{MeshKind, Solid};
use render::interior::tour;
use std::path::Path;

/// Rooms a, b and c in a row of squares around a corner: between a and b a window, from a to c
/// and from c to b doors. Boxes and outlines.
const BOXES: [(&str, [f64; 3], [f64; 3]); 3] = [
    ("a", [0.0, 0.0, 0.0], [4.0, 3.0, 4.0]),
    ("b", [4.0, 0.0, 0.0], [8.0, 3.0, 4.0]),
    ("c", [0.0, 0.0, 4.0], [8.0, 3.0, 8.0]),
];
const OPENINGS: [(&str, [[f64; 3]; 4]); 3] = [
    (
        "a|b",
        [
            [4.0, 1.0, 1.0],
            [4.0, 1.0, 3.0],
            [4.0, 2.0, 3.0],
            [4.0, 2.0, 1.0],
        ],
    ),
    (
        "a|c",
        [
            [1.0, 0.0, 4.0],
            [2.0, 0.0, 4.0],
            [2.0, 2.0, 4.0],
            [1.0, 2.0, 4.0],
        ],
    ),
    (
        "c|b",
        [
            [6.0, 0.0, 4.0],
            [7.0, 0.0, 4.0],
            [7.0, 2.0, 4.0],
            [6.0, 2.0, 4.0],
        ],
    ),
];

/// A model whose nodes say all of it: a diagonal of each room, and the openings.
fn model() -> Model {
    let mut model = Model::default();
    let mut add = |name: String, corners: &[DVec3]| {
        let first = model.mesh.positions.len() as u32;
        let triangles = model.mesh.triangles.len() as u32;
        model.mesh.positions.extend(corners);
        let fan = (1..corners.len() as u32 - 1).map(|i| [first, first + i, first + i + 1]);
        model.mesh.triangles.extend(fan);
        model.parts.push(Part {
            triangles: triangles..model.mesh.triangles.len() as u32,
            node_idx: model.nodes.len() as u32,
            material_idx: 0,
        });
        model.nodes.push(ModelNode {
            name,
            parent_idx: None,
        });
    };
    for (name, min, max) in BOXES {
        let [min, max] = [min, max].map(DVec3::from_array);
        add(format!("cell:{name}"), &[min, max, min.with_y(max.y)]);
    }
    for (name, outline) in OPENINGS {
        add(format!("portal:{name}"), &outline.map(DVec3::from_array));
    }
    model.uvs = vec![[0.0; 2]; model.mesh.positions.len()];
    model.colors = vec![[255; 4]; model.mesh.positions.len()];
    let mesh: &Mesh = &model.mesh;
    assert_eq!(mesh.triangles.len(), 3 + 6);
    model
}

fn by_boxes() -> Interior {
    let rooms = BOXES
        .map(|(name, min, max)| format!(r#"{{"name": "{name}", "min": {min:?}, "max": {max:?}}}"#));
    let openings = OPENINGS.map(|(name, outline)| {
        let (a, b) = name.split_once('|').unwrap();
        format!(r#"{{"name": "{name}", "between": ["{a}", "{b}"], "polygon": {outline:?}}}"#)
    });
    let (rooms, openings) = (rooms.join(","), openings.join(","));
    let text = format!(r#"{{"version": 1, "rooms": [{rooms}], "openings": [{openings}]}}"#);
    let read = parse_rooms(Path::new("r.json"), text.as_bytes(), "m.glb");
    read.unwrap().0
}

#[test]
fn tours_go_through_doors_and_not_through_windows() {
    let model = model();
    let (by_nodes, _) = interior_from_nodes(&model, "m.glb").unwrap();
    let camera = Camera::of(
        &Lens::pinhole(DVec2::splat(50.0), DVec2::splat(32.0)),
        64,
        64,
    );
    for interior in [by_boxes(), by_nodes] {
        let (contents, _) = Contents::new(&interior, &model).unwrap();
        let path = tour(&interior, &contents, &model, &camera, 200, 15.0).unwrap();
        let eyes: Vec<DVec3> = path.frames.iter().map(|f| f.view.center()).collect();
        // At eye height over the floor everywhere.
        assert!(eyes.iter().all(|eye| (eye.y - 1.6).abs() < 1e-9));
        // Over the plane between a and b only in c.
        let crossings = eyes.windows(2).filter(|e| (e[0].x < 4.0) != (e[1].x < 4.0));
        let places: Vec<f64> = crossings.map(|e| e[0].z).collect();
        assert!(
            !places.is_empty() && places.iter().all(|z| *z > 4.0),
            "{places:?}"
        );
        // And all rooms are seen.
        for cell in 0..3 {
            let is_there =
                |eye: &DVec3| contents.locate(&interior, *eye).map(|c| c.0) == Some(cell);
            assert!(eyes.iter().any(is_there), "{cell}");
        }
    }
}

/// Steps of a tour that pass a triangle, and how many cells it comes to.
fn crossings(interior: &Interior, model: &Model) -> (usize, usize) {
    let (contents, _) = Contents::new(interior, model).unwrap();
    let camera = Camera::of(
        &Lens::pinhole(DVec2::splat(50.0), DVec2::splat(32.0)),
        64,
        64,
    );
    let path = tour(interior, &contents, model, &camera, 1500, 15.0).unwrap();
    let solid = Solid::new(MeshKind::Mesh, model.mesh.clone());
    let eyes: Vec<DVec3> = path.frames.iter().map(|f| f.view.center()).collect();
    let passes = |e: &[DVec3]| {
        let hit = solid.first_hit(e[0], e[1] - e[0]);
        hit.is_some_and(|hit| hit.along <= 1.0)
    };
    let mut cells: Vec<_> = eyes
        .iter()
        .filter_map(|e| contents.locate(interior, *e))
        .collect();
    cells.sort_unstable();
    cells.dedup();
    (eyes.windows(2).filter(|e| passes(e)).count(), cells.len())
}

#[test]
fn tours_go_around_walls_and_furniture() {
    for (rooms, seed) in [(3, 2), (9, 6), (19, 1)] {
        let (house, _) = house::small_house(rooms, seed);
        let found = crossings(&house.interior, &house.model);
        assert_eq!(found, (0, rooms), "{rooms} rooms");
    }
    let captures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/captures");
    let file = captures.join("interior-house/house.glb");
    if !file.exists() {
        eprintln!("SKIPPED: {} is absent", file.display());
        return;
    }
    let (model, _) = read_model(&file).unwrap();
    let evidence = Evidence {
        mesh: &model.mesh,
        cameras: &[],
        sights: &[],
    };
    let found = find_interior(&evidence, "house.glb", &FindOptions::default()).unwrap();
    assert_eq!(crossings(&found.interior, &model), (0, 3));
}
