//! `lumigraph import`

use super::exposure::ExposureArgs;
use super::options::{KeyArgs, beside_text, positive, print_warnings};
use super::output::{print, say};
use super::session::progress;
use lumigraph::scene::{DEPTH_UNITS_PER_STEP, ImportOptions, Scene, TimeSource};
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
/// Masks and depth maps in PHOTOS/masks and PHOTOS/depth are found by the photos' names.
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
    /// Ignore masks (0 = ignore, 255 = use): a.jpg.png or a.png for a.jpg
    /// [default: PHOTOS/masks, if there]
    #[arg(long, value_name = "DIR")]
    masks: Option<PathBuf>,
    /// Use no ignore masks
    #[arg(long, conflicts_with = "masks")]
    no_masks: bool,
    /// Object mattes, named likewise: what is cut out keeps its smooth outline, as with
    /// photos that have an alpha channel. PHOTOS/masks given here is not used as ignore
    /// masks
    #[arg(long, value_name = "DIR")]
    mattes: Option<PathBuf>,
    /// Depth maps, named likewise: 16-bit grey PNG, depth along z, 0 = none
    /// [default: PHOTOS/depth, if there]
    #[arg(long, value_name = "DIR")]
    depth: Option<PathBuf>,
    /// World units a step of the depth maps
    #[arg(long, value_name = "UNITS", default_value_t = DEPTH_UNITS_PER_STEP,
        value_parser = positive)]
    depth_scale: f64,
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
        masks: args.masks.clone(),
        no_masks: args.no_masks,
        mattes: args.mattes.clone(),
        depth: args.depth.clone(),
        depth_scale: args.depth_scale,
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
        "{}: {} photos, {} points{}\n",
        args.output.display(),
        scene.photos.len(),
        scene.reconstruction.points.len(),
        beside_text(&scene)
    ))
}
