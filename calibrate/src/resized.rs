//! Cameras of photos that were reduced or enlarged after they were calibrated.

use crate::{Camera, CameraError, CameraId, ImageId, Reconstruction};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};

impl Reconstruction {
    /// Gives images other sizes (width and height in pixels), as if their pictures had been stretched to them: focal
    /// lengths, principal points and keypoints follow, each axis by its own ratio. Images that share a camera and a
    /// size share one afterwards; cameras that no image has go. Points' errors are scaled by the mean over their
    /// observations.
    ///
    /// # Errors
    /// A camera whose parameters make no lens, with an image of it; all is as it was then.
    pub fn resize_images(
        &mut self,
        sizes: &BTreeMap<ImageId, (u32, u32)>,
    ) -> Result<(), (ImageId, CameraError)> {
        // 1. The cameras.
        let mut cameras = self.cameras.clone();
        let mut resized: BTreeMap<(CameraId, (u32, u32)), CameraId> = BTreeMap::new();
        for (image_id, &size) in sizes {
            let Some(image) = self.images.get(image_id) else {
                continue;
            };
            let id = image.camera_id;
            let camera = &self.cameras[&id];
            if size == (camera.width, camera.height) {
                continue;
            }
            if let Entry::Vacant(entry) = resized.entry((id, size)) {
                let lens = camera.lens().map_err(|error| (*image_id, error))?;
                let [sx, sy] = ratios(camera, size);
                let next = cameras.keys().next_back().map_or(1, |id| id.0 + 1);
                let new = CameraId(next);
                cameras.insert(new, Camera::of(&lens.scaled(sx, sy), size.0, size.1));
                entry.insert(new);
            }
        }

        // 2. Their images.
        let mut scales: BTreeMap<ImageId, f64> = BTreeMap::new();
        for (image_id, &size) in sizes {
            let Some(image) = self.images.get_mut(image_id) else {
                continue;
            };
            let Some(&new) = resized.get(&(image.camera_id, size)) else {
                continue;
            };
            let [sx, sy] = ratios(&self.cameras[&image.camera_id], size);
            image.camera_id = new;
            for keypoint in &mut image.keypoints {
                keypoint.x *= sx;
                keypoint.y *= sy;
            }
            scales.insert(*image_id, (sx * sy).sqrt());
        }
        let used: BTreeSet<CameraId> = self.images.values().map(|image| image.camera_id).collect();
        cameras.retain(|id, _| used.contains(id));
        self.cameras = cameras;

        // 3. What is known of their points.
        let known = self.points.values_mut();
        for point in known.filter(|point| point.error_px >= 0.0 && !point.track.is_empty()) {
            let scale = |(id, _): &(ImageId, u32)| scales.get(id).copied().unwrap_or(1.0);
            let sum: f64 = point.track.iter().map(scale).sum();
            point.error_px *= sum / point.track.len() as f64;
        }
        Ok(())
    }
}

/// New pixels an old one, across and down.
fn ratios(camera: &Camera, (width, height): (u32, u32)) -> [f64; 2] {
    [(width, camera.width), (height, camera.height)]
        .map(|(new, old)| f64::from(new) / f64::from(old))
}
