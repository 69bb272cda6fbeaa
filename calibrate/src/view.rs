use crate::{Lens, Pixel, Rigid3};
use glam::DVec3;

/// A posed camera with its image size: what a source view was taken with, or what a
/// desired view is to be drawn with.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Intrinsics, in pixels of a `width` × `height` image.
    pub lens: Lens,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Extrinsics.
    pub camera_from_world: Rigid3,
}

impl View {
    /// The centre of projection, in the world.
    pub fn center(&self) -> DVec3 {
        self.camera_from_world.center()
    }

    /// The camera's forward axis, in the world.
    pub fn forward(&self) -> DVec3 {
        self.camera_from_world.rotation.conjugate() * DVec3::Z
    }

    /// The camera's upward axis (−y of its frame), in the world.
    pub fn up(&self) -> DVec3 {
        self.camera_from_world.rotation.conjugate() * DVec3::NEG_Y
    }

    /// Where a point of the world falls; `None` behind the camera or beyond its lens.
    /// The pixel may lie outside the image.
    pub fn project(&self, point_in_world: DVec3) -> Option<Pixel> {
        self.lens.project(self.camera_from_world * point_in_world)
    }

    /// Whether a pixel lies inside the image, borders included.
    pub fn contains(&self, pixel: Pixel) -> bool {
        (0.0..=f64::from(self.width)).contains(&pixel.x)
            && (0.0..=f64::from(self.height)).contains(&pixel.y)
    }

    /// This camera on the way to where another one is, and turned as it is: at a share of 0 its own
    /// pose, at 1 the other's.
    #[must_use]
    pub fn between(&self, other: &Self, share: f64) -> Self {
        let (from, to) = (self.camera_from_world, other.camera_from_world);
        let rotation = from.rotation.slerp(to.rotation, share).normalize();
        let center = from.center().lerp(to.center(), share);
        Self {
            camera_from_world: Rigid3::new(rotation, -(rotation * center)),
            ..self.clone()
        }
    }

    /// The same camera with another image size: focal lengths and principal point follow.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let (sx, sy) = (
            f64::from(width) / f64::from(self.width),
            f64::from(height) / f64::from(self.height),
        );
        Self {
            lens: self.lens.scaled(sx, sy),
            width,
            height,
            ..self.clone()
        }
    }
}
