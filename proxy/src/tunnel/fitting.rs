//! A box on its way to fit: walls found one by one where the cost of all points is least, then
//! all of it at once by robust least squares.

use super::Tunnel;
use crate::cloud::median;
use crate::condition;
use calibrate::Rigid3;
use glam::{DMat3, DQuat, DVec2, DVec3};
use nalgebra::{DMatrix, SMatrix, SVector};

/// Places tried for each wall.
const PLACES: usize = 40;
/// What counts as near a wall, in shares of the tunnel's size, from coarse to fine.
pub(super) const TOLERANCES: [f64; 4] = [0.12, 0.06, 0.03, 0.02];
/// A point outside costs this much, one well inside 1: a wall would hide the one, while the
/// other may be furniture.
const OUTSIDE: f64 = 3.0;
/// But farther outside than this share of the size it costs 1 again: it is a mirror image,
/// as floors show them, or a mismatch.
const MIRRORED: f64 = 0.25;
/// Cameras count as misplaced, and need not be inside, where they are farther off the way
/// than this many standard deviations and this share of the tunnel's size.
pub(super) const ASTRAY_SIGMAS: f64 = 4.0;
const ASTRAY: f64 = 0.25;
/// Who walks through a tunnel walks along it, to within about this angle in radians. A tunnel
/// that much off the path costs as much as this share of the points off its walls.
const ASTRAY_ANGLE: f64 = 0.05;
const ASTRAY_COST: f64 = 0.02;
/// Walls stay this far from the cameras, in shares of the tunnel's size.
const CLEARANCE: f64 = 0.05;
/// A wall with fewer of the points is not found.
const FOUND: f64 = 0.01;
/// Where a wall is not found, this share of the points lies beyond.
const BEYOND: f64 = 0.01;

/// A box on its way to fit; all lengths relative to the cameras' middle.
#[derive(Clone)]
pub(super) struct Fitting<'a> {
    /// Its axes in the world.
    axes: DMat3,
    pub(super) min: DVec3,
    pub(super) max: DVec3,
    centers: &'a [DVec3],
    pub(super) points: &'a [DVec3],
    /// Which way the cameras went, in the world, where they did.
    pub(super) path: Option<DVec3>,
    /// About as large as it is wide.
    pub(super) size: f64,
    /// In shares of `size`.
    pub(super) tolerance: f64,
}

impl<'a> Fitting<'a> {
    pub(super) fn new(axes: DMat3, centers: &'a [DVec3], points: &'a [DVec3], size: f64) -> Self {
        let mut fitting = Self {
            axes,
            min: DVec3::ZERO,
            max: DVec3::ZERO,
            centers,
            points,
            path: None,
            size,
            tolerance: TOLERANCES[0],
        };
        // It starts around everything.
        let at = fitting.in_box(points);
        let (low, high) = fitting.camera_bounds();
        for axis in 0..3 {
            let mut along: Vec<f64> = at.iter().map(|p| p[axis]).collect();
            along.sort_by(f64::total_cmp);
            fitting.min[axis] = along[along.len() / 50].min(low[axis]);
            fitting.max[axis] = along[along.len() - 1 - along.len() / 50].max(high[axis]);
        }
        fitting
    }

    fn in_box(&self, points: &[DVec3]) -> Vec<DVec3> {
        let box_from_world = self.axes.transpose();
        points.iter().map(|p| box_from_world * *p).collect()
    }

    /// What the box must hold: the cameras, with a little room. Those astray don't count
    /// across the way.
    fn camera_bounds(&self) -> (DVec3, DVec3) {
        let centers = self.in_box(self.centers);
        let (mut low, mut high) = (DVec3::ZERO, DVec3::ZERO);
        for axis in 0..3 {
            let at: Vec<f64> = centers.iter().map(|c| c[axis]).collect();
            let middle = median(at.clone());
            let deviation = 1.4826 * median(at.iter().map(|x| (x - middle).abs()).collect());
            let limit = if axis == 2 {
                f64::INFINITY
            } else {
                (ASTRAY_SIGMAS * deviation).max(ASTRAY * self.size)
            };
            let kept = at.into_iter().filter(|x| (x - middle).abs() <= limit);
            let (least, most) = kept.fold((middle, middle), |(l, m), x| (l.min(x), m.max(x)));
            low[axis] = least - CLEARANCE * self.size;
            high[axis] = most + CLEARANCE * self.size;
        }
        (low, high)
    }

    /// What counts as near each wall. Depths along the way are less sure than what lies
    /// across it, the more so the farther away.
    fn tolerances(&self) -> (DVec3, DVec3) {
        let unit = DVec3::splat(self.tolerance * self.size);
        let (low, high) = self.camera_bounds();
        let far = |length: f64| unit.with_z(unit.z * (0.5 * length / self.size).max(1.0));
        (far(low.z - self.min.z), far(self.max.z - high.z))
    }

