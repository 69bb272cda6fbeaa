//! A triangle to a band's pixels.
//!
//! A triangle with corners a, b, c relative to the eye is seen along a ray d where d·(b × c),
//! d·(c × a) and d·(a × b) have the sign of a·(b × c); they are also the barycentric weights but
//! for their sum, and that sum over a·(b × c) is the inverse depth where d has z = 1 (Olano and
//! Greer 1997, "Triangle scan conversion using 2D homogeneous coordinates"). So nothing is cut off
//! at a near plane, and weights are right in perspective.

use super::projected::{ANYWHERE, Bounds, Corner, IN_FRONT, between};
use super::squares::Block;
use super::{Beyond, Pinhole, Window};
use glam::{DVec2, DVec3};
use proxy::interior::clip;
use std::ops::Range;

/// Where a triangle is.
#[derive(Clone, Copy)]
pub(super) struct Around {
    /// Pixels, from … to before.
    pub(super) columns: [u32; 2],
    pub(super) rows: [u32; 2],
    /// The greatest inverse depth of its corners; infinite where one is not in front.
    pub(super) nearest: f64,
}

/// A triangle made ready: three edges, and their sum over the volume.
pub(super) struct Ready {
    edges: [DVec3; 3],
    /// From here on the edges are positive, or 0 where what is on an edge itself is inside.
    limits: [f64; 3],
    inverse_depth: DVec3,
    around: Around,
}

/// What some neighbouring columns add to a triangle's edges and inverse depth.
struct Columns {
    first: usize,
    /// Of their rays.
    x: [f64; TOGETHER],
    edges: [[f64; TOGETHER]; 3],
    inverse_depth: [f64; TOGETHER],
}

/// What a row adds to them.
struct Row {
    /// Of its rays.
    y: f64,
    edges: [f64; 3],
    inverse_depth: f64,
}

/// Rows of an image that one task draws, and what their pixels see.
pub(super) struct Band<'k> {
    /// From the first to before the last.
    pub(super) rows: [u32; 2],
    /// Pixels in a row.
    pub(super) width: usize,
    /// By pixel: see [`Raster`](super::Raster).
    pub(super) keys: &'k mut [u64],
}

/// More columns than this are first narrowed down by each edge.
const WIDE: u32 = 8;
/// Edges that change less along the row than this, in shares of their terms, lie along it.
const ALONG_ROW: f64 = 1e-9;
/// Columns that are looked at together.
pub(super) const TOGETHER: usize = 4;
/// The least number above 0.
const ABOVE_0: f64 = f64::from_bits(1);
/// Inverse depths that are kept.
const LEAST: f64 = f32::MIN_POSITIVE as f64;
const MOST: f64 = f32::MAX as f64;

