//! How a glTF file's triangles look: base colours, textures, corners' colours, nodes' names.

use super::accessor::Accessors;
use super::buffers::fetch;
use super::{Place, Visitor};
use crate::mesh::model::srgb_from_linear;
use crate::mesh::{Material, MeshFileError, Model, ModelNode, Part, Texture, Wrap};
use image::{ImageReader, Limits, RgbaImage};
use rayon::prelude::*;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

#[derive(Deserialize)]
struct Root {
    #[serde(default)]
    nodes: Vec<Node>,
    #[serde(default)]
    meshes: Vec<MeshEntry>,
    #[serde(default)]
    materials: Vec<MaterialEntry>,
    #[serde(default)]
    textures: Vec<TextureEntry>,
    #[serde(default)]
    images: Vec<ImageEntry>,
    #[serde(default)]
    samplers: Vec<Sampler>,
}

#[derive(Deserialize)]
struct Node {
    #[serde(default)]
    name: String,
}

#[derive(Deserialize)]
struct MeshEntry {
    #[serde(default)]
    primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
struct Primitive {
    attributes: BTreeMap<String, usize>,
    material: Option<usize>,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "camelCase")]
struct MaterialEntry {
    #[serde(default)]
    pbr_metallic_roughness: Roughness,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Roughness {
    base_color_factor: Option<[f64; 4]>,
    base_color_texture: Option<TextureUse>,
}

#[derive(Clone, Deserialize)]
#[serde(rename_all = "camelCase")]
struct TextureUse {
    index: usize,
    #[serde(default)]
    tex_coord: u32,
    #[serde(default)]
    extensions: BTreeMap<String, serde::de::IgnoredAny>,
}

#[derive(Deserialize)]
struct TextureEntry {
    source: Option<usize>,
    sampler: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct ImageEntry {
    uri: Option<String>,
    buffer_view: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Sampler {
    #[serde(default)]
    wrap_s: u32,
    #[serde(default)]
    wrap_t: u32,
}

/// Reads a .glb or .gltf file with its looks. What could not be had of them is told beside the
/// model; it has a plain colour instead.
pub(in crate::mesh) fn parse_model(
    path: &Path,
    bytes: &[u8],
) -> Result<(Model, Vec<String>), MeshFileError> {
    let (json, blob) = super::split(path, bytes)?;
    // The geometry's reader looks at the JSON first, and says what is wrong with it.
    let root = super::root(path, json)?;
    let failed = |e| MeshFileError::File(path.to_owned(), format!("its materials: {e}"));
    let mut looks = Looks {
        root: Some(serde_json::from_slice(json).map_err(failed)?),
        most_encoded: super::MAX_GROWTH * bytes.len() + 65536,
        ..Looks::default()
    };
    let mesh = super::read(path, bytes.len(), &root, blob, &mut looks)?;
    let Looks {
        mut model,
        mut warnings,
        pictures,
        ..
    } = looks;
    model.uvs.resize(mesh.positions.len(), [0.0; 2]);
    model.colors.resize(mesh.positions.len(), [255; 4]);
    model.mesh = mesh;
    let mut together = 0;
    for picture in &pictures {
        together += decoded_size(&picture.bytes);
        if together > MAX_PICTURES {
            return Err(MeshFileError::Record {
                path: path.to_owned(),
                record: format!("image {}", picture.number),
                problem: format!(
                    "with those before it, it takes {} MiB of memory, more than {} MiB; make the \
                     model's pictures smaller",
                    together >> 20,
                    MAX_PICTURES >> 20
                ),
            });
        }
    }
    // On all threads, in order.
    let texture = |p: &_| {
        let (picture, warning) = decode(path, p)?;
        Ok((Texture::new(picture), warning))
    };
    let decoded: Vec<Result<_, MeshFileError>> = pictures.par_iter().map(texture).collect();
    for texture in decoded {
        let (texture, warning) = texture?;
        model.textures.push(texture);
        warnings.extend(warning);
    }
    Ok((model, warnings))
}

/// What is gathered while reading.
#[derive(Default)]
struct Looks {
    root: Option<Root>,
    model: Model,
    warnings: Vec<String>,
    /// Index into the model's nodes of each of the file's.
    node_idxs: BTreeMap<usize, u32>,
    /// The same of materials; `None` is the one of primitives that name none.
    material_idxs: BTreeMap<Option<usize>, u32>,
    /// Of each picture of the file, the model's texture, or none where it is missing.
    picture_idxs: BTreeMap<usize, Option<u32>>,
    /// Textures that are yet to be decoded.
    pictures: Vec<Picture>,
    /// Their bytes, and how many they may be: nothing keeps a file's pictures from sharing bytes.
    encoded: usize,
    most_encoded: usize,
}

struct Picture {
    number: usize,
    bytes: Vec<u8>,
}

impl Visitor for Looks {
    fn node(&mut self, number: usize, parent: Option<usize>) {
        let names = self.root.as_ref().and_then(|root| root.nodes.get(number));
        let parent_idx = parent.and_then(|p| self.node_idxs.get(&p).copied());
        self.node_idxs.insert(number, self.model.nodes.len() as u32);
        self.model.nodes.push(ModelNode {
            name: names.map(|n| n.name.clone()).unwrap_or_default(),
            parent_idx,
        });
    }

    fn primitive(
        &mut self,
        accessors: &mut Accessors<'_>,
        place: Place,
    ) -> Result<(), MeshFileError> {
        let entry = self.root.as_ref().and_then(|root| {
            let mesh = root.meshes.get(place.mesh)?;
            mesh.primitives.get(place.primitive)
        });
        let number = entry.and_then(|entry| entry.material);
        let attribute = |name: &str| entry.and_then(|entry| entry.attributes.get(name).copied());
        let used = self.texture_use(number);
        let uvs = attribute(&format!("TEXCOORD_{}", used.map_or(0, |u| u.tex_coord)));
        let colors = attribute("COLOR_0");
        let here = format!("mesh {}, primitive {}", place.mesh, place.primitive);
        let failed = |problem: String| MeshFileError::Record {
            path: accessors.path.to_owned(),
            record: here.clone(),
            problem,
        };
        // 1. Corners; those before of what has no triangles look like nothing.
        self.model.uvs.resize(place.corners.start, [0.0; 2]);
        self.model.colors.resize(place.corners.start, [255; 4]);
        let count = place.corners.len();
        for (what, accessor) in [("texture coordinates", uvs), ("colours", colors)] {
            let Some(accessor) = accessor else {
                continue;
            };
            let found = accessors.count(accessor)?;
            if found != count {
                return Err(failed(format!("{found} {what} for {count} corners")));
            }
        }
        let corners = self.model.uvs.len() + count;
        if let Some(accessor) = uvs {
            let finite = |x: f64| if x.is_finite() { x as f32 } else { 0.0 };
            let uv = |[u, v, ..]: [f64; 4]| [finite(u), finite(v)];
            self.model.uvs.extend(accessors.vectors(accessor)?.map(uv));
        } else {
            self.model.uvs.resize(corners, [0.0; 2]);
        }
        if let Some(accessor) = colors {
            let code = |x: f64| (255.0 * srgb_from_linear(x)).round() as u8;
            let color = |[r, g, b, _]: [f64; 4]| [code(r), code(g), code(b), 255];
            let colors = accessors.vectors(accessor)?;
            self.model.colors.extend(colors.map(color));
        } else {
            self.model.colors.resize(corners, [255; 4]);
        }
        // 2. What they are part of.
        let has_uvs = uvs.is_some();
        let material_idx = self.material(accessors, number)?;
        let is_textured = self.model.materials[material_idx as usize]
            .texture_idx
            .is_some();
        if is_textured && !has_uvs {
            self.warnings
                .push(format!("{here} has a texture but no texture coordinates"));
        }
        let triangles = place.triangles.start as u32..place.triangles.end as u32;
        self.model.parts.push(Part {
            triangles,
            node_idx: self.node_idxs.get(&place.node).copied().unwrap_or(0),
            material_idx,
        });
        Ok(())
    }
}

impl Looks {
    fn texture_use(&self, material: Option<usize>) -> Option<&TextureUse> {
        let entry = self.root.as_ref()?.materials.get(material?)?;
        entry.pbr_metallic_roughness.base_color_texture.as_ref()
    }

    /// The model's material for one of the file's.
    fn material(
        &mut self,
        accessors: &mut Accessors<'_>,
        number: Option<usize>,
    ) -> Result<u32, MeshFileError> {
        if let Some(idx) = self.material_idxs.get(&number) {
            return Ok(*idx);
        }
        let mut material = Material::default();
        let entry = self
            .root
            .as_ref()
            .and_then(|root| root.materials.get(number?));
        match (entry, number) {
            (Some(entry), _) => {
                if let Some([r, g, b, _]) = entry.pbr_metallic_roughness.base_color_factor {
                    material.base_color = [r, g, b].map(|x| srgb_from_linear(x) as f32);
                }
            }
            (None, Some(number)) => self
                .warnings
                .push(format!("there is no material {number}: it is white")),
            (None, None) => {}
        }
        if let Some(used) = self.texture_use(number).cloned() {
            for extension in used.extensions.keys() {
                self.warnings.push(format!(
                    "texture {}: {} is not applied",
                    used.index,
                    crate::mesh::obj::shown(extension)
                ));
            }
            (material.texture_idx, material.wrap) = self.texture(accessors, used.index)?;
        }
        let idx = self.model.materials.len() as u32;
        self.model.materials.push(material);
        self.material_idxs.insert(number, idx);
        Ok(idx)
    }

    /// The model's texture for one of the file's, and how it goes on beyond its sides.
    fn texture(
        &mut self,
        accessors: &mut Accessors<'_>,
        number: usize,
    ) -> Result<(Option<u32>, [Wrap; 2]), MeshFileError> {
        let Some(root) = &self.root else {
            return Ok((None, [Wrap::Repeat; 2]));
        };
        let entry = root.textures.get(number);
        let sampler = entry.and_then(|t| root.samplers.get(t.sampler?));
        let wrap = |code: u32| match code {
            33071 => Wrap::Clamp,
            33648 => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        let wraps = sampler.map_or([Wrap::Repeat; 2], |s| [wrap(s.wrap_s), wrap(s.wrap_t)]);
        let image = entry.and_then(|t| t.source);
        let Some((image, source)) = image.and_then(|i| Some((i, root.images.get(i)?))) else {
            self.warnings.push(format!(
                "texture {number} has no picture that can be read: a plain colour instead"
            ));
            return Ok((None, wraps));
        };
        if let Some(idx) = self.picture_idxs.get(&image) {
            return Ok((*idx, wraps));
        }
        let failed = |problem: String| MeshFileError::Record {
            path: accessors.path.to_owned(),
            record: format!("image {image}"),
            problem,
        };
        let bytes = match (source.buffer_view, &source.uri) {
            (Some(view), _) => {
                let bytes = accessors.view_bytes(view)?;
                self.encoded += bytes.len();
                let most = self.most_encoded;
                if self.encoded > most + accessors.buffers.external_size() {
                    return Err(failed(format!(
                        "pictures share bytes until they take {} bytes, more than {most}; export \
                         the model again",
                        self.encoded
                    )));
                }
                Ok(accessors.view_bytes(view)?.to_vec())
            }
            (None, Some(uri)) => fetch(accessors.path, uri, failed).map(|(bytes, _)| bytes),
            (None, None) => Err(failed("it is nowhere".to_owned())),
        };
        let idx = match bytes {
            Ok(bytes) => {
                let picture = Picture {
                    number: image,
                    bytes,
                };
                self.pictures.push(picture);
                Some(self.pictures.len() as u32 - 1)
            }
            Err(error) => {
                self.warnings
                    .push(format!("{error}: a plain colour instead"));
                None
            }
        };
        self.picture_idxs.insert(image, idx);
        Ok((idx, wraps))
    }
}

/// Bytes that a picture may take, decoded.
const MAX_PICTURE: u64 = 1 << 30;
/// Bytes that all of a model's may take.
const MAX_PICTURES: u64 = 4 << 30;

/// Bytes that a picture takes as RGBA, with the smaller ones of it, by what it says of itself; none where
/// it does not.
fn decoded_size(bytes: &[u8]) -> u64 {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let size = reader.ok().and_then(|r| r.into_dimensions().ok());
    size.map_or(0, |(width, height)| {
        16 * u64::from(width) * u64::from(height) / 3
    })
}

/// A picture; white, and a warning, where it is of a kind that is not read.
fn decode(path: &Path, picture: &Picture) -> Result<(RgbaImage, Option<String>), MeshFileError> {
    let record = format!("image {}", picture.number);
    let failed = |problem: String| MeshFileError::Record {
        path: path.to_owned(),
        record: record.clone(),
        problem,
    };
    let reader = ImageReader::new(Cursor::new(&picture.bytes)).with_guessed_format();
    let mut reader = reader.map_err(|e| failed(e.to_string()))?;
    let is_read = |f| matches!(f, image::ImageFormat::Png | image::ImageFormat::Jpeg);
    if !reader.format().is_some_and(is_read) {
        let white = RgbaImage::from_pixel(1, 1, image::Rgba([255; 4]));
        let warning = format!("{record} is neither PNG nor JPEG: a plain colour instead");
        return Ok((white, Some(warning)));
    }
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_PICTURE);
    reader.limits(limits);
    match reader.decode() {
        Ok(decoded) => Ok((decoded.into_rgba8(), None)),
        Err(error) => Err(failed(format!(
            "it cannot be decoded ({error}); export the model again"
        ))),
    }
}
