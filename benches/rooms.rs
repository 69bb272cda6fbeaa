//! From a capture with depth maps to the first picture of a walk, stage by stage, with its photos given
//! once and several times over: `cargo bench --bench rooms -- CAPTURE … [--times 1,2,4]`; see README.md.

use calibrate::{Camera, ImageId, Lens, colmap};
use clap::Parser;
use cpu_time::ProcessTime;
use glam::{DVec2, DVec3};
use lumigraph::scene::Scene;
use proxy::interior::Contents;
use proxy::interior::find::FindOptions;
use proxy::mesh::{model_to_glb, parse_model};
use proxy::{MeshKind, Proxy, Solid};
use render::interior::{Captured, Painter, PortalFill, Tour, Walk, WalkOptions};
use render::{DeviceChoice, Engine, FieldOptions, Method};
use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Measures what an interior of a capture takes.
#[derive(Parser)]
struct Args {
    /// Captures with depth maps: folders with images, depth and sparse/0
    captures: Vec<PathBuf>,
    /// How often each photo is given
    #[arg(long, value_delimiter = ',', default_value = "1")]
    times: Vec<usize>,
    /// What cargo passes
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    println!("capture, photos, triangles, bytes of the model | stage: wall s, CPU s, peak MB | …");
    for capture in &args.captures {
        for times in &args.times {
            let folder = tempfile::tempdir()?;
            let given = several(capture, *times, folder.path())?;
            measure(capture, &given)?;
        }
    }
    Ok(())
}

/// A capture whose photos are there several times, by links.
fn several(capture: &Path, times: usize, into: &Path) -> Result<PathBuf, Box<dyn Error>> {
    let capture = capture.canonicalize()?;
    let model = colmap::read_model(&capture.join("sparse/0"))?;
    let mut images = BTreeMap::new();
    for folder in ["images", "depth", "sparse/0"] {
        fs::create_dir_all(into.join(folder))?;
    }
    for copy in 0..times {
        for image in model.images.values() {
            let mut image = image.clone();
            let name = format!("{copy}_{}", image.name);
            let depth = |name: &str| Path::new("depth").join(Path::new(name).with_extension("png"));
            for (from, to) in [
                (
                    Path::new("images").join(&image.name),
                    Path::new("images").join(&name),
                ),
                (depth(&image.name), depth(&name)),
            ] {
                std::os::unix::fs::symlink(capture.join(from), into.join(to))?;
            }
            // There are no points.
            image.keypoints.clear();
            image.name = name;
            images.insert(ImageId(images.len() as u32 + 1), image);
        }
    }
    let whole = calibrate::Reconstruction {
        images,
        points: BTreeMap::new(),
        ..model
    };
    colmap::write_binary(&whole, &into.join("sparse/0"))?;
    Ok(into.to_owned())
}

/// What a stage took.
fn stage<T>(name: &str, run: impl FnOnce() -> T) -> T {
    let (cpu, wall) = (ProcessTime::now(), Instant::now());
    // Resets the peak.
    let _ = fs::write("/proc/self/clear_refs", "5");
    let made = run();
    let (cpu, wall) = (cpu.elapsed().as_secs_f64(), wall.elapsed().as_secs_f64());
    print!(
        " | {name}: {wall:.2} {cpu:.2} {:.0}",
        resident("VmHWM:") / 1e6
    );
    made
}

fn measure(capture: &Path, given: &Path) -> Result<(), Box<dyn Error>> {
    let none = BTreeSet::new();
    let name = capture.file_name().unwrap_or_default().to_string_lossy();
    let (scene, _) = Scene::open(given, false)?;
    print!("{name}, {}", scene.photos.len());
    let surface = stage("fused and coloured", || scene.surface(&none))?;
    let found = stage("rooms found", || {
        surface.rooms("model.glb", &FindOptions::default())
    })?;
    let bytes = stage("model written", || model_to_glb(&surface.model))?;
    drop(surface);
    let mut interior = found.interior;
    interior.show_photos(".");
    let start = Instant::now();
    let (mut model, mut contents) = stage("opened", || {
        let (model, _) = parse_model(Path::new("model.glb"), &bytes)?;
        let (contents, _) = Contents::new(&interior, &model)?;
        Ok::<_, Box<dyn Error>>((model, contents))
    })?;
    let triangles = model.mesh.triangles.len();
    let camera = Camera::of(
        &Lens::pinhole(DVec2::splat(448.0), DVec2::new(320.0, 256.0)),
        640,
        512,
    );
    let path = Tour::new(&interior, &contents, &model, &camera, 1500, 15.0)?.path;
    let walls = Solid::new(MeshKind::Mesh, model.mesh.clone());
    let eyes: Vec<DVec3> = path.frames.iter().map(|f| f.view.center()).collect();
    let crosses = |step: &&[DVec3]| {
        let hit = walls.first_hit(step[0], step[1] - step[0]);
        hit.is_some_and(|hit| hit.along <= 1.0)
    };
    let crossed = eyes.windows(2).filter(crosses).count();
    let steps = eyes.len() - 1;
    let painter = stage("photos made ready", || {
        let backdrop = scene.add_backdrop(&none, &mut model, &mut contents)?;
        let solid = Solid::new(MeshKind::Depth, model.mesh.clone());
        let lumigraph = scene.lumigraph(&none, Proxy::Mesh(Arc::new(solid)))?;
        let captured = Captured::new(
            lumigraph,
            Engine::open(DeviceChoice::Cpu)?,
            FieldOptions::default(),
            Method::Triangulated { cells_across: 32 },
            &interior,
            &contents,
            &model,
            backdrop,
        );
        captured.prepare();
        Ok::<_, Box<dyn Error>>(Painter::of_photos(captured))
    })?;
    let mut walk = Walk::with(
        painter,
        &interior,
        &contents,
        &model,
        WalkOptions::default(),
    );
    let first = &path.frames[0].view;
    stage("first picture", || walk.draw(first, PortalFill::Geometry))?;
    let shown = start.elapsed().as_secs_f64();
    stage("again", || walk.draw(first, PortalFill::Geometry))?;
    println!(
        " | {triangles} triangles, {:.1} MB, shown after {shown:.2} s, {crossed} of a tour's {steps} \
         steps through them",
        bytes.len() as f64 / 1e6
    );
    Ok(())
}

/// Memory of this process in bytes, where Linux says; else 0.
fn resident(which: &str) -> f64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix(which));
    let kibibytes = line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<f64>().ok());
    kibibytes.unwrap_or(0.0) * 1024.0
}
