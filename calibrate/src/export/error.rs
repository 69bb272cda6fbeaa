use crate::CameraError;

/// Why a reconstruction cannot be said in another program's format.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExportError {
    /// A lens that the format lacks.
    #[error(
        "camera {camera_id} is {model}{what}, which {format} cannot express; import the photos \
         with --undistort and export that scene, or export as colmap"
    )]
    Lens {
        /// The camera.
        camera_id: u32,
        /// Its model, by COLMAP's name.
        model: &'static str,
        /// What about it, beginning with a blank; empty: all of it.
        what: &'static str,
        /// The format.
        format: &'static str,
    },
    /// Lenses that cannot stand in one file.
    #[error(
        "camera {fisheye} ({fisheye_model}) is a fisheye and camera {other} ({other_model}) is \
         not, and transforms.json has one camera_model for all; import the photos with \
         --undistort and export that scene, or export as colmap"
    )]
    Mixed {
        /// A fisheye.
        fisheye: u32,
        /// Its model.
        fisheye_model: &'static str,
        /// One that is none.
        other: u32,
        /// Its model.
        other_model: &'static str,
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
    /// There is nothing to export.
    #[error("the reconstruction has no images; there is nothing to export")]
    NoImages,
}
