//! `lumigraph walk`

mod empty;
mod report;
mod scant;
mod tour;

use super::Usage;
use super::captured::{Opened, Photos};
use super::film::{FilmArgs, FrameChoice, frame_choice};
use super::frames::read_path;
use super::inputs::{files_behind, scenes_of, video_of};
use super::interior::{check_holds_none, check_there};
use super::made::{self, Made};
use super::notes::Notes;
use super::options::{cut, size};
use super::output::{print, print_json, say, write_file};
use super::path::{NerfstudioArgs, check_is_file};
use super::references::{ReferenceArgs, before_ldis};
use super::report::is_empty;
use super::session::progress;
use super::shot::say_other_look;
use super::targets::{check_film, check_folder, check_in_no_part, others};
use super::took::Start;
use anyhow::{Context, bail};
use calibrate::View;
use clap::ValueEnum;
use cpu_time::ProcessTime;
use lumigraph::scene::{Truth, picture_files};
use render::CameraPath;
use render::interior::{Painter, Pinhole, PinholeError, PortalFill, Splat, Walk, WalkOptions};
use report::{Drawn, Report, Scored, Walked, ms, times_svg};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Walk through an interior
///
/// The room one is in is drawn as geometry; what lies beyond its portals as geometry too, or out of
/// images made before the portals: as textures, warped, or as layered depth images. Geometry has
/// the model's colours, or those of the photos of a capture's rooms. Frames are PNGs; times.svg
/// plots how long each takes to draw, and below that, where portals show images, how long with
/// making those that are not there yet: so long one stands still ("with making", at worst).
/// path.json is the tour (no other path is written over). --held-out draws the photos that were
/// held out when the interior was made, and scores them as `evaluate` does.
///
///     lumigraph walk house --portals all -o walk
///     lumigraph walk house --path film/path.json -o frames --video film.mp4
///     lumigraph walk office --held-out --portals all,whole -o scored
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    /// The interior: a folder with interior.json, or that file
    interior: PathBuf,
    /// A path file, nerfstudio's too, or a screenshot of `view`
    #[arg(long, value_name = "FILE", conflicts_with = "tour")]
    path: Option<PathBuf>,
    #[command(flatten)]
    nerfstudio: NerfstudioArgs,
    /// Walk through all rooms [default, where there is no --path]
    #[arg(long)]
    tour: bool,
    /// Draw and score the photos that were held out when the interior was made; distorted ones are not drawn:
    /// make it of what `import --undistort` writes
    #[arg(
        long,
        conflicts_with_all = ["tour", "path", "frames", "video", "fps", "resume", "persist"]
    )]
    held_out: bool,
    /// Frames of a tour [default: 520]; or which of a path's are drawn, counted from 0, so that several
    /// runs share a film: 120..240, or 120..240/300 of a tour
    #[arg(long, value_name = "N|A..B", value_parser = frame_choice)]
    frames: Option<FrameChoice>,
    /// What portals show: geometry, texture, warp1, warp2, ldi, several of them, or all; of several,
    /// each has a folder of its own. whole draws everything as if there were no cells
    #[arg(
        long,
        value_name = "KIND",
        value_delimiter = ',',
        default_value = "geometry"
    )]
    portals: Vec<String>,
    /// Size of the frames in pixels [default: the path's own; of a tour 640x512]
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<(u32, u32)>,
    #[command(flatten)]
    references: ReferenceArgs,
    /// Make all LDIs, though there are files of them (`lumigraph ldis`). The same bytes, later
    #[arg(long)]
    no_ldi_files: bool,
    /// Draw samples as squares of so many pixels, not as large as their footprints
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..=16))]
    splat: Option<u32>,
    /// Nearer to a portal than this, in radii of its semicircle (of 1.5 widths), what is beyond is
    /// geometry; images are mixed in from 5/6 of it on [default: 1; of LDIs made of photos 0.55]
    #[arg(long, value_name = "RADII")]
    near: Option<f64>,
    /// Keep the last frame's colours where no image shows anything
    #[arg(long, conflicts_with = "resume")]
    persist: bool,
    /// Leave nothing out, or nothing of what is named, though no picture needs it: cells as a whole,
    /// columns of LDIs that are out of sight. The same bytes, later
    #[arg(long, value_enum, value_name = "WHAT", num_args = 0.., require_equals = true,
        value_delimiter = ',', default_missing_value = "all")]
    no_skip: Vec<NoSkip>,
    #[command(flatten)]
    film: FilmArgs,
    /// Print times, and what was drawn and skipped, as JSON
    #[arg(long)]
    json: bool,
    /// The folder for the frames
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

