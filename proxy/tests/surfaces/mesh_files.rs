//! Mesh files: what is read, what is written, and what is said of bad ones.

use crate::common;

use base64::Engine;
use calibrate::{Lens, Rigid3, View};
use glam::{DMat4, DVec2, DVec3};
use proptest::prelude::*;
use proxy::mesh::{self, Mesh};
use proxy::{MeshKind, Solid};
use std::path::Path;

fn parse(name: &str, bytes: impl AsRef<[u8]>) -> Result<Mesh, String> {
    mesh::parse(Path::new(name), bytes.as_ref()).map_err(|e| e.to_string())
}

fn message(name: &str, bytes: impl AsRef<[u8]>) -> String {
    parse(name, bytes).unwrap_err()
}

fn solid(mesh: &Mesh) -> Solid {
    Solid::new(MeshKind::Mesh, mesh.clone())
}

fn triangle() -> Mesh {
    Mesh {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
        triangles: vec![[0, 1, 2]],
    }
}

/// A glTF file of one mesh; indices and positions in one buffer.
fn gltf(mode: u32, indices: Option<&[u16]>, positions: &[[f32; 3]], nodes: &str) -> String {
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

const SQUARE: [[f32; 3]; 4] = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [1., 1., 0.]];
const ONE_NODE: &str = r#"[{"mesh": 0}]"#;

fn normals(mesh: &Mesh) -> Vec<DVec3> {
    let normal = |i| {
        let [a, b, c] = mesh.corners(i);
        (b - a).cross(c - a)
    };
    (0..mesh.triangles.len()).map(normal).collect()
}

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
    let remedy = "; put that file there, or export the mesh as .glb";
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
fn ply_is_read_from_text_and_both_binary_orders() {
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\ncomment made by hand\nelement camera 1\n\
             property list uchar float views\nelement vertex 4\nproperty uchar red\n\
             property double x\nproperty float y\nproperty short z\nelement face 1\n\
             property float quality\nproperty list uchar int vertex_indices\nend_header\n"
        )
    };
    let corners = [
        (500000.123456789, 1.5, 2),
        (1.0, 0.0, 0),
        (1.0, 1.0, 0),
        (0.0, 1.0, -3),
    ];
    let mut text = header("ascii") + "2 0.5 0.5\n";
    for (x, y, z) in corners {
        text += &format!("255 {x} {y} {z}\n");
    }
    text += "0.9 4 0 1 2 3\n";
    let expected = Mesh {
        positions: corners
            .map(|(x, y, z)| DVec3::new(x, y, f64::from(z)))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    };
    assert_eq!(parse("a.ply", &text).unwrap(), expected);
    for is_big in [false, true] {
        let name = if is_big {
            "binary_big_endian"
        } else {
            "binary_little_endian"
        };
        let mut bytes = header(name).into_bytes();
        let mut put = |little: &[u8]| match is_big {
            true => bytes.extend(little.iter().rev()),
            false => bytes.extend(little),
        };
        put(&[2]);
        put(&0.5_f32.to_le_bytes());
        put(&0.5_f32.to_le_bytes());
        for (x, y, z) in corners {
            put(&[255]);
            put(&x.to_le_bytes());
            put(&(y as f32).to_le_bytes());
            put(&(z as i16).to_le_bytes());
        }
        put(&0.9_f32.to_le_bytes());
        put(&[4]);
        (0..4_i32).for_each(|i| put(&i.to_le_bytes()));
        assert_eq!(parse("a.ply", &bytes).unwrap(), expected, "{name}");
        let error = message("a.ply", &bytes[..bytes.len() - 1]);
        assert_eq!(error, "a.ply, face 0: the file ends here; it is cut off");
    }
}

