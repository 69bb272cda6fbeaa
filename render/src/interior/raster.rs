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

use super::{Pinhole, Window};
use glam::DVec3;
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
/// Corners nearer to the plane of the eye than this, in shares of their distance, are not
/// projected.
const IN_FRONT: f64 = 1e-6;

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
        let list = |list: &&[u32]| self.draw_list(model, list, camera, window, beyond);
        lists.par_iter().with_min_len(GRAIN).map(list).sum()
    }

    /// One list of [`Self::draw`]'s.
    pub(super) fn draw_list(
        &self,
        model: &Model,
        list: &[u32],
        camera: &Pinhole,
        window: &Window,
        beyond: Option<&Beyond>,
    ) -> usize {
        let draw = |i: &u32| {
            let corners = model.mesh.corners(*i as usize).map(|p| camera.point(p));
            let ready = Ready::new(corners, camera);
            usize::from(ready.is_some_and(|t| self.fill(&t, *i, camera, window, beyond)))
        };
        list.iter().map(draw).sum()
    }

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
        let owns = [a, b, c].map(|e| e.x > 0.0 || (e.x == 0.0 && e.y > 0.0));
        for y in triangle.rows[0]..triangle.rows[1] {
            let dy = camera.rows[y as usize];
            let rest = [a, b, c].map(|e| e.y * dy + e.z);
            let depth = triangle.inverse_depth;
            let depth_rest = depth.y * dy + depth.z;
            let open = window.row(y);
            let mut from = open.start.max(triangle.columns[0]);
            let mut to = open.end.min(triangle.columns[1]);
            if to.saturating_sub(from) > WIDE {
                for (edge, rest) in [a, b, c].iter().zip(rest) {
                    // Along the row nothing but rounding would tell where it crosses.
                    let size = (edge.y * dy).abs() + edge.z.abs();
                    if edge.x.abs() > ALONG_ROW * size {
                        (from, to) = narrowed(edge.x, rest, camera, from, to);
                    }
                }
            }
            let mut inside = false;
            for x in from..to {
                let dx = camera.columns[x as usize];
                let is_in = |e: f64, owns: bool| e > 0.0 || (e == 0.0 && owns);
                let hit = is_in(a.x * dx + rest[0], owns[0])
                    && is_in(b.x * dx + rest[1], owns[1])
                    && is_in(c.x * dx + rest[2], owns[2]);
                if !hit {
                    // Convex: once out, always out.
                    if inside {
                        break;
                    }
                    continue;
                }
                inside = true;
                let mut inverse_depth = depth.x * dx + depth_rest;
                // Rounding does not bring what is seen edge on before its corners.
                if inverse_depth > triangle.nearest {
                    inverse_depth = triangle.nearest;
                }
                let stored = inverse_depth as f32;
                if !(stored > 0.0 && stored.is_finite()) {
                    continue;
                }
                let ray = || DVec3::new(dx, dy, 1.0);
                if beyond.is_some_and(|plane| !plane.has(ray(), inverse_depth)) {
                    continue;
                }
                is_seen = true;
                let key = u64::from(stored.to_bits()) << 32 | u64::from(!idx);
                let pixel = &self.keys[y as usize * self.width as usize + x as usize];
                if pixel.load(Relaxed) < key {
                    pixel.fetch_max(key, Relaxed);
                }
            }
        }
        is_seen
    }

    /// Which triangle a pixel sees, and its inverse depth; pixels are counted row by row.
    pub fn at(&self, pixel: usize) -> Option<(u32, f32)> {
        let key = self.keys[pixel].load(Relaxed);
        let bits = (key >> 32) as u32;
        (key != 0).then(|| (!(key as u32), f32::from_bits(bits)))
    }

    /// The inverse depth of what a pixel sees, 0 for nothing.
    pub(super) fn inverse_depth(&self, pixel: usize) -> f32 {
        f32::from_bits((self.keys[pixel].load(Relaxed) >> 32) as u32)
    }
}

/// The columns of from … to where slope·x + rest may be positive, but for rounding, which a
/// column more allows for.
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
pub(super) fn edges([a, b, c]: [DVec3; 3]) -> [DVec3; 3] {
    [b.cross(c), c.cross(a), a.cross(b)]
}

impl Ready {
    /// `None` where no pixel's centre can be inside.
    fn new(corners: [DVec3; 3], camera: &Pinhole) -> Option<Self> {
        let (columns, rows) = pixels_around(&corners, camera)?;
        let depth = corners.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
        let nearest = match depth > 0.0 {
            true => 1.0 / depth,
            false => f64::INFINITY,
        };
        let [a, b, c] = edges(corners);
        let volume = corners[0].dot(a);
        let (edges, volume) = match volume < 0.0 {
            // Its other side.
            true => ([-a, -b, -c], -volume),
            false => ([a, b, c], volume),
        };
        let inverse_depth = (edges[0] + edges[1] + edges[2]) / volume;
        inverse_depth.is_finite().then_some(Self {
            edges,
            inverse_depth,
            nearest,
            columns,
            rows,
        })
    }
}

/// Columns and rows, from … to before, around a triangle.
fn pixels_around(corners: &[DVec3; 3], camera: &Pinhole) -> Option<([u32; 2], [u32; 2])> {
    let is_in_front = |p: &DVec3| p.z > IN_FRONT * p.abs().max_element();
    if corners.iter().all(is_in_front) {
        return spans(corners, camera, ROOM);
    }
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
    spans(&part, camera, 1.0)
}

fn spans(corners: &[DVec3], camera: &Pinhole, room: f64) -> Option<([u32; 2], [u32; 2])> {
    let span = |axis: usize, count: u32| {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for p in corners {
            let at = p[axis] / p.z * camera.focal[axis] + camera.principal[axis];
            (low, high) = (low.min(at), high.max(at));
        }
        // Pixels whose centres are between them. A cast takes the whole part of what is positive,
        // and keeps within range.
        let first = (low - room - 0.5).max(0.0);
        let whole = first as u32;
        let from = whole.saturating_add(u32::from(f64::from(whole) < first));
        let to = (high + room + 0.5).max(0.0) as u32;
        let span = [from, to.min(count)];
        (span[0] < span[1]).then_some(span)
    };
    Some((span(0, camera.width)?, span(1, camera.height)?))
}
