//! A glTF file's nodes: where they are in the world, and where the copies of their meshes are.

use super::Root;
use super::accessor::Accessors;
use crate::mesh::MeshFileError;
use glam::{DMat4, DQuat, DVec3};
use serde::Deserialize;
use std::path::Path;

#[derive(Deserialize)]
pub(super) struct Scene {
    #[serde(default)]
    nodes: Vec<usize>,
}

#[derive(Deserialize)]
pub(super) struct Node {
    children: Option<Box<[usize]>>,
    pub(super) mesh: Option<u32>,
    /// Of its mesh's targets, in place of the mesh's own.
    pub(super) weights: Option<Box<[f64]>>,
    matrix: Option<Box<[f64; 16]>>,
    translation: Option<Box<[f64; 3]>>,
    rotation: Option<Box<[f64; 4]>>,
    scale: Option<Box<[f64; 3]>>,
    extensions: Option<Box<Extensions>>,
}

/// The extension by which a node shows its mesh as often as accessors have transforms.
pub(super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// The extension by which a node, and all below it, is there but not shown.
pub(super) const VISIBILITY: &str = "KHR_node_visibility";

/// How far the last row of a node's matrix may be from (0, 0, 0, 1): rounding of what wrote it.
const AFFINE: f64 = 1e-6;

/// What is read of a node's extensions.
#[derive(Deserialize)]
struct Extensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    instancing: Option<Instancing>,
    #[serde(rename = "KHR_node_visibility")]
    visibility: Option<NodeVisibility>,
}

#[derive(Deserialize)]
struct NodeVisibility {
    visible: Option<bool>,
}

#[derive(Deserialize)]
struct Instancing {
    #[serde(default)]
    attributes: Copies,
}

/// The accessors that have transforms of copies of a mesh, in the node's frame: each is scaled, then rotated,
/// then translated.
#[derive(Default, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) struct Copies {
    translation: Option<usize>,
    rotation: Option<usize>,
    scale: Option<usize>,
}

/// A node of the default scene.
pub(super) struct Placed {
    pub(super) number: usize,
    pub(super) parent: Option<usize>,
    pub(super) world_from_node: DMat4,
    /// The file hides it, or one that it is below.
    pub(super) is_hidden: bool,
}

/// The default scene's nodes in the order of the file's trees.
pub(super) fn placed_nodes(path: &Path, root: &Root) -> Result<Vec<Placed>, MeshFileError> {
    // Without scenes every tree is meant.
    let number = root.scene.unwrap_or(0);
    let roots: Vec<usize> = match root.scenes.get(number) {
        Some(scene) => scene.nodes.clone(),
        None if root.scenes.is_empty() => {
            let children = root.nodes.iter().filter_map(|n| n.children.as_deref());
            let mut is_root = vec![true; root.nodes.len()];
            for child in children.flatten() {
                is_root
                    .get_mut(*child)
                    .into_iter()
                    .for_each(|is| *is = false);
            }
            (0..root.nodes.len()).filter(|i| is_root[*i]).collect()
        }
        None => {
            let problem = format!("there is no scene {number}");
            return Err(MeshFileError::File(path.to_owned(), problem));
        }
    };
    let mut found = Vec::new();
    let mut is_found = vec![false; root.nodes.len()];
    // Each with its parent, which is placed already.
    let mut open: Vec<(usize, Option<usize>)> = Vec::new();
    open.extend(roots.iter().rev().map(|node| (*node, None)));
    while let Some((number, parent_place)) = open.pop() {
        let parent: Option<&Placed> = parent_place.and_then(|place: usize| found.get(place));
        let world_from_parent = parent.map_or(DMat4::IDENTITY, |parent| parent.world_from_node);
        let here = || format!("node {number}");
        let Some(node) = root.nodes.get(number) else {
            return Err(failed(path, &here(), "there is no such node".to_owned()));
        };
        if std::mem::replace(&mut is_found[number], true) {
            let problem = "two nodes have it as their child; nodes must form trees";
            return Err(failed(path, &here(), problem.to_owned()));
        }
        if let Some(row) = node.projective_row() {
            let problem = format!(
                "its matrix has the last row {row:?}, expected [0, 0, 0, 1]; apply its transform before exporting"
            );
            return Err(failed(path, &here(), problem));
        }
        let world_from_node = world_from_parent * node.parent_from_node();
        if !world_from_node.is_finite() {
            return Err(failed(
                path,
                &here(),
                "its transform is not finite".to_owned(),
            ));
        }
        let children = node.children.as_deref().unwrap_or_default();
        let place = found.len();
        open.extend(children.iter().rev().map(|child| (*child, Some(place))));
        found.push(Placed {
            number,
            parent: parent.map(|parent| parent.number),
            world_from_node,
            is_hidden: node.is_hidden() || parent.is_some_and(|parent| parent.is_hidden),
        });
    }
    Ok(found)
}

