//! A sensor that does not stand upright behind its lens, as the fast engines draw through it.

use calibrate::Lens;
use glam::DVec2;

/// With (x, y) the distorted coordinates, those on the sensor are
/// (x + shear.x·y, y + shear.y·x)/(1 + horizon · (x, y)), seen where the divisor is positive;
/// focal lengths and principal point make pixels of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sensor {
    /// By the other coordinate.
    pub shear: DVec2,
    /// The line that is seen infinitely far away.
    pub horizon: DVec2,
}

/// The focal lengths, and the sensor where it is tilted or skewed. A tilt's scales along x
/// and y are in the focal lengths.
pub(crate) fn focal_and_sensor(lens: &Lens) -> (DVec2, Option<Sensor>) {
    let Some(homography) = lens.distortion().sensor() else {
        return (lens.focal, None);
    };
    let (x, y) = (homography.x_axis, homography.y_axis);
    let sensor = Sensor {
        shear: DVec2::new(y.x / x.x, x.y / y.y),
        horizon: DVec2::new(x.z, y.z),
    };
    let scale = DVec2::new(x.x, y.y);
    (lens.focal * scale, Some(sensor))
}
