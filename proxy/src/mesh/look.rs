//! Whether a mesh lies where the cameras look.

use crate::Solid;
use calibrate::{Pixel, View};
use rayon::prelude::*;

/// Rays across and down each photo.
const RAYS: (u32, u32) = (16, 12);
/// Views asked, spread over all.
const VIEWS: usize = 24;

/// The share of rays, spread evenly over up to 24 of the views, that meet the mesh in front
/// of the camera, at whatever depth: near 0 where a mesh lies in another frame than the
/// cameras, so that it is worth a warning. 0 if there are no views or rays.
pub fn lies_where_cameras_look(solid: &Solid, views: &[View]) -> f64 {
    let step = views.len().div_ceil(VIEWS).max(1);
    let asked: Vec<&View> = views.iter().step_by(step).collect();
    let is_met = |view: &View, i: u32| {
        let (across, down) = RAYS;
        let part = |cell: u32, of: u32, side: u32| {
            (f64::from(cell) + 0.5) / f64::from(of) * f64::from(side)
        };
        let pixel = Pixel::new(
            part(i % across, across, view.width),
            part(i / across, down, view.height),
        );
        let ray = view.camera_from_world.rotation.conjugate() * view.lens.unproject(pixel)?;
        Some(solid.first_hit(view.center(), ray).is_some())
    };
    let rays = asked
        .par_iter()
        .flat_map_iter(|view| (0..RAYS.0 * RAYS.1).filter_map(|i| is_met(view, i)));
    let (met, all) = rays
        .map(|met| (usize::from(met), 1_usize))
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    if all == 0 {
        0.0
    } else {
        met as f64 / all as f64
    }
}
