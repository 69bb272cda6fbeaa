//! `lumigraph import`

use super::Usage;
use super::damaged::left_out_text;
use super::exposure::ExposureArgs;
use super::hold::hold;
use super::inputs::video_of;
use super::interior::check_no_interior;
use super::options::{KeyArgs, beside_text, positive, print_warnings};
use super::output::{print, say};
use super::session::{progress, spinner};
use super::targets::check_folder;
use super::uncalibrated::UncalibratedArgs;
use anyhow::bail;
use calibrate::{colmap, formats, opencv};
use capture::video::FrameShape;
use capture::{as_argument, find_photos_folder};
use lumigraph::scene::file::Extra;
use lumigraph::scene::{
    ImportOptions, Kind, Scene, SceneError, SceneProxy, TimeSource, Warning, calibrated_size,
    relative, remedy_of_model,
};
use proxy::hull::TURNTABLE_STEPS;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Make a scene of photos and their calibration, or of photos alone
///
/// PHOTOS is a capture (a folder with `images/` and a COLMAP model in `sparse/0`, `sparse`,
/// `dense/sparse`, `colmap/sparse/0` or itself, or else an OpenCV calibration with poses), or the photo folder
/// alone, with --calibration. Of `sparse/0`, `sparse/1` and so on, the model with the most photos
/// is taken. Photos may lie in folders within, as one for each camera of a rig. They are not
/// copied, except with --undistort.
///
/// An OpenCV calibration is a file in YAML, XML or JSON as its calibration sample writes it:
/// camera matrix, distortion, and extrinsic parameters. Its poses are given to the photos in
/// the order of a list within or beside it (images.yml), else in the order of their names.
/// It speaks of photos as their EXIF orientation has them shown, which is how OpenCV reads them,
/// unless it says `ignore_orientation: 1`.
///
/// Masks and depth maps in PHOTOS/masks and PHOTOS/depth are found by the photos' names, others
/// where a transforms.json names them.
///
/// Without a calibration, COLMAP is run if it is installed. A video may be given instead of
/// photos: ffmpeg takes its sharpest frames, into the scene's folder. Interrupted, the same
/// command goes on where it was.
///
///     lumigraph import my-capture -o my-scene
///     lumigraph import photos --calibration out_camera_data.yml -o my-scene
///     lumigraph import my-capture --undistort -o my-scene
///     lumigraph import sweep.mp4 --frames 60 -o my-scene
///     lumigraph import car-photos --turntable 10 -o my-scene
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
    /// Depth maps, named likewise: 16-bit grey PNG, depth along z (of panoramas and photos
    /// that reach beyond 90° from their axis: along the ray), 0 = none
    /// [default: PHOTOS/depth, if there]
    #[arg(long, value_name = "DIR")]
    depth: Option<PathBuf>,
    /// Use no depth maps
    #[arg(long, conflicts_with_all = ["depth", "depth_scale"])]
    no_depth: bool,
    /// World units a step of the depth maps [default: what a transforms.json that names them says, else 0.001]
    #[arg(long, value_name = "UNITS", value_parser = positive)]
    depth_scale: Option<f64>,
    /// When each photo was taken: lines of name,seconds [default: PHOTOS/times.csv, else
    /// what cameras wrote into the photos or into their names]
    #[arg(long, value_name = "FILE.csv")]
    times: Option<PathBuf>,
    /// The photos are frames of a video, counted in their names, so many a second
    #[arg(long, value_name = "F", value_parser = positive, conflicts_with = "times")]
    frame_rate: Option<f64>,
    #[command(flatten)]
    uncalibrated: UncalibratedArgs,
    /// The photos are of an object on a turntable, DEGREES apart in the order of their names;
    /// cameras are found from its silhouettes
    ///
    /// For a perfect circle of cameras that look at its axis, upright. Degrees are positive where
    /// the camera moves counter-clockwise around the object as seen from above: the object turns
    /// clockwise. Silhouettes come from --mattes, the photos' alpha or a plain background. The
    /// scene has their hull as its proxy.
    #[arg(long, value_name = "DEGREES", value_parser = turntable_step,
        conflicts_with_all = ["calibration", "camera_matrix",
        "distortion", "fisheye", "matching", "frames", "fps", "undistort", "depth"])]
    turntable: Option<f64>,
    /// Photos were reduced or enlarged since they were calibrated, both sides alike: scale their cameras to them
    #[arg(long, conflicts_with = "turntable")]
    resized: bool,
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
    check_folder(&args.output)?;
    if Scene::put_back(&args.output)? {
        say!(
            "note: {}: an import was stopped as its scene took the place of another here; that one is back",
            args.output.display()
        );
    }
    Scene::check_free(&args.output, args.force)?;
    let given = [&args.calibration, &args.masks, &args.mattes, &args.depth];
    let inputs = given.into_iter().flatten().chain([&args.photos]).cloned();
    Scene::check_apart(&args.output, inputs.chain(find_photos_folder(&args.photos)))?;
    // What every scene names: the photos' folder, if they are not of a video, and what was given beside it.
    let folder = Some(&args.photos).filter(|photos| photos.is_dir());
    for named in folder.into_iter().chain(&args.calibration) {
        relative(&args.output, named)?;
    }

    // 1. The photos.
    check_no_interior(&args.photos)?;
    check_no_scene(&args.photos)?;
    let is_video = args.photos.is_file();
    if let Some(remedy) = remedy_of_model(&args.photos).filter(|_| is_video) {
        bail!(
            "{}: expected photos or a video; {remedy}",
            args.photos.display()
        );
    }
    if is_video {
        check_no_calibration(args)?;
    }
    if !is_video && args.uncalibrated.asks_for_frames() {
        let message = "--frames and --fps are for a video's file, and PHOTOS is none";
        return Err(Usage(message.to_owned()).into());
    }
    if is_video && args.frame_rate.is_some() {
        let message = "--frame-rate is for frames that are counted in their names, and a video tells its times itself; \
                       --times FILE.csv gives others";
        return Err(Usage(message.to_owned()).into());
    }
    if is_video && args.turntable.is_some() {
        let message = "--turntable takes a folder of photos in even steps, and PHOTOS is a file";
        return Err(Usage(message.to_owned()).into());
    }
    // Before another import's frames, or what its COLMAP does, are taken for one's own or replaced.
    let held = is_video.then(|| hold(&args.output)).transpose()?;
    let proxy_before = Scene::proxy_kind(&args.output);
    // The scene that is here stays whole until another takes its place.
    let aside = match is_video {
        true => {
            let shape = frame_shape(args);
            let (video, output) = (&args.photos, &args.output);
            args.uncalibrated.put_aside(video, shape, output)?
        }
        false => None,
    };
    let imported = import(args, is_video, held.is_some());
    match aside {
        Some(aside) if imported.is_ok() => aside.remove(),
        Some(aside) => aside.put_back()?,
        None => {}
    }
    let scene = imported?;
    if let (Some(kind), None) = (proxy_before, &scene.proxy) {
        say!(
            "note: {}: its own proxy ({kind}) is gone with the scene that was here; `lumigraph proxy` gives it another",
            args.output.display()
        );
    }
    print(&format!(
        "{}: {} photos, {} points{}\n",
        args.output.display(),
        scene.photos.len(),
        scene.reconstruction.points.len(),
        beside_text(&scene)
    ))
}