    pub(super) fn cost(&self) -> f64 {
        let astray = self.off_path().map_or(0.0, |off| {
            ASTRAY_COST * self.points.len() as f64 * off.length_squared()
        });
        self.cost_of(&self.in_box(self.points), self.min, self.max) + astray
    }

    /// How far off the path the box is, right and down, in units of [`ASTRAY_ANGLE`].
    fn off_path(&self) -> Option<DVec2> {
        let path = self.axes.transpose() * self.path?;
        Some(path.truncate() * path.z.signum() / ASTRAY_ANGLE)
    }

    /// Geman and McClure's cost of all points' distances from their nearest wall.
    fn cost_of(&self, points: &[DVec3], min: DVec3, max: DVec3) -> f64 {
        let trial = Self {
            min,
            max,
            ..self.clone()
        };
        let (near, far) = trial.tolerances();
        let of_point = |p: &DVec3| {
            let (low, high) = ((*p - min) / near, (max - *p) / far);
            let inside = low.min(high);
            if inside.min_element() >= 0.0 {
                let squared = inside.min_element().powi(2);
                squared / (1.0 + squared)
            } else {
                let squared = inside.min(DVec3::ZERO).length_squared();
                let saturated = squared / (1.0 + squared);
                // Next to the wall as inside, or noise would push it outwards.
                saturated * (1.0 + self.outside(inside) * saturated)
            }
        };
        points.iter().map(of_point).sum()
    }

    /// From coarse to fine.
    pub(super) fn in_detail(mut self) -> Self {
        for tolerance in TOLERANCES {
            self.tolerance = tolerance;
            self.search();
            self.refine();
        }
        self
    }

    /// What a point outside costs more, by how far `inside` of the nearest walls it is, in
    /// tolerances. Beyond the ends nothing is mirrored.
    fn outside(&self, inside: DVec3) -> f64 {
        let across = inside.truncate().min(DVec2::ZERO) * self.tolerance / MIRRORED;
        (OUTSIDE - 1.0) / (1.0 + across.length_squared())
    }

    /// Tries places for each wall in turn: where the points are.
    pub(super) fn search(&mut self) {
        let points = self.in_box(self.points);
        let (low, high) = self.camera_bounds();
        // Across the way first, then the ends.
        for axis in [0, 1, 2] {
            let mut along: Vec<f64> = points.iter().map(|p| p[axis]).collect();
            along.sort_by(f64::total_cmp);
            let below = &along[..along.partition_point(|&x| x < low[axis])];
            let above = &along[along.partition_point(|&x| x <= high[axis])..];
            for (beyond, is_max) in [(below, false), (above, true)] {
                let mut best = (
                    self.cost_of(&points, self.min, self.max),
                    self.min,
                    self.max,
                );
                for place in places(beyond) {
                    let (mut min, mut max) = (self.min, self.max);
                    if is_max {
                        max[axis] = place;
                    } else {
                        min[axis] = place;
                    }
                    let cost = self.cost_of(&points, min, max);
                    if cost < best.0 {
                        best = (cost, min, max);
                    }
                }
                (self.min, self.max) = (best.1, best.2);
            }
        }
    }

    /// Turns the box and moves its walls: robust least squares over all nine numbers, each
    /// point pulling at its nearest wall.
    pub(super) fn refine(&mut self) {
        let mut cost = self.cost();
        for _ in 0..12 {
            let Some(step) = self.step() else { return };
            let mut next = self.clone();
            let turn = DVec3::new(step[0], step[1], step[2]);
            next.axes = self.axes * DMat3::from_quat(DQuat::from_scaled_axis(turn));
            next.min += DVec3::new(step[3], step[4], step[5]);
            next.max += DVec3::new(step[6], step[7], step[8]);
            let (low, high) = next.camera_bounds();
            next.min = next.min.min(low);
            next.max = next.max.max(high);
            let next_cost = next.cost();
            if !(next_cost < cost) {
                return;
            }
            let done = cost - next_cost < 1e-9 * cost;
            cost = next_cost;
            *self = next;
            if done {
                return;
            }
        }
    }

    /// One step of Gauss and Newton's: a rotation vector in the box's frame, then `min` and
    /// `max`.
    fn step(&self) -> Option<SVector<f64, 9>> {
        let (mut matrix, right_side) = self.normal_equations();
        // A little damping holds what no point decides.
        for k in 0..9 {
            let own = if k < 3 { 1.0 } else { self.size.powi(-2) };
            matrix[(k, k)] = matrix[(k, k)] * (1.0 + 1e-6) + 1e-3 * own;
        }
        let step = matrix.cholesky()?.solve(&right_side);
        step.iter().all(|s| s.is_finite()).then_some(step)
    }

