//! `lumigraph render`

use super::exposure::ExposureArgs;
use super::film::{FilmArgs, FrameChoice, frame_choice};
use super::frames::{Asked, FRAMES, NamedView, ViewArgs, apart_s, note_of_still};
use super::inputs::{files_behind, files_behind_scene, files_of};
use super::options::{DrawArgs, FieldArgs, FinishArgs, HoldOutArgs, SceneArgs, max_error};
use super::output::say;
use super::output::{print, print_json};
use super::path::NerfstudioArgs;
use super::report::Report;
use super::session::{Session, progress};
use super::shot::say_other_look;
use super::stamp::in_unicode;
use super::surface::ProxyArgs;
use super::targets::{
    check_film, check_folder, check_in_no_part, check_inputs, check_no_photos, others,
};
use super::time::{AtArgs, TimeArgs};
use super::took::Start;
use calibrate::View;
use lumigraph::scene::picture_files;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Render novel views
///
/// A frame is a PNG with the view's name; its alpha is coverage.
///
///     lumigraph render my-capture --path orbit --frames 60 -o frames
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    views: ViewArgs,
    /// Frames of a derived path [default: 30]; or which of a path's are drawn, counted from 0, so
    /// that several runs share a film: 120..240, or 120..240/300 of a derived path
    #[arg(long, value_name = "N|A..B", value_parser = frame_choice)]
    frames: Option<FrameChoice>,
    #[command(flatten)]
    nerfstudio: NerfstudioArgs,
    #[command(flatten)]
    hold_out: HoldOutArgs,
    #[command(flatten)]
    proxy: ProxyArgs,
    #[command(flatten)]
    exposure: ExposureArgs,
    #[command(flatten)]
    field: FieldArgs,
    /// Keep each frame's difference from --renderer exact within so many steps of 255 (the root
    /// of the mean square over pixels and channels; 1 is 48 dB, half of it 6 dB more): by
    /// measuring, the coarsest grid that does is taken, else exact [default: inf, not measured]
    #[arg(long, value_name = "STEPS", value_parser = max_error,
        conflicts_with_all = ["renderer", "grid"])]
    max_error: Option<f64>,
    #[command(flatten)]
    finish: FinishArgs,
    #[command(flatten)]
    draw: DrawArgs,
    #[command(flatten)]
    time: TimeArgs,
    #[command(flatten)]
    at: AtArgs,
    #[command(flatten)]
    film: FilmArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// The folder for the frames
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let start = Start::now();
    let chosen = args.frames.clone().unwrap_or_default();
    // Of a path that is not there nobody can say how many frames it has.
    let asked = Asked::new(&args.views, &args.nerfstudio.frame()?)?;
    chosen.check(asked.is_derived())?;
    if asked.is_derived() {
        chosen.check_end(chosen.count(FRAMES) as usize)?;
    }
    let file = args.views.path.as_ref().map(PathBuf::from);
    let file = file.filter(|_| !asked.is_derived());
    let read = args.views.views.as_ref().or(file.as_ref());
    args.nerfstudio.say_unused(read);
    if let (Some(read), None) = (read, args.max_error) {
        let options = args.field.options().spelled(args.field.method());
        say_other_look(read, &[options]);
    }
    let why_empty = asked.why_empty(args.nerfstudio.is_unplaced(read));
    check_folder(&args.output)?;
    args.film.check(&args.output)?;
    let scene = args.scene.open()?;
    // Photos that are left out, too, are nobody's to replace, nor the video that they were taken out of.
    let kept = files_behind_scene(&args.scene.scene, &scene);
    check_film(args.film.file(), &kept)?;
    check_no_photos(&args.output, &scene)?;
    check_in_no_part(&args.output, "-o")?;
    let without = args.hold_out.names(&scene)?;
    if let (Some(read), true) = (read, asked.has_times())
        && let Some(note) = args.time.note_of_unused(args.at.time, &scene)
    {
        say!("note: {}: {note}", read.display());
    }
    let asked = asked.in_scene(&scene);
    // What need not be derived is checked first: fitting a proxy may take long.
    let known: Vec<&NamedView> = match &asked {
        Asked::Read { views, .. } => chosen.of(views.iter().collect())?,
        Asked::Derived(_) => Vec::new(),
    };
    let file = read.map_or(String::new(), |read| format!("{}: ", read.display()));
    desired(args, &file, &known)?;
    let times = known
        .iter()
        .map(|f| (format!("{file}{}", f.name), f.time_s));
    let remedy = format!("{}, or --time for all", asked.untimed());
    args.time.check(args.at.time, &scene, times, &remedy)?;
    let mut session = Session::new(
        scene,
        without,
        args.scene.strict,
        &args.proxy,
        &args.exposure,
        &args.field,
        &args.draw,
        &args.time,
        args.at.time,
    )?;
    session.max_error = args.max_error;
    session.finish_as(&args.finish);
    session.why_empty = why_empty;
    let points = || session.points();
    let count = chosen.count(FRAMES);
    let is_derived = asked.is_derived();
    // Views of a model have their photos' times, at no rate.
    let is_path = !matches!(
        asked,
        Asked::Read {
            are_images: true,
            ..
        }
    );
    let (frames, fps) = asked.frames(count, session.lumigraph(), points)?;
    // Of all frames: those of several parts of a path share a folder.
    let names = frames.iter().map(|f| (f.name.as_str(), true));
    let all_files = picture_files("view", names, &args.output);
    let photos = session.lumigraph().sources.len();
    if let Some(note) = note_of_still(&frames, photos).filter(|_| is_derived) {
        session.note(note);
    }
    if is_path
        && args.at.time.is_none()
        && args.time.plays_a_part(None)
        && let Some(apart_s) = apart_s(&frames)
        && let Some(note) = args.film.note_of_rate(apart_s)
    {
        session.note(&note);
    }
    let frames = chosen.of(frames)?;
    let desired = desired(args, &file, &frames.iter().collect::<Vec<_>>())?;
    let all_files = all_files?;
    let files = chosen.of(all_files.clone())?;
    check_inputs(all_files.iter().map(PathBuf::as_path), &kept)?;
    let kind_or_file = [&args.views.path, &args.proxy.proxy].into_iter().flatten();
    let named = [&args.views.views, &args.hold_out.hold_out].into_iter();
    let named = named.flatten().chain(args.nerfstudio.file()).cloned();
    let named = named.chain(kind_or_file.map(PathBuf::from));
    let mut inputs = files_behind(named, std::slice::from_ref(&args.scene.scene));
    inputs.extend(files_of(&session.scene));
    let folder = &args.output;
    let mut is_there = args.film.begin(folder, &files, &all_files, &inputs)?;
    session.prepare()?;
    // The path stays as it was derived, whoever found them.
    session.leave_out_known(&args.film.left_out(folder)?)?;

    let view = |i: usize| {
        let moment = session.moment(&frames[i].name, frames[i].time_s)?;
        Ok((desired[i].clone(), moment))
    };
    let views = (0..files.len())
        .map(view)
        .collect::<anyhow::Result<Vec<_>>>()?;
    loop {
        let missing = is_there.iter().filter(|is_there| !**is_there).count();
        let bar = progress(missing, "rendering");
        let take = |i: usize, picture| {
            args.film.write(&files[i], picture)?;
            bar.inc(1);
            anyhow::Ok(())
        };
        let again = |left_out: &BTreeMap<String, String>| {
            bar.set_length(files.len() as u64);
            bar.set_position(0);
            args.film.leave_out(left_out, folder, &files, &all_files)
        };
        session.draw_all(&views, &mut is_there, take, again)?;
        bar.finish_and_clear();
        // Another run may have found one damaged meanwhile.
        if !session.leave_out_known(&args.film.left_out(folder)?)? {
            break;
        }
        args.film.remove(&files)?;
        is_there.fill(false);
    }
    args.film.finish(&files, fps)?;
    if !chosen.is_part() {
        for note in others([folder.as_path()], &files)? {
            say!("note: {note}");
        }
    }

    let report = Report::new(&session, &start);
    if args.json {
        let listed = frames
            .iter()
            .zip(&files)
            .enumerate()
            .map(|(i, (frame, file))| {
                // Those that were there cost nothing.
                let cost = (!is_there[i]).then(|| session.cost_json(i));
                json!({"name": frame.name, "file": in_unicode(file), "cost": cost})
            });
        return print_json(&json!({
            "frames": listed.collect::<Vec<_>>(),
            "video": args.film.video(),
            "proxy": session.proxy.json(),
            "exposure": session.exposure.json(),
            "report": report,
        }));
    }
    say!("proxy: {}", session.proxy.text());
    say!("exposure: {}", session.exposure.text());
    say!("{}", report.text());
    print(&format!(
        "{}: {} frames{}\n",
        args.output.display(),
        files.len(),
        match is_there.iter().filter(|is_there| **is_there).count() {
            0 => String::new(),
            there => format!(", {there} of them from before"),
        }
    ))
}

/// The views of frames in the size that is asked for; what is said of one begins with `file`, which it is read from.
///
/// # Errors
/// One cannot be drawn so large; a film is asked for, and they are not of one size.
fn desired(args: &Args, file: &str, frames: &[&NamedView]) -> anyhow::Result<Vec<View>> {
    let resized = |frame: &&NamedView| {
        let named = format!("{file}frame {}", frame.name);
        args.draw.resized(&named, frame.view.clone())
    };
    let desired = frames
        .iter()
        .map(resized)
        .collect::<anyhow::Result<Vec<_>>>()?;
    let names = frames.iter().map(|frame| frame.name.as_str());
    args.film.check_sizes(names.zip(&desired))?;
    Ok(desired)
}
