//! What one depth map says by itself, and how noisy it is.

use super::frame::{Frame, Inverse, Rays, Statistics, Trust};
use super::{DepthError, JUDGED, check_frame};
use calibrate::{DepthAlong, View};
use capture::DepthMap;

/// How sure depth maps are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthNoise {
    /// The standard deviation of inverse depths, in 1 / world units: of a depth z it is this times
    /// z². What neighbouring pixels do not explain, rounding included.
    pub inverse_depth: f64,
    /// The median depth, in world units.
    pub depth: f64,
}

/// Estimates the noise of some depth maps, of twelve spread over all. `frame` gives one of a number
/// below `count` with the view that saw it.
///
/// # Errors
/// Those of `frame`; depth maps that don't fit their views, or say nothing.
pub fn noise<E: Into<Box<dyn std::error::Error + Send + Sync>>>(
    count: usize,
    mut frame: impl FnMut(usize) -> Result<(View, DepthMap), E>,
) -> Result<DepthNoise, DepthError> {
    if count == 0 {
        return Err(DepthError::NoFrames);
    }
    let mut rays = Rays::default();
    let mut statistics = Statistics::default();
    for number in (0..count).step_by(count.div_ceil(JUDGED)) {
        let (view, depth) = frame(number).map_err(|e| DepthError::Frame(number, e.into()))?;
        check_frame(number, &view, &depth)?;
        let rays = rays.of(&view.lens, depth.width, depth.height);
        statistics.add(&Inverse::new(view, &depth, rays));
    }
    Ok(DepthNoise {
        inverse_depth: statistics.noise(),
        depth: statistics.depth().ok_or(DepthError::NoDepth(count))?,
    })
}

/// The inverse depths of a map along its camera's axis that neighbours confirm, row by row; 0 where a pixel saw two
/// surfaces mixed, or one that slants by more than `max_slant` radians, or nothing.
///
/// # Errors
/// A depth map that does not fit its view; a view without a pose.
pub fn believed(
    view: &View,
    depth: &DepthMap,
    noise: DepthNoise,
    max_slant: f64,
) -> Result<Vec<f32>, DepthError> {
    check_frame(0, view, depth)?;
    let mut rays = Rays::default();
    let rays = rays.of(&view.lens, depth.width, depth.height);
    let trust = Trust {
        max_slant,
        max_depth: f64::INFINITY,
        max_footprint: f64::INFINITY,
        noise: noise.inverse_depth,
        unit_depth: noise.depth,
    };
    let frame = Frame::new(&Inverse::new(view.clone(), depth, rays), &trust);
    let along = DepthAlong::of_view(view);
    let samples = frame.samples.iter().zip(rays);
    let inverse =
        samples.map(|(sample, ray)| along.inverse_along_axis(*ray, sample.inverse.into()) as f32);
    Ok(inverse.collect())
}
