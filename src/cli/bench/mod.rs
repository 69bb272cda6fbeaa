//! `lumigraph bench`

mod interior;
mod judge;
mod measure;
mod measured;
mod report;
mod scaling;
mod scatter;
mod settings;
mod skips;
mod stress;
mod times;
mod variants;

use super::Usage;
use super::captured::Opened;
use super::exposure::ExposureArgs;
use super::inputs::{files_of, files_of_mesh, files_of_places, scenes_of};
use super::options::DeviceName;
use super::output::{print, print_json, say, temporary_folder, write_file};
use super::session::progress;
use super::stamp::{Stamp, changes, in_unicode, stamps};
use super::targets::check_folder;
use anyhow::Context;
use datasets::house::{HouseOptions, house};
use indicatif::ProgressBar;
use judge::judge;
use lumigraph::scene::{Scene, SceneError};
use measured::{Effort, Pictures, Subject};
use proxy::interior::Contents;
use render::interior::Painter;
use report::{Thumbnails, page, thumbnails};
use scaling::Scaling;
use scatter::round;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Measure run time against error
///
/// Of each scene every setting that trades one for the other is measured: time, memory, and error
/// against held-out photos and against the exact picture; of interiors what portals show, against
/// the model drawn whole. Writes report.html (plots, the settings that nothing beats, pictures and
/// their differences), results.json and results.csv. What a folder holds already is not measured
/// again while the files it was measured of stay as they were. Without scenes: three synthetic
/// ones and a house.
///
///     lumigraph bench my-capture house -o measured
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    /// Scenes, captures and interiors
    #[arg(value_name = "SCENE|INTERIOR")]
    scenes: Vec<PathBuf>,
    /// Small pictures and the most telling settings: two minutes without scenes [default]
    #[arg(long, conflicts_with = "full")]
    quick: bool,
    /// Every setting and kind of surface, pictures of 960 pixels: some minutes a scene, and what
    /// was done stays when it is interrupted
    #[arg(long)]
    full: bool,
    /// Also how time grows with the number of photos, pixels, faces and threads
    #[arg(long)]
    scaling: bool,
    /// Instead of measuring, draw scenes that try to break things for so many minutes, and check
    /// what must hold of all
    #[arg(long, value_name = "MINUTES", value_parser = super::options::positive,
        conflicts_with_all = ["scenes", "quick", "full", "scaling", "long_side"])]
    stress: Option<f64>,
    /// The number of the first of these scenes
    #[arg(long, value_name = "N", default_value_t = 0, requires = "stress",
        conflicts_with_all = ["scenes", "quick", "full", "scaling", "long_side"])]
    seed: u64,
    /// Pixels along the longer side of the pictures [default: 480, with --full 960]
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(32..=8192))]
    long_side: Option<u32>,
    /// What draws; without a graphics processor, auto is cpu
    #[arg(long, value_enum, default_value = "auto")]
    device: DeviceName,
    /// Print the results as JSON
    #[arg(long)]
    json: bool,
    /// The folder for the report and the results
    #[arg(short, long, value_name = "DIR", default_value = "lumigraph-bench")]
    output: PathBuf,
}

/// The folder for finished subjects, in that for the report.
const MEASURED: &str = "measured";

/// A finished subject as it is kept: measured under the same plan it is not measured again.
#[derive(Serialize, Deserialize)]
struct Kept {
    plan: Plan,
    subject: Subject,
    thumbnails: Thumbnails,
}

