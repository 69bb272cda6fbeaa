//! What a camera sees of triangles, all pixels at once: much faster than a ray for each.
//!
//! Corners are taken to where a pixel's ray is (x, y, 1). There the side from corner A to B is the
//! plane A × B through the eye, and a triangle's inverse depth is linear, too:
//! (A × B + B × C + C × A) / A·(B × C). So nothing is divided by a depth, and no triangle need be
//! cut at the eye (Olano and Greer 1997, "Triangle scan conversion using 2D homogeneous
//! coordinates").
//!
//! Of a pinhole's rows a triangle has all pixels from one column to another. Where a lens bends,
//! its sides are asked at each pixel's ray, but for blocks of pixels whose rays are all beyond one of them.

mod kept;
mod rays;

use crate::solid::Sight;
use crate::{Facets, Solid};
use calibrate::{Lens, View};
use glam::{DMat3, DVec2, DVec3};
pub use kept::Kept;
use pulp::Arch;
use rayon::prelude::*;
pub use rays::Rays;
use rays::{BLOCK, Bent};
use std::ops::Range;

/// Which triangle each pixel of a picture sees first.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Pixels across.
    pub width: usize,
    /// Row by row, the triangle at each pixel's centre; [`Scan::NOTHING`] where there is none. Those
    /// of what bounds a solid come after its own, as [`Solid::corners`] counts.
    pub triangle_of: Vec<u32>,
    /// Row by row, 1/z of that point in the camera's frame; zero where there is none.
    pub inverse_depth: Vec<f64>,
}

/// Rows that are scanned together.
const BAND: usize = 16;
/// How far beyond its sides a triangle is still met, relative to the terms that are added up to
/// find them: neighbours leave no gap. It is 1e-9 pixels or so.
const SLACK: f64 = 1e-12;

impl Scan {
    /// No triangle.
    pub const NOTHING: u32 = u32::MAX;
}

/// A triangle, ready to be scanned.
struct Prepared {
    triangle_idx: u32,
    /// Inside where all are at least minus their slack: times (x, y, 1).
    sides: [DVec3; 3],
    slack: [f64; 3],
    /// 1/z: times (x, y, 1).
    inverse_depth: DVec3,
    columns: Range<usize>,
    rows: Range<usize>,
}

impl Solid {
    /// What a view sees in a picture reduced so many times: the pixel in column i and row j looks
    /// along the ray of the view's pixel ((i + ½)·reduction, (j + ½)·reduction). The same
    /// triangles as [`Solid::first_hit`]'s, but for ties of rounding: of triangles at one depth
    /// the first. `None` where some pixel looks aside or back.
    pub fn scan(&self, view: &View, reduction: u32) -> Option<Scan> {
        Some(self.scan_along(view, &Rays::reduced(view, reduction)?))
    }

    /// [`Self::scan`] along rays of the view's camera.
    pub fn scan_along(&self, view: &View, rays: &Rays) -> Scan {
        self.scan_by(Threads::All, view, rays)
    }

    /// The same on this thread alone: for what others wait for. (A thread whose work others share takes up work of
    /// theirs meanwhile, which may be to wait for it.)
    pub fn scan_alone(&self, view: &View, rays: &Rays) -> Scan {
        self.scan_by(Threads::This, view, rays)
    }

    fn scan_by(&self, threads: Threads, view: &View, rays: &Rays) -> Scan {
        let mut scan = Scan::of(self.prepared(threads, view, rays), threads, rays);
        if let Some(hull) = self.within() {
            let kept = hull.keep_by(threads, view, rays, &scan.inverse_depth);
            scan.keep(&kept, self.mesh().triangles.len() as u32);
        }
        scan
    }

    /// The triangles of [`Self::scan_along`] alone, in place of whatever numbers there are for the pixels.
    ///
    /// # Panics
    /// There are not as many as pixels.
    pub fn triangles_along(&self, view: &View, rays: &Rays, triangle_of: &mut [u32]) {
        let [width, height] = rays.size;
        assert_eq!(triangle_of.len(), width * height, "a number for each pixel");
        if self.within().is_some() {
            triangle_of.copy_from_slice(&self.scan_along(view, rays).triangle_of);
        } else {
            let triangles = self.prepared(Threads::All, view, rays);
            draw_all(&triangles, Threads::All, rays, triangle_of, None);
        }
    }

