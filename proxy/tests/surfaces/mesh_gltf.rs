//! Meshes of glTF files: what is read, and what is said of bad ones.

use crate::mesh_files::{SQUARE, message, normals, parse};

use base64::Engine;
use glam::DVec3;
use proxy::mesh;
use std::path::Path;

/// A glTF file of one mesh; indices and positions in one buffer.
pub(crate) fn gltf(
    mode: u32,
    indices: Option<&[u16]>,
    positions: &[[f32; 3]],
    nodes: &str,
) -> String {
    let mut bytes: Vec<u8> = Vec::new();
    bytes.extend(
        positions
            .as_flattened()
            .iter()
            .flat_map(|x| x.to_le_bytes()),
    );
    let length = bytes.len();
    bytes.extend(
        indices
            .unwrap_or_default()
            .iter()
            .flat_map(|x| x.to_le_bytes()),
    );
    let text = base64::engine::general_purpose::STANDARD.encode(&bytes);
    let primitive_indices = indices.map_or(String::new(), |_| r#""indices": 1,"#.to_owned());
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}],
        "nodes": {nodes},
        "meshes": [{{"primitives": [{{{primitive_indices} "mode": {mode}, "attributes": {{"POSITION": 0}}}}]}}],
        "accessors": [
            {{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": {}}},
            {{"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": {}}}],
        "bufferViews": [
            {{"buffer": 0, "byteLength": {length}}},
            {{"buffer": 0, "byteOffset": {length}, "byteLength": {}}}],
        "buffers": [{{"byteLength": {}, "uri": "data:application/octet-stream;base64,{text}"}}]}}"#,
        positions.len(),
        indices.map_or(0, <[u16]>::len),
        bytes.len() - length,
        bytes.len(),
    )
}

pub(crate) const ONE_NODE: &str = r#"[{"mesh": 0}]"#;

#[test]
fn gltf_triangles_strips_and_fans_are_triangles() {
    for (mode, indices) in [
        (4, vec![0, 1, 2, 2, 1, 3]),
        (5, vec![0, 1, 2, 3]),
        (6, vec![0, 1, 3, 2]),
    ] {
        let read = parse("a.gltf", gltf(mode, Some(&indices), &SQUARE, ONE_NODE)).unwrap();
        assert_eq!(read.triangles.len(), 2, "mode {mode}");
        assert!(
            normals(&read).iter().all(|n| *n == DVec3::Z),
            "mode {mode}: {read:?}"
        );
    }
    let strip = parse("a.gltf", gltf(5, None, &SQUARE, ONE_NODE)).unwrap();
    assert_eq!(strip.triangles, [[0, 1, 2], [2, 1, 3]]);
}

#[test]
fn a_gltf_scene_without_triangles_is_told() {
    let said = "a.gltf: its default scene has no triangle; if another of its scenes is meant, export \
                that one, and of lines or a cloud of points make a surface first";
    let square = gltf(4, Some(&[0, 1, 2]), &SQUARE, ONE_NODE);
    let empty = square.replace(r#""scenes": [{"nodes": [0]}]"#, r#""scenes": [{}]"#);
    assert_ne!(empty, square);
    for text in [
        gltf(0, None, &SQUARE, ONE_NODE),
        gltf(1, None, &SQUARE, ONE_NODE),
        gltf(4, None, &SQUARE[..2], ONE_NODE),
        empty,
    ] {
        assert_eq!(message("a.gltf", &text), said);
        let model = mesh::parse_model(Path::new("a.gltf"), text.as_bytes());
        assert_eq!(model.unwrap_err().to_string(), said);
    }
}

#[test]
fn gltf_nodes_move_their_meshes_and_mirrors_keep_the_outside() {
    let nodes = r#"[
        {"children": [1], "translation": [500000.123456789, 5400000.25, 10]},
        {"mesh": 0, "scale": [-2, 1, 1], "rotation": [0, 0, 0.7071067811865476, 0.7071067811865476]}]"#;
    let read = parse("a.gltf", gltf(4, Some(&[0, 1, 2]), &SQUARE, nodes)).unwrap();
    // x is mirrored and doubled, then turned onto −y; y onto −x.
    let origin = DVec3::new(500000.123456789, 5400000.25, 10.0);
    assert!((read.positions[1] - origin - DVec3::new(0.0, -2.0, 0.0)).length() < 1e-9);
    assert!((read.positions[2] - origin - DVec3::new(-1.0, 0.0, 0.0)).length() < 1e-9);
    let outside = normals(&read)[0];
    assert!(outside.z > 0.0, "{outside}");
    let matrix = r#"[{"mesh": 0, "matrix": [1,0,0,0, 0,0,1,0, 0,-1,0,0, 3,4,5,1]}]"#;
    let read = parse("a.gltf", gltf(4, Some(&[0, 1, 2]), &SQUARE, matrix)).unwrap();
    assert_eq!(read.positions[2], DVec3::new(3.0, 4.0, 6.0));
}

