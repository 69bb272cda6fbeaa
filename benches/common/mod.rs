//! What more than one bench needs.

use calibrate::{Lens, View};
use datasets::Options;
use glam::DVec2;
use render::Lumigraph;
use std::error::Error;
use std::path::{Path, PathBuf};

/// Writes a synthetic scene as a capture.
pub(crate) fn generate(
    name: &str,
    size: (u32, u32),
    views: Option<usize>,
    into: &Path,
) -> Result<PathBuf, Box<dyn Error>> {
    let options = Options {
        size: Some(size),
        views,
        samples_per_side: Some(1),
    };
    let folder = into.join(name);
    datasets::write(&datasets::by_name(name, &options)?, &folder)?;
    Ok(folder)
}

/// A pinhole on the way from a photo to the next, with the first one's focal length and
/// proportions.
pub(crate) fn on_the_way(lumigraph: &Lumigraph, first: usize, share: f64, long_side: u32) -> View {
    let [a, b] = [first, first + 1].map(|i| &lumigraph.sources[i].view);
    let scale = f64::from(long_side) / f64::from(a.width.max(a.height));
    let [width, height] = [a.width, a.height].map(|s| (f64::from(s) * scale).round() as u32);
    let half = 0.5 * DVec2::new(f64::from(width), f64::from(height));
    View {
        lens: Lens::pinhole(DVec2::splat(a.lens.mean_focal() * scale), half),
        width,
        height,
        ..a.between(b, share)
    }
}