#[test]
fn lines_of_a_ply_file_may_end_in_returns() {
    let header = |format: &str| {
        let text = format!(
            "ply\nformat {format} 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
             property float z\nelement face 1\nproperty list uchar uchar vertex_indices\nend_header\n"
        );
        text.replace('\n', "\r")
    };
    let text = header("ascii") + "0 0 0\r1 0 0\r0 1 0\r3 0 1 2\r";
    assert_eq!(parse("a.ply", &text).unwrap(), triangle());
    assert_eq!(
        message("a.ply", text.replace("3 0 1 2", "3 0 1 x")),
        "a.ply, line 13: `x` is no whole number"
    );
    // A number that begins as a new line does.
    let first = f32::from_le_bytes([b'\n', 0, 0, 0x3f]);
    let mut bytes = header("binary_little_endian").into_bytes();
    for x in [first, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
        bytes.extend(x.to_le_bytes());
    }
    bytes.extend([3, 0, 1, 2]);
    let read = parse("a.ply", &bytes).unwrap();
    assert_eq!(read.positions[0], DVec3::new(f64::from(first), 0.0, 0.0));
    assert_eq!(read.positions[1..], triangle().positions[1..]);
}

#[test]
fn ply_strips_of_triangles_are_read() {
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
             property float z\nelement tristrips 1\nproperty list int int vertex_indices\n\
             end_header\n"
        )
    };
    // A square, and one of its triangles again.
    let indices: [i32; 8] = [0, 1, 2, 3, -1, 3, 2, 1];
    let expected = Mesh {
        positions: SQUARE.map(|p| DVec3::from_array(p.map(f64::from))).to_vec(),
        triangles: vec![[0, 1, 2], [2, 1, 3], [3, 2, 1]],
    };
    let corners: String = SQUARE.map(|[x, y, z]| format!("{x} {y} {z}\n")).concat();
    let text = |strips: &str| header("ascii") + &corners + strips;
    let read = parse("a.ply", text("8 0 1 2 3 -1 3 2 1\n"));
    assert_eq!(read.unwrap(), expected);
    for (name, is_big) in [("binary_little_endian", false), ("binary_big_endian", true)] {
        let mut bytes = header(name).into_bytes();
        let mut put = |mut word: [u8; 4]| {
            if is_big {
                word.reverse();
            }
            bytes.extend(word);
        };
        for x in SQUARE.as_flattened() {
            put(x.to_le_bytes());
        }
        put(8_i32.to_le_bytes());
        for i in indices {
            put(i.to_le_bytes());
        }
        assert_eq!(parse("a.ply", &bytes).unwrap(), expected, "{name}");
    }
    assert_eq!(
        message("a.ply", text("3 0 1 4\n")),
        "a.ply, line 14: it uses corner 4, but there are 4 (the first is 0); is the file cut off?"
    );
    assert_eq!(
        message("a.ply", text("4 0 1 -2 3\n")),
        "a.ply, line 14: it uses corner -2; corners count from 0"
    );
    let short = message("a.ply", text("5 0 1 -1 2 3\n"));
    assert!(short.contains("4 corners but no triangle"), "{short}");
}

