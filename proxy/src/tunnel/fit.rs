//! Fitting a tunnel: the box that fits best around some guess of the direction.

use super::direction::{guesses, principal_direction};
use super::fitting::{Fitting, TOLERANCES};
use super::{ON_WALL, Tunnel, TunnelError};
use crate::cloud::median;
use crate::order::{in_own_order, spread_over};
use calibrate::View;
use glam::{DMat3, DVec3};

/// Fewer points than this tell no six walls.
const LEAST_POINTS: usize = 12;
/// Points farther from the cameras' middle than this many times the median are left out; cameras where
/// they are that much farther than both points and cameras are.
const FAR: f64 = 100.0;
/// So many points, spread over all, try guesses.
const SAMPLE: usize = 1200;
/// A path tells the direction when it is this long (standard deviation, shares of the size).
const WALK: f64 = 0.5;
/// Below this share of the size a cloud has no extent.
const FLAT: f64 = 1e-6;

/// Lays a tunnel around the cameras of `views`, its walls through the points.
///
/// Points and cameras that are not finite, and points far from everything, do not count.
/// Only `share_on_walls`, or [`Tunnel::is_hallway`], tells whether the scene is one: points
/// in any arrangement get the box that fits them best, whatever their order.
///
/// # Errors
/// No camera; too few points, or all of them on a line.
pub fn fit(views: &[View], points_in_world: &[DVec3]) -> Result<Tunnel, TunnelError> {
    // 1. What there is to go by, around the cameras' middle.
    let posed: Vec<&View> = views
        .iter()
        .filter(|v| v.camera_from_world.is_finite() && v.center().is_finite())
        .collect();
    if posed.is_empty() {
        return Err(TunnelError::NoViews);
    }
    let middle = |axis: usize| median(posed.iter().map(|v| v.center()[axis]).collect());
    let origin = DVec3::new(middle(0), middle(1), middle(2));
    let mut points = offsets(points_in_world.iter().copied(), origin);
    let mut centers = offsets(posed.iter().map(|v| v.center()), origin);
    let limit = reach(&points);
    // A walk may lead far from where most photos were taken, if that is one place.
    let limit_of_centers = limit.max(reach(&centers));
    points.retain(|p| p.length() <= limit);
    centers.retain(|c| c.length() <= limit_of_centers);
    if centers.is_empty() {
        return Err(TunnelError::NoViews);
    }
    if points.len() < LEAST_POINTS {
        return Err(TunnelError::TooFewPoints {
            found: points.len(),
            expected: LEAST_POINTS,
        });
    }
    let points = in_own_order(&points);

    // 2. Its size: points lie half of it from the path.
    let guesses = guesses(&posed, &centers, &points);
    let size = size_across(guesses[0], &centers, &points);
    let extent = points.iter().map(|p| p.length()).fold(0.0, f64::max);
    if !(size > FLAT * extent) {
        return Err(TunnelError::NoWalls);
    }

    // 3. The best box for each guess, roughly; then the best three in all detail, of which all points tell the best.
    let few = spread_over(&points, SAMPLE);
    let path = principal_direction(&centers)
        .filter(|(_, spread)| *spread > WALK * size)
        .map(|(path, _)| path);
    let rough = |axes: DMat3| {
        let mut fitting = Fitting::new(axes, &centers, &few, size);
        fitting.path = path;
        fitting.tolerance = TOLERANCES[0];
        (0..2).for_each(|_| fitting.search());
        (fitting.cost(), fitting)
    };
    let mut fits: Vec<(f64, Fitting)> = guesses.into_iter().map(rough).collect();
    fits.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut fits: Vec<(f64, Fitting)> = fits
        .into_iter()
        .take(3)
        .map(|(_, fitting)| {
            let mut fitting = fitting.in_detail();
            fitting.points = &points;
            (fitting.cost(), fitting)
        })
        .collect();
    fits.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut best = fits.swap_remove(0).1;
    best.size = 0.5 * ((best.max.x - best.min.x) + (best.max.y - best.min.y));
    for tolerance in &TOLERANCES[2..] {
        best.tolerance = *tolerance;
        best.refine();
    }
    best.tolerance = ON_WALL;
    best.place_unseen_walls();
    Ok(best.into_tunnel(origin))
}

/// The finite points relative to `origin`.
fn offsets(points_in_world: impl Iterator<Item = DVec3>, origin: DVec3) -> Vec<DVec3> {
    let offsets = points_in_world.map(|p| p - origin);
    offsets.filter(|p| p.length().is_finite()).collect()
}

/// How far from the origin something still counts.
fn reach(offsets: &[DVec3]) -> f64 {
    match offsets {
        [] => 0.0,
        _ => FAR * median(offsets.iter().map(|p| p.length()).collect()),
    }
}

/// Twice the median distance of the points from the cameras' middle, across the way.
fn size_across(axes: DMat3, centers: &[DVec3], points: &[DVec3]) -> f64 {
    let middle = centers.iter().sum::<DVec3>() / centers.len().max(1) as f64;
    let across = |p: &DVec3| (axes.transpose() * (*p - middle)).truncate().length();
    2.0 * median(points.iter().map(across).collect())
}
