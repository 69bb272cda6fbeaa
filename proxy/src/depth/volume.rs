//! Signed distances in blocks of voxels.

use super::blocks::{Grid, SIDE};
use super::frame::{Frame, TILE};
use calibrate::{DepthAlong, View};
use glam::{DVec3, IVec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// Voxels of a block.
pub(super) const VOXELS: usize = SIDE * SIDE * SIDE;

/// A voxel: what the depth maps say of its centre.
#[derive(Clone, Copy, Default)]
pub(super) struct Voxel {
    /// The mean signed distance from the surface, in bands before it, positive towards the
    /// cameras.
    distance: f32,
    /// The weight of those who say so.
    weight: f32,
    /// The weight of those who see through here to something behind.
    free: f32,
}

impl Voxel {
    /// The distance in bands; NaN where nobody saw this place.
    pub(super) fn value(&self) -> f32 {
        match *self {
            Self {
                weight: 0.0,
                free: 0.0,
                ..
            } => f32::NAN,
            Self { weight, free, .. } if free > weight => 1.0,
            Self { distance, .. } => distance,
        }
    }
}

/// Where the bytes of a block go, its key and place in tables included.
pub(super) const BLOCK_BYTES: usize = VOXELS * size_of::<Voxel>() + 64;

/// What one who sees through a place counts, against one who sees a surface frontally at the
/// median depth.
const FREE_WEIGHT: f64 = 0.5;

/// How far from a surface distances are kept, in world units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Band {
    /// In front of it.
    pub(super) before: f64,
    /// Behind it, where nothing was seen: no more than cells need that the surface crosses,
    /// or the two sides of thin things would hide one another.
    pub(super) behind: f64,
    /// The least cosine of slant believed.
    pub(super) least_cos: f64,
}

/// The blocks, sorted by key.
pub(super) struct Volume {
    pub(super) grid: Grid,
    pub(super) band: Band,
    pub(super) keys: Vec<IVec3>,
    pub(super) blocks: Vec<Box<[Voxel; VOXELS]>>,
    index: HashMap<IVec3, u32>,
}

impl Volume {
    pub(super) fn new(grid: Grid, band: Band, keys: Vec<IVec3>) -> Self {
        let empty = || Box::new([Voxel::default(); VOXELS]);
        let blocks = keys.iter().map(|_| empty()).collect();
        let index = keys
            .iter()
            .enumerate()
            .map(|(i, k)| (*k, i as u32))
            .collect();
        Self {
            grid,
            band,
            keys,
            blocks,
            index,
        }
    }

    /// The number of the block with a key.
    pub(super) fn find(&self, key: IVec3) -> Option<usize> {
        self.index.get(&key).map(|i| *i as usize)
    }

    /// Takes in what a depth map says.
    pub(super) fn integrate(&mut self, frame: &Frame) {
        let (grid, band) = (&self.grid, &self.band);
        let blocks = self.keys.par_iter().zip(&mut self.blocks);
        blocks.with_min_len(16).for_each(|(key, block)| {
            let corner = grid.voxel_in_world(*key * SIDE as i32);
            match reach(frame, corner, grid.voxel_size, band) {
                Reach::None => (),
                Reach::Free(depth) => {
                    let weight = free_weight(frame, depth);
                    block.iter_mut().for_each(|v| v.free += weight);
                }
                Reach::Some => vote(frame, corner, grid.voxel_size, band, block),
            }
        });
    }
}

/// What a depth map says of a block as a whole.
enum Reach {
    /// Nothing: it lies beside the image or behind the surface.
    None,
    /// All of it is free, at this depth.
    Free(f64),
    /// Ask voxel by voxel.
    Some,
}