    /// The triangles that rays may meet, in order.
    fn prepared(&self, threads: Threads, view: &View, rays: &Rays) -> Vec<Prepared> {
        let front_only = self.kind().has_front_sides_only();
        self.in_sight_of(threads, view, rays, |i, corners| {
            Prepared::new(i, corners, rays, |sides| {
                let is_seen = !(front_only && sides.volume >= 0.0);
                is_seen.then(|| sides.inverse_depth())
            })
        })
    }

    /// What `prepare` makes of triangles that rays may meet, in order: of each one's number, and its corners where a
    /// pixel's ray is (x, y, 1). Much of a large mesh is out of sight.
    fn in_sight_of<T: Send>(
        &self,
        threads: Threads,
        view: &View,
        rays: &Rays,
        prepare: impl Fn(u32, [DVec3; 3]) -> Option<T> + Sync,
    ) -> Vec<T> {
        let plane_from_world =
            rays.plane_from_camera() * DMat3::from_quat(view.camera_from_world.rotation);
        let center = view.center();
        let of_triangle = |i: usize| {
            let corners = self.mesh().corners(i);
            prepare(i as u32, corners.map(|p| plane_from_world * (p - center)))
        };
        let runs = self.in_sight(&rays.sight(center, plane_from_world));
        let runs = runs.into_par_iter().with_min_len(threads.at_least(4));
        runs.flat_map_iter(|run| run.filter_map(of_triangle))
            .collect()
    }
}

/// Who works.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Threads {
    All,
    /// Nothing is left for others to take up.
    This,
}

impl Threads {
    /// How much is done by one that could do with so much.
    fn at_least(self, count: usize) -> usize {
        match self {
            Self::All => count,
            Self::This => usize::MAX,
        }
    }
}

impl Facets {
    /// Which facet the viewer sees along rays, and how far. The same as [`Facets::locate`]'s but for
    /// ties of rounding, and for directions that rounding leaves without any.
    pub fn scan(&self, rays: &Rays) -> Scan {
        let plane_from_camera = rays.plane_from_camera();
        // q·ray, the ray being where it is (x, y, 1).
        let of_planes = plane_from_camera.inverse().transpose();
        let prepare = |i: usize| {
            let corners = self.triangles[i].map(|c| self.directions[c as usize]);
            let corners = corners.map(|corner| plane_from_camera * corner);
            Prepared::new(i as u32, corners, rays, |_| {
                Some(of_planes * self.planes[i])
            })
        };
        let facets = (0..self.triangles.len()).into_par_iter();
        let facets = facets.with_min_len(256).filter_map(prepare).collect();
        Scan::of(facets, Threads::All, rays)
    }
}

impl Rays {
    /// What they may meet, of a camera there.
    fn sight(&self, center: DVec3, plane_from_world: DMat3) -> Sight {
        let [least, most] = match &self.bent {
            None => [DVec2::ZERO, DVec2::from(self.size.map(|side| side as f64))],
            Some(bent) => [bent.all.least, bent.all.most],
        };
        let world_from_plane = plane_from_world.transpose();
        let normals = [
            DVec3::new(1.0, 0.0, -least.x),
            DVec3::new(-1.0, 0.0, most.x),
            DVec3::new(0.0, 1.0, -least.y),
            DVec3::new(0.0, -1.0, most.y),
            DVec3::Z,
        ];
        Sight {
            center,
            normals: normals.map(|normal| world_from_plane * normal),
        }
    }

    /// Columns and rows whose pixels may see a triangle of corners that are all ahead.
    fn around(&self, corners: [DVec3; 3]) -> [Range<usize>; 2] {
        let [a, b, c] = corners.map(|p| p.truncate() / p.z);
        let (least, most) = (a.min(b).min(c), a.max(b).max(c));
        let room = SLACK * (least.abs() + most.abs());
        match &self.bent {
            None => [0, 1].map(|axis| {
                // Of pixels whose centres may be between the two.
                let room = room[axis] + 1e-6;
                let side = self.size[axis] as f64;
                let within = |at: f64| at.clamp(0.0, side) as usize;
                within((least[axis] - 0.5 - room).ceil())
                    ..within((most[axis] - 0.5 + room).floor() + 1.0)
            }),
            Some(bent) => bent.within(least - room - 1e-9, most + room + 1e-9),
        }
    }

