//! What cells and portals are made of: contents, outlines and named nodes of a model.

use crate::interior::{TWO_ROOMS, rooms, two_rooms};

use glam::DVec3;
use proxy::interior::{CellId, Content, Contents, InteriorWarning, PortalId, interior_from_nodes};
use proxy::mesh::{self, Mesh, Model, ModelNode, Part};

/// A model of single triangles.
fn model(triangles: &[[[f64; 3]; 3]], nodes: &[&str]) -> Model {
    let corners: Vec<DVec3> = triangles
        .as_flattened()
        .iter()
        .map(|p| DVec3::from_array(*p))
        .collect();
    let count = triangles.len() as u32;
    let name = |i: u32| nodes.get(i as usize).copied().unwrap_or("thing").to_owned();
    Model {
        uvs: vec![[0.0; 2]; corners.len()],
        colors: vec![[255; 4]; corners.len()],
        mesh: Mesh {
            triangles: (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            positions: corners,
        },
        parts: (0..count)
            .map(|i| Part {
                triangles: i..i + 1,
                node_idx: i,
                material_idx: 0,
            })
            .collect(),
        nodes: (0..count)
            .map(|i| ModelNode {
                name: name(i),
                parent_idx: None,
            })
            .collect(),
        materials: vec![mesh::Material::default()],
        textures: Vec::new(),
    }
}

/// A triangle around a place.
fn around([x, y, z]: [f64; 3], size: f64) -> [[f64; 3]; 3] {
    [
        [x - size, y, z - size],
        [x + size, y, z - size],
        [x, y, z + size],
    ]
}

#[test]
fn cells_have_what_touches_them() {
    let model = model(
        &[
            around([1.0, 1.0, 1.0], 0.1),
            around([4.0, 1.0, 1.0], 0.1),
            around([7.0, 1.0, 1.0], 0.1),
            around([7.0, 9.0, 1.0], 0.1),
        ],
        &[],
    );
    let interior = two_rooms();
    let (contents, warnings) = Contents::new(&interior, &model).unwrap();
    assert_eq!(contents.triangles, [vec![0, 1], vec![1, 2]]);
    assert_eq!(contents.elsewhere, [3]);
    assert_eq!(warnings, [InteriorWarning::Elsewhere(1)]);
    // Of an empty model there is nothing to see, and everything else works.
    let (empty, warnings) = Contents::new(&interior, &Model::default()).unwrap();
    assert_eq!(warnings.len(), 2);
    assert_eq!(empty.locate(&interior, DVec3::ONE), Some(CellId(0)));
}

#[test]
fn nodes_name_cells_and_portals() {
    let mut model = model(
        &[
            around([1.0, 1.0, 1.0], 1.0),
            around([5.0, 1.0, 1.0], 1.0),
            [[3.0, 0.0, 0.0], [3.0, 0.0, 2.0], [3.0, 2.0, 2.0]],
            [[3.0, 0.0, 0.0], [3.0, 2.0, 2.0], [3.0, 2.0, 0.0]],
        ],
        &["cell:a", "cell:b", "portal:a|b"],
    );
    model.parts[3].node_idx = 2;
    let (interior, warnings) = interior_from_nodes(&model, "m.glb", 1.0).unwrap();
    assert_eq!(warnings, []);
    assert_eq!(interior.eye_height, 1.6);
    let portal = interior.portal(PortalId(0));
    assert_eq!(portal.cells, [Some(CellId(0)), Some(CellId(1))]);
    assert_eq!(portal.polygon.corners().len(), 4);
    assert!((portal.polygon.normal() + DVec3::X).length() < 1e-12);
    let (contents, warnings) = Contents::new(&interior, &model).unwrap();
    assert_eq!(contents.triangles, [vec![0], vec![1]]);
    assert_eq!((contents.elsewhere.len(), warnings.len()), (0, 0));
    // In centimetres.
    let (fine, _) = interior_from_nodes(&model, "m.glb", 100.0).unwrap();
    assert_eq!(fine.eye_height, 160.0);
    assert!(interior_from_nodes(&model, "m.glb", f64::NAN).is_err());
    // What is not there.
    let mut unknown = interior.clone();
    unknown.cells[0].content = Content::Nodes(vec!["moon".to_owned()]);
    let error = Contents::new(&unknown, &model).unwrap_err().to_string();
    assert_eq!(
        error,
        "cell `a` shows the node `moon`, which the model does not have; correct its `nodes`; there are: cell:a, cell:b"
    );
    // Of many, some.
    let node = |i: usize| ModelNode {
        name: format!("part {i:02}"),
        parent_idx: None,
    };
    let parts = Model {
        nodes: (0..30).map(node).collect(),
        ..Model::default()
    };
    let error = Contents::new(&unknown, &parts).unwrap_err().to_string();
    assert!(error.contains("there are: part 00, part 01, "), "{error}");
    assert!(error.ends_with(", part 19, and 10 more"), "{error}");
    let error = Contents::new(&unknown, &Model::default()).unwrap_err();
    let error = error.to_string();
    assert!(error.ends_with("there are: none with a name"), "{error}");
    // Names that are not quite as they should be.
    for (i, name, said) in [
        (2, "portal:a", "expected `portal:A|B`, or `portal:A|` for"),
        (2, "Portal:a|b", "names of rooms begin with `cell:`"),
        (1, "Cell:b", "names of rooms begin with `cell:`"),
    ] {
        let mut odd = model.clone();
        odd.nodes[i].name = name.to_owned();
        let error = interior_from_nodes(&odd, "m.glb", 1.0).unwrap_err();
        let said = format!("node `{name}`: {said}");
        assert!(error.to_string().starts_with(&said), "{error}");
    }
    model.nodes[2].name = "portal:a|c".to_owned();
    let error = interior_from_nodes(&model, "m.glb", 1.0)
        .unwrap_err()
        .to_string();
    assert!(error.contains("leads to the cell `c`"), "{error}");
    model.parts[3].node_idx = 0;
    model.parts[2].node_idx = 0;
    model.nodes[2].name = "portal:a|b".to_owned();
    let error = interior_from_nodes(&model, "m.glb", 1.0)
        .unwrap_err()
        .to_string();
    assert!(error.contains("it has no triangles"), "{error}");
    for node in &mut model.nodes {
        node.name.clear();
    }
    assert!(interior_from_nodes(&model, "m.glb", 1.0).is_err());
}

/// An L-shaped corridor, a room in its crook, and what opens between them.
fn room_in_the_crook(polygon: &str) -> String {
    format!(
        r#"{{"version": 1,
            "rooms": [
              {{"name": "corridor", "min": [0, 0, 0], "max": [6, 3, 6],
               "floor": [[0, 0, 0], [6, 0, 0], [6, 0, 1.5], [1.5, 0, 1.5], [1.5, 0, 6], [0, 0, 6]]}},
              {{"name": "room", "min": [1.6, 0, 1.6], "max": [3, 3, 3]}}
            ],
            "openings": [{{"name": "door", "between": ["corridor", "room"], "polygon": {polygon}}}]}}"#
    )
}

