//! Meshes of PLY files: what is read, and what is said of bad ones.

use crate::mesh_files::{SQUARE, message, parse, triangle};

use glam::DVec3;
use proxy::mesh::Mesh;

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
