//! Photos, near or far, that see past a point, and should not (Merrell et al. 2007).

use super::DepthMap;
use super::small::SmallPhoto;
use glam::DVec3;
use pulp::Arch;
use rayon::prelude::*;

/// By how much nearer, relatively, a point must be than what a photo sees to be in its way.
const BLOCKS: f64 = 0.03;
/// The same in steps between the depths tried.
const BLOCKS_STEPS: f64 = 4.0;
/// Pixels of a square, across and down.
const SQUARE: usize = 16;

/// Photos that are asked at once.
const LANES: usize = 8;

/// All that may object.
pub(super) struct Objectors<'a> {
    lanes: Vec<Lanes>,
    photos: Vec<Objector<'a>>,
}

/// Where points fall in some photos, number by number.
#[derive(Default)]
struct Lanes {
    centers: [[f64; LANES]; 3],
    /// Column by column.
    rotations: [[[f64; LANES]; 3]; 3],
    focals: [f64; LANES],
    principals: [[f64; LANES]; 2],
}

/// A photo whose depths are known.
struct Objector<'a> {
    photo: &'a SmallPhoto,
    map: &'a DepthMap,
    /// By square, row by row, the least inverse depth that is known in it; infinite where none is. Most points are in
    /// nobody's way, which squares tell: all photos' are at hand where their depths are not.
    farthest: Vec<f32>,
}

impl<'a> Objectors<'a> {
    pub(super) fn new(photos: &'a [Option<SmallPhoto>], maps: &[Option<&'a DepthMap>]) -> Self {
        let all = photos.par_iter().zip(maps);
        let with_maps =
            all.filter_map(|(photo, map)| Some(Objector::new(photo.as_ref()?, (*map)?)));
        let photos: Vec<Objector<'a>> = with_maps.collect();
        Self {
            lanes: photos.chunks(LANES).map(Lanes::of).collect(),
            photos,
        }
    }

    /// Whether more than so many have a point in their way.
    pub(super) fn are_more_than(&self, count: usize, position: DVec3) -> bool {
        // A closure that gives away what it has is compiled for wide vectors: see `Comparison::new`.
        Arch::new().dispatch(
            #[inline(always)]
            move || self.count(position, count) > count,
        )
    }

    /// How many have a point in their way; no more are counted than one more than `most`.
    #[inline(always)]
    fn count(&self, position: DVec3, most: usize) -> usize {
        let mut count = 0;
        for (lanes, photos) in self.lanes.iter().zip(self.photos.chunks(LANES)) {
            let (at, depths) = lanes.project(position);
            for (k, photo) in photos.iter().enumerate() {
                let is_ahead = depths[k] > 0.0;
                count += usize::from(is_ahead && photo.objects(at.map(|v| v[k]), depths[k]));
            }
            if count > most {
                break;
            }
        }
        count
    }
}

impl Lanes {
    fn of(photos: &[Objector<'_>]) -> Self {
        let mut lanes = Self::default();
        for (k, Objector { photo, .. }) in photos.iter().enumerate() {
            for i in 0..3 {
                lanes.centers[i][k] = photo.center[i];
                for j in 0..3 {
                    lanes.rotations[j][i][k] = photo.rotation.col(j)[i];
                }
            }
            lanes.focals[k] = photo.focal;
            for i in 0..2 {
                lanes.principals[i][k] = photo.principal[i];
            }
        }
        lanes
    }

    /// As [`SmallPhoto::project`] does, to the last bit: in pixels, and depths along z.
    #[inline(always)]
    fn project(&self, point_in_world: DVec3) -> ([[f64; LANES]; 2], [f64; LANES]) {
        let (mut at, mut depths) = ([[0.0; LANES]; 2], [0.0; LANES]);
        for k in 0..LANES {
            let off = [0, 1, 2].map(
                #[inline(always)]
                |i| point_in_world[i] - self.centers[i][k],
            );
            let [x, y, z] = [0, 1, 2].map(
                #[inline(always)]
                |i| {
                    let [a, b, c] = &self.rotations;
                    a[i][k] * off[0] + b[i][k] * off[1] + c[i][k] * off[2]
                },
            );
            at[0][k] = self.focals[k] * x / z + self.principals[0][k];
            at[1][k] = self.focals[k] * y / z + self.principals[1][k];
            depths[k] = z;
        }
        (at, depths)
    }
}

impl<'a> Objector<'a> {
    fn new(photo: &'a SmallPhoto, map: &'a DepthMap) -> Self {
        let across = photo.width.div_ceil(SQUARE);
        let mut farthest = vec![f32::INFINITY; across * photo.height.div_ceil(SQUARE)];
        for (y, row) in map.inverse_depths.chunks(photo.width).enumerate() {
            let squares = &mut farthest[y / SQUARE * across..][..across];
            for (square, part) in squares.iter_mut().zip(row.chunks(SQUARE)) {
                let known = part.iter().copied().filter(|inverse| *inverse > 0.0);
                *square = known.fold(*square, f32::min);
            }
        }
        Self {
            photo,
            map,
            farthest,
        }
    }