#[test]
fn gltf_buffers_may_lie_beside_the_file_but_not_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    let bytes: Vec<u8> = SQUARE
        .as_flattened()
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    std::fs::write(folder.path().join("a b.bin"), bytes).unwrap();
    let text = gltf(5, None, &SQUARE, ONE_NODE);
    let at = text.find("data:").unwrap();
    let with_uri = |uri: &str| format!("{}{uri}\"}}]}}", &text[..at]);
    let path = folder.path().join("mesh.gltf");
    std::fs::write(&path, with_uri("a%20b.bin")).unwrap();
    assert_eq!(mesh::read(&path).unwrap().triangles.len(), 2);
    for elsewhere in ["https://example.org/a.bin", "../a.bin", "/dev/zero", ""] {
        std::fs::write(&path, with_uri(elsewhere)).unwrap();
        let error = mesh::read(&path).unwrap_err().to_string();
        assert!(
            error.contains("put them into a file beside this one"),
            "{error}"
        );
    }
    std::fs::write(&path, with_uri("none.bin")).unwrap();
    let error = mesh::read(&path).unwrap_err().to_string();
    let (file, none) = (path.display(), folder.path().join("none.bin"));
    let said = format!(
        "{file}, buffer 0: its bytes cannot be read from {}: ",
        none.display()
    );
    assert!(error.starts_with(&said), "{error}");
    let remedy =
        "; put that file there, or export the model again as .glb with all that it uses inside";
    assert!(error.ends_with(remedy), "{error}");
}

