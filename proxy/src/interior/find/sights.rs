//! Lines of sight out of depth maps.

use calibrate::{DepthAlong, Pixel, View};
use capture::DepthMap;
use glam::DVec3;

/// From a camera to what a depth map shows, at every so-manieth column and row with a depth, which is what
/// [`DepthAlong`] says.
pub fn sights(view: &View, depth: &DepthMap, every: u32) -> Vec<[DVec3; 2]> {
    let world_from_camera = view.camera_from_world.inverse();
    let (center, along) = (view.center(), DepthAlong::of_view(view));
    let every = every.max(1);
    let mut sights = Vec::new();
    for row in (every / 2..depth.height).step_by(every as usize) {
        for column in (every / 2..depth.width).step_by(every as usize) {
            let index = row as usize * depth.width as usize + column as usize;
            let known = depth.depths.get(index).map(|d| f64::from(*d));
            let Some(depth_there) = known.filter(|d| *d > 0.0 && d.is_finite()) else {
                continue;
            };
            let ray = view.lens.unproject(Pixel::center_of(column, row));
            let Some(ray) = ray.and_then(|ray| along.ray(ray)) else {
                continue;
            };
            let point = world_from_camera * (ray * depth_there);
            if point.is_finite() && center.is_finite() {
                sights.push([center, point]);
            }
        }
    }
    sights
}
