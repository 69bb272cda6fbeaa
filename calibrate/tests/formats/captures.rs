//! Where the real examples are.

use calibrate::{CameraId, Reconstruction, Rigid3};
use std::path::PathBuf;

const CAPTURES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/captures");

/// A file among the captures, or a loud `None`.
pub(crate) fn capture(file: &str) -> Option<PathBuf> {
    let path = PathBuf::from(CAPTURES).join(file);
    if !path.exists() {
        eprintln!("SKIPPED: {} is absent", path.display());
        return None;
    }
    Some(path)
}

/// The distances between all keypoints and their points' projections, in pixels.
pub(crate) fn reprojection_errors_px(whole: &Reconstruction) -> Vec<f64> {
    let ids: Vec<CameraId> = whole.cameras.keys().copied().collect();
    ids.into_iter()
        .flat_map(|id| whole.reprojection_errors_px(id).unwrap())
        .collect()
}

pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The angle between two rotations in radians, exact for tiny ones too.
pub(crate) fn angle_between(a: Rigid3, b: Rigid3) -> f64 {
    let turn = a.rotation * b.rotation.conjugate();
    2.0 * turn.xyz().length().atan2(turn.w.abs())
}