#[derive(PartialEq, Serialize, Deserialize)]
struct Plan {
    version: String,
    given: String,
    effort: Effort,
    device: String,
    threads: usize,
    /// What it was measured of; none of what is synthetic.
    inputs: Vec<Stamp>,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    if let Some(minutes) = args.stress {
        return stress::run(minutes, args.seed, args.json);
    }
    check_folder(&args.output.join(MEASURED))?;
    let effort = match args.full {
        true => Effort {
            thorough: true,
            long_side: args.long_side.unwrap_or(960),
            views: 8,
            repeats: 5,
        },
        false => Effort {
            thorough: false,
            long_side: args.long_side.unwrap_or(480),
            views: 3,
            repeats: 3,
        },
    };
    let mut subjects = Vec::new();
    for (given, name) in given(&args.scenes)? {
        let plan = Plan {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            given: match &given {
                Given::Folder(folder) => folder.display().to_string(),
                Given::Synthetic(name) => format!("synthetic {name}"),
            },
            effort,
            device: args.device.name().to_owned(),
            threads: rayon::current_num_threads(),
            inputs: inputs(&given).with_context(|| name.clone())?,
        };
        let file = args.output.join(MEASURED).join(format!("{name}.json"));
        let kept = std::fs::read(&file).ok();
        let kept: Option<Kept> = kept.and_then(|bytes| serde_json::from_slice(&bytes).ok());
        if let Some(kept) = kept {
            if kept.plan == plan {
                say!("{name}: measured before; {} holds it", file.display());
                subjects.push((kept.subject, kept.thumbnails));
                continue;
            }
            let changes = changes(&kept.plan.inputs, &plan.inputs);
            if !changes.is_empty() {
                say!("{name}: measured anew, as before it was of other files: {changes}");
            }
        }
        let bar = progress(1, name.clone());
        let measured = measure_one(&given, &name, args, effort, &bar);
        bar.finish_and_clear();
        let (subject, pictures) = measured.with_context(|| name.clone())?;
        let kept = Kept {
            plan,
            thumbnails: thumbnails(&pictures)?,
            subject,
        };
        write_file(&file, &serde_json::to_vec(&kept)?)?;
        subjects.push((kept.subject, kept.thumbnails));
    }
    let scaling = args.scaling.then(|| {
        let bar = progress(1, "growth");
        let measured = Scaling::measure(args.full, &bar);
        bar.finish_and_clear();
        measured
    });
    let scaling = scaling.transpose()?;
    let machine = machine();
    let html = page(&machine, &subjects, scaling.as_ref());
    let subjects: Vec<Subject> = subjects.into_iter().map(|(subject, _)| subject).collect();
    let results = json!({
        "version": 1,
        "machine": machine,
        "subjects": subjects,
        "scaling": scaling,
    });
    write_file(&args.output.join("report.html"), html.as_bytes())?;
    write_file(&args.output.join("results.csv"), csv(&subjects).as_bytes())?;
    let text = serde_json::to_string_pretty(&results)? + "\n";
    write_file(&args.output.join("results.json"), text.as_bytes())?;
    if args.json {
        return print_json(&results);
    }
    let mut text = String::new();
    for subject in &subjects {
        text += &table(subject);
    }
    if let Some(scaling) = &scaling {
        text += &scaling.text();
    }
    print(&format!(
        "{text}{}\n",
        args.output.join("report.html").display()
    ))
}

