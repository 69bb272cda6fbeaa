//! Dense points: depths of all photos by comparing them, and the points they agree on.
//!
//! Structure from motion leaves points where photos have corners. Between them the sparse
//! surface is a guess. Here every photo is compared with its neighbours over a sweep of planes
//! (Collins 1996; zero-mean normalised correlation over small windows, the best two
//! neighbours count, so that what one of them does not see spoils nothing), the costs are
//! smoothed along eight directions (Hirschmüller 2008), and a depth stays where photos agree
//! on it. What remains becomes points like the sparse ones, a few pixels apart, each with the
//! views that agree on it. Where they agree on nothing a depth counts that a sensor measured.

mod consistent;
mod measured;
mod neighbours;
mod objections;
mod small;
mod smooth;
mod supposed;
mod sweep;
mod warp;
mod windows;

use crate::{Solid, SparsePoint};
use calibrate::View;
use image::RgbaImage;
use neighbours::Affinity;
use rayon::prelude::*;
use small::SmallPhoto;
use std::borrow::Cow;
use std::sync::Arc;

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
/// used; `None` where it cannot be had. `depth` gives what a sensor measured of it, if anything: one
/// over the depths along z (world units) of all its view's pixels, row by row, zero where unknown, as
/// [`crate::depth::believed`] has them. Photos without either, or without neighbours that share points
/// with them, add nothing of it.
///
/// # Panics
/// A depth map has not as many pixels as its view.
pub fn densify(
    views: &[View],
    sparse: &[SparsePoint],
    photo: impl Fn(usize) -> Option<RgbaImage> + Sync,
    depth: impl Fn(usize) -> Option<Vec<f32>> + Sync,
    options: &DenseOptions,
) -> Vec<SparsePoint> {
    let mut matching = Matching::new(views, sparse, photo, depth, options);
    matching.compare(&[]);
    matching.points(sparse, &[])
}

/// Photos made ready to be compared, and the depths found so far: to ask for the points that
/// would be found without one of them or another, most depths are the same.
pub struct Matching {
    spacing: u32,
    photos: Vec<Option<SmallPhoto>>,
    /// Of each photo, if a sensor measured any: the inverse depths of its pixels; zero where unknown.
    measured: Vec<Option<Vec<f32>>>,
    affinity: Affinity,
    /// Of each photo, with all of them.
    neighbours: Vec<Vec<usize>>,
    /// The inverse depths to try.
    ranges: Vec<Option<[f64; 2]>>,
    /// Of each photo, those found so far.
    maps: Vec<Vec<Found>>,
}

/// A photo's depths, and the neighbours that tell them.
struct Found {
    neighbours: Vec<usize>,
    map: Option<DepthMap>,
}

impl Matching {
    /// See [`densify`], which takes the same.
    ///
    /// # Panics
    /// As that.
    pub fn new(
        views: &[View],
        sparse: &[SparsePoint],
        photo: impl Fn(usize) -> Option<RgbaImage> + Sync,
        depth: impl Fn(usize) -> Option<Vec<f32>> + Sync,
        options: &DenseOptions,
    ) -> Self {
        let indices = (0..views.len()).into_par_iter();
        let photos: Vec<Option<SmallPhoto>> = indices
            .clone()
            .map(|i| SmallPhoto::new(&views[i], &photo(i)?, options.long_side))
            .collect();
        let measured = indices.map(|i| {
            let photo = photos[i].as_ref()?;
            Some(measured::reduced(photo, &views[i], &depth(i)?))
        });
        let measured = measured.collect();
        let shown = neighbours::shown(&photos, sparse);
        let affinity = Affinity::new(views, &shown);
        Self {
            spacing: options.spacing,
            neighbours: affinity.neighbours(|i| photos[i].is_some()),
            affinity,
            ranges: neighbours::depth_ranges(&photos, &shown),
            maps: photos.iter().map(|_| Vec::new()).collect(),
            photos,
            measured,
        }
    }

    /// Finds which photos go together, and the depths to try, where no sparse points tell: by comparing them
    /// once between two inverse depths (1/z, world units; the lesser first) each. The views are those
    /// of [`Self::new`].
    ///
    /// # Panics
    /// There are not as many ranges as views.
    pub fn suppose(&mut self, views: &[View], ranges: &[[f64; 2]]) {
        assert_eq!(views.len(), ranges.len(), "a range for each view");
        // 1. As if all were seen that lies in the ranges.
        let supposed = supposed::points(&self.photos, ranges);
        self.go_together(views, &supposed);
        let tried = self.photos.iter().zip(ranges);
        self.ranges = tried.map(|(p, range)| p.as_ref().map(|_| *range)).collect();
        // 2. By what they agree on.
        self.compare(&[]);
        let found = self.points(&[], &[]);
        self.go_together(views, &found);
        self.maps.iter_mut().for_each(Vec::clear);
    }

