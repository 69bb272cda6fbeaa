//! The warp: a reference image with depth as another camera sees it.
//!
//! McMillan and Bishop 1995, "Plenoptic modeling", as Rafferty et al. 1998 (§3.1) use it:
//! x₂ ≐ δ(x₁)·P₂⁻¹(c₁ − c₂) + P₂⁻¹·P₁·x₁. Here P₁·x₁ is the ray with z = 1, so the disparity δ is
//! the inverse depth. Samples are visited in an order in which what is nearer to the desired
//! camera comes later, so no depths are compared: towards the epipole where the desired centre is
//! in front of the reference camera, away from it where it is behind. (The papers' "behind:
//! towards" is how pixels move.)

use super::{Pinhole, Reference, Target, Window};
use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

/// The warp equation between two cameras.
#[derive(Clone, Copy, Debug)]
pub struct Warp {
    /// Homogeneous desired pixels from homogeneous reference pixels, at infinity.
    pub pixel_from_pixel: DMat3,
    /// What an inverse depth of 1 adds.
    pub shift: DVec3,
    /// The desired centre, in the reference camera's frame.
    pub center: DVec3,
}

/// Where a sample falls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Warped {
    /// In the desired image.
    pub pixel: DVec2,
    /// In the desired camera's frame.
    pub inverse_depth: f64,
}

/// How large a sample is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Splat {
    /// As large as its pixel's footprint: the box around what the warp makes of it, with the
    /// depth's slope between neighbours of one surface.
    #[default]
    Footprint,
    /// That many pixels each way.
    Fixed(u32),
}

/// How far beyond its footprint a splat reaches, in pixels, so that neighbours leave no gap.
const OVERLAP: f64 = 0.08;
/// The least and the most half sides of a splat, in pixels.
const HALF: [f64; 2] = [0.5, 8.0];

impl Warp {
    /// From one camera's image to another's.
    pub fn new(reference: &Pinhole, desired: &Pinhole) -> Self {
        let pixel_from_ray = |camera: &Pinhole| {
            DMat3::from_cols(
                DVec3::new(camera.focal.x, 0.0, 0.0),
                DVec3::new(0.0, camera.focal.y, 0.0),
                camera.principal.extend(1.0),
            )
        };
        let (f, c) = (reference.focal, reference.principal);
        let ray_from_pixel = DMat3::from_cols(
            DVec3::new(1.0 / f.x, 0.0, 0.0),
            DVec3::new(0.0, 1.0 / f.y, 0.0),
            (-c / f).extend(1.0),
        );
        let between = reference.center - desired.center;
        let desired_pixel_from_world = pixel_from_ray(desired) * desired.rotation;
        Self {
            pixel_from_pixel: desired_pixel_from_world
                * reference.rotation.transpose()
                * ray_from_pixel,
            shift: desired_pixel_from_world * between,
            center: reference.rotation * -between,
        }
    }

    /// The homogeneous desired pixel of a reference pixel whose point has that inverse depth.
    #[inline(always)]
    pub(super) fn homogeneous(&self, pixel: DVec2, inverse_depth: f64) -> DVec3 {
        self.pixel_from_pixel * pixel.extend(1.0) + inverse_depth * self.shift
    }

    /// Where a reference pixel falls whose point has that inverse depth; `None` behind the desired
    /// camera.
    #[inline]
    pub fn at(&self, pixel: DVec2, inverse_depth: f64) -> Option<Warped> {
        let at = self.homogeneous(pixel, inverse_depth);
        let is_in_front = at.z > 0.0 && at.is_finite();
        is_in_front.then(|| Warped {
            pixel: at.truncate() / at.z,
            inverse_depth: inverse_depth / at.z,
        })
    }

    /// The order to visit columns and rows in: rows above or before `split` and those from it
    /// on are two sheets, each from its first to its last.
    fn order(&self, reference: &Pinhole) -> [[Vec<u32>; 2]; 2] {
        let is_in_front = self.center.z >= 0.0;
        let axis = |axis: usize, count: u32| {
            // The first pixel whose centre is beyond the epipole; of one at infinity, all or none.
            let at = self.center[axis] / self.center.z.abs();
            let at = if is_in_front { at } else { -at };
            let at = at * reference.focal[axis] + reference.principal[axis];
            let at = if at.is_nan() { 0.0 } else { at };
            let split = (at - 0.5).ceil().clamp(0.0, f64::from(count)) as u32;
            let (before, after) = (0..split, split..count);
            match is_in_front {
                true => [before.collect(), after.rev().collect()],
                false => [before.rev().collect(), after.collect()],
            }
        };
        [axis(0, reference.width), axis(1, reference.height)]
    }
}

/// A sample as it will be drawn: what `x..` and `y..` of pixels it covers.
#[derive(Clone, Copy)]
struct Drawn {
    from: [i32; 2],
    to: [i32; 2],
    inverse_depth: f32,
}

