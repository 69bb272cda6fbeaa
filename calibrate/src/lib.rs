//! Camera models and poses; reading and writing calibrations.
//!
//! Conventions, decided once for the whole project:
//!
//! - The **camera frame** has x right, y down and z forward, as in COLMAP and OpenCV.
//! - Poses are named by their frames: `camera_from_world` maps a point in the world to
//!   the same point in the camera's frame.
//! - **Pixels**: the image's top-left corner is (0, 0) and the first pixel's centre is
//!   (0.5, 0.5), as in COLMAP. OpenCV puts that centre at (0, 0).

mod camera;
pub mod colmap;
mod depth_along;
mod excerpt;
pub mod export;
pub mod exposure;
pub mod formats;
mod lens;
pub mod opencv;
mod period;
mod reconstruction;
mod reprojection;
mod resized;
mod rigid;
mod spread;
mod ties;
pub mod undistort;
mod view;

pub use camera::{Camera, CameraError, CameraId, ModelKind};
pub use depth_along::DepthAlong;
pub use lens::{Distortion, Lens, Pixel, Projection};
pub use period::{MIN_PHOTOS, Period, PeriodError, Snapshot, find_period};
pub use reconstruction::{Image, ImageId, Keypoint, Point3D, Point3DId, Reconstruction};
pub use reprojection::Reprojection;
pub use rigid::Rigid3;
pub use spread::{outer, principal_axes};
pub use ties::{TRUSTED_TIE, WeakGroup};
pub use view::View;
