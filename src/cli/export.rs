//! `lumigraph export`

use super::Usage;
use super::inputs::{calibration_of, files_behind_scene, model_files};
use super::options::{Doubtful, SceneArgs, beside_counts};
use super::output::{print, say, write_file};
use super::targets::{check_apart, check_file, check_folder};
use anyhow::bail;
use calibrate::export::{
    FrameFiles, check_colmap, check_colmap_text, has_board, opencv_yaml, transforms_json,
};
use calibrate::{Image, Reconstruction, colmap};
use clap::ValueEnum;
use lumigraph::scene::{DEPTH_UNITS_PER_STEP, Photo, Scene, SceneError, relative};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Write a scene's cameras, poses and points for other programs
///
/// A COLMAP model is a folder, and one that is there and says something else is replaced with
/// --force alone; transforms.json (nerfstudio) and OpenCV's calibration are a
/// file, which names the photos by their paths from where it lies, transforms.json their ignore
/// masks, depth maps and times, too. Photos are not copied.
/// What a format cannot express is an error: `import --undistort` gives pinhole cameras, which
/// all of them can. Tilted sensors and skewed fisheyes are OpenCV's alone.
/// Photos and points that what draws leaves out as unsure or wrong are written, too, which a note says.
///
///     lumigraph export my-scene --format colmap -o model
///     lumigraph export my-scene --format transforms -o my-scene/transforms.json
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    #[command(flatten)]
    scene: SceneArgs,
    /// Whose format
    #[arg(long, value_enum)]
    format: Format,
    /// Replace another model, or whatever else, that PATH holds
    #[arg(long)]
    force: bool,
    /// The model's folder, or the file
    #[arg(short, long, value_name = "PATH")]
    output: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    /// COLMAP's binary model: cameras, poses, points and their tracks
    Colmap,
    /// COLMAP's text model: the same, of photos without white space in their names
    ColmapText,
    /// nerfstudio's transforms.json: cameras, poses and times
    Transforms,
    /// OpenCV's YAML: one camera and its poses; the corners of a board
    #[value(name = "opencv")]
    OpenCv,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let output = &args.output;
    let is_file = matches!(args.format, Format::Transforms | Format::OpenCv);
    if is_file && output.is_dir() {
        let message = "is a folder, but this format is a file; give its name with -o";
        return Err(Usage(format!("{} {message}", output.display())).into());
    }
    match is_file {
        true => check_file(output, "-o")?,
        false => check_folder(output)?,
    }
    let scene = args.scene.open_whole()?;
    let written = match is_file {
        true => vec![output.to_owned()],
        false => model_files(output),
    };
    // Over the calibration, above all: what is written lacks the photos that were left out, whose poses are nowhere
    // else.
    let inputs = files_behind_scene(&args.scene.scene, &scene);
    check_apart(
        "the scene is",
        "-o",
        written.iter().map(PathBuf::as_path),
        &inputs,
    )?;
    match is_file {
        true => check_no_picture(output)?,
        false => check_model_folder(&scene, output)?,
    }
    let whole = &scene.reconstruction;
    if !is_file && !args.force {
        check_no_other_model(whole, args.format, output)?;
    }
    match args.format {
        Format::Colmap => {
            check_colmap(whole)?;
            colmap::write_binary(whole, output)?;
        }
        Format::ColmapText => {
            check_colmap_text(whole)?;
            colmap::write_text(whole, output)?;
        }
        Format::Transforms => {
            let files = files(&scene, output)?;
            let text = transforms_json(whole, &|image| of(&files, image))?;
            write_text(&text, args)?;
        }
        Format::OpenCv => {
            let files = files(&scene, output)?;
            let text = opencv_yaml(whole, &|image| of(&files, image).photo)?;
            write_text(&text, args)?;
        }
    }
    say_beside(&scene, args.format);
    say_doubtful(&scene, args.format);
    print(&format!(
        "{}: {} photos, {}\n",
        output.display(),
        whole.images.len(),
        match args.format {
            Format::Transforms => "no points: the format has none".to_owned(),
            Format::OpenCv if !has_points(whole, args.format) => {
                "no points: the format has those of a calibration board alone".to_owned()
            }
            _ => format!("{} points", whole.points.len()),
        }
    ))
}

