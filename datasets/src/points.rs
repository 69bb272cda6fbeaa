//! Sparse points as structure from motion leaves them, but exact.

use crate::noise::unit;
use calibrate::{ImageId, Keypoint, Pixel, Point3D, Point3DId, Reconstruction, View};
use glam::DVec3;

/// A place is seen where the ray towards it ends this near to it, relative to its length.
const SAME_PLACE: f64 = 1e-9;

/// What the photo of an index shows along a ray.
pub(crate) trait Seen {
    /// The place that is met and its colour; `None` where it is nothing that could be found
    /// again in another photo.
    fn trace(&self, view_idx: usize, from: DVec3, direction: DVec3) -> Option<(DVec3, [u8; 3])>;

    /// How far away the first surface is, in world units.
    fn distance(&self, view_idx: usize, from: DVec3, direction: DVec3) -> Option<f64>;
}

/// Adds about `count` surface points to `reconstruction`, whose images must be `views` in
/// order with ids from 1: each is visible in all images of its track (two at least), and
/// its keypoints are its exact projections.
pub(crate) fn sparse_points(
    views: &[&View],
    seen: &impl Seen,
    count: usize,
    seed: u32,
    reconstruction: &mut Reconstruction,
) {
    let mut next_id = 1;
    for i in 0..count {
        // 1. A random pixel of each view in turn shows a surface point.
        let first = i % views.len();
        let view = views[first];
        let pixel = Pixel::new(
            f64::from(view.width) * unit(seed, i as i32, 0, 9),
            f64::from(view.height) * unit(seed, i as i32, 1, 9),
        );
        let Some(ray) = view.lens.unproject(pixel) else {
            continue;
        };
        let direction = view.camera_from_world.rotation.conjugate() * ray;
        let Some((position, color)) = seen.trace(first, view.center(), direction) else {
            continue;
        };
        // 2. Which views see it?
        let track: Vec<(usize, Pixel)> = (0..views.len())
            .filter_map(|v| Some((v, seen_at(seen, v, views[v], position)?)))
            .collect();
        if track.len() < 2 {
            continue;
        }
        // 3. Note it down on both sides.
        let id = Point3DId(next_id);
        next_id += 1;
        let observations = track.into_iter().map(|(v, pixel)| {
            let image_id = ImageId(v as u32 + 1);
            let image = reconstruction
                .images
                .get_mut(&image_id)
                .expect("an image for each view");
            image.keypoints.push(Keypoint {
                x: pixel.x,
                y: pixel.y,
                point: Some(id),
            });
            (image_id, image.keypoints.len() as u32 - 1)
        });
        let track = observations.collect();
        reconstruction.points.insert(
            id,
            Point3D {
                position,
                color,
                error_px: 0.0,
                track,
            },
        );
    }
}

/// Where a view sees a surface point; `None` outside its image and behind other things.
fn seen_at(seen: &impl Seen, view_idx: usize, view: &View, point: DVec3) -> Option<Pixel> {
    let pixel = view.project(point).filter(|&pixel| view.contains(pixel))?;
    let to_point = point - view.center();
    let distance = seen.distance(view_idx, view.center(), to_point)?;
    let expected = to_point.length();
    ((distance - expected).abs() <= SAME_PLACE * expected).then_some(pixel)
}
