//! Pictures of a mesh, and a plain blending of photos over it.

use crate::bvh::Bvh;
use calibrate::{Pixel, View};
use glam::DVec3;
use image::{Rgb, RgbImage};
use proxy::{Mesh, SparsePoint};
use rayon::prelude::*;
use std::path::Path;

/// Longer side of what is scored.
const SIDE: f64 = 240.0;

fn rays(view: &View) -> Vec<Option<DVec3>> {
    let pixels = (0..view.height).flat_map(|y| (0..view.width).map(move |x| (x, y)));
    pixels
        .map(|(x, y)| view.lens.unproject(Pixel::center_of(x, y)))
        .collect()
}

fn small(view: &View) -> View {
    let scale = SIDE / f64::from(view.width.max(view.height));
    view.resized(
        (f64::from(view.width) * scale) as u32,
        (f64::from(view.height) * scale) as u32,
    )
}

/// Inverse depth as grey from black to white, shaded by the facets' normals; facets seen from
/// behind are red.
pub(crate) fn depth(view: &View, bvh: &Bvh<'_>, mesh: &Mesh, file: &Path) {
    let scale = 640.0 / f64::from(view.width.max(view.height));
    let view = view.resized(
        (f64::from(view.width) * scale) as u32,
        (f64::from(view.height) * scale) as u32,
    );
    let world_from_camera = view.camera_from_world.rotation.conjugate();
    let hits: Vec<Option<(f64, f64)>> = rays(&view)
        .into_par_iter()
        .map(|ray| {
            let ray = world_from_camera * ray?.normalize();
            let (along, t) = bvh.hit(view.center(), ray)?;
            let [a, b, c] = mesh.corners(t as usize);
            let facing = -(b - a).cross(c - a).normalize().dot(ray);
            Some((1.0 / along, facing))
        })
        .collect();
    let mut sorted: Vec<f64> = hits.iter().flatten().map(|h| h.0).collect();
    sorted.sort_by(f64::total_cmp);
    let top = sorted[sorted.len() * 98 / 100];
    let picture = RgbImage::from_fn(view.width, view.height, |x, y| {
        match hits[(y * view.width + x) as usize] {
            None => Rgb([255, 0, 255]),
            Some((inverse, facing)) => {
                let depth = (inverse / top).min(1.0).sqrt();
                let shade = 0.35 + 0.65 * facing.abs();
                let level =
                    |low: f64, high: f64| (255.0 * shade * (low + (high - low) * depth)) as u8;
                if facing < 0.0 {
                    Rgb([255, level(0.0, 0.5), 0])
                } else {
                    Rgb([level(0.1, 1.0), level(0.2, 0.9), level(0.6, 0.4)])
                }
            }
        }
    });
    picture.save(file).unwrap();
}

