//! Triangles to pixels.
//!
//! A pixel keeps the greatest of (inverse depth, lower index first). That is one number, and the
//! greatest is the same in whatever order triangles come. Colours are found afterwards, once a
//! pixel.
//!
//! The image is drawn in bands of rows, each by one task, which meets runs of triangles front to
//! back. Runs and triangles are passed over where all pixels around them show something nearer
//! already, or what an image fills for good: of them nothing would be seen, so pictures are the
//! same.

use super::geometry::{FEW_RUNS, RUN, Run};
use super::projected::Projected;
use super::squares::Squares;
use super::target::{ALONE, fill_all};
use super::triangle::{Around, Band, Ready, spans};
use super::{Pinhole, Runs, Window};
use crate::cpu::lanes::vectorised;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// What each pixel of an image sees: which triangle, and how near.
#[derive(Debug, Default)]
pub struct Raster {
    width: u32,
    /// Bits of 1 / z, then of the complement of the triangle's index, or 0 for what is seen before any
    /// triangle; 0 for nothing.
    keys: Vec<u64>,
}

/// A plane with what lies beyond it: only that is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    /// Unit length, away from the viewer, in the camera's frame.
    normal: DVec3,
    /// Of the plane from the eye, along the normal.
    distance: f64,
}

/// What counts as on the plane, in shares of the inverse depth.
pub(super) const ON_PLANE: f64 = 1e-6;

impl Beyond {
    /// What is beyond a plane through a point, as a camera sees it; `normal` points away from the
    /// viewer, both in the world.
    pub fn new(camera: &Pinhole, point: DVec3, normal: DVec3) -> Self {
        let normal = camera.rotation * normal;
        let distance = normal.dot(camera.point(point));
        Self { normal, distance }
    }

    /// Whether the eye is before the plane, not on it or beyond.
    pub(super) fn is_ahead(&self) -> bool {
        self.distance > 0.0
    }

    /// The inverse depth of the plane along a ray with z = 1; infinite where the eye is
    /// on the plane, and not positive where the ray does not meet it.
    pub fn inverse_depth(&self, ray: DVec3) -> f64 {
        let along = self.normal.dot(ray);
        match self.distance.abs() > 0.0 {
            true => along / self.distance,
            false => f64::INFINITY * along.signum(),
        }
    }

    /// Whether the point at an inverse depth along a ray with z = 1 is beyond or on it.
    pub fn has(&self, ray: DVec3, inverse_depth: f64) -> bool {
        let height = self.normal.dot(ray) - self.distance * inverse_depth;
        height >= -ON_PLANE * (self.distance * inverse_depth).abs()
    }
}

/// How triangles are drawn.
#[derive(Clone, Copy, Debug, Default)]
pub struct DrawOptions<'a> {
    /// Only what is beyond it is drawn.
    pub beyond: Option<&'a Beyond>,
    /// Whether triangles are drawn, too, that others hide. The pictures are the same.
    pub all: bool,
}

/// What drawing triangles took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Met {
    /// Triangles of runs that were not passed over.
    pub tried: usize,
    /// Triangles that touch a pixel's centre where nothing was known to hide them, if that is
    /// known.
    pub touching: Option<usize>,
}

/// A run that is waiting.
struct Queued<'a> {
    run: &'a Run,
    window: &'a Window,
    /// Of its box from the eye, squared.
    distance: f64,
    /// Pixels around it, from … to before.
    columns: [u32; 2],
    rows: [u32; 2],
    /// Of its box the greatest inverse depth; infinite where it is not all in front.
    nearest: f32,
    /// By triangle a bit: whether it touches a pixel's centre; the last bit: whether the run was
    /// not passed over.
    touching: [AtomicU64; 2],
}

/// What a task has at hand.
#[derive(Default)]
struct Scratch {
    points: Projected,
    squares: Squares,
}

/// Rows in a band: few, so that its pixels stay at hand.
const BAND: usize = 64;
/// The bit of a run itself.
const TRIED: u128 = 1 << 127;
/// Rounding, in shares of the distance, and in pixels.
const SLACK: f64 = 1e-9;
const ROOM: f64 = 1.0;

const _: () = assert!(RUN < 127, "a bit for each triangle of a run");

impl Raster {
    /// Empties it, as large as a camera's image.
    pub fn clear(&mut self, camera: &Pinhole) {
        self.clear_to(camera, &[]);
    }

    /// Empties it, but for something that is seen before any triangle: by pixel its inverse depth, 0
    /// for nothing. Nothing behind it is kept.
    pub(super) fn clear_to(&mut self, camera: &Pinhole, floor: &[f32]) {
        let count = camera.width as usize * camera.height as usize;
        self.width = camera.width;
        if floor.is_empty() {
            return fill_all(&mut self.keys, count, 0);
        }
        self.keys.resize(count, 0);
        let key = |s: &f32| u64::from(s.to_bits()) << 32;
        let keys = self.keys.par_chunks_mut(ALONE);
        keys.zip(floor.par_chunks(ALONE)).for_each(|(keys, floor)| {
            keys.iter_mut().zip(floor).for_each(|(k, s)| *k = key(s));
        });
    }