impl Node {
    /// The copies of its mesh, if it tells of any.
    pub(super) fn copies(&self) -> Option<&Copies> {
        let extensions = self.extensions.as_ref()?;
        Some(&extensions.instancing.as_ref()?.attributes)
    }

    /// Whether the file hides it, whatever it is below.
    fn is_hidden(&self) -> bool {
        let extensions = self.extensions.as_ref();
        let visibility = extensions.and_then(|extensions| extensions.visibility.as_ref());
        visibility.is_some_and(|visibility| visibility.visible == Some(false))
    }

    /// The last row of its matrix where that is none of a transform that keeps planes parallel, but for rounding.
    fn projective_row(&self) -> Option<[f64; 4]> {
        let matrix = self.matrix.as_ref()?;
        let [x, y, z, w] = [3, 7, 11, 15].map(|i| matrix[i]);
        let off = [x, y, z, w - 1.0];
        let is_affine = off.iter().all(|off| off.abs() <= AFFINE);
        (!is_affine).then_some([x, y, z, w])
    }

    fn parent_from_node(&self) -> DMat4 {
        if let Some(matrix) = &self.matrix {
            return DMat4::from_cols_array(matrix);
        }
        let or = |v: &Option<Box<[f64; 3]>>, other: DVec3| {
            v.as_ref().map_or(other, |v| DVec3::from_array(**v))
        };
        let rotation = self.rotation.as_ref().map(|r| unit(**r));
        let (scale, rotation, translation) = (
            or(&self.scale, DVec3::ONE),
            rotation.unwrap_or(DQuat::IDENTITY),
            or(&self.translation, DVec3::ZERO),
        );
        DMat4::from_scale_rotation_translation(scale, rotation, translation)
    }
}

/// A rotation of numbers whose digits make it not quite of length 1; none where they are all 0.
fn unit(rotation: [f64; 4]) -> DQuat {
    let rotation = DQuat::from_array(rotation);
    if rotation.length_squared() == 0.0 {
        return DQuat::IDENTITY;
    }
    rotation.normalize()
}

impl Copies {
    /// How many there are.
    pub(super) fn count(
        &self,
        accessors: &mut Accessors<'_>,
        record: &str,
    ) -> Result<usize, MeshFileError> {
        let mut first: Option<(&str, usize)> = None;
        for (what, accessor) in [
            ("translations", self.translation),
            ("rotations", self.rotation),
            ("scales", self.scale),
        ] {
            let Some(accessor) = accessor else {
                continue;
            };
            let count = accessors.count(accessor)?;
            let (other, expected) = *first.get_or_insert((what, count));
            if count != expected {
                return Err(failed(
                    accessors.path,
                    record,
                    format!(
                        "its copies ({INSTANCING}) have {expected} {other} and {count} {what}; \
                         export the model again"
                    ),
                ));
            }
        }
        // Where nothing tells them apart they are all in one place.
        Ok(first.map_or(1, |(_, count)| count))
    }

    /// Where in the world they are; what comes in is their node's transform, once for each.
    pub(super) fn transforms(
        &self,
        accessors: &mut Accessors<'_>,
        record: &str,
        mut world_from_copies: Vec<DMat4>,
    ) -> Result<Vec<DMat4>, MeshFileError> {
        if let Some(accessor) = self.translation {
            let translations = accessors.triples(accessor, "translations")?;
            for (transform, translation) in world_from_copies.iter_mut().zip(translations) {
                *transform *= DMat4::from_translation(translation);
            }
        }
        if let Some(accessor) = self.rotation {
            let rotations = accessors.quadruples(accessor, "rotations")?;
            for (transform, rotation) in world_from_copies.iter_mut().zip(rotations) {
                *transform *= DMat4::from_quat(unit(rotation));
            }
        }
        if let Some(accessor) = self.scale {
            let scales = accessors.triples(accessor, "scales")?;
            for (transform, scale) in world_from_copies.iter_mut().zip(scales) {
                *transform *= DMat4::from_scale(scale);
            }
        }
        match world_from_copies.iter().position(|m| !m.is_finite()) {
            None => Ok(world_from_copies),
            Some(i) => {
                let problem = format!("the transform of its copy {i} is not finite");
                Err(failed(accessors.path, record, problem))
            }
        }
    }
}

fn failed(path: &Path, record: &str, problem: String) -> MeshFileError {
    MeshFileError::Record {
        path: path.to_owned(),
        record: record.to_owned(),
        problem,
    }
}
