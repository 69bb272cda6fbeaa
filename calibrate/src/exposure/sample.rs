//! Colours of sparse points in the photos that see them.

use super::Observation;
use crate::{Camera, CameraId, Image, Reconstruction};
use capture::CaptureError;
use glam::DVec3;
use image::RgbaImage;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Where in a photo a sparse point is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Which point, by index into [`Patches::points_in_world`].
    pub point_idx: usize,
    /// Pixels, the first pixel's centre at (0.5, 0.5).
    pub x: f64,
    /// Pixels.
    pub y: f64,
    /// Standard deviation in pixels of the Gaussian that weighs what lies around.
    pub sigma_px: f64,
}

/// Where to look in every photo of a set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Patches {
    /// The points that two photos or more see.
    pub points_in_world: Vec<DVec3>,
    /// By photo.
    pub of_photo: Vec<Vec<Patch>>,
}

/// The patch around a point where it is seen coarsest. Wider ones gather more light from
/// surfaces beside the point, narrower ones more of the features' own misplacement.
const SIGMA_PX: f64 = 2.0;
/// Where it is seen this much finer than that, the patch grows no further.
const MAX_MAGNIFICATION: f64 = 4.0;
/// Values beyond these are not in proportion to the light: noise and black levels below,
/// the shoulder of the camera's curve above.
const PROPORTIONAL: std::ops::RangeInclusive<f64> = 12.0..=245.0;
/// A pixel at this value may have been brighter.
const CLIPPED: u8 = 253;
/// A pixel of no less alpha is whole: mattes of many programs are a few steps less than 255 within the object, and colours
/// are straight.
const WHOLE: u8 = 230;
/// Within how many standard deviations pixels count.
const REACH: f64 = 2.5;

/// Where the sparse points fall in the photos of the given names. A patch covers the same
/// width of the surface in every photo: its size in pixels follows from focal length and
/// distance.
pub fn patches(reconstruction: &Reconstruction, photo_names: &[&str]) -> Patches {
    let idx_of: BTreeMap<&str, usize> = photo_names.iter().copied().zip(0..).collect();
    let photo_idx = |image: &Image| idx_of.get(image.name.as_str()).copied();
    let focal = |camera: &Camera| camera.lens().ok().map(|lens| lens.mean_focal());
    let cameras = reconstruction.cameras.iter();
    let focal_of: BTreeMap<CameraId, f64> = cameras
        .filter_map(|(id, camera)| Some((*id, focal(camera)?)))
        .collect();
    let mut patches = Patches {
        points_in_world: Vec::new(),
        of_photo: vec![Vec::new(); photo_names.len()],
    };
    for point in reconstruction.points.values() {
        // 1. Who sees it, where, and how large.
        let mut seen: BTreeMap<usize, (f64, f64, f64)> = BTreeMap::new();
        for (image_id, keypoint_idx) in &point.track {
            let Some(image) = reconstruction.images.get(image_id) else {
                continue;
            };
            let keypoint = image.keypoints.get(*keypoint_idx as usize);
            let focal = focal_of.get(&image.camera_id);
            let (Some(idx), Some(keypoint), Some(focal)) = (photo_idx(image), keypoint, focal)
            else {
                continue;
            };
            let distance = (image.camera_from_world * point.position).length();
            let scale = focal / distance;
            if scale.is_finite() && scale > 0.0 {
                seen.entry(idx).or_insert((keypoint.x, keypoint.y, scale));
            }
        }
        if seen.len() < 2 {
            continue;
        }
        // 2. The coarsest sets the patch's width on the surface.
        let coarsest = seen.values().map(|s| s.2).fold(f64::INFINITY, f64::min);
        let point_idx = patches.points_in_world.len();
        patches.points_in_world.push(point.position);
        for (idx, (x, y, scale)) in seen {
            patches.of_photo[idx].push(Patch {
                point_idx,
                x,
                y,
                sigma_px: SIGMA_PX * (scale / coarsest).min(MAX_MAGNIFICATION),
            });
        }
    }
    patches
}

/// What a photo, of straight alpha, shows at its patches. A patch with a pixel of less than 0.9 alpha, or whose middle is
/// outside the photo, shows nothing; a channel that is clipped anywhere in it, or too dark
/// or bright on the whole, is `None`.
pub fn sample(photo: &RgbaImage, photo_idx: usize, patches: &[Patch]) -> Vec<Observation> {
    let (width, height) = (f64::from(photo.width()), f64::from(photo.height()));
    let inside = |p: &&Patch| (0.0..width).contains(&p.x) && (0.0..height).contains(&p.y);
    let observation = |patch: &Patch| {
        Some(Observation {
            photo_idx,
            point_idx: patch.point_idx,
            rgb: mean_color(photo, patch)?,
        })
    };
    patches
        .iter()
        .filter(inside)
        .filter_map(observation)
        .collect()
}

/// The Gaussian-weighted mean around a patch's middle.
fn mean_color(photo: &RgbaImage, patch: &Patch) -> Option<[Option<f64>; 3]> {
    let reach = REACH * patch.sigma_px;
    // Pixels whose centres lie within reach.
    let range = |at: f64, size: u32| {
        let first = (at - reach - 0.5).ceil().max(0.0) as u32;
        let last = (at + reach - 0.5).floor().min(f64::from(size) - 1.0) as u32;
        first..=last
    };
    let bell = |offset: f64| (-0.5 * (offset / patch.sigma_px).powi(2)).exp();
    let (mut sum, mut weights, mut clipped) = ([0.0; 3], 0.0, [false; 3]);
    for y in range(patch.y, photo.height()) {
        let down = bell(f64::from(y) + 0.5 - patch.y);
        for x in range(patch.x, photo.width()) {
            let [r, g, b, alpha] = photo.get_pixel(x, y).0;
            if alpha < WHOLE {
                return None;
            }
            let weight = down * bell(f64::from(x) + 0.5 - patch.x);
            weights += weight;
            for (c, value) in [r, g, b].into_iter().enumerate() {
                sum[c] += weight * f64::from(value);
                clipped[c] |= value >= CLIPPED;
            }
        }
    }
    Some(std::array::from_fn(|c| {
        let mean = sum[c] / weights;
        (!clipped[c] && PROPORTIONAL.contains(&mean)).then_some(mean)
    }))
}

/// [`sample`] for every photo, several at a time, each forgotten once looked at; `decode`
/// gives a photo's pixels by its index. Those without patches are not asked for. With it
/// come the photos that cannot be decoded.
pub fn sample_all(
    patches: &Patches,
    decode: impl Fn(usize) -> Result<RgbaImage, CaptureError> + Sync,
) -> (Vec<Observation>, Vec<(usize, CaptureError)>) {
    let look = |(idx, of_photo): (usize, &Vec<Patch>)| match of_photo.as_slice() {
        [] => Ok(Vec::new()),
        some => decode(idx).map(|photo| sample(&photo, idx, some)),
    };
    let looked: Vec<Result<Vec<Observation>, CaptureError>> =
        patches.of_photo.par_iter().enumerate().map(look).collect();
    let (mut observations, mut failed) = (Vec::new(), Vec::new());
    for (idx, result) in looked.into_iter().enumerate() {
        match result {
            Ok(some) => observations.extend(some),
            Err(error) => failed.push((idx, error)),
        }
    }
    (observations, failed)
}
