//! Triangles to pixels.
//!
//! A triangle with corners a, b, c relative to the eye is seen along a ray d where d·(b × c),
//! d·(c × a) and d·(a × b) have the sign of a·(b × c); they are also the barycentric weights but
//! for their sum, and that sum over a·(b × c) is the inverse depth where d has z = 1 (Olano and
//! Greer 1997, "Triangle scan conversion using 2D homogeneous coordinates"). So nothing is cut off
//! at a near plane, and weights are right in perspective.
//!
//! A pixel keeps the greatest of (inverse depth, lower index first). That is one number, and the
//! greatest is the same in whatever order and on however many threads triangles come. Colours are
//! found afterwards, once a pixel.

use super::corners::{Corner, Corners, IN_FRONT};
use super::{Pinhole, Window};
use crate::cpu::lanes::vectorised;
use glam::{DVec2, DVec3};
use proxy::interior::clip;
use proxy::mesh::Model;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// What each pixel of an image sees: which triangle, and how near.
#[derive(Debug, Default)]
pub struct Raster {
    width: u32,
    /// Bits of 1 / z, then of the complement of the triangle's index; 0 for nothing.
    keys: Vec<AtomicU64>,
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
const ON_PLANE: f64 = 1e-6;

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

/// A triangle made ready: three edges, their sum over the volume, and pixels around it.
struct Ready {
    edges: [DVec3; 3],
    inverse_depth: DVec3,
    /// The greatest inverse depth of its corners; infinite where one is not in front.
    nearest: f64,
    columns: [u32; 2],
    rows: [u32; 2],
}

/// Lists that a task takes at once.
const GRAIN: usize = 2;
/// More columns than this are first narrowed down by each edge.
const WIDE: u32 = 8;
/// Edges that change less along the row than this, in shares of their terms, lie along it.
const ALONG_ROW: f64 = 1e-9;
/// How far beyond a triangle's corners its pixels are asked for, in pixels: rounding.
const ROOM: f64 = 1e-3;
/// Columns that are looked at together.
const TOGETHER: usize = 4;

impl Raster {
    /// Empties it, as large as a camera's image.
    pub fn clear(&mut self, camera: &Pinhole) {
        let count = camera.width as usize * camera.height as usize;
        self.width = camera.width;
        self.keys.truncate(count);
        self.keys.par_iter_mut().for_each(|key| *key.get_mut() = 0);
        self.keys.resize_with(count, AtomicU64::default);
    }

    /// Draws lists of triangles where a window lets them, and beyond a plane if there is one;
    /// both sides of triangles are seen. How many of them touch a pixel's centre.
    ///
    /// # Panics
    /// If a list names a triangle that the model does not have, or the raster was cleared for
    /// another image.
    pub fn draw(
        &self,
        model: &Model,
        lists: &[&[u32]],
        camera: &Pinhole,
        window: &Window,
        beyond: Option<&Beyond>,
    ) -> usize {
        assert_eq!(self.width, camera.width, "cleared for the camera");
        let list = |corners: &mut Corners, list: &&[u32]| {
            self.draw_list(model, list, camera, window, beyond, corners)
        };
        let lists = lists.par_iter().with_min_len(GRAIN);
        lists.map_init(Corners::new, list).sum()
    }

    /// One list of [`Self::draw`]'s, with corners of the same model and camera at hand.
    pub(super) fn draw_list(
        &self,
        model: &Model,
        list: &[u32],
        camera: &Pinhole,
        window: &Window,
        beyond: Option<&Beyond>,
        corners: &mut Corners,
    ) -> usize {
        // Loops, not chains of calls: those would be compiled without vector instructions.
        vectorised(
            #[inline(always)]
            || {
                let mut seen = 0;
                for i in list {
                    let corners = corners.of(model, camera, *i);
                    if let Some(triangle) = Ready::new(&corners, camera) {
                        let is_seen = self.fill(&triangle, *i, camera, window, beyond);
                        seen += usize::from(is_seen);
                    }
                }
                seen
            },
        )
    }

