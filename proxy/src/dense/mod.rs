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

use crate::{Solid, SparsePoint};
use calibrate::View;
use image::RgbaImage;
use neighbours::Affinity;
use rayon::prelude::*;
use small::SmallPhoto;
use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

/// Points, and the names of the views that their `seen_by` counts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DensePoints {
    /// By index.
    pub names: Vec<String>,
    /// The points.
    pub points: Vec<SparsePoint>,
    /// As that of [`crate::Proxy::Points`].
    pub within: Option<Arc<Solid>>,
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
    Matching::new(views, sparse, photo, options).points(sparse, None)
}

/// Photos made ready to be compared, and the depths found so far: to ask for the points that
/// would be found without one of them or another, most depths are the same.
pub struct Matching {
    spacing: u32,
    photos: Vec<Option<SmallPhoto>>,
    affinity: Affinity,
    /// Of each photo, with all of them.
    neighbours: Vec<Vec<usize>>,
    /// The inverse depths to try.
    ranges: Vec<Option<[f64; 2]>>,
    /// With all photos, each when first needed.
    maps: Vec<OnceLock<Option<DepthMap>>>,
}

impl Matching {
    /// See [`densify`], which takes the same.
    pub fn new(
        views: &[View],
        sparse: &[SparsePoint],
        photo: impl Fn(usize) -> Option<RgbaImage> + Sync,
        options: &DenseOptions,
    ) -> Self {
        let indices = 0..views.len();
        let photos: Vec<Option<SmallPhoto>> = indices
            .into_par_iter()
            .map(|i| SmallPhoto::new(&views[i], &photo(i)?, options.long_side))
            .collect();
        let affinity = Affinity::new(views, sparse);
        Self {
            spacing: options.spacing,
            neighbours: affinity.neighbours(|i| photos[i].is_some()),
            affinity,
            ranges: neighbours::depth_ranges(&photos, sparse),
            maps: photos.iter().map(|_| OnceLock::new()).collect(),
            photos,
        }
    }

    /// The given points, and those that the photos agree on between them, or that all but
    /// one of them do. Without it, only the range of depths that are tried remembers it.
    pub fn points(&self, sparse: &[SparsePoint], without: Option<usize>) -> Vec<SparsePoint> {
        // 1. Which photos to compare.
        let of_all = &self.neighbours;
        let neighbours = match without {
            Some(gone) => {
                let usable = |i: usize| self.photos[i].is_some() && i != gone;
                Cow::Owned(self.affinity.neighbours(usable))
            }
            None => Cow::Borrowed(of_all),
        };

        // 2. Their depths.
        let maps: Vec<Option<Cow<'_, DepthMap>>> = (0..self.photos.len())
            .into_par_iter()
            .map(|i| {
                if without == Some(i) {
                    None
                } else if neighbours[i] == of_all[i] {
                    let map = self.maps[i].get_or_init(|| self.map(i, &of_all[i]));
                    map.as_ref().map(Cow::Borrowed)
                } else {
                    self.map(i, &neighbours[i]).map(Cow::Owned)
                }
            })
            .collect();
        let maps: Vec<Option<&DepthMap>> = maps.iter().map(|map| map.as_deref()).collect();

        // 3. What they agree on.
        let mut points = sparse.to_vec();
        points.extend(consistent::points(
            &self.photos,
            &maps,
            &neighbours,
            self.spacing,
        ));
        points
    }

    fn map(&self, i: usize, neighbours: &[usize]) -> Option<DepthMap> {
        let reference = self.photos[i].as_ref()?;
        let others: Vec<&SmallPhoto> = neighbours
            .iter()
            .filter_map(|&j| self.photos[j].as_ref())
            .collect();
        let costs = sweep::costs(reference, &others, self.ranges[i]?)?;
        Some(smooth::depths(reference, &costs))
    }
}

#[cfg(test)]
mod tests;
