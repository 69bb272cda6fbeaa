//! Photos and depth maps of a scene.

use crate::Scene;
use crate::scene::Seen;
use crate::shading::Light;
use calibrate::{DepthAlong, Pixel, View};
use glam::DVec3;
use image::RgbaImage;
use rayon::prelude::*;

/// A photo: each pixel is the mean, in linear light, of `samples_per_side`² rays spread
/// evenly over it, stored as sRGB. Alpha is the part of them that met something. The
/// same bytes come out whatever the number of threads.
pub fn render_view(scene: &Scene, view: &View, samples_per_side: u32) -> RgbaImage {
    render_through(scene, view, samples_per_side, &LensRays::of(view))
}

/// [`render_view`] with the lens' rays at hand: photos through one lens share them.
pub(crate) fn render_through(
    scene: &Scene,
    view: &View,
    samples_per_side: u32,
    lens_rays: &LensRays,
) -> RgbaImage {
    let (width, height) = (view.width, view.height);
    let side = samples_per_side.max(1);
    let order = scene.by_distance(view.center());
    let mut bytes = vec![0_u8; 4 * width as usize * height as usize];
    bytes
        .par_chunks_mut(4 * width.max(1) as usize)
        .enumerate()
        .for_each(|(row, out)| {
            let (mut rays, mut found) = (Vec::new(), Found::default());
            for (column, rgba) in out.chunks_exact_mut(4).enumerate() {
                lens_rays.rays_within(view, column, row, side, &mut rays);
                let (mean, hits) = mean_color(scene, view, &order, &mut rays, &mut found);
                if hits > 0 {
                    rgba[..3].copy_from_slice(&srgb_from_linear(mean.to_array()));
                    let coverage = f64::from(hits) / f64::from(side * side);
                    rgba[3] = (255.0 * coverage).round() as u8;
                }
            }
        });
    RgbaImage::from_raw(width, height, bytes).expect("four bytes a pixel")
}

/// What a pixel's rays find: the lists are there for the next pixel's.
#[derive(Default)]
struct Found {
    /// The objects that they can meet, and how far away these are.
    candidates: Vec<(f64, usize)>,
    /// What each ray meets, and the ray.
    seen: Vec<(Seen, DVec3)>,
    /// The light at some of these places.
    lights: Vec<(usize, Light)>,
}

/// The mean colour that a pixel's rays (unit length, camera frame) see, and how many of
/// them meet something. `order` is the scene's, as the camera sees it.
fn mean_color(
    scene: &Scene,
    view: &View,
    order: &[(f64, usize)],
    rays: &mut [DVec3],
    found: &mut Found,
) -> (DVec3, u32) {
    let Found {
        candidates,
        seen,
        lights,
    } = found;
    let center = view.center();
    let world_from_camera = view.camera_from_world.rotation.conjugate();
    for ray in rays.iter_mut() {
        *ray = world_from_camera * *ray;
    }
    let Some(axis) = rays.iter().sum::<DVec3>().try_normalize() else {
        return (DVec3::ZERO, 0);
    };
    // 1. What can the rays meet, and what do they meet first?
    let sines = rays.iter().map(|ray| ray.cross(axis).length());
    let sin_angle = 1.001 * sines.fold(1e-12, f64::max);
    let near_axis = |i: usize| scene.placed[i].near_ray(center, axis, sin_angle, 0.0);
    candidates.clear();
    candidates.extend(order.iter().copied().filter(|o| near_axis(o.1)));
    seen.clear();
    seen.extend(
        rays.iter()
            .filter_map(|&ray| Some((scene.look_in_order(center, ray, candidates)?, ray))),
    );
    // 2. Light changes slowly over a surface: it is worked out once for each side of each
    // object in the pixel, at the ray nearest to the middle. Textures, highlights and
    // mirror images are not.
    let middle = seen.len() / 2;
    lights.clear();
    let mut sum = DVec3::ZERO;
    for k in 0..seen.len() {
        let i = (middle + k) % seen.len();
        let (place, ray) = &seen[i];
        let known = lights.iter().find(|(at, _)| {
            let other = &seen[*at].0;
            other.object_idx == place.object_idx
                && other.surface.face == place.surface.face
                && other.normal.dot(place.normal) > 0.98
                && other.point.distance(place.point) < 8.0 * sin_angle * place.distance
        });
        let light = match known {
            Some(&(_, light)) => light,
            None => {
                let light = scene.light(place);
                lights.push((i, light));
                light
            }
        };
        // A highlight is clipped before it is averaged: smoother edges.
        sum += scene.shade(place, *ray, light).min(DVec3::ONE);
    }
    (sum / seen.len().max(1) as f64, seen.len() as u32)
}

