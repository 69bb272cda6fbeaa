//! Triangles met front to back, less those that are hidden.
//!
//! A run of triangles is passed over where all pixels around it show something nearer already, by a
//! pyramid of the least inverse depths of squares of pixels (Greene, Kass and Miller 1993,
//! "Hierarchical Z-buffer visibility"). What an image fills for good hides all beyond its portal's
//! plane before any triangle is met. Of what is passed over nothing would be seen, so pictures are
//! the same.

use super::corners::Corners;
use super::{Pinhole, Raster, Runs, Window};
use crate::cpu::lanes::vectorised;
use glam::{DVec2, DVec3};
use proxy::mesh::Model;
use rayon::prelude::*;
use std::sync::atomic::AtomicU64;

/// Of squares of pixels, and of squares of those, the least inverse depth behind which nothing is
/// seen.
#[derive(Debug, Default)]
pub(super) struct Hidden {
    /// From the finest to a single square.
    levels: Vec<Level>,
}

#[derive(Debug, Default)]
struct Level {
    across: usize,
    /// Row by row.
    least: Vec<f32>,
}

/// What meeting triangles took.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Met {
    /// Triangles that were not passed over.
    pub(super) tried: usize,
    /// Those of them that touch a pixel's centre, if that is known.
    pub(super) touching: Option<usize>,
}

/// A run that is waiting.
struct Queued<'a> {
    /// Of its box from the eye, squared.
    distance: f64,
    list: &'a [u32],
    /// The box' least and greatest coordinates.
    corners: [DVec3; 2],
    window: &'a Window,
}

/// Pixels along a side of the finest squares.
const SIDE: usize = 8;
/// The most squares along a side that one run is compared with.
const ACROSS: usize = 8;
/// Runs that are met before the next are asked whether these hide them; then twice as many, and so
/// on.
const FIRST: usize = 64;
/// Rounding, in shares of the distance, and in pixels.
const SLACK: f64 = 1e-9;
const ROOM: f64 = 1.0;

