//! What a pinhole camera sees of a mesh, all pixels at once: much faster than a ray for each.
//!
//! Corners are taken to where a pixel's ray is (x, y, 1). There the side from corner A to B is the
//! plane A × B through the eye, and a triangle's inverse depth is linear, too:
//! (A × B + B × C + C × A) / A·(B × C). So nothing is divided by a depth, and no triangle need be
//! cut at the eye (Olano and Greer 1997, "Triangle scan conversion using 2D homogeneous
//! coordinates").

use super::Solid;
use calibrate::{Distortion, View};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::ops::Range;

/// Which triangle each pixel of a picture sees first.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Pixels across.
    pub width: usize,
    /// Row by row, the triangle at each pixel's centre; [`Scan::NOTHING`] where there is none.
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
    rows: Range<usize>,
}

impl Solid {
    /// What a view sees in a picture reduced so many times: the pixel in column i and row j looks
    /// along the ray of the view's pixel ((i + ½)·reduction, (j + ½)·reduction). The same
    /// triangles as [`Solid::first_hit`]'s, but for ties of rounding: of triangles at one depth
    /// the first. `None` where the lens is no pinhole.
    pub fn scan(&self, view: &View, reduction: u32) -> Option<Scan> {
        if view.lens.distortion() != Distortion::None {
            return None;
        }
        let step = f64::from(reduction);
        let [width, height] = [view.width, view.height].map(|side| side.div_ceil(reduction));
        let [width, height] = [width as usize, height as usize];
        let (focal, principal) = (view.lens.focal / step, view.lens.principal / step);
        let pixel_from_camera = DMat3::from_cols(
            DVec3::new(focal.x, 0.0, 0.0),
            DVec3::new(0.0, focal.y, 0.0),
            principal.extend(1.0),
        );
        let pixel_from_world =
            pixel_from_camera * DMat3::from_quat(view.camera_from_world.rotation);
        let center = view.center();
        let front_only = self.kind.has_front_sides_only();
        let prepare = |i: usize| {
            let corners = self
                .mesh
                .corners(i)
                .map(|p| pixel_from_world * (p - center));
            let mut prepared = Prepared::new(corners, front_only, [width, height])?;
            prepared.triangle_idx = i as u32;
            Some(prepared)
        };
        let triangles = (0..self.mesh.triangles.len()).into_par_iter();
        let triangles: Vec<Prepared> = triangles.with_min_len(256).filter_map(prepare).collect();
        // Which triangles reach which bands, in order.
        let mut bands: Vec<Vec<u32>> = vec![Vec::new(); height.div_ceil(BAND)];
        for (i, triangle) in triangles.iter().enumerate() {
            let last = (triangle.rows.end - 1) / BAND;
            bands[triangle.rows.start / BAND..=last]
                .iter_mut()
                .for_each(|band| band.push(i as u32));
        }
        let mut scan = Scan {
            width,
            triangle_of: vec![Scan::NOTHING; width * height],
            inverse_depth: vec![0.0; width * height],
        };
        let pixels = (BAND * width).max(1);
        let ids = scan.triangle_of.par_chunks_mut(pixels);
        let depths = scan.inverse_depth.par_chunks_mut(pixels);
        let work = ids.zip(depths).zip(&bands).enumerate();
        work.for_each(|(band_idx, ((ids, depths), band))| {
            let first = band_idx * BAND;
            for &i in band {
                let triangle = &triangles[i as usize];
                let end = triangle.rows.end.min(first + ids.len() / width);
                for row in triangle.rows.start.max(first)..end {
                    let at = (row - first) * width;
                    let pixels = at..at + width;
                    triangle.draw(row, &mut ids[pixels.clone()], &mut depths[pixels]);
                }
            }
        });
        Some(scan)
    }
}