/// The rays through the centres and the corners of all pixels of a view, in its camera's
/// frame.
///
/// Inverting a distortion costs as much as tracing a ray. Within one pixel the lens is so
/// nearly linear that rays interpolated between its corners lie within 1e-6 px of the
/// true ones, which moves where a pixel is sampled, not what is found there.
pub(crate) struct LensRays {
    width: usize,
    centers: Vec<Option<DVec3>>,
    corners: Vec<Option<DVec3>>,
}

impl LensRays {
    pub(crate) fn of(view: &View) -> Self {
        let (width, height) = (view.width as usize, view.height as usize);
        let rays = |columns: usize, rows: usize, at: f64| {
            (0..columns * rows)
                .into_par_iter()
                .map(|i| {
                    let (column, row) = (i % columns, i / columns);
                    let pixel = Pixel::new(column as f64 + at, row as f64 + at);
                    view.lens.unproject(pixel)
                })
                .collect()
        };
        Self {
            width,
            centers: rays(width, height, 0.5),
            corners: rays(width + 1, height + 1, 0.0),
        }
    }

    /// `side`² rays spread evenly over a pixel; one alone is exact, and so are all where
    /// the lens does not reach all corners.
    fn rays_within(
        &self,
        view: &View,
        column: usize,
        row: usize,
        side: u32,
        rays: &mut Vec<DVec3>,
    ) {
        rays.clear();
        let within = |k: u32| (f64::from(k) + 0.5) / f64::from(side);
        let places = (0..side * side).map(|i| (within(i % side), within(i / side)));
        let top = row * (self.width + 1) + column;
        let bottom = top + self.width + 1;
        let corners = [top, top + 1, bottom, bottom + 1].map(|i| self.corners[i]);
        if let [Some(a), Some(b), Some(c), Some(d)] = corners
            && side > 1
        {
            rays.extend(places.map(|(x, y)| a.lerp(b, x).lerp(c.lerp(d, x), y).normalize()));
        } else {
            rays.extend(places.filter_map(|(x, y)| {
                let pixel = Pixel::new(column as f64 + x, row as f64 + y);
                view.lens.unproject(pixel)
            }));
        }
    }
}

/// The depth at every pixel's centre, along what [`DepthAlong`] says, row by row, in world
/// units; NaN where the pixel's ray meets nothing.
pub fn render_depth(scene: &Scene, view: &View) -> Vec<f64> {
    depth_through(scene, view, &LensRays::of(view))
}

/// [`render_depth`] with the lens' rays at hand.
pub(crate) fn depth_through(scene: &Scene, view: &View, lens_rays: &LensRays) -> Vec<f64> {
    let world_from_camera = view.camera_from_world.rotation.conjugate();
    let center = view.center();
    let order = scene.by_distance(center);
    let along = DepthAlong::of_view(view);
    lens_rays
        .centers
        .par_iter()
        .map(|ray| {
            let ray = (*ray)?;
            let seen = scene.look_in_order(center, world_from_camera * ray, &order)?;
            Some(along.depth(seen.distance * ray))
        })
        .map(|depth| depth.unwrap_or(f64::NAN))
        .collect()
}

/// The 8-bit sRGB code of linear light, clipped to what it can hold.
pub fn srgb_from_linear(linear: [f64; 3]) -> [u8; 3] {
    linear.map(|value| {
        let value = value.clamp(0.0, 1.0);
        let code = if value <= 0.003_130_8 {
            12.92 * value
        } else {
            1.055 * value.powf(1.0 / 2.4) - 0.055
        };
        (255.0 * code).round() as u8
    })
}