/// Meets triangles in windows, the nearest runs first. `floor` has, by pixel, an inverse depth
/// behind which nothing is seen whatever is met; it may be empty.
pub(super) fn meet(
    model: &Model,
    parts: &[(Runs<'_>, Window)],
    camera: &Pinhole,
    floor: &[f32],
    raster: &mut Raster,
    hidden: &mut Hidden,
) -> Met {
    // 1. By their boxes' distance.
    let mut queue: Vec<Queued<'_>> = Vec::new();
    for (runs, window) in parts {
        for (list, corners) in runs.boxes() {
            let [low, high] = corners;
            let off = (low - camera.center).max(camera.center - high);
            queue.push(Queued {
                distance: off.max(DVec3::ZERO).length_squared(),
                list,
                corners,
                window,
            });
        }
    }
    queue.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    // 2. More and more of them at once, but for those that are hidden by then.
    let (mut tried, mut touching) = (0, 0);
    let (mut rest, mut count) = (&queue[..], FIRST);
    let mut is_known = false;
    if !floor.is_empty() {
        hidden.find(raster, camera, floor);
        is_known = true;
    }
    while !rest.is_empty() {
        let (part, others) = rest.split_at(count.min(rest.len()));
        let (known, raster_now) = (&*hidden, &*raster);
        let draw = |corners: &mut Corners, run: &Queued<'_>| {
            if is_known && known.hides(&run.corners, camera) {
                return (0, 0);
            }
            let touching = raster_now.draw_list(model, run.list, camera, run.window, None, corners);
            (run.list.len(), touching)
        };
        let drawn = part.par_iter().with_min_len(2);
        let drawn = drawn.map_init(Corners::new, draw);
        let drawn = drawn.reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        (tried, touching) = (tried + drawn.0, touching + drawn.1);
        (rest, count) = (others, 2 * count);
        if !rest.is_empty() {
            hidden.find(raster, camera, floor);
            is_known = true;
        }
    }
    Met {
        tried,
        touching: Some(touching),
    }
}

/// Lessens what squares have by a row of pixels, the greater each of what it sees and of the floor.
#[inline(always)]
fn least_of_row(squares: &mut [f32], keys: &mut [AtomicU64], floor: Option<&[f32]>) {
    for (i, (square, keys)) in squares.iter_mut().zip(keys.chunks_mut(SIDE)).enumerate() {
        let floor = floor.map(|floor| &floor[i * SIDE..i * SIDE + keys.len()]);
        for (k, key) in keys.iter_mut().enumerate() {
            let met = f32::from_bits((*key.get_mut() >> 32) as u32);
            let s = floor.map_or(met, |floor| floor[k].max(met));
            *square = square.min(s);
        }
    }
}

impl Hidden {
    /// Of what was met so far.
    fn find(&mut self, raster: &mut Raster, camera: &Pinhole, floor: &[f32]) {
        let (width, height) = (camera.width as usize, camera.height as usize);
        let across = width.div_ceil(SIDE);
        let down = height.div_ceil(SIDE);
        // 1. Squares of pixels.
        self.levels
            .resize_with(1.max(self.levels.len()), Level::default);
        let finest = &mut self.levels[0];
        finest.across = across;
        finest.least.clear();
        finest.least.resize(across * down, f32::INFINITY);
        let row = |((row, squares), keys): ((usize, &mut [f32]), &mut [AtomicU64])| {
            vectorised(
                #[inline(always)]
                || {
                    for (i, keys) in keys.chunks_exact_mut(width).enumerate() {
                        let start = (row * SIDE + i) * width;
                        let floor = floor.get(start..start + width);
                        least_of_row(squares, keys, floor);
                    }
                },
            );
        };
        let rows = finest.least.par_chunks_mut(across).enumerate();
        rows.zip(raster.keys_mut().par_chunks_mut(SIDE * width))
            .for_each(row);
        // 2. Squares of squares.
        let (mut level, mut across, mut down) = (0, across, down);
        while across.max(down) > 1 {
            let (columns, rows) = (across.div_ceil(2), down.div_ceil(2));
            self.levels
                .resize_with((level + 2).max(self.levels.len()), Level::default);
            let (finer, coarser) = self.levels.split_at_mut(level + 1);
            let (finer, coarser) = (&finer[level].least, &mut coarser[0]);
            coarser.across = columns;
            coarser.least.clear();
            coarser.least.resize(columns * rows, f32::INFINITY);
            for (i, s) in finer.iter().enumerate() {
                let square = &mut coarser.least[i / across / 2 * columns + i % across / 2];
                *square = square.min(*s);
            }
            (level, across, down) = (level + 1, columns, rows);
        }
        self.levels.truncate(level + 1);
    }

    /// Whether nothing that is in a box would be seen: all of it is in front of the eye, and behind
    /// what every pixel around it shows.
    fn hides(&self, [low, high]: &[DVec3; 2], camera: &Pinhole) -> bool {
        // 1. The pixels around it, and its nearest depth.
        let (mut least, mut most) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let mut nearest = f64::INFINITY;
        for corner in 0..8 {
            let side = |k: usize| {
                if corner >> k & 1 == 0 {
                    low[k]
                } else {
                    high[k]
                }
            };
            let point = camera.point(DVec3::new(side(0), side(1), side(2)));
            let depth = point.z - SLACK * point.abs().max_element();
            if !(depth > 0.0) {
                return false;
            }
            let at = point.truncate() / point.z * camera.focal + camera.principal;
            (least, most) = (least.min(at), most.max(at));
            nearest = nearest.min(depth);
        }
        let (least, most) = (least - ROOM, most + ROOM);
        let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
        if !(least.cmplt(size).all() && most.cmpgt(DVec2::ZERO).all()) {
            return least.is_finite() && most.is_finite();
        }
        let (least, most) = (least.max(DVec2::ZERO), most.min(size - 1.0));
        let square = |at: f64| at as usize / SIDE;
        let [mut left, mut right] = [least.x, most.x].map(square);
        let [mut top, mut bottom] = [least.y, most.y].map(square);
        // 2. As fine as few squares allow.
        let mut level = 0;
        while (right - left).max(bottom - top) >= ACROSS {
            [left, right, top, bottom] = [left, right, top, bottom].map(|i| i / 2);
            level += 1;
        }
        let Level { across, least } = &self.levels[level];
        let s = (1.0 / nearest) as f32;
        (top..=bottom).all(|y| {
            let row = &least[y * across + left..=y * across + right];
            row.iter().all(|behind| *behind > s)
        })
    }
}
