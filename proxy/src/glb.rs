//! glTF 2.0 binary, by way of the `gltf` crate.

use crate::Plane;
use glam::DVec3;
use gltf::binary::{Glb, Header};
use gltf::json::{self, validation::Checked::Valid, validation::USize64};
use std::borrow::Cow;

/// The extras of the first node, as JSON text.
pub(crate) fn extras(bytes: &[u8]) -> Result<String, String> {
    // gltf 1.4 takes the header's 12 bytes off the length that it states, however short.
    if let Some([b'g', b'l', b'T', b'F', _, _, _, _, length @ ..]) = bytes.first_chunk::<12>()
        && (u32::from_le_bytes(*length) as usize) < 12
    {
        return Err("not a glTF file: its header states a length without itself".to_owned());
    }
    // Only the extras matter, and the check of the rest looks up what may not be there.
    let gltf = gltf::Gltf::from_slice_without_validation(bytes)
        .map_err(|e| format!("not a glTF file: {e}"))?;
    let extras = gltf.nodes().next().and_then(|node| node.extras().clone());
    extras.map(|raw| raw.get().to_owned()).ok_or_else(|| {
        "this mesh does not say which lumigraph proxy it shows; \
         export the proxy again with `lumigraph proxy … -o FILE.json`"
            .to_owned()
    })
}

/// The part of a plane around the given points, as a square of two triangles.
///
/// Positions are f32 and relative to the plane's point, which is the node's translation:
/// glTF has no doubles. The exact plane travels in the node's `extras`.
pub(crate) fn quad(plane: &Plane, shown: &[DVec3], extras: String) -> Result<Vec<u8>, String> {
    // A square large enough for the points' feet on the plane, leaving out the farthest
    // few per cent, which may be anywhere.
    let across = plane.normal().any_orthonormal_vector();
    let along = plane.normal().cross(across);
    let mut reach: Vec<f64> = shown
        .iter()
        .map(|p| *p - plane.point())
        .map(|v| v.dot(across).hypot(v.dot(along)))
        .collect();
    reach.retain(|r| r.is_finite());
    reach.sort_by(f64::total_cmp);
    let half = match reach.len() {
        0 => 1.0,
        n => (reach[(n * 95 / 100).min(n - 1)] * 1.2).max(1e-6),
    };
    let corner = |x: f64, y: f64| {
        (across * (x * half) + along * (y * half))
            .as_vec3()
            .to_array()
    };
    let corners = [
        corner(-1.0, -1.0),
        corner(1.0, -1.0),
        corner(1.0, 1.0),
        corner(-1.0, 1.0),
    ];
    let indices: [u16; 6] = [0, 1, 2, 0, 2, 3];
    let mut data: Vec<u8> = Vec::new();
    data.extend(corners.iter().flatten().flat_map(|v| v.to_le_bytes()));
    let positions_length = data.len();
    data.extend(indices.iter().flat_map(|i| i.to_le_bytes()));

    let mut root = json::Root::default();
    let buffer = root.push(json::Buffer {
        byte_length: USize64::from(data.len()),
        name: None,
        uri: None,
        extensions: None,
        extras: None,
    });
    let mut view = |offset: usize, length: usize, target| {
        root.push(json::buffer::View {
            buffer,
            byte_length: USize64::from(length),
            byte_offset: Some(USize64::from(offset)),
            byte_stride: None,
            name: None,
            target: Some(Valid(target)),
            extensions: None,
            extras: None,
        })
    };
    let positions_view = view(0, positions_length, json::buffer::Target::ArrayBuffer);
    let indices_view = view(
        positions_length,
        12,
        json::buffer::Target::ElementArrayBuffer,
    );
    let bound = |pick: fn(f32, f32) -> f32| {
        let axis = |k: usize| corners.iter().map(|c| c[k]).reduce(pick).unwrap_or(0.0);
        Some(json::serialize::to_value([axis(0), axis(1), axis(2)]).unwrap_or_default())
    };
    let accessor = |view, count: usize, component, shape, min, max| json::Accessor {
        buffer_view: Some(view),
        byte_offset: Some(USize64(0)),
        count: USize64::from(count),
        component_type: Valid(json::accessor::GenericComponentType(component)),
        extensions: None,
        extras: None,
        type_: Valid(shape),
        min,
        max,
        name: None,
        normalized: false,
        sparse: None,
    };
    use json::accessor::{ComponentType, Type};
    let positions = root.push(accessor(
        positions_view,
        4,
        ComponentType::F32,
        Type::Vec3,
        bound(f32::min),
        bound(f32::max),
    ));
    let indices = root.push(accessor(
        indices_view,
        6,
        ComponentType::U16,
        Type::Scalar,
        None,
        None,
    ));
    let mesh = root.push(json::Mesh {
        extensions: None,
        extras: None,
        name: Some("plane".to_owned()),
        primitives: vec![json::mesh::Primitive {
            attributes: [(Valid(json::mesh::Semantic::Positions), positions)].into(),
            extensions: None,
            extras: None,
            indices: Some(indices),
            material: None,
            mode: Valid(json::mesh::Mode::Triangles),
            targets: None,
        }],
        weights: None,
    });
    let raw = serde_json::value::RawValue::from_string(extras).map_err(|e| e.to_string())?;
    let node = root.push(json::Node {
        mesh: Some(mesh),
        name: Some("lumigraph proxy".to_owned()),
        translation: Some(plane.point().as_vec3().to_array()),
        extras: Some(raw),
        ..Default::default()
    });
    let scene = root.push(json::Scene {
        extensions: None,
        extras: None,
        name: None,
        nodes: vec![node],
    });
    root.scene = Some(scene);

    let mut text = json::serialize::to_string(&root)
        .map_err(|e| e.to_string())?
        .into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    data.resize(data.len().next_multiple_of(4), 0);
    let length = u32::try_from(12 + 8 + text.len() + 8 + data.len()).map_err(|e| e.to_string())?;
    let glb = Glb {
        header: Header {
            magic: *b"glTF",
            version: 2,
            length,
        },
        bin: Some(Cow::Owned(data)),
        json: Cow::Owned(text),
    };
    glb.to_vec().map_err(|e| e.to_string())
}