impl Prepared {
    /// `None` for one that no pixel sees. Corners are where a pixel's ray is (x, y, 1).
    fn new([a, b, c]: [DVec3; 3], front_only: bool, [width, height]: [usize; 2]) -> Option<Self> {
        let sides = [b.cross(c), c.cross(a), a.cross(b)];
        let volume = a.dot(sides[0]);
        if front_only && volume >= 0.0 {
            return None;
        }
        let inverse_depth = (sides[0] + sides[1] + sides[2]) / volume;
        // Edge on, or not a number: it is seen nowhere.
        if !inverse_depth.is_finite() || [a, b, c].iter().all(|p| p.z <= 0.0) {
            return None;
        }
        let rows = if [a, b, c].iter().all(|p| p.z > 0.0) {
            let inside = |k: usize, side: usize| {
                let at = [a, b, c].map(|p| p[k] / p.z);
                let least = at[0].min(at[1]).min(at[2]);
                let most = at[0].max(at[1]).max(at[2]);
                // Of pixels whose centres may be between the two.
                let room = SLACK * (least.abs() + most.abs()) + 1e-6;
                let within = |at: f64| at.clamp(0.0, side as f64) as usize;
                within((least - 0.5 - room).ceil())..within((most - 0.5 + room).floor() + 1.0)
            };
            if inside(0, width).is_empty() {
                return None;
            }
            inside(1, height)
        } else {
            0..height
        };
        let sides = sides.map(|side| side * volume.signum());
        let reach = DVec3::new(width as f64, height as f64, 1.0);
        (!rows.is_empty()).then_some(Self {
            triangle_idx: 0,
            slack: sides.map(|side| SLACK * side.abs().dot(reach)),
            sides,
            inverse_depth,
            rows,
        })
    }