impl Band<'_> {
    /// Whether pixels' middles that are in the band may be within bounds.
    #[inline(always)]
    pub(super) fn may_have(&self, bounds: &Bounds) -> bool {
        let [left, top, right, bottom] = *bounds;
        let rows = self.rows.map(|row| row as i32);
        // What is anywhere has -i32::MIN, which is no number.
        let is_anywhere = left == ANYWHERE;
        let bottom = bottom.wrapping_neg().min(rows[1]);
        is_anywhere | ((left.wrapping_add(right) < 0) & (top.max(rows[0]) < bottom))
    }

    /// Those of a triangle's pixels that are in the band, if there are any.
    #[inline(always)]
    pub(super) fn block(&self, columns: [u32; 2], rows: [u32; 2]) -> Option<Block> {
        let (from, to) = (rows[0].max(self.rows[0]), rows[1].min(self.rows[1]));
        (from < to).then(|| Block {
            columns,
            rows: [from - self.rows[0], to - self.rows[0]],
        })
    }

    /// Draws a triangle where a window lets it, and beyond a plane if there is one; whether it
    /// touches a pixel's centre.
    #[inline(always)]
    pub(super) fn fill(
        &mut self,
        triangle: &Ready,
        idx: u32,
        camera: &Pinhole,
        window: &Window,
        beyond: Option<&Beyond>,
    ) -> bool {
        let around = &triangle.around;
        let [from, to] = around.columns;
        let mut is_seen = false;
        if to - from <= WIDE {
            // What a row has in common with others is found once.
            for first in (from..to).step_by(TOGETHER) {
                let columns = Columns::new(triangle, camera, first as usize);
                for y in self.rows_of(around) {
                    let open = window.row(y);
                    let open = [open.start.max(from), open.end.min(to)];
                    let row = Row::new(triangle, camera.rows[y as usize]);
                    is_seen |= self.fill_some(triangle, idx, &columns, &row, y, open, beyond);
                }
            }
            return is_seen;
        }
        for y in self.rows_of(around) {
            let row = Row::new(triangle, camera.rows[y as usize]);
            let open = window.row(y);
            let open = row.narrowed(triangle, camera, [open.start.max(from), open.end.min(to)]);
            for first in (open[0]..open[1]).step_by(TOGETHER) {
                let columns = Columns::new(triangle, camera, first as usize);
                is_seen |= self.fill_some(triangle, idx, &columns, &row, y, open, beyond);
            }
        }
        is_seen
    }

    #[inline(always)]
    fn rows_of(&self, around: &Around) -> Range<u32> {
        around.rows[0].max(self.rows[0])..around.rows[1].min(self.rows[1])
    }

    /// Some columns of one row, as far as they are open.
    #[inline(always)]
    #[expect(
        clippy::too_many_arguments,
        reason = "compiled in place, where all is at hand"
    )]
    #[expect(
        clippy::manual_range_contains,
        reason = "its branch keeps the loop from being vectors"
    )]
    fn fill_some(
        &mut self,
        triangle: &Ready,
        idx: u32,
        columns: &Columns,
        row: &Row,
        y: u32,
        open: [u32; 2],
        beyond: Option<&Beyond>,
    ) -> bool {
        // 1. What rays see of the triangle where they meet it.
        let limits = triangle.limits;
        let nearest = triangle.around.nearest;
        let [from, to] = open.map(|column| i64::from(column) - columns.first as i64);
        let mut keys = [0; TOGETHER];
        for k in 0..TOGETHER {
            let is_in = (columns.edges[0][k] + row.edges[0] >= limits[0])
                & (columns.edges[1][k] + row.edges[1] >= limits[1])
                & (columns.edges[2][k] + row.edges[2] >= limits[2]);
            // Rounding does not bring what is seen edge on before its corners.
            let inverse_depth = columns.inverse_depth[k] + row.inverse_depth;
            let inverse_depth = if inverse_depth > nearest {
                nearest
            } else {
                inverse_depth
            };
            let is_met = is_in
                & (inverse_depth >= LEAST)
                & (inverse_depth <= MOST)
                & (k as i64 >= from)
                & ((k as i64) < to);
            let key = u64::from((inverse_depth as f32).to_bits()) << 32 | u64::from(!idx);
            keys[k] = if is_met { key } else { 0 };
        }
        if let Some(plane) = beyond {
            for k in 0..TOGETHER {
                let inverse_depth = columns.inverse_depth[k] + row.inverse_depth;
                let ray = DVec3::new(columns.x[k], row.y, 1.0);
                if !plane.has(ray, inverse_depth.min(nearest)) {
                    keys[k] = 0;
                }
            }
        }
        // 2. What is nearer than what was there.
        let mut any = 0;
        for k in 0..TOGETHER {
            any |= keys[k];
        }
        if any != 0 {
            let start = (y - self.rows[0]) as usize * self.width;
            merge(&mut self.keys[start + columns.first..], &keys);
        }
        any != 0
    }
}

/// The greater of each two; there may be fewer places, if those beyond have nothing.
#[inline(always)]
fn merge(places: &mut [u64], keys: &[u64; TOGETHER]) {
    if let Some(places) = places.first_chunk_mut::<TOGETHER>() {
        for k in 0..TOGETHER {
            // As signed numbers, which are compared faster: no key has the highest bit.
            let is_nearer = keys[k] as i64 > places[k] as i64;
            places[k] = if is_nearer { keys[k] } else { places[k] };
        }
        return;
    }
    for (place, key) in places.iter_mut().zip(keys) {
        *place = (*place).max(*key);
    }
}