#[test]
fn bad_gltf_files_say_where() {
    let good = gltf(4, Some(&[0, 1, 2]), &SQUARE, ONE_NODE);
    let bad = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        message("a.gltf", good.replacen(from, to, 1))
    };
    assert_eq!(
        bad(
            r#""asset""#,
            r#""extensionsRequired": ["KHR_draco_mesh_compression"], "asset""#
        ),
        "a.gltf: it needs the extension KHR_draco_mesh_compression, which is not read; export \
         the mesh again without it (without compression, say)"
    );
    assert_eq!(
        bad(r#""version": "2.0""#, r#""version": "1.0""#),
        "a.gltf: glTF version 1.0; this program reads version 2: export the mesh again as glTF 2.0"
    );
    assert_eq!(
        bad(r#""count": 4"#, r#""count": 400000000000"#),
        "a.gltf, accessor 0: its 400000000000 elements do not fit into their buffer view (of 2); \
         is the file cut off?"
    );
    assert_eq!(
        bad(r#""count": 4"#, r#""count": 2"#),
        "a.gltf, mesh 0, primitive 0: it uses corner 2, but has only 2"
    );
    assert_eq!(
        bad(
            r#""buffer": 0, "byteLength": 48"#,
            r#""buffer": 7, "byteLength": 48"#
        ),
        "a.gltf, buffer 7: there is no such buffer"
    );
    assert_eq!(
        bad(
            ONE_NODE,
            r#"[{"mesh": 0, "children": [1]}, {"children": [0]}]"#
        ),
        "a.gltf, node 0: two nodes have it as their child; nodes must form trees"
    );
    assert_eq!(
        bad(ONE_NODE, r#"[{"mesh": 3}]"#),
        "a.gltf, node 0: there is no mesh 3"
    );
    assert_eq!(bad(ONE_NODE, "[]"), "a.gltf, node 0: there is no such node");
    assert_eq!(
        bad(
            ONE_NODE,
            r#"[{"mesh": 0, "scale": [1e308, 1, 1], "translation": [1e308, 0, 0]}]"#
        ),
        "a.gltf, mesh 0, primitive 0: the position of corner 1 is not finite"
    );
    assert_eq!(
        bad(
            ONE_NODE,
            r#"[{"mesh": 0, "matrix": [1,0,0,0.5, 0,1,0,0, 0,0,1,0, 0,0,0,1]}]"#
        ),
        "a.gltf, node 0: its matrix has the last row [0.5, 0.0, 0.0, 1.0], expected [0, 0, 0, 1]; \
         apply its transform before exporting"
    );
    assert_eq!(
        bad(r#""mode": 4"#, r#""mode": 9"#),
        "a.gltf, mesh 0, primitive 0: its mode is 9, expected 0 to 6; export the mesh again"
    );
}

#[test]
fn what_of_a_gltf_file_is_no_triangle_is_told() {
    let told = |text: &str| mesh::parse_model(Path::new("a.gltf"), text.as_bytes()).unwrap();
    let (model, warnings) = told(&gltf(4, None, &SQUARE, ONE_NODE));
    assert_eq!(model.mesh.triangles.len(), 1);
    assert_eq!(
        warnings,
        ["mesh 0, primitive 0: the corners are no multiple of 3, and the last ones are left out"]
    );
    // Once, however many there are; files of triangles with their edges are many.
    let both = gltf(4, Some(&[0, 1, 2]), &SQUARE, ONE_NODE);
    let thin =
        r#"{"mode": 1, "attributes": {"POSITION": 0}}, {"mode": 0, "attributes": {"POSITION": 0}}"#;
    let both = both.replacen(
        r#""primitives": ["#,
        &format!(r#""primitives": [{thin}, "#),
        1,
    );
    let (model, warnings) = told(&both);
    assert_eq!(model.mesh.triangles.len(), 1);
    assert_eq!(
        warnings,
        ["mesh 0, primitive 0 and 1 more: points and lines are not drawn"]
    );
}

#[test]
fn nodes_may_repeat_a_mesh_in_a_small_file() {
    // As rows of seats: the mesh takes some 100 times what the file does.
    let children: Vec<String> = (1..=500).map(|i| i.to_string()).collect();
    let nodes = vec![r#"{"mesh": 0}"#; 500].join(",");
    let nodes = format!(r#"[{{"children": [{}]}}, {nodes}]"#, children.join(","));
    let file = gltf(4, None, &[[0.0, 1.0, 2.0]; 300], &nodes);
    let mesh = parse("a.gltf", &file).unwrap();
    assert_eq!(mesh.triangles.len(), 500 * 100);
    assert!(24 * mesh.positions.len() > 100 * file.len());
}

#[test]
fn nodes_cannot_repeat_a_mesh_without_end() {
    let children: Vec<String> = (1..5000).map(|i| i.to_string()).collect();
    let nodes = vec![r#"{"mesh": 0}"#; 4999].join(",");
    let nodes = format!(r#"[{{"children": [{}]}}, {nodes}]"#, children.join(","));
    let positions = vec![[0.0, 1.0, 2.0]; 3000];
    let error = message("a.gltf", gltf(4, None, &positions, &nodes));
    assert!(
        error.contains("nodes repeat meshes until they take"),
        "{error}"
    );
}

#[test]
fn gltf_targets_move_corners_by_their_weights() {
    // Targets that move each corner by its own place: the square grows.
    let plain = gltf(
        5,
        None,
        &SQUARE,
        r#"[{"mesh": 0, "translation": [0, 0, 5]}]"#,
    );
    let whole = plain.replace(
        r#""attributes": {"POSITION": 0}"#,
        r#""attributes": {"POSITION": 0}, "targets": [{"NORMAL": 7}, {"POSITION": 0}, {"POSITION": 0}]"#,
    );
    let of_mesh = |weights: &str| {
        let from = r#""meshes": [{"#;
        whole.replace(from, &format!(r#"{from}"weights": {weights}, "#))
    };
    let of_node = |text: &str, weights: &str| {
        text.replace(
            r#""mesh": 0"#,
            &format!(r#""mesh": 0, "weights": {weights}"#),
        )
    };
    let times = |text: String| {
        let read = parse("a.gltf", text).unwrap();
        let times = read.positions[3].x / f64::from(SQUARE[3][0]);
        for (position, corner) in read.positions.iter().zip(SQUARE) {
            let expected = times * DVec3::from(corner.map(f64::from)) + 5.0 * DVec3::Z;
            assert!((*position - expected).length() < 1e-12, "{position}");
        }
        times
    };
    assert_eq!(times(whole.clone()), 1.0);
    assert_eq!(times(of_mesh("[1, 0, 0]")), 1.0);
    assert_eq!(times(of_mesh("[0, 0.5, 2]")), 3.5);
    assert_eq!(times(of_node(&whole, "[0, 1]")), 2.0);
    assert_eq!(times(of_node(&of_mesh("[0, 1, 1]"), "[0, 0, 0]")), 1.0);

    // A target that lists the corners that it moves: the last alone, by the third's place.
    let sparse = |index: &str| {
        let from = r#""accessors": ["#;
        let place = format!(
            r#"{{"componentType": 5126, "type": "VEC3", "count": 4, "sparse": {{"count": 1,
            "indices": {{"bufferView": 1, "byteOffset": 2, "componentType": {index}}},
            "values": {{"bufferView": 0, "byteOffset": 24}}}}}}"#
        );
        let text = gltf(4, Some(&[0, 3, 2, 0, 1, 3]), &SQUARE, ONE_NODE);
        let text = text.replace(from, &format!("{from}{place}, "));
        let text = text.replace(r#""indices": 1"#, r#""indices": 2"#);
        text.replace(
            r#""attributes": {"POSITION": 0}"#,
            r#""attributes": {"POSITION": 1}, "targets": [{"POSITION": 0}]"#,
        )
    };
    let read = parse("a.gltf", of_node(&sparse("5123"), "[2]")).unwrap();
    let corner = |i: usize| DVec3::from(SQUARE[i].map(f64::from));
    let moved = corner(3) + 2.0 * corner(2);
    assert_eq!(read.positions, [corner(0), corner(1), corner(2), moved]);
    // Without weight it is not read.
    parse("a.gltf", sparse("5126")).unwrap();
    let said = message("a.gltf", of_node(&sparse("5126"), "[2]"));
    let expected = "a.gltf, accessor 0: indices must be unsigned whole numbers";
    assert_eq!(said, expected);
    let short = of_node(&sparse("5123"), "[2]").replacen(r#""count": 4"#, r#""count": 3"#, 1);
    let said = message("a.gltf", &short);
    let expected = "a.gltf, accessor 0: 3 moves of a target for 4 corners";
    assert_eq!(said, expected);
}

#[test]
fn gltf_numbers_that_are_compressed_are_told() {
    let plain = gltf(5, None, &SQUARE, ONE_NODE);
    let used = |name: &str| format!(r#"{{"extensionsUsed": ["KHR_lights_punctual", "{name}"], "#);
    let compressed = |text: &str, name: &str| text.replacen('{', &used(name), 1);
    let no_view = plain.replacen(r#""bufferView": 0, "#, "", 1);
    let at = plain.find(r#", "uri": "data:"#).unwrap();
    let no_bytes = format!("{}}}]}}", &plain[..at]);
    for (text, what) in [
        (
            no_view,
            "accessor 0: it has no numbers in the file (no buffer view)",
        ),
        (
            no_bytes,
            "buffer 0: it has no bytes: neither a uri nor a binary chunk",
        ),
    ] {
        let expected = format!("a.gltf, {what}; export the mesh again");
        assert_eq!(message("a.gltf", &text), expected);
        for name in ["KHR_draco_mesh_compression", "EXT_meshopt_compression"] {
            let expected = format!(
                "a.gltf, {what}; the file is compressed ({name}), which is not read: export the mesh again without \
                 compression"
            );
            assert_eq!(message("a.gltf", compressed(&text, name)), expected);
        }
    }
    // Where the numbers are there as well, they are read.
    parse("a.gltf", compressed(&plain, "KHR_draco_mesh_compression")).unwrap();
}