fn reach(frame: &Frame, corner: DVec3, voxel_size: f64, band: &Band) -> Reach {
    let view = &frame.view;
    let extent = voxel_size * (SIDE - 1) as f64;
    let corners = (0..8).map(|i| {
        let along = DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64);
        view.camera_from_world * (corner + along * extent)
    });
    let (mut near, mut far) = (f64::INFINITY, f64::NEG_INFINITY);
    let (mut low, mut high) = (glam::DVec2::INFINITY, glam::DVec2::NEG_INFINITY);
    let mut all_seen = true;
    for point in corners {
        let depth = frame.along.depth(point);
        near = near.min(depth);
        far = far.max(depth);
        match view.lens.project(point) {
            Some(pixel) => {
                let pixel = glam::DVec2::new(pixel.x, pixel.y);
                (low, high) = (low.min(pixel), high.max(pixel));
            }
            None => all_seen = false,
        }
    }
    if frame.along == DepthAlong::Ray {
        // A block's corners are neither its nearest points nor, around the vertical axis, those whose pixels lie
        // outermost.
        let middle = view.camera_from_world * (corner + DVec3::splat(0.5 * extent));
        let half = 0.5 * extent * 3_f64.sqrt();
        (near, far) = (middle.length() - half, middle.length() + half);
        all_seen &= middle.x.hypot(middle.z) > 4.0 * half;
    }
    if far <= 0.0 {
        return Reach::None;
    }
    if !all_seen || near <= 0.0 {
        return Reach::Some;
    }
    // A lens bends the block's sides outwards by less than this.
    let margin = (high - low) * 0.25 + 1.0;
    let (low, high) = (low - margin, high + margin);
    let size = glam::DVec2::new(view.width.into(), view.height.into());
    if high.min_element() < 0.0 || low.cmpge(size).any() {
        return Reach::None;
    }
    let is_inside = low.min_element() >= 0.0 && high.cmplt(size).all();
    let tile = |pixel: f64, end: f64| pixel.clamp(0.0, end - 1.0) as usize / TILE;
    let (mut least, mut greatest, mut whole) = (f32::INFINITY, 0_f32, is_inside);
    for row in tile(low.y, size.y)..=tile(high.y, size.y) {
        for column in tile(low.x, size.x)..=tile(high.x, size.x) {
            let tile = &frame.tiles[row * frame.tiles_across + column];
            least = least.min(tile.least);
            greatest = greatest.max(tile.greatest);
            whole &= tile.whole;
        }
    }
    // Nearer or farther than this the distance to any believed surface is truncated.
    let margin = band.before.max(band.behind) / band.least_cos;
    if greatest == 0.0 || near > f64::from(least).recip() + margin {
        Reach::None
    } else if whole && far < f64::from(greatest).recip() - margin {
        Reach::Free(0.5 * (near + far))
    } else {
        Reach::Some
    }
}

/// Errors of depth grow with its square; so do those of poses, seen from far.
fn free_weight(frame: &Frame, depth: f64) -> f32 {
    (FREE_WEIGHT * frame.weight_at(depth)) as f32
}

/// Takes in a depth map voxel by voxel.
fn vote(frame: &Frame, corner: DVec3, voxel_size: f64, band: &Band, block: &mut [Voxel; VOXELS]) {
    let View {
        lens,
        width,
        height,
        camera_from_world,
    } = &frame.view;
    let origin = *camera_from_world * corner;
    let axes = camera_from_world.matrix() * voxel_size;
    let (columns, rows) = (f64::from(*width), f64::from(*height));
    for (i, voxel) in block.iter_mut().enumerate() {
        let at = DVec3::new(
            (i % SIDE) as f64,
            (i / SIDE % SIDE) as f64,
            (i / (SIDE * SIDE)) as f64,
        );
        let point = origin + axes * at;
        let there = frame.along.depth(point);
        let Some(pixel) = lens.project(point).filter(|_| there > 0.0) else {
            continue;
        };
        if !(pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < columns && pixel.y < rows) {
            continue;
        }
        let (column, row) = (pixel.x as usize, pixel.y as usize);
        let sample = &frame.samples[row * *width as usize + column];
        if sample.inverse == 0.0 {
            continue;
        }
        // 1. The depth of the plane that the surface has around the pixel.
        let off = [pixel.x - column as f64 - 0.5, pixel.y - row as f64 - 0.5];
        let here = f64::from(sample.inverse);
        let inverse =
            here + off[0] * f64::from(sample.slope[0]) + off[1] * f64::from(sample.slope[1]);
        let depth = inverse.clamp(0.5 * here, 2.0 * here).recip();
        let along_ray = (depth - there) * (point.length() / there);
        if sample.cos == 0.0 {
            if along_ray > 0.1 * depth + band.before {
                voxel.free += free_weight(frame, there);
            }
            continue;
        }
        // 2. The distance from that plane.
        let distance = along_ray * f64::from(sample.cos);
        if distance > band.before {
            voxel.free += free_weight(frame, there);
            continue;
        }
        // 3. Behind the surface, less and less is said.
        let sure = ((distance + band.behind) / (0.67 * band.behind)).clamp(0.0, 1.0);
        let weight = sample.weight * sure as f32;
        if weight > 0.0 {
            let sum = voxel.weight + weight;
            let distance = (distance / band.before) as f32;
            voxel.distance += (distance - voxel.distance) * (weight / sum);
            voxel.weight = sum;
        }
    }
}
