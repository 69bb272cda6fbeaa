//! Textured models as glTF 2.0 binary.

use super::model::linear_from_srgb;
use super::{ExportError, Mesh, Model, Wrap};
use glam::DVec3;
use gltf::binary::{Glb, Header};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::ops::Range;

/// A model as GLB, its textures within as PNG.
///
/// Positions are rounded to f32 in the world's own frame. Far from its origin, as in UTM metres, they
/// are relative to a place amid the model, where the nodes without a parent stand, unless f32 holds
/// them as they are. Everything else comes back from the file as it was. Nodes keep their names and
/// places in the tree.
///
/// # Errors
/// A model without triangles, positions beyond f32, 4 GiB and more.
pub fn model_to_glb(model: &Model) -> Result<Vec<u8>, ExportError> {
    if model.mesh.triangles.is_empty() {
        return Err(ExportError::Empty);
    }
    let mut file = File {
        origin: origin(&model.mesh),
        ..File::default()
    };
    // 1. Nodes: each part is a primitive of its node's mesh.
    let mut nodes: Vec<Value> = model
        .nodes
        .iter()
        .map(|node| json!({"name": node.name}))
        .collect();
    let mut meshes: Vec<Value> = Vec::new();
    let mut mesh_of_node = vec![None; model.nodes.len()];
    for part in &model.parts {
        let primitive = file.primitive(model, part.triangles.clone(), part.material_idx)?;
        let node = part.node_idx as usize;
        match mesh_of_node.get(node).copied().flatten() {
            None => {
                if let Some(slot) = mesh_of_node.get_mut(node) {
                    *slot = Some(meshes.len());
                    nodes[node]["mesh"] = json!(meshes.len());
                    meshes.push(json!({"primitives": [primitive]}));
                }
            }
            Some(mesh) => {
                if let Some(primitives) = meshes[mesh]["primitives"].as_array_mut() {
                    primitives.push(primitive);
                }
            }
        }
    }
    let mut roots = Vec::new();
    for (i, node) in model.nodes.iter().enumerate() {
        match node.parent_idx.map(|p| p as usize).filter(|p| *p < i) {
            None => {
                roots.push(i);
                if file.origin != DVec3::ZERO {
                    nodes[i]["translation"] = json!(file.origin.to_array());
                }
            }
            Some(parent) => match nodes[parent]["children"].as_array_mut() {
                Some(children) => children.push(json!(i)),
                None => nodes[parent]["children"] = json!([i]),
            },
        }
    }
    // 2. Materials.
    let mut samplers: Vec<Value> = Vec::new();
    let mut textures: Vec<Value> = Vec::new();
    let mut materials = Vec::new();
    for material in &model.materials {
        let factor = material
            .base_color
            .map(|x| linear_from_srgb(f64::from(x)) as f32);
        let mut looks = json!({
            "baseColorFactor": [factor[0], factor[1], factor[2], 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0,
        });
        if let Some(source) = material.texture_idx {
            let [s, t] = material.wrap.map(code);
            let sampler = json!({"magFilter": 9729, "minFilter": 9987, "wrapS": s, "wrapT": t});
            let sampler_idx = place(&mut samplers, sampler);
            let texture = json!({"source": source, "sampler": sampler_idx});
            looks["baseColorTexture"] = json!({"index": place(&mut textures, texture)});
        }
        materials.push(json!({"pbrMetallicRoughness": looks, "doubleSided": true}));
    }
    let mut images = Vec::new();
    for texture in &model.textures {
        let mut png = Vec::new();
        let encoder =
            PngEncoder::new_with_quality(&mut png, CompressionType::Default, FilterType::Adaptive);
        let picture = texture.picture();
        let (width, height) = picture.dimensions();
        encoder
            .write_image(&picture, width, height, ExtendedColorType::Rgba8)
            .map_err(ExportError::Picture)?;
        let view = file.view(&png, None);
        images.push(json!({"bufferView": view, "mimeType": "image/png"}));
    }
    // 3. The file.
    let mut root = json!({
        "asset": {"version": "2.0", "generator": "lumigraph"},
        "scene": 0,
        "scenes": [{"nodes": roots}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
        "accessors": file.accessors,
        "bufferViews": file.views,
        "buffers": [{"byteLength": file.data.len()}],
    });
    for (key, values) in [
        ("samplers", samplers),
        ("textures", textures),
        ("images", images),
    ] {
        // glTF has no empty arrays.
        if !values.is_empty() {
            root[key] = values.into();
        }
    }
    let text = serde_json::to_vec(&root).map_err(ExportError::Extras)?;
    container(text, file.data, ExportError::ModelTooLarge)
}

/// From so many of its own sizes away on, rounding at a model's coordinates takes three bits or more of
/// what it could keep.
const FAR: f64 = 4.0;

/// Where positions are counted from: the world's origin, or a place amid the mesh where that is far
/// away and f32 does not hold the coordinates.
fn origin(mesh: &Mesh) -> DVec3 {
    let Some((low, high)) = mesh.bounds() else {
        return DVec3::ZERO;
    };
    let size = (high - low).max_element();
    let reach = low.abs().max(high.abs()).max_element();
    let is_held = |p: &DVec3| p.as_vec3().as_dvec3() == *p;
    if !(reach > FAR * size) || mesh.positions.iter().all(is_held) {
        return DVec3::ZERO;
    }
    // A multiple of a sixteenth of the power of two in its size: of few digits, so that a model that is
    // read and written again is moved to the same place.
    let power = f64::from_bits(size.to_bits() & f64::INFINITY.to_bits());
    let step = power / 16.0;
    let amid = (low.midpoint(high) / step).round() * step;
    match amid.is_finite() {
        true => amid,
        false => DVec3::ZERO,
    }
}

/// JSON and bytes as GLB; `too_large` says that they are, with how many bytes they take.
pub(super) fn container(
    mut text: Vec<u8>,
    mut data: Vec<u8>,
    too_large: fn(usize) -> ExportError,
) -> Result<Vec<u8>, ExportError> {
    let length = file_size(text.len(), data.len(), too_large)?;
    text.resize(text.len().next_multiple_of(4), b' ');
    data.resize(data.len().next_multiple_of(4), 0);
    let glb = Glb {
        header: Header {
            magic: *b"glTF",
            version: 2,
            length,
        },
        bin: Some(Cow::Owned(data)),
        json: Cow::Owned(text),
    };
    glb.to_vec().map_err(|_| too_large(length as usize))
}

/// What a GLB of so many bytes of JSON and of data takes, which its header holds in 32 bits.
pub(super) fn file_size(
    text: usize,
    data: usize,
    too_large: fn(usize) -> ExportError,
) -> Result<u32, ExportError> {
    let chunks = [text, data].map(|bytes| 8 + bytes.next_multiple_of(4));
    let length = 12 + chunks[0] + chunks[1];
    u32::try_from(length).map_err(|_| too_large(length))
}

/// Where a value is in a list; it is added if it was not there.
fn place(list: &mut Vec<Value>, value: Value) -> usize {
    let found = list.iter().position(|v| *v == value);
    found.unwrap_or_else(|| {
        list.push(value);
        list.len() - 1
    })
}

fn code(wrap: Wrap) -> u32 {
    match wrap {
        Wrap::Repeat => 10497,
        Wrap::Mirror => 33648,
        Wrap::Clamp => 33071,
    }
}

/// A position, texture coordinates and a colour of 16 bits a channel.
const BYTES_OF_CORNER: usize = 12 + 8 + 8;
const BYTES_OF_TRIANGLE: usize = 12;

const ARRAY: u32 = 34962;
const ELEMENTS: u32 = 34963;

/// The bytes of the file, and what they are.
#[derive(Default)]
struct File {
    /// Positions are relative to it.
    origin: DVec3,
    data: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl File {
    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        let mut view = json!({
            "buffer": 0,
            "byteOffset": self.data.len(),
            "byteLength": bytes.len(),
        });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.data.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// A run of triangles with the corners that it uses.
    fn primitive(
        &mut self,
        model: &Model,
        triangles: Range<u32>,
        material_idx: u32,
    ) -> Result<Value, ExportError> {
        let triangles = &model.mesh.triangles[triangles.start as usize..triangles.end as usize];
        let mut used: Vec<u32> = triangles.as_flattened().to_vec();
        used.sort_unstable();
        used.dedup();
        // How many bytes they take, before they are written.
        let bytes = used.len() * BYTES_OF_CORNER + triangles.len() * BYTES_OF_TRIANGLE;
        file_size(0, self.data.len() + bytes, ExportError::ModelTooLarge)?;
        let local = |i: &u32| used.binary_search(i).unwrap_or(0) as u32;
        let indices = triangles.as_flattened().iter().map(local);
        let indices: Vec<u8> = indices.flat_map(u32::to_le_bytes).collect();
        let (mut positions, mut uvs, mut colors) = (Vec::new(), Vec::new(), Vec::new());
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for corner in &used {
            let i = *corner as usize;
            let position = (model.mesh.positions[i] - self.origin).as_vec3().to_array();
            if !position.iter().all(|x| x.is_finite()) {
                return Err(ExportError::Position(i, model.mesh.positions[i]));
            }
            for k in 0..3 {
                low[k] = low[k].min(position[k]);
                high[k] = high[k].max(position[k]);
            }
            positions.extend(position.into_iter().flat_map(f32::to_le_bytes));
            uvs.extend(model.uvs[i].into_iter().flat_map(f32::to_le_bytes));
            // Light in 16 bits tells all codes apart.
            let light = |c: u8| (65535.0 * linear_from_srgb(f64::from(c) / 255.0)).round() as u16;
            let [r, g, b, _] = model.colors[i];
            let light = [light(r), light(g), light(b), u16::MAX];
            colors.extend(light.into_iter().flat_map(u16::to_le_bytes));
        }
        let count = used.len();
        let view = self.view(&positions, Some(ARRAY));
        let position = self.accessor(json!({
            "bufferView": view, "componentType": 5126, "count": count, "type": "VEC3",
            "min": low, "max": high,
        }));
        let view = self.view(&uvs, Some(ARRAY));
        let uv = self.accessor(json!({
            "bufferView": view, "componentType": 5126, "count": count, "type": "VEC2",
        }));
        let view = self.view(&colors, Some(ARRAY));
        let color = self.accessor(json!({
            "bufferView": view, "componentType": 5123, "normalized": true, "count": count,
            "type": "VEC4",
        }));
        let view = self.view(&indices, Some(ELEMENTS));
        let indices = self.accessor(json!({
            "bufferView": view, "componentType": 5125, "count": 3 * triangles.len(),
            "type": "SCALAR",
        }));
        Ok(json!({
            "attributes": {"POSITION": position, "TEXCOORD_0": uv, "COLOR_0": color},
            "indices": indices,
            "material": material_idx,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_glb_holds_what_its_header_can_tell() {
        let most = u32::MAX as usize;
        // Two chunks, and none is padded beyond what is counted.
        assert_eq!(file_size(5, 6, ExportError::TooLarge).unwrap(), 44);
        for (text, data) in [(0, 3 << 30), (100, most - 28 - 100 - 3)] {
            assert!(file_size(text, data, ExportError::TooLarge).is_ok());
        }
        for (text, data) in [
            (0, 4 << 30),
            (104, most - 28 - 100 - 3),
            (1, usize::MAX / 4),
        ] {
            assert!(file_size(text, data, ExportError::TooLarge).is_err());
        }
    }

    #[test]
    fn what_is_too_large_is_told_with_its_size_and_what_to_do() {
        let said = |too_large: fn(usize) -> ExportError| {
            let error = file_size(1000, 5 << 30, too_large).unwrap_err();
            error.to_string()
        };
        assert_eq!(
            said(ExportError::TooLarge),
            "a GLB holds less than 4 GiB, and this mesh takes at least 5368710148 bytes; simplify \
             it, or write .ply"
        );
        assert_eq!(
            said(ExportError::ModelTooLarge),
            "a GLB holds less than 4 GiB, and this model takes at least 5368710148 bytes; it must \
             be of fewer triangles: simplify the mesh that it is made of, in Blender or MeshLab, \
             or ask for fewer"
        );
    }
}