    /// Draws it over what is farther in a row.
    fn draw(&self, row: usize, ids: &mut [u32], depths: &mut [f64]) {
        let y = row as f64 + 0.5;
        // The columns whose centres are inside of all sides.
        let (mut least, mut most) = (0.0_f64, ids.len() as f64);
        for (side, slack) in self.sides.iter().zip(self.slack) {
            // side.x · x + rest ≥ 0
            let rest = side.y * y + side.z + slack;
            let at = -rest / side.x - 0.5;
            if side.x > 0.0 {
                least = least.max(at.ceil());
            } else if side.x < 0.0 {
                most = most.min(at.floor() + 1.0);
            } else if rest < 0.0 {
                return;
            }
        }
        let (start, end) = (least as usize, most.max(0.0) as usize);
        if start >= end {
            return;
        }
        let rest = self.inverse_depth.y * y + self.inverse_depth.z;
        let slope = self.inverse_depth.x;
        let pixels = ids[start..end].iter_mut().zip(&mut depths[start..end]);
        for (i, (id, depth)) in pixels.enumerate() {
            let here = slope * ((start + i) as f64 + 0.5) + rest;
            let is_nearer = here > *depth;
            *depth = if is_nearer { here } else { *depth };
            *id = if is_nearer { self.triangle_idx } else { *id };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Mesh, MeshKind};
    use calibrate::{Lens, Pixel, Rigid3};
    use glam::{DQuat, DVec2};
    use proptest::prelude::*;

    /// Triangles of any size around the origin, some of them neighbours.
    fn mesh(corners: &[[f64; 3]]) -> Mesh {
        let mut mesh = Mesh {
            positions: corners.iter().map(|&p| DVec3::from_array(p)).collect(),
            triangles: Vec::new(),
        };
        let count = corners.len() as u32;
        for i in 0..count.saturating_sub(2) {
            mesh.triangles.push([i, i + 1, i + 2]);
            mesh.triangles.push([i, (i * 7 + 3) % count, i + 2]);
        }
        mesh
    }

    /// Compares a scan with a ray for each pixel. How many pixels see something.
    fn compare(solid: &Solid, view: &View, reduction: u32) -> usize {
        let scan = solid.scan(view, reduction).unwrap();
        let world_from_camera = view.camera_from_world.rotation.conjugate();
        let mut seen = 0;
        for (i, (&id, &s)) in scan.triangle_of.iter().zip(&scan.inverse_depth).enumerate() {
            let at = |i: usize| (i as f64 + 0.5) * f64::from(reduction);
            let pixel = Pixel::new(at(i % scan.width), at(i / scan.width));
            let ray = view.lens.unproject(pixel).unwrap();
            let hit = solid.first_hit(view.center(), world_from_camera * (ray / ray.z));
            let place = (i % scan.width, i / scan.width);
            match hit {
                None => assert_eq!(id, Scan::NOTHING, "{place:?}"),
                Some(hit) => {
                    assert_ne!(id, Scan::NOTHING, "{place:?}");
                    let off = (s * hit.along - 1.0).abs();
                    assert!(off < 1e-6, "{place:?}: {off:e}");
                    assert!(id == hit.triangle_idx || off < 1e-9, "{place:?}");
                    seen += 1;
                }
            }
        }
        assert!(scan.inverse_depth.iter().all(|s| s.is_finite()));
        seen
    }

    fn view(center: DVec3, turn: DQuat, (width, height): (u32, u32), focal: f64) -> View {
        View {
            lens: Lens::pinhole(
                DVec2::new(focal, 1.1 * focal),
                DVec2::new(0.45 * f64::from(width), 0.6 * f64::from(height)),
            ),
            width,
            height,
            camera_from_world: Rigid3 {
                rotation: turn,
                translation: -(turn * center),
            },
        }
    }

    proptest! {
        #[test]
        fn a_scan_is_a_ray_for_every_pixel(
            corners in proptest::collection::vec(prop::array::uniform3(-2.0..2.0), 3..20),
            center in prop::array::uniform3(-2.5..2.5),
            turn in prop::array::uniform3(-3.0..3.0),
            focal in 5.0..80.0,
            reduction in 1_u32..4,
            shift in prop_oneof![Just(0.0), Just(1e5)],
            carved: bool,
        ) {
            let shift = DVec3::new(shift, -shift, shift);
            let mut mesh = mesh(&corners);
            mesh.positions.iter_mut().for_each(|p| *p += shift);
            let kind = if carved { MeshKind::Carved } else { MeshKind::Mesh };
            let solid = Solid::new(kind, mesh);
            let turn = DQuat::from_scaled_axis(DVec3::from_array(turn));
            let view = view(DVec3::from_array(center) + shift, turn, (37, 35), focal);
            compare(&solid, &view, reduction);
        }
    }

    /// Pixels' centres on sides and corners, triangles that share them, and a view inside.
    #[test]
    fn neighbours_leave_no_gap() {
        let at = |i: u32| f64::from(i) - 4.0;
        let grid = |z: f64| -> Vec<DVec3> {
            (0..81)
                .map(|i| DVec3::new(at(i % 9), at(i / 9), z))
                .collect()
        };
        let cell = |i: u32| {
            let a = i / 8 * 9 + i % 8;
            [[a, a + 1, a + 10], [a, a + 10, a + 9]]
        };
        let mesh = Mesh {
            positions: grid(4.0),
            triangles: (0..64).flat_map(cell).collect(),
        };
        let solid = Solid::new(MeshKind::Mesh, mesh);
        // A cell is 16 pixels, its corners are pixels' centres.
        let mut view = view(DVec3::ZERO, DQuat::IDENTITY, (96, 96), 64.0);
        view.lens = Lens::pinhole(DVec2::splat(64.0), DVec2::splat(48.5));
        assert_eq!(compare(&solid, &view, 1), 96 * 96);
        assert_eq!(compare(&solid, &view, 2), 48 * 48);
    }

    #[test]
    fn nothing_is_seen_of_nothing() {
        let empty = Solid::new(MeshKind::Mesh, Mesh::default());
        let view = view(DVec3::ZERO, DQuat::IDENTITY, (20, 10), 10.0);
        let scan = empty.scan(&view, 1).unwrap();
        assert!(scan.triangle_of.iter().all(|&id| id == Scan::NOTHING));
        let positions = vec![DVec3::new(f64::NAN, 0.0, 1.0), DVec3::X, DVec3::Z];
        let triangles = vec![[0, 1, 2], [1, 1, 2]];
        let odd = Solid::new(
            MeshKind::Mesh,
            Mesh {
                positions,
                triangles,
            },
        );
        assert_eq!(odd.scan(&view, 1).unwrap(), scan);
    }
}