#[test]
fn bad_ply_files_say_where() {
    let with = |rest: &str| {
        message(
            "a.ply",
            format!(
                "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                 property float z\nelement face 1\nproperty list uchar int vertex_index\n\
                 end_header\n{rest}"
            ),
        )
    };
    let corners = "0 0 0\n1 0 0\n0 1 0\n";
    assert_eq!(
        with("0 0 0\n1 nan 0\n"),
        "a.ply, line 11: a coordinate is not finite; remove the corner and its faces"
    );
    assert_eq!(
        with("0 0 0\n1 one 0\n"),
        "a.ply, line 11: `one` is no number"
    );
    assert_eq!(
        with(corners),
        "a.ply, line 13: the file ends here; it is cut off"
    );
    assert_eq!(
        with(&format!("{corners}3 0 1 3\n")),
        "a.ply, line 13: it uses corner 3, but there are 3 (the first is 0); is the file cut off?"
    );
    assert_eq!(
        with(&format!("{corners}3 0 1 -1\n")),
        "a.ply, line 13: it uses corner -1; corners count from 0"
    );
    assert_eq!(
        message(
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n"
        ),
        "a.ply: its corners have no properties x, y and z"
    );
    assert_eq!(
        message("a.ply", "plyx\n"),
        "a.ply, line 1: a PLY file begins with the line `ply`"
    );
    assert_eq!(
        message(
            "a.ply",
            "ply\nformat ascii 1.0\nelement face 0\nproperty list float int a\n"
        ),
        "a.ply, line 4: a list's length must be of a whole number's type"
    );
    assert!(with(&format!("{corners}2 0 1\n")).contains("3 corners but no triangle"));
    // Counts alone take neither memory nor time.
    let huge = "ply\nformat binary_little_endian 1.0\nelement nothing 18446744073709551615\n\
                element vertex 18446744073709551615\nproperty float x\nproperty float y\n\
                property float z\nend_header\n";
    assert_eq!(
        message("a.ply", huge),
        "a.ply, vertex 0: the file ends here; it is cut off"
    );
}

#[test]
fn obj_faces_take_every_form() {
    let text = "# a house\nmtllib house.mtl\no wall\nv 500000.123456789 0 0\nv 1 0 0 0.5 0.5 0.5\n\
                v 1 1 0\r\nvt 0 0\nvn 0 0 1\nusemtl brick\nf 1 2 3\nf 1/1 2/1 3/1 4/1\n\
                v 0 1 0 # late\nf -4//1 -3//1 -2//1 -1//1\nl 1 2\nf 1/1/1 2/1/1 -1/1/1\n";
    let read = parse("a.obj", text).unwrap();
    assert_eq!(read.positions[0].x, 500000.123456789);
    assert_eq!(
        read.triangles,
        [
            [0, 1, 2],
            [0, 1, 2],
            [0, 2, 3],
            [0, 1, 2],
            [0, 2, 3],
            [0, 1, 3]
        ]
    );
}

#[test]
fn obj_lines_may_end_as_on_any_computer() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let expected = parse("a.obj", text).unwrap();
    for end in ["\r\n", "\r"] {
        assert_eq!(parse("a.obj", text.replace('\n', end)).unwrap(), expected);
        let bad = text.replace("f 1 2 3", "f 1 2 4").replace('\n', end);
        assert_eq!(
            message("a.obj", bad),
            "a.obj, line 4: a face uses corner 4, but the file has 3; is it cut off?"
        );
    }
    // One way and another in one file.
    let old = text.replace('\n', "\r");
    for mixed in [
        format!("# made\n{old}"),
        format!("# made\r\n{old}\r\n"),
        format!("{old}\n"),
        text.replacen('\n', "\r", 2),
        text.replacen('\n', "\r\n", 2),
    ] {
        assert_eq!(
            parse("a.obj", mixed.clone()).unwrap(),
            expected,
            "{mixed:?}"
        );
    }
    let bad = format!("# made\n{}\r\n", old.replace("f 1 2 3", "f 1 2 4"));
    assert_eq!(
        message("a.obj", bad),
        "a.obj, line 5: a face uses corner 4, but the file has 3; is it cut off?"
    );
}

/// An L of area 5, at a slant and far from the origin; and a square with a hole, joined to its outline.
const CONCAVE: [(&[[f64; 2]], f64); 2] = [
    (
        &[[0., 0.], [3., 0.], [3., 1.], [1., 1.], [1., 3.], [0., 3.]],
        5.0,
    ),
    (
        &[
            [0., 0.],
            [4., 0.],
            [4., 4.],
            [0., 4.],
            [0., 0.],
            [1., 1.],
            [1., 3.],
            [3., 3.],
            [3., 1.],
            [1., 1.],
        ],
        12.0,
    ),
];