#[test]
fn a_door_has_its_sides_where_a_room_goes_around_the_next() {
    // The corridor's middle lies beyond the room's, as seen from the door.
    for polygon in [
        "[[1.5, 0, 2], [1.5, 0, 2.8], [1.5, 2, 2.8], [1.5, 2, 2]]",
        "[[1.5, 2, 2], [1.5, 2, 2.8], [1.5, 0, 2.8], [1.5, 0, 2]]",
    ] {
        let (mut interior, warnings) = rooms(&room_in_the_crook(polygon)).unwrap();
        assert_eq!(warnings, []);
        let door = &mut interior.portals[0].polygon;
        assert!((door.normal() + DVec3::X).length() < 1e-12);
        *door = door.clone().reversed();
        let warnings = interior.check().unwrap();
        assert_eq!(warnings, [InteriorWarning::Turned("door".to_owned())]);
    }
    // A window out of a U into its own yard.
    let yard = r#"{"version": 1,
        "rooms": [{"name": "u", "min": [0, 0, 0], "max": [6, 3, 6],
          "floor": [[0, 0, 0], [6, 0, 0], [6, 0, 6], [4.5, 0, 6], [4.5, 0, 1.5], [1.5, 0, 1.5],
                    [1.5, 0, 6], [0, 0, 6]]}],
        "openings": [{"name": "window", "between": ["u", null],
          "polygon": [[2.5, 1, 1.5], [3.5, 1, 1.5], [3.5, 2, 1.5], [2.5, 2, 1.5]]}]}"#;
    let (interior, warnings) = rooms(yard).unwrap();
    assert_eq!(warnings, []);
    assert!((interior.portals[0].polygon.normal() + DVec3::Z).length() < 1e-12);
}

#[test]
fn an_outline_is_believed_where_both_cells_are_on_both_sides() {
    let both = TWO_ROOMS
        .replace("\"max\": [4, 3, 4]", "\"max\": [8, 3, 4]")
        .replace("\"min\": [4, 0, 0]", "\"min\": [0, 0, 0]")
        .replace("\"max\": [8, 3, 4]", "\"max\": [9, 3, 4]");
    let (mut interior, warnings) = rooms(&both).unwrap();
    let is_turned = |warning: &InteriorWarning| matches!(warning, InteriorWarning::Turned(_));
    assert!(!warnings.iter().any(is_turned), "{warnings:?}");
    let door = &mut interior.portals[0].polygon;
    assert!((door.normal() + DVec3::X).length() < 1e-12);
    *door = door.clone().reversed();
    assert!(!interior.check().unwrap().iter().any(is_turned));
}

/// Flat, four-sided pieces of named nodes.
pub(crate) fn nodes_of_quads(quads: &[(&str, [[f64; 3]; 4])]) -> Model {
    let triangles: Vec<[[f64; 3]; 3]> = quads
        .iter()
        .flat_map(|(_, [a, b, c, d])| [[*a, *b, *c], [*a, *c, *d]])
        .collect();
    let mut names: Vec<&str> = quads.iter().map(|(name, _)| *name).collect();
    names.dedup();
    let mut model = model(&triangles, &names);
    for (i, part) in model.parts.iter_mut().enumerate() {
        let name = quads[i / 2].0;
        part.node_idx = names.iter().position(|n| *n == name).unwrap() as u32;
    }
    model
}