impl Args {
    /// Which frames.
    fn chosen(&self) -> FrameChoice {
        self.frames.clone().unwrap_or_default()
    }
}

/// What is not to be left out.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum NoSkip {
    All,
    Cells,
    Columns,
}

/// Frames a second of a tour.
const FPS: f64 = 15.0;

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let start = Start::now();
    // 1. What to do.
    let fills = fills(&args.portals)?;
    args.references.check()?;
    if let Some(near) = args.near.filter(|near| !(*near >= 0.0 && near.is_finite())) {
        let text = format!("--near is {near}; expected 0 or more");
        return Err(Usage(text).into());
    }
    if let Some(file) = &args.path {
        let remedy = "give a path's file, or leave out --path, to walk a tour through all rooms";
        check_is_file(file, remedy)?;
        check_there(file)?;
    }
    let chosen = args.chosen();
    chosen.check(args.path.is_none())?;
    let keeps_colors = args.persist && fills.iter().any(|fill| fill.shows_images());
    if keeps_colors && chosen.is_part() {
        let text = "--persist: what a frame keeps is of the one before; draw all of the path";
        return Err(Usage(text.to_owned()).into());
    }
    if args.film.video().is_some() && fills.len() > 1 {
        let text = "--video makes a film of one kind of --portals";
        return Err(Usage(text.to_owned()).into());
    }
    let keeps = |what| args.no_skip.iter().any(|n| *n == NoSkip::All || *n == what);
    let defaults = WalkOptions::default();
    let mut options = WalkOptions {
        whole_cells: keeps(NoSkip::Cells),
        whole_ldis: keeps(NoSkip::Columns),
        splat: args.splat.map_or(Splat::Footprint, Splat::Fixed),
        near: args.near.unwrap_or(defaults.near),
        near_photos: args.near.unwrap_or(defaults.near_photos),
        persist: args.persist,
        ..defaults
    };
    check_holds_none(&args.output)?;
    check_folder(&args.output)?;
    check_in_no_part(&args.output, "-o")?;
    args.film.check(&args.output)?;
    // 2. What there is.
    let warn = |text| say!("warning: {text}");
    let references = &args.references;
    let use_photos = !references.no_photos || args.held_out;
    let exposure = use_photos.then_some(&references.exposure);
    let mut opened = Opened::new(&args.interior, exposure, warn)?;
    let named = || args.interior.display().to_string();
    options.library = references.options(opened.photos.is_some());
    let way = match args.held_out {
        true => {
            let frames = held_out(opened.photos.as_ref(), args.size).with_context(named)?;
            Way {
                files: frames.iter().map(|frame| frame.file.clone()).collect(),
                frames,
                fps: FPS,
                tour: None,
            }
        }
        false => way(args, &opened)?,
    };
    check_views(args, &way.frames)?;
    let views = way.frames.iter().map(|f| (f.name.as_str(), &f.view));
    args.film.check_sizes(views)?;
    let mut inputs = opened.files();
    let mut scenes = scenes_of(&opened.file, &opened.interior);
    let videos: Vec<PathBuf> = scenes.iter().filter_map(|scene| video_of(scene)).collect();
    check_film(args.film.file(), &videos)?;
    if opened.photos.is_none() {
        scenes.clear();
    }
    let named = args.path.iter().chain(args.nerfstudio.file()).cloned();
    inputs.extend(files_behind(named, &scenes));
    args.nerfstudio.say_unused(args.path.as_ref());
    // 3. The walks: one walker, so that images are made once for all kinds.
    if references.no_photos {
        opened.photos = None;
    }
    if let Some(photos) = &opened.photos {
        say!("exposure: {}", photos.exposure.text());
    }
    let mut painter = opened.painter(references.device(), references.cpu_memory)?;
    if let Some(file) = &args.path {
        let ldi_views = options.library.with_photos(painter.captured()).ldi_views;
        let drawn: Vec<String> = fills.iter().map(|fill| fill.spelled(ldi_views)).collect();
        say_other_look(file, &drawn);
    }
    let mut notes = Notes::default();
    notes.keep(opened.photos.iter().flat_map(Photos::left_out));
    if fills.contains(&PortalFill::Ldi) {
        references.say_unused_views(&options.library, &painter);
    }
    let ldis = match fills.contains(&PortalFill::Ldi) && !args.no_ldi_files {
        true => ldi_files(&opened, &options, &painter, &mut notes)?,
        false => None,
    };
    let note = match fills.contains(&PortalFill::Ldi) && ldis.is_none() {
        true => before_ldis(&options.library, &mut painter),
        false => None,
    };
    notes.say_new(&painter);
    if let Some(note) = note {
        notes.say(note);
    }
    let (interior, contents, model) = (&opened.interior, &opened.contents, &opened.model);
    std::thread::scope(|scope| {
        let mut walk = Walk::with(painter, interior, contents, model, options);
        if let Err(error) = walk.make_ahead(scope) {
            notes.say(format!("{error}; no LDI is made ahead of need"));
        }
        if let Some(folder) = &ldis {
            walk.use_ldi_files(folder);
        }
        let walks = walk_all(args, &mut walk, &fills, &way, &inputs, &mut notes)?;
        if let [walked] = &walks[..] {
            args.film.finish(&walked.files, way.fps)?;
        }
        say_others(args, &walks)?;
        notes.say_new(walk.painter());
        if let Some(note) = empty::note(args, &walks) {
            notes.say(note);
        }
        if let Some(captured) = walk.painter().captured().filter(|_| !args.held_out)
            && let Some(note) = scant::note(interior, contents, captured, &walks)
        {
            notes.say(note);
        }
        let frames_empty = empty::count(&walks);
        let whole = Report::new(&walk, notes.into_all(), frames_empty, &start);
        report(args, &opened, &walk, &walks, &way.frames, &whole)
    })
}

