//! The pixels of an image that lie in a convex region.

use super::Pinhole;
use glam::DVec3;
use proxy::interior::Region;
use std::ops::Range;

/// Of each row of an image, the pixels from a first to a last one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// By row; empty where none of it is inside.
    rows: Vec<(u32, u32)>,
}

/// As a region's own: what lies on its edge is inside, in radians.
const MARGIN: f64 = 1e-9;

impl Window {
    /// All pixels of an image.
    pub fn whole(width: u32, height: u32) -> Self {
        let rows = vec![(0, width); height as usize];
        Self { rows }
    }

    /// The pixels of a camera whose rays a region has.
    pub fn of(region: &Region, camera: &Pinhole) -> Self {
        if region.is_all() {
            return Self::whole(camera.width, camera.height);
        }
        Self::of_cone(region.corners(), camera)
    }

    /// The pixels within a convex cone of directions in the world, its edges counter-clockwise
    /// as the eye sees them.
    pub(super) fn of_cone(edges: &[DVec3], camera: &Pinhole) -> Self {
        let edges: Vec<DVec3> = edges.iter().map(|d| camera.rotation * *d).collect();
        let side = |i: usize| edges[(i + 1) % edges.len()].cross(edges[i]).try_normalize();
        let sides: Vec<DVec3> = (0..edges.len()).filter_map(side).collect();
        let columns = &camera.columns;
        let row = |y: &f64| {
            let (mut first, mut end) = (0, columns.len());
            for side in &sides {
                let rest = side.y * y + side.z;
                let slack = MARGIN * (1.0 + y.abs());
                // Monotone along the row.
                let is_outside = |x: &f64| side.x * x + rest < -slack;
                if side.x >= 0.0 {
                    first = first.max(columns.partition_point(is_outside));
                } else {
                    end = end.min(columns.partition_point(|x| !is_outside(x)));
                }
            }
            (first as u32, end.max(first) as u32)
        };
        Self {
            rows: camera.rows.iter().map(row).collect(),
        }
    }

    /// Takes in another window of the same image, and in each row what lies between the two.
    pub(super) fn take_in(&mut self, other: &Self) {
        self.rows.resize(other.rows.len(), (0, 0));
        for (row, &(first, end)) in self.rows.iter_mut().zip(&other.rows) {
            if row.0 >= row.1 {
                *row = (first, end);
            } else if first < end {
                *row = (row.0.min(first), row.1.max(end));
            }
        }
    }

    /// Whether it has all pixels of an image so wide.
    pub(crate) fn is_whole(&self, width: u32) -> bool {
        self.rows.iter().all(|row| *row == (0, width))
    }

    /// The pixels of a row.
    pub fn row(&self, y: u32) -> Range<u32> {
        let (first, end) = self.rows.get(y as usize).copied().unwrap_or_default();
        first..end
    }
}