    #[inline(always)]
    fn fill(
        &self,
        triangle: &Ready,
        idx: u32,
        camera: &Pinhole,
        window: &Window,
        beyond: Option<&Beyond>,
    ) -> bool {
        let mut is_seen = false;
        let [a, b, c] = triangle.edges;
        // On an edge itself a pixel is inside of one of the two triangles that share it.
        let owns = [owns(a), owns(b), owns(c)];
        let depth = triangle.inverse_depth;
        for y in triangle.rows[0]..triangle.rows[1] {
            let dy = camera.rows[y as usize];
            let rest = [a.y * dy + a.z, b.y * dy + b.z, c.y * dy + c.z];
            let depth_rest = depth.y * dy + depth.z;
            let open = window.row(y);
            let mut from = open.start.max(triangle.columns[0]);
            let mut to = open.end.min(triangle.columns[1]);
            if to.saturating_sub(from) > WIDE {
                for i in 0..3 {
                    let (edge, rest) = (triangle.edges[i], rest[i]);
                    // Along the row nothing but rounding would tell where it crosses.
                    let size = (edge.y * dy).abs() + edge.z.abs();
                    if edge.x.abs() > ALONG_ROW * size {
                        (from, to) = narrowed(edge.x, rest, camera, from, to);
                    }
                }
            }
            let start = y as usize * self.width as usize;
            let (from, to) = (from as usize, to as usize);
            let mut next = from;
            while next < to {
                let first = next;
                next += TOGETHER;
                let columns = together(&camera.columns, first);
                // 1. The inverse depth where a ray meets the triangle, else 0.
                let mut depths = [0.0_f32; TOGETHER];
                for k in 0..TOGETHER {
                    let dx = columns[k];
                    let [e, f, g] = [a.x * dx + rest[0], b.x * dx + rest[1], c.x * dx + rest[2]];
                    let is_in = ((e > 0.0) | ((e == 0.0) & owns[0]))
                        & ((f > 0.0) | ((f == 0.0) & owns[1]))
                        & ((g > 0.0) | ((g == 0.0) & owns[2]));
                    // Rounding does not bring what is seen edge on before its corners.
                    let inverse_depth = depth.x * dx + depth_rest;
                    let inverse_depth = if inverse_depth > triangle.nearest {
                        triangle.nearest
                    } else {
                        inverse_depth
                    };
                    let stored = inverse_depth as f32;
                    let is_met = is_in & (stored > 0.0) & (stored < f32::INFINITY);
                    depths[k] = if is_met { stored } else { 0.0 };
                }
                // 2. What is nearer than what was there.
                for k in 0..TOGETHER.min(to - first) {
                    if depths[k] == 0.0 {
                        continue;
                    }
                    let ray = || DVec3::new(columns[k], dy, 1.0);
                    if beyond.is_some_and(|plane| {
                        let inverse_depth = depth.x * columns[k] + depth_rest;
                        !plane.has(ray(), inverse_depth.min(triangle.nearest))
                    }) {
                        continue;
                    }
                    is_seen = true;
                    let key = u64::from(depths[k].to_bits()) << 32 | u64::from(!idx);
                    let pixel = &self.keys[start + first + k];
                    if pixel.load(Relaxed) < key {
                        pixel.fetch_max(key, Relaxed);
                    }
                }
            }
        }
        is_seen
    }

    /// Which triangle a pixel sees, and its inverse depth; pixels are counted row by row.
    #[inline]
    pub fn at(&self, pixel: usize) -> Option<(u32, f32)> {
        let key = self.keys[pixel].load(Relaxed);
        let bits = (key >> 32) as u32;
        (key != 0).then(|| (!(key as u32), f32::from_bits(bits)))
    }

