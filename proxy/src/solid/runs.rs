//! Triangles near one another, passed over together where a camera sees nothing around them.

use crate::Mesh;
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;

/// Boxes around triangles of a mesh, each around so many that follow one another: as a rule those are near.
pub(super) struct Runs(Vec<[DVec3; 2]>);

/// Triangles in a run: few where tests have few.
const RUN: usize = if cfg!(test) { 4 } else { 64 };

/// What lies beyond any of some planes through a camera's centre, beyond doubt of rounding, it does not see.
pub(crate) struct Sight {
    /// In the world.
    pub center: DVec3,
    /// Towards what is seen; of any length.
    pub normals: [DVec3; 5],
}

/// More than rounding is worth, in shares of what is added up.
const SLACK: f64 = 1e-9;

impl Sight {
    /// Whether all of a box is unseen.
    fn is_beyond(&self, [low, high]: &[DVec3; 2]) -> bool {
        let middle = 0.5 * (*low + *high) - self.center;
        let half = 0.5 * (*high - *low);
        self.normals.iter().any(|normal| {
            let most = normal.dot(middle) + normal.abs().dot(half);
            let terms = normal.abs().dot(middle.abs() + half);
            most < -SLACK * terms
        })
    }
}

impl Runs {
    pub(super) fn new(mesh: &Mesh) -> Self {
        let around = |run: &[[u32; 3]]| {
            let corners = run.iter().flatten().map(|i| mesh.positions[*i as usize]);
            let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
            corners.fold(none, |[low, high], p| [low.min(p), high.max(p)])
        };
        Self(mesh.triangles.par_chunks(RUN).map(around).collect())
    }

    /// Which triangles of so many may be seen, run by run, in order.
    pub(super) fn in_sight(&self, count: usize, sight: &Sight) -> Vec<Range<usize>> {
        let runs = (0..count).step_by(RUN).zip(&self.0);
        let seen = runs.filter(|(_, around)| !sight.is_beyond(around));
        seen.map(|(first, _)| first..(first + RUN).min(count))
            .collect()
    }
}
