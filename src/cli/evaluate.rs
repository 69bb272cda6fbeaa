//! `lumigraph evaluate`

use super::exposure::ExposureArgs;
use super::options::{DrawArgs, FieldArgs, SceneArgs, resized};
use super::output::say;
use super::output::{print, print_json};
use super::report::{Report, Start};
use super::session::{Session, progress};
use super::surface::ProxyArgs;
use super::time::TimeArgs;
use anyhow::bail;
use clap::builder::RangedU64ValueParser;
use image::{DynamicImage, RgbaImage};
use lumigraph::scene::{Scene, picture_files};
use render::score::{MaskedScore, PSNR_CAP_DB, Score, mean, mean_masked, score, score_masked};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Score held-out photos: render each at its own pose and compare
///
/// PSNR and SSIM over the whole picture (what is not covered counts as black), PSNR once the
/// picture is given the photo's own exposure (psnr_exposed), PSNR over the covered pixels,
/// coverage, how far the photos that share a pixel are apart in steps of 255, details aside
/// (seams), and processor time without decoding; where a photo has an ignore mask or a matte,
/// also PSNR, SSIM and coverage inside. Held out are the photos that the capture's split.json
/// names, else every 8th. With --period or --time-window each is rendered as of its own time.
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
    exposure: ExposureArgs,
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
    /// See [`render::seams`].
    seams: Option<f64>,
    /// Inside the photo's own mask or matte, if it has one.
    #[serde(flatten)]
    masked: Option<MaskedScore>,
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
        &args.exposure,
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
    say!("exposure: {}", session.exposure.text());
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
    let files = picture_files("view", names.iter().map(|n| (n.as_str(), true)), folder)?;
    session.prepare()?;
    let bar = progress(names.len(), "evaluating");
    let mut lines = Vec::new();
    for (name, file) in names.iter().zip(files) {
        let view = session.scene.view(name)?;
        let Some(photo) = session.decode(name, (view.width, view.height))? else {
            continue;
        };
        let desired = resized(view, size);
        let inside = photo
            .inside()
            .map(DynamicImage::from)
            .map(|mask| mask.into_rgba8());
        let size = (desired.width, desired.height);
        let photo = at_size(photo.pixels, size);
        let inside = inside.map(|mask| DynamicImage::from(at_size(mask, size)).into_luma8());
        let moment = session.moment(&format!("photo {name}"), session.scene.time_s(name))?;
        let drawn = session.draw_timed(&desired, moment.as_ref())?;
        if output.is_some() {
            capture::write_png(&file, &drawn.picture)?;
        }
        lines.push(Line {
            name: name.clone(),
            score: score(&drawn.picture, &photo)?,
            seams: session.seams(&desired, moment.as_ref())?,
            masked: match inside {
                Some(inside) => score_masked(&drawn.picture, &photo, &inside)?,
                None => None,
            },
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
    let seams: Vec<f64> = lines.iter().filter_map(|line| line.seams).collect();
    let masked: Vec<MaskedScore> = lines.iter().filter_map(|line| line.masked).collect();
    let cpu_ms: f64 = lines.iter().map(|line| line.cpu_ms).sum();
    Some(Line {
        name: "mean".to_owned(),
        score: mean(&scores)?,
        seams: (!seams.is_empty()).then(|| seams.iter().sum::<f64>() / seams.len() as f64),
        masked: mean_masked(&masked),
        cpu_ms: cpu_ms / lines.len() as f64,
    })
}

fn json(session: &Session, lines: &[Line]) -> Value {
    let mut mean = json!(mean_line(lines));
    if let Some(mean) = mean.as_object_mut() {
        mean.remove("name");
    }
    let mut result = json!({
        "photos": lines,
        "mean": mean,
        "proxy": session.proxy.json(),
        "exposure": session.exposure.json(),
    });
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
    let any_masked = mean.as_ref().is_some_and(|line| line.masked.is_some());
    let mut text = format!(
        "{:width$}  {:>7}  {:>12}  {:>6}  {:>12}  {:>8}  {:>6}",
        "photo", "psnr", "psnr_exposed", "ssim", "psnr_covered", "coverage", "seams"
    );
    if any_masked {
        text += &format!("  {:>11}  {:>11}", "psnr_masked", "ssim_masked");
    }
    text += &format!("  {:>8}\n", "cpu ms");
    let db =
        |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{:.2}", v.min(PSNR_CAP_DB)));
    for line in lines.iter().chain(&mean) {
        text += &format!(
            "{:width$}  {:>7}  {:>12}  {:>6.4}  {:>12}  {:>8.4}  {:>6}",
            line.name,
            db(Some(line.score.psnr)),
            db(Some(line.score.psnr_exposed)),
            line.score.ssim,
            db(line.score.psnr_covered),
            line.score.coverage,
            line.seams.map_or("-".to_owned(), |v| format!("{v:.2}")),
        );
        if any_masked {
            let ssim = line.masked.and_then(|m| m.ssim_masked);
            let ssim = ssim.map_or("-".to_owned(), |v| format!("{v:.4}"));
            let psnr = db(line.masked.map(|m| m.psnr_masked));
            text += &format!("  {psnr:>11}  {ssim:>11}");
        }
        text += &format!("  {:>8.1}\n", line.cpu_ms);
    }
    text
}
