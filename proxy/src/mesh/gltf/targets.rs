//! Morph targets, or shape keys, which move a primitive's corners by as much as their weights say.

use super::accessor::Accessors;
use crate::mesh::MeshFileError;
use glam::DVec3;
use serde::Deserialize;

/// A target of a primitive.
#[derive(Deserialize)]
pub(super) struct Target {
    #[serde(rename = "POSITION")]
    position: Option<usize>,
}

/// How far targets of such weights move each of so many corners, in their mesh's frame; none where they move
/// nothing.
pub(super) fn moves(
    accessors: &mut Accessors<'_>,
    targets: &[Target],
    weights: &[f64],
    corners: usize,
) -> Result<Vec<DVec3>, MeshFileError> {
    let mut sums = Vec::new();
    for (target, weight) in targets.iter().zip(weights) {
        let Some(accessor) = target.position.filter(|_| *weight != 0.0) else {
            continue;
        };
        let moves = accessors.filled_triples(accessor, corners, "moves of a target")?;
        sums.resize(corners, DVec3::ZERO);
        for (sum, by) in sums.iter_mut().zip(moves) {
            *sum += *weight * by;
        }
    }
    Ok(sums)
}