    /// To where a ray is (x, y, 1): a pinhole's pixels, or the plane z = 1.
    fn plane_from_camera(&self) -> DMat3 {
        let Lens {
            focal, principal, ..
        } = self.lens;
        match self.bent {
            Some(_) => DMat3::IDENTITY,
            None => DMat3::from_cols(
                DVec3::new(focal.x, 0.0, 0.0),
                DVec3::new(0.0, focal.y, 0.0),
                principal.extend(1.0),
            ),
        }
    }
}

impl Scan {
    /// Of triangles in order.
    fn of(triangles: Vec<Prepared>, threads: Threads, rays: &Rays) -> Self {
        let [width, height] = rays.size;
        let mut scan = Self {
            width,
            triangle_of: vec![0; width * height],
            inverse_depth: vec![0.0; width * height],
        };
        let depths = Some(scan.inverse_depth.as_mut_slice());
        draw_all(&triangles, threads, rays, &mut scan.triangle_of, depths);
        scan
    }

    /// Moves what pixels see to where it is kept, triangles of what keeps it counted from `first`.
    fn keep(&mut self, kept: &[Kept], first: u32) {
        let pixels = self.triangle_of.iter_mut().zip(&mut self.inverse_depth);
        for ((id, depth), kept) in pixels.zip(kept) {
            (*id, *depth) = match *kept {
                Kept::AsItIs => continue,
                Kept::Nowhere => (Self::NOTHING, 0.0),
                Kept::On {
                    triangle_idx,
                    inverse,
                } => (first + triangle_idx, inverse),
            };
        }
    }
}

/// Which triangle each pixel sees first, over whatever is there; and the inverse depths, over zeros.
fn draw_all(
    triangles: &[Prepared],
    threads: Threads,
    rays: &Rays,
    ids: &mut [u32],
    depths: Option<&mut [f64]>,
) {
    let [width, height] = rays.size;
    let bands = by_bands(triangles.iter().map(|triangle| &triangle.rows), height);
    let pixels = (BAND * width).max(1);
    let draw = |(band_idx, ids): (usize, &mut [u32]), mut depths: Option<&mut [f64]>| {
        // 1. What each row meets, triangle by triangle.
        let first = band_idx * BAND;
        let mut rows: [Vec<Span>; BAND] = Default::default();
        for &i in &bands[band_idx] {
            let triangle = &triangles[i as usize];
            let end = triangle.rows.end.min(first + ids.len() / width);
            for row in triangle.rows.start.max(first)..end {
                let columns = match &rays.bent {
                    None => triangle.columns_in(row, width),
                    Some(_) => triangle.columns.clone(),
                };
                if !columns.is_empty() {
                    rows[row - first].push((columns.start as u32, columns.end as u32, i));
                }
            }
        }
        // 2. What is nearest.
        let mut own = match &depths {
            None => vec![0.0; width],
            Some(_) => Vec::new(),
        };
        for (i, (spans, ids)) in rows.iter_mut().zip(ids.chunks_mut(width)).enumerate() {
            let row = first + i;
            ids.fill(Scan::NOTHING);
            let depths = match &mut depths {
                Some(depths) => &mut depths[i * width..(i + 1) * width],
                None if rays.bent.is_none() && are_apart(spans, triangles, row, width) => {
                    for (start, end, i) in spans {
                        ids[*start as usize..*end as usize]
                            .fill(triangles[*i as usize].triangle_idx);
                    }
                    continue;
                }
                None => {
                    own.fill(0.0);
                    own.as_mut_slice()
                }
            };
            if let Some(bent) = &rays.bent {
                for (_, _, i) in spans {
                    triangles[*i as usize].draw_bent(row, bent, ids, depths);
                }
                continue;
            }
            Arch::new().dispatch(
                #[inline(always)]
                move || {
                    for (start, end, i) in spans {
                        let columns = *start as usize..*end as usize;
                        triangles[*i as usize].draw(row, columns, ids, depths);
                    }
                },
            );
        }
    };
    let ids = ids.par_chunks_mut(pixels).enumerate();
    let ids = ids.with_min_len(threads.at_least(1));
    match depths {
        None => ids.for_each(|ids| draw(ids, None)),
        Some(depths) => {
            let both = ids.zip(depths.par_chunks_mut(pixels));
            both.for_each(|(ids, depths)| draw(ids, Some(depths)));
        }
    }
}