    /// Whether it sees past a point that falls on a position in it.
    #[inline(always)]
    fn objects(&self, at: [f64; 2], depth: f64) -> bool {
        let Some(pixel) = self.photo.index(at) else {
            return false;
        };
        let clear = (BLOCKS / depth).max(BLOCKS_STEPS * self.map.step);
        let is_past = |inverse: f32| 1.0 / depth - f64::from(inverse) > clear;
        let [column, row] = at.map(|v| v as usize / SQUARE);
        let square = self.farthest[row * self.photo.width.div_ceil(SQUARE) + column];
        is_past(square) && {
            let inverse = self.map.inverse_depths[pixel];
            inverse > 0.0 && is_past(inverse)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Lens, Rigid3, View};
    use glam::DVec2;
    use image::{Rgba, RgbaImage};

    #[test]
    fn who_sees_past_a_point_objects_to_it_whatever_is_beside() {
        let view = |x: f64| View {
            lens: Lens::pinhole(DVec2::splat(40.0), DVec2::new(25.0, 20.0)),
            width: 50,
            height: 40,
            camera_from_world: Rigid3::looking_at(DVec3::X * x, DVec3::X * x + DVec3::Z, DVec3::Y),
        };
        let gray = RgbaImage::from_pixel(50, 40, Rgba([100, 100, 100, 255]));
        // More than are asked at once.
        let photos: Vec<Option<SmallPhoto>> = (0..LANES + 3)
            .map(|i| SmallPhoto::new(&view(0.03 * i as f64), &gray, 50))
            .collect();
        // Near, far and unknown, as numbers fall.
        let map = |seed: usize| DepthMap {
            inverse_depths: (0..50 * 40)
                .map(|i| [0.5, 0.49, 0.2, 0.0][(i * 7 + i / 50 * 3 + i * i % 11 + seed) % 4])
                .collect(),
            step: 0.002,
        };
        let maps: Vec<DepthMap> = (0..photos.len()).map(map).collect();
        let with_maps: Vec<Option<&DepthMap>> = maps.iter().map(Some).collect();
        let objectors = Objectors::new(&photos, &with_maps);
        let mut counts = [0; LANES + 4];
        for k in 0..4000 {
            let share = |by: f64| (f64::from(k) * by).fract() - 0.5;
            let z = 1.5 + 5.0 * (share(0.324_718) + 0.5);
            let position = DVec3::new(1.4 * z * share(0.618_034), 1.2 * z * share(0.414_214), z);
            let objects = |(photo, map): (&Option<SmallPhoto>, &DepthMap)| {
                let (at, depth) = photo.as_ref()?.project(position)?;
                let inverse = f64::from(map.inverse_depths[photo.as_ref()?.index(at)?]);
                let clear = (BLOCKS / depth).max(BLOCKS_STEPS * map.step);
                (inverse > 0.0 && 1.0 / depth - inverse > clear).then_some(())
            };
            let count = photos.iter().zip(&maps).filter_map(objects).count();
            for most in 0..LANES {
                assert_eq!(objectors.are_more_than(most, position), count > most);
            }
            counts[count] += 1;
        }
        assert!(
            counts[..LANES].iter().all(|count| *count > 20),
            "{counts:?}"
        );
    }
}
