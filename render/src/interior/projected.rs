//! A run's points as a camera sees them.

use super::Pinhole;
use super::geometry::Run;
use glam::DVec3;

/// A point relative to a camera.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    /// In the camera's frame.
    pub(super) point: DVec3,
    /// 1 / z.
    pub(super) inverse_depth: f64,
}

/// A run's points relative to a camera.
#[derive(Debug, Default)]
pub(super) struct Projected {
    corners: Vec<Corner>,
    bounds: Vec<Bounds>,
}

/// Of a point in the image: the first column and row whose middles are at it or beyond, and less than
/// nothing by those before which it lies. Of several points the least of each number are the pixels
/// around all of them. All are [`ANYWHERE`] where a point is not in front.
pub(super) type Bounds = [i32; 4];

/// See [`Bounds`].
pub(super) const ANYWHERE: i32 = i32::MIN;
/// Corners nearer to the plane of the eye than this, in shares of their distance, are not
/// projected.
pub(super) const IN_FRONT: f64 = 1e-6;
/// How far beyond points pixels are asked for, in pixels: rounding.
const ROOM: f64 = 1e-3;

impl Projected {
    /// Projects a run's points, in place of those of another.
    #[inline(always)]
    pub(super) fn project(&mut self, run: &Run, camera: &Pinhole) {
        let (focal, principal) = (camera.focal, camera.principal);
        let [across, down] = [camera.width, camera.height].map(f64::from);
        self.corners.clear();
        self.bounds.clear();
        for point in &run.points {
            let point = camera.point(*point);
            let inverse_depth = 1.0 / point.z;
            self.corners.push(Corner {
                point,
                inverse_depth,
            });
            let pixel = point.truncate() * inverse_depth * focal + principal;
            let [left, right] = between(pixel.x - ROOM, pixel.x + ROOM, across);
            let [top, bottom] = between(pixel.y - ROOM, pixel.y + ROOM, down);
            let is_in_front = point.z > IN_FRONT * point.abs().max_element();
            self.bounds.push(match is_in_front {
                true => [left, top, -right, -bottom],
                false => [ANYWHERE; 4],
            });
        }
    }

    /// A triangle's corners.
    #[inline(always)]
    pub(super) fn of(&self, corners: [u16; 3]) -> [Corner; 3] {
        corners.map(|k| self.corners[usize::from(k)])
    }

    /// The pixels around them.
    #[inline(always)]
    pub(super) fn around(&self, corners: [u16; 3]) -> Bounds {
        let [a, b, c] = corners.map(|k| &self.bounds[usize::from(k)]);
        let mut least = [0; 4];
        for k in 0..4 {
            least[k] = a[k].min(b[k]).min(c[k]);
        }
        least
    }
}

/// Of so many pixels the first whose middle is at `low` or beyond, and the one after the last whose middle
/// is at `high` or before.
#[inline(always)]
pub(super) fn between(low: f64, high: f64, count: f64) -> [i32; 2] {
    // A cast takes the whole part of what is positive.
    let first = (low - 0.5).max(0.0).min(count);
    let whole = first as i32;
    let from = whole + i32::from(f64::from(whole) < first);
    let to = (high + 0.5).max(0.0).min(count) as i32;
    [from, to]
}