/// Writes a calibration, and fails where it would replace anything else, as
/// [`check_no_other_model`] does.
fn write_text(text: &str, args: &Args) -> anyhow::Result<()> {
    let output = &args.output;
    let is_other =
        || std::fs::read(output).map_or(output.exists(), |there| there != text.as_bytes());
    if !args.force && is_other() {
        bail!(
            "{}: holds something else; nothing was written: replace it with --force, or choose another -o",
            output.display()
        );
    }
    write_file(output, text.as_bytes())
}

/// Whether sparse points are written.
fn has_points(whole: &Reconstruction, format: Format) -> bool {
    match format {
        Format::Colmap | Format::ColmapText => true,
        Format::Transforms => false,
        Format::OpenCv => has_board(whole),
    }
}

/// Says which of the photos and points that are written what draws leaves out.
fn say_doubtful(scene: &Scene, format: Format) {
    let whole = &scene.reconstruction;
    let mut doubtful = Doubtful::of(scene);
    if !has_points(whole, format) {
        doubtful.contradicted = 0;
    }
    doubtful.say(whole.points.len(), "exported all the same, though ");
}

/// What the names of pictures end in.
const PICTURES: [&str; 4] = ["jpg", "jpeg", "png", "webp"];

/// Fails where a file of text would be called as a picture, by which others know what it is.
fn check_no_picture(output: &Path) -> Result<(), Usage> {
    let end = output.extension().unwrap_or_default();
    if !PICTURES.iter().any(|known| end.eq_ignore_ascii_case(known)) {
        return Ok(());
    }
    let text = format!(
        "-o {}: that is a picture's name, but this format is a text; choose another, as transforms.json or camera.yml",
        output.display()
    );
    Err(Usage(text))
}

/// Fails where a COLMAP model would lie among the scene's photos, or with the model of any scene: of one in binary
/// and one in text beside it nobody knows which is read.
fn check_model_folder<'a>(scene: &'a Scene, output: &Path) -> anyhow::Result<()> {
    let Ok(real) = output.canonicalize() else {
        return Ok(());
    };
    let is_output = |folder: &Path| folder.canonicalize().is_ok_and(|folder| folder == real);
    // From the one that a photo lies in up to the one that its name counts from.
    let around = |photo: &'a Photo| {
        let count = Path::new(&photo.name).components().count();
        photo.path.ancestors().skip(1).take(count)
    };
    let folders: BTreeSet<&Path> = scene.photos.iter().flat_map(around).collect();
    if folders.into_iter().any(is_output) {
        bail!(
            "{}: the scene's photos are in this very folder; nothing was written: choose another -o",
            output.display()
        );
    }
    let beside = real.parent().filter(|folder| Scene::is_scene(folder));
    let own = beside.and_then(calibration_of);
    if own.is_some_and(|own| is_output(&own)) {
        bail!(
            "{}: a scene's own model is in this very folder; nothing was written: choose another -o",
            output.display()
        );
    }
    Ok(())
}

/// Fails where a COLMAP model would be replaced, or hidden behind one in binary, that says anything else: it may be the
/// only calibration that somebody's photos have. One that says the same, as an earlier export does, is no loss.
fn check_no_other_model(
    whole: &Reconstruction,
    format: Format,
    output: &Path,
) -> anyhow::Result<()> {
    // Of one in binary where text is to be written the writer tells, and of one with rigs.
    let extension = match format {
        Format::Colmap => "bin",
        _ => "txt",
    };
    if ["rigs", "frames"]
        .iter()
        .any(|stem| output.join(format!("{stem}.{extension}")).exists())
    {
        return Ok(());
    }
    let is_lost = |file: &PathBuf| {
        let is_text = file.extension().is_some_and(|end| end == "txt");
        (is_text || matches!(format, Format::Colmap)) && file.exists()
    };
    let Some(file) = model_files(output).into_iter().find(is_lost) else {
        return Ok(());
    };
    if colmap::read_model(output).is_ok_and(|there| there == *whole) {
        return Ok(());
    }
    bail!(
        "{}: holds {}, of another COLMAP model; nothing was written: replace it with --force, or choose another -o",
        output.display(),
        file.file_name().unwrap_or_default().display()
    )
}

