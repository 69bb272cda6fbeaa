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
/// Of which so many are asked at once for their columns.
const TOGETHER: usize = 4;
/// Runs of triangles that are prepared together.
const RUNS: usize = 8;
/// How far beyond its sides a triangle is still met, relative to the terms that are added up to
/// find them: neighbours leave no gap. It is 1e-9 pixels or so.
const SLACK: f64 = 1e-12;

impl Scan {
    /// No triangle.
    pub const NOTHING: u32 = u32::MAX;
}

/// All, part after part as they were made, which are not copied side by side.
type InOrder<T> = Vec<Vec<T>>;

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
        let mut scan = Scan::of(&self.prepared(threads, view, rays), threads, rays);
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
    fn prepared(&self, threads: Threads, view: &View, rays: &Rays) -> InOrder<Prepared> {
        let front_only = self.kind().has_front_sides_only();
        self.in_sight_of(
            threads,
            view,
            rays,
            #[inline(always)]
            |i, corners| {
                Prepared::new(
                    i,
                    corners,
                    rays,
                    #[inline(always)]
                    |sides| {
                        let is_seen = !(front_only && sides.volume >= 0.0);
                        is_seen.then(|| sides.inverse_depth())
                    },
                )
            },
        )
    }

    /// What `prepare` makes of triangles that rays may meet, in order: of each one's number, and its corners where a
    /// pixel's ray is (x, y, 1). Much of a large mesh is out of sight.
    fn in_sight_of<T: Send>(
        &self,
        threads: Threads,
        view: &View,
        rays: &Rays,
        prepare: impl Fn(u32, [DVec3; 3]) -> Option<T> + Sync,
    ) -> InOrder<T> {
        let plane_from_world =
            rays.plane_from_camera() * DMat3::from_quat(view.camera_from_world.rotation);
        let center = view.center();
        let of_runs = |runs: &[Range<usize>]| {
            let mut all = Vec::new();
            Arch::new().dispatch(
                #[inline(always)]
                || {
                    for i in runs.iter().cloned().flatten() {
                        let corners = self.mesh().corners(i);
                        let corners = corners.map(
                            #[inline(always)]
                            |p| plane_from_world * (p - center),
                        );
                        all.extend(prepare(i as u32, corners));
                    }
                },
            );
            all
        };
        let runs = self.in_sight(&rays.sight(center, plane_from_world));
        let runs = runs.par_chunks(RUNS).with_min_len(threads.at_least(1));
        runs.map(of_runs).collect()
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
        Scan::of(&[facets], Threads::All, rays)
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
    #[inline(always)]
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
    fn of(triangles: &[Vec<Prepared>], threads: Threads, rays: &Rays) -> Self {
        let [width, height] = rays.size;
        let mut scan = Self {
            width,
            triangle_of: vec![0; width * height],
            inverse_depth: vec![0.0; width * height],
        };
        let depths = Some(scan.inverse_depth.as_mut_slice());
        draw_all(triangles, threads, rays, &mut scan.triangle_of, depths);
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
    triangles: &[Vec<Prepared>],
    threads: Threads,
    rays: &Rays,
    ids: &mut [u32],
    depths: Option<&mut [f64]>,
) {
    let [width, height] = rays.size;
    let bands = by_bands(triangles.iter().flatten(), |triangle| triangle, height);
    let pixels = (BAND * width).max(1);
    let draw =
        |own: &mut Vec<f64>, band_idx: usize, ids: &mut [u32], depths: Option<&mut [f64]>| {
            let (band, first) = (&bands[band_idx][..], band_idx * BAND);
            ids.fill(Scan::NOTHING);
            let depths = match depths {
                Some(depths) => depths,
                None if rays.bent.is_none() && are_few(band, width) => {
                    return draw_few(band, first, width, ids);
                }
                None => {
                    own.clear();
                    own.resize(ids.len(), 0.0);
                    own.as_mut_slice()
                }
            };
            Arch::new().dispatch(
                #[inline(always)]
                move || match &rays.bent {
                    None => {
                        for triangle in band {
                            triangle.draw(first, width, ids, depths);
                        }
                    }
                    Some(bent) => {
                        for triangle in band {
                            triangle.draw_bent(first, width, bent, ids, depths);
                        }
                    }
                },
            );
        };
    let ids = ids.par_chunks_mut(pixels).enumerate();
    let ids = ids.with_min_len(threads.at_least(1));
    match depths {
        None => ids.for_each_init(Vec::new, |own, (i, ids)| draw(own, i, ids, None)),
        Some(depths) => {
            let both = ids.zip(depths.par_chunks_mut(pixels));
            both.for_each(|((i, ids), depths)| draw(&mut Vec::new(), i, ids, Some(depths)));
        }
    }
}

/// Whether triangles are so few for a band of so wide a picture that pixels may well be in one at most.
fn are_few(band: &[&Prepared], width: usize) -> bool {
    const PIXELS: usize = 8;
    band.len() * PIXELS <= width
}

/// Which of few triangles a pinhole's pixels in a band of rows see first, over nothing: where each pixel of a row is in one at
/// most no depths are compared.
fn draw_few(band: &[&Prepared], first: usize, width: usize, ids: &mut [u32]) {
    // 1. What each row meets, triangle by triangle.
    let mut rows: [Vec<Span<'_>>; BAND] = Default::default();
    for triangle in band {
        triangle.each_row(first, width, ids.len(), |row, columns| {
            if !columns.is_empty() {
                rows[row - first].push((columns, triangle));
            }
        });
    }
    // 2. What is nearest.
    let mut depths = Vec::new();
    for (i, (spans, ids)) in rows.iter().zip(ids.chunks_mut(width)).enumerate() {
        let row = first + i;
        if are_apart(spans, row) {
            for (columns, triangle) in spans {
                ids[columns.clone()].fill(triangle.triangle_idx);
            }
            continue;
        }
        depths.clear();
        depths.resize(width, 0.0);
        Arch::new().dispatch(
            #[inline(always)]
            || {
                for (columns, triangle) in spans {
                    let (ids, depths) = (&mut ids[columns.clone()], &mut depths[columns.clone()]);
                    triangle.draw_columns(row, columns.start, ids, depths);
                }
            },
        );
    }
}

/// Columns of a row, and which triangle's.
type Span<'a> = (Range<usize>, &'a Prepared);

/// Whether each pixel of a pinhole's row is in one span at most, all in front: then nothing need be
/// compared.
fn are_apart(spans: &[Span<'_>], row: usize) -> bool {
    let mut columns: Vec<[usize; 2]> = spans.iter().map(|(c, _)| [c.start, c.end]).collect();
    columns.sort_unstable();
    let is_in_front = |(columns, triangle): &Span<'_>| {
        let mut ends = [columns.start, columns.end - 1].into_iter();
        ends.all(|column| triangle.inverse_depth_at(row, column) > 0.0)
    };
    columns.windows(2).all(|two| two[0][1] <= two[1][0]) && spans.iter().all(is_in_front)
}

/// Which of some, that have triangles, reach which bands, in order.
fn by_bands<'a, T>(
    all: impl Iterator<Item = &'a T>,
    triangle: impl Fn(&T) -> &Prepared,
    height: usize,
) -> Vec<Vec<&'a T>> {
    let mut bands: Vec<Vec<&T>> = vec![Vec::new(); height.div_ceil(BAND)];
    for own in all {
        let rows = &triangle(own).rows;
        let last = (rows.end - 1) / BAND;
        bands[rows.start / BAND..=last]
            .iter_mut()
            .for_each(|band| band.push(own));
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
    #[inline(always)]
    fn new([a, b, c]: [DVec3; 3]) -> Self {
        let of = [b.cross(c), c.cross(a), a.cross(b)];
        Self {
            volume: a.dot(of[0]),
            of,
        }
    }

    /// 1/z: times (x, y, 1).
    #[inline(always)]
    fn inverse_depth(&self) -> DVec3 {
        (self.of[0] + self.of[1] + self.of[2]) / self.volume
    }
}

