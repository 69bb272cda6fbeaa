//! glTF 2.0 binary, written by way of the `gltf` crate's types.

use super::model_glb::{container, file_size};
use super::{ExportError, Mesh};
use calibrate::View;
use glam::{DQuat, DVec3, Vec3};
use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::{self, validation::Checked::Valid, validation::USize64};

/// A mesh as GLB, with its cameras, for looking at elsewhere.
///
/// The first node holds the mesh and `extras` (JSON text). Positions are f32 and relative to
/// that node, which stands amid the mesh: in UTM metres, too, they keep millimetres. The cameras are its children: the vertical field of view and aspect of each
/// lens without its distortion, looking along −z with y up as glTF has it. Coordinates are
/// the world's, whatever way up it is. Triangles are seen from both sides.
///
/// # Errors
/// An empty mesh, numbers that are not finite, 4 GiB and more, extras that are no JSON.
pub fn to_glb(
    mesh: &Mesh,
    cameras: &[(String, View)],
    extras: Option<String>,
) -> Result<Vec<u8>, ExportError> {
    let (low, high) = match mesh.bounds() {
        Some(bounds) if !mesh.triangles.is_empty() => bounds,
        _ => return Err(ExportError::Empty),
    };
    let translation = (low.midpoint(high)).as_vec3();
    // What the file's text says, which those who read it in f64 will take.
    let as_written = |x: f32| x.to_string().parse().unwrap_or_else(|_| f64::from(x));
    let origin = DVec3::from_array(translation.to_array().map(as_written));
    let corners: Vec<Vec3> = mesh
        .positions
        .iter()
        .map(|p| (*p - origin).as_vec3())
        .collect();
    let is_bad = |p: &Vec3| !p.is_finite() || !translation.is_finite();
    if let Some(i) = corners.iter().position(is_bad) {
        return Err(ExportError::Position(i, mesh.positions[i]));
    }
    // 1. The bytes, twelve a corner and twelve a triangle.
    let bytes = 12 * (corners.len() + mesh.triangles.len());
    file_size(0, bytes, ExportError::TooLarge)?;
    let mut data = Vec::with_capacity(bytes);
    data.extend(
        corners
            .iter()
            .flat_map(Vec3::to_array)
            .flat_map(f32::to_le_bytes),
    );
    let positions_length = data.len();
    let indices = mesh.triangles.as_flattened().iter();
    data.extend(indices.flat_map(|i| i.to_le_bytes()));
    // 2. What they are.
    let mut root = json::Root::default();
    root.asset.generator = Some("lumigraph".to_owned());
    let buffer = root.push(json::Buffer {
        byte_length: USize64::from(data.len()),
        name: None,
        uri: None,
        extensions: None,
        extras: None,
    });
    let mut view = |from: usize, to: usize, target| {
        root.push(json::buffer::View {
            buffer,
            byte_length: USize64::from(to - from),
            byte_offset: Some(USize64::from(from)),
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
        data.len(),
        json::buffer::Target::ElementArrayBuffer,
    );
    let bound = |pick: fn(Vec3, Vec3) -> Vec3| {
        let bound = corners.iter().copied().reduce(pick).unwrap_or_default();
        Some(json::serialize::to_value(bound.to_array()).unwrap_or_default())
    };
    let accessor = |view, count: usize, component, shape, [min, max]: [_; 2]| json::Accessor {
        buffer_view: Some(view),
        byte_offset: Some(USize64(0)),
        count: USize64::from(count),
        component_type: Valid(GenericComponentType(component)),
        extensions: None,
        extras: None,
        type_: Valid(shape),
        min,
        max,
        name: None,
        normalized: false,
        sparse: None,
    };
    let bounds = [bound(Vec3::min), bound(Vec3::max)];
    let positions = accessor(
        positions_view,
        corners.len(),
        ComponentType::F32,
        Type::Vec3,
        bounds,
    );
    let positions = root.push(positions);
    let count = 3 * mesh.triangles.len();
    let none = [None, None];
    let indices = accessor(indices_view, count, ComponentType::U32, Type::Scalar, none);
    let indices = root.push(indices);
    // Viewers leave out backs otherwise, and which side of a plane is its front means nothing.
    let material = root.push(json::Material {
        double_sided: true,
        ..Default::default()
    });
    let shape = root.push(json::Mesh {
        extensions: None,
        extras: None,
        name: Some("proxy".to_owned()),
        primitives: vec![json::mesh::Primitive {
            attributes: [(Valid(json::mesh::Semantic::Positions), positions)].into(),
            extensions: None,
            extras: None,
            indices: Some(indices),
            material: Some(material),
            mode: Valid(json::mesh::Mode::Triangles),
            targets: None,
        }],
        weights: None,
    });
    // 3. Nodes; the mesh's comes first, where it is looked for.
    let raw = extras.map(serde_json::value::RawValue::from_string);
    let node = root.push(json::Node {
        mesh: Some(shape),
        name: Some("lumigraph proxy".to_owned()),
        translation: Some(translation.to_array()),
        extras: raw.transpose().map_err(ExportError::Extras)?,
        ..Default::default()
    });
    let mut nodes = Vec::with_capacity(cameras.len());
    let near = (high - low).length() * 1e-3;
    for (name, view) in cameras {
        nodes.push(camera(&mut root, name, view, origin, near)?);
    }
    root.nodes[node.value()].children = (!nodes.is_empty()).then_some(nodes);
    let scene = root.push(json::Scene {
        extensions: None,
        extras: None,
        name: None,
        nodes: vec![node],
    });
    root.scene = Some(scene);
    // 4. The file.
    let text = json::serialize::to_string(&root).map_err(ExportError::Extras)?;
    container(text.into_bytes(), data, ExportError::TooLarge)
}

/// A camera's node, relative to `origin`.
fn camera(
    root: &mut json::Root,
    name: &str,
    view: &View,
    origin: DVec3,
    near: f64,
) -> Result<json::Index<json::Node>, ExportError> {
    let focal = view.lens.focal;
    // tan of half the field of view.
    let (across, down) = (
        f64::from(view.width) / (2.0 * focal.x),
        f64::from(view.height) / (2.0 * focal.y),
    );
    let translation = (view.center() - origin).as_vec3();
    let (yfov, aspect) = ((2.0 * down.atan()) as f32, (across / down) as f32);
    let is_sound = yfov > 0.0 && aspect > 0.0 && aspect.is_finite() && translation.is_finite();
    if !is_sound || !view.camera_from_world.is_finite() {
        return Err(ExportError::Camera(name.to_owned()));
    }
    let camera = root.push(json::Camera {
        name: Some(name.to_owned()),
        orthographic: None,
        perspective: Some(json::camera::Perspective {
            aspect_ratio: Some(aspect),
            yfov,
            zfar: None,
            znear: (near as f32).max(f32::MIN_POSITIVE),
            extensions: None,
            extras: None,
        }),
        type_: Valid(json::camera::Type::Perspective),
        extensions: None,
        extras: None,
    });
    // glTF's cameras have y up and look along −z: half a turn about x.
    let half_turn = DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0);
    let world_from_camera = view.camera_from_world.rotation.conjugate() * half_turn;
    let rotation = world_from_camera.normalize().as_quat().to_array();
    Ok(root.push(json::Node {
        camera: Some(camera),
        name: Some(name.to_owned()),
        rotation: Some(json::scene::UnitQuaternion(rotation)),
        translation: Some(translation.to_array()),
        ..Default::default()
    }))
}
