//! `lumigraph export`

use super::Usage;
use super::inputs::{calibration_in, calibration_of, model_files, parts_of};
use super::options::SceneArgs;
use super::output::{print, write_file};
use anyhow::bail;
use calibrate::export::{
    FrameFiles, check_colmap, check_colmap_text, has_board, opencv_yaml, transforms_json,
};
use calibrate::{Image, colmap};
use clap::ValueEnum;
use lumigraph::scene::{Photo, Scene, relative};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Write a scene's cameras, poses and points for other programs
///
/// A COLMAP model is a folder; transforms.json (nerfstudio) and OpenCV's calibration are a
/// file, which names the photos by their paths from where it lies. Photos are not copied.
/// What a format cannot express is an error: `import --undistort` gives pinhole cameras, which
/// all of them can. Tilted sensors and skewed fisheyes are OpenCV's alone.
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
    /// The model's folder, or the file
    #[arg(short, long, value_name = "PATH")]
    output: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    /// COLMAP's binary model: everything
    Colmap,
    /// COLMAP's text model: everything, of photos without white space in their names
    ColmapText,
    /// nerfstudio's transforms.json: cameras and poses
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
    let scene = args.scene.open_whole()?;
    check_calibration(&scene, &args.scene.scene, output, is_file)?;
    let whole = &scene.reconstruction;
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
            let files = Files::new(&scene, output);
            let text = transforms_json(whole, &|image| files.of(image))?;
            write_file(output, text.as_bytes())?;
        }
        Format::OpenCv => {
            let files = Files::new(&scene, output);
            let text = opencv_yaml(whole, &|image| files.of(image).photo)?;
            write_file(output, text.as_bytes())?;
        }
    }
    print(&format!(
        "{}: {} photos, {}\n",
        output.display(),
        whole.images.len(),
        match args.format {
            Format::Transforms => "no points: the format has none".to_owned(),
            Format::OpenCv if !has_board(whole) => {
                "no points: the format has those of a calibration board alone".to_owned()
            }
            _ => format!("{} points", whole.points.len()),
        }
    ))
}

/// Fails where the output would take the place of the scene's calibration: what is written
/// lacks the photos that were left out, whose poses are nowhere else.
fn check_calibration(
    scene: &Scene,
    given: &Path,
    output: &Path,
    is_file: bool,
) -> anyhow::Result<()> {
    let written = match is_file {
        true => vec![output.to_owned()],
        false => model_files(output),
    };
    let origin = scene.calibration.as_deref().or(scene.capture.as_deref());
    let read = [calibration_of(given), origin.and_then(calibration_in)];
    let real = |path: PathBuf| path.canonicalize().ok();
    let kept: Vec<PathBuf> = read
        .into_iter()
        .flatten()
        .flat_map(|path| parts_of(&path))
        .filter_map(real)
        .collect();
    let is_kept = |path: &PathBuf| real(path.clone()).is_some_and(|path| kept.contains(&path));
    if let Some(file) = written.iter().find(|path| is_kept(path)) {
        bail!(
            "{}: the scene's calibration is this very file; nothing was written: choose another -o",
            file.display()
        );
    }
    Ok(())
}

/// Where a scene's photos and masks lie, as seen from a file's folder.
struct Files<'a> {
    photos: BTreeMap<&'a str, &'a Photo>,
    folder: PathBuf,
}

impl<'a> Files<'a> {
    fn new(scene: &'a Scene, file: &Path) -> Self {
        let folder = match file.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        Self {
            photos: scene.photos.iter().map(|p| (p.name.as_str(), p)).collect(),
            folder: folder.to_owned(),
        }
    }

    fn of(&self, image: &Image) -> FrameFiles {
        let photo = self.photos.get(image.name.as_str());
        let mask = photo.and_then(|photo| photo.ignore_mask.as_deref());
        FrameFiles {
            photo: photo.map_or_else(
                || image.name.clone(),
                |photo| relative(&self.folder, &photo.path),
            ),
            mask: mask.map(|mask| relative(&self.folder, mask)),
        }
    }
}