/// The folder of LDIs that `lumigraph ldis` made as this walk would, if it did. What is said of others is
/// noted.
fn ldi_files(
    opened: &Opened,
    options: &WalkOptions,
    painter: &Painter,
    notes: &mut Notes,
) -> anyhow::Result<Option<PathBuf>> {
    let made = || {
        let (files, photos) = (opened.files(), opened.photos.as_ref());
        Made::new(&opened.file, &files, &options.library, painter, photos)
    };
    made::usable(&opened.file, made, |text| notes.say(text))
}

/// Draws all frames, by each kind of portals.
fn walk_all(
    args: &Args,
    walk: &mut Walk<'_>,
    fills: &[PortalFill],
    way: &Way,
    inputs: &[PathBuf],
    notes: &mut Notes,
) -> anyhow::Result<Vec<Walked>> {
    // 1. Which frames are there.
    let mut begun = Vec::new();
    let mut folders = Vec::new();
    for fill in fills {
        let folder = match fills.len() {
            1 => args.output.clone(),
            _ => args.output.join(fill.name()),
        };
        let in_folder = |file: &PathBuf| folder.join(file);
        let all: Vec<PathBuf> = way.files.iter().map(in_folder).collect();
        let files = way.frames.iter().map(|frame| in_folder(&frame.file));
        let files: Vec<PathBuf> = files.collect();
        let is_there = args.film.begin(&folder, &files, &all, inputs)?;
        begun.push((*fill, files, is_there));
        folders.push(folder);
    }
    // 2. The path, not before: beside frames that are not of this walk stays theirs.
    if let Some(tour) = &way.tour {
        tour::keep(args, tour)?;
    }
    // 3. The others.
    let mut walks = Vec::new();
    for (fill, files, is_there) in begun {
        walk.begin();
        let drawn = draw(walk, fill, &way.frames, files, &is_there, &args.film, notes);
        walks.push(drawn?);
    }
    // 4. Whether they are still of one film.
    for folder in &folders {
        args.film.left_out(folder)?;
    }
    Ok(walks)
}