#[test]
fn a_polygon_that_is_not_convex_covers_itself_alone() {
    let mut cases = 0;
    for (corners, area) in CONCAVE {
        for start in 0..corners.len() {
            for is_reversed in [false, true] {
                let count = corners.len();
                let mut around: Vec<usize> = (0..count).map(|i| (i + start) % count).collect();
                if is_reversed {
                    around.reverse();
                }
                let place = |&[x, y]: &[f64; 2]| format!("{} {} {}\n", 5e5 + x, 5e6 + y, x + y);
                let places: Vec<String> = corners.iter().map(place).collect();
                let places = places.concat();
                // Faces may come before their corners.
                let face: String = around.iter().map(|i| format!(" {}", i + 1)).collect();
                let obj = format!("f{face}\nv {}\n", places.trim_end().replace('\n', "\nv "));
                let face: String = around.iter().map(|i| format!(" {i}")).collect();
                let ply = format!(
                    "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\n\
                     element vertex {count}\nproperty double x\nproperty double y\nproperty double z\n\
                     end_header\n{count}{face}\n{places}"
                );
                for (name, text) in [("a.obj", obj), ("a.ply", ply)] {
                    let mesh = parse(name, text).unwrap();
                    assert_eq!(mesh.triangles.len(), count - 2);
                    let flat: Vec<f64> = normals(&mesh).iter().map(|n| n.z / 2.0).collect();
                    let sign = if is_reversed { -1.0 } else { 1.0 };
                    assert!(
                        flat.iter().all(|a| sign * a > 0.0),
                        "{name} {start}: {flat:?}"
                    );
                    let sum: f64 = flat.iter().sum();
                    assert!((sum - sign * area).abs() < 1e-6, "{name} {start}: {sum}");
                    cases += 1;
                }
            }
        }
    }
    assert_eq!(cases, 2 * 2 * (6 + 10));
}

/// An OBJ file of one polygon in the plane z = 0.
fn polygon(corners: &[[f64; 2]]) -> Mesh {
    let lines = corners.iter().map(|[x, y]| format!("v {x} {y} 0\n"));
    let face: String = (1..=corners.len()).map(|i| format!(" {i}")).collect();
    parse("a.obj", lines.collect::<String>() + "f" + &face).unwrap()
}

fn fan(corners: u32) -> Vec<[u32; 3]> {
    (1..corners - 1).map(|i| [0, i, i + 1]).collect()
}

#[test]
fn a_polygon_that_its_first_corner_sees_whole_is_a_fan() {
    // Convex, with a corner on a side, but for digits; and an arrow, from its tip.
    let almost = [[0., 0.], [1., 1e-7], [2., 0.], [2., 2.], [0., 2.]];
    assert_eq!(polygon(&almost).triangles, fan(5));
    let arrow = [[0., 0.], [2., -1.], [1., 0.], [2., 1.]];
    assert_eq!(polygon(&arrow).triangles, fan(4));
    // What encloses nothing, or crosses itself.
    let line = [[0., 0.], [1., 1.], [2., 2.], [1., 1.]];
    assert_eq!(polygon(&line).triangles, fan(4));
    let eight = [[0., 0.], [1., 1.], [1., 0.], [0., 1.]];
    assert_eq!(polygon(&eight).triangles, fan(4));
}

#[test]
fn polygons_of_many_corners_take_no_time() {
    // A comb of so many teeth.
    let comb = |teeth: u32| {
        let tooth = |i: u32| [[f64::from(i) + 0.5, 5.0], [f64::from(i), 0.0]];
        let mut corners = vec![[0.0, -1.0], [f64::from(teeth), -1.0]];
        corners.extend((0..teeth).rev().flat_map(tooth));
        corners
    };
    let mesh = polygon(&comb(2000));
    assert_eq!(mesh.triangles.len(), 4000);
    assert!(normals(&mesh).iter().all(|n| n.z > 0.0));
    // It is too large to be cut well.
    assert_eq!(polygon(&comb(200_000)).triangles, fan(400_002));
}

