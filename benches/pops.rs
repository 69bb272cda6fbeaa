//! What changes at once along a smooth path: `cargo bench --bench pops -- CAPTURE…`; see
//! README.md.
//!
//! Each step of a sweep is halved a dozen times, always towards the half over which the picture
//! changes more. Motion is then divided by 4096, and what is left is what pops: a point that
//! comes or goes, a triangle that flips, a photo that enters.

use calibrate::View;
use clap::Parser;
use image::RgbaImage;
use lumigraph::scene::{Kind, Scene, SceneError};
use render::{FieldOptions, Frame, Lumigraph, Method, cpu};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Measures what pops along a sweep.
#[derive(Parser)]
struct Args {
    /// Captures, or scenes written by `lumigraph import`
    #[arg(required = true)]
    captures: Vec<PathBuf>,
    /// Kinds of proxy
    #[arg(long, value_delimiter = ',', default_value = "points,dense,carved")]
    kinds: Vec<String>,
    /// Steps of the sweep
    #[arg(long, default_value_t = 16)]
    steps: usize,
    /// What cargo passes
    #[arg(long, hide = true)]
    bench: bool,
}

/// Pixels along the longer side.
const LONG_SIDE: u32 = 320;
const HALVINGS: u32 = 12;
/// Side of the blocks over which the worst change is averaged, in pixels.
const BLOCK: u32 = 16;

/// How far two pictures differ, in steps of 255.
#[derive(Clone, Copy, Debug)]
struct Change {
    /// Over the whole picture.
    mean: f64,
    /// Over the block that changes most.
    block: f64,
}

fn change(a: &RgbaImage, b: &RgbaImage) -> Change {
    let columns = a.width().div_ceil(BLOCK);
    let mut blocks = vec![(0.0, 0.0); (columns * a.height().div_ceil(BLOCK)) as usize];
    for ((x, y, p), q) in a.enumerate_pixels().zip(b.pixels()) {
        let (sum, count) = &mut blocks[(y / BLOCK * columns + x / BLOCK) as usize];
        let channels = p.0.iter().zip(&q.0).take(3);
        *sum += channels
            .map(|(p, q)| f64::from(p.abs_diff(*q)))
            .sum::<f64>()
            / 3.0;
        *count += 1.0;
    }
    let (sum, count) = blocks
        .iter()
        .fold((0.0, 0.0), |(s, n), (sum, count)| (s + sum, n + count));
    Change {
        mean: sum / count,
        block: blocks
            .iter()
            .map(|(sum, count)| sum / count)
            .fold(0.0, f64::max),
    }
}

/// What is left of the change from one view to another when it is halved again and again.
fn pop(lumigraph: &Lumigraph, a: &View, b: &View) -> Result<Change, SceneError> {
    let draw = |share: f64| {
        let frame = Frame::new(lumigraph, a.between(b, share), FieldOptions::default());
        cpu::render(&frame, Method::Exact).map_err(|e| SceneError::Unfit(e.to_string()))
    };
    let (mut from, mut to) = (0.0, 1.0);
    let (mut first, mut last) = (draw(from)?, draw(to)?);
    for _ in 0..HALVINGS {
        let half = 0.5 * (from + to);
        let middle = draw(half)?;
        if change(&first, &middle).mean >= change(&middle, &last).mean {
            (to, last) = (half, middle);
        } else {
            (from, first) = (half, middle);
        }
    }
    Ok(change(&first, &last))
}

fn measure(capture: &Path, kind: Kind, steps: usize) -> Result<Vec<Change>, SceneError> {
    let (scene, _) = Scene::open(capture, false)?;
    let without = scene.held_out_by_default()?;
    let fitted = scene.fit(kind, &without)?;
    let lumigraph = scene.lumigraph(&without, fitted.proxy)?;
    // From one photo to the next but one, through the middle of the capture.
    let views = &lumigraph.sources;
    let middle = views.len() / 2;
    let [a, b] = [middle.saturating_sub(1), (middle + 1).min(views.len() - 1)].map(|i| {
        let view = &views[i].view;
        let (width, height) = capture::reduced_size((view.width, view.height), LONG_SIDE);
        view.clone().resized(width, height)
    });
    (0..steps)
        .map(|i| {
            let at = |i: usize| a.between(&b, i as f64 / steps as f64);
            pop(&lumigraph, &at(i), &at(i + 1))
        })
        .collect()
}

fn main() -> ExitCode {
    let args = Args::parse();
    println!("| capture | proxy | mean pop | worst | worst block |");
    println!("|---|---|---|---|---|");
    let mut failed = false;
    for capture in &args.captures {
        for name in &args.kinds {
            let Some(kind) = Kind::from_name(name) else {
                eprintln!("no kind of proxy: {name}");
                return ExitCode::FAILURE;
            };
            match measure(capture, kind, args.steps) {
                Ok(changes) => {
                    let worst = |of: fn(&Change) -> f64| changes.iter().map(of).fold(0.0, f64::max);
                    let mean = changes.iter().map(|c| c.mean).sum::<f64>() / changes.len() as f64;
                    let capture = capture.file_name().unwrap_or_default().to_string_lossy();
                    let (whole, block) = (worst(|c| c.mean), worst(|c| c.block));
                    println!("| {capture} | {name} | {mean:.3} | {whole:.3} | {block:.1} |");
                }
                Err(error) => {
                    eprintln!("{}: {error}", capture.display());
                    failed = true;
                }
            }
        }
    }
    if failed {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    }
}
