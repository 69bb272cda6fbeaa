//! How far a proxy is from the truth, pixel by pixel of the held-out photos.

use calibrate::{DepthAlong, Pixel, View};
use glam::DVec3;
use lumigraph::scene::{Scene, SceneError};
use render::{FieldOptions, Frame, Lumigraph};
use serde::Serialize;
use std::collections::BTreeSet;

/// A pixel counts as complete where the proxy is so near the truth, as a part of the scene's
/// size.
const NEAR: f64 = 0.01;

/// Distances along the pixels' rays between what the proxy shows there and the truth, as parts
/// of the scene's size: the diagonal of the box around all that the held-out photos show.
#[derive(Serialize)]
pub(super) struct Distances {
    /// Their mean, where there is a proxy; more than the scene's size counts as that.
    pub(super) mean: f64,
    /// 95 % of them are less.
    pub(super) p95: f64,
    /// The share of the true pixels where there is a proxy within 1 %.
    pub(super) complete: f64,
    /// World units.
    scene_size: f64,
}

/// A held-out photo's camera, and what it truly shows.
pub(super) struct Depths {
    view: View,
    /// Where the depth is known: the pixel, the ray in the camera's frame as [`DepthAlong::ray`] has it, the depth.
    known: Vec<(Pixel, DVec3, f64)>,
}

/// What is known of the held-out photos' depth.
pub(super) fn truths(
    scene: &Scene,
    held_out: &BTreeSet<String>,
) -> Result<Vec<Depths>, SceneError> {
    let mut all = Vec::new();
    for photo in scene.photos.iter().filter(|p| held_out.contains(&p.name)) {
        let view = scene.view(&photo.name)?;
        let Some(map) = photo.decode_depth((view.width, view.height))? else {
            continue;
        };
        let along = DepthAlong::of_view(&view);
        let places = (0..view.height).flat_map(|y| (0..view.width).map(move |x| (x, y)));
        let known = places.filter_map(|(column, row)| {
            let depth = map.at(column, row)?;
            let pixel = Pixel::center_of(column, row);
            let ray = along.ray(view.lens.unproject(pixel)?)?;
            Some((pixel, ray, f64::from(depth)))
        });
        all.push(Depths {
            known: known.collect(),
            view,
        });
    }
    Ok(all)
}

impl Distances {
    /// Of a lumigraph's proxy; `None` where nothing is known.
    pub(super) fn of(lumigraph: &Lumigraph, truths: &[Depths]) -> Option<Self> {
        let scene_size = scene_size(truths)?;
        let mut distances = Vec::new();
        let mut count = 0;
        for Depths { view, known } in truths {
            let frame = Frame::new(lumigraph, view.clone(), FieldOptions::default());
            count += known.len();
            for &(pixel, ray, depth) in known {
                let inverse = frame.surface.plane_at(pixel).map(|q| q.dot(ray));
                if let Some(inverse) = inverse.filter(|s| *s > 0.0) {
                    let distance = ray.length() * (1.0 / inverse - depth).abs();
                    distances.push((distance / scene_size).min(1.0));
                }
            }
        }
        distances.sort_by(f64::total_cmp);
        let p95 = *distances.get((0.95 * distances.len() as f64) as usize)?;
        let near = distances.partition_point(|d| *d <= NEAR);
        Some(Self {
            mean: distances.iter().sum::<f64>() / distances.len() as f64,
            p95,
            complete: near as f64 / count as f64,
            scene_size,
        })
    }
}

/// The diagonal of the box around all that is known, in world units.
fn scene_size(truths: &[Depths]) -> Option<f64> {
    let mut bounds: Option<(DVec3, DVec3)> = None;
    for Depths { view, known } in truths {
        let world_from_camera = view.camera_from_world.inverse();
        for &(_, ray, depth) in known {
            let point = world_from_camera * (ray * depth);
            let (low, high) = bounds.unwrap_or((point, point));
            bounds = Some((low.min(point), high.max(point)));
        }
    }
    bounds
        .map(|(low, high)| low.distance(high))
        .filter(|size| *size > 0.0)
}
