//! Many frames one after the other: `cargo bench --bench soak`; see README.md.
//!
//! Random options along random paths, each path with budgets of its own for photos in memory and
//! on the device. Now and then a frame must be the same, byte for byte, as a new engine draws it
//! from photos that nobody decoded before, under the same budgets; and memory must not grow.

use clap::Parser;
use datasets::Options;
use lumigraph::bench::Random;
use lumigraph::scene::{Kind, Scene};
use render::{
    Blend, DeviceChoice, Engine, FieldOptions, Frame, Lumigraph, Method, Prepared, RenderError,
    prepare_within,
};
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
    /// Begin no frame after so many seconds
    #[arg(long, default_value_t = f64::INFINITY)]
    seconds: f64,
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
/// Of the frames, or the seconds: until then caches fill, and budgets change what they hold.
const WARM_UP: f64 = 0.5;
/// How much memory may grow after that, at most.
const GROWTH: f64 = 0.1;
/// What photos may take, in bytes. All of a scene take 2.8 MB, one 230 kB.
const BUDGETS: [Option<u64>; 6] = [
    None,
    None,
    Some(2_000_000),
    Some(1_000_000),
    Some(300_000),
    Some(60_000),
];
/// Steps of 255, for frames whose method is chosen by a bound on their error.
const BOUNDS: [f64; 3] = [1.0, 0.5, 0.25];
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
    let mut scenes = scenes(folder.path())?;
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
    let (mut scene, mut from, mut to) = (0, 0, 0);
    let mut budgets = [None; 2];
    let mut drawn = 0;
    let mut capped = 0;
    for i in 0..args.frames {
        if i % PATH == 0 {
            scene = random.below(scenes.len());
            let count = scenes[scene].lumigraph.sources.len();
            (from, to) = (random.below(count), random.below(count));
            budgets = [0; 2].map(|_| BUDGETS[random.below(BUDGETS.len())]);
            scenes[scene].lumigraph.photos.set_budget(budgets[0]);
            for (_, engine) in &mut engines {
                set_budget(engine, budgets[1]);
            }
        }
        if start.elapsed().as_secs_f64() > args.seconds {
            break;
        }
        let lumigraph = &scenes[scene].lumigraph;
        let share = (i % PATH) as f64 / PATH as f64;
        let (width, height) = SIZES[random.below(SIZES.len())];
        let [a, b] = [from, to].map(|i| &lumigraph.sources[i].view);
        let desired = a.between(b, share).resized(width, height);
        let options = FieldOptions {
            k: 1 + random.below(16),
            beta: [0.0, 0.1, 1.0][random.below(3)],
            blend: [Blend::Consistent, Blend::Paper][random.below(2)],
            ..FieldOptions::default()
        };
        let method = match random.below(3) {
            0 => Asked::Method(Method::Exact),
            1 => Asked::Method(Method::TRIANGULATED),
            _ => Asked::Within(BOUNDS[random.below(BOUNDS.len())]),
        };
        let which = random.below(engines.len());
        let (choice, engine) = &mut engines[which];
        let before = capped_drawings(lumigraph, engine);
        let frame = Frame::new(lumigraph, desired.clone(), options);
        let picture = engine.draw(&frame, &method.prepare(&frame)?)?;
        capped += usize::from(capped_drawings(lumigraph, engine) > before);
        drawn = i + 1;

        if drawn % args.compare_every.max(1) == 0 {
            compared += 1;
            let mut new = Engine::open(*choice)?;
            set_budget(&mut new, budgets[1]);
            let mut lumigraph = scenes[scene].anew()?;
            lumigraph.photos.set_budget(budgets[0]);
            let frame = Frame::new(&lumigraph, desired, options);
            if new.draw(&frame, &method.prepare(&frame)?)? != picture {
                unlike += 1;
                println!(
                    "frame {i} is unlike a new engine's: {}, {method:?}, {options:?}, \
                     {width} × {height}, budgets {budgets:?}",
                    new.description()
                );
            }
        }
        let tenth = (args.frames / 10).max(1);
        let share = drawn as f64 / args.frames as f64;
        let share = share.max(start.elapsed().as_secs_f64() / args.seconds);
        if drawn % tenth == 0 || drawn == args.frames {
            let last = without_photos(&mut scenes);
            scenes[scene].lumigraph.photos.set_budget(budgets[0]);
            if warm.is_none() && share >= WARM_UP {
                warm = last;
            }
            let resident = last.map_or("?".to_owned(), |mib| format!("{mib:.1}"));
            let s = start.elapsed().as_secs_f64();
            println!("| {drawn} | {s:.0} | {resident} | {compared} | {unlike} |",);
        }
    }
    println!("\n{drawn} frames, {capped} of them from coarser mip levels for lack of room");
    let mut well = unlike == 0;
    let last = without_photos(&mut scenes);
    if let (Some(warm), Some(last)) = (warm, last) {
        let growth = last / warm - 1.0;
        println!(
            "memory after the warm-up: {warm:.1} MiB, at the end {last:.1} ({:+.1} %)",
            100.0 * growth
        );
        well &= growth <= GROWTH;
    }
    Ok(well)
}

/// A scene with one of its proxies.
struct Subject {
    scene: Scene,
    proxy: proxy::Proxy,
    lumigraph: Lumigraph,
}

impl Subject {
    /// Without any photo decoded.
    fn anew(&self) -> Result<Lumigraph, Box<dyn Error>> {
        let all = BTreeSet::new();
        Ok(self.scene.lumigraph(&all, self.proxy.clone())?)
    }
}

/// How a frame's method is found.
#[derive(Clone, Copy, Debug)]
enum Asked {
    Method(Method),
    Within(f64),
}

impl Asked {
    fn prepare(self, frame: &Frame<'_>) -> Result<Prepared, RenderError> {
        match self {
            Self::Method(method) => Prepared::new(frame, method),
            Self::Within(bound) => Ok(prepare_within(frame, bound)?.prepared),
        }
    }
}

fn set_budget(engine: &mut Engine, budget: Option<u64>) {
    if let Some(gpu) = engine.gpu_mut() {
        gpu.set_budget(budget);
    }
}

/// Memory held once no photo is decoded: how many are is a matter of the last budgets.
fn without_photos(scenes: &mut [Subject]) -> Option<f64> {
    for subject in scenes {
        subject.lumigraph.photos.set_budget(Some(0));
    }
    resident_mib()
}

/// How many drawings lacked room for the finest mip levels so far.
fn capped_drawings(lumigraph: &Lumigraph, engine: &Engine) -> u64 {
    let gpu = engine.gpu().map_or(0, |gpu| gpu.residency().capped_frames);
    lumigraph.photos.residency().capped_frames + gpu
}

/// The still life on a plane, on its points and on a mesh that hides parts of itself; the
/// hallway on its tunnel.
fn scenes(folder: &Path) -> Result<Vec<Subject>, Box<dyn Error>> {
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
        for &kind in kinds {
            let (scene, _) = Scene::open(&capture, false)?;
            let proxy = scene.fit(kind, &all)?.proxy;
            let lumigraph = scene.lumigraph(&all, proxy.clone())?;
            scenes.push(Subject {
                scene,
                proxy,
                lumigraph,
            });
        }
    }
    Ok(scenes)
}

/// Memory held, where the system says so in Linux's way.
fn resident_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"))?;
    let kib: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kib / 1024.0)
}
