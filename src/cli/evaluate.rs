//! `lumigraph evaluate`

use super::exposure::ExposureArgs;
use super::film::write_picture;
use super::inputs::files_behind_scene;
use super::options::{DrawArgs, FieldArgs, FinishArgs, SceneArgs, compared};
use super::output::say;
use super::output::{print, print_json};
use super::report::Report;
use super::session::{Session, progress};
use super::surface::ProxyArgs;
use super::targets::{check_folder, check_in_no_part, check_inputs, check_no_photos, others};
use super::time::TimeArgs;
use super::took::Start;
use anyhow::bail;
use lumigraph::scene::{Scene, Split, TruthScore, picture_files};
use render::score::{PSNR_CAP_DB, mean_of};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Score held-out photos: render each at its own pose and compare
///
/// PSNR and SSIM over the whole picture (what is not covered counts as black), PSNR once the
/// picture is given the photo's own exposure (psnr_exposed: channels are multiplied by what fits
/// best by least squares, and then clipped at white), PSNR over the covered pixels,
/// coverage (the mean alpha), the share of the photo's sparse points, where two or more others see
/// them, that fall on covered pixels (coverage_points), how far the photos that share a pixel
/// are apart in steps of 255, details aside (seams), and processor time without decoding. There
/// is no PSNR nor SSIM where neither photo nor picture shows anything. Where a photo has an
/// ignore mask or a matte, also PSNR, SSIM and coverage inside; with a matte, the mean alpha
/// inside it (coverage_matte) and outside (coverage_background: best is 0), and with --json the
/// shares of pixels covered by half or more (covered_matte, covered_background). Held out are the
/// photos that the capture's split.json names, else every 8th. With --period or --time-window
/// each is rendered as of its own time.
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
    #[arg(long, value_name = "N", conflicts_with = "hold_out", value_parser = every)]
    every: Option<usize>,
    #[command(flatten)]
    proxy: ProxyArgs,
    #[command(flatten)]
    exposure: ExposureArgs,
    #[command(flatten)]
    field: FieldArgs,
    #[command(flatten)]
    finish: FinishArgs,
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
    scores: TruthScore,
    /// See [`render::seams`].
    seams: Option<f64>,
    cpu_ms: f64,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let start = Start::now();
    let output = args.output.as_deref();
    if let Some(folder) = output {
        check_folder(folder)?;
    }
    let scene = args.scene.open()?;
    if let Some(folder) = output {
        check_no_photos(folder, &scene)?;
        check_in_no_part(folder, "-o")?;
    }
    let held_out = held_out(args, &scene)?;
    // What cannot be compared is said at once: fitting a proxy may take long.
    for (name, view) in held_out.iter().zip(scene.views(&held_out)?) {
        compared(name, view, args.draw.size)?;
    }
    let photos = scene.photos.iter().filter(|p| held_out.contains(&p.name));
    let times = photos.map(|photo| (named(&photo.name), photo.time_s));
    let remedy = "`import --times FILE.csv` gives it one; or hold out photos that have one";
    args.time.check(None, &scene, times, remedy)?;
    let kept = files_behind_scene(&args.scene.scene, &scene);
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
    session.finish_as(&args.finish);
    let size = args.draw.size;
    let lines = score_photos(&mut session, &held_out, size, output, &kept)?;
    let report = Report::new(&session, &start);
    if args.json {
        return print_json(&json(&session, &lines, &report));
    }
    say!("proxy: {}", session.proxy.text());
    say!("exposure: {}", session.exposure.text());
    say!("{}", report.text());
    print(&table(&lines))
}

/// A photo, as what is said of its view begins.
fn named(name: &str) -> String {
    format!("photo {name}")
}

/// Of how many photos one is held out: not of each.
fn every(text: &str) -> Result<usize, String> {
    let count = text.parse::<usize>().ok().filter(|&count| count > 1);
    count.ok_or_else(|| "expected a whole number above one, as in 8".to_owned())
}

fn held_out(args: &Args, scene: &Scene) -> anyhow::Result<BTreeSet<String>> {
    if let Some(every) = args.every {
        return Ok(scene.every(every));
    }
    let Some(split) = args.hold_out.clone().or_else(|| scene.own_split()) else {
        say_lost_capture(scene);
        return Ok(scene.held_out_by_default()?);
    };
    let Split { held_out, left_out } = scene.held_out_some(&split)?;
    if !left_out.is_empty() {
        say!(
            "note: {}: left out of the scene, and not scored: {}",
            split.display(),
            left_out.join(", ")
        );
    }
    Ok(held_out)
}

/// Says that photos are held out by their places in the list though the scene's capture may have named some.
pub(super) fn say_lost_capture(scene: &Scene) {
    if let Some(capture) = scene.lost_capture() {
        say!(
            "note: {}, which the scene was made of, is not there: if it has a split.json, other photos than these were to \
             be held out; put that into the scene's folder, or import again",
            capture.display()
        );
    }
}

/// Renders and scores each of the given photos, all of the same others; where one turns out corrupt it is left
/// out, unless `--strict`. No picture takes the place of a file that is to be `kept`.
fn score_photos(
    session: &mut Session,
    names: &BTreeSet<String>,
    size: Option<(u32, u32)>,
    output: Option<&std::path::Path>,
    kept: &[PathBuf],
) -> anyhow::Result<Vec<Line>> {
    let folder = output.unwrap_or(std::path::Path::new(""));
    let files = picture_files("view", names.iter().map(|n| (n.as_str(), true)), folder)?;
    if output.is_some() {
        let files = files.iter().map(PathBuf::as_path);
        check_inputs(files, kept)?;
    }
    session.prepare()?;
    let lines = loop {
        let drawn_of = session.lumigraph().sources.len();
        let lines = score_each(session, names, size, output.map(|_| &files[..]))?;
        // What was drawn before a photo was left out is drawn again.
        if session.lumigraph().sources.len() == drawn_of {
            break lines;
        }
    };
    if lines.is_empty() {
        bail!("none of the held-out photos can be decoded");
    }
    if let Some(note) = session.note_of_empty() {
        say!("note: {note}");
    }
    if let Some(folder) = output {
        for note in others([folder], &files)? {
            say!("note: {note}");
        }
    }
    Ok(lines)
}