/// Makes the scene and writes it. `is_held` says whether nobody else works in its folder.
fn import(args: &Args, is_video: bool, is_held: bool) -> anyhow::Result<Scene> {
    let (capture, frames) = if is_video {
        let folder = Scene::frames_folder(&args.output);
        let shape = frame_shape(args);
        let frames = args.uncalibrated.extract(&args.photos, shape, &folder)?;
        (folder, frames)
    } else {
        (args.photos.clone(), Vec::new())
    };

    // 2. Their calibration.
    let mut options = ImportOptions {
        calibration: args.calibration.clone(),
        keys: args.keys.keys(),
        times: match (&args.times, args.frame_rate) {
            (Some(file), _) => TimeSource::List(file.clone()),
            (None, Some(per_second)) => TimeSource::FrameRate(per_second),
            (None, None) => TimeSource::Found,
        },
        resized: args.resized,
        strict: args.strict,
        masks: args.masks.clone(),
        no_masks: args.no_masks,
        mattes: args.mattes.clone(),
        depth: args.depth.clone(),
        no_depth: args.no_depth,
        depth_scale: args.depth_scale,
    };
    let first = match args.turntable {
        Some(step_degrees) => Scene::import_turntable(&capture, step_degrees, &options),
        None => Scene::import(&capture, &options),
    };
    let imported = match first {
        Err(SceneError::Uncalibrated { .. }) => {
            let _held = match is_held {
                true => None,
                false => Some(hold(&args.output)?),
            };
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
    let (mut scene, mut warnings) = imported?;
    warnings.extend(scene.leave_out_unwritable(args.strict)?);
    scene.video = match is_video {
        true => Some(args.photos.clone()),
        false => video_of_frames(&args.photos),
    };
    print_warnings(&warnings);
    let has_depth = scene.photos.iter().any(|photo| photo.depth_map.is_some());
    if args.depth_scale.is_some() && !has_depth {
        say!("note: --depth-scale changes nothing: no photo has a depth map");
    }
    if args.strict {
        check_photos(&scene)?;
    }
    // A list that is given says what the film does not, as of slow motion.
    let is_listed = args.times.is_some();
    let own = frames.iter().filter(|_| !is_listed);
    let time_of: BTreeMap<&str, f64> = own.map(|f| (f.name.as_str(), f.time_s)).collect();
    for photo in &mut scene.photos {
        if let Some(time_s) = time_of.get(photo.name.as_str()) {
            photo.time_s = Some(*time_s);
        }
    }
    let exposure = args.exposure.choose_to_write(&mut scene);
    // The scene keeps them: what is made of it may do without, or of their depth maps alone.
    for damaged in &exposure.left_out {
        say!("note: for matching exposures, {}", left_out_text(damaged));
    }
    say!("exposure: {}", exposure.text());
    if args.turntable.is_some() {
        keep_hull(&mut scene);
        scene.save_with_silhouettes(&args.output, args.force)?;
    } else if args.undistort {
        let bar = progress(scene.photos.len(), "undistorting photos");
        let step = || bar.inc(1);
        let asked = args.depth.is_some();
        let (output, strict) = (&args.output, args.strict);
        let warnings = scene.save_undistorted(output, args.force, strict, asked, &step);
        bar.finish_and_clear();
        print_warnings(&warnings?);
    } else {
        scene.save(&args.output, args.force)?;
    }
    Ok(scene)
}

/// The video that a folder's photos were taken out of, where they are those that a scene took out of one and keeps.
fn video_of_frames(photos: &Path) -> Option<PathBuf> {
    let photos = photos.canonicalize().ok()?;
    let scene = photos.parent()?;
    match Scene::frames_folder(scene) == photos {
        true => video_of(scene),
        false => None,
    }
}

/// Fails of a scene whose photos lie elsewhere, and of a scene's file: there is nothing to import.
fn check_no_scene(photos: &Path) -> anyhow::Result<()> {
    let what = if photos.is_file() && photos.ends_with("scene.json") {
        "the file of a scene, whose folder can be rendered as it is"
    } else if Scene::is_scene(photos) && find_photos_folder(photos).is_none() {
        "a scene already (scene.json), which can be rendered as it is"
    } else {
        return Ok(());
    };
    bail!(
        "{}: {what}; to import its photos anew, give the folder that they lie in",
        photos.display()
    )
}

/// Which shape a video's frames are to have where its pixels are not square: a calibration that was made of other
/// programs' frames speaks of them as they are stored, unless it is of another size.
fn frame_shape(args: &Args) -> FrameShape {
    let Some(calibration) = &args.calibration else {
        return FrameShape::Square;
    };
    match calibrated_size(calibration, &args.keys.keys()) {
        Some((width, height)) => FrameShape::Calibrated(width, height),
        None => FrameShape::Stored,
    }
}

/// Fails where PHOTOS is a file that is no video: the photos' calibration, maybe, or what else is written as
/// OpenCV's files are.
fn check_no_calibration(args: &Args) -> anyhow::Result<()> {
    let file = &args.photos;
    let format = formats::detect(file).or_else(|| formats::meant(file));
    if format.is_some() || colmap::is_part(file) || opencv::may_be_calibration(file) {
        let [argument, output] = [file, &args.output].map(|path| as_argument(path));
        bail!(
            "{}: a calibration, or no video at any rate; give its photos: `lumigraph import PHOTOS \
             --calibration {argument} -o {output}`",
            file.display()
        );
    }
    if opencv::is_storage_name(file) {
        bail!(
            "{}: no video, nor a calibration that is known here; give a video, or the folder of the photos",
            file.display()
        );
    }
    Ok(())
}

/// Fails of a photo that cannot be decoded, or what lies beside it.
pub(super) fn check_photos(scene: &Scene) -> Result<(), SceneError> {
    let bar = spinner("decoding every photo");
    let checked = scene.check_photos();
    bar.finish_and_clear();
    checked
}

/// Makes the hull of its silhouettes a scene's own proxy.
fn keep_hull(scene: &mut Scene) {
    let bar = spinner("carving the hull");
    let fitted = scene.fit(Kind::Hull, &BTreeSet::new());
    bar.finish_and_clear();
    match fitted {
        Ok(fitted) => {
            say!("proxy: hull, {}", fitted.how);
            scene.proxy = Some(SceneProxy {
                proxy: Ok(fitted.proxy),
                file: String::new(),
                fitted_without: Some(Vec::new()),
                other: Extra::new(),
            });
        }
        Err(error) => say!("note: the scene has no proxy of its own yet: {error}"),
    }
}

/// Degrees from photo to photo.
fn turntable_step(text: &str) -> Result<f64, String> {
    let (least, most) = (TURNTABLE_STEPS.start(), TURNTABLE_STEPS.end());
    match text.parse::<f64>() {
        Ok(step) if TURNTABLE_STEPS.contains(&step.abs()) => Ok(step),
        _ => Err(format!(
            "expected {least} to {most} degrees, or as many the other way (-10)"
        )),
    }
}
