//! `lumigraph import`

use super::Usage;
use super::options::{KeyArgs, print_warnings};
use super::output::{print, say};
use super::uncalibrated::UncalibratedArgs;
use lumigraph::scene::{ImportOptions, Scene, SceneError, Warning};
use std::path::PathBuf;

/// Make a scene of photos and their calibration, or of photos alone
///
/// PHOTOS is a capture (a folder with `images/` and a COLMAP model in `sparse/0`, `sparse`,
/// `dense/sparse` or itself, or else an OpenCV calibration with poses), or the photo folder
/// alone, with --calibration. Photos are not copied.
///
/// An OpenCV calibration is a file in YAML, XML or JSON as its calibration sample writes it:
/// camera matrix, distortion, and extrinsic parameters. Its poses are given to the photos in
/// the order of a list within or beside it (images.yml), else in the order of their names.
///
/// Without a calibration, COLMAP is run if it is installed. A video may be given instead of
/// photos: ffmpeg takes its sharpest frames, into the scene's folder. Interrupted, the same
/// command goes on where it was.
///
///     lumigraph import my-capture -o my-scene
///     lumigraph import photos --calibration out_camera_data.yml -o my-scene
///     lumigraph import sweep.mp4 --frames 60 -o my-scene
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    /// The capture, or its photos, or a video
    photos: PathBuf,
    /// The COLMAP model, a folder with one in the usual places, or OpenCV's file
    /// [default: PHOTOS]
    #[arg(long, value_name = "PATH")]
    calibration: Option<PathBuf>,
    #[command(flatten)]
    keys: KeyArgs,
    #[command(flatten)]
    uncalibrated: UncalibratedArgs,
    /// Fail on a missing or corrupt photo instead of leaving it out
    #[arg(long)]
    strict: bool,
    /// Replace the scene that OUTPUT holds
    #[arg(long)]
    force: bool,
    /// The scene's folder
    #[arg(short, long, value_name = "SCENE")]
    output: PathBuf,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    // Before what may take hours.
    Scene::check_free(&args.output, args.force)?;

    // 1. The photos.
    let is_video = args.photos.is_file();
    if !is_video && args.uncalibrated.asks_for_frames() {
        let message = "--frames and --fps are for a video's file, and PHOTOS is none";
        return Err(Usage(message.to_owned()).into());
    }
    let (capture, frames) = if is_video {
        let folder = Scene::frames_folder(&args.output);
        let frames = args.uncalibrated.extract(&args.photos, &folder)?;
        (folder, frames)
    } else {
        (args.photos.clone(), Vec::new())
    };

    // 2. Their calibration.
    let mut options = ImportOptions {
        calibration: args.calibration.clone(),
        keys: args.keys.keys(),
        strict: args.strict,
    };
    let imported = match Scene::import(&capture, &options) {
        Err(SceneError::Uncalibrated { .. }) => {
            let work = Scene::colmap_folder(&args.output);
            let uncalibrated = &args.uncalibrated;
            options.calibration = Some(uncalibrated.calibrate(&capture, is_video, &work)?);
            let (scene, mut warnings) = Scene::import(&capture, &options)?;
            // Said already, and why.
            warnings.retain(|w| !matches!(w, Warning::Uncalibrated { .. }));
            Ok((scene, warnings))
        }
        imported => {
            if args.uncalibrated.asks_for_matching() && imported.is_ok() {
                say!("note: --matching changes nothing: the photos have a calibration");
            }
            imported
        }
    };
    let (mut scene, warnings) = imported?;
    print_warnings(&warnings);
    for photo in &mut scene.photos {
        let frame = frames.iter().find(|frame| frame.name == photo.name);
        photo.time_s = frame.map(|frame| frame.time_s);
    }
    scene.save(&args.output, args.force)?;
    print(&format!(
        "{}: {} photos, {} points\n",
        args.output.display(),
        scene.photos.len(),
        scene.reconstruction.points.len()
    ))
}
