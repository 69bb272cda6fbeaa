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

mod draw;
mod kept;
mod rays;

use crate::solid::Sight;
use crate::{Facets, Solid};
use calibrate::{Lens, View};
use draw::draw_all;
use glam::{DMat3, DVec2, DVec3};
pub use kept::Kept;
use pulp::Arch;
use rayon::prelude::*;
pub use rays::Rays;
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
}

#[cfg(test)]
mod tests;
