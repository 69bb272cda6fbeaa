//! Surface nets (Gibson 1998): a vertex in every cell of eight voxels that the surface
//! crosses, at the mean of where it crosses the cell's edges; a quadrilateral around every
//! edge crossed.

use super::blocks::SIDE;
use super::volume::Volume;
use crate::Mesh;
use glam::{DVec3, IVec3};
use rayon::prelude::*;

/// Voxels along the side of a block with the first layer of the next ones.
const WIDE: usize = SIDE + 1;
/// Distances change by no more than a voxel's side from one voxel to the next; where they do
/// by more than so many, free space meets what lies behind a silhouette.
const MAX_CHANGE: f64 = 2.0;
/// The surface lies so many voxels behind the distances' zero, so that where a wall passes
/// exactly through voxels rounding does not decide which of them are outside.
const BEHIND_ZERO: f64 = 1e-4;

/// The eight corners of a cell, and the edges between them: pairs that differ in one bit.
const EDGES: [(usize, usize); 12] = [
    (0, 1),
    (2, 3),
    (4, 5),
    (6, 7),
    (0, 2),
    (1, 3),
    (4, 6),
    (5, 7),
    (0, 4),
    (1, 5),
    (2, 6),
    (3, 7),
];

/// A block's vertices.
struct Vertices {
    /// Their cells, ascending.
    cells: Vec<u16>,
    positions: Vec<DVec3>,
}

/// The zero of the distances.
pub(super) fn surface(volume: &Volume) -> Mesh {
    let numbers = 0..volume.keys.len();
    let max_change = (MAX_CHANGE * volume.grid.voxel_size / volume.band.before) as f32;
    let crossing = |a: f32, b: f32| {
        // NaN compares false.
        let is_crossed = (a < 0.0 && b >= 0.0) || (b < 0.0 && a >= 0.0);
        is_crossed && (a - b).abs() <= max_change
    };
    // 1. Vertices.
    let vertices: Vec<Vertices> = numbers
        .clone()
        .into_par_iter()
        .map(|block_idx| {
            let values = values(volume, block_idx);
            let first = volume.keys[block_idx] * SIDE as i32;
            let mut found = Vertices {
                cells: Vec::new(),
                positions: Vec::new(),
            };
            for cell in 0..SIDE * SIDE * SIDE {
                let at = unpack(cell);
                let corners: [f32; 8] = std::array::from_fn(|i| values[wide(at + bits(i))]);
                let (mut sum, mut count) = (DVec3::ZERO, 0);
                for (i, j) in EDGES {
                    let (a, b) = (corners[i], corners[j]);
                    if crossing(a, b) {
                        let t = f64::from(a) / (f64::from(a) - f64::from(b));
                        sum += bits(i).as_dvec3().lerp(bits(j).as_dvec3(), t);
                        count += 1;
                    }
                }
                if count > 0 {
                    let within = sum / f64::from(count);
                    found.cells.push(cell as u16);
                    found.positions.push(
                        volume.grid.voxel_in_world(first + at) + within * volume.grid.voxel_size,
                    );
                }
            }
            found
        })
        .collect();
    let mut first_of = Vec::with_capacity(vertices.len());
    let mut total = 0_u32;
    for block in &vertices {
        first_of.push(total);
        total += block.cells.len() as u32;
    }
    let positions: Vec<DVec3> = vertices
        .iter()
        .flat_map(|v| &v.positions)
        .copied()
        .collect();
    // 2. Quadrilaterals.
    let triangles: Vec<Vec<[u32; 3]>> = numbers
        .into_par_iter()
        .map(|block_idx| {
            let key = volume.keys[block_idx];
            // Blocks before this one along each axis, itself included.
            let before: [Option<usize>; 8] = std::array::from_fn(|i| match i {
                0 => Some(block_idx),
                _ => volume.find(key - bits(i)),
            });
            let vertex = |cell: IVec3| {
                let mut block = 0;
                let mut within = cell;
                for k in 0..3 {
                    if cell[k] < 0 {
                        within[k] += SIDE as i32;
                        block |= 1 << k;
                    }
                }
                let block = before[block]?;
                let found = vertices[block]
                    .cells
                    .binary_search(&(pack(within) as u16))
                    .ok()?;
                Some(first_of[block] + found as u32)
            };
            // The first of the four cells around an edge is the block's own.
            let mut triangles = Vec::new();
            if vertices[block_idx].cells.is_empty() {
                return triangles;
            }
            let values = values(volume, block_idx);
            for voxel in 0..SIDE * SIDE * SIDE {
                let at = unpack(voxel);
                let a = values[wide(at)];
                for k in 0..3 {
                    let b = values[wide(at + IVec3::AXES[k])];
                    if !crossing(a, b) {
                        continue;
                    }
                    let (u, v) = (IVec3::AXES[(k + 1) % 3], IVec3::AXES[(k + 2) % 3]);
                    // Around the axis, counter-clockwise where it points towards one.
                    let around = [at - u - v, at - v, at, at - u].map(vertex);
                    let [Some(p), Some(q), Some(r), Some(s)] = around else {
                        continue;
                    };
                    // Out of the surface is where distances grow.
                    let quad = if a < 0.0 { [p, q, r, s] } else { [s, r, q, p] };
                    let of = |i: usize| positions[quad[i] as usize];
                    // The shorter diagonal.
                    let [p, q, r, s] = quad;
                    if of(0).distance_squared(of(2)) <= of(1).distance_squared(of(3)) {
                        triangles.extend([[p, q, r], [p, r, s]]);
                    } else {
                        triangles.extend([[q, r, s], [q, s, p]]);
                    }
                }
            }
            triangles
        })
        .collect();
    Mesh {
        positions,
        triangles: triangles.concat(),
    }
}

/// The distances of a block and of the first layer of the blocks after it; NaN where unknown.
fn values(volume: &Volume, block_idx: usize) -> Box<[f32; WIDE * WIDE * WIDE]> {
    let mut values = Box::new([f32::NAN; WIDE * WIDE * WIDE]);
    let side = SIDE as i32;
    let behind_zero = (BEHIND_ZERO * volume.grid.voxel_size / volume.band.before) as f32;
    for i in 0..8 {
        let Some(block) = (match i {
            0 => Some(block_idx),
            _ => volume.find(volume.keys[block_idx] + bits(i)),
        }) else {
            continue;
        };
        let extent = IVec3::ONE * side - bits(i) * (side - 1);
        for z in 0..extent.z {
            for y in 0..extent.y {
                for x in 0..extent.x {
                    let at = IVec3::new(x, y, z);
                    values[wide(at + bits(i) * side)] =
                        volume.blocks[block][pack(at)].value() + behind_zero;
                }
            }
        }
    }
    values
}

fn bits(i: usize) -> IVec3 {
    IVec3::new((i & 1) as i32, (i >> 1 & 1) as i32, (i >> 2 & 1) as i32)
}

fn pack(at: IVec3) -> usize {
    (at.x + SIDE as i32 * (at.y + SIDE as i32 * at.z)) as usize
}

fn unpack(i: usize) -> IVec3 {
    IVec3::new(
        (i % SIDE) as i32,
        (i / SIDE % SIDE) as i32,
        (i / (SIDE * SIDE)) as i32,
    )
}

fn wide(at: IVec3) -> usize {
    (at.x + WIDE as i32 * (at.y + WIDE as i32 * at.z)) as usize
}
