//! The open border of a fused surface, which follows voxels in steps.

use crate::Mesh;
use glam::DVec3;
use rayon::prelude::*;

/// How often corners go towards the middle of their neighbours, and back again (Taubin 1995, "A signal processing approach to
/// fair surface design"): steps of a few voxels go, what is longer stays.
const ROUNDS: usize = 40;
const FORTH: f64 = 0.5;
const BACK: f64 = -0.53;
/// Corners stay within so many voxels.
const FARTHEST: f64 = 1.0;

/// Smooths the curves at which a surface ends. Corners within it stay, and so does a corner of the border that would turn a
/// triangle over.
pub(super) fn smooth(mesh: &mut Mesh, voxel_size: f64) {
    // 1. The border: edges of one triangle; of each corner there its two neighbours, where there are no more.
    let edge = |a: u32, b: u32| u64::from(a.min(b)) << 32 | u64::from(a.max(b));
    let sides = mesh.triangles.par_iter();
    let sides = sides.flat_map_iter(|[a, b, c]| [edge(*a, *b), edge(*b, *c), edge(*c, *a)]);
    let mut edges: Vec<u64> = sides.collect();
    edges.par_sort_unstable();
    let open = edges.chunk_by(|a, b| a == b).filter(|same| same.len() == 1);
    let mut ends: Vec<[u32; 2]> = open
        .flat_map(|same| {
            let [a, b] = [(same[0] >> 32) as u32, same[0] as u32];
            [[a, b], [b, a]]
        })
        .collect();
    ends.sort_unstable();
    let curves = ends
        .chunk_by(|a, b| a[0] == b[0])
        .filter(|of| of.len() == 2);
    let corners: Vec<[u32; 3]> = curves.map(|of| [of[0][0], of[0][1], of[1][1]]).collect();
    // 2. Forth and back.
    let before = mesh.positions.clone();
    for by in [FORTH, BACK].into_iter().cycle().take(2 * ROUNDS) {
        let at = |i: u32| mesh.positions[i as usize];
        let moved = |[i, a, b]: &[u32; 3]| at(*i) + by * (0.5 * (at(*a) + at(*b)) - at(*i));
        let moved: Vec<DVec3> = corners.par_iter().map(moved).collect();
        for ([i, ..], p) in corners.iter().zip(moved) {
            mesh.positions[*i as usize] = p;
        }
    }
    // 3. Not far, and no triangle turned over.
    let most = FARTHEST * voxel_size;
    for [i, ..] in &corners {
        let place = *i as usize;
        let off = (mesh.positions[place] - before[place]).clamp_length_max(most);
        mesh.positions[place] = before[place] + off;
    }
    let mut is_moved = vec![false; before.len()];
    for [i, ..] in &corners {
        is_moved[*i as usize] = true;
    }
    let of_border = |t: &&[u32; 3]| t.iter().any(|i| is_moved[*i as usize]);
    let along: Vec<[u32; 3]> = mesh.triangles.iter().filter(of_border).copied().collect();
    // Each time more of those that moved are back: it ends.
    loop {
        let is_over = |t: &&[u32; 3]| {
            let normal = |positions: &[DVec3]| {
                let [a, b, c] = t.map(|i| positions[i as usize]);
                (b - a).cross(c - a)
            };
            let (is, was) = (normal(&mesh.positions), normal(&before));
            is != was && is.dot(was) < 0.1 * was.length_squared()
        };
        let over: Vec<[u32; 3]> = along.par_iter().filter(is_over).copied().collect();
        if over.is_empty() {
            return;
        }
        for i in over.into_iter().flatten() {
            mesh.positions[i as usize] = before[i as usize];
        }
    }
}