/// A piece of floor or ceiling.
pub(crate) fn level([x0, x1]: [f64; 2], [z0, z1]: [f64; 2], y: f64) -> [[f64; 3]; 4] {
    [[x0, y, z0], [x1, y, z0], [x1, y, z1], [x0, y, z1]]
}

/// A wall from one place to another.
pub(crate) fn wall([x0, z0]: [f64; 2], [x1, z1]: [f64; 2]) -> [[f64; 3]; 4] {
    [[x0, 0.0, z0], [x1, 0.0, z1], [x1, 2.5, z1], [x0, 2.5, z0]]
}

#[test]
fn openings_may_be_copies_and_have_faces_on_both_sides() {
    let door = wall([3.0, 0.5], [3.0, 1.5]);
    let [a, b, c, d] = door;
    let mut quads = vec![
        ("cell:a", level([0.0, 3.0], [0.0, 4.0], 0.0)),
        ("cell:b.007", level([3.0, 6.0], [0.0, 4.0], 0.0)),
        ("portal:a|b.007", door),
        ("portal:a|b.007.001", wall([3.0, 2.5], [3.0, 3.5])),
        ("portal:a|.002", wall([0.0, 1.0], [0.0, 2.0])),
    ];
    // Split into triangles as the front is, and the other way.
    for back in [[a, d, c, b], [d, c, b, a]] {
        quads.insert(3, ("portal:a|b.007", back));
        let model = nodes_of_quads(&quads);
        let (interior, warnings) = interior_from_nodes(&model, "m.glb", 1.0).unwrap();
        assert_eq!(warnings, []);
        let [a, b] = [Some(CellId(0)), Some(CellId(1))];
        let cells: Vec<_> = interior.portals.iter().map(|p| p.cells).collect();
        assert_eq!(cells, [[a, b], [a, b], [a, None]]);
        let names: Vec<&str> = interior.portals.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["a|b.007", "a|b.007.001", "a|.002"]);
        let corners = interior.portals[0].polygon.corners();
        let is_there = |p: &[f64; 3]| corners.contains(&DVec3::from_array(*p));
        assert!(corners.len() == 4 && door.iter().all(is_there));
        quads.remove(3);
    }
    // A number that is none, and what is no copy.
    for name in ["portal:a|b.1", "portal:a|b.x01", "portal:a|c.001"] {
        let mut quads = quads.clone();
        quads.push((name, door));
        let error = interior_from_nodes(&nodes_of_quads(&quads), "m.glb", 1.0).unwrap_err();
        let said = format!(
            "leads to the cell `{}`",
            name.trim_start_matches("portal:a|")
        );
        assert!(error.to_string().contains(&said), "{error}");
    }
}

#[test]
fn nodes_of_a_door_have_their_sides_where_a_room_goes_around_the_next() {
    let mut quads = Vec::new();
    for y in [0.0, 2.5] {
        quads.push(("cell:corridor", level([0.0, 6.0], [0.0, 1.5], y)));
        quads.push(("cell:corridor", level([0.0, 1.5], [1.5, 6.0], y)));
    }
    for (from, to) in [
        ([0.0, 0.0], [6.0, 0.0]),
        ([0.0, 0.0], [0.0, 6.0]),
        ([0.0, 6.0], [1.5, 6.0]),
        ([6.0, 0.0], [6.0, 1.5]),
        ([1.5, 1.5], [6.0, 1.5]),
        ([1.5, 1.5], [1.5, 2.0]),
        ([1.5, 3.0], [1.5, 6.0]),
    ] {
        quads.push(("cell:corridor", wall(from, to)));
    }
    for y in [0.0, 2.5] {
        quads.push(("cell:room", level([1.5, 3.5], [1.5, 3.5], y)));
    }
    for (from, to) in [
        ([1.5, 1.5], [3.5, 1.5]),
        ([3.5, 1.5], [3.5, 3.5]),
        ([1.5, 3.5], [3.5, 3.5]),
    ] {
        quads.push(("cell:room", wall(from, to)));
    }
    // Its outline may go either way round, and either side may be named first.
    let door = wall([1.5, 2.0], [1.5, 3.0]);
    let [a, b, c, d] = door;
    for (name, outline, into_first) in [
        ("portal:corridor|room", door, DVec3::NEG_X),
        ("portal:corridor|room", [d, c, b, a], DVec3::NEG_X),
        ("portal:room|corridor", door, DVec3::X),
        ("portal:room|corridor", [d, c, b, a], DVec3::X),
    ] {
        let all = [quads.as_slice(), &[(name, outline)]].concat();
        let (interior, warnings) =
            interior_from_nodes(&nodes_of_quads(&all), "m.glb", 1.0).unwrap();
        assert_eq!(warnings, []);
        let normal = interior.portals[0].polygon.normal();
        assert!((normal - into_first).length() < 1e-12, "{name}: {normal}");
    }
}
