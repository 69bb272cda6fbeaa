//! Which blocks of voxels depth maps need.

use super::frame::Frame;
use super::volume::Band;
use glam::{DVec3, IVec3};
use rayon::prelude::*;

/// Voxels along a block's side.
pub(super) const SIDE: usize = 8;
/// Blocks farther than this from the origin, in blocks, are not kept.
const FARTHEST: f64 = (1 << 20) as f64;

/// Where the voxels are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    /// Voxel (0, 0, 0), in the world: near the cameras, so that no digits are lost.
    pub(super) origin: DVec3,
    /// World units.
    pub(super) voxel_size: f64,
}

impl Grid {
    /// A voxel's centre.
    pub(super) fn voxel_in_world(&self, voxel: IVec3) -> DVec3 {
        self.origin + voxel.as_dvec3() * self.voxel_size
    }

    /// The block coordinates of a point: block (i, j, k) holds i ≤ x < i + 1, and so on.
    /// Blocks meet midway between voxels.
    fn in_blocks(&self, point_in_world: DVec3) -> DVec3 {
        ((point_in_world - self.origin) / self.voxel_size + 0.5) / SIDE as f64
    }
}

/// Adds the blocks that the truncation bands of a depth map's rays enter to the sorted
/// `keys`.
pub(super) fn add_touched(
    keys: &mut Vec<IVec3>,
    grid: &Grid,
    frame: &Frame,
    rays: &[DVec3],
    band: &Band,
) {
    let world_from_camera = frame.view.camera_from_world.inverse();
    let row_keys = |row: usize| {
        let mut found: Vec<IVec3> = Vec::new();
        for (point, cos) in frame.surface(rays, row) {
            // The band is as thick as it should be across the surface.
            let along = point.normalize() / cos;
            // What is nearer than the camera is behind it.
            let depth = |p: DVec3| frame.along.depth(p);
            let front = match depth(along) * band.before < depth(point) {
                true => point - along * band.before,
                false => DVec3::ZERO,
            };
            let back = point + along * band.behind;
            let [from, to] = [front, back].map(|p| grid.in_blocks(world_from_camera * p));
            walk(from, to, |key| {
                if found.last() != Some(&key) {
                    found.push(key);
                }
            });
        }
        sort(&mut found);
        found
    };
    let rows: Vec<Vec<IVec3>> = (0..frame.view.height as usize)
        .into_par_iter()
        .map(row_keys)
        .collect();
    keys.extend(rows.iter().flatten());
    sort(keys);
}

fn sort(keys: &mut Vec<IVec3>) {
    keys.sort_unstable_by_key(|k| k.to_array());
    keys.dedup();
}

/// The unit cells that a segment passes through (Amanatides and Woo 1987).
fn walk(from: DVec3, to: DVec3, mut visit: impl FnMut(IVec3)) {
    let is_near = |p: DVec3| p.abs().max_element() < FARTHEST;
    if !(is_near(from) && is_near(to)) {
        return;
    }
    let (mut at, end) = (from.floor().as_ivec3(), to.floor().as_ivec3());
    let way = to - from;
    let step = way.signum();
    let mut next = DVec3::INFINITY;
    let mut stride = DVec3::INFINITY;
    for k in 0..3 {
        if way[k] != 0.0 {
            let border = at[k] as f64 + f64::from(step[k] > 0.0);
            next[k] = (border - from[k]) / way[k];
            stride[k] = way[k].abs().recip();
        }
    }
    visit(at);
    for _ in 0..(end - at).abs().element_sum() {
        let k = (0..3)
            .min_by(|a, b| next[*a].total_cmp(&next[*b]))
            .unwrap_or(0);
        at[k] += step[k] as i32;
        next[k] += stride[k];
        visit(at);
    }
}
