//! Time and fit of visual hulls: `cargo bench -p proxy --bench hull [-- CAPTURE …]`; see
//! benches/README.md.

use calibrate::{View, colmap};
use cpu_time::ProcessTime;
use proxy::hull::{Options, Silhouette, carve, turntable};
use std::path::{Path, PathBuf};
use std::time::Instant;

const PHOTOS: usize = 40;
/// Repeats, of which the median counts.
const REPEATS: usize = 5;

/// The tolerances and misses of the curve.
const TOLERANCES_PX: [f64; 4] = [0.0, 1.0, 2.0, 3.0];
const MISSES: [u16; 4] = [0, 1, 2, 3];

fn main() {
    let given: Vec<PathBuf> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with("--"))
        .map(PathBuf::from)
        .collect();
    if given.is_empty() {
        car();
    }
    for folder in given {
        curve(&folder);
    }
}

/// Time and fit of the synthetic car.
fn car() {
    let scene = datasets::Options {
        size: Some((640, 480)),
        views: Some(PHOTOS),
        samples_per_side: Some(1),
    };
    let car = datasets::by_name("car", &scene).expect("the car is built in");
    let views: Vec<View> = car.photos.iter().map(|p| p.view.clone()).collect();
    let silhouettes: Vec<Silhouette> = views
        .iter()
        .map(|view| {
            let depth = datasets::render_depth(&car.scene, view);
            let inside = depth.iter().map(|z| z.is_finite()).collect();
            Silhouette::new(view.width, view.height, inside).expect("a depth a pixel")
        })
        .collect();
    println!("{PHOTOS} masks of 640 × 480; median of {REPEATS}\n");
    println!(
        "{:28}{:>10}{:>10}{:>8}{:>11}{:>8}",
        "", "CPU ms", "wall ms", "faces", "coverage", "IoU"
    );
    for (name, faces) in [("as carved", None), ("500 faces", Some(500))] {
        let options = Options {
            faces,
            ..Options::default()
        };
        let hull = carve(&views, &silhouettes, &options).expect("the car has a hull");
        let (cpu, wall) = timed(|| drop(carve(&views, &silhouettes, &options)));
        let m = hull.measures;
        println!(
            "{name:28}{cpu:>10.0}{wall:>10.0}{:>8}{:>11.5}{:>8.4}",
            m.faces, m.coverage, m.iou
        );
    }
    let step_degrees = 360.0 / PHOTOS as f64;
    let (cpu, wall) = timed(|| drop(turntable(&silhouettes, step_degrees)));
    println!("{:28}{cpu:>10.0}{wall:>10.0}", "turntable");
}

/// Coverage and IoU of a capture's masks against tolerance and misses, and by default.
fn curve(folder: &Path) {
    let (views, silhouettes) = masked(folder);
    println!("{}: {} masks", folder.display(), views.len());
    println!(
        "{:>14}{:>10}{:>11}{:>9}{:>9}{:>11}{:>9}{:>9}",
        "tolerance px", "misses", "coverage", "IoU", "faces", "coverage", "IoU", "CPU ms"
    );
    // The last line is the default, whatever it settles on.
    let settings = TOLERANCES_PX.iter().flat_map(|t| MISSES.map(|m| (*t, m)));
    let settings = settings.map(|(tolerance_px, misses)| Options {
        tolerance_px,
        misses,
        least_coverage: 0.0,
        ..Options::default()
    });
    for options in settings.chain([Options::default()]) {
        let cpu = ProcessTime::now();
        let hull = carve(&views, &silhouettes, &options);
        let cpu = cpu.elapsed().as_secs_f64() * 1e3;
        match hull {
            Ok(hull) => println!(
                "{:>14}{:>10}{:>11.4}{:>9.4}{:>9}{:>11.4}{:>9.4}{cpu:>9.0}",
                hull.tolerance_px,
                hull.misses,
                hull.carved.coverage,
                hull.carved.iou,
                hull.measures.faces,
                hull.measures.coverage,
                hull.measures.iou,
            ),
            Err(error) => {
                println!(
                    "{:>14}{:>10}  {error}",
                    options.tolerance_px, options.misses
                );
            }
        }
    }
}

/// The photos of a capture, but those held out, with the silhouettes in its `masks`.
fn masked(folder: &Path) -> (Vec<View>, Vec<Silhouette>) {
    let model = colmap::read_model(&folder.join("sparse/0")).expect("a COLMAP model in sparse/0");
    let split = std::fs::read_to_string(folder.join("split.json")).unwrap_or_default();
    let images = model.images.values();
    let used = images.filter(|image| !split.contains(&format!("\"{}\"", image.name)));
    let masked = used.map(|image| {
        let masks = folder.join("masks");
        let as_colmap = masks.join(format!("{}.png", image.name));
        let file = match as_colmap.exists() {
            true => as_colmap,
            false => masks.join(Path::new(&image.name).with_extension("png")),
        };
        let mask = image::open(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        let mask = mask.into_luma8();
        let (width, height) = mask.dimensions();
        let view = View {
            lens: model.cameras[&image.camera_id].lens().expect("a lens"),
            width,
            height,
            camera_from_world: image.camera_from_world,
        };
        let silhouette = Silhouette::from_values(width, height, mask.as_raw());
        (view, silhouette.expect("a value a pixel"))
    });
    masked.unzip()
}

/// CPU and wall time in milliseconds.
fn timed(work: impl Fn()) -> (f64, f64) {
    let mut times: Vec<(f64, f64)> = (0..REPEATS)
        .map(|_| {
            let (cpu, wall) = (ProcessTime::now(), Instant::now());
            work();
            (
                cpu.elapsed().as_secs_f64() * 1e3,
                wall.elapsed().as_secs_f64() * 1e3,
            )
        })
        .collect();
    times.sort_by(|a, b| a.0.total_cmp(&b.0));
    times[REPEATS / 2]
}
