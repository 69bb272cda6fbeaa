//! Which triangles a frame draws, and how.

use super::NEAR;
use super::tables::Held;
use crate::interior::{Pinhole, Runs, Window};
use proxy::mesh::Model;
use rayon::prelude::*;

/// Depths of one triangle that differ by more than this factor are not left to the device, whose
/// rounding is relative to the nearest.
const SPREAD: f64 = 4.0;

/// What a frame draws: triangles in the model's order, each once a window.
pub(super) struct List {
    /// Triangle and window, 0 for everywhere; first those whose depths the device interpolates.
    pub entries: Vec<[u32; 2]>,
    pub in_front: usize,
    /// Pixels from … to before of each row, window after window.
    pub rows: Vec<[u32; 2]>,
}

impl List {
    pub(super) fn new(
        model: &Model,
        parts: &[(Runs<'_>, Window)],
        camera: &Pinhole,
        held: &Held,
    ) -> Self {
        let unit = held.units.world_per_unit;
        let near = 2.0 * NEAR * unit;
        let is_in_front =
            |nearest: f64, farthest: f64| nearest > near && farthest < SPREAD * nearest;
        let axis = camera.rotation.transpose().z_axis;
        let depth = |p: glam::DVec3| axis.dot(p - camera.center);
        // 1. Which triangles, a bit each: in front, then across; no list need be sorted, and none
        // is drawn twice.
        let words = held.count.div_ceil(64);
        let mut rows: Vec<[u32; 2]> = Vec::new();
        let mut sets: Vec<(u32, [Vec<u64>; 2])> = Vec::new();
        for (runs, window) in parts {
            let which = match window.is_whole(camera.width) {
                true => 0,
                false => {
                    let row = |y: u32| {
                        let open = window.row(y);
                        [open.start, open.end]
                    };
                    rows.extend((0..camera.height).map(row));
                    (rows.len() / camera.height as usize) as u32
                }
            };
            let mut set = [vec![0_u64; words], vec![0_u64; words]];
            let mut add = |class: usize, i: u32| set[class][i as usize / 64] |= 1 << (i % 64);
            // What a run's ball says of all that it holds its triangles would say, too.
            let class = |(list, center, radius): &(&[u32], glam::DVec3, f64)| -> Vec<u8> {
                let middle = depth(*center);
                if is_in_front(middle - radius, middle + radius) {
                    return Vec::new();
                }
                let class = |i: &u32| {
                    let depths = model.mesh.corners(*i as usize).map(depth);
                    let nearest = depths.into_iter().fold(f64::INFINITY, f64::min);
                    let farthest = depths.into_iter().fold(f64::NEG_INFINITY, f64::max);
                    u8::from(!is_in_front(nearest, farthest))
                };
                list.iter().map(class).collect()
            };
            let lists: Vec<_> = runs.balls().collect();
            let classes: Vec<Vec<u8>> = lists.par_iter().with_min_len(64).map(class).collect();
            for ((list, ..), classes) in lists.iter().zip(&classes) {
                for (k, i) in list.iter().enumerate() {
                    add(classes.get(k).copied().unwrap_or(0).into(), *i);
                }
            }
            sets.push((which, set));
        }
        // 2. In order.
        let mut entries = Vec::new();
        let mut in_front = 0;
        for class in 0..2 {
            for word in 0..words {
                let any = sets
                    .iter()
                    .fold(0, |bits, (_, set)| bits | set[class][word]);
                let mut left = any;
                while left != 0 {
                    let bit = left.trailing_zeros();
                    left &= left - 1;
                    for (window, set) in &sets {
                        if set[class][word] >> bit & 1 == 1 {
                            entries.push([64 * word as u32 + bit, *window]);
                        }
                    }
                }
            }
            if class == 0 {
                in_front = entries.len();
            }
        }
        Self {
            entries,
            in_front,
            rows,
        }
    }
}
