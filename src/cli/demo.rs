//! `lumigraph demo`

use super::Cli;
use super::output::{print, write_file};
use super::targets::check_folder;
use anyhow::{Context, bail};
use calibrate::Rigid3;
use capture::is_left_of;
use clap::Parser;
use datasets::Options;
use lumigraph::scene::{Scene, other_within};
use render::path::default_name;
use render::{CameraPath, PathFrame};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A built-in scene from photos to novel views, a field picture and scores
///
/// Runs the other commands one after the other and shows them, so that they can be run
/// again on photos of one's own.
///
///     lumigraph demo
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    /// The folder for everything; an earlier demo's output there is replaced, unless files of one's own lie
    /// among it
    #[arg(short, long, value_name = "DIR", default_value = "lumigraph-demo")]
    output: PathBuf,
}

/// Marks a folder as a demo's: only such a one is emptied.
const MARKER: &str = "lumigraph-demo.txt";
/// Which of the synthetic captures it is of.
const DATASET: &str = "shelf";
/// How many novel views.
const FRAMES: usize = 12;
/// The part that `import` replaces, unless files of one's own lie in it.
const SCENE: &str = "scene";

/// What a demo leaves in its folder, in order, and what it is.
const PARTS: [(&str, &str); 6] = [
    (
        "capture",
        "the photos, their calibration, and the truth about them",
    ),
    (SCENE, "the scene, with its proxy"),
    (
        "frames",
        "novel views, along a path through the photos' places",
    ),
    (
        "forward.json",
        "a path of one frame, a third of the way from the photos on",
    ),
    (
        "field.png",
        "the blending field there: a colour for each photo",
    ),
    (
        "evaluation",
        "the held-out photos as rendered from the others",
    ),
];

/// The photo from which the step forward is taken: one in the middle.
const MIDDLE: &str = "0008.png";
/// How far it goes towards the proxy. The photos' places lie behind the viewer then, near
/// the line of sight, and the field shows each as a spot of its colour.
const STEP: f64 = 0.33;

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let folder = &args.output;
    check_folder(folder)?;
    clear(folder)?;
    let at = |part: &str| folder.join(part).display().to_string();
    let [capture, scene, frames, forward, field, evaluation] = PARTS.map(|(part, _)| at(part));
    let split = at("capture/split.json");
    let count = FRAMES.to_string();
    let import: [&str; 5] = ["import", &capture, "-o", &scene, "--force"];
    // It need not be forced where there is no scene yet.
    let words = 4 + usize::from(Scene::is_scene(Path::new(&scene)));
    let commands: [&[&str]; 6] = [
        &["generate", DATASET, "-o", &capture],
        &import[..words],
        &["proxy", &scene, "plane", "--hold-out", &split],
        &[
            "render", &scene, "--path", "orbit", "--frames", &count, "-o", &frames,
        ],
        &[
            "field", &scene, "--path", &forward, "--view", "forward", "-o", &field,
        ],
        &["evaluate", &scene, "-o", &evaluation],
    ];
    let shown = commands.map(|words| format!("lumigraph {}\n", words.join(" ")));
    write_file(&folder.join(MARKER), shown.concat().as_bytes())?;
    for (words, shown) in commands.into_iter().zip(&shown) {
        print(&format!("$ {shown}"))?;
        if words[0] == "field" {
            step_forward(Path::new(&scene), Path::new(&forward))?;
        }
        let line = std::iter::once("lumigraph").chain(words.iter().copied());
        super::run(Cli::try_parse_from(line)?)?;
    }

    print("\nWritten:\n")?;
    for (part, what) in PARTS {
        print(&format!("  {:32} {what}\n", at(part)))?;
    }
    Ok(())
}

/// Writes a path whose only frame lies ahead of a photo's place.
fn step_forward(scene: &Path, path: &Path) -> anyhow::Result<()> {
    let (scene, _) = Scene::open(scene, true)?;
    let image = scene
        .reconstruction
        .images
        .values()
        .find(|i| i.name == MIDDLE);
    let image = image.with_context(|| format!("photo {MIDDLE} is not in the scene"))?;
    let camera = &scene.reconstruction.cameras[&image.camera_id];
    let view = scene.view(MIDDLE)?;
    let plane = scene.fit_plane(&BTreeSet::new())?.plane;
    let ahead = plane.intersect(view.center(), view.forward());
    let ahead = ahead.context("the photo looks away from the proxy")?;
    let center = view.center().lerp(ahead, STEP);
    let rotation = view.camera_from_world.rotation;
    let pose = Rigid3::new(rotation, -(rotation * center));
    let frame = PathFrame::new("forward".to_owned(), camera.clone(), pose, None)?;
    render::path::write(path, &CameraPath::new(1.0, vec![frame])?)?;
    Ok(())
}

/// Removes what an earlier demo left, but for its scene, whose place another takes.
///
/// # Errors
/// Something that no demo wrote lies there, and would go, too: then nothing is removed.
fn clear(folder: &Path) -> anyhow::Result<()> {
    let failed = || format!("{}: cannot clear the folder", folder.display());
    let occupied = folder.exists()
        && std::fs::read_dir(folder)
            .with_context(failed)?
            .next()
            .is_some();
    if !occupied {
        return Ok(());
    }
    if !folder.join(MARKER).is_file() {
        bail!(
            "{}: holds something other than an earlier demo; choose another folder with -o",
            folder.display()
        );
    }
    Scene::check_free(&folder.join(SCENE), true)?;
    let written = written(folder)?;
    let parts = PARTS.iter().filter(|(part, _)| *part != SCENE);
    let parts: Vec<PathBuf> = parts.map(|(part, _)| folder.join(part)).collect();
    for part in &parts {
        let other = match part.is_dir() {
            true => other_within(part, |file| is_of(file, &written))?,
            false => Some(part.clone()).filter(|file| file.exists() && !written.contains(file)),
        };
        if let Some(other) = other {
            bail!(
                "{}: no demo wrote this, and it would go with what an earlier one left there; move it away, or \
                 choose another folder with -o",
                other.display()
            );
        }
    }
    for part in parts {
        if part.is_dir() {
            std::fs::remove_dir_all(&part).with_context(failed)?;
        } else if part.exists() {
            std::fs::remove_file(&part).with_context(failed)?;
        }
    }
    Ok(())
}

/// The files that a demo leaves in its folder, but for those of its scene.
fn written(folder: &Path) -> anyhow::Result<BTreeSet<PathBuf>> {
    let dataset = datasets::by_name(DATASET, &Options::default())?;
    let in_part = |part: &str, file: &Path| folder.join(part).join(file);
    let capture = datasets::files(&dataset).into_iter();
    let mut files: BTreeSet<PathBuf> = capture.map(|file| in_part("capture", &file)).collect();
    let frames = (0..FRAMES).map(|i| format!("{}.png", default_name(i)));
    files.extend(frames.map(|frame| in_part("frames", Path::new(&frame))));
    let held_out = dataset.held_out.iter().map(Path::new);
    files.extend(held_out.map(|photo| in_part("evaluation", photo)));
    files.extend(["forward.json", "field.png"].map(|file| folder.join(file)));
    Ok(files)
}

/// Whether a file is one of those written, or what a demo that was killed left beside its place.
fn is_of(file: &Path, written: &BTreeSet<PathBuf>) -> bool {
    let name = |path: &Path| path.file_name().unwrap_or_default().display().to_string();
    let is_left =
        |whole: &PathBuf| file.parent() == whole.parent() && is_left_of(&name(file), &name(whole));
    written.contains(file) || written.iter().any(is_left)
}
