//! COLMAP's models as OpenCV's, where they are the same lens.

use super::ExportError;
use crate::{Camera, CameraId, Distortion, Lens};

/// What OpenCV's two models have in common with ours.
pub(super) enum Terms {
    /// k₁ … k₆ and p₁, p₂; all zero for a pinhole.
    Standard { k: [f64; 6], p: [f64; 2] },
    /// The fisheye's polynomial.
    Fisheye { k: [f64; 4] },
}

/// A camera's lens and its terms in OpenCV's model.
///
/// # Errors
/// The camera has no lens, or one that is neither of OpenCV's.
pub(super) fn terms(
    id: CameraId,
    camera: &Camera,
    format: &'static str,
) -> Result<(Lens, Terms), ExportError> {
    let lens = camera.lens().map_err(|source| ExportError::Camera {
        camera_id: id.0,
        source,
    })?;
    let terms = match lens.distortion() {
        Distortion::None => Terms::Standard {
            k: [0.0; 6],
            p: [0.0; 2],
        },
        Distortion::Rational { k, p } => Terms::Standard { k, p },
        Distortion::Fisheye { k } => Terms::Fisheye { k },
        _ => return Err(refused(id, camera, "", format)),
    };
    Ok((lens, terms))
}

/// The error that a format lacks a lens.
pub(super) fn refused(
    id: CameraId,
    camera: &Camera,
    what: &'static str,
    format: &'static str,
) -> ExportError {
    ExportError::Lens {
        camera_id: id.0,
        model: camera.model.name(),
        what,
        format,
    }
}
