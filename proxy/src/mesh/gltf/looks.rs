//! How a glTF file's triangles look: base colours, textures, corners' colours, nodes' names.

use super::accessor::Accessors;
use super::buffers::fetch;
use super::materials::{MaterialEntry, TextureUse, not_shown};
use super::pictures::{Decoded, Picture, decode};
use super::{PassedOver, Place, Visitor};
use crate::mesh::model::srgb_from_linear;
use crate::mesh::{Material, MeshFileError, Model, ModelNode, PORTAL_NODE, Part, Wrap};
use glam::{DAffine2, DVec2};
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::{BTreeMap, BTreeSet};
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
    /// What poses its mesh by other nodes, its bones.
    skin: Option<IgnoredAny>,
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

#[derive(Deserialize)]
struct TextureEntry {
    source: Option<usize>,
    sampler: Option<usize>,
    /// By name, whatever they hold: other kinds of picture.
    #[serde(default)]
    extensions: BTreeMap<String, IgnoredAny>,
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
    #[serde(default)]
    mag_filter: u32,
}

/// A sampler's filter that mixes no texels.
const NEAREST: u32 = 9728;

/// What textures' pictures are by the extensions that name them.
const KINDS: [(&str, &str); 4] = [
    ("EXT_texture_avif", "AVIF"),
    ("EXT_texture_webp", "WebP"),
    ("KHR_texture_basisu", "KTX2"),
    ("MSFT_texture_dds", "DDS"),
];

/// Reads a .glb or .gltf file that has triangles with its looks. What could not be had of them is told beside the
/// model, and has a plain colour instead; so is what is drawn opaque or left out.
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
    let hidden: usize = looks.hidden.values().sum();
    if mesh.triangles.is_empty() {
        let path = path.to_owned();
        return Err(match hidden {
            0 if looks.out_of_sight.is_empty() => MeshFileError::EmptyScene(path),
            0 => MeshFileError::File(
                path,
                format!(
                    "all nodes that have triangles ({}) are hidden ({}); unhide them, and export the model again",
                    looks.out_of_sight.len(),
                    super::nodes::VISIBILITY
                ),
            ),
            _ => MeshFileError::File(
                path,
                format!(
                    "all its triangles ({hidden}) are invisible, as their materials' alpha is 0 or less \
                     than the cutoff; export the model again with materials that are opaque"
                ),
            ),
        });
    }
    let decoded = decode(path, &looks.pictures)?;
    let mut not_shown = looks.not_shown(&decoded);
    not_shown.extend(looks.told_passed_over());
    not_shown.extend(looks.told_unposed());
    not_shown.extend(looks.told_out_of_sight());
    not_shown.extend(looks.told_smoothed());
    not_shown.extend(looks.told_unread());
    let Looks {
        mut model,
        mut warnings,
        ..
    } = looks;
    model.uvs.resize(mesh.positions.len(), [0.0; 2]);
    model.colors.resize(mesh.positions.len(), [255; 4]);
    model.mesh = mesh;
    for picture in decoded {
        model.textures.push(picture.texture);
        warnings.extend(picture.warning);
    }
    warnings.extend(not_shown);
    Ok((model, warnings))
}

/// What is gathered while reading.
#[derive(Default)]
struct Looks {
    root: Option<Root>,
    model: Model,
    warnings: Vec<String>,
    /// Primitives, by mesh, that a warning says lack texture coordinates: they may be there many times.
    without_uvs: BTreeSet<(usize, usize)>,
    /// Index into the model's nodes of each of the file's.
    node_idxs: BTreeMap<usize, u32>,
    /// The same of materials; `None` is the one of primitives that name none.
    material_idxs: BTreeMap<Option<usize>, u32>,
    /// Of each of the model's nodes, whether it stands for an opening, which is not drawn.
    openings: Vec<bool>,
    /// Primitives, by mesh, that are no triangles, or not all of them.
    passed_over: BTreeMap<PassedOver, BTreeSet<(usize, usize)>>,
    /// Nodes whose meshes bones would pose.
    unposed: BTreeSet<usize>,
    /// Nodes with meshes that the file hides.
    out_of_sight: BTreeSet<usize>,
    /// Textures that are drawn smoothly, though the file wants to see their texels.
    smoothed: BTreeSet<usize>,
    /// Textures that an extension alone has a picture for, by that.
    unread: BTreeMap<String, BTreeSet<usize>>,
    /// How many triangles are left out as nobody could see them, by the file's materials.
    hidden: BTreeMap<usize, usize>,
    /// The least alpha of corners that are drawn, by the file's materials.
    drawn: BTreeMap<usize, f64>,
    /// Of each picture of the file, the model's texture, or none where it is missing.
    picture_idxs: BTreeMap<usize, Option<u32>>,
    /// Textures that are yet to be decoded.
    pictures: Vec<Picture>,
    /// Their bytes, and how many they may be: nothing keeps a file's pictures from sharing bytes.
    encoded: usize,
    most_encoded: usize,
}

