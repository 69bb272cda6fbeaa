//! The points that depths of several photos agree on.

use super::DepthMap;
use super::small::SmallPhoto;
use crate::SparsePoint;
use glam::DVec3;
use rayon::prelude::*;

/// Relative difference of depths up to which two photos agree.
const AGREE: f64 = 0.012;
/// The same in steps between the depths tried, which tell more where photos lie close together.
const AGREE_STEPS: f64 = 1.0;
const BLOCKS_STEPS: f64 = 4.0;
/// By how much nearer, relatively, a point must be than what a photo sees to be in its way.
const BLOCKS: f64 = 0.03;
/// So many times as many photos must find a point in their way as agree on it before it goes.
const OUTVOTED: usize = 3;
/// How many others must agree, where there are so many.
const OTHERS: usize = 2;
/// That a sensor measured a depth counts as so many photos that agree on it.
const MEASURED: usize = 1;

/// A point that a photo and some of its neighbours agree on.
struct Agreed {
    position: DVec3,
    seen_by: Vec<u32>,
    cell: usize,
}

/// Points about `spacing` pixels apart in each photo. `maps` are what comparing photos says, `measured`
/// what sensors do.
pub(super) fn points(
    photos: &[Option<SmallPhoto>],
    maps: &[Option<&DepthMap>],
    measured: &[Option<&[f32]>],
    neighbours: &[Vec<usize>],
    spacing: u32,
) -> Vec<SparsePoint> {
    let spacing = spacing as usize;
    // Whoever compared with a photo can agree with it.
    let mut related: Vec<Vec<usize>> = neighbours.to_vec();
    for (i, of) in neighbours.iter().enumerate() {
        of.iter().for_each(|&j| related[j].push(i));
    }
    for of in &mut related {
        of.sort_unstable();
        of.dedup();
    }
    let agreed: Vec<Vec<Agreed>> = (0..photos.len())
        .into_par_iter()
        .map(|i| of_photo(i, photos, maps, measured[i], &related[i], spacing))
        .collect();

    // Of points that several photos have only the first stays.
    let columns = |photo: &SmallPhoto| photo.width.div_ceil(spacing);
    let mut taken: Vec<Vec<f64>> = photos
        .iter()
        .map(|photo| match photo {
            Some(photo) => vec![0.0; columns(photo) * photo.height.div_ceil(spacing)],
            None => Vec::new(),
        })
        .collect();
    let mut points = Vec::new();
    for (i, agreed) in agreed.into_iter().enumerate() {
        let Some(photo) = &photos[i] else { continue };
        for point in agreed {
            let Some((_, depth)) = photo.project(point.position) else {
                continue;
            };
            if alike(taken[i][point.cell], 1.0 / depth) {
                continue;
            }
            for &j in &point.seen_by {
                let Some(other) = &photos[j as usize] else {
                    continue;
                };
                if let Some((at, depth)) = other.project(point.position)
                    && let Some(index) = other.index(at)
                {
                    let (x, y) = (index % other.width, index / other.width);
                    let cell = y / spacing * columns(other) + x / spacing;
                    taken[j as usize][cell] = 1.0 / depth;
                }
            }
            points.push(SparsePoint {
                position: point.position,
                seen_by: point.seen_by,
            });
        }
    }
    points
}

fn alike(a: f64, b: f64) -> bool {
    (a - b).abs() <= AGREE * a.max(b)
}