#[test]
fn bad_obj_files_say_where() {
    let with = |rest: &str| message("a.obj", format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{rest}"));
    assert_eq!(
        with("f 1 2 4\n"),
        "a.obj, line 4: a face uses corner 4, but the file has 3; is it cut off?"
    );
    assert_eq!(
        with("f 1 2 0\n"),
        "a.obj, line 4: corners are counted from 1; this face uses 0"
    );
    assert_eq!(
        with("f 1 2 -4\n"),
        "a.obj, line 4: a face uses corner -4, but 3 come before it; is the file cut off?"
    );
    assert_eq!(
        with("f 1 2 x\n"),
        "a.obj, line 4: expected a corner such as 7/1/3, found `x`"
    );
    assert_eq!(
        with("v 1 2\n"),
        "a.obj, line 4: a corner needs three coordinates"
    );
    assert_eq!(
        with("v 1 2 inf\n"),
        "a.obj, line 4: the coordinate inf is not finite; remove the corner and its faces"
    );
    assert!(with("").starts_with("a.obj: 3 corners but no triangle"));
    assert!(message("a.stl", "").starts_with("a.stl: meshes are read from"));
}

#[test]
fn what_editors_put_before_text_is_passed_over() {
    // The last corner is no face's: were the first lost, nothing would be said.
    let corners: [[f32; 3]; 4] = [[0.; 3], [1., 0., 0.], [0., 1., 0.], [9.; 3]];
    let lines = |start: &str| {
        corners
            .map(|[x, y, z]| format!("{start}{x} {y} {z}\n"))
            .concat()
    };
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
         property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
         {}3 0 1 2\n",
        lines("")
    );
    for (name, text) in [
        ("a.obj", lines("v ") + "f 1 2 3\n"),
        ("a.ply", ply),
        ("a.gltf", gltf(4, Some(&[0, 1, 2]), &corners, ONE_NODE)),
    ] {
        let mesh = parse(name, format!("\u{feff}{text}")).unwrap();
        let expected = corners.map(|corner| DVec3::from_array(corner.map(f64::from)));
        assert_eq!(
            (mesh.positions, mesh.triangles),
            (expected.to_vec(), vec![[0, 1, 2]]),
            "{name}"
        );
    }
}

/// A mesh far from the origin, as in UTM metres.
fn far_mesh() -> Mesh {
    let origin = DVec3::new(500_123.456_789, 5_400_321.987_654, 312.3);
    let position = |i: usize| {
        origin
            + DVec3::new(
                (i % 5) as f64 * 1.37,
                (i / 5) as f64 * 0.91,
                (i as f64).sin(),
            )
    };
    Mesh {
        positions: (0..20).map(position).collect(),
        triangles: (0..18).map(|i| [i, i + 1, i + 2]).collect(),
    }
}

fn camera() -> View {
    View {
        lens: Lens::pinhole(DVec2::new(500.0, 510.0), DVec2::new(320.0, 240.0)),
        width: 640,
        height: 480,
        camera_from_world: Rigid3::looking_at(
            DVec3::new(500_120.0, 5_400_320.0, 320.0),
            far_mesh().positions[7],
            DVec3::Z,
        ),
    }
}

