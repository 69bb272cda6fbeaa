//! What pixels see of a surface, kept within a closed mesh.
//!
//! A pixel's point lies within where the last side of the mesh before it, along the ray, is one
//! where the ray enters. That holds on edges, too, where a ray meets both neighbours, which counting
//! sides does not. A point outside goes to the nearest side; what sees no side sees nothing.

use super::draw::by_bands;
use super::{BAND, Prepared, Threads};
use crate::{Rays, Solid};
use calibrate::View;
use glam::DVec3;
use rayon::prelude::*;

/// Where a pixel's point belongs, given a mesh that it has to be within.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kept {
    /// Nowhere: the ray misses the mesh.
    Nowhere,
    /// It is within.
    AsItIs,
    /// On a side of the mesh.
    On {
        /// Which triangle.
        triangle_idx: u32,
        /// 1/z there, or 1/along.
        inverse: f64,
    },
}

/// A side of the mesh that a ray meets.
#[derive(Clone, Copy)]
struct Side {
    /// 1/z, or 1/distance.
    inverse: f64,
    triangle_idx: u32,
    /// Whether the ray enters there.
    enters: bool,
}

/// A triangle of the mesh, and whether rays enter there.
type Crossed = (Prepared, bool);

impl Side {
    fn kept(self) -> Kept {
        Kept::On {
            triangle_idx: self.triangle_idx,
            inverse: self.inverse,
        }
    }
}

/// The sides next to a point along its ray.
#[derive(Clone, Copy, Default)]
struct Around {
    before: Option<Side>,
    behind: Option<Side>,
}

impl Around {
    /// Takes a side into account; of those at one depth the first stays.
    #[inline]
    fn meet(&mut self, side: Side, point_inverse: f64) {
        if side.inverse >= point_inverse {
            if self.before.is_none_or(|own| side.inverse < own.inverse) {
                self.before = Some(side);
            }
        } else if side.inverse > 0.0 && self.behind.is_none_or(|own| side.inverse > own.inverse) {
            self.behind = Some(side);
        }
    }

    fn keep(&self, point_inverse: f64) -> Kept {
        match (self.before, self.behind) {
            (Some(before), _) if before.enters => Kept::AsItIs,
            (None, Some(behind)) if !behind.enters => Kept::AsItIs,
            (Some(side), None) | (None, Some(side)) => side.kept(),
            (None, None) => Kept::Nowhere,
            (Some(before), Some(behind)) => {
                let far = |inverse: f64| (1.0 / inverse - 1.0 / point_inverse).abs();
                let is_nearer = far(before.inverse) <= far(behind.inverse);
                if is_nearer { before } else { behind }.kept()
            }
        }
    }
}

impl Solid {
    /// Keeps a view's points, one for each pixel along rays of its camera, within this mesh, which is
    /// closed and counter-clockwise from outside: where each belongs, row by row. Points are given by
    /// 1/z in the camera's frame; one of zero or less is behind all there is.
    pub fn keep(&self, view: &View, rays: &Rays, inverse_depth: &[f64]) -> Vec<Kept> {
        self.keep_by(Threads::All, view, rays, inverse_depth)
    }

    pub(super) fn keep_by(
        &self,
        threads: Threads,
        view: &View,
        rays: &Rays,
        inverse_depth: &[f64],
    ) -> Vec<Kept> {
        let triangles = self.in_sight_of(threads, view, rays, |i, corners| {
            let mut enters = false;
            let prepared = Prepared::new(i, corners, rays, |sides| {
                enters = sides.volume < 0.0;
                Some(sides.inverse_depth())
            })?;
            Some((prepared, enters))
        });
        let [width, height] = rays.size;
        let bands = by_bands(triangles.iter().flatten(), |(triangle, _)| triangle, height);
        let band = |(band_idx, (points, band)): (usize, (&[f64], &Vec<&Crossed>))| {
            let first = band_idx * BAND;
            let mut around = vec![Around::default(); points.len()];
            for (triangle, enters) in band {
                for row in triangle.rows_in(first, width, points.len()) {
                    let pixels = (row - first) * width..(row + 1 - first) * width;
                    let (around, points) = (&mut around[pixels.clone()], &points[pixels]);
                    triangle.each_pixel(row, rays, |column, inverse| {
                        let side = Side {
                            inverse,
                            triangle_idx: triangle.triangle_idx,
                            enters: *enters,
                        };
                        if inverse > 0.0 {
                            around[column].meet(side, points[column]);
                        }
                    });
                }
            }
            let kept = around.iter().zip(points);
            kept.map(|(around, &point)| around.keep(point)).collect()
        };
        let points = inverse_depth.par_chunks((BAND * width).max(1));
        let points = points.zip(&bands).enumerate();
        let points = points.with_min_len(threads.at_least(1));
        let kept: Vec<Vec<Kept>> = points.map(band).collect();
        kept.concat()
    }

