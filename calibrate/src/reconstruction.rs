use crate::{Camera, CameraId, Rigid3};
use glam::DVec3;
use std::collections::BTreeMap;

/// The id of an image in a reconstruction: sparse, chosen by whoever made it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ImageId(pub u32);

/// The id of a sparse point: sparse, chosen by whoever made it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Point3DId(pub u64);

/// A calibrated photo set: cameras, posed images and sparse points, as structure from
/// motion leaves them. Units are the capture's own.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reconstruction {
    /// Camera models; several images may share one.
    pub cameras: BTreeMap<CameraId, Camera>,
    /// Posed images.
    pub images: BTreeMap<ImageId, Image>,
    /// Sparse points.
    pub points: BTreeMap<Point3DId, Point3D>,
}

/// One posed photo.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// The photo's path relative to the photo folder, `/` between its parts.
    pub name: String,
    /// Which of the reconstruction's cameras took it.
    pub camera_id: CameraId,
    /// Its pose.
    pub camera_from_world: Rigid3,
    /// The features found in it. A point's track refers to them by index.
    pub keypoints: Vec<Keypoint>,
}

/// A feature found in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keypoint {
    /// Pixels, the first pixel's centre at (0.5, 0.5).
    pub x: f64,
    /// Pixels.
    pub y: f64,
    /// The sparse point it is an observation of, if any.
    pub point: Option<Point3DId>,
}

/// A sparse point.
#[derive(Clone, Debug, PartialEq)]
pub struct Point3D {
    /// In the world.
    pub position: DVec3,
    /// sRGB.
    pub color: [u8; 3],
    /// Mean reprojection error in pixels; negative where it was never computed.
    pub error_px: f64,
    /// The images that see it, each with the index of its keypoint there.
    pub track: Vec<(ImageId, u32)>,
}
