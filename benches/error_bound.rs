//! Whether frames drawn with `--max-error` keep within it: `cargo bench --bench error_bound
//! [-- CAPTURE…]`; see README.md.

mod common;

use clap::Parser;
use common::{generate, on_the_way};
use cpu_time::ProcessTime;
use lumigraph::scene::{Kind, Scene};
use render::cpu::Cpu;
use render::score::score;
use render::{FieldOptions, Frame, GRIDS, Method, Samples, TriangulatedField};
use serde::Serialize;
use std::collections::BTreeSet;
use std::error::Error;
use std::path::PathBuf;

/// Compares the error that a frame's samples tell with the whole picture's.
#[derive(Parser)]
struct Args {
    /// Captures, or scenes written by `lumigraph import` [default: synthetic scenes]
    captures: Vec<PathBuf>,
    /// Kinds of proxy; what does not apply is passed over
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "plane,tunnel,points,carved"
    )]
    kinds: Vec<String>,
    /// Frames, along the way from photo to photo
    #[arg(long, default_value_t = 10)]
    frames: usize,
    /// Pixels along the longer side of the pictures
    #[arg(long, default_value_t = 960)]
    long_side: u32,
    /// Write all figures, a frame and grid at a time
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// What cargo passes
    #[arg(long, hide = true)]
    bench: bool,
}

/// Drawn where no capture is given.
const SYNTHETIC: [&str; 5] = ["shelf", "hallway", "wall", "knick-knacks", "car"];
/// Of the synthetic photos.
const SIZE: (u32, u32) = (500, 375);
const VIEWS: usize = 12;
/// Bounds that are tried, in steps of 255: 42, 48, 54, 60 and 66 dB.
const BOUNDS: [f64; 5] = [2.0, 1.0, 0.5, 0.25, 0.125];

/// A frame drawn with a grid.
#[derive(Clone, Debug, Serialize)]
struct Drawn {
    scene: String,
    kind: String,
    frame: usize,
    grid: u32,
    /// Of the whole picture against the exact one, as the CPU engine draws both: steps of 255.
    error: f64,
    /// As the samples have it, without margin and with it.
    estimate: f64,
    at_most: f64,
    /// CPU-ms: the exact picture, the field, its picture, the samples, the estimate.
    exact_ms: f64,
    field_ms: f64,
    draw_ms: f64,
    samples_ms: f64,
    estimate_ms: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    let synthetic = tempfile::tempdir()?;
    let folders = if args.captures.is_empty() {
        let write = |name: &&str| generate(name, SIZE, Some(VIEWS), synthetic.path());
        SYNTHETIC.iter().map(write).collect::<Result<_, _>>()?
    } else {
        args.captures.clone()
    };
    let mut all = Vec::new();
    println!("| scene | proxy | frames | grids taken, by bound | within |");
    println!("|---|---|---|---|---|");
    for folder in &folders {
        let name = folder.file_name().unwrap_or(folder.as_os_str());
        let name = name.to_string_lossy();
        let (scene, _) = Scene::open(folder, false)?;
        for kind in &args.kinds {
            let kind = Kind::from_name(kind).ok_or(format!("no kind of proxy: {kind}"))?;
            match measure(&name, &scene, kind, &args) {
                Ok(drawn) => {
                    println!("{}", row(&drawn));
                    all.extend(drawn);
                }
                Err(error) => eprintln!("{name}, {}: {error}", kind.name()),
            }
        }
    }
    println!("\n| bound | frames | exact | within |");
    println!("|---|---|---|---|");
    for bound in BOUNDS {
        let frames = all.chunks(GRIDS.len());
        let exact = frames.filter(|grids| taken(grids, bound).is_none()).count();
        let (within, count) = within(&all, &[bound]);
        println!("| {bound} | {count} | {exact} | {within} |");
    }
    if let Some(file) = &args.json {
        std::fs::write(file, serde_json::to_string_pretty(&all)?)?;
    }
    Ok(())
}

/// The frame's grid for a bound, as `render::prepare_within` chooses; `None` for exact.
fn taken(grids: &[Drawn], bound: f64) -> Option<&Drawn> {
    grids.iter().find(|drawn| drawn.at_most <= bound)
}

/// Of how many frames and bounds the true error is within the bound.
fn within(all: &[Drawn], bounds: &[f64]) -> (usize, usize) {
    let frames = all.chunks(GRIDS.len());
    let pairs = frames.flat_map(|grids| bounds.iter().map(|bound| (taken(grids, *bound), *bound)));
    pairs.fold((0, 0), |(within, count), (drawn, bound)| {
        let kept = drawn.is_none_or(|d| d.error <= bound);
        (within + usize::from(kept), count + 1)
    })
}

fn row(drawn: &[Drawn]) -> String {
    let of_bound = |bound: f64| {
        let mut counts = [0; GRIDS.len() + 1];
        for grids in drawn.chunks(GRIDS.len()) {
            let grid = taken(grids, bound).map(|d| d.grid);
            let at = GRIDS.iter().position(|g| Some(*g) == grid);
            counts[at.unwrap_or(GRIDS.len())] += 1;
        }
        format!("{bound}: {}", counts.map(|c| c.to_string()).join("/"))
    };
    let (within, count) = within(drawn, &BOUNDS);
    format!(
        "| {} | {} | {} | {} | {within} of {count} |",
        drawn[0].scene,
        drawn[0].kind,
        drawn.len() / GRIDS.len(),
        BOUNDS.map(of_bound).join(", ")
    )
}

fn measure(
    name: &str,
    scene: &Scene,
    kind: Kind,
    args: &Args,
) -> Result<Vec<Drawn>, Box<dyn Error>> {
    let all = BTreeSet::new();
    let lumigraph = scene.lumigraph(&all, scene.fit(kind, &all)?.proxy)?;
    let steps = lumigraph.sources.len().saturating_sub(1);
    if steps == 0 {
        return Err("no pair of photos".into());
    }
    let mut cpu = Cpu::default();
    let mut drawn = Vec::new();
    for i in 0..args.frames {
        let at = (i as f64 + 0.5) * steps as f64 / args.frames as f64;
        // Parts of the way spread evenly, too.
        let share = (0.5 + 0.618_034 * i as f64).fract();
        let desired = on_the_way(&lumigraph, at as usize, share, args.long_side);
        let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
        // Decodes what it needs.
        let exact = cpu.render(&frame, Method::Exact)?;
        let (_, exact_ms) = timed(|| cpu.render(&frame, Method::Exact));
        let (samples, samples_ms) = timed(|| Samples::new(&frame));
        let samples = samples?;
        for grid in GRIDS {
            let (field, field_ms) = timed(|| TriangulatedField::new(&frame, grid));
            let field = field?;
            let (estimate, estimate_ms) = timed(|| samples.error_of(&field));
            let (picture, draw_ms) = timed(|| cpu.render_field(&frame, &field));
            let psnr = score(&picture?, &exact)?.psnr;
            let estimate = estimate?;
            drawn.push(Drawn {
                scene: name.to_owned(),
                kind: kind.name().to_owned(),
                frame: i,
                grid,
                error: 255.0 * 10_f64.powf(-psnr / 20.0),
                estimate: estimate.mean_square.sqrt(),
                at_most: estimate.at_most(),
                exact_ms,
                field_ms,
                draw_ms,
                samples_ms,
                estimate_ms,
            });
        }
    }
    Ok(drawn)
}

/// What something gives, and how many CPU-ms it took.
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = ProcessTime::now();
    let done = work();
    (done, start.elapsed().as_secs_f64() * 1e3)
}
