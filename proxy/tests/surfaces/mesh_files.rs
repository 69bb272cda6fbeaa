//! Mesh files: that they give back what was written, and what a glTF file holds beside a mesh.

use crate::common;
use crate::mesh_gltf::{ONE_NODE, gltf};

use calibrate::{Lens, Rigid3, View};
use glam::{DMat4, DVec2, DVec3};
use proptest::prelude::*;
use proxy::mesh::{self, Mesh};
use proxy::{MeshKind, Solid};
use std::path::Path;

pub(crate) fn parse(name: &str, bytes: impl AsRef<[u8]>) -> Result<Mesh, String> {
    mesh::parse(Path::new(name), bytes.as_ref()).map_err(|e| e.to_string())
}

pub(crate) fn message(name: &str, bytes: impl AsRef<[u8]>) -> String {
    parse(name, bytes).unwrap_err()
}

fn solid(mesh: &Mesh) -> Solid {
    Solid::new(MeshKind::Mesh, mesh.clone())
}

pub(crate) fn triangle() -> Mesh {
    Mesh {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
        triangles: vec![[0, 1, 2]],
    }
}

pub(crate) const SQUARE: [[f32; 3]; 4] = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [1., 1., 0.]];

pub(crate) fn normals(mesh: &Mesh) -> Vec<DVec3> {
    let normal = |i| {
        let [a, b, c] = mesh.corners(i);
        (b - a).cross(c - a)
    };
    (0..mesh.triangles.len()).map(normal).collect()
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

/// Which side a plane's normal is on is chance, and cameras may be on either.
#[test]
fn a_glb_is_seen_from_both_sides() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plane.glb");
    let of_plane = |normal: DVec3| {
        let plane = proxy::Plane::new(DVec3::ZERO, normal).unwrap();
        proxy::write(&path, &proxy::Proxy::Plane(plane), &[], &[]).unwrap();
        std::fs::read(&path).unwrap()
    };
    for bytes in [
        of_plane(DVec3::Z),
        of_plane(DVec3::NEG_Z),
        mesh::to_glb(&far_mesh(), &[], None).unwrap(),
    ] {
        let document = checked(&bytes);
        let mut primitives = document.meshes().flat_map(|mesh| mesh.primitives());
        assert!(primitives.all(|part| part.material().double_sided()));
    }
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
