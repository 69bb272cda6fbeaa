//! The same places in every photo, for what photos say of time.

use crate::frame::Frame;
use crate::lumigraph::Lumigraph;
use crate::options::FieldOptions;
use crate::reference::sample;
use calibrate::{Pixel, Snapshot};
use glam::DVec3;
use rayon::prelude::*;

/// Places across the image; few, so that each is the mean of many pixels and parallax
/// matters little.
const ACROSS: u32 = 32;
/// What has no less alpha is shown whole: mattes and masks of many programs are a few steps less than 255 there.
const WHOLE: f64 = 0.9;

/// What each photo that has a time shows of the proxy, at places evenly spread over the view
/// of the photo in the middle. Photos are decoded one by one and not kept; those that cannot
/// be are passed over.
pub fn snapshots(lumigraph: &Lumigraph) -> Vec<Snapshot> {
    // 1. The places: the pixels of a small picture.
    let centers = lumigraph.sources.iter().map(|s| s.view.center());
    let mean = centers.sum::<DVec3>() / lumigraph.sources.len() as f64;
    let off = |i: &usize| lumigraph.sources[*i].view.center().distance_squared(mean);
    let middle = (0..lumigraph.sources.len()).min_by(|i, j| off(i).total_cmp(&off(j)));
    let Some(middle) = middle.map(|i| &lumigraph.sources[i].view) else {
        return Vec::new();
    };
    let down = (ACROSS * middle.height).div_ceil(middle.width).max(1);
    let frame = Frame::new(
        lumigraph,
        middle.resized(ACROSS, down),
        FieldOptions::default(),
    );
    let pixels = (0..down).flat_map(|y| (0..ACROSS).map(move |x| Pixel::center_of(x, y)));
    let places: Vec<_> = pixels.map(|pixel| frame.proxy_point(pixel)).collect();

    // 2. Their colours.
    let snapshot = |source_idx: usize| {
        let source = &lumigraph.sources[source_idx];
        let time_s = source.time_s?;
        let photo = lumigraph.photos.decode(source_idx).ok()?;
        let color = |point: &Option<_>| {
            let point = point.as_ref()?;
            let pixel = frame.project(source_idx, point)?;
            let level = frame.level_of_detail(source_idx, point);
            let seen = source.view.contains(pixel);
            let [r, g, b, alpha] = sample(&photo, pixel, level);
            // The colour alone, which is not premultiplied.
            (seen && alpha >= WHOLE).then(|| [r, g, b].map(|v| (v / alpha) as f32))
        };
        Some(Snapshot {
            time_s,
            center: source.view.center(),
            colors: places.iter().map(color).collect(),
        })
    };
    let sources = (0..lumigraph.sources.len()).into_par_iter();
    sources.filter_map(snapshot).collect()
}
