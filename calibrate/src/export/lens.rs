//! COLMAP's models as OpenCV's, where they are the same lens.

use super::ExportError;
use crate::{Camera, CameraId, Distortion, Lens, Reconstruction};

/// What OpenCV's two models have in common with ours.
pub(super) enum Terms {
    /// As [`Distortion::Tilted`]'s; all zero for a pinhole.
    Standard {
        k: [f64; 6],
        p: [f64; 2],
        s: [f64; 4],
        tau: [f64; 2],
    },
    /// As [`Distortion::SkewedFisheye`]'s.
    Fisheye { k: [f64; 4], alpha: f64 },
}

/// A camera's lens.
///
/// # Errors
/// The camera has none.
pub(super) fn lens(id: CameraId, camera: &Camera) -> Result<Lens, ExportError> {
    camera.lens().map_err(|source| ExportError::Camera {
        camera_id: id.0,
        source,
    })
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
    let lens = lens(id, camera)?;
    let flat = |k, p| Terms::Standard {
        k,
        p,
        s: [0.0; 4],
        tau: [0.0; 2],
    };
    let terms = match lens.distortion() {
        Distortion::None => flat([0.0; 6], [0.0; 2]),
        Distortion::Rational { k, p } => flat(k, p),
        Distortion::Tilted { k, p, s, tau } => Terms::Standard { k, p, s, tau },
        Distortion::Fisheye { k } => Terms::Fisheye { k, alpha: 0.0 },
        Distortion::SkewedFisheye { k, alpha } => Terms::Fisheye { k, alpha },
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
        model: camera.model,
        what,
        format,
    }
}

/// Whether COLMAP has all cameras' models. Our own reading of its text format knows others.
///
/// # Errors
/// A camera whose model COLMAP lacks.
pub fn check_colmap(reconstruction: &Reconstruction) -> Result<(), ExportError> {
    let lacking = |(_, camera): &(&CameraId, &Camera)| camera.model.colmap_id().is_none();
    match reconstruction.cameras.iter().find(lacking) {
        Some((&id, camera)) => Err(refused(id, camera, "", "COLMAP")),
        None => Ok(()),
    }
}

/// Whether COLMAP reads all photos' names from its text format, too, as well as their cameras'
/// models. Our own reading of that format takes names with blanks as they are.
///
/// # Errors
/// As [`check_colmap`]; a photo with white space in its name.
pub fn check_colmap_text(reconstruction: &Reconstruction) -> Result<(), ExportError> {
    check_colmap(reconstruction)?;
    let mut names = reconstruction.images.values().map(|image| &image.name);
    match names.find(|name| name.contains(char::is_whitespace)) {
        Some(name) => Err(ExportError::WhiteSpace { name: name.clone() }),
        None => Ok(()),
    }
}
