//! Many frames one after the other: `cargo bench --bench soak`; see README.md.
//!
//! Random options along random paths. Now and then a frame must be the same, byte for byte,
//! as a new engine draws it, and memory must not grow.

use calibrate::{Rigid3, View};
use clap::Parser;
use datasets::Options;
use lumigraph::scene::{Kind, Scene};
use render::{Blend, DeviceChoice, Engine, FieldOptions, Frame, Lumigraph, Method};
use std::collections::BTreeSet;
use std::error::Error;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

/// Draws many frames and watches bytes and memory.
#[derive(Parser)]
struct Args {
    /// How many
    #[arg(long, default_value_t = 2000)]
    frames: usize,
    /// Engines to take in turn; gpu is passed over where there is none
    #[arg(long, value_delimiter = ',', default_value = "cpu,gpu")]
    engines: Vec<String>,
    /// Every so many frames one is drawn by a new engine, too
    #[arg(long, default_value_t = 100)]
    compare_every: usize,
    /// Of the paths and options
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// What cargo passes
    #[arg(long, hide = true)]
    bench: bool,
}

/// Frames of a path from one random view to the next.
const PATH: usize = 25;
/// Of the frames: until then caches fill.
const WARM_UP: f64 = 0.2;
/// How much memory may grow after that, at most.
const GROWTH: f64 = 0.1;
const SIZES: [(u32, u32); 4] = [(96, 72), (160, 120), (121, 163), (240, 135)];

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Whether all went well.
fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let scenes = scenes(folder.path())?;
    let mut random = Random(args.seed);
    let mut engines = Vec::new();
    for name in &args.engines {
        let choice = match name.as_str() {
            "cpu" => DeviceChoice::Cpu,
            "gpu" => DeviceChoice::Gpu,
            _ => return Err(format!("no engine: {name}").into()),
        };
        match Engine::open(choice) {
            Ok(engine) => engines.push((choice, engine)),
            Err(error) => println!("{name} is passed over: {error}"),
        }
    }
    if engines.is_empty() {
        return Err("no engine is left".into());
    }
    println!("| frames | s | resident, MiB | compared | unlike |");
    println!("|---|---|---|---|---|");
    let start = Instant::now();
    let (mut compared, mut unlike) = (0, 0);
    let mut warm = None;
    let mut last = None;
    let (mut scene, mut from, mut to) = (0, 0, 0);
    for i in 0..args.frames {
        if i % PATH == 0 {
            scene = random.below(scenes.len());
            let count = scenes[scene].sources.len();
            (from, to) = (random.below(count), random.below(count));
        }
        let lumigraph = &scenes[scene];
        let share = (i % PATH) as f64 / PATH as f64;
        let (width, height) = SIZES[random.below(SIZES.len())];
        let [a, b] = [from, to].map(|i| &lumigraph.sources[i].view);
        let desired = between(a, b, share).resized(width, height);
        let options = FieldOptions {
            k: 1 + random.below(16),
            beta: [0.0, 0.1, 1.0][random.below(3)],
            blend: [Blend::Consistent, Blend::Paper][random.below(2)],
            ..FieldOptions::default()
        };
        let method = [Method::Exact, Method::TRIANGULATED][random.below(2)];
        let frame = Frame::new(lumigraph, desired, options);
        let which = random.below(engines.len());
        let (choice, engine) = &mut engines[which];
        let picture = engine.render(&frame, method)?;

        if (i + 1) % args.compare_every.max(1) == 0 {
            compared += 1;
            if Engine::open(*choice)?.render(&frame, method)? != picture {
                unlike += 1;
                println!(
                    "frame {i} is unlike a new engine's: {}, {method:?}, {options:?}, {width} × {height}",
                    engine.description()
                );
            }
        }
        let tenth = (args.frames / 10).max(1);
        if (i + 1) % tenth == 0 || i + 1 == args.frames {
            last = resident_mib();
            if warm.is_none() && (i + 1) as f64 >= WARM_UP * args.frames as f64 {
                warm = last;
            }
            let resident = last.map_or("?".to_owned(), |mib| format!("{mib:.1}"));
            let s = start.elapsed().as_secs_f64();
            println!(
                "| {} | {s:.0} | {resident} | {compared} | {unlike} |",
                i + 1
            );
        }
    }
    let mut well = unlike == 0;
    if let (Some(warm), Some(last)) = (warm, last) {
        let growth = last / warm - 1.0;
        println!(
            "\nmemory after the warm-up: {warm:.1} MiB, at the end {last:.1} ({:+.1} %)",
            100.0 * growth
        );
        well &= growth <= GROWTH;
    }
    Ok(well)
}

/// The still life on a plane, on its points and on a mesh that hides parts of itself; the
/// hallway on its tunnel.
fn scenes(folder: &Path) -> Result<Vec<Lumigraph>, Box<dyn Error>> {
    let options = Options {
        size: Some((240, 180)),
        views: Some(12),
        samples_per_side: Some(1),
    };
    let all = BTreeSet::new();
    let mut scenes = Vec::new();
    for (name, kinds) in [
        ("shelf", &[Kind::Plane, Kind::Points, Kind::Carved][..]),
        ("hallway", &[Kind::Tunnel]),
    ] {
        let capture = folder.join(name);
        datasets::write(&datasets::by_name(name, &options)?, &capture)?;
        let (scene, _) = Scene::open(&capture, false)?;
        for &kind in kinds {
            scenes.push(scene.lumigraph(&all, scene.fit(kind, &all)?.proxy)?);
        }
    }
    Ok(scenes)
}

/// Part of the way from one view to another, with the first one's lens.
fn between(a: &View, b: &View, share: f64) -> View {
    let (from, to) = (a.camera_from_world, b.camera_from_world);
    let rotation = from.rotation.slerp(to.rotation, share).normalize();
    let center = from.center().lerp(to.center(), share);
    View {
        camera_from_world: Rigid3::new(rotation, -(rotation * center)),
        ..a.clone()
    }
}

/// Memory held, where the system says so in Linux's way.
fn resident_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"))?;
    let kib: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kib / 1024.0)
}

/// Pseudo-random numbers, the same everywhere: SplitMix64 (Steele et al. 2014).
struct Random(u64);

impl Random {
    fn below(&mut self, count: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % count as u64) as usize
    }
}