impl Columns {
    #[inline(always)]
    fn new(triangle: &Ready, camera: &Pinhole, first: usize) -> Self {
        let x = together(&camera.columns, first);
        let mut columns = Self {
            first,
            x,
            edges: [[0.0; TOGETHER]; 3],
            inverse_depth: [0.0; TOGETHER],
        };
        for k in 0..TOGETHER {
            for i in 0..3 {
                columns.edges[i][k] = triangle.edges[i].x * x[k];
            }
            columns.inverse_depth[k] = triangle.inverse_depth.x * x[k];
        }
        columns
    }
}

impl Row {
    #[inline(always)]
    fn new(triangle: &Ready, y: f64) -> Self {
        let at = |edge: DVec3| edge.y * y + edge.z;
        Self {
            y,
            edges: triangle.edges.map(at),
            inverse_depth: at(triangle.inverse_depth),
        }
    }

    /// The columns among some where a ray may meet the triangle.
    #[inline(always)]
    fn narrowed(&self, triangle: &Ready, camera: &Pinhole, open: [u32; 2]) -> [u32; 2] {
        let [mut from, mut to] = open;
        for i in 0..3 {
            let edge = triangle.edges[i];
            // Along the row nothing but rounding would tell where it crosses.
            let size = (edge.y * self.y).abs() + edge.z.abs();
            if edge.x.abs() > ALONG_ROW * size {
                (from, to) = narrowed(edge.x, self.edges[i], camera, from, to);
            }
        }
        [from, to]
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

impl Around {
    /// Of a triangle by what is around its corners; `None` where no pixel's centre can be inside.
    #[inline(always)]
    pub(super) fn new(bounds: Bounds, [a, b, c]: &[Corner; 3], camera: &Pinhole) -> Option<Self> {
        let (columns, rows) = match bounds[0] != ANYWHERE {
            true => {
                let [left, top, right, bottom] = bounds;
                let [left, right] = [left, -right].map(|column| column as u32);
                let [top, bottom] = [top, -bottom].map(|row| row as u32);
                ([left, right], [top, bottom])
            }
            false => pixels_around(&[a.point, b.point, c.point], camera)?,
        };
        let nearest = match (a.point.z > 0.0) & (b.point.z > 0.0) & (c.point.z > 0.0) {
            true => a.inverse_depth.max(b.inverse_depth).max(c.inverse_depth),
            false => f64::INFINITY,
        };
        Some(Self {
            columns,
            rows,
            nearest,
        })
    }
}

impl Ready {
    /// `None` for one that is seen edge on.
    #[inline(always)]
    pub(super) fn new(corners: &[Corner; 3], around: Around) -> Option<Self> {
        let [a, b, c] = edges(corners.map(|corner| corner.point));
        let volume = corners[0].point.dot(a);
        let (edges, volume) = match volume < 0.0 {
            // Its other side.
            true => ([-a, -b, -c], -volume),
            false => ([a, b, c], volume),
        };
        let inverse_depth = (edges[0] + edges[1] + edges[2]) * (1.0 / volume);
        inverse_depth.is_finite().then_some(Self {
            edges,
            // On an edge itself a pixel is inside of one of the two triangles that share it.
            limits: edges.map(|edge| if owns(edge) { 0.0 } else { ABOVE_0 }),
            inverse_depth,
            around,
        })
    }
}

/// The rays' x of some columns from a first one on; the last one's again where there are no more.
#[inline(always)]
pub(super) fn together(columns: &[f64], first: usize) -> [f64; TOGETHER] {
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

/// Columns and rows, from … to before, of pixels whose middles are around some places, or so far beyond.
pub(super) fn spans(pixels: &[DVec2], camera: &Pinhole, room: f64) -> Option<([u32; 2], [u32; 2])> {
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for at in pixels {
        (low, high) = (low.min(*at), high.max(*at));
    }
    let (low, high) = (low - room, high + room);
    let of = |axis: usize, count: u32| {
        let [from, to] = between(low[axis], high[axis], f64::from(count));
        (from < to).then_some([from as u32, to as u32])
    };
    Some((of(0, camera.width)?, of(1, camera.height)?))
}