    /// Draws runs of triangles where windows let them; both sides of triangles are seen.
    ///
    /// # Panics
    /// If the raster was cleared for another image.
    pub fn draw(
        &mut self,
        parts: &[(Runs<'_>, Window)],
        camera: &Pinhole,
        options: &DrawOptions<'_>,
    ) -> Met {
        assert_eq!(self.width, camera.width, "cleared for the camera");
        let mut queue: Vec<Queued<'_>> = Vec::new();
        for (runs, window) in parts {
            let runs = runs.runs.par_iter().with_min_len(FEW_RUNS);
            queue.par_extend(runs.filter_map(|run| {
                let queued = Queued::new(run, window, camera);
                queued.or_else(|| options.all.then(|| Queued::aside(run, window)))
            }));
        }
        // Nearest first. None is negative, so they are in the order of their bits.
        let places = queue.iter().zip(0..);
        let mut order: Vec<(u64, u32)> = places.map(|(q, i)| (q.distance.to_bits(), i)).collect();
        order.sort_unstable();
        let width = camera.width as usize;
        let bands = self.keys.par_chunks_mut(BAND * width).enumerate();
        bands.for_each_init(Scratch::default, |scratch, (i, keys)| {
            let rows = [i * BAND, i * BAND + keys.len() / width].map(|row| row as u32);
            let mut band = Band { rows, width, keys };
            // Loops, not chains of calls: those would be compiled without vector instructions.
            vectorised(
                #[inline(always)]
                || draw_band(&mut band, (&queue, &order), camera, options, scratch),
            );
        });
        let (mut tried, mut touching) = (0, 0);
        for queued in &queue {
            let bits = queued.bits();
            touching += (bits & !TRIED).count_ones() as usize;
            if bits & TRIED != 0 {
                tried += queued.run.triangles.len();
            }
        }
        Met {
            tried,
            touching: Some(touching),
        }
    }

    /// Which triangle a pixel sees, and its inverse depth; pixels are counted row by row.
    #[inline]
    pub fn at(&self, pixel: usize) -> Option<(u32, f32)> {
        let key = self.keys[pixel];
        let bits = (key >> 32) as u32;
        (key as u32 != 0).then(|| (!(key as u32), f32::from_bits(bits)))
    }
}

/// Draws what of waiting runs is in a band, in an order of their places.
#[inline(always)]
fn draw_band(
    band: &mut Band<'_>,
    (queue, order): (&[Queued<'_>], &[(u64, u32)]),
    camera: &Pinhole,
    options: &DrawOptions<'_>,
    scratch: &mut Scratch,
) {
    let Scratch { points, squares } = scratch;
    let width = camera.width as usize;
    let mut candidates = [0; RUN + 1];
    squares.begin(width, (band.rows[1] - band.rows[0]) as usize);
    for queued in order.iter().map(|(_, i)| &queue[*i as usize]) {
        let Some(block) = band.block(queued.columns, queued.rows) else {
            continue;
        };
        if !options.all && squares.hide(band.keys, width, &block, queued.nearest) {
            continue;
        }
        let mut bits = TRIED;
        let run = queued.run;
        points.project(run, camera);
        // 1. Triangles that may have a pixel, without a branch that no one foresees.
        let mut count = 0;
        for (i, corners) in run.corners.iter().enumerate() {
            candidates[count] = i as u8;
            count += usize::from(band.may_have(&points.around(*corners)));
        }
        // 2. Of them.
        for i in candidates[..count].iter().map(|i| usize::from(*i)) {
            let bounds = points.around(run.corners[i]);
            let corners = points.of(run.corners[i]);
            let Some(around) = Around::new(bounds, &corners, camera) else {
                continue;
            };
            let Some(block) = band.block(around.columns, around.rows) else {
                continue;
            };
            if !options.all && squares.hid(&block, around.nearest as f32) {
                continue;
            }
            let Some(triangle) = Ready::new(&corners, around) else {
                continue;
            };
            let idx = run.triangles[i];
            if band.fill(&triangle, idx, camera, queued.window, options.beyond) {
                bits |= 1 << i;
                squares.draw(&block);
            }
        }
        queued.add(bits);
    }
}

impl<'a> Queued<'a> {
    /// `None` where no pixel is around the run.
    fn new(run: &'a Run, window: &'a Window, camera: &Pinhole) -> Option<Self> {
        let off = (run.low - camera.center).max(camera.center - run.high);
        let mut queued = Self {
            distance: off.max(DVec3::ZERO).length_squared(),
            columns: [0, camera.width],
            rows: [0, camera.height],
            ..Self::aside(run, window)
        };
        let mut pixels = [DVec2::ZERO; 8];
        let mut nearest = f64::INFINITY;
        for (corner, pixel) in pixels.iter_mut().enumerate() {
            let side = |k: usize| match corner >> k & 1 {
                0 => run.low[k],
                _ => run.high[k],
            };
            let point = camera.point(DVec3::new(side(0), side(1), side(2)));
            let depth = point.z - SLACK * point.abs().max_element();
            if !(depth > 0.0) {
                return Some(queued);
            }
            *pixel = point.truncate() / point.z * camera.focal + camera.principal;
            nearest = nearest.min(depth);
        }
        if !pixels.iter().all(|pixel| pixel.is_finite()) {
            return Some(queued);
        }
        (queued.columns, queued.rows) = spans(&pixels, camera, ROOM)?;
        queued.nearest = (1.0 / nearest) as f32;
        Some(queued)
    }

    /// A run that no pixel is around, for the first band to find that out.
    fn aside(run: &'a Run, window: &'a Window) -> Self {
        Self {
            run,
            window,
            distance: f64::INFINITY,
            columns: [0, 1],
            rows: [0, 1],
            nearest: f32::INFINITY,
            touching: Default::default(),
        }
    }

    /// Adds bits of [`Self::touching`].
    fn add(&self, bits: u128) {
        let [low, high] = &self.touching;
        low.fetch_or(bits as u64, Relaxed);
        high.fetch_or((bits >> 64) as u64, Relaxed);
    }

    fn bits(&self) -> u128 {
        let [low, high] = self.touching.each_ref().map(|bits| bits.load(Relaxed));
        u128::from(high) << 64 | u128::from(low)
    }
}
