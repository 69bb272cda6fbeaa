//! A plane made anew for each desired view, from the points that it sees.
//!
//! Seen from the view, a plane's inverse distance is s = q · v along the ray v, linear in the
//! image. q comes from robust least squares over the points. Every point's weight and the
//! cost itself are continuous in the view's pose, and the cost is convex: the plane moves
//! smoothly as the view does.

use crate::Plane;
use crate::points::{EASY_ANGLE, SparsePoint, unlikeness};
use calibrate::{Pixel, View, outer};
use glam::{DMat3, DVec3};

/// Within this share of the image's shorter side points fade out towards the border.
const FADE: f64 = 0.1;
/// What a point in front counts outside the image, relative to one inside: enough where
/// there is no other.
const OUTSIDE: f64 = 1e-4;
/// Residuals beyond this share of the typical inverse distance no longer weigh by their
/// squares (Huber's cost).
const LINEAR_FROM: f64 = 0.05;
/// The wish for a plane parallel to the image, as the sum of squares of rays across the axis
/// that it weighs: about a tenth of a point well off the axis, so that two points decide
/// little and ten almost all.
const PARALLEL: f64 = 0.02;
/// The plane's inverse distance anywhere in the image is at least this share of its mean:
/// every pixel sees the plane.
const LEAST: f64 = 0.1;
const ROUNDS: usize = 30;

/// A point as the desired view sees it.
struct Seen {
    /// Unit length, in the view's frame.
    ray: DVec3,
    inverse_distance: f64,
    weight: f64,
}

/// The plane whose inverse distance fits that of the points in the desired image best: those
/// that `sources` like `desired` observe, inside its image, in front of it.
///
/// All of the image sees it. With few points it is parallel to the image. `None` where none
/// is in front of the view.
pub fn fit_plane_for_view(
    desired: &View,
    sources: &[View],
    points: &[SparsePoint],
) -> Option<Plane> {
    // 1. Who counts for how much.
    let centers: Vec<DVec3> = sources.iter().map(View::center).collect();
    let seen: Vec<Seen> = points
        .iter()
        .filter_map(|point| seen(desired, &centers, point))
        .collect();
    let total: f64 = seen.iter().map(|s| s.weight).sum();
    if !(total > 0.0) {
        return None;
    }

    // 2. A plane parallel to the image at the mean inverse depth, outliers weighing less.
    let scale = weighted_median(&seen, total);
    let axis = DVec3::Z;
    let parallel = axis * robust_depth(&seen, scale);

    // 3. Tilted as the points ask, by iteratively reweighted least squares (Huber's cost).
    //    Weights are relative to the largest: a handful of points counts as a handful.
    let largest = seen.iter().map(|s| s.weight).fold(0.0, f64::max);
    let mut q = parallel;
    for _ in 0..ROUNDS {
        let (mut matrix, mut right_side) = (DMat3::ZERO, DVec3::ZERO);
        for s in &seen {
            let residual = (q.dot(s.ray) - s.inverse_distance).abs();
            let w = s.weight / largest * huber(residual, scale);
            let v = s.ray;
            matrix += outer(v) * w;
            right_side += v * (w * s.inverse_distance);
        }
        // The wish to be parallel: q's x and y are zero.
        matrix.x_axis.x += PARALLEL;
        matrix.y_axis.y += PARALLEL;
        let next = matrix.inverse() * right_side;
        if !next.is_finite() {
            break;
        }
        let change = (next - q).length();
        q = next;
        if change <= 1e-13 * scale {
            break;
        }
    }

    // 4. Tilted less where its horizon would come into the image.
    let share = border_rays(desired)
        .map(|ray| {
            let (flat, tilted) = (parallel.dot(ray), q.dot(ray));
            let least = LEAST * flat;
            if tilted >= least {
                1.0
            } else {
                (flat - least) / (flat - tilted)
            }
        })
        .fold(1.0, f64::min);
    let q = parallel + share.clamp(0.0, 1.0) * (q - parallel);

    // 5. In the world: the point where the plane is nearest to the view is q / |q|².
    let world_from_camera = desired.camera_from_world.rotation.conjugate();
    let nearest = q / q.length_squared();
    Plane::new(
        desired.center() + world_from_camera * nearest,
        world_from_camera * q,
    )
    .ok()
}

