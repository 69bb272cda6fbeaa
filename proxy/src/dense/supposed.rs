//! Where there are no sparse points: places that views may show, to find out by which photos go together.

use super::small::SmallPhoto;
use crate::SparsePoint;
use glam::DVec3;
use rayon::prelude::*;

/// Places across and down each photo, and depths of each.
const ACROSS: usize = 6;
const DOWN: usize = 4;
const DEPTHS: usize = 6;
/// Photos whose places are taken, at most: each place may be in the image of every other photo, and every
/// two photos that have it are compared.
const PHOTOS: usize = 60;

/// Places spread over what photos may show between two inverse depths each, and the photos that have them in
/// their images: as if nothing hid anything. Of many photos the places of some are taken, at even steps in
/// their order.
pub(super) fn points(photos: &[Option<SmallPhoto>], ranges: &[[f64; 2]]) -> Vec<SparsePoint> {
    let of_photo = |i: usize| -> Vec<SparsePoint> {
        let Some(photo) = &photos[i] else {
            return Vec::new();
        };
        let [far, near] = ranges[i];
        let places = (0..ACROSS * DOWN * DEPTHS).map(|k| {
            let share = |k: usize, of: usize| (k as f64 + 0.5) / of as f64;
            let depth = k / (ACROSS * DOWN);
            let inverse = far + (near - far) * depth as f64 / (DEPTHS - 1) as f64;
            let x = share(k % ACROSS, ACROSS) * photo.width as f64 - photo.principal[0];
            let y = share(k / ACROSS % DOWN, DOWN) * photo.height as f64 - photo.principal[1];
            let in_camera = DVec3::new(x / photo.focal, y / photo.focal, 1.0) / inverse;
            photo.center + photo.rotation.transpose() * in_camera
        });
        let shown_by = |position: DVec3| {
            let shows = |photo: &SmallPhoto| {
                let at = photo.project(position);
                at.is_some_and(|(at, _)| photo.index(at).is_some())
            };
            let shown = photos.iter().zip(0..);
            let shown = shown.filter(|(photo, _)| photo.as_ref().is_some_and(shows));
            shown.map(|(_, j)| j).collect()
        };
        places
            .filter(|position| position.is_finite())
            .map(|position| SparsePoint {
                position,
                seen_by: shown_by(position),
            })
            .collect()
    };
    let usable: Vec<usize> = (0..photos.len()).filter(|&i| photos[i].is_some()).collect();
    let taken = usable.len().min(PHOTOS);
    (0..taken)
        .into_par_iter()
        .map(|k| usable[k * usable.len() / taken])
        .flat_map_iter(of_photo)
        .collect()
}
