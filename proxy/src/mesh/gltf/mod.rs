//! glTF 2.0: the triangles of the default scene, nodes' transforms applied.
//!
//! The JSON is read into only what geometry needs. The `gltf` crate's own types round node
//! transforms to f32 and take many times the file's size in memory, and its accessors panic
//! where references lead nowhere.

mod accessor;
mod buffers;
mod looks;
mod materials;
mod nodes;
mod pictures;
mod targets;

pub(super) use buffers::files_beside;
pub(super) use looks::parse_model;

use super::{Mesh, MeshFileError};
use accessor::Accessors;
use buffers::Buffers;
use capture::without_byte_order_mark;
use glam::{DMat4, DVec3};
use nodes::{Node, Placed, Scene, placed_nodes};
use serde::Deserialize;
use std::ops::Range;
use std::path::Path;
use targets::Target;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Root {
    asset: Asset,
    scene: Option<usize>,
    #[serde(default)]
    scenes: Vec<Scene>,
    #[serde(default)]
    nodes: Vec<Node>,
    #[serde(default)]
    meshes: Vec<MeshEntry>,
    #[serde(default)]
    accessors: Vec<accessor::Accessor>,
    #[serde(default)]
    buffer_views: Vec<accessor::BufferView>,
    #[serde(default)]
    buffers: Vec<buffers::Buffer>,
    #[serde(default)]
    extensions_used: Vec<String>,
    #[serde(default)]
    extensions_required: Vec<String>,
}

#[derive(Deserialize)]
struct Asset {
    version: String,
}

#[derive(Deserialize)]
struct MeshEntry {
    #[serde(default)]
    primitives: Vec<Primitive>,
    /// Of each primitive's targets, where a node says nothing else.
    weights: Option<Box<[f64]>>,
}

#[derive(Deserialize)]
struct Primitive {
    attributes: Attributes,
    indices: Option<usize>,
    /// Triangles, if absent.
    mode: Option<u32>,
    targets: Option<Box<[Target]>>,
}

#[derive(Deserialize)]
struct Attributes {
    #[serde(rename = "POSITION")]
    position: Option<usize>,
}

/// Required extensions that change how a surface looks, not where it is (what of them is not shown is
/// told with a model), the one that only allows positions of whole numbers, and those that are read.
const HARMLESS: [&str; 7] = [
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_lights_",
    "KHR_mesh_quantization",
    nodes::INSTANCING,
    nodes::VISIBILITY,
];

/// Bytes of mesh for each byte of the file, where nodes repeat meshes; and what any file's may take: rows of
/// seats are a small file. Transforms of copies, which are numbers of the file, grow less.
const MAX_GROWTH: usize = 64;
const ANY_MESH: usize = 256 << 20;
const ANY_COPIES: usize = 64 << 10;

/// Who wants to know more of the file than where its triangles are.
trait Visitor {
    /// A node of the scene, after its parent.
    fn node(&mut self, _number: usize, _parent: Option<usize>) {}

    /// Whether a node's mesh is to be left out, as the file hides the node.
    fn leaves_out_hidden(&mut self, _node: usize) -> bool {
        true
    }

    /// Whether a primitive of a node's mesh is to be left out.
    fn leaves_out(&self, _node: usize, _mesh: usize, _primitive: usize) -> bool {
        false
    }

    /// A primitive that was left out, and how many triangles it has.
    fn left_out(&mut self, _mesh: usize, _primitive: usize, _triangles: usize) {}

    /// What of a primitive is no triangle, and passed over.
    fn passed_over(&mut self, _mesh: usize, _primitive: usize, _what: PassedOver) {}

    /// A primitive whose triangles have been read.
    fn primitive(
        &mut self,
        _accessors: &mut Accessors<'_>,
        _place: Place,
    ) -> Result<(), MeshFileError> {
        Ok(())
    }

    /// The end of the scene.
    fn end(&mut self, _accessors: &mut Accessors<'_>) -> Result<(), MeshFileError> {
        Ok(())
    }
}

/// What is no triangle.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum PassedOver {
    /// Points and lines.
    Thin,
    /// One or two corners after the last triangle.
    Rest,
}