impl Prepared {
    /// Of corners where a pixel's ray is (x, y, 1); 1/z is what its sides say, times that. `None` for one that no pixel
    /// sees.
    #[inline(always)]
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

    /// The rows of it that lie in a band that begins with one of a picture so wide, and has so many pixels.
    #[inline(always)]
    fn rows_in(&self, first: usize, width: usize, pixels: usize) -> Range<usize> {
        self.rows.start.max(first)..self.rows.end.min(first + pixels / width)
    }

    /// Draws it over what is farther in a band of rows, ray by ray.
    #[inline(always)]
    fn draw_bent(
        &self,
        first: usize,
        width: usize,
        bent: &Bent,
        ids: &mut [u32],
        depths: &mut [f64],
    ) {
        let is_beyond = |bounds: &rays::Bounds| {
            let mut sides = self.sides.iter().zip(self.slack);
            sides.any(|(side, slack)| bounds.most_of(*side) < -slack)
        };
        // What is narrower is as soon asked ray by ray.
        let is_wide = self.columns.len() > BLOCK;
        let [a, b, c] = self.sides;
        let [least_a, least_b, least_c] = self.slack.map(|slack| -slack);
        let blocks = width.div_ceil(BLOCK);
        for row in self.rows_in(first, width, ids.len()) {
            if is_wide && is_beyond(&bent.rows[row]) {
                continue;
            }
            let of_row = (row - first) * width;
            for block in self.columns.start / BLOCK..self.columns.end.div_ceil(BLOCK) {
                if is_wide && is_beyond(&bent.blocks[row * blocks + block]) {
                    continue;
                }
                let start = self.columns.start.max(block * BLOCK);
                let end = self.columns.end.min((block + 1) * BLOCK);
                let at = &bent.at[row * width..][start..end];
                let drawn = ids[of_row..][start..end].iter_mut();
                let drawn = drawn.zip(&mut depths[of_row..][start..end]);
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
    }

    /// Calls `each` with the rows of it in a band, as [`Self::rows_in`] has them, and the columns of a pinhole's pixels there
    /// whose centres are inside of all sides.
    #[inline(always)]
    fn each_row(
        &self,
        first: usize,
        width: usize,
        pixels: usize,
        mut each: impl FnMut(usize, Range<usize>),
    ) {
        let rows = self.rows_in(first, width, pixels);
        for start in rows.clone().step_by(TOGETHER) {
            let columns = self.columns_in(start, width);
            for (row, [least, most]) in (start..rows.end).zip(columns) {
                each(row, least..most);
            }
        }
    }

    /// From which column to before which, of a pinhole's row and of the next, the centres of pixels are inside of all sides.
    #[inline(always)]
    fn columns_in(&self, row: usize, width: usize) -> [[usize; 2]; TOGETHER] {
        let (mut least, mut most) = ([0.0_f64; TOGETHER], [width as f64; TOGETHER]);
        for (side, slack) in self.sides.iter().zip(self.slack) {
            for k in 0..TOGETHER {
                // side.x · x + rest ≥ 0
                let y = (row + k) as f64 + 0.5;
                let rest = side.y * y + side.z + slack;
                let at = -rest / side.x - 0.5;
                if side.x > 0.0 {
                    least[k] = least[k].max(at.ceil());
                } else if side.x < 0.0 {
                    most[k] = most[k].min(at.floor() + 1.0);
                } else if rest < 0.0 {
                    most[k] = 0.0;
                }
            }
        }
        std::array::from_fn(|k| {
            let most = most[k].max(0.0);
            [least[k].min(most), most].map(|column| column as usize)
        })
    }

    /// Calls `put(column, 1/z)` for all pixels of a row that look at it or, where the viewer is
    /// between its corners, away from it.
    fn each_pixel(&self, row: usize, rays: &Rays, mut put: impl FnMut(usize, f64)) {
        let [width, _] = rays.size;
        match &rays.bent {
            None => {
                let at = DVec3::new(0.0, row as f64 + 0.5, 1.0);
                let rest = self.inverse_depth.dot(at);
                let [[least, most], ..] = self.columns_in(row, width);
                for column in least..most {
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

    /// Draws it over what is farther in a band of a pinhole's rows.
    #[inline(always)]
    fn draw(&self, first: usize, width: usize, ids: &mut [u32], depths: &mut [f64]) {
        self.each_row(
            first,
            width,
            ids.len(),
            #[inline(always)]
            |row, columns| {
                let of_row = (row - first) * width;
                let ids = &mut ids[of_row..][columns.clone()];
                let depths = &mut depths[of_row..][columns.clone()];
                self.draw_columns(row, columns.start, ids, depths);
            },
        );
    }

    /// Draws it over what is farther in pixels of a pinhole's row, from a column on.
    #[inline(always)]
    fn draw_columns(&self, row: usize, first: usize, ids: &mut [u32], depths: &mut [f64]) {
        let rest = self.inverse_depth.y * (row as f64 + 0.5) + self.inverse_depth.z;
        let slope = self.inverse_depth.x;
        for (column, (id, depth)) in (first as i32..).zip(ids.iter_mut().zip(depths)) {
            let here = slope * (f64::from(column) + 0.5) + rest;
            let is_nearer = here > *depth;
            *depth = if is_nearer { here } else { *depth };
            *id = if is_nearer { self.triangle_idx } else { *id };
        }
    }
}

#[cfg(test)]
mod tests;