/// What the walks took.
fn report(
    args: &Args,
    opened: &Opened,
    walk: &Walk<'_>,
    walks: &[Walked],
    frames: &[Named],
    whole: &Report,
) -> anyhow::Result<()> {
    let interior = &opened.interior;
    let device = walk.painter().description();
    let references = walk.library().residency();
    let captured = walk.painter().captured();
    let photos = captured.map(|captured| &captured.lumigraph().photos);
    // Where all frames are from before, so is their plot.
    if let (Some(first), Some(last)) = (frames.first(), frames.last())
        && let Some(svg) = times_svg(walks, &(first.index..=last.index))
    {
        write_file(&args.output.join("times.svg"), svg.as_bytes())?;
    }
    if args.json {
        let walks: Vec<Value> = walks.iter().map(|w| w.json(interior)).collect();
        return print_json(&json!({
            "triangles": opened.triangles,
            "cells": interior.cells.len(),
            "portals": interior.portals.len(),
            "device": device,
            "references_possible": walk.library().len(),
            "references_made": references.loads,
            "references_let_go": references.evictions,
            "references_peak_bytes": references.peak,
            "photos_peak_bytes": photos.map(|photos| photos.residency().peak),
            "photos_decoded": photos.map(|photos| photos.decoded()),
            "video": args.film.video(),
            "walks": walks,
            "report": whole,
        }));
    }
    say!("{}", whole.text());
    let mut text = format!(
        "{:<10} {:>9} {:>9} {:>9} {:>11} {:>9} {:>9} {:>8} {:>7} {:>5}",
        "portals",
        "median ms",
        "95 % ms",
        "worst ms",
        "with making",
        "triangles",
        "samples",
        "holes",
        "images",
        "LDIs"
    );
    if args.held_out {
        let titles = ["psnr", "ssim", "coverage", "cpu ms"];
        text += &titles.map(|title| format!(" {title:>8}")).concat();
    }
    text += "\n";
    for walk in walks {
        text += &walk.line();
    }
    print(&format!(
        "{text}{}: {} frames{}, drawn by {device}\n",
        args.output.display(),
        frames.len(),
        from_before(walks)
    ))
}

/// Says where pictures of other walks lie among those of these, or beside them, whatever portals showed.
fn say_others(args: &Args, walks: &[Walked]) -> anyhow::Result<()> {
    if args.chosen().is_part() {
        return Ok(());
    }
    let own: Vec<PathBuf> = walks.iter().flat_map(|walk| walk.files.clone()).collect();
    let kinds = PortalFill::ALL.into_iter().chain([PortalFill::Whole]);
    let folders = kinds.map(|fill| args.output.join(fill.name()));
    let folders: Vec<PathBuf> = folders.collect();
    let folders = folders.iter().chain([&args.output]).map(PathBuf::as_path);
    for note in others(folders, &own)? {
        say!("note: {note}");
    }
    Ok(())
}

/// How many frames were there before, for people: of each kind of portals, if that differs.
fn from_before(walks: &[Walked]) -> String {
    let count = walks.first().map_or(0, Walked::before);
    if walks.iter().any(|walk| walk.before() != count) {
        let of_kind = |walk: &Walked| format!("{} of {}", walk.before(), walk.fill.name());
        let counts: Vec<String> = walks.iter().map(of_kind).collect();
        return format!(", from before {}", counts.join(", "));
    }
    match count {
        0 => String::new(),
        _ => format!(", {count} of them from before"),
    }
}

fn fills(names: &[String]) -> anyhow::Result<Vec<PortalFill>> {
    let mut fills = Vec::new();
    for name in names {
        match (name.as_str(), PortalFill::from_name(name)) {
            ("all", _) => fills.extend(PortalFill::ALL),
            (_, Some(fill)) => fills.push(fill),
            _ => {
                let known = PortalFill::ALL.map(PortalFill::name).join(", ");
                let text = format!("--portals: unknown {name:?}; expected {known}, whole, or all");
                return Err(Usage(text).into());
            }
        }
    }
    let mut once = Vec::new();
    for fill in fills {
        if !once.contains(&fill) {
            once.push(fill);
        }
    }
    Ok(once)
}

/// What is to be drawn.
struct Way {
    frames: Vec<Named>,
    /// Of all frames of the path, as those of several parts of it share a folder: from that folder.
    files: Vec<PathBuf>,
    /// How many of them a film shows a second.
    fps: f64,
    /// The whole tour that they are of, if they are of one.
    tour: Option<CameraPath>,
}

struct Named {
    /// In the path, counted from 0.
    index: usize,
    name: String,
    /// From the folder for the frames.
    file: PathBuf,
    view: View,
    /// What the frame is to be compared with.
    truth: Option<Truth>,
}

/// The photos that were held out.
fn held_out(photos: Option<&Photos>, size: Option<(u32, u32)>) -> anyhow::Result<Vec<Named>> {
    let held_out = photos.map(|photos| photos.held_out(size));
    let held_out = held_out.transpose()?.unwrap_or_default();
    let names = held_out.iter().map(|(name, ..)| (name.as_str(), true));
    let files = picture_files("frame", names, Path::new(""))?;
    let held_out = held_out.into_iter().zip(files).enumerate();
    let named = held_out.map(|(index, ((name, view, truth), file))| Named {
        index,
        name,
        file,
        view,
        truth: Some(truth),
    });
    let named: Vec<Named> = named.collect();
    if named.is_empty() {
        bail!(
            "no photos were held out when it was made; make it with `interior --hold-out SPLIT.json`"
        );
    }
    Ok(named)
}

