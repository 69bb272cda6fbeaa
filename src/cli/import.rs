//! `lumigraph import`

use super::exposure::ExposureArgs;
use super::options::{KeyArgs, print_warnings};
use super::output::{print, say};
use super::session::progress;
use lumigraph::scene::{ImportOptions, Scene};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Make a scene of photos and their calibration
///
/// PHOTOS is a capture (a folder with `images/` and a COLMAP model in `sparse/0`, `sparse`,
/// `dense/sparse` or itself, or else an OpenCV calibration with poses), or the photo folder
/// alone, with --calibration. Photos are not copied, except with --undistort.
///
/// An OpenCV calibration is a file in YAML, XML or JSON as its calibration sample writes it:
/// camera matrix, distortion, and extrinsic parameters. Its poses are given to the photos in
/// the order of a list within or beside it (images.yml), else in the order of their names.
///
///     lumigraph import my-capture -o my-scene
///     lumigraph import photos --calibration out_camera_data.yml -o my-scene
///     lumigraph import my-capture --undistort -o my-scene
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
    /// Write undistorted photos into the scene's folder, and pinhole cameras for them
    ///
    /// As large as the photos fill them, as PNG; photos without distortion are copied. What a
    /// wide lens sees more than 60° aside is left out, and masked where its photos end before.
    #[arg(long)]
    undistort: bool,
    #[command(flatten)]
    exposure: ExposureArgs,
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
        strict: args.strict,
    };
    let (mut scene, warnings) = Scene::import(&args.photos, &options)?;
    print_warnings(&warnings);
    let exposure = args.exposure.choose(&mut scene, &BTreeSet::new());
    say!("exposure: {}", exposure.text());
    if args.undistort {
        let bar = progress(scene.photos.len(), "undistorting photos");
        let step = || bar.inc(1);
        let warnings = scene.save_undistorted(&args.output, args.force, args.strict, &step);
        bar.finish_and_clear();
        print_warnings(&warnings?);
    } else {
        scene.save(&args.output, args.force)?;
    }
    print(&format!(
        "{}: {} photos, {} points\n",
        args.output.display(),
        scene.photos.len(),
        scene.reconstruction.points.len()
    ))
}
