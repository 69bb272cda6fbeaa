use crate::{CameraError, ModelKind};

/// Why a reconstruction cannot be said in another program's format.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExportError {
    /// A lens that the format lacks.
    #[error(
        "camera {camera_id} is {}{what}, which {format} cannot express; {}",
        model.name(), remedy(*model)
    )]
    Lens {
        /// The camera.
        camera_id: u32,
        /// Its model.
        model: ModelKind,
        /// What about it, beginning with a blank; empty: all of it.
        what: &'static str,
        /// The format.
        format: &'static str,
    },
    /// Lenses that cannot stand in one file.
    #[error(
        "camera {camera_id} ({}) is a {} and camera {other} ({}) is \
         not, and transforms.json has one camera_model for all; {}",
        model.name(), kind_of(*model), other_model.name(), remedy_beside(*model)
    )]
    Mixed {
        /// A fisheye or panorama.
        camera_id: u32,
        /// Its model.
        model: ModelKind,
        /// One that is none.
        other: u32,
        /// Its model.
        other_model: ModelKind,
    },
    /// Several cameras where the format has one.
    #[error(
        "the photos were taken with {0} cameras, but the poses in an OpenCV file are those of \
         one; export as colmap or transforms"
    )]
    Cameras(usize),
    /// A camera is unusable.
    #[error("camera {camera_id}: {source}")]
    Camera {
        /// The camera.
        camera_id: u32,
        /// What is wrong with it.
        source: CameraError,
    },
    /// A photo whose name COLMAP would read in part.
    #[error(
        "photo {name:?} has white space in its name, where COLMAP ends a name in its text format; \
         export with --format colmap, or rename the photo and import again"
    )]
    WhiteSpace {
        /// The photo's name.
        name: String,
    },
    /// There is nothing to export.
    #[error("the reconstruction has no images; there is nothing to export")]
    NoImages,
}

/// What a camera is that cannot stand beside others.
fn kind_of(model: ModelKind) -> &'static str {
    match model {
        ModelKind::Equirectangular => "panorama",
        _ => "fisheye",
    }
}

/// What to do about such a one: nothing undistorts panoramas.
fn remedy_beside(model: ModelKind) -> &'static str {
    match model {
        ModelKind::Equirectangular => "export as colmap",
        _ => "import the photos with --undistort and export that scene, or export as colmap",
    }
}

/// What to do about a model that some format lacks.
fn remedy(model: ModelKind) -> &'static str {
    match model {
        ModelKind::Equirectangular => "export as colmap, or cut the panoramas into views first",
        ModelKind::OpenCvTilted | ModelKind::OpenCvSkewedFisheye => {
            "import the photos with --undistort and export that scene, or export as opencv"
        }
        _ if model.colmap_id().is_some() => {
            "import the photos with --undistort and export that scene, or export as colmap"
        }
        _ => "import the photos with --undistort and export that scene",
    }
}
