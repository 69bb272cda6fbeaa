//! A desired camera as the walk's drawing takes it.

use calibrate::{Distortion, View};
use glam::{DMat3, DVec2, DVec3};

/// A camera without distortion, with the rays of its pixels.
///
/// Relative to it a point is `rotation * (point_in_world - center)`: centres are subtracted
/// first, so that digits stay far from the world's origin.
#[derive(Clone, Debug)]
pub struct Pinhole {
    /// The centre of projection, in the world.
    pub center: DVec3,
    /// From the world's axes to the camera's.
    pub rotation: DMat3,
    /// In pixels.
    pub focal: DVec2,
    /// In pixels.
    pub principal: DVec2,
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
    /// x of each column's ray, where z is 1.
    pub(super) columns: Vec<f64>,
    /// y of each row's ray, where z is 1.
    pub(super) rows: Vec<f64>,
}

/// Why a walk does not draw a view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PinholeError {
    /// Its lens bends straight lines.
    #[error("its lens is distorted; interiors are drawn for cameras without distortion")]
    Distorted,
    /// NaN, infinite, or a focal length that is not positive.
    #[error("its pose or lens is not finite, or a focal length is not positive")]
    NotFinite,
    /// No pixels, or more than a picture has.
    #[error("its picture has {0} × {1} pixels; expected 1 to {MAX_SIDE} each way")]
    Size(u32, u32),
}

/// Pixels are counted in 16 bits.
pub(crate) const MAX_SIDE: u32 = 16_384;

impl Pinhole {
    /// The camera of a view.
    ///
    /// # Errors
    /// A lens with distortion; numbers that are not finite; no pixels.
    pub fn new(view: &View) -> Result<Self, PinholeError> {
        let (width, height) = (view.width, view.height);
        if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
            return Err(PinholeError::Size(width, height));
        }
        if view.lens.distortion() != Distortion::None {
            return Err(PinholeError::Distorted);
        }
        let (focal, principal) = (view.lens.focal, view.lens.principal);
        let is_usable = focal.is_finite() && focal.min_element() > 0.0 && principal.is_finite();
        if !is_usable || !view.camera_from_world.is_finite() {
            return Err(PinholeError::NotFinite);
        }
        let ray = |i: u32, axis: usize| (f64::from(i) + 0.5 - principal[axis]) / focal[axis];
        Ok(Self {
            center: view.center(),
            rotation: view.camera_from_world.matrix(),
            focal,
            principal,
            width,
            height,
            columns: (0..width).map(|x| ray(x, 0)).collect(),
            rows: (0..height).map(|y| ray(y, 1)).collect(),
        })
    }

    /// A point of the world relative to the camera.
    #[inline]
    pub fn point(&self, point_in_world: DVec3) -> DVec3 {
        self.rotation * (point_in_world - self.center)
    }

    /// The ray through a pixel's centre, z = 1, in the camera's frame.
    #[inline]
    pub fn ray(&self, x: u32, y: u32) -> DVec3 {
        DVec3::new(self.columns[x as usize], self.rows[y as usize], 1.0)
    }

    /// The least and greatest x / z and y / z that the image shows.
    pub(super) fn bounds(&self) -> [DVec2; 2] {
        let size = DVec2::new(f64::from(self.width), f64::from(self.height));
        [
            -self.principal / self.focal,
            (size - self.principal) / self.focal,
        ]
    }
}

impl Pinhole {
    /// Without pixels.
    pub(super) fn nowhere() -> Self {
        Self {
            center: DVec3::ZERO,
            rotation: DMat3::IDENTITY,
            focal: DVec2::ONE,
            principal: DVec2::ZERO,
            width: 0,
            height: 0,
            columns: Vec::new(),
            rows: Vec::new(),
        }
    }
}
