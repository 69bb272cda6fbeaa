//! Copies of a glTF node's mesh, which `EXT_mesh_gpu_instancing` tells of.

use base64::Engine;
use glam::{DQuat, DVec3};
use proxy::mesh::{self, Mesh};
use serde_json::{Map, Value, json};
use std::f64::consts::FRAC_PI_2;
use std::path::Path;

/// What there is one of for each copy.
struct Attribute {
    name: &'static str,
    components: usize,
    component_type: u32,
    count: usize,
    bytes: Vec<u8>,
}

fn floats<const N: usize>(name: &'static str, numbers: &[[f32; N]]) -> Attribute {
    let bytes = numbers.as_flattened().iter().flat_map(|x| x.to_le_bytes());
    Attribute {
        name,
        components: N,
        component_type: 5126,
        count: numbers.len(),
        bytes: bytes.collect(),
    }
}

fn normalized(name: &'static str, numbers: &[[i16; 4]]) -> Attribute {
    let bytes = numbers.as_flattened().iter().flat_map(|x| x.to_le_bytes());
    Attribute {
        name,
        components: 4,
        component_type: 5122,
        count: numbers.len(),
        bytes: bytes.collect(),
    }
}

/// A node that is twice as large as its triangle, at (10, 0, 0), and as often there as attributes say.
fn file(attributes: &[Attribute]) -> Value {
    let corners = floats("POSITION", &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let mut bytes = Vec::new();
    let (mut accessors, mut views) = (Vec::new(), Vec::new());
    for attribute in std::iter::once(&corners).chain(attributes) {
        accessors.push(json!({
            "bufferView": views.len(),
            "componentType": attribute.component_type,
            "normalized": attribute.component_type != 5126,
            "type": format!("VEC{}", attribute.components),
            "count": attribute.count,
        }));
        let length = attribute.bytes.len();
        views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": length}));
        bytes.extend(&attribute.bytes);
    }
    let numbered = attributes.iter().zip(1_u32..);
    let numbered: Map<String, Value> = numbered
        .map(|(attribute, number)| (attribute.name.to_owned(), Value::from(number)))
        .collect();
    let text = base64::engine::general_purpose::STANDARD.encode(&bytes);
    json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["EXT_mesh_gpu_instancing"],
        "nodes": [{"mesh": 0, "translation": [10, 0, 0], "scale": [2, 2, 2],
            "extensions": {"EXT_mesh_gpu_instancing": {"attributes": numbered}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": bytes.len(), "uri": format!("data:;base64,{text}")}],
    })
}

fn read(file: &Value) -> Result<Mesh, String> {
    let bytes = file.to_string().into_bytes();
    mesh::parse(Path::new("c.gltf"), &bytes).map_err(|e| e.to_string())
}

const TRANSLATIONS: [[f32; 3]; 3] = [[0.0; 3], [5.0, 0.0, 0.0], [0.0, 7.0, 1.0]];
const SCALES: [[f32; 3]; 3] = [[1.0; 3], [1.0, 2.0, 3.0], [-1.0, 1.0, 1.0]];
/// The second is a quarter of a turn around z.
const ROTATIONS: [[i16; 4]; 3] = [[0, 0, 0, 32767], [0, 0, 23170, 23170], [0, 0, 0, 32767]];

fn all() -> Value {
    file(&[
        floats("TRANSLATION", &TRANSLATIONS),
        normalized("ROTATION", &ROTATIONS),
        floats("SCALE", &SCALES),
        // Somebody's own.
        floats("_AGE", &[[1.0, 2.0]; 3]),
    ])
}

#[test]
fn copies_of_a_mesh_are_where_they_are_said_to_be() {
    let mesh = read(&all()).unwrap();
    assert_eq!((mesh.triangles.len(), mesh.positions.len()), (3, 9));
    for i in 0..3 {
        let [t, s] = [TRANSLATIONS[i], SCALES[i]].map(|v| DVec3::from_array(v.map(f64::from)));
        let turn = DQuat::from_rotation_z(if i == 1 { FRAC_PI_2 } else { 0.0 });
        for (k, corner) in [DVec3::ZERO, DVec3::X, DVec3::Y].into_iter().enumerate() {
            let expected = 10.0 * DVec3::X + 2.0 * (t + turn * (s * corner));
            let found = mesh.positions[3 * i + k];
            assert!((found - expected).length() < 1e-9, "{i}: {found}");
        }
        // The outside stays outside where a copy is mirrored.
        let [a, b, c] = mesh.corners(i);
        assert!((b - a).cross(c - a).z > 0.0, "{i}");
    }
    // Where the extension is required as well.
    let mut required = all();
    required["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    assert_eq!(read(&required).unwrap(), mesh);
    // What is below the node is not copied.
    let mut with_child = all();
    with_child["nodes"][0]["children"] = json!([1]);
    let nodes = with_child["nodes"].as_array_mut().unwrap();
    nodes.push(json!({"mesh": 0}));
    assert_eq!(read(&with_child).unwrap().triangles.len(), 4);
    // Each attribute may be lacking, and all of them.
    let moved = read(&file(&[floats("TRANSLATION", &TRANSLATIONS)])).unwrap();
    assert_eq!(moved.positions[3], DVec3::new(20.0, 0.0, 0.0));
    assert_eq!(read(&file(&[])).unwrap().triangles.len(), 1);
}

#[test]
fn copies_look_alike_and_what_they_lack_is_told_once() {
    let mut file = all();
    let (model, warnings) = looks(&file);
    assert_eq!(warnings, [""; 0]);
    assert_eq!(model.mesh, read(&file).unwrap());
    let parts: Vec<_> = model.parts.iter().map(|p| p.triangles.clone()).collect();
    assert_eq!(parts, [0..1, 1..2, 2..3]);
    assert!(model.parts.iter().all(|p| p.node_idx == 0));
    assert_eq!((model.uvs.len(), model.colors.len()), (9, 9));
    // A texture without coordinates.
    file["meshes"][0]["primitives"][0]["material"] = json!(0);
    file["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    file["textures"] = json!([{"source": 0}]);
    let png = "iVBORw0KGgoAAAANSUhEUgAAAAMAAAACCAIAAAASFvFNAAAAFUlEQVR4nGPkPMHMwMDAwMDAxAADAA8qANgo7\
               Df8AAAAAElFTkSuQmCC";
    file["images"] = json!([{"uri": format!("data:image/png;base64,{png}")}]);
    assert_eq!(
        looks(&file).1,
        ["mesh 0, primitive 0 has a texture but no texture coordinates"]
    );
    // All copies of what nobody could see are left out.
    let invisible =
        json!({"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0]}});
    file["materials"] = json!([invisible]);
    let bytes = file.to_string().into_bytes();
    let error = mesh::parse_model(Path::new("c.gltf"), &bytes).unwrap_err();
    let said = "c.gltf: all its triangles (3) are invisible";
    assert!(error.to_string().starts_with(said), "{error}");
}

fn looks(file: &Value) -> (mesh::Model, Vec<String>) {
    mesh::parse_model(Path::new("c.gltf"), &file.to_string().into_bytes()).unwrap()
}

#[test]
fn bad_copies_say_where() {
    let message = |attributes: &[Attribute]| read(&file(attributes)).unwrap_err();
    let translations = || floats("TRANSLATION", &TRANSLATIONS);
    assert_eq!(
        message(&[translations(), floats("SCALE", &SCALES[..2])]),
        "c.gltf, node 0: its copies (EXT_mesh_gpu_instancing) have 3 translations and 2 scales; \
         export the model again"
    );
    assert_eq!(
        message(&[floats("ROTATION", &TRANSLATIONS)]),
        "c.gltf, accessor 1: rotations must be of type VEC4"
    );
    assert_eq!(
        message(&[floats("SCALE", &[[1.0; 4]])]),
        "c.gltf, accessor 1: scales must be of type VEC3"
    );
    let broken = [[0.0, 0.0, 0.0, 1.0], [0.0, f32::NAN, 0.0, 1.0]];
    assert_eq!(
        message(&[floats("ROTATION", &broken)]),
        "c.gltf, node 0: the transform of its copy 1 is not finite"
    );
    // However little each of them shows, they cannot be repeated without end.
    let mut many = file(&[floats("TRANSLATION", &[[0.0; 3]; 400])]);
    many["meshes"][0]["primitives"][0]["mode"] = json!(1);
    many["nodes"] = Value::from(vec![many["nodes"][0].clone(); 400]);
    let error = read(&many).unwrap_err();
    let said = "nodes repeat meshes until they take";
    assert!(
        error.starts_with("c.gltf, node ") && error.contains(said),
        "{error}"
    );
}
