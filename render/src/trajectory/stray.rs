//! Cameras that are misplaced by far.

use super::capture::{distances_ahead, nearest};
use super::gaze;
use crate::lumigraph::SourceView;
use glam::DVec3;
use proxy::{Proxy, geometric_median};
use std::borrow::Cow;

/// A camera is astray that is farther from the middle of all cameras than so many times what three quarters of
/// them are within.
const FAR: f64 = 10.0;
/// And farther than so many times the distance to the scene: where most photos were taken from one place, those
/// that were not are no strays.
const FAR_OF_SCENE: f64 = 4.0;

/// The source views but for those whose cameras are astray: what lies between one of them and the others is a void
/// that no photo shows. All of them where nothing tells how far the scene is.
pub(super) fn without_strays<'a>(
    sources: &'a [SourceView],
    points_in_world: &[DVec3],
    proxy: &Proxy,
) -> Cow<'a, [SourceView]> {
    let Some(first) = sources.first() else {
        return Cow::Borrowed(sources);
    };
    let first = first.view.center();
    let centers: Vec<DVec3> = sources.iter().map(|s| s.view.center() - first).collect();
    let middle = geometric_median(&centers);
    let distances: Vec<f64> = centers.iter().map(|c| c.distance(middle)).collect();
    let mut sorted = distances.clone();
    let three_quarters = (3 * sorted.len()).div_ceil(4) - 1;
    let within = *sorted
        .select_nth_unstable_by(three_quarters, f64::total_cmp)
        .1;

    let view = &sources[nearest(&centers, middle)].view;
    let (to_points, to_proxy) = distances_ahead(view, gaze::ahead(view), points_in_world, proxy);
    let Some(to_scene) = to_points.or(to_proxy) else {
        return Cow::Borrowed(sources);
    };
    let limit = (FAR * within).max(FAR_OF_SCENE * to_scene);
    if distances.iter().all(|d| *d <= limit) {
        return Cow::Borrowed(sources);
    }
    let kept = sources.iter().zip(&distances).filter(|(_, d)| **d <= limit);
    Cow::Owned(kept.map(|(source, _)| source.clone()).collect())
}