    /// Of a [`Self::step`].
    fn normal_equations(&self) -> (SMatrix<f64, 9, 9>, SVector<f64, 9>) {
        let (near, far) = self.tolerances();
        let mut matrix = SMatrix::<f64, 9, 9>::zeros();
        let mut right_side = SVector::<f64, 9>::zeros();
        for point in self.in_box(self.points) {
            let (low, high) = ((point - self.min) / near, (self.max - point) / far);
            let inside = low.min(high);
            let Some(wall) = nearest_wall(low, high) else {
                continue;
            };
            let axis = wall % 3;
            let (place, tolerance) = match wall {
                0..3 => (self.min[axis], near[axis]),
                _ => (self.max[axis], far[axis]),
            };
            let residual = (point[axis] - place) / tolerance;
            let squared = residual * residual;
            let inwards = if wall < 3 { residual } else { -residual };
            let steeper = if inwards < 0.0 {
                1.0 + 2.0 * self.outside(inside) * squared / (1.0 + squared)
            } else {
                1.0
            };
            let weight = steeper / (1.0 + squared).powi(2);
            // Turning the axes by ω carries a fixed point to p − ω × p.
            let turned = DVec3::AXES[axis].cross(point) / tolerance;
            let mut row = SVector::<f64, 9>::zeros();
            for k in 0..3 {
                row[k] = turned[k];
            }
            row[3 + wall] = -1.0 / tolerance;
            matrix += weight * row * row.transpose();
            right_side -= weight * residual * row;
        }
        if let Some(off) = self.off_path() {
            // The path's x and y change by −ω.y and ω.x (its z is about 1).
            let weight = ASTRAY_COST * self.points.len() as f64;
            let slope = 1.0 / ASTRAY_ANGLE;
            for (k, slope, residual) in [(1, -slope, off.x), (0, slope, off.y)] {
                matrix[(k, k)] += weight * slope * slope;
                right_side[k] -= weight * slope * residual;
            }
        }
        (matrix, right_side)
    }

    /// How many points lie near each wall, and how many near any.
    fn counts(&self) -> ([usize; 6], usize) {
        let tolerance = DVec3::splat(self.tolerance * self.size);
        let mut on = [0; 6];
        for point in self.in_box(self.points) {
            let (low, high) = (
                (point - self.min) / tolerance,
                (self.max - point) / tolerance,
            );
            if let Some(wall) = nearest_wall(low, high)
                && low.min(high)[wall % 3].abs() <= 1.0
            {
                on[wall] += 1;
            }
        }
        (on, on.iter().sum())
    }

    /// Puts walls without points where the points end.
    pub(super) fn place_unseen_walls(&mut self) {
        let (on, _) = self.counts();
        let least = FOUND * self.points.len() as f64;
        let points = self.in_box(self.points);
        let (low, high) = self.camera_bounds();
        let last = points.len() - 1;
        let beyond = ((BEYOND * points.len() as f64) as usize).min(last);
        for wall in (0..6).filter(|&wall| (on[wall] as f64) < least) {
            let axis = wall % 3;
            let mut along: Vec<f64> = points.iter().map(|p| p[axis]).collect();
            along.sort_by(f64::total_cmp);
            // An end keeps away from the cameras: they should not stand against it.
            let room = if axis == 2 { 0.5 * self.size } else { 0.0 };
            match wall {
                0..3 => self.min[axis] = along[beyond].min(low[axis] - room),
                _ => self.max[axis] = along[last - beyond].max(high[axis] + room),
            }
        }
    }

    pub(super) fn into_tunnel(self, origin: DVec3) -> Tunnel {
        let rotation = DQuat::from_mat3(&self.axes.transpose()).normalize();
        let (points_on, on_walls) = self.counts();
        let (low, high) = self.camera_bounds();
        let room = 2.0 * CLEARANCE * self.size;
        Tunnel {
            tunnel_from_world: Rigid3::new(rotation, -(rotation * origin)),
            min: self.min,
            max: self.max,
            points_on,
            points: self.points.len(),
            share_on_walls: on_walls as f64 / self.points.len() as f64,
            walked: high.z - low.z - room,
            condition: condition::of_normal_equations(&DMatrix::from_column_slice(
                9,
                9,
                self.normal_equations().0.as_slice(),
            )),
        }
    }
}

/// The wall nearest to a point that is `low` from the walls of `min` and `high` from those
/// of `max`, in tolerances; `None` for a point far outside.
fn nearest_wall(low: DVec3, high: DVec3) -> Option<usize> {
    let from = low.min(high);
    let outside = (0..3).filter(|&axis| from[axis] < -1.0).count();
    if outside > 1 {
        return None;
    }
    let nearest = |a: &usize, b: &usize| from[*a].total_cmp(&from[*b]);
    let axis = (0..3).min_by(nearest)?;
    Some(if low[axis] <= high[axis] {
        axis
    } else {
        axis + 3
    })
}

/// So many of the sorted values, spread evenly among them.
fn places(sorted: &[f64]) -> impl Iterator<Item = f64> + '_ {
    let count = PLACES.min(sorted.len());
    (0..count).map(move |i| sorted[(2 * i + 1) * sorted.len() / (2 * count)])
}