    /// Which photos are to be compared, and between which depths, by points that they show.
    fn go_together(&mut self, views: &[View], points: &[SparsePoint]) {
        self.affinity = Affinity::new(views, points);
        self.neighbours = self.affinity.neighbours(|i| self.photos[i].is_some());
        self.ranges = neighbours::depth_ranges(&self.photos, points);
    }

    /// Finds the depths of all photos, and what they would be without the photos of one of the given
    /// sets or another: together they take less than one after the other, and points can be asked for
    /// at once.
    pub fn compare(&mut self, without: &[Vec<usize>]) {
        let gone: Vec<(&Vec<usize>, Vec<Vec<usize>>)> = without
            .iter()
            .map(|gone| (gone, self.neighbours_without(gone)))
            .collect();
        let of_photo = |i: usize| {
            let mut choices = vec![self.neighbours[i].clone()];
            for (gone, neighbours) in &gone {
                if !gone.contains(&i) && !choices.contains(&neighbours[i]) {
                    choices.push(neighbours[i].clone());
                }
            }
            self.find(i, choices)
        };
        let photos = (0..self.photos.len()).into_par_iter();
        self.maps = photos.map(of_photo).collect();
    }

    /// The given points, and those that the photos agree on between them, or that all without some
    /// of them do, with what sensors measured where they don't. Of those left out only the range of
    /// depths that are tried knows.
    pub fn points(&self, sparse: &[SparsePoint], without: &[usize]) -> Vec<SparsePoint> {
        // 1. Which photos to compare.
        let neighbours = if without.is_empty() {
            Cow::Borrowed(&self.neighbours)
        } else {
            Cow::Owned(self.neighbours_without(without))
        };

        // 2. Their depths.
        let maps: Vec<Option<Cow<'_, DepthMap>>> = (0..self.photos.len())
            .into_par_iter()
            .map(|i| {
                if without.contains(&i) {
                    return None;
                }
                let known = self.maps[i].iter().find(|f| f.neighbours == neighbours[i]);
                match known {
                    Some(found) => found.map.as_ref().map(Cow::Borrowed),
                    None => {
                        let found = self.find(i, vec![neighbours[i].clone()]).pop()?;
                        found.map.map(Cow::Owned)
                    }
                }
            })
            .collect();
        let maps: Vec<Option<&DepthMap>> = maps.iter().map(|map| map.as_deref()).collect();
        let measured = |i: usize| {
            self.measured[i]
                .as_deref()
                .filter(|_| !without.contains(&i))
        };
        let measured: Vec<Option<&[f32]>> = (0..self.photos.len()).map(measured).collect();

        // 3. What they agree on.
        let mut points = sparse.to_vec();
        points.extend(consistent::points(
            &self.photos,
            &maps,
            &measured,
            &neighbours,
            self.spacing,
        ));
        points
    }

    fn neighbours_without(&self, gone: &[usize]) -> Vec<Vec<usize>> {
        let usable = |i: usize| self.photos[i].is_some() && !gone.contains(&i);
        self.affinity.neighbours(usable)
    }

    /// A photo's depths by each choice of neighbours.
    fn find(&self, i: usize, choices: Vec<Vec<usize>>) -> Vec<Found> {
        let mut maps: Vec<Option<DepthMap>> = choices.iter().map(|_| None).collect();
        if let (Some(reference), Some(range)) = (&self.photos[i], self.ranges[i]) {
            let (kept, some): (Vec<usize>, Vec<Vec<usize>>) = choices
                .iter()
                .enumerate()
                .filter(|(_, choice)| !choice.is_empty())
                .map(|(k, choice)| (k, choice.clone()))
                .unzip();
            sweep::costs(reference, &self.photos, &some, range, |k, costs| {
                maps[kept[k]] = Some(smooth::depths(reference, &costs));
            });
        }
        let found = choices.into_iter().zip(maps);
        found
            .map(|(neighbours, map)| Found { neighbours, map })
            .collect()
    }
}

#[cfg(test)]
mod tests;