/// PSNR of held-out photos over the mesh and over the proxy of points.
pub(crate) fn score(
    folder: &Path,
    named: &[(String, View)],
    held_out: &[(String, View)],
    [bvh, shell]: [&Bvh<'_>; 2],
    points: &[SparsePoint],
) {
    let sources: Vec<View> = named.iter().map(|(_, view)| view.clone()).collect();
    let load = |(name, view): &(String, View)| {
        let view = small(view);
        let photo = image::open(folder.join(name)).unwrap().to_rgb8();
        let photo = image::imageops::resize(
            &photo,
            view.width,
            view.height,
            image::imageops::FilterType::Triangle,
        );
        (view, photo)
    };
    let photos: Vec<(View, RgbImage)> = named.par_iter().map(load).collect();
    let wanted: Vec<(View, RgbImage)> = held_out.par_iter().map(load).collect();
    let (mut carved, mut sparse, mut shelled) = (Vec::new(), Vec::new(), Vec::new());
    for (view, truth) in &wanted {
        let world_from_camera = view.camera_from_world.rotation.conjugate();
        let center = view.center();
        let over_mesh = |ray: DVec3| {
            let ray = world_from_camera * ray;
            bvh.hit(center, ray).map(|(along, _)| center + ray * along)
        };
        carved.push(psnr(view, truth, &photos, over_mesh, Some(bvh)));
        let over_shell = |ray: DVec3| {
            let ray = world_from_camera * ray;
            shell
                .hit(center, ray)
                .map(|(along, _)| center + ray * along)
        };
        shelled.push(psnr(view, truth, &photos, over_shell, Some(shell)));
        let facets = proxy::points::facets(view, &sources, points);
        if let Some(facets) = facets {
            let over_points = |ray: DVec3| {
                let q = facets.planes[facets.locate(ray, 0) as usize];
                let s = q.dot(ray);
                (s > 0.0).then(|| center + world_from_camera * ray / s)
            };
            sparse.push(psnr(view, truth, &photos, over_points, None));
        }
    }
    let mean =
        |v: &[[f64; 3]]| [0, 1, 2].map(|k| v.iter().map(|r| r[k]).sum::<f64>() / v.len() as f64);
    println!(
        "{:18} PSNR, of covered, coverage: carved {:.2?}, points {:.2?}, shell {:.2?}",
        "",
        mean(&carved),
        mean(&sparse),
        mean(&shelled)
    );
}

fn psnr(
    view: &View,
    truth: &RgbImage,
    photos: &[(View, RgbImage)],
    surface: impl Fn(DVec3) -> Option<DVec3> + Sync,
    mesh: Option<&Bvh<'_>>,
) -> [f64; 3] {
    let blended: Vec<Option<[f64; 3]>> = rays(view)
        .into_par_iter()
        .map(|ray| blend(ray.and_then(&surface)?, view.center(), photos, mesh))
        .collect();
    let covered = blended.iter().flatten().count() as f64;
    let colours: Vec<[f64; 3]> = blended.iter().map(|c| c.unwrap_or_default()).collect();
    let square = |(c, t): (&[f64; 3], &Rgb<u8>)| {
        (0..3)
            .map(|k| (c[k] - f64::from(t.0[k])).powi(2))
            .sum::<f64>()
    };
    let squares = colours.iter().zip(truth.pixels()).map(square);
    let inside = blended
        .iter()
        .zip(truth.pixels())
        .filter_map(|(c, t)| Some(square((c.as_ref()?, t))));
    let db = |squares: f64, count: f64| 10.0 * (255.0 * 255.0 * 3.0 * count / squares).log10();
    let count = colours.len() as f64;
    [
        db(squares.sum(), count),
        db(inside.sum(), covered),
        covered / count,
    ]
}

/// Buehler's blend of the five photos with the smallest angles that see a place.
fn blend(
    place: DVec3,
    desired: DVec3,
    photos: &[(View, RgbImage)],
    mesh: Option<&Bvh<'_>>,
) -> Option<[f64; 3]> {
    let here = place - desired;
    let mut best: Vec<(f64, usize, Pixel)> = photos
        .iter()
        .enumerate()
        .filter_map(|(i, (view, _))| {
            let pixel = view.project(place).filter(|p| view.contains(*p))?;
            let there = place - view.center();
            Some((
                there.cross(here).length().atan2(there.dot(here)) + 1e-6,
                i,
                pixel,
            ))
        })
        .collect();
    best.sort_by(|a, b| a.0.total_cmp(&b.0));
    let sees = |(_, i, _): &(f64, usize, Pixel)| {
        let center = photos[*i].0.center();
        mesh.and_then(|m| m.hit(center, place - center))
            .is_none_or(|(along, _)| along > 0.98)
    };
    let best: Vec<_> = best.into_iter().filter(sees).take(6).collect();
    let limit = if best.len() > 5 {
        best[5].0
    } else {
        f64::INFINITY
    };
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for (angle, i, pixel) in best {
        let weight = (1.0 - angle / limit).max(0.0) / angle;
        let photo = &photos[i].1;
        let (x, y) = (pixel.x - 0.5, pixel.y - 0.5);
        let (fx, fy) = (x - x.floor(), y - y.floor());
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let px = (x.floor() as i64 + dx).clamp(0, i64::from(photo.width()) - 1) as u32;
            let py = (y.floor() as i64 + dy).clamp(0, i64::from(photo.height()) - 1) as u32;
            let share =
                weight * if dx == 0 { 1.0 - fx } else { fx } * if dy == 0 { 1.0 - fy } else { fy };
            for k in 0..3 {
                sum[k] += share * f64::from(photo.get_pixel(px, py).0[k]);
            }
            total += share;
        }
    }
    (total > 0.0).then(|| sum.map(|c| c / total))
}