#[test]
fn files_give_back_what_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = far_mesh();
    for (name, allowed) in [("a.ply", 0.0), ("a.glb", 1e-6)] {
        let path = folder.path().join(name);
        let cameras = [("one.jpg".to_owned(), camera())];
        mesh::write(&path, &mesh, &cameras, Some(r#"{"version": 1}"#.to_owned())).unwrap();
        let back = mesh::read(&path).unwrap();
        assert_eq!(back.triangles, mesh.triangles);
        for (a, b) in back.positions.iter().zip(&mesh.positions) {
            assert!((*a - *b).length() <= allowed, "{name}: {a} for {b}");
        }
    }
    assert_eq!(
        std::fs::read_dir(folder.path()).unwrap().count(),
        2,
        "nothing left behind"
    );
    let error = mesh::write(&folder.path().join("a.obj"), &mesh, &[], None).unwrap_err();
    assert!(error.to_string().contains("written as .glb and .ply"));
}

/// What a strict reader of glTF sees.
fn checked(bytes: &[u8]) -> gltf::Document {
    gltf::Gltf::from_slice(bytes).unwrap().document
}

#[test]
fn cameras_of_a_glb_look_where_the_photos_did() {
    let view = camera();
    let cameras = [("one.jpg".to_owned(), view.clone())];
    let bytes = mesh::to_glb(&far_mesh(), &cameras, None).unwrap();
    let document = checked(&bytes);
    let root = document.default_scene().unwrap().nodes().next().unwrap();
    assert!(root.mesh().is_some(), "the mesh's node is first");
    let node = root.children().next().unwrap();
    assert_eq!(node.name(), Some("one.jpg"));
    let world_from_node = |node: &gltf::Node| {
        let columns = node.transform().matrix().map(|c| c.map(f64::from));
        DMat4::from_cols_array_2d(&columns)
    };
    let world_from_camera = world_from_node(&root) * world_from_node(&node);
    // A metre is a third of the rounding of f32 in UTM; the part within the scene is not.
    assert!((world_from_camera.w_axis.truncate() - view.center()).length() < 1.0);
    let forward = world_from_camera.transform_vector3(DVec3::NEG_Z);
    assert!((forward - view.forward()).length() < 1e-6);
    let up = world_from_camera.transform_vector3(DVec3::Y);
    assert!((up - view.up()).length() < 1e-6);
    let camera = node.camera().unwrap();
    let gltf::camera::Projection::Perspective(lens) = camera.projection() else {
        panic!("a perspective camera");
    };
    let tan = f64::from(lens.yfov() / 2.0).tan();
    assert!((tan - 240.0 / 510.0).abs() < 1e-6);
    let aspect = f64::from(lens.aspect_ratio().unwrap());
    assert!((aspect * tan - 320.0 / 500.0).abs() < 1e-6);
}

#[test]
fn what_a_glb_cannot_hold_is_refused() {
    let error = |mesh: &Mesh, cameras: &[(String, View)], extras: Option<&str>| {
        let extras = extras.map(str::to_owned);
        mesh::to_glb(mesh, cameras, extras).unwrap_err().to_string()
    };
    assert!(error(&Mesh::default(), &[], None).contains("no triangle"));
    let mut bad = triangle();
    bad.positions[1].y = f64::NAN;
    assert!(error(&bad, &[], None).starts_with("corner "));
    assert!(error(&triangle(), &[], Some("{")).contains("JSON"));
    let mut view = camera();
    view.camera_from_world.translation.x = f64::INFINITY;
    assert!(error(&triangle(), &[("a.jpg".to_owned(), view)], None).contains("a.jpg"));
}

#[test]
fn a_mesh_elsewhere_is_not_where_cameras_look() {
    let mesh = far_mesh();
    let views = [camera()];
    let here = mesh::lies_where_cameras_look(&solid(&mesh), &views);
    assert!(here > 0.03, "{here}");
    let mut y_up = mesh.clone();
    y_up.transform(&DMat4::from_rotation_x(-std::f64::consts::FRAC_PI_2));
    assert_eq!(mesh::lies_where_cameras_look(&solid(&y_up), &views), 0.0);
    assert_eq!(mesh::lies_where_cameras_look(&solid(&mesh), &[]), 0.0);
    // A wall that reaches behind the camera.
    let behind = |x: f64, y: f64| {
        views[0].center() + views[0].forward() * 0.01 + DVec3::new(x, y, 0.0) * 1e6
    };
    let mut wall = triangle();
    wall.positions = vec![behind(-1.0, -1.0), behind(1.0, -1.0), behind(0.0, 1.0)];
    let met = mesh::lies_where_cameras_look(&solid(&wall), &views);
    assert!(met > 0.9, "{met}");
}

#[test]
fn a_house_is_imported_and_lies_around_its_cameras() {
    let Some(house) = common::find_capture("interior-house") else {
        return;
    };
    let mesh = mesh::read(&house.join("house.glb")).unwrap();
    assert!(mesh.triangles.len() > 1000, "{}", mesh.triangles.len());
    let capture = common::capture(&common::find_capture("house-walk").unwrap());
    let views: Vec<View> = capture
        .held_out
        .iter()
        .map(|(view, _)| view.clone())
        .collect();
    let met = mesh::lies_where_cameras_look(&solid(&mesh), &views);
    // The rest of the rays leave through the windows.
    let depths: Vec<f32> = capture
        .held_out
        .iter()
        .flat_map(|f| common::decode(f).unwrap().1.depths)
        .collect();
    let known = depths.iter().filter(|d| **d > 0.0).count() as f64 / depths.len() as f64;
    assert!((met - known).abs() < 0.02, "{met} {known}");
    // Its photos were rendered from it.
    let errors = common::errors(&mesh, &capture.held_out[..1], 0.01);
    assert!(errors.percentile_95 < 0.001, "{errors:?}");
}

proptest! {
    /// Whatever its first corner sees of it, the triangles of a star are it: they are all the same way
    /// round, and their areas add up to its.
    #[test]
    fn stars_are_cut_into_themselves(
        radii in prop::collection::vec(0.05..1.0_f64, 3..60), down: bool,
    ) {
        let turn = std::f64::consts::TAU / radii.len() as f64;
        let corner = |(i, radius): (usize, &f64)| {
            let (sin, cos) = (turn * i as f64).sin_cos();
            [radius * cos, if down { -radius * sin } else { radius * sin }]
        };
        let corners: Vec<[f64; 2]> = radii.iter().enumerate().map(corner).collect();
        let flat: Vec<f64> = normals(&polygon(&corners)).iter().map(|n| n.z).collect();
        prop_assert_eq!(flat.len(), corners.len() - 2);
        let covered: f64 = flat.iter().map(|a| a.abs()).sum();
        let next = radii.iter().cycle().skip(1);
        let area: f64 = radii.iter().zip(next).map(|(a, b)| a * b * turn.sin()).sum();
        prop_assert!((covered / area - 1.0).abs() < 5e-5, "{} {}", covered, area);
    }

    #[test]
    fn any_mesh_survives_every_file(
        corners in prop::collection::vec(prop::array::uniform3(-1e7..1e7_f64), 3..40),
        triangles in prop::collection::vec(prop::array::uniform3(0..1000_u32), 1..40),
    ) {
        let count = corners.len() as u32;
        let mesh = Mesh {
            positions: corners.iter().map(|p| DVec3::from_array(*p)).collect(),
            triangles: triangles.iter().map(|t| t.map(|i| i % count)).collect(),
        };
        prop_assert_eq!(&parse("a.ply", mesh::to_ply(&mesh, None, "any")).unwrap(), &mesh);
        let bytes = mesh::to_glb(&mesh, &[], None).unwrap();
        checked(&bytes);
        let back = parse("a.glb", bytes).unwrap();
        prop_assert_eq!(&back.triangles, &mesh.triangles);
        for (a, b) in back.positions.iter().zip(&mesh.positions) {
            prop_assert!((*a - *b).length() < 2.0, "{} for {}", a, b);
        }
    }

    #[test]
    fn no_cut_or_changed_file_panics(at in 0..1000_usize, value: u8, kind in 0..2_usize) {
        let mesh = far_mesh();
        let (name, mut bytes) = match kind {
            0 => ("a.ply", mesh::to_ply(&mesh, None, "any")),
            _ => ("a.glb", mesh::to_glb(&mesh, &[], None).unwrap()),
        };
        let at = at * (bytes.len() - 1) / 999;
        let _ = parse(name, &bytes[..at]);
        bytes[at] = value;
        let _ = parse(name, &bytes);
    }
}
