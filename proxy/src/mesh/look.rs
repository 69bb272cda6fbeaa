//! Whether a mesh lies where the cameras look.

use super::Mesh;
use calibrate::{Pixel, View};
use glam::DVec3;
use rayon::prelude::*;

/// Rays across and down each photo.
const RAYS: (u32, u32) = (16, 12);
/// Views asked, spread over all.
const VIEWS: usize = 24;

/// The share of rays, spread evenly over up to 24 of the views, that meet the mesh in front
/// of the camera, at whatever depth: near 0 where a mesh lies in another frame than the
/// cameras, so that it is worth a warning. 0 if there are no views or rays.
pub fn lies_where_cameras_look(mesh: &Mesh, views: &[View]) -> f64 {
    let asked: Vec<&View> = views
        .iter()
        .step_by(views.len().div_ceil(VIEWS).max(1))
        .collect();
    let counts: Vec<(usize, usize)> = asked.par_iter().map(|view| rays_met(mesh, view)).collect();
    let (met, all) = counts
        .iter()
        .fold((0, 0), |(m, a), (met, all)| (m + met, a + all));
    if all == 0 {
        0.0
    } else {
        met as f64 / all as f64
    }
}

/// How many of a view's rays meet the mesh, and how many there are.
fn rays_met(mesh: &Mesh, view: &View) -> (usize, usize) {
    let (across, down) = RAYS;
    let step = [
        f64::from(view.width) / f64::from(across),
        f64::from(view.height) / f64::from(down),
    ];
    let ray = |i: u32| {
        let pixel = Pixel::new(
            (f64::from(i % across) + 0.5) * step[0],
            (f64::from(i / across) + 0.5) * step[1],
        );
        view.lens.unproject(pixel)
    };
    let rays: Vec<Option<DVec3>> = (0..across * down).map(ray).collect();
    let mut is_met = vec![false; rays.len()];
    // A corner that is not finite projects to nothing and is met by nothing.
    let in_camera: Vec<DVec3> = mesh
        .positions
        .iter()
        .map(|p| view.camera_from_world * *p)
        .collect();
    let pixels: Vec<Option<Pixel>> = in_camera.iter().map(|p| view.lens.project(*p)).collect();
    for triangle in &mesh.triangles {
        let corners = triangle.map(|i| in_camera[i as usize]);
        let [a, b, c] = corners;
        let inwards = [a.cross(b), b.cross(c), c.cross(a)];
        let normal = (b - a).cross(c - a);
        let mut try_ray = |i: usize| {
            let Some(ray) = rays[i].filter(|_| !is_met[i]) else {
                return;
            };
            let sides = inwards.map(|side| side.dot(ray));
            let is_through = sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0);
            is_met[i] = is_through && normal.dot(a) / normal.dot(ray) > 0.0;
        };
        // Rays within the corners' bounding box, or all if a corner is out of sight. A lens
        // may bend a side out of the box: by less than a ray's distance, for most.
        let [Some(p), Some(q), Some(r)] = triangle.map(|i| pixels[i as usize]) else {
            if corners.iter().any(|p| p.z > 0.0) {
                (0..rays.len()).for_each(&mut try_ray);
            }
            continue;
        };
        let cells = |at: [f64; 3], step: f64, end: u32| {
            let low = at.iter().copied().fold(f64::INFINITY, f64::min) / step - 0.5;
            let high = at.iter().copied().fold(f64::NEG_INFINITY, f64::max) / step - 0.5;
            low.ceil().max(0.0) as usize..((high.floor() + 1.0).max(0.0) as usize).min(end as usize)
        };
        let columns = cells([p.x, q.x, r.x], step[0], across);
        for row in cells([p.y, q.y, r.y], step[1], down) {
            for column in columns.clone() {
                try_ray(row * across as usize + column);
            }
        }
    }
    let met = is_met.iter().filter(|m| **m).count();
    (met, rays.iter().flatten().count())
}