impl Visitor for Looks {
    fn node(&mut self, number: usize, parent: Option<usize>) {
        let named = self.node_entry(number);
        let name = named.map(|n| n.name.clone()).unwrap_or_default();
        let parent_idx = parent.and_then(|p| self.node_idxs.get(&p).copied());
        let is_below = parent.is_some_and(|p| self.is_opening(p));
        self.openings
            .push(is_below || name.starts_with(PORTAL_NODE));
        self.node_idxs.insert(number, self.model.nodes.len() as u32);
        self.model.nodes.push(ModelNode { name, parent_idx });
    }

    fn leaves_out_hidden(&mut self, node: usize) -> bool {
        // Of an opening only the outline counts, seen or not.
        let is_left_out = !self.is_opening(node);
        if is_left_out {
            self.out_of_sight.insert(node);
        }
        is_left_out
    }

    fn leaves_out(&self, node: usize, mesh: usize, primitive: usize) -> bool {
        // Of an opening only the outline counts.
        let material = self.material_of(mesh, primitive);
        let entry = material.and_then(|number| self.entry(number));
        entry.is_some_and(MaterialEntry::is_invisible) && !self.is_opening(node)
    }

    fn left_out(&mut self, mesh: usize, primitive: usize, triangles: usize) {
        if let (Some(number), true) = (self.material_of(mesh, primitive), triangles > 0) {
            *self.hidden.entry(number).or_insert(0) += triangles;
        }
    }

    fn passed_over(&mut self, mesh: usize, primitive: usize, what: PassedOver) {
        let of_kind = self.passed_over.entry(what).or_default();
        of_kind.insert((mesh, primitive));
    }