/// Columns of a row from … to before, and which triangle's.
type Span = (u32, u32, u32);

/// Whether each pixel of a pinhole's row is in one span at most, all in front: then nothing need be
/// compared. Not asked where spans are many, for they are short.
fn are_apart(spans: &[Span], triangles: &[Prepared], row: usize, width: usize) -> bool {
    const PIXELS: usize = 16;
    if spans.len() * PIXELS > width {
        return false;
    }
    let mut columns: Vec<[u32; 2]> = spans.iter().map(|(start, end, _)| [*start, *end]).collect();
    columns.sort_unstable();
    let is_in_front = |(start, end, i): &Span| {
        let mut ends = [*start, *end - 1].into_iter();
        ends.all(|column| triangles[*i as usize].inverse_depth_at(row, column as usize) > 0.0)
    };
    columns.windows(2).all(|two| two[0][1] <= two[1][0]) && spans.iter().all(is_in_front)
}

/// Which triangles, given by the rows they reach, reach which bands: their indices, in order.
fn by_bands<'a>(rows: impl Iterator<Item = &'a Range<usize>>, height: usize) -> Vec<Vec<u32>> {
    let mut bands: Vec<Vec<u32>> = vec![Vec::new(); height.div_ceil(BAND)];
    for (i, rows) in rows.enumerate() {
        let last = (rows.end - 1) / BAND;
        bands[rows.start / BAND..=last]
            .iter_mut()
            .for_each(|band| band.push(i as u32));
    }
    bands
}

/// A triangle's sides, where a pixel's ray is (x, y, 1).
struct Sides {
    /// Each opposite a corner, positive on that corner's side if the volume is.
    of: [DVec3; 3],
    /// Of the corners' directions.
    volume: f64,
}

impl Sides {
    fn new([a, b, c]: [DVec3; 3]) -> Self {
        let of = [b.cross(c), c.cross(a), a.cross(b)];
        Self {
            volume: a.dot(of[0]),
            of,
        }
    }

    /// 1/z: times (x, y, 1).
    fn inverse_depth(&self) -> DVec3 {
        (self.of[0] + self.of[1] + self.of[2]) / self.volume
    }
}

impl Prepared {
    /// Of corners where a pixel's ray is (x, y, 1); 1/z is what its sides say, times that. `None` for one that no pixel
    /// sees.
    fn new(
        triangle_idx: u32,
        corners: [DVec3; 3],
        rays: &Rays,
        inverse_depth: impl FnOnce(&Sides) -> Option<DVec3>,
    ) -> Option<Self> {
        // 1. Most triangles of a fine mesh have no pixel's centre, which needs no sides.
        let ahead = corners.map(|p| p.z > 0.0);
        if ahead == [false; 3] {
            return None;
        }
        let [columns, rows] = match ahead {
            [true, true, true] => rays.around(corners),
            _ => rays.size.map(|side| 0..side),
        };
        if rows.is_empty() || columns.is_empty() {
            return None;
        }
        // 2. Edge on, or not a number: it is seen nowhere.
        let sides = Sides::new(corners);
        let inverse_depth = inverse_depth(&sides)?;
        if sides.volume == 0.0 || !inverse_depth.is_finite() {
            return None;
        }
        let of = sides.of.map(|side| side * sides.volume.signum());
        let [width, height] = rays.size;
        let reach = match &rays.bent {
            None => DVec3::new(width as f64, height as f64, 1.0),
            Some(bent) => bent.all.least.abs().max(bent.all.most.abs()).extend(1.0),
        };
        let slack = of.map(|side| SLACK * side.abs().dot(reach));
        if let Some(bent) = &rays.bent
            && ahead != [true; 3]
            && (0..3).any(|k| bent.all.most_of(of[k]) < -slack[k])
        {
            return None;
        }
        Some(Self {
            triangle_idx,
            slack,
            sides: of,
            inverse_depth,
            columns,
            rows,
        })
    }

