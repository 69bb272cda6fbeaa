//! Carves captures and says how well: `cargo run --release -p proxy --example carve -- CAPTURE…
//! [key=value…]`. Keys: `lines`, `softness`, `behind` and `quality` are the options; `smooth` is
//! the share of the way that vertices move to their neighbours' mean. `lumigraph evaluate
//! CAPTURE --proxy carved` scores pictures.
//!
//! Held out: every tenth point, and the photos that `split.json` names.

use calibrate::{Reconstruction, View, colmap};
use glam::DVec3;
use proxy::{Mesh, MeshKind, Solid, SparsePoint, carve, mesh};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Instant;

fn main() {
    let mut options = carve::Options::default();
    let (mut captures, mut smooth) = (Vec::new(), 0.0);
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
            _ => panic!("unknown key {key}"),
        }
    }
    for capture in captures {
        one(&capture, &options, smooth);
    }
}

fn one(capture: &Path, options: &carve::Options, smooth: f64) {
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
    let views = |model: &Reconstruction, keep: &dyn Fn(&str) -> bool| -> Vec<View> {
        let images = model.images.values().filter(|i| keep(&i.name));
        let view = |image: &calibrate::Image| {
            let camera = &model.cameras[&image.camera_id];
            View {
                lens: camera.lens().unwrap(),
                width: camera.width,
                height: camera.height,
                camera_from_world: image.camera_from_world,
            }
        };
        images.map(view).collect()
    };
    let sources = views(&rest, &|_| true);
    let held_out = views(&model, &|n| test.contains(n));
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
    let mut mesh = carve::surface(&sources, &used, options).unwrap().mesh;
    let took = start.elapsed();
    smoothen(&mut mesh, smooth);
    let solid = Solid::new(MeshKind::Carved, mesh);

    // 1. Withheld points: inverse depth of the mesh over that of the point.
    let mut errors: Vec<f64> = withheld
        .par_iter()
        .flat_map_iter(|point| {
            let (solid, sources) = (&solid, &sources);
            point.seen_by.iter().map(move |&i| {
                let center = sources[i as usize].center();
                let hit = solid.first_hit(center, point.position - center);
                hit.map_or(f64::INFINITY, |hit| (1.0 / hit.along - 1.0).abs())
            })
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    let at = |share: f64| 100.0 * errors[((errors.len() - 1) as f64 * share) as usize];
    let mean_log =
        errors.iter().map(|e| (1.0 + e.min(1e3)).ln()).sum::<f64>() / errors.len() as f64;

    // 2. Coverage.
    let held_out = held_out.into_iter();
    let every: Vec<View> = sources.iter().cloned().chain(held_out).collect();
    let met = mesh::lies_where_cameras_look(&solid, &every);
    println!(
        "{name:18} {} points, {} facets, {:.2} s; withheld: median {:.2} %, 75 % {:.2} %, 90 % {:.1} %, 95 % {:.1} %, mean log {mean_log:.4}; {met:.4} of rays meet it",
        used.len(),
        solid.mesh().triangles.len(),
        took.as_secs_f64(),
        at(0.5),
        at(0.75),
        at(0.9),
        at(0.95),
    );
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
