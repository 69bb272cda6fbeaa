//! What tests and benches of surfaces share: captures with depth maps, and a mesh as a depth
//! map.
#![allow(dead_code, missing_docs, unreachable_pub)]

use calibrate::{Pixel, View, colmap};
use capture::DepthMap;
use proxy::{Mesh, MeshKind, Solid};
use std::path::{Path, PathBuf};

/// A capture with depth maps.
pub struct Capture {
    /// Those to fuse, then those held out: view and file of the depth map.
    pub used: Vec<(View, PathBuf)>,
    pub held_out: Vec<(View, PathBuf)>,
}

/// A folder of the captures, if it is there.
pub fn find_capture(name: &str) -> Option<PathBuf> {
    let captures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/captures");
    let folder = captures.join(name);
    if !folder.exists() {
        eprintln!("SKIPPED: {} is absent", folder.display());
        return None;
    }
    Some(folder)
}

pub fn capture(folder: &Path) -> Capture {
    let model = colmap::read_model(&folder.join("sparse/0")).unwrap();
    let split = std::fs::read_to_string(folder.join("split.json")).unwrap();
    let mut capture = Capture {
        used: Vec::new(),
        held_out: Vec::new(),
    };
    for image in model.images.values() {
        let camera = &model.cameras[&image.camera_id];
        let view = View {
            lens: camera.lens().unwrap(),
            width: camera.width,
            height: camera.height,
            camera_from_world: image.camera_from_world,
        };
        let stem = Path::new(&image.name).with_extension("png");
        let path = folder.join("depth").join(stem);
        if split.contains(&format!("\"{}\"", image.name)) {
            capture.held_out.push((view, path));
        } else {
            capture.used.push((view, path));
        }
    }
    capture
}

pub fn decode((view, path): &(View, PathBuf)) -> Result<(View, DepthMap), capture::CaptureError> {
    let map = capture::decode_depth(path, "", (view.width, view.height), 0.001)?;
    Ok((view.clone(), map))
}

/// The depth of the nearest triangle at each pixel's centre, infinite where there is none.
pub fn depth_of(mesh: &Mesh, view: &View) -> Vec<f64> {
    let solid = Solid::new(MeshKind::Mesh, mesh.clone());
    let center = view.center();
    let world_from_camera = view.camera_from_world.rotation.conjugate();
    let pixels = (0..view.height).flat_map(|y| (0..view.width).map(move |x| (x, y)));
    let depth = |(x, y): (u32, u32)| {
        let ray = view.lens.unproject(Pixel::center_of(x, y)).unwrap();
        let hit = solid.first_hit(center, world_from_camera * (ray / ray.z));
        hit.map_or(f64::INFINITY, |hit| hit.along)
    };
    pixels.map(depth).collect()
}

/// The share of depths held out that one of the depth maps used shows as well, within `near`:
/// no surface can have more.
pub fn shown(capture: &Capture, near: f64) -> f64 {
    let used: Vec<_> = capture.used.iter().map(|f| decode(f).unwrap()).collect();
    let (mut known, mut count) = (0, 0);
    for frame in &capture.held_out {
        let (view, depth) = decode(frame).unwrap();
        let world_from_camera = view.camera_from_world.inverse();
        for i in (0..depth.depths.len())
            .step_by(7)
            .filter(|i| depth.depths[*i] > 0.0)
        {
            let pixel = Pixel::center_of(i as u32 % view.width, i as u32 / view.width);
            let ray = view.lens.unproject(pixel).unwrap();
            let point = world_from_camera * (ray / ray.z * f64::from(depth.depths[i]));
            let is_shown = |(view, depth): &(View, DepthMap)| {
                let z = (view.camera_from_world * point).z;
                let pixel = view.project(point).filter(|p| view.contains(*p));
                pixel.is_some_and(|p| {
                    let (column, row) = (p.x as usize, p.y as usize);
                    let i = row * view.width as usize + column;
                    depth
                        .depths
                        .get(i)
                        .is_some_and(|d| (f64::from(*d) - z).abs() <= near)
                })
            };
            known += 1;
            count += usize::from(used.iter().any(is_shown));
        }
    }
    count as f64 / known as f64
}

/// How a surface compares with depth maps.
#[derive(Debug)]
pub struct Errors {
    /// Of depths where both have one: what is seen through holes included.
    pub mean: f64,
    /// Of those within `near`.
    pub mean_near: f64,
    pub median: f64,
    pub percentile_95: f64,
    /// The share of known depths that the surface meets within `near`.
    pub complete: f64,
    /// The share of known depths before which the surface has something else.
    pub in_front: f64,
    /// The share of known depths where the surface has nothing.
    pub missing: f64,
}

pub fn errors(mesh: &Mesh, truth: &[(View, PathBuf)], near: f64) -> Errors {
    let (mut errors, mut known, mut complete, mut in_front) = (Vec::new(), 0, 0, 0);
    for frame in truth {
        let (view, depth) = decode(frame).unwrap();
        let found = depth_of(mesh, &view);
        for (found, truth) in found.iter().zip(&depth.depths) {
            let truth = f64::from(*truth);
            if truth <= 0.0 {
                continue;
            }
            known += 1;
            complete += usize::from((found - truth).abs() <= near);
            in_front += usize::from(*found < truth - near);
            if found.is_finite() {
                errors.push((found - truth).abs());
            }
        }
    }
    errors.sort_by(f64::total_cmp);
    let share = |n: usize| n as f64 / known as f64;
    Errors {
        mean: errors.iter().sum::<f64>() / errors.len() as f64,
        mean_near: errors[..complete].iter().sum::<f64>() / complete as f64,
        median: errors[errors.len() / 2],
        percentile_95: errors[errors.len() * 95 / 100],
        complete: share(complete),
        in_front: share(in_front),
        missing: 1.0 - share(errors.len()),
    }
}
