//! The points that depths of several photos agree on.

use super::DepthMap;
use super::objections::Objectors;
use super::small::SmallPhoto;
use crate::SparsePoint;
use glam::DVec3;
use rayon::prelude::*;

/// Relative difference of depths up to which two photos agree.
const AGREE: f64 = 0.012;
/// The same in steps between the depths tried, which tell more where photos lie close together.
const AGREE_STEPS: f64 = 1.0;
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
    let objectors = Objectors::new(photos, maps);
    let of_photo = |i: usize| {
        let (measured, related) = (measured[i], &related[i]);
        of_photo(i, photos, maps, measured, related, &objectors, spacing)
    };
    let agreed: Vec<Vec<Agreed>> = (0..photos.len()).into_par_iter().map(of_photo).collect();

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

/// How far from an inverse depth others agree with it, where a step between those tried is so wide.
fn near(inverse: f64, step: f64) -> f64 {
    (AGREE * inverse).max(AGREE_STEPS * step)
}

/// The inverse depth along a photo's ray, turned to the world, at which it meets what lies that deep in another; `None`
/// where it does not.
fn along(photo: &SmallPhoto, ray: DVec3, other: &SmallPhoto, inverse_there: f64) -> Option<f64> {
    // At s the depth there is that of the photo's own camera, and the ray's over s.
    let axis = other.rotation.row(2);
    let (of_camera, of_ray) = (axis.dot(photo.center - other.center), axis.dot(ray));
    let s = of_ray * inverse_there / (1.0 - of_camera * inverse_there);
    (s > 0.0 && s.is_finite()).then_some(s)
}

/// Of one number or more; of an even count the mean of the two in the middle, as the upper one (`cloud::median`) would
/// bring all points nearer.
fn median(numbers: &mut [f64]) -> f64 {
    numbers.sort_by(f64::total_cmp);
    let count = numbers.len();
    numbers[(count - 1) / 2].midpoint(numbers[count / 2])
}

/// One point for each cell of a photo in which there is any, that nearest to its middle: one that
/// photos agree on, at the median of their depths, else one that was measured.
fn of_photo(
    i: usize,
    photos: &[Option<SmallPhoto>],
    maps: &[Option<&DepthMap>],
    measured: Option<&[f32]>,
    related: &[usize],
    objectors: &Objectors<'_>,
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
    // The inverse depth by which another does.
    let agrees = |position: DVec3, other: &SmallPhoto, map: &DepthMap| {
        let (at, depth) = other.project(position)?;
        let inverse = f64::from(map.inverse_depths[other.index(at)?]);
        let off = (inverse - 1.0 / depth).abs();
        // Unknown is 0, which lies within a step of what is far.
        (inverse > 0.0 && off <= near(inverse, map.step)).then_some(inverse)
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
            let (mut seen_by, mut depths) = (Vec::new(), vec![inverse]);
            let step = maps[i].map_or(0.0, |own| own.step);
            let ray = photo.rotation.transpose() * photo.ray(x, y);
            for (j, other, map) in &with_maps {
                if let Some(there) = agrees(position, other, map) {
                    seen_by.push(*j as u32);
                    // Of one that looks across the ray a little there is much along it.
                    let met = along(photo, ray, other, there);
                    depths.extend(met.filter(|s| (s - inverse).abs() <= near(inverse, step)));
                }
            }
            if seen_by.len() < needed || !position.is_finite() {
                return None;
            }
            if objectors.are_more_than(OUTVOTED * (seen_by.len() + own), position) {
                return None;
            }
            seen_by.push(i as u32);
            seen_by.sort_unstable();
            Some(Agreed {
                // What a sensor measured nobody knows better.
                position: match own {
                    0 => photo.point(x, y, median(&mut depths)),
                    _ => position,
                },
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

    fn small(camera_from_world: Rigid3) -> SmallPhoto {
        let view = View {
            lens: Lens::pinhole(DVec2::splat(30.0), DVec2::new(16.0, 12.0)),
            width: 32,
            height: 24,
            camera_from_world,
        };
        let gray = RgbaImage::from_pixel(32, 24, Rgba([100, 100, 100, 255]));
        SmallPhoto::new(&view, &gray, 32).unwrap()
    }

    #[test]
    fn a_point_lies_at_the_median_of_the_depths_that_agree() {
        let photo = small(Rigid3::IDENTITY);
        let map = |depth: f64| DepthMap {
            inverse_depths: vec![(1.0 / depth) as f32; photo.width * photo.height],
            step: 1e-6,
        };
        let depths = |maps: [f64; 4]| {
            let maps = maps.map(map);
            let neighbours: Vec<Vec<usize>> = (0..4)
                .map(|i| (0..4).filter(|j| *j != i).collect())
                .collect();
            let maps = maps.each_ref().map(Some);
            points(
                &vec![Some(photo.clone()); 4],
                &maps,
                &[None; 4],
                &neighbours,
                4,
            )
        };
        // The first photo has all points; the last does not agree with it.
        for point in depths([10.09, 10.0, 9.99, 10.5]) {
            assert!((point.position.z - 10.0).abs() < 1e-5, "{point:?}");
            assert_eq!(point.seen_by, [0, 1, 2]);
        }
        for point in depths([10.09, 10.02, 10.0, 9.99]) {
            assert!((point.position.z - 10.01).abs() < 1e-4, "{point:?}");
            assert_eq!(point.seen_by, [0, 1, 2, 3]);
        }
    }

    #[test]
    fn another_photos_depth_is_met_along_the_ray() {
        let photo = small(Rigid3::IDENTITY);
        let center = DVec3::new(2.0, -0.5, 0.7);
        let other = small(Rigid3::looking_at(
            center,
            DVec3::new(0.3, 0.2, 5.0),
            DVec3::Y,
        ));
        for (x, y, inverse) in [(3, 4, 0.2), (20, 13, 0.15), (31, 0, 0.3)] {
            let (_, depth) = other.project(photo.point(x, y, inverse)).unwrap();
            let ray = photo.rotation.transpose() * photo.ray(x, y);
            let met = along(&photo, ray, &other, 1.0 / depth).unwrap();
            assert!((met - inverse).abs() < 1e-12, "{met}");
        }
        // What lies behind this photo is met nowhere before it.
        let behind = small(Rigid3::looking_at(DVec3::Z * 9.0, DVec3::ZERO, DVec3::Y));
        let ray = photo.ray(16, 12);
        assert_eq!(along(&photo, ray, &behind, 1.0 / 12.0), None);
    }
}