/// What a point says; `None` behind the view.
fn seen(desired: &View, centers: &[DVec3], point: &SparsePoint) -> Option<Seen> {
    let center = desired.center();
    let here = point.position - center;
    let distance = here.length();
    let ray = desired.camera_from_world.rotation * (here / distance);
    if !(ray.z > 0.0 && ray.is_finite() && distance.is_finite() && distance > 0.0) {
        return None;
    }
    // 1. Inside the image, fading towards its border.
    let inside = desired.project(point.position).map_or(0.0, |at| {
        let (width, height) = (f64::from(desired.width), f64::from(desired.height));
        let room = at.x.min(width - at.x).min(at.y).min(height - at.y);
        let t = (room / (FADE * width.min(height))).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    });
    // 2. Observed from about the same direction and distance.
    let unlike = |&i: &u32| {
        let there = point.position - *centers.get(i as usize)?;
        let unlike = unlikeness(here, there);
        unlike.is_finite().then_some(unlike)
    };
    let unlike = point.seen_by.iter().filter_map(unlike).reduce(f64::min)?;
    let like = EASY_ANGLE / (EASY_ANGLE + unlike);
    Some(Seen {
        ray,
        inverse_distance: 1.0 / distance,
        weight: (OUTSIDE + inside) * like * like,
    })
}

/// Huber's weight of a residual.
fn huber(residual: f64, scale: f64) -> f64 {
    let limit = LINEAR_FROM * scale;
    if residual > limit {
        limit / residual
    } else {
        1.0
    }
}

/// A robust mean of the inverse depths 1/z.
fn robust_depth(seen: &[Seen], scale: f64) -> f64 {
    let mut mean = scale;
    for _ in 0..ROUNDS {
        let (mut sum, mut weights) = (0.0, 0.0);
        for s in seen {
            let residual = (mean * s.ray.z - s.inverse_distance).abs();
            let w = s.weight * huber(residual, scale);
            sum += w * s.ray.z * s.inverse_distance;
            weights += w * s.ray.z * s.ray.z;
        }
        mean = sum / weights;
    }
    mean
}

/// The inverse distance in the middle of the weight, between the values around it so that it
/// moves continuously.
fn weighted_median(seen: &[Seen], total: f64) -> f64 {
    let mut sorted: Vec<(f64, f64)> = seen
        .iter()
        .map(|s| (s.inverse_distance, s.weight))
        .collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut passed = 0.0;
    let mut before: Option<(f64, f64)> = None;
    for (value, weight) in sorted {
        let at = passed + 0.5 * weight;
        if at >= 0.5 * total {
            return match before {
                Some((low, low_at)) if at > low_at => {
                    low + (value - low) * (0.5 * total - low_at) / (at - low_at)
                }
                _ => value,
            };
        }
        before = Some((value, at));
        passed += weight;
    }
    before.map_or(0.0, |(value, _)| value)
}

/// Rays through the image's border.
fn border_rays(view: &View) -> impl Iterator<Item = DVec3> + '_ {
    const STEPS: u32 = 8;
    let (width, height) = (f64::from(view.width), f64::from(view.height));
    let border = (0..=STEPS).flat_map(move |i| {
        let share = f64::from(i) / f64::from(STEPS);
        let (x, y) = (share * width, share * height);
        [(x, 0.0), (x, height), (0.0, y), (width, y)]
    });
    border
        .filter_map(|(x, y)| view.lens.unproject(Pixel::new(x, y)))
        .filter(|ray| ray.z > 0.0)
}