/// The files of a scene's photos by the photos' names, as seen from a file's folder, and their times.
fn files<'a>(scene: &'a Scene, file: &Path) -> Result<BTreeMap<&'a str, FrameFiles>, SceneError> {
    let folder = match file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let has_depth = depth_scale(scene).is_some();
    let of_photo = |photo: &'a Photo| {
        let beside = |file: Option<&Path>| file.map(|file| relative(folder, file)).transpose();
        let depth = photo.depth_map.as_deref().filter(|_| has_depth);
        let files = FrameFiles {
            photo: relative(folder, &photo.path)?,
            mask: beside(photo.ignore_mask.as_deref())?,
            depth: beside(depth)?,
            time_s: photo.time_s,
        };
        Ok((photo.name.as_str(), files))
    };
    scene.photos.iter().map(of_photo).collect()
}

/// Those of an image; one without a photo has its name alone.
fn of(files: &BTreeMap<&str, FrameFiles>, image: &Image) -> FrameFiles {
    let known = files.get(image.name.as_str()).cloned();
    known.unwrap_or_else(|| FrameFiles {
        photo: image.name.clone(),
        mask: None,
        depth: None,
        time_s: None,
    })
}

/// World units a step of the scene's depth maps, where a `transforms.json` can name them: if all
/// photos have one, in the same steps.
fn depth_scale(scene: &Scene) -> Option<f64> {
    let of = |photo: &Photo| {
        let scale = photo.depth_scale.unwrap_or(DEPTH_UNITS_PER_STEP);
        photo.depth_map.as_ref().map(|_| scale)
    };
    let mut scales = scene.photos.iter().map(of);
    let first = scales.next()??;
    scales.all(|scale| scale == Some(first)).then_some(first)
}

/// Says what beside the photos is not in the file or model, or in a way that its readers must know of.
fn say_beside(scene: &Scene, format: Format) {
    let total = scene.photos.len();
    let counts = beside_counts(scene);
    let [masks, .., depth_maps] = counts.map(|(_, n)| n);
    let is_transforms = matches!(format, Format::Transforms);
    if is_transforms && masks > 0 && masks < total {
        say!(
            "note: {masks} of {total} photos have an ignore mask; nerfstudio wants one for each or \
             for none"
        );
    }
    let scale = depth_scale(scene).filter(|_| is_transforms);
    if let Some(scale) = scale.filter(|scale| *scale != DEPTH_UNITS_PER_STEP) {
        say!(
            "note: the depth maps are in steps of {scale} world units, which the file cannot say: \
             give nerfstudio-data --depth-unit-scale-factor {scale}, or --depth-scale {scale} to \
             `import`"
        );
    }
    if is_transforms && depth_maps > 0 && scale.is_none() {
        say!(
            "note: left out: {depth_maps} depth maps; nerfstudio wants one for each of the {total} \
             photos, all in the same steps"
        );
    }
    // Of nerfstudio's, masks, depth maps and times are dealt with.
    let has_place = |what: &str| is_transforms && ["ignore masks", "depth maps"].contains(&what);
    let others = counts
        .into_iter()
        .filter(|(what, n)| *n > 0 && !has_place(what));
    let mut others: Vec<String> = others.map(|(what, n)| format!("{n} {what}")).collect();
    let count = |has: fn(&Photo) -> bool| scene.photos.iter().filter(|p| has(p)).count();
    for (what, n, has_place) in [
        ("times", count(|p| p.time_s.is_some()), is_transforms),
        ("gains", count(|p| p.gain.is_some()), false),
    ] {
        if n > 0 && !has_place {
            others.push(format!("{what} of {n} photos"));
        }
    }
    if !others.is_empty() {
        let others = others.join(", ");
        say!("note: left out: {others}; the format has no place for them");
    }
}
