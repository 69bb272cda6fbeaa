use crate::{Lens, Pixel};
use glam::DVec3;

/// Where a sparse point falls by the calibration, beside where it was observed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reprojection {
    /// So many pixels from there.
    Off(f64),
    /// Nowhere: it lies behind the camera, whose lens does not see it there.
    Behind,
    /// Nowhere: it lies in front of the camera, but beyond the range in which the lens maps rays one to one, or so far
    /// out that numbers overflow. Wrong distortion coefficients do so.
    BeyondLens,
}

impl Reprojection {
    /// That of a point in the camera's frame.
    pub(crate) fn of(lens: &Lens, point_in_camera: DVec3, observed: Pixel) -> Self {
        let projected = lens.project(point_in_camera);
        match projected.map(|pixel| pixel.distance(observed)) {
            Some(px) if px.is_finite() => Self::Off(px),
            _ if point_in_camera.z > 0.0 => Self::BeyondLens,
            _ => Self::Behind,
        }
    }

    /// The distance in pixels; infinite where the point falls nowhere.
    pub fn px(self) -> f64 {
        match self {
            Self::Off(px) => px,
            Self::Behind | Self::BeyondLens => f64::INFINITY,
        }
    }
}
