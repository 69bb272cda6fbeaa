//! The plane in which what a pixel shows is sharp, as a camera is focused on it.

use crate::cloud::median;
use crate::{Plane, PlaneError};
use calibrate::{Pixel, View};
use glam::DVec3;

/// How many points nearest to the pixel decide.
const NEAREST: usize = 9;
/// Of those, the ones within this share of the image's diagonal, unless there are fewer than
/// [`ENOUGH`].
const NEAR: f64 = 0.05;
const ENOUGH: usize = 3;

/// Why nothing could be focused on.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FocusError {
    /// No such pixel.
    #[error("the pixel {x}, {y} lies outside the photo of {width} × {height}; choose one inside")]
    Outside {
        /// What was asked for, in pixels.
        x: f64,
        /// What was asked for, in pixels.
        y: f64,
        /// The photo's.
        width: u32,
        /// The photo's.
        height: u32,
    },
    /// Nothing to take the depth from.
    #[error(
        "the photo sees no sparse point to take the depth at {x}, {y} from; focus on another \
         photo, or give the plane by hand (`proxy SCENE plane --point X,Y,Z --normal X,Y,Z`)"
    )]
    NoPoints {
        /// What was asked for, in pixels.
        x: f64,
        /// What was asked for, in pixels.
        y: f64,
    },
    /// The camera's pose is not finite.
    #[error(transparent)]
    Plane(#[from] PlaneError),
}

/// The plane parallel to a photo's image plane through what the photo shows at a pixel: at
/// the median depth of the points nearest to it. Its normal is the camera's axis.
///
/// `points_in_world` are those that the photo observes; others would be taken for seen, too.
/// Those behind the camera or outside the image don't count.
///
/// # Errors
/// A pixel outside the image; no point inside it.
pub fn plane_focused_on(
    view: &View,
    pixel: Pixel,
    points_in_world: &[DVec3],
) -> Result<Plane, FocusError> {
    let Pixel { x, y } = pixel;
    if !view.contains(pixel) {
        return Err(FocusError::Outside {
            x,
            y,
            width: view.width,
            height: view.height,
        });
    }
    // 1. Depths of the points in the image, by their distance from the pixel.
    let mut seen: Vec<(f64, f64)> = points_in_world
        .iter()
        .filter_map(|point| {
            let depth = (view.camera_from_world * *point).z;
            let at = view.project(*point).filter(|&at| view.contains(at))?;
            (depth > 0.0 && depth.is_finite()).then(|| (at.distance(pixel), depth))
        })
        .collect();
    if seen.is_empty() {
        return Err(FocusError::NoPoints { x, y });
    }
    seen.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));

    // 2. The middle one of the nearest: of two surfaces, that which has more points there.
    let diagonal = f64::from(view.width).hypot(f64::from(view.height));
    let near = seen.partition_point(|s| s.0 <= NEAR * diagonal);
    seen.truncate(near.clamp(ENOUGH, NEAREST));
    let depth = median(seen.iter().map(|s| s.1).collect());
    let forward = view.forward();
    Ok(Plane::new(view.center() + forward * depth, forward)?)
}
