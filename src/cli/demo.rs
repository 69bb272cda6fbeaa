//! `lumigraph demo`

use super::Cli;
use super::output::{print, write_file};
use super::targets::check_folder;
use anyhow::{Context, bail};
use calibrate::Rigid3;
use clap::Parser;
use lumigraph::scene::Scene;
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
    /// The folder for everything; an earlier demo's output there is replaced
    #[arg(short, long, value_name = "DIR", default_value = "lumigraph-demo")]
    output: PathBuf,
}

/// Marks a folder as a demo's: only such a one is emptied.
const MARKER: &str = "lumigraph-demo.txt";

/// What a demo leaves in its folder, in order, and what it is.
const PARTS: [(&str, &str); 6] = [
    (
        "capture",
        "the photos, their calibration, and the truth about them",
    ),
    ("scene", "the scene, with its proxy"),
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
    let commands: [&[&str]; 6] = [
        &["generate", "shelf", "-o", &capture],
        &["import", &capture, "-o", &scene],
        &["proxy", &scene, "plane", "--hold-out", &split],
        &[
            "render", &scene, "--path", "orbit", "--frames", "12", "-o", &frames,
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

/// Removes what an earlier demo left.
fn clear(folder: &Path) -> anyhow::Result<()> {
    let failed = || format!("{}: cannot clear the folder", folder.display());
    let occupied = folder.exists()
        && std::fs::read_dir(folder)
            .with_context(failed)?
            .next()
            .is_some();
    if occupied && !folder.join(MARKER).is_file() {
        bail!(
            "{}: holds something other than an earlier demo; choose another folder with -o",
            folder.display()
        );
    }
    for (part, _) in PARTS {
        let path = folder.join(part);
        if path.is_dir() {
            std::fs::remove_dir_all(&path).with_context(failed)?;
        } else if path.exists() {
            std::fs::remove_file(&path).with_context(failed)?;
        }
    }
    Ok(())
}