    /// Draws it over what is farther in a row, ray by ray.
    fn draw_bent(&self, row: usize, bent: &Bent, ids: &mut [u32], depths: &mut [f64]) {
        let width = ids.len();
        let is_beyond = |bounds: &rays::Bounds| {
            let mut sides = self.sides.iter().zip(self.slack);
            sides.any(|(side, slack)| bounds.most_of(*side) < -slack)
        };
        if is_beyond(&bent.rows[row]) {
            return;
        }
        let [a, b, c] = self.sides;
        let [least_a, least_b, least_c] = self.slack.map(|slack| -slack);
        let blocks = width.div_ceil(BLOCK);
        for block in self.columns.start / BLOCK..self.columns.end.div_ceil(BLOCK) {
            if is_beyond(&bent.blocks[row * blocks + block]) {
                continue;
            }
            let pixels = block * BLOCK..((block + 1) * BLOCK).min(width);
            let at = &bent.at[row * width..][pixels.clone()];
            let drawn = ids[pixels.clone()].iter_mut().zip(&mut depths[pixels]);
            for ((id, depth), at) in drawn.zip(at) {
                let of = |side: DVec3| side.x * at.x + side.y * at.y + side.z;
                let here = of(self.inverse_depth);
                let is_inside = (of(a) >= least_a) & (of(b) >= least_b) & (of(c) >= least_c);
                let is_nearer = is_inside & (here > *depth);
                *depth = if is_nearer { here } else { *depth };
                *id = if is_nearer { self.triangle_idx } else { *id };
            }
        }
    }

    /// The columns of a pinhole's row whose centres are inside of all sides.
    fn columns_in(&self, row: usize, width: usize) -> Range<usize> {
        let y = row as f64 + 0.5;
        let (mut least, mut most) = (0.0_f64, width as f64);
        for (side, slack) in self.sides.iter().zip(self.slack) {
            // side.x · x + rest ≥ 0
            let rest = side.y * y + side.z + slack;
            let at = -rest / side.x - 0.5;
            if side.x > 0.0 {
                least = least.max(at.ceil());
            } else if side.x < 0.0 {
                most = most.min(at.floor() + 1.0);
            } else if rest < 0.0 {
                return 0..0;
            }
        }
        let end = most.max(0.0) as usize;
        (least as usize).min(end)..end
    }

    /// Calls `put(column, 1/z)` for all pixels of a row that look at it or, where the viewer is
    /// between its corners, away from it.
    fn each_pixel(&self, row: usize, rays: &Rays, mut put: impl FnMut(usize, f64)) {
        let [width, _] = rays.size;
        match &rays.bent {
            None => {
                let at = DVec3::new(0.0, row as f64 + 0.5, 1.0);
                let rest = self.inverse_depth.dot(at);
                for column in self.columns_in(row, width) {
                    put(column, self.inverse_depth.x * (column as f64 + 0.5) + rest);
                }
            }
            Some(bent) => {
                for column in self.columns.clone() {
                    let at = bent.at[row * width + column].extend(1.0);
                    let mut sides = self.sides.iter().zip(self.slack);
                    if sides.all(|(side, slack)| side.dot(at) >= -slack) {
                        put(column, self.inverse_depth.dot(at));
                    }
                }
            }
        }
    }

    /// 1/z at the centre of a pinhole's pixel.
    fn inverse_depth_at(&self, row: usize, column: usize) -> f64 {
        let rest = self.inverse_depth.y * (row as f64 + 0.5) + self.inverse_depth.z;
        self.inverse_depth.x * (column as f64 + 0.5) + rest
    }

    /// Draws columns of a pinhole's row over what is farther.
    #[inline(always)]
    fn draw(&self, row: usize, columns: Range<usize>, ids: &mut [u32], depths: &mut [f64]) {
        let rest = self.inverse_depth.y * (row as f64 + 0.5) + self.inverse_depth.z;
        let slope = self.inverse_depth.x;
        let start = columns.start;
        let pixels = ids[columns.clone()].iter_mut().zip(&mut depths[columns]);
        for (i, (id, depth)) in pixels.enumerate() {
            let here = slope * ((start + i) as f64 + 0.5) + rest;
            let is_nearer = here > *depth;
            *depth = if is_nearer { here } else { *depth };
            *id = if is_nearer { self.triangle_idx } else { *id };
        }
    }
}

#[cfg(test)]
mod tests;
