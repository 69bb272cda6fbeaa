//! Carves captures and says how well: `cargo run --release -p proxy --example carve -- CAPTURE…
//! [key=value…]`. Keys: `lines`, `softness`, `behind` and `quality` are the options; `smooth` is
//! the share of the way that vertices move to their neighbours' mean; `pictures=1` scores
//! held-out photos, 240 pixels wide or high, by a plain blending; `out` is a folder for depth
//! pictures and PLY files.
//!
//! Held out: every tenth point, and the photos that `split.json` names.

mod bvh;
mod picture;

use bvh::Bvh;
use calibrate::{Pixel, Reconstruction, View, colmap};
use glam::DVec3;
use proxy::{Mesh, SparsePoint, carve};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

fn main() {
    let mut options = carve::Options::default();
    let (mut captures, mut out, mut pictures, mut smooth) = (Vec::new(), None, false, 0.0);
    for argument in std::env::args().skip(1) {
        let Some((key, value)) = argument.split_once('=') else {
            captures.push(PathBuf::from(argument));
            continue;
        };
        let number = || value.parse::<f64>().expect("a number");
        match key {
            "lines" => options.lines_per_point = number() as usize,
            "softness" => options.softness = number(),
            "behind" => options.behind = number(),
            "quality" => options.quality = number(),
            "smooth" => smooth = number(),
            "pictures" => pictures = number() > 0.0,
            "out" => out = Some(PathBuf::from(value)),
            _ => panic!("unknown key {key}"),
        }
    }
    for capture in captures {
        one(&capture, &options, smooth, pictures, out.as_deref());
    }
}

fn one(capture: &Path, options: &carve::Options, smooth: f64, pictures: bool, out: Option<&Path>) {
    let name = capture.file_name().unwrap().to_string_lossy().into_owned();
    let model = colmap::read_model(&capture.join("sparse/0")).unwrap();
    let split = std::fs::read_to_string(capture.join("split.json")).unwrap_or_default();
    let test: BTreeSet<String> = model
        .images
        .values()
        .map(|i| i.name.clone())
        .filter(|n| split.contains(&format!("\"{n}\"")))
        .collect();
    let rest = model.without_images(&test);
    let views = |model: &Reconstruction, keep: &dyn Fn(&str) -> bool| -> Vec<(String, View)> {
        let images = model.images.values().filter(|i| keep(&i.name));
        images
            .map(|image| {
                let camera = &model.cameras[&image.camera_id];
                let view = View {
                    lens: camera.lens().unwrap(),
                    width: camera.width,
                    height: camera.height,
                    camera_from_world: image.camera_from_world,
                };
                (image.name.clone(), view)
            })
            .collect()
    };
    let named = views(&rest, &|_| true);
    let held_out = views(&model, &|n| test.contains(n));
    let sources: Vec<View> = named.iter().map(|(_, v)| v.clone()).collect();
    let index: Vec<_> = rest.images.keys().copied().collect();
    let all: Vec<SparsePoint> = rest
        .points
        .values()
        .map(|p| {
            let seen: BTreeSet<u32> = p
                .track
                .iter()
                .map(|(id, _)| index.binary_search(id).unwrap() as u32)
                .collect();
            SparsePoint {
                position: p.position,
                seen_by: seen.into_iter().collect(),
            }
        })
        .collect();
    let (withheld, used): (Vec<_>, Vec<_>) = all
        .iter()
        .cloned()
        .enumerate()
        .partition(|(i, _)| i % 10 == 3);
    let [withheld, used] = [withheld, used]
        .map(|v: Vec<(usize, SparsePoint)>| v.into_iter().map(|(_, p)| p).collect::<Vec<_>>());

    let start = Instant::now();
    let mut mesh = carve::surface(&sources, &used, options).unwrap();
    let took = start.elapsed();
    smoothen(&mut mesh, smooth);
    let bvh = Bvh::new(&mesh);

    // 1. Withheld points: inverse depth of the mesh over that of the point.
    let mut errors: Vec<f64> = withheld
        .par_iter()
        .flat_map_iter(|point| {
            let bvh = &bvh;
            let sources = &sources;
            point.seen_by.iter().map(move |&i| {
                let center = sources[i as usize].center();
                let hit = bvh.hit(center, point.position - center);
                hit.map_or(f64::INFINITY, |(along, _)| (1.0 / along - 1.0).abs())
            })
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    let at = |share: f64| 100.0 * errors[((errors.len() - 1) as f64 * share) as usize];
    let mean_log =
        errors.iter().map(|e| (1.0 + e.min(1e3)).ln()).sum::<f64>() / errors.len() as f64;

    // 2. Coverage.
    let every: Vec<&View> = sources
        .iter()
        .chain(held_out.iter().map(|(_, v)| v))
        .collect();
    let (hit, asked) = every
        .par_iter()
        .map(|view| {
            let mut counts = (0, 0);
            for y in 0..24 {
                for x in 0..32 {
                    let pixel = Pixel::new(
                        (f64::from(x) + 0.5) / 32.0 * f64::from(view.width),
                        (f64::from(y) + 0.5) / 24.0 * f64::from(view.height),
                    );
                    let Some(ray) = view.lens.unproject(pixel) else {
                        continue;
                    };
                    let ray = view.camera_from_world.rotation.conjugate() * ray;
                    counts.1 += 1;
                    counts.0 += usize::from(bvh.hit(view.center(), ray).is_some());
                }
            }
            counts
        })
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    println!(
        "{name:18} {} points, {} facets, {:.2} s; withheld: median {:.2} %, 75 % {:.2} %, 90 % {:.1} %, 95 % {:.1} %, mean log {mean_log:.4}; missed {} of {asked}",
        used.len(),
        mesh.triangles.len(),
        took.as_secs_f64(),
        at(0.5),
        at(0.75),
        at(0.9),
        at(0.95),
        asked - hit,
    );
    if pictures {
        let photos = capture.join("images");
        let shell = proxy::shell(&sources, &used);
        let proxies = [&bvh, &Bvh::new(&shell)];
        picture::score(&photos, &named, &held_out, proxies, &all);
    }
    if let Some(out) = out {
        std::fs::create_dir_all(out).unwrap();
        std::fs::write(out.join(format!("{name}.ply")), ply(&mesh)).unwrap();
        for (i, (_, view)) in held_out.iter().enumerate() {
            picture::depth(view, &bvh, &mesh, &out.join(format!("{name}-h{i}.png")));
        }
        for i in [0, sources.len() / 2] {
            picture::depth(
                &sources[i],
                &bvh,
                &mesh,
                &out.join(format!("{name}-{i}.png")),
            );
        }
    }
}

/// Moves each vertex towards its neighbours' mean by a share of the way.
fn smoothen(mesh: &mut Mesh, share: f64) {
    let mut sums = vec![(DVec3::ZERO, 0.0); mesh.positions.len()];
    for t in &mesh.triangles {
        for k in 0..3 {
            let sum = &mut sums[t[k] as usize];
            sum.0 += mesh.positions[t[(k + 1) % 3] as usize];
            sum.1 += 1.0;
        }
    }
    for (position, (sum, count)) in mesh.positions.iter_mut().zip(sums) {
        *position = position.lerp(sum / count, share);
    }
}

fn ply(mesh: &Mesh) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.positions.len(),
        mesh.triangles.len()
    );
    for DVec3 { x, y, z } in &mesh.positions {
        writeln!(text, "{x} {y} {z}").unwrap();
    }
    for [a, b, c] in &mesh.triangles {
        writeln!(text, "3 {a} {b} {c}").unwrap();
    }
    text
}
