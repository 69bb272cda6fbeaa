//! Time and error of one frame: `cargo bench --bench frame [-- CAPTURE…]`; see README.md.

use calibrate::{Lens, View};
use cpu_time::ProcessTime;
use datasets::Options;
use glam::DVec2;
use image::RgbaImage;
use lumigraph::scene::Scene;
use render::cpu::Cpu;
use render::gpu::Gpu;
use render::score::score;
use render::{
    FieldOptions, Frame, Lumigraph, Method, PhotoStore, SourceView, TriangulatedField, reference,
};
use std::collections::BTreeSet;
use std::path::Path;
use std::time::{Duration, Instant};

/// What every engine is asked for.
const SIZE: (u32, u32) = (960, 720);
/// Photos at most, so that captures compare.
const PHOTOS: usize = 17;
/// Interleaved repeats, of which the median counts.
const REPEATS: usize = 7;

fn main() {
    // Cargo passes `--bench`.
    let captures: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with('-'))
        .collect();
    let mut gpu = Gpu::open().ok();
    match &gpu {
        Some(gpu) => println!("graphics: {}", gpu.description()),
        None => println!("graphics: none"),
    }
    println!(
        "{} × {}, up to {PHOTOS} photos; CPU ms / wall ms, median of {REPEATS}; \
         dB of the triangulated picture against the exact one\n",
        SIZE.0, SIZE.1
    );
    let head = [
        "cpu exact",
        "cpu triang.",
        "field",
        "gpu triang.",
        "gpu exact",
        "reference",
    ];
    print!("{:34}", "");
    head.iter().for_each(|name| print!("{name:>15}"));
    println!("{:>10}", "dB");

    if captures.is_empty() {
        measure("shelf", &shelf(), &mut gpu);
    }
    for capture in captures {
        match open(Path::new(&capture)) {
            Ok(lumigraph) => measure(&capture, &lumigraph, &mut gpu),
            Err(error) => println!("{capture}: {error}"),
        }
    }
}

/// The synthetic still life with as many photos as [`PHOTOS`], each 1000 × 750.
fn shelf() -> Lumigraph {
    let options = Options {
        size: Some((1000, 750)),
        views: Some(PHOTOS),
        samples_per_side: Some(1),
    };
    let dataset = datasets::by_name("shelf", &options).expect("the shelf is built in");
    let picture = |p: &datasets::Photo| datasets::render_view(&dataset.scene, &p.view, 1);
    let photos: Vec<RgbaImage> = dataset.photos.iter().map(picture).collect();
    let source = |p: &datasets::Photo| SourceView {
        name: p.name.clone(),
        view: p.view.clone(),
        gain: [1.0; 3],
        time_s: None,
        quarters: 0,
    };
    Lumigraph {
        points: Vec::new(),
        sources: dataset.photos.iter().map(source).collect(),
        photos: PhotoStore::from_images(photos),
        proxy: proxy::Proxy::Plane(
            proxy::fit_plane(&dataset.reconstruction)
                .expect("the shelf has points")
                .plane,
        ),
        visibility: None,
    }
}

/// The first photos of a capture.
fn open(capture: &Path) -> Result<Lumigraph, Box<dyn std::error::Error>> {
    let (scene, _) = Scene::open(capture, false)?;
    let rest: BTreeSet<String> = scene.names().into_iter().skip(PHOTOS).collect();
    let proxy = proxy::Proxy::Plane(scene.fit_plane(&rest)?.plane);
    Ok(scene.lumigraph(&rest, proxy)?)
}

/// Midway between the two middle photos, and at 1 % of their baseline from one.
fn desired_views(lumigraph: &Lumigraph) -> [(&'static str, View); 2] {
    let middle = lumigraph.sources.len() / 2;
    let a = &lumigraph.sources[middle - 1].view;
    let b = &lumigraph.sources[middle].view;
    let between = |t: f64| {
        let size = DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1));
        let scale = (size / DVec2::new(f64::from(a.width), f64::from(a.height))).min_element();
        View {
            lens: Lens::pinhole(DVec2::splat(a.lens.mean_focal() * scale), 0.5 * size),
            width: SIZE.0,
            height: SIZE.1,
            ..a.between(b, t)
        }
    };
    [("midway", between(0.5)), ("1 %", between(0.01))]
}

fn measure(name: &str, lumigraph: &Lumigraph, gpu: &mut Option<Gpu>) {
    for (which, desired) in desired_views(lumigraph) {
        let frame = Frame::new(lumigraph, desired, FieldOptions::default());
        let Method::Triangulated { cells_across } = Method::TRIANGULATED else {
            return;
        };
        let mut cpu = Cpu::default();
        let exact = cpu
            .render(&frame, Method::Exact)
            .expect("the photos decode");
        let triangulated = cpu
            .render(&frame, Method::TRIANGULATED)
            .expect("the photos decode");
        if let Some(gpu) = gpu {
            // The first frame makes pipelines and uploads photos.
            gpu.render(&frame, Method::Exact).expect("the device draws");
            gpu.render(&frame, Method::TRIANGULATED)
                .expect("the device draws");
        }
        let mut times: [Vec<(Duration, Duration)>; 6] = Default::default();
        for repeat in 0..REPEATS {
            times[0].push(timed(|| drop(cpu.render(&frame, Method::Exact))));
            times[1].push(timed(|| drop(cpu.render(&frame, Method::TRIANGULATED))));
            times[2].push(timed(|| drop(TriangulatedField::new(&frame, cells_across))));
            if let Some(gpu) = gpu {
                times[3].push(timed(|| drop(gpu.render(&frame, Method::TRIANGULATED))));
                times[4].push(timed(|| drop(gpu.render(&frame, Method::Exact))));
            }
            if repeat == 0 {
                times[5].push(timed(|| drop(reference::render_exact(&frame))));
            }
        }
        let psnr = score(&triangulated, &exact).map_or(f64::NAN, |s| s.psnr);
        let short = Path::new(name)
            .file_name()
            .unwrap_or_default()
            .to_string_lossy();
        print!(
            "{:34}",
            format!("{short}, {} photos, {which}", lumigraph.sources.len())
        );
        for mut times in times {
            times.sort();
            match times.get(times.len() / 2) {
                Some((cpu, wall)) => {
                    print!("{:>15}", format!("{:.1} / {:.1}", ms(*cpu), ms(*wall)))
                }
                None => print!("{:>15}", "-"),
            }
        }
        println!("{psnr:>10.1}");
    }
}

fn timed(work: impl FnOnce()) -> (Duration, Duration) {
    let (cpu, wall) = (ProcessTime::now(), Instant::now());
    work();
    (cpu.elapsed(), wall.elapsed())
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}
