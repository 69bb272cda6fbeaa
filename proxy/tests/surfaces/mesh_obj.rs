//! Meshes of OBJ files: faces of every form, polygons of any shape, and what is said of bad ones.

use crate::mesh_files::{message, normals, parse};

use proptest::prelude::*;
use proxy::mesh::Mesh;

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
fn obj_capitals_are_read_and_utf_16_is_told() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1 2 3\n";
    let expected = parse("a.obj", text).unwrap();
    assert_eq!(parse("a.obj", text.to_uppercase()).unwrap(), expected);
    for to_bytes in [u16::to_le_bytes, u16::to_be_bytes] {
        let codes = std::iter::once(0xfeff).chain(text.encode_utf16());
        let bytes: Vec<u8> = codes.flat_map(to_bytes).collect();
        assert_eq!(
            message("a.obj", bytes),
            "a.obj: its text is UTF-16, which is not read; save it as UTF-8"
        );
    }
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
}