    /// What all pixels see, row by row: bits of the inverse depth, then of the complement of the
    /// triangle's index; 0 for nothing.
    pub(super) fn keys_mut(&mut self) -> &mut [AtomicU64] {
        &mut self.keys
    }
}

/// Whether what is on an edge itself is inside.
#[inline(always)]
fn owns(edge: DVec3) -> bool {
    edge.x > 0.0 || (edge.x == 0.0 && edge.y > 0.0)
}

/// The columns of from … to where slope·x + rest may be positive, but for rounding, which a
/// column more allows for.
#[inline(always)]
fn narrowed(slope: f64, rest: f64, camera: &Pinhole, from: u32, to: u32) -> (u32, u32) {
    let column = -rest / slope * camera.focal.x + camera.principal.x - 0.5;
    // A cast takes the whole part of what is positive.
    let at = column.max(0.0) as u32;
    if slope > 0.0 {
        (from.max(at.saturating_sub(1)), to)
    } else if column < -1.0 {
        (from, from)
    } else {
        (from, to.min(at.saturating_add(3)))
    }
}

/// Edges of a triangle as seen from the eye: along a ray each is its opposite corner's weight.
#[inline(always)]
pub(super) fn edges([a, b, c]: [DVec3; 3]) -> [DVec3; 3] {
    [b.cross(c), c.cross(a), a.cross(b)]
}

impl Ready {
    /// `None` where no pixel's centre can be inside.
    #[inline(always)]
    fn new([a, b, c]: &[Corner; 3], camera: &Pinhole) -> Option<Self> {
        let corners = [a.point, b.point, c.point];
        let (columns, rows) = match a.is_in_front & b.is_in_front & c.is_in_front {
            true => spans(&[a.pixel, b.pixel, c.pixel], camera, ROOM),
            false => pixels_around(&corners, camera),
        }?;
        let nearest = match (a.point.z > 0.0) & (b.point.z > 0.0) & (c.point.z > 0.0) {
            true => a.inverse_depth.max(b.inverse_depth).max(c.inverse_depth),
            false => f64::INFINITY,
        };
        let [a, b, c] = edges(corners);
        let volume = corners[0].dot(a);
        let (edges, volume) = match volume < 0.0 {
            // Its other side.
            true => ([-a, -b, -c], -volume),
            false => ([a, b, c], volume),
        };
        let inverse_depth = (edges[0] + edges[1] + edges[2]) * (1.0 / volume);
        inverse_depth.is_finite().then_some(Self {
            edges,
            inverse_depth,
            nearest,
            columns,
            rows,
        })
    }
}

/// The rays' x of some columns from a first one on; the last one's again where there are no more.
#[inline(always)]
fn together(columns: &[f64], first: usize) -> [f64; TOGETHER] {
    let here = columns.get(first..first + TOGETHER);
    let here = here.and_then(|columns| columns.try_into().ok());
    here.unwrap_or_else(|| {
        let last = columns.len() - 1;
        std::array::from_fn(|k| columns[(first + k).min(last)])
    })
}

/// Columns and rows, from … to before, around a triangle that is not all in front.
#[inline(never)]
fn pixels_around(corners: &[DVec3; 3], camera: &Pinhole) -> Option<([u32; 2], [u32; 2])> {
    if corners.iter().all(|p| p.z <= 0.0) {
        return None;
    }
    // 1. The part within the pyramid of the image, which lies in front.
    let [low, high] = camera.bounds();
    let sides = [
        DVec3::new(1.0, 0.0, -low.x),
        DVec3::new(-1.0, 0.0, high.x),
        DVec3::new(0.0, 1.0, -low.y),
        DVec3::new(0.0, -1.0, high.y),
    ];
    let mut part = corners.to_vec();
    for side in sides {
        part = clip(&part, |p| side.dot(p));
    }
    if part.is_empty() {
        return None;
    }
    // 2. At the eye itself it may be anywhere.
    let size = corners
        .iter()
        .map(|p| p.abs().max_element())
        .fold(0.0, f64::max);
    if !part.iter().all(|p| p.z > IN_FRONT * size) {
        return Some(([0, camera.width], [0, camera.height]));
    }
    let projected = |p: &DVec3| p.truncate() / p.z * camera.focal + camera.principal;
    let pixels: Vec<DVec2> = part.iter().map(projected).collect();
    spans(&pixels, camera, 1.0)
}

/// Columns and rows, from … to before, around pixels.
#[inline(always)]
fn spans(pixels: &[DVec2], camera: &Pinhole, room: f64) -> Option<([u32; 2], [u32; 2])> {
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for at in pixels {
        (low, high) = (low.min(*at), high.max(*at));
    }
    let columns = span(low.x - room, high.x + room, camera.width)?;
    let rows = span(low.y - room, high.y + room, camera.height)?;
    Some((columns, rows))
}

/// Pixels, from … to before, whose middles are between two places, if there are any.
#[inline(always)]
fn span(low: f64, high: f64, count: u32) -> Option<[u32; 2]> {
    // A cast takes the whole part of what is positive, and keeps within range.
    let first = (low - 0.5).max(0.0);
    let whole = first as u32;
    let from = whole.saturating_add(u32::from(f64::from(whole) < first));
    let to = ((high + 0.5).max(0.0) as u32).min(count);
    (from < to).then_some([from, to])
}