    fn primitive(
        &mut self,
        accessors: &mut Accessors<'_>,
        place: Place,
    ) -> Result<(), MeshFileError> {
        if self
            .node_entry(place.node)
            .is_some_and(|node| node.skin.is_some())
        {
            self.unposed.insert(place.node);
        }
        let entry = self.root.as_ref().and_then(|root| {
            let mesh = root.meshes.get(place.mesh)?;
            mesh.primitives.get(place.primitive)
        });
        let number = entry.and_then(|entry| entry.material);
        let attribute = |name: &str| entry.and_then(|entry| entry.attributes.get(name).copied());
        let used = self.texture_use(number);
        let coordinates = used.map_or(0, TextureUse::coordinates);
        let uvs = attribute(&format!("TEXCOORD_{coordinates}"));
        let placed = used.map(TextureUse::picture_from_coordinates);
        let placed = placed.unwrap_or(DAffine2::IDENTITY);
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
        let mut least_alpha = 1.0_f64;
        if let Some(accessor) = uvs {
            let finite = |x: f64| if x.is_finite() { x as f32 } else { 0.0 };
            let uv = |[u, v, ..]: [f64; 4]| {
                let place = placed.transform_point2(DVec2::new(u, v));
                place.to_array().map(finite)
            };
            self.model.uvs.extend(accessors.vectors(accessor)?.map(uv));
        } else {
            self.model.uvs.resize(corners, [0.0; 2]);
        }
        if let Some(accessor) = colors {
            let code = |x: f64| (255.0 * srgb_from_linear(x)).round() as u8;
            // Corners' colours are for what reflects.
            let shines = number.and_then(|n| self.entry(n));
            let shines = shines.is_some_and(MaterialEntry::shows_emission);
            let color = |[r, g, b, alpha]: [f64; 4]| {
                least_alpha = least_alpha.min(alpha);
                match shines {
                    true => [255; 4],
                    false => [code(r), code(g), code(b), 255],
                }
            };
            let colors = accessors.vectors(accessor)?;
            self.model.colors.extend(colors.map(color));
        } else {
            self.model.colors.resize(corners, [255; 4]);
        }
        // 2. What they are part of.
        let has_uvs = uvs.is_some();
        if let (Some(number), false) = (number, self.is_opening(place.node)) {
            let least = self.drawn.entry(number).or_insert(1.0);
            *least = least.min(least_alpha);
        }
        let material_idx = self.material(accessors, number)?;
        let is_textured = self.model.materials[material_idx as usize]
            .texture_idx
            .is_some();
        let named = (place.mesh, place.primitive);
        if is_textured && !has_uvs && self.without_uvs.insert(named) {
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
    /// A node of the file.
    fn node_entry(&self, number: usize) -> Option<&Node> {
        self.root.as_ref()?.nodes.get(number)
    }

    /// A material of the file.
    fn entry(&self, material: usize) -> Option<&MaterialEntry> {
        self.root.as_ref()?.materials.get(material)
    }

    /// Which material a primitive names.
    fn material_of(&self, mesh: usize, primitive: usize) -> Option<usize> {
        let mesh = self.root.as_ref()?.meshes.get(mesh)?;
        mesh.primitives.get(primitive)?.material
    }

    fn texture_use(&self, material: Option<usize>) -> Option<&TextureUse> {
        self.entry(material?)?.texture()
    }

    /// Whether a node of the file stands for an opening, or is below one that does.
    fn is_opening(&self, node: usize) -> bool {
        let idx = self.node_idxs.get(&node);
        idx.and_then(|idx| self.openings.get(*idx as usize)) == Some(&true)
    }

    /// What of the materials is not shown as the file says.
    fn not_shown(&self, decoded: &[Decoded]) -> Vec<String> {
        let of_texture = |number: &usize| {
            // Alpha of what shines is not the material's.
            self.entry(*number).filter(|m| !m.shows_emission())?;
            let idx = self.material_idxs.get(&Some(*number))?;
            let material = self.model.materials.get(*idx as usize)?;
            let picture = decoded.get(material.texture_idx? as usize)?;
            Some(picture.least_alpha)
        };
        let drawn = self.drawn.iter().map(|(number, of_corners)| {
            let of_texture = of_texture(number).unwrap_or(1.0);
            (*number, of_corners * of_texture)
        });
        let drawn: BTreeMap<usize, f64> = drawn.collect();
        let materials = self.root.as_ref().map(|root| &root.materials[..]);
        not_shown(materials.unwrap_or_default(), &self.hidden, &drawn)
    }

    /// What stands otherwise than its bones say.
    fn told_unposed(&self) -> Option<String> {
        let numbers: Vec<usize> = self.unposed.iter().copied().collect();
        let name = |number| Some(self.node_entry(number)?.name.as_str());
        let of = super::listed("node", &numbers, name);
        (!numbers.is_empty()).then(|| {
            format!(
                "what bones pose (a skin) is drawn as it was modelled, in its rest pose; apply the pose before \
                 exporting ({of})"
            )
        })
    }

    /// What the file hides.
    fn told_out_of_sight(&self) -> Option<String> {
        let numbers: Vec<usize> = self.out_of_sight.iter().copied().collect();
        let name = |number| Some(self.node_entry(number)?.name.as_str());
        let of = super::listed("node", &numbers, name);
        (!numbers.is_empty()).then(|| {
            format!(
                "what the file hides ({}) is left out; unhide it before exporting to have it drawn ({of})",
                super::nodes::VISIBILITY
            )
        })
    }

    /// What is drawn smoother than the file asks for.
    fn told_smoothed(&self) -> Option<String> {
        let numbers: Vec<usize> = self.smoothed.iter().copied().collect();
        let of = super::listed("texture", &numbers, |_| None);
        (!numbers.is_empty()).then(|| {
            format!(
                "{of}: drawn smoothly, though the file asks for hard texels (NEAREST); enlarge the picture for sharper ones"
            )
        })
    }

    /// What textures' pictures are that are not read, once a kind.
    fn told_unread(&self) -> Vec<String> {
        let told = self.unread.iter().map(|(extension, numbers)| {
            let numbers: Vec<usize> = numbers.iter().copied().collect();
            let of = super::listed("texture", &numbers, |_| None);
            let kind = KINDS.iter().find(|(name, _)| name == extension);
            let kind = kind.map_or("another kind", |(_, kind)| *kind);
            format!(
                "{of}: a plain colour instead of a picture that is {kind} alone ({}), which is not read; export the \
                 model again with PNG or JPEG textures",
                crate::mesh::obj::shown(extension)
            )
        });
        told.collect()
    }

    /// What of the primitives is no triangle, once a kind.
    fn told_passed_over(&self) -> Vec<String> {
        let told = self.passed_over.iter().filter_map(|(what, primitives)| {
            let (mesh, primitive) = primitives.first()?;
            let others = match primitives.len() - 1 {
                0 => String::new(),
                count => format!(" and {count} more"),
            };
            let what = match what {
                PassedOver::Thin => "points and lines are not drawn",
                PassedOver::Rest => {
                    "the corners are no multiple of 3, and the last ones are left out"
                }
            };
            Some(format!(
                "mesh {mesh}, primitive {primitive}{others}: {what}"
            ))
        });
        told.collect()
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
                if let Some([r, g, b, _]) = entry.factor() {
                    material.base_color = [r, g, b].map(|x| srgb_from_linear(x) as f32);
                }
            }
            (None, Some(number)) => self
                .warnings
                .push(format!("there is no material {number}: it is white")),
            (None, None) => {}
        }
        if let Some(used) = self.texture_use(number).cloned() {
            for extension in used.not_applied() {
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
            let other = entry.and_then(|t| t.extensions.keys().next());
            match other.filter(|_| image.is_none()) {
                Some(extension) => {
                    let of_kind = self.unread.entry(extension.clone()).or_default();
                    of_kind.insert(number);
                }
                None => self.warnings.push(format!(
                    "texture {number} has no picture that can be read: a plain colour instead"
                )),
            }
            return Ok((None, wraps));
        };
        if sampler.is_some_and(|sampler| sampler.mag_filter == NEAREST) {
            self.smoothed.insert(number);
        }
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
            (None, Some(uri)) => {
                let told = |problem: String| problem;
                fetch(accessors.path, uri, told).map(|(bytes, _)| bytes)
            }
            (None, None) => Err("it is nowhere".to_owned()),
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
            Err(problem) => {
                self.warnings
                    .push(format!("image {image}: {problem}: a plain colour instead"));
                None
            }
        };
        self.picture_idxs.insert(image, idx);
        Ok((idx, wraps))
    }
}
