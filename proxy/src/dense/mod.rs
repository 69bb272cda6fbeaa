//! Dense points: depths of all photos by comparing them, and the points they agree on.
//!
//! Structure from motion leaves points where photos have corners. Between them the sparse
//! surface is a guess. Here every photo is compared with its neighbours over a sweep of planes
//! (Collins 1996; zero-mean normalised correlation over small windows, the best two
//! neighbours count, so that what one of them does not see spoils nothing), the costs are
//! smoothed along eight directions (Hirschmüller 2008), and a depth stays where photos agree
//! on it. What remains becomes points like the sparse ones, a few pixels apart, each with the
//! views that agree on it.

mod consistent;
mod neighbours;
mod small;
mod smooth;
mod sweep;

use crate::SparsePoint;
use calibrate::View;
use image::RgbaImage;
use rayon::prelude::*;
use small::SmallPhoto;

/// Points, and the names of the views that their `seen_by` counts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DensePoints {
    /// By index.
    pub names: Vec<String>,
    /// The points.
    pub points: Vec<SparsePoint>,
}

/// How carefully to look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DenseOptions {
    /// Photos are reduced to this many pixels along their longer side.
    pub long_side: u32,
    /// Pixels of the reduced photos between points, across and down.
    pub spacing: u32,
}

impl Default for DenseOptions {
    fn default() -> Self {
        Self {
            long_side: 400,
            spacing: 4,
        }
    }
}

/// The inverse depths (1/z, world units) of a reduced photo, row by row; zero where unknown.
#[derive(Clone, Debug, PartialEq)]
struct DepthMap {
    inverse_depths: Vec<f32>,
    /// From one depth tried to the next: what a pixel's shift tells apart.
    step: f64,
}

/// The sparse points, and the points that photos agree on between them.
///
/// `photo` gives a photo by its view's index, of any size, transparent where it is not to be
/// used; `None` where it cannot be had. Photos without neighbours that share points with
/// them add nothing.
pub fn densify(
    views: &[View],
    sparse: &[SparsePoint],
    photo: impl Fn(usize) -> Option<RgbaImage> + Sync,
    options: &DenseOptions,
) -> Vec<SparsePoint> {
    // 1. Small pinhole photos, and which of them to compare.
    let indices = 0..views.len();
    let photos: Vec<Option<SmallPhoto>> = indices
        .into_par_iter()
        .map(|i| SmallPhoto::new(&views[i], &photo(i)?, options.long_side))
        .collect();
    let neighbours = neighbours::of_all(views, sparse, &photos);

    // 2. Their depths.
    let ranges = neighbours::depth_ranges(&photos, sparse);
    let maps: Vec<Option<DepthMap>> = (0..views.len())
        .into_par_iter()
        .map(|i| {
            let reference = photos[i].as_ref()?;
            let others: Vec<&SmallPhoto> = neighbours[i]
                .iter()
                .filter_map(|&j| photos[j].as_ref())
                .collect();
            let costs = sweep::costs(reference, &others, ranges[i]?)?;
            Some(smooth::depths(reference, &costs))
        })
        .collect();

    // 3. What they agree on.
    let mut points = sparse.to_vec();
    points.extend(consistent::points(
        &photos,
        &maps,
        &neighbours,
        options.spacing,
    ));
    points
}

#[cfg(test)]
mod tests;