/// One point for each cell of a photo in which there is any, that nearest to its middle: one that
/// photos agree on, else one that was measured.
fn of_photo(
    i: usize,
    photos: &[Option<SmallPhoto>],
    maps: &[Option<&DepthMap>],
    measured: Option<&[f32]>,
    related: &[usize],
    spacing: usize,
) -> Vec<Agreed> {
    let Some(photo) = &photos[i] else {
        return Vec::new();
    };
    let with_maps: Vec<(usize, &SmallPhoto, &DepthMap)> = related
        .iter()
        .filter_map(|&j| Some((j, photos[j].as_ref()?, maps[j]?)))
        .collect();
    // Where there is nobody to agree with, nothing is agreed on.
    let needed = OTHERS.min(with_maps.len());
    let compared = maps[i].filter(|_| needed > 0);
    if compared.is_none() && measured.is_none() {
        return Vec::new();
    }
    let agrees = |position: DVec3, other: &SmallPhoto, map: &DepthMap| {
        let (at, depth) = other.project(position)?;
        let inverse = f64::from(map.inverse_depths[other.index(at)?]);
        let off = (inverse - 1.0 / depth).abs();
        let near = (AGREE * inverse).max(AGREE_STEPS * map.step);
        // Unknown is 0, which lies within a step of what is far.
        (inverse > 0.0 && off <= near).then_some(())
    };
    // Photos near or far that see something behind it, and should not (Merrell et al. 2007).
    let objects = |position: DVec3, other: &SmallPhoto, map: &DepthMap| {
        let (at, depth) = other.project(position)?;
        let inverse = f64::from(map.inverse_depths[other.index(at)?]);
        let behind = 1.0 / depth - inverse;
        let clear = (BLOCKS / depth).max(BLOCKS_STEPS * map.step);
        (inverse > 0.0 && behind > clear).then_some(())
    };
    let objections = |position: DVec3| {
        let all = photos.iter().zip(maps);
        let with_maps = all.filter_map(|(photo, map)| Some((photo.as_ref()?, (*map)?)));
        with_maps
            .filter(|(other, map)| objects(position, other, map).is_some())
            .count()
    };
    let middle = spacing / 2;
    let mut order: Vec<(usize, usize)> = (0..spacing)
        .flat_map(|y| (0..spacing).map(move |x| (x, y)))
        .collect();
    order.sort_by_key(|&(x, y)| (x.abs_diff(middle).pow(2) + y.abs_diff(middle).pow(2), y, x));
    let (columns, rows) = (
        photo.width.div_ceil(spacing),
        photo.height.div_ceil(spacing),
    );
    // The first pixel of a cell of which enough others agree with what it says; what is said counts as the voices
    // of `own` photos.
    let in_cell = |cell: usize, inverse_depths: &[f32], needed: usize, own: usize| {
        let (left, top) = (cell % columns * spacing, cell / columns * spacing);
        order.iter().find_map(|&(dx, dy)| {
            let (x, y) = (left + dx, top + dy);
            if x >= photo.width || y >= photo.height {
                return None;
            }
            let inverse = f64::from(inverse_depths[y * photo.width + x]);
            if inverse <= 0.0 {
                return None;
            }
            let position = photo.point(x, y, inverse);
            let mut seen_by: Vec<u32> = with_maps
                .iter()
                .filter(|(_, other, map)| agrees(position, other, map).is_some())
                .map(|(j, ..)| *j as u32)
                .collect();
            if seen_by.len() < needed || !position.is_finite() {
                return None;
            }
            if objections(position) > OUTVOTED * (seen_by.len() + own) {
                return None;
            }
            seen_by.push(i as u32);
            seen_by.sort_unstable();
            Some(Agreed {
                position,
                seen_by,
                cell,
            })
        })
    };
    let of_cell = |cell: usize| {
        let agreed = || in_cell(cell, &compared?.inverse_depths, needed, 0);
        let measured = || in_cell(cell, measured?, 0, MEASURED);
        agreed().or_else(measured)
    };
    (0..columns * rows).filter_map(of_cell).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Lens, Rigid3, View};
    use glam::DVec2;
    use image::{Rgba, RgbaImage};

    /// Depths so far that one step more or less is infinity.
    #[test]
    fn nothing_agrees_with_pixels_of_unknown_depth() {
        let view = View {
            lens: Lens::pinhole(DVec2::splat(30.0), DVec2::new(16.0, 12.0)),
            width: 32,
            height: 24,
            camera_from_world: Rigid3::IDENTITY,
        };
        let gray = RgbaImage::from_pixel(32, 24, Rgba([100, 100, 100, 255]));
        let photo = SmallPhoto::new(&view, &gray, 32).unwrap();
        let map = |inverse: f32| DepthMap {
            inverse_depths: vec![inverse; photo.width * photo.height],
            step: 0.02,
        };
        let (far, unknown) = (map(0.01), map(0.0));
        let photos = vec![Some(photo.clone()); 3];
        let neighbours = [vec![1, 2], vec![0, 2], vec![0, 1]];
        let count = |maps: [&DepthMap; 3]| {
            let maps = maps.map(Some);
            points(&photos, &maps, &[None; 3], &neighbours, 4).len()
        };
        assert_eq!(count([&far, &unknown, &unknown]), 0);
        assert_eq!(count([&far, &far, &unknown]), 0);
        assert_eq!(count([&far, &far, &far]), 8 * 6);
    }
}
