//! `lumigraph evaluate`

use super::options::{DrawArgs, FieldArgs, ProxyArgs, SceneArgs, resized};
use super::output::say;
use super::output::{frame_files, print, print_json};
use super::report::{Report, Start};
use super::session::{Session, progress};
use super::time::TimeArgs;
use anyhow::bail;
use clap::builder::RangedU64ValueParser;
use image::RgbaImage;
use lumigraph::scene::Scene;
use render::score::{PSNR_CAP_DB, Score, mean, score};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Score held-out photos: render each at its own pose and compare
///
/// PSNR and SSIM over the whole picture (what is not covered counts as black), PSNR over
/// the covered pixels, coverage, and processor time without decoding. Held out are the
/// photos that the capture's split.json names, else every 8th. With --period or
/// --time-window each is rendered as of its own time.
///
///     lumigraph evaluate my-capture --every 4
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    #[command(flatten)]
    scene: SceneArgs,
    /// Hold out the photos named in this file: {"test": ["a.jpg", …]}
    #[arg(long, value_name = "SPLIT.json")]
    hold_out: Option<PathBuf>,
    /// Hold out every N-th photo by name
    #[arg(long, value_name = "N", conflicts_with = "hold_out",
        value_parser = RangedU64ValueParser::<usize>::new().range(2..))]
    every: Option<usize>,
    #[command(flatten)]
    proxy: ProxyArgs,
    #[command(flatten)]
    field: FieldArgs,
    #[command(flatten)]
    draw: DrawArgs,
    #[command(flatten)]
    time: TimeArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// A folder for the rendered pictures
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

/// One photo's scores.
#[derive(Serialize)]
struct Line {
    name: String,
    #[serde(flatten)]
    score: Score,
    cpu_ms: f64,
}

/// The photos held out where nobody says which.
const EVERY: usize = 8;

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let start = Start::now();
    let scene = args.scene.open()?;
    let held_out = held_out(args, &scene)?;
    let mut session = Session::new(
        scene,
        held_out.clone(),
        args.scene.strict,
        &args.proxy,
        &args.field,
        &args.draw,
        &args.time,
        None,
    )?;
    let output = args.output.as_deref();
    let size = args.draw.size;
    let lines = score_photos(&mut session, &held_out, size, output)?;
    let result = json(&session, &lines);
    if args.json {
        return print_json(&result);
    }
    say!("proxy: {}", session.proxy.text());
    say!("{}", Report::new(&session, &start).text());
    print(&table(&lines))
}

fn held_out(args: &Args, scene: &Scene) -> anyhow::Result<BTreeSet<String>> {
    let split = match args.every {
        Some(every) => return Ok(scene.every(every)),
        None => args.hold_out.clone().or_else(|| scene.own_split()),
    };
    let Some(split) = split else {
        return Ok(scene.every(EVERY));
    };
    let names = scene.held_out(&split)?;
    if names.is_empty() {
        bail!(
            "{}: all of its photos are missing or corrupt",
            split.display()
        );
    }
    Ok(names)
}

/// Renders and scores each of the given photos; where one turns out corrupt it is left out,
/// unless `--strict`.
fn score_photos(
    session: &mut Session,
    names: &BTreeSet<String>,
    size: Option<(u32, u32)>,
    output: Option<&std::path::Path>,
) -> anyhow::Result<Vec<Line>> {
    let folder = output.unwrap_or(std::path::Path::new(""));
    let files = frame_files(names.iter().map(String::as_str), folder)?;
    session.prepare()?;
    let bar = progress(names.len(), "evaluating");
    let mut lines = Vec::new();
    for (name, file) in names.iter().zip(files) {
        let view = session.scene.view(name)?;
        let Some(photo) = session.decode(name, (view.width, view.height))? else {
            continue;
        };
        let desired = resized(view, size);
        let photo = at_size(photo, (desired.width, desired.height));
        let moment = session.moment(&format!("photo {name}"), session.scene.time_s(name))?;
        let drawn = session.draw_timed(&desired, moment.as_ref())?;
        if output.is_some() {
            capture::write_png(&file, &drawn.picture)?;
        }
        lines.push(Line {
            name: name.clone(),
            score: score(&drawn.picture, &photo)?,
            cpu_ms: drawn.cpu.as_secs_f64() * 1e3,
        });
        bar.inc(1);
    }
    bar.finish_and_clear();
    if lines.is_empty() {
        bail!("none of the held-out photos can be decoded");
    }
    Ok(lines)
}

fn at_size(photo: RgbaImage, (width, height): (u32, u32)) -> RgbaImage {
    if photo.dimensions() == (width, height) {
        return photo;
    }
    capture::resize(&photo, width, height)
}

fn mean_line(lines: &[Line]) -> Option<Line> {
    let scores: Vec<Score> = lines.iter().map(|line| line.score).collect();
    let cpu_ms: f64 = lines.iter().map(|line| line.cpu_ms).sum();
    Some(Line {
        name: "mean".to_owned(),
        score: mean(&scores)?,
        cpu_ms: cpu_ms / lines.len() as f64,
    })
}

fn json(session: &Session, lines: &[Line]) -> Value {
    let mut mean = json!(mean_line(lines));
    if let Some(mean) = mean.as_object_mut() {
        mean.remove("name");
    }
    let mut result = json!({"photos": lines, "mean": mean, "proxy": session.proxy.json()});
    if let Some(time) = session.time_json() {
        result["time"] = time;
    }
    result
}

/// For people.
fn table(lines: &[Line]) -> String {
    let mean = mean_line(lines);
    let widest = lines.iter().map(|line| line.name.chars().count()).max();
    let width = widest.unwrap_or_default().max("photo".len());
    let mut text = format!(
        "{:width$}  {:>7}  {:>6}  {:>12}  {:>8}  {:>8}\n",
        "photo", "psnr", "ssim", "psnr_covered", "coverage", "cpu ms"
    );
    for line in lines.iter().chain(&mean) {
        let covered = line.score.psnr_covered;
        text += &format!(
            "{:width$}  {:>7.2}  {:>6.4}  {:>12}  {:>8.4}  {:>8.1}\n",
            line.name,
            line.score.psnr.min(PSNR_CAP_DB),
            line.score.ssim,
            covered.map_or("-".to_owned(), |v| format!("{:.2}", v.min(PSNR_CAP_DB))),
            line.score.coverage,
            line.cpu_ms
        );
    }
    text
}