/// Draws a reference image as a desired camera sees it, over what is there, in the pixels of a
/// window. How many samples were drawn.
pub fn warp(
    reference: &Reference,
    desired: &Pinhole,
    window: &Window,
    splat: Splat,
    into: &mut Target,
) -> usize {
    let warp = Warp::new(&reference.camera, desired);
    let seen = &reference.seen;
    let width = seen.width as usize;
    if width == 0 || (into.width, into.height) != (desired.width, desired.height) {
        return 0;
    }
    // 1. Where samples fall: rows at once.
    let row = |y: u32| (0..seen.width).map(move |x| (x, y));
    let place = |(x, y): (u32, u32)| place(&warp, seen, x, y, splat);
    let rows = (0..seen.height).into_par_iter().with_min_len(16);
    let placed: Vec<Option<Drawn>> = rows.flat_map_iter(|y| row(y).map(place)).collect();
    // 2. The splats, in order.
    let [columns, rows] = warp.order(&reference.camera);
    let mut count = 0;
    for y in rows.iter().flatten() {
        for x in columns.iter().flatten() {
            let i = *y as usize * width + *x as usize;
            if let Some(drawn) = placed[i] {
                count += usize::from(draw(drawn, seen.color[i], window, into));
            }
        }
    }
    count
}

fn place(warp: &Warp, seen: &Target, x: u32, y: u32, splat: Splat) -> Option<Drawn> {
    let i = (y * seen.width + x) as usize;
    let s = f64::from(seen.inverse_depth[i]);
    if !(s > 0.0) {
        return None;
    }
    let center = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
    let at = warp.at(center, s)?;
    let half = match splat {
        Splat::Fixed(pixels) => DVec2::splat(0.5 * f64::from(pixels)),
        Splat::Footprint => {
            let z = at.inverse_depth / s;
            let slope = |step: usize, has: [bool; 2]| slope(&seen.inverse_depth, i, step, has);
            let slope_x = slope(1, [x > 0, x + 1 < seen.width]);
            let slope_y = slope(seen.width as usize, [y > 0, y + 1 < seen.height]);
            // The derivative of a quotient; z is 1 over the divisor.
            let change = |column: DVec3, slope: f64| {
                let d = column + slope * warp.shift;
                (d.truncate() - at.pixel * d.z) * z
            };
            let along_x = change(warp.pixel_from_pixel.x_axis, slope_x);
            let along_y = change(warp.pixel_from_pixel.y_axis, slope_y);
            0.5 * (along_x.abs() + along_y.abs()) + OVERLAP
        }
    };
    let half = half.clamp(DVec2::splat(HALF[0]), DVec2::splat(HALF[1]));
    Some(Drawn {
        from: (at.pixel - half - 0.5).to_array().map(ceil),
        to: (at.pixel + half - 0.5).to_array().map(ceil),
        inverse_depth: at.inverse_depth as f32,
    })
}

/// The least whole number that is not less, within some range.
fn ceil(x: f64) -> i32 {
    let x = x.clamp(-1e6, 1e6);
    let whole = x as i32;
    whole + i32::from(f64::from(whole) < x)
}

/// The normal of what a pixel shows, away from its camera and in its frame; 0 where it shows nothing.
///
/// On a plane n·X = d the inverse depth is n·q / d, q the ray with z = 1: its slopes are the normal.
pub(crate) fn normal_at(camera: &Pinhole, inverse_depth: &[f32], i: usize) -> DVec3 {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let (x, y) = (i % width, i / width);
    let s = f64::from(inverse_depth[i]);
    if !(s > 0.0) {
        return DVec3::ZERO;
    }
    let ray = camera.ray(x as u32, y as u32);
    let slope_x = slope(inverse_depth, i, 1, [x > 0, x + 1 < width]) * camera.focal.x;
    let slope_y = slope(inverse_depth, i, width, [y > 0, y + 1 < height]) * camera.focal.y;
    DVec3::new(slope_x, slope_y, s - slope_x * ray.x - slope_y * ray.y)
}

/// How inverse depth changes from a pixel to the next: the smaller of the changes on its two
/// sides, zero where they disagree. It is exact on a plane, and at the border of a surface that
/// surface's own.
fn slope(inverse_depth: &[f32], i: usize, step: usize, [before, after]: [bool; 2]) -> f64 {
    let s = f64::from(inverse_depth[i]);
    let other = |has: bool, j: usize| {
        let other = if has {
            f64::from(inverse_depth[j])
        } else {
            0.0
        };
        (other > 0.0).then_some(other)
    };
    let down = other(before, i.wrapping_sub(step)).map(|v| s - v);
    let up = other(after, i + step).map(|v| v - s);
    match (down, up) {
        (Some(a), Some(b)) if a * b <= 0.0 => 0.0,
        (Some(a), Some(b)) => {
            if a.abs() < b.abs() {
                a
            } else {
                b
            }
        }
        (a, b) => a.or(b).unwrap_or(0.0),
    }
}

fn draw(drawn: Drawn, color: [u8; 4], window: &Window, into: &mut Target) -> bool {
    let mut is_drawn = false;
    let rows = drawn.from[1].max(0)..drawn.to[1].min(into.height as i32);
    for y in rows {
        let open = window.row(y as u32);
        let from = drawn.from[0].max(open.start as i32);
        let to = drawn.to[0].min(open.end as i32);
        for x in from..to {
            let i = y as usize * into.width as usize + x as usize;
            into.color[i] = color;
            into.inverse_depth[i] = drawn.inverse_depth;
            is_drawn = true;
        }
    }
    is_drawn
}