/// The same, whatever they are drawn of; pictures are written to `files`, where there are any.
fn score_each(
    session: &mut Session,
    names: &BTreeSet<String>,
    size: Option<(u32, u32)>,
    files: Option<&[PathBuf]>,
) -> anyhow::Result<Vec<Line>> {
    session.forget();
    let bar = progress(names.len(), "evaluating");
    let mut lines = Vec::new();
    let views = session.scene.views(names)?;
    for (i, (name, view)) in names.iter().zip(views).enumerate() {
        let Some(truth) = session.truth(name)? else {
            continue;
        };
        let desired = compared(name, view, size)?;
        let truth = truth.resized(desired.width, desired.height);
        let moment = session.moment(&named(name), session.scene.time_s(name))?;
        let drawn = session.draw_timed(&desired, moment.as_ref())?;
        if let Some(files) = files {
            write_picture(&files[i], &drawn.picture)?;
        }
        lines.push(Line {
            name: name.clone(),
            scores: truth.score(&drawn.picture)?,
            seams: session.seams(&desired, moment.as_ref())?,
            cpu_ms: drawn.cpu.as_secs_f64() * 1e3,
        });
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(lines)
}

fn mean_line(lines: &[Line]) -> Option<Line> {
    let scores: Vec<TruthScore> = lines.iter().map(|line| line.scores).collect();
    let seams: Vec<f64> = lines.iter().filter_map(|line| line.seams).collect();
    let cpu_ms: Vec<f64> = lines.iter().map(|line| line.cpu_ms).collect();
    Some(Line {
        name: "mean".to_owned(),
        scores: TruthScore::mean(&scores)?,
        seams: mean_of(&seams),
        cpu_ms: mean_of(&cpu_ms)?,
    })
}

fn json(session: &Session, lines: &[Line], report: &Report) -> Value {
    let mut mean = json!(mean_line(lines));
    if let Some(mean) = mean.as_object_mut() {
        mean.remove("name");
    }
    json!({
        "photos": lines,
        "mean": mean,
        "proxy": session.proxy.json(),
        "exposure": session.exposure.json(),
        "report": report,
    })
}

/// For people.
fn table(lines: &[Line]) -> String {
    let mean = mean_line(lines);
    let any = |has: fn(&TruthScore) -> bool| mean.as_ref().is_some_and(|line| has(&line.scores));
    let (any_masked, any_matte) = (any(|s| s.masked.is_some()), any(|s| s.matte.is_some()));
    let db = |value: Option<f64>| {
        value.map_or_else(missing, |value| format!("{:.2}", value.min(PSNR_CAP_DB)))
    };
    let share = |value: Option<f64>| value.map_or_else(missing, |value| format!("{value:.4}"));
    let columns = |line: &Line| {
        let TruthScore {
            score,
            coverage_points,
            masked,
            matte,
        } = line.scores;
        let told = |value: f64| Some(value).filter(|_| !line.scores.is_of_nothing());
        let mut columns = vec![
            ("psnr", db(told(score.psnr))),
            ("psnr_exposed", db(told(score.psnr_exposed))),
            ("ssim", share(told(score.ssim))),
            ("psnr_covered", db(score.psnr_covered)),
            ("coverage", share(Some(score.coverage))),
            ("coverage_points", share(coverage_points)),
        ];
        if any_masked {
            columns.extend([
                ("psnr_masked", db(masked.map(|m| m.psnr_masked))),
                ("ssim_masked", share(masked.and_then(|m| m.ssim_masked))),
                ("coverage_masked", share(masked.map(|m| m.coverage_masked))),
            ]);
        }
        if any_matte {
            let background = matte.and_then(|m| m.coverage_background);
            columns.extend([
                (
                    "coverage_matte",
                    share(matte.and_then(|m| m.coverage_matte)),
                ),
                ("coverage_background", share(background)),
            ]);
        }
        let seams = line.seams.map_or_else(missing, |v| format!("{v:.2}"));
        columns.extend([("seams", seams), ("cpu ms", format!("{:.1}", line.cpu_ms))]);
        columns
    };
    let rows = lines.iter().chain(&mean);
    let rows: Vec<(&str, Vec<(&str, String)>)> = rows
        .map(|line| (line.name.as_str(), columns(line)))
        .collect();
    let widest = rows.iter().map(|(name, _)| name.chars().count()).max();
    let width = widest.unwrap_or_default().max("photo".len());
    let mut text = format!("{:width$}", "photo");
    for (title, _) in rows.first().map_or(&[][..], |(_, columns)| columns) {
        text += &format!("  {title:>NARROWEST$}");
    }
    text += "\n";
    for (name, columns) in &rows {
        text += &format!("{name:width$}");
        for (title, value) in columns {
            let width = title.len().max(NARROWEST);
            text += &format!("  {value:>width$}");
        }
        text += "\n";
    }
    text
}

/// Columns are no narrower than any of their numbers.
const NARROWEST: usize = 7;

fn missing() -> String {
    "-".to_owned()
}
