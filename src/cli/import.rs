//! `lumigraph import`

use super::options::{KeyArgs, positive, print_warnings};
use super::output::print;
use lumigraph::scene::{ImportOptions, Scene, TimeSource};
use std::path::PathBuf;

/// Make a scene of photos and their calibration
///
/// PHOTOS is a capture (a folder with `images/` and a COLMAP model in `sparse/0`, `sparse`,
/// `dense/sparse` or itself, or else an OpenCV calibration with poses), or the photo folder
/// alone, with --calibration. Photos are not copied.
///
/// An OpenCV calibration is a file in YAML, XML or JSON as its calibration sample writes it:
/// camera matrix, distortion, and extrinsic parameters. Its poses are given to the photos in
/// the order of a list within or beside it (images.yml), else in the order of their names.
///
///     lumigraph import my-capture -o my-scene
///     lumigraph import photos --calibration out_camera_data.yml -o my-scene
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    /// The capture, or its photos
    photos: PathBuf,
    /// The COLMAP model, a folder with one in the usual places, or OpenCV's file
    /// [default: PHOTOS]
    #[arg(long, value_name = "PATH")]
    calibration: Option<PathBuf>,
    #[command(flatten)]
    keys: KeyArgs,
    /// When each photo was taken: lines of name,seconds [default: PHOTOS/times.csv, else
    /// what cameras wrote into the photos or into their names]
    #[arg(long, value_name = "FILE.csv")]
    times: Option<PathBuf>,
    /// The photos are frames of a video, counted in their names, so many a second
    #[arg(long, value_name = "F", value_parser = positive, conflicts_with = "times",
        allow_negative_numbers = true)]
    frame_rate: Option<f64>,
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
    let options = ImportOptions {
        calibration: args.calibration.clone(),
        keys: args.keys.keys(),
        times: match (&args.times, args.frame_rate) {
            (Some(file), _) => TimeSource::List(file.clone()),
            (None, Some(per_second)) => TimeSource::FrameRate(per_second),
            (None, None) => TimeSource::Found,
        },
        strict: args.strict,
    };
    let (mut scene, warnings) = Scene::import(&args.photos, &options)?;
    print_warnings(&warnings);
    scene.save(&args.output, args.force)?;
    print(&format!(
        "{}: {} photos, {} points\n",
        args.output.display(),
        scene.photos.len(),
        scene.reconstruction.points.len()
    ))
}