/// Where a primitive is in the file and in the mesh.
struct Place {
    node: usize,
    mesh: usize,
    primitive: usize,
    corners: Range<usize>,
    triangles: Range<usize>,
}

/// To know where the triangles are is enough.
impl Visitor for () {}

/// Reads a .glb or a .gltf file that has triangles.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Mesh, MeshFileError> {
    let (json, blob) = split(path, bytes)?;
    let mesh = read(path, bytes.len(), &root(path, json)?, blob, &mut ())?;
    match mesh.triangles.is_empty() {
        true => Err(MeshFileError::EmptyScene(path.to_owned())),
        false => Ok(mesh),
    }
}

/// The JSON and the binary chunk of a GLB; of a .gltf file, all of it is JSON.
fn split<'a>(path: &Path, bytes: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>), MeshFileError> {
    match bytes.starts_with(b"glTF") {
        true => container(bytes).map_err(|e| MeshFileError::File(path.to_owned(), e)),
        false => Ok((without_byte_order_mark(bytes), None)),
    }
}

/// What the JSON says of geometry, if it can be read at all.
fn root(path: &Path, json: &[u8]) -> Result<Root, MeshFileError> {
    let whole = |problem: String| MeshFileError::File(path.to_owned(), problem);
    let root: Root =
        serde_json::from_slice(json).map_err(|e| whole(format!("not a glTF file: {e}")))?;
    if !root.asset.version.starts_with("2.") {
        return Err(whole(format!(
            "glTF version {}; this program reads version 2: export the mesh again as glTF 2.0",
            super::obj::shown(&root.asset.version)
        )));
    }
    let harmful = |e: &&String| !HARMLESS.iter().any(|harmless| e.starts_with(harmless));
    if let Some(extension) = root.extensions_required.iter().find(harmful) {
        return Err(whole(format!(
            "it needs the extension {}, which is not read; export the mesh again without it \
             (without compression, say)",
            super::obj::shown(extension)
        )));
    }
    Ok(root)
}

/// The triangles; the visitor hears of each primitive.
fn read(
    path: &Path,
    file_size: usize,
    root: &Root,
    blob: Option<&[u8]>,
    visitor: &mut impl Visitor,
) -> Result<Mesh, MeshFileError> {
    let mut reader = Reader {
        accessors: Accessors {
            path,
            accessors: &root.accessors,
            views: &root.buffer_views,
            buffers: Buffers::new(path, &root.buffers, blob, &root.extensions_used),
        },
        mesh: Mesh::default(),
        copies: 0,
        file_size,
    };
    for Placed {
        number,
        parent,
        world_from_node,
        is_hidden,
    } in placed_nodes(path, root)?
    {
        visitor.node(number, parent);
        let node = &root.nodes[number];
        let Some(mesh) = node.mesh.map(|mesh| mesh as usize) else {
            continue;
        };
        if is_hidden && visitor.leaves_out_hidden(number) {
            continue;
        }
        let entry = root.meshes.get(mesh);
        let entry = entry.ok_or_else(|| MeshFileError::Record {
            path: path.to_owned(),
            record: format!("node {number}"),
            problem: format!("there is no mesh {mesh}"),
        })?;
        let weights = node.weights.as_deref().or(entry.weights.as_deref());
        let weights = weights.unwrap_or_default();
        let world_from_copies = reader.world_from_copies(node, number, world_from_node)?;
        for (i, primitive) in entry.primitives.iter().enumerate() {
            if visitor.leaves_out(number, mesh, i) {
                let triangles = reader.triangle_count(primitive)?;
                visitor.left_out(mesh, i, triangles * world_from_copies.len());
                continue;
            }
            if let Some(what) = reader.passed_over(primitive)? {
                visitor.passed_over(mesh, i, what);
            }
            let name = format!("mesh {mesh}, primitive {i}");
            for world_from_copy in &world_from_copies {
                let (corner, triangle) = (reader.mesh.positions.len(), reader.mesh.triangles.len());
                reader.primitive(primitive, weights, &name, world_from_copy)?;
                let place = Place {
                    node: number,
                    mesh,
                    primitive: i,
                    corners: corner..reader.mesh.positions.len(),
                    triangles: triangle..reader.mesh.triangles.len(),
                };
                if !place.triangles.is_empty() {
                    visitor.primitive(&mut reader.accessors, place)?;
                }
            }
        }
    }
    visitor.end(&mut reader.accessors)?;
    Ok(reader.mesh)
}