/// The frames of a path, or of a tour.
fn way(args: &Args, opened: &Opened) -> anyhow::Result<Way> {
    let (path, tour) = match &args.path {
        Some(file) => {
            let read = read_path(file, &args.nerfstudio.frame()?)?;
            (read, None)
        }
        None => {
            let tour = tour::plan(args, opened)?;
            (tour.clone(), Some(tour))
        }
    };
    let names = path.frames.iter().map(|f| (f.name.as_str(), true));
    let files = picture_files("frame", names, Path::new(""))?;
    let frames = path.frames.into_iter().zip(&files).enumerate();
    let named = frames.map(|(index, (frame, file))| Named {
        index,
        name: frame.name,
        file: file.clone(),
        view: cut(frame.view, args.size),
        truth: None,
    });
    Ok(Way {
        frames: args.chosen().of(named.collect())?,
        files,
        fps: path.fps,
        tour,
    })
}

/// Fails where a frame's view is none that interiors are drawn for, before any is drawn.
fn check_views(args: &Args, frames: &[Named]) -> anyhow::Result<()> {
    for Named { name, view, .. } in frames {
        let Err(error) = Pinhole::new(view) else {
            continue;
        };
        let named = match &args.path {
            Some(path) => format!("{}: frame {name}", path.display()),
            None if args.held_out => format!("{}: photo {name}", args.interior.display()),
            None => format!("frame {name}"),
        };
        let remedy = match error {
            PinholeError::Distorted if args.held_out => {
                ": import the photos with --undistort, and make the interior of that scene"
            }
            PinholeError::Distorted => ": give the frame the model PINHOLE",
            PinholeError::NotFinite | PinholeError::Size(..) => "",
        };
        bail!("{named}: {error}{remedy}");
    }
    Ok(())
}

/// Draws those frames that are not there, into their files, and says what there is to say after each.
fn draw(
    walk: &mut Walk<'_>,
    fill: PortalFill,
    frames: &[Named],
    files: Vec<PathBuf>,
    is_there: &[bool],
    film: &FilmArgs,
    notes: &mut Notes,
) -> anyhow::Result<Walked> {
    let missing = is_there.iter().filter(|is_there| !**is_there).count();
    let bar = progress(missing, fill.name());
    let made_before = walk.library().residency().loads;
    let mut drawn = Vec::new();
    for ((frame, file), is_there) in frames.iter().zip(&files).zip(is_there) {
        if *is_there {
            continue;
        }
        let named = || format!("frame {}", frame.name);
        let mut cost = walk.draw(&frame.view, fill).with_context(named)?;
        let mut scored = None;
        if let Some(truth) = &frame.truth {
            // Once more, when all that it needs is there.
            let first = cost;
            let start = ProcessTime::now();
            cost = walk.draw(&frame.view, fill).with_context(named)?;
            let cpu_ms = ms(start.elapsed());
            cost.references_made += first.references_made;
            cost.ldis_made += first.ldis_made;
            cost.ldis_read += first.ldis_read;
            cost.ldis_ahead += first.ldis_ahead;
            cost.references += first.references;
            cost.waited += first.waited;
            let score = truth.score(&walk.picture().picture())?;
            scored = Some(Scored { score, cpu_ms });
        }
        let picture = walk.picture().picture();
        let (is_empty, shown) = (is_empty(&picture), scant::shown(&picture));
        film.write(file, picture)?;
        bar.suspend(|| notes.say_new(walk.painter()));
        drawn.push(Drawn {
            index: frame.index,
            name: frame.name.clone(),
            file: file.clone(),
            cost,
            scored,
            is_empty,
            shown,
        });
        bar.inc(1);
    }
    bar.finish_and_clear();
    // Portals that LDIs fill show no image itself, and others no LDI.
    let (references_used, ldis_used) = match (fill, walk.references_used()) {
        (PortalFill::Ldi, used) => (0, used),
        (_, used) => (used, 0),
    };
    let made = walk.library().residency().loads - made_before;
    Ok(Walked {
        fill,
        frames: drawn,
        files,
        references_used,
        ldis_used,
        references_made: made as usize,
    })
}