    /// [`Self::keep`] for the point at `along` lengths of `direction` from a viewer; one at infinity
    /// or behind the viewer is behind all there is.
    pub fn keep_on_ray(&self, from_in_world: DVec3, direction: DVec3, along: f64) -> Kept {
        let point_inverse = if along > 0.0 { along.recip() } else { 0.0 };
        let mut around = Around::default();
        let mut passed = 0.0;
        // Sides where the ray leaves count, too.
        let next = |from: DVec3| self.first_own_hit(from, direction, false);
        while let Some(hit) = next(from_in_world + direction * passed) {
            // A little on, so that it is not met again.
            passed = (passed + hit.along) * (1.0 + ON);
            let [a, b, c] = self.corners(hit.triangle_idx as usize);
            let side = Side {
                inverse: passed.recip(),
                triangle_idx: hit.triangle_idx,
                enters: (b - a).cross(c - a).dot(direction) < 0.0,
            };
            around.meet(side, point_inverse);
            if around.behind.is_some() {
                break;
            }
        }
        around.keep(point_inverse)
    }
}

/// How much farther along a ray the next side is looked for, relatively.
const ON: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MeshKind, Scan};
    use calibrate::{Distortion, Lens, Pixel, Rigid3};
    use glam::{DQuat, DVec2};
    use proptest::prelude::*;
    use std::sync::Arc;

    fn boxes(of: &[(DVec3, DVec3)]) -> Solid {
        Solid::new(MeshKind::Hull, crate::scan::tests::boxes(of))
    }

    fn view(center: DVec3, turn: DQuat, k1: f64) -> View {
        let bent = Distortion::Rational {
            k: [k1, 0.0, 0.0, 0.0, 0.0, 0.0],
            p: [0.0; 2],
        };
        View {
            lens: Lens::new(DVec2::new(31.0, 33.0), DVec2::new(18.2, 17.1), bent),
            width: 37,
            height: 35,
            camera_from_world: Rigid3 {
                rotation: turn,
                translation: -(turn * center),
            },
        }
    }

    /// Straight on at two boxes, one behind the other, from two units before the first.
    #[test]
    fn a_point_stays_within_or_goes_to_the_nearest_side() {
        let solid = boxes(&[
            (DVec3::new(-1.0, -1.0, 2.0), DVec3::new(1.0, 1.0, 3.0)),
            (DVec3::new(-1.0, -1.0, 5.0), DVec3::new(1.0, 1.0, 6.0)),
        ]);
        let side = |kept: Kept| match kept {
            Kept::On { triangle_idx, .. } => {
                let corners = solid.mesh().corners(triangle_idx as usize);
                Some(corners.map(|p| p.z).iter().sum::<f64>() / 3.0)
            }
            _ => None,
        };
        let keep = |along: f64| solid.keep_on_ray(DVec3::ZERO, DVec3::Z, along);
        assert_eq!(keep(2.5), Kept::AsItIs);
        assert_eq!(keep(5.5), Kept::AsItIs);
        for (along, expected) in [
            (1.0, 2.0),
            (3.5, 3.0),
            (4.5, 5.0),
            (9.0, 6.0),
            (f64::INFINITY, 6.0),
            (-1.0, 6.0),
        ] {
            assert_eq!(side(keep(along)), Some(expected), "{along}");
        }
        let aside = solid.keep_on_ray(DVec3::ZERO, DVec3::X, 2.5);
        assert_eq!(aside, Kept::Nowhere);
        // From within.
        let from = DVec3::new(0.1, 0.2, 2.5);
        assert_eq!(solid.keep_on_ray(from, DVec3::Z, 0.2), Kept::AsItIs);
        assert_eq!(side(solid.keep_on_ray(from, DVec3::Z, 1.0)), Some(3.0));
    }

    proptest! {
        #[test]
        fn all_pixels_at_once_are_kept_as_ray_by_ray(
            center in prop::array::uniform3(-2.5..2.5),
            turn in prop::array::uniform3(-3.0..3.0),
            sizes in prop::array::uniform3(0.1..1.5),
            at in -0.5..6.0,
            slope in -0.5..0.5,
            k1 in prop_oneof![Just(0.0), -0.2..0.2],
        ) {
            let half = DVec3::from_array(sizes);
            let next = DVec3::new(2.3, 0.4, -0.3);
            let solid = boxes(&[(-half, half), (next - 0.7 * half, next + 0.7 * half)]);
            let turn = DQuat::from_scaled_axis(DVec3::from_array(turn));
            let view = view(DVec3::from_array(center), turn, k1);
            let Some(rays) = Rays::of(&view.lens, (view.width, view.height)) else {
                return Ok(());
            };
            let pixels = (0..view.width * view.height).map(|i| (i % view.width, i / view.width));
            let depth = |x: u32| -> f64 { at + slope * f64::from(x) / 10.0 };
            let points: Vec<f64> = pixels.clone().map(|(x, _)| depth(x).recip()).collect();
            let kept = solid.keep(&view, &rays, &points);
            let world_from_camera = view.camera_from_world.rotation.conjugate();
            for ((x, y), found) in pixels.zip(kept) {
                let ray = view.lens.unproject(Pixel::center_of(x, y)).unwrap();
                let direction = world_from_camera * (ray / ray.z);
                let expected = solid.keep_on_ray(view.center(), direction, depth(x));
                // A ray along an edge meets either of its triangles.
                let alike = match (found, expected) {
                    (
                        Kept::On { triangle_idx: a, inverse: at_a },
                        Kept::On { triangle_idx: b, inverse: at_b },
                    ) => {
                        let along = |i: u32| {
                            let [a, b, c] = solid.mesh().corners(i as usize);
                            let normal = (b - a).cross(c - a);
                            normal.dot(a - view.center()) / normal.dot(direction)
                        };
                        (along(a) - along(b)).abs() < 1e-6
                            && (at_a.recip() - along(a)).abs() < 1e-6
                            && (at_b.recip() - along(b)).abs() < 1e-6
                    }
                    _ => found == expected,
                };
                prop_assert!(alike, "{x} {y}: {found:?}, {expected:?}");
            }
        }

        #[test]
        fn a_mesh_within_a_hull_is_met_there_by_rays_and_scans_alike(
            center in prop::array::uniform3(-3.5..3.5),
            turn in prop::array::uniform3(-3.0..3.0),
            sizes in prop::array::uniform3(0.1..1.5),
            offset in prop::array::uniform3(-1.0..1.0),
        ) {
            let (half, at) = (DVec3::from_array(sizes), DVec3::from_array(offset));
            let hull = Arc::new(boxes(&[(-half, half)]));
            let mut solid = boxes(&[(at - 0.8, at + 0.8)]);
            solid.keep_within(Some(hull));
            let view = view(DVec3::from_array(center), DQuat::from_scaled_axis(turn.into()), 0.0);
            let rays = Rays::of(&view.lens, (view.width, view.height)).unwrap();
            let scan = solid.scan_along(&view, &rays);
            let world_from_camera = view.camera_from_world.rotation.conjugate();
            for (i, triangle_idx) in scan.triangle_of.iter().enumerate() {
                let pixel = Pixel::center_of(i as u32 % view.width, i as u32 / view.width);
                let ray = view.lens.unproject(pixel).unwrap();
                let direction = world_from_camera * (ray / ray.z);
                let Some(hit) = solid.first_hit(view.center(), direction) else {
                    prop_assert_eq!(*triangle_idx, Scan::NOTHING);
                    continue;
                };
                // 1. Alike, on a triangle that has that name.
                prop_assert!((scan.inverse_depth[i].recip() - hit.along).abs() < 1e-6);
                let [a, b, c] = solid.corners(*triangle_idx as usize);
                let normal = (b - a).cross(c - a);
                let along = normal.dot(a - view.center()) / normal.dot(direction);
                prop_assert!((along - hit.along).abs() < 1e-6, "{along}, {hit:?}");
                // 2. Within.
                let point = view.center() + direction * hit.along;
                prop_assert!((point.abs() - half).max_element() < 1e-6, "{point}");
            }
        }
    }
}
