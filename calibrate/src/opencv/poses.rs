//! The poses of a storage file: of the board's frame in each photo's camera, or of a
//! stereo rig.

use super::OpenCvError;
use super::storage::{Node, Value};
use super::values::{Named, Values};
use crate::Rigid3;
use glam::{DMat3, DQuat, DVec3};

/// How far from 0 an entry of RᵀR − I may be: files in single precision, and by hand.
const ROTATION_TOLERANCE: f64 = 1e-4;

/// `camera_from_world` of each view, from `extrinsic_parameters` or `rvecs` and `tvecs`;
/// none where the file has neither.
pub(super) fn of_views(values: &Values<'_>) -> Result<Vec<Rigid3>, OpenCvError> {
    let six = ["extrinsicparameters", "extrinsicparams", "extrinsics"];
    if let Some(named) = values.find_within(&six)
        && let Some(matrix) = named.node.matrix()
        && !matrix.data.is_empty()
    {
        let per_row = matrix.cols * matrix.channels;
        if per_row != 6 && !(matrix.channels == 6 && matrix.rows == 1) {
            let hint = if matrix.rows == 6 {
                "; transpose it"
            } else {
                ""
            };
            let problem = format!(
                "the poses are {}, expected N × 6, a rotation vector and a translation in each \
                 row{hint}",
                matrix.shape()
            );
            return Err(values.refuse(named, problem));
        }
        let rows = matrix.data.chunks_exact(6).enumerate();
        return rows
            .map(|(row, c)| pose(values, named, row, [c[0], c[1], c[2]], [c[3], c[4], c[5]]))
            .collect();
    }
    let rotations = values.find_within(&["rvecs", "rvec", "rotationvectors", "rotationvector"]);
    let translations =
        values.find_within(&["tvecs", "tvec", "translationvectors", "translationvector"]);
    let (Some(rotations), Some(translations)) = (rotations, translations) else {
        return Ok(Vec::new());
    };
    let (r, t) = (triples(values, rotations)?, triples(values, translations)?);
    if r.len() != t.len() {
        let problem = format!(
            "{} rotations, but {} holds {} translations; expected as many",
            r.len(),
            translations.path,
            t.len()
        );
        return Err(values.refuse(rotations, problem));
    }
    let both = r.into_iter().zip(t).enumerate();
    both.map(|(row, (r, t))| pose(values, rotations, row, r, t))
        .collect()
}

/// `right_from_left` of a stereo rig, from `R` and `T`.
pub(super) fn of_rig(values: &Values<'_>) -> Result<Option<Rigid3>, OpenCvError> {
    let matrix = |names: &[&str]| {
        let named = values.find(names)?;
        Some((named, named.node.matrix()?))
    };
    let rotation = matrix(&["r", "stereor", "rotation", "rotationmatrix"]);
    let translation = matrix(&["t", "stereot", "translation", "translationvector"]);
    let (Some((named, r)), Some((t_named, t))) = (rotation, translation) else {
        return Ok(None);
    };
    let &[x, y, z] = t.data.as_slice() else {
        let problem = format!("the translation is {}, expected 3 × 1", t.shape());
        return Err(values.refuse(t_named, problem));
    };
    if let &[a, b, c] = r.data.as_slice() {
        return pose(values, named, 0, [a, b, c], [x, y, z]).map(Some);
    }
    if (r.rows, r.cols, r.channels) != (3, 3, 1) {
        let problem = format!("the rotation is {}, expected 3 × 3", r.shape());
        return Err(values.refuse(named, problem));
    }
    let rotation = DMat3::from_cols_slice(&r.data).transpose();
    let pose = Rigid3::from_matrix(rotation, DVec3::new(x, y, z), ROTATION_TOLERANCE);
    pose.map(Some).ok_or_else(|| {
        let problem = "no rotation (its columns are not unit vectors at right angles, it mirrors, \
                       or the translation is not finite); calibrate again";
        values.refuse(named, problem)
    })
}

fn pose(
    values: &Values<'_>,
    named: &Named<'_>,
    row: usize,
    rotation: [f64; 3],
    translation: [f64; 3],
) -> Result<Rigid3, OpenCvError> {
    let pose = Rigid3 {
        rotation: DQuat::from_scaled_axis(DVec3::from_array(rotation)),
        translation: DVec3::from_array(translation),
    };
    if pose.is_finite() {
        return Ok(pose);
    }
    let problem = format!(
        "view {} is rotated by {rotation:?} and moved by {translation:?}, expected finite numbers",
        row + 1
    );
    Err(values.refuse(named, problem))
}

/// Vectors of three, in any of the ways that OpenCV and its users write them: N × 3,
/// N of three channels, one 3 × 1, or a sequence of any of these.
fn triples(values: &Values<'_>, named: &Named<'_>) -> Result<Vec<[f64; 3]>, OpenCvError> {
    fn collect(node: &Node, into: &mut Vec<[f64; 3]>) -> Option<()> {
        if let Some(matrix) = node.matrix() {
            let in_rows = matrix.cols * matrix.channels == 3 || matrix.channels == 3;
            let (triples, rest) = matrix.data.as_chunks::<3>();
            if !rest.is_empty() || !(in_rows || matrix.data.len() == 3) {
                return None;
            }
            into.extend(triples);
            return Some(());
        }
        match &node.value {
            Value::Sequence(nodes) => nodes.iter().try_for_each(|node| collect(node, into)),
            Value::Map(entries) => entries.iter().try_for_each(|(_, node)| collect(node, into)),
            _ => None,
        }
    }
    let mut found = Vec::new();
    collect(named.node, &mut found).ok_or_else(|| {
        let shape = named
            .node
            .matrix()
            .map_or("no list of vectors".to_owned(), |m| m.shape());
        values.refuse(
            named,
            format!("found {shape}, expected vectors of three (N × 3)"),
        )
    })?;
    Ok(found)
}