/// The JSON and the binary chunk of a GLB.
fn container(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), String> {
    let not_glb = |what: &str| format!("not a glTF file: {what}");
    let word = |at: usize| {
        let bytes = bytes.get(at..at + 4).and_then(|b| b.try_into().ok());
        bytes
            .map(u32::from_le_bytes)
            .ok_or_else(|| not_glb("it is cut off"))
    };
    if word(4)? != 2 {
        return Err(format!(
            "GLB version {}; this program reads version 2",
            word(4)?
        ));
    }
    let mut chunks = [None, None];
    let mut at = 12;
    for (chunk, kind) in chunks.iter_mut().zip([b"JSON", b"BIN\0"]) {
        if at >= bytes.len() {
            break;
        }
        let length = word(at)? as usize;
        if word(at + 4)? != u32::from_le_bytes(*kind) {
            break;
        }
        let end = (at + 8)
            .checked_add(length)
            .filter(|end| *end <= bytes.len());
        let end = end.ok_or_else(|| not_glb("it is cut off"))?;
        *chunk = Some(&bytes[at + 8..end]);
        at = end.next_multiple_of(4);
    }
    let json = chunks[0].ok_or_else(|| not_glb("its first chunk is not JSON"))?;
    Ok((json, chunks[1]))
}

/// What is gathered while reading.
struct Reader<'a> {
    accessors: Accessors<'a>,
    mesh: Mesh,
    /// How many copies nodes have told of so far.
    copies: usize,
    file_size: usize,
}

