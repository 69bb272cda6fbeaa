//! A run's points as a camera sees them.

use super::Pinhole;
use super::geometry::Run;
use crate::cpu::lanes::whole_f64;
use glam::DVec3;

/// A point relative to a camera.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    /// In the camera's frame.
    pub(super) point: DVec3,
    /// 1 / z.
    pub(super) inverse_depth: f64,
}

impl Corner {
    const EYE: Self = Self {
        point: DVec3::ZERO,
        inverse_depth: 0.0,
    };
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
        let count = run.points.len();
        self.corners.resize(count, Corner::EYE);
        self.bounds.resize(count, [ANYWHERE; 4]);
        let corners = self.corners.iter_mut().zip(&mut self.bounds);
        // Without pushes, branches and casts that would keep it from becoming vector instructions.
        for (point, (corner, bounds)) in run.points.iter().zip(corners) {
            let point = camera.point(*point);
            let inverse_depth = 1.0 / point.z;
            *corner = Corner {
                point,
                inverse_depth,
            };
            let x = point.x * inverse_depth * focal.x + principal.x;
            let y = point.y * inverse_depth * focal.y + principal.y;
            let [left, right] = between(x - ROOM, x + ROOM, across);
            let [top, bottom] = between(y - ROOM, y + ROOM, down);
            let most = point.x.abs().max(point.y.abs()).max(point.z.abs());
            let is_in_front = point.z > IN_FRONT * most;
            let around = [left, top, -right, -bottom];
            for k in 0..4 {
                bounds[k] = if is_in_front { around[k] } else { ANYWHERE };
            }
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
    let first = (low - 0.5).max(0.0).min(count);
    let (whole, from) = whole_f64(first);
    let from = from + if whole < first { 1 } else { 0 };
    let (_, to) = whole_f64((high + 0.5).max(0.0).min(count));
    [from, to]
}