/// What is measured.
enum Given {
    Folder(PathBuf),
    Synthetic(&'static str),
}

/// Synthetic subjects, where none is given: flat, deep, an object, and an interior.
const SYNTHETIC: [&str; 4] = ["shelf", "hallway", "car", "house"];

/// What to measure, each with a name of its own.
fn given(scenes: &[PathBuf]) -> anyhow::Result<Vec<(Given, String)>> {
    if scenes.is_empty() {
        let all = SYNTHETIC.map(|name| (Given::Synthetic(name), name.to_owned()));
        return Ok(all.into());
    }
    let mut all: Vec<(Given, String)> = Vec::new();
    for folder in scenes {
        if !folder.exists() {
            return Err(SceneError::NoFolder(folder.clone()).into());
        }
        let full = std::fs::canonicalize(folder);
        let full = full.with_context(|| folder.display().to_string())?;
        let name = full.file_name().unwrap_or(full.as_os_str());
        let name = name.to_string_lossy().into_owned();
        if let Some((Given::Folder(other), _)) = all.iter().find(|(_, n)| *n == name) {
            let text = format!(
                "{} and {} have the same name; measure them into folders of their own",
                other.display(),
                folder.display()
            );
            return Err(Usage(text).into());
        }
        all.push((Given::Folder(full), name));
    }
    Ok(all)
}

/// The files that decide what is measured, as they are now: a scene's, or an interior's and its scenes'.
fn inputs(given: &Given) -> anyhow::Result<Vec<Stamp>> {
    let Given::Folder(folder) = given else {
        return Ok(Vec::new());
    };
    let mut files = Vec::new();
    let mut scenes = vec![folder.clone()];
    if folder.join(super::interior::INTERIOR).is_file() {
        let (file, interior) = super::interior::open(folder)?;
        let model = interior.model.iter().map(|name| folder.join(name));
        files.extend(model.flat_map(files_of_mesh));
        scenes = scenes_of(&file, &interior);
        files.push(file);
    }
    for folder in &scenes {
        // It is opened once more where it is measured, and its warnings are told then.
        let (scene, _) = Scene::open(folder, false)?;
        files.extend(files_of(&scene));
        files.extend(scene.own_split());
        files.extend(files_of_places(folder));
    }
    let mut stamps = stamps(&files, in_unicode);
    stamps.dedup();
    Ok(stamps)
}

fn measure_one(
    given: &Given,
    name: &str,
    args: &Args,
    effort: Effort,
    bar: &ProgressBar,
) -> anyhow::Result<(Subject, Pictures)> {
    let device = args.device.choice();
    let scene = |folder: &Path| {
        let start = Instant::now();
        let (mut scene, warnings) = Scene::open(folder, false)?;
        let read_ms = 1e3 * start.elapsed().as_secs_f64();
        super::options::print_warnings(&warnings);
        super::options::drop_weak(&mut scene);
        measure::measure(scene, read_ms, name, effort, device, bar)
    };
    match given {
        Given::Folder(folder) if folder.join(super::interior::INTERIOR).is_file() => {
            let warn = |text| say!("warning: {text}");
            let exposure = ExposureArgs::default();
            let mut opened = Opened::new(folder, Some(&exposure), warn)?;
            let painter = opened.painter(device, None)?;
            let (interior, contents) = (&opened.interior, &opened.contents);
            interior::measure(
                interior,
                contents,
                &opened.model,
                painter,
                name,
                effort,
                bar,
            )
        }
        Given::Folder(folder) => scene(folder),
        Given::Synthetic("house") => {
            let options = HouseOptions {
                rooms: if effort.thorough { 9 } else { 3 },
                triangles: effort.thorough.then_some(400_000),
                seed: 1,
            };
            let house = house(&options)?;
            let (contents, _) = Contents::new(&house.interior, &house.model)?;
            let (interior, model) = (&house.interior, &house.model);
            let painter = Painter::open(device, model);
            interior::measure(interior, &contents, model, painter, name, effort, bar)
        }
        Given::Synthetic(dataset) => {
            let folder = temporary_folder()?;
            let options = datasets::Options {
                size: (!effort.thorough).then_some((480, 360)),
                ..datasets::Options::default()
            };
            bar.set_message(format!("{name}: making"));
            let path = folder.path().join(dataset);
            datasets::write(&datasets::by_name(dataset, &options)?, &path)?;
            scene(&path)
        }
    }
}

fn machine() -> String {
    format!(
        "lumigraph {} on {} {}, {} threads",
        env!("CARGO_PKG_VERSION"),
        std::env::consts::OS,
        std::env::consts::ARCH,
        rayon::current_num_threads()
    )
}

fn csv(subjects: &[Subject]) -> String {
    let mut text = "subject,knob,value,cpu_ms,cpu_ms_least,cpu_ms_most,wall_ms,first_cpu_ms,\
                    first_wall_ms,image_bytes,images_made,psnr,ssim,coverage,holes,\
                    steps_from_exact,psnr_to_exact,on_front\n"
        .to_owned();
    for subject in subjects {
        let front = judge(&subject.settings).front;
        for (i, m) in subject.settings.iter().enumerate() {
            // Names may hold commas and quotes.
            let name = subject.name.replace('"', "\"\"");
            let holes = m.holes.map_or(String::new(), |h| h.to_string());
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "\"{name}\",{},{},{},{},{},{},{},{},{},{},{},{},{},{holes},{},{},{}",
                m.knob,
                m.value,
                m.frame.cpu_ms,
                m.cpu_ms_range[0],
                m.cpu_ms_range[1],
                m.frame.wall_ms,
                m.first.cpu_ms,
                m.first.wall_ms,
                m.image_bytes,
                m.images_made,
                m.psnr,
                m.ssim,
                m.coverage,
                m.steps_from_exact,
                m.psnr_to_exact,
                front.contains(&i)
            );
        }
    }
    text
}

/// For people.
fn table(subject: &Subject) -> String {
    let verdict = judge(&subject.settings);
    let mut text = format!("{}: {}\n", subject.name, subject.about);
    let _ = writeln!(
        text,
        "  {:<20}{:>9}{:>9}{:>11}{:>9}{:>9}{:>9}{:>12}",
        "setting", "CPU ms", "wall ms", "first, ms", "MB", "PSNR", "SSIM", "from exact"
    );
    for (i, m) in subject.settings.iter().enumerate() {
        let mark = if verdict.front.contains(&i) { "*" } else { " " };
        let _ = writeln!(
            text,
            "{mark} {:<20}{:>9}{:>9}{:>11}{:>9}{:>9.2}{:>9.4}{:>12}",
            m.name,
            round(m.frame.cpu_ms),
            round(m.frame.wall_ms),
            round(m.first.wall_ms),
            round(m.image_bytes as f64 / 1e6),
            m.psnr,
            m.ssim,
            round(m.steps_from_exact)
        );
    }
    for skip in &subject.skips {
        let same = if skip.same_bytes { "the same" } else { "OTHER" };
        let _ = writeln!(
            text,
            "  --no-skip={}: {} CPU ms, {} with all, {same} bytes; left out: {}",
            skip.name,
            round(skip.without.cpu_ms),
            round(skip.with.cpu_ms),
            skip.fired.as_deref().unwrap_or("nothing")
        );
    }
    for (name, reason) in &subject.failed {
        let _ = writeln!(text, "  {name}: {reason}");
    }
    let _ = writeln!(text, "{}\n", verdict.text());
    text
}