impl Reader<'_> {
    /// Where a node's mesh is in the world: once where the node is, or as often as there are copies of it.
    fn world_from_copies(
        &mut self,
        node: &Node,
        number: usize,
        world_from_node: DMat4,
    ) -> Result<Vec<DMat4>, MeshFileError> {
        let Some(copies) = node.copies() else {
            return Ok(vec![world_from_node]);
        };
        let name = format!("node {number}");
        let count = copies.count(&mut self.accessors, &name)?;
        self.copies += count;
        self.check_size(size_of::<DMat4>() * self.copies, ANY_COPIES, &name)?;
        copies.transforms(&mut self.accessors, &name, vec![world_from_node; count])
    }

    /// Whether a file of this size may become so many bytes, where any file may become some.
    fn check_size(&self, bytes: usize, any: usize, name: &str) -> Result<(), MeshFileError> {
        let size = self.file_size + self.accessors.buffers.external_size();
        if bytes <= MAX_GROWTH * size + any {
            return Ok(());
        }
        Err(MeshFileError::Record {
            path: self.accessors.path.to_owned(),
            record: name.to_owned(),
            problem: format!(
                "nodes repeat meshes until they take {bytes} bytes, more than {MAX_GROWTH} times \
                 the file; simplify them, or leave some of them out, before exporting"
            ),
        })
    }

    /// How many triangles a primitive is made of.
    fn triangle_count(&mut self, primitive: &Primitive) -> Result<usize, MeshFileError> {
        let Some(positions) = primitive.attributes.position else {
            return Ok(0);
        };
        let corners = self
            .accessors
            .count(primitive.indices.unwrap_or(positions))?;
        Ok(match primitive.mode.unwrap_or(4) {
            4 => corners / 3,
            5 | 6 => corners.saturating_sub(2),
            _ => 0,
        })
    }

    /// What of a primitive makes no triangles.
    fn passed_over(&mut self, primitive: &Primitive) -> Result<Option<PassedOver>, MeshFileError> {
        let Some(positions) = primitive.attributes.position else {
            return Ok(None);
        };
        Ok(match primitive.mode.unwrap_or(4) {
            0..=3 => Some(PassedOver::Thin),
            4 => {
                let corners = primitive.indices.unwrap_or(positions);
                let corners = self.accessors.count(corners)?;
                (corners % 3 > 0).then_some(PassedOver::Rest)
            }
            _ => None,
        })
    }

    /// Takes in a primitive if it is made of triangles, moved by targets of these weights.
    fn primitive(
        &mut self,
        primitive: &Primitive,
        weights: &[f64],
        name: &str,
        world_from_node: &DMat4,
    ) -> Result<(), MeshFileError> {
        let failed = |problem: String| MeshFileError::Record {
            path: self.accessors.path.to_owned(),
            record: name.to_owned(),
            problem,
        };
        let mode = primitive.mode.unwrap_or(4);
        if mode > 6 {
            return Err(failed(format!(
                "its mode is {mode}, expected 0 to 6; export the mesh again"
            )));
        }
        let (4..=6, Some(positions)) = (mode, primitive.attributes.position) else {
            return Ok(());
        };
        // 1. How much it will be, before any memory is taken.
        let corners = self.accessors.count(positions)?;
        let indices = primitive
            .indices
            .map(|i| self.accessors.count(i))
            .transpose()?;
        let indices = indices.unwrap_or(corners);
        let bytes =
            24 * (self.mesh.positions.len() + corners) + 12 * (self.mesh.triangles.len() + indices);
        self.check_size(bytes, ANY_MESH, name)?;
        // 2. Corners.
        let first = self.mesh.positions.len();
        let targets = primitive.targets.as_deref().unwrap_or_default();
        let moves = targets::moves(&mut self.accessors, targets, weights, corners)?;
        let positions = self.accessors.triples(positions, "positions")?;
        for (i, position) in positions.enumerate() {
            let position = position + moves.get(i).copied().unwrap_or(DVec3::ZERO);
            let position = world_from_node.transform_point3(position);
            if !position.is_finite() {
                return Err(failed(format!("the position of corner {i} is not finite")));
            }
            self.mesh.positions.push(position);
        }
        // 3. Triangles.
        let corner = |i: u32| match (i as usize) < corners {
            true => Ok(first as u32 + i),
            false => Err(failed(format!(
                "it uses corner {i}, but has only {corners}"
            ))),
        };
        let indices: Vec<u32> = match primitive.indices {
            Some(accessor) => self
                .accessors
                .indices(accessor)?
                .map(corner)
                .collect::<Result<_, _>>()?,
            None => (0..corners as u32).map(|i| first as u32 + i).collect(),
        };
        let is_mirrored = world_from_node.determinant() < 0.0;
        let triangles = &mut self.mesh.triangles;
        let mut push =
            |[a, b, c]: [u32; 3]| triangles.push(if is_mirrored { [a, c, b] } else { [a, b, c] });
        match mode {
            4 => indices.as_chunks::<3>().0.iter().for_each(|t| push(*t)),
            // Every other triangle of a strip is turned.
            5 => indices
                .windows(3)
                .enumerate()
                .for_each(|(i, t)| match i % 2 {
                    0 => push([t[0], t[1], t[2]]),
                    _ => push([t[1], t[0], t[2]]),
                }),
            _ => indices
                .windows(2)
                .skip(1)
                .for_each(|t| push([indices[0], t[0], t[1]])),
        }
        Ok(())
    }
}

/// So many records are named at most.
const MOST_NAMES: usize = 3;

/// Records of a kind as messages show them: how many, and the names of the first, or their numbers.
fn listed<'a>(noun: &str, numbers: &[usize], name: impl Fn(usize) -> Option<&'a str>) -> String {
    let shown = |number: &usize| match name(*number) {
        None | Some("") => format!("number {number}"),
        Some(name) => format!("`{}`", super::obj::shown(name)),
    };
    let names: Vec<String> = numbers.iter().take(MOST_NAMES).map(shown).collect();
    let plural = if numbers.len() == 1 { "" } else { "s" };
    let more = if numbers.len() > MOST_NAMES {
        ", …"
    } else {
        ""
    };
    format!(
        "{} {noun}{plural}: {}{more}",
        numbers.len(),
        names.join(", ")
    )
}
