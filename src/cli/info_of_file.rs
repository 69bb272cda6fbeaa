//! `lumigraph info` of a calibration's file without photos.

use super::output::{print, print_json, say};
use anyhow::anyhow;
use calibrate::colmap::{self, ColmapError};
use calibrate::opencv::{self, Keys, OpenCvCalibration, OpenCvCamera, OpenCvError};
use calibrate::{Camera, Reconstruction, formats};
use capture::as_argument;
use lumigraph::scene::{self, Sizes};
use serde_json::{Value, json};
use std::path::Path;

pub(super) fn run(path: &Path, keys: &Keys, as_json: bool) -> anyhow::Result<()> {
    let info = match formats::detect(path).or_else(|| formats::meant(path)) {
        Some(format) => {
            say_unused_keys(keys, &path.display().to_string());
            let (whole, sizes) = scene::read_bare(format, path)?;
            if sizes == Sizes::Unknown {
                say!(
                    "note: neither the file nor photos beside it tell the photos' size; principal \
                     points, and focal lengths given as angles, are in parts of it"
                );
            }
            of_reconstruction(&whole, sizes)
        }
        None if colmap::is_part(path) => {
            say_unused_keys(keys, &path.display().to_string());
            // One of a model's files stands for all, if the others are there.
            let folder = path.parent().unwrap_or(Path::new(""));
            let whole = match colmap::read_model(folder) {
                Err(ColmapError::NoModel { .. }) => Reconstruction {
                    cameras: colmap::read_cameras(path)?,
                    ..Reconstruction::default()
                },
                model => model?,
            };
            of_reconstruction(&whole, Sizes::Known)
        }
        None => {
            let calibration = opencv::read_calibration(path, keys);
            let calibration = calibration.map_err(|error| unknown(path, error))?;
            for note in &calibration.notes {
                say!("note: {note}");
            }
            gather(&calibration)
        }
    };
    print_info(&info, as_json)
}

/// Of a file that is none of OpenCV's, as the last that it could be, what all of them are; and of a camera path that
/// it is one.
fn unknown(path: &Path, error: OpenCvError) -> anyhow::Error {
    if let Ok(read) = render::path::read(path) {
        let frames = match read.frames.len() {
            1 => "one frame".to_owned(),
            count => format!("{count} frames"),
        };
        let (named, argument) = (path.display(), as_argument(path));
        return anyhow!(
            "{named}: a camera path of {frames}, no calibration; `lumigraph render SCENE --path {argument} -o \
             FRAMES` draws it, or of an interior `lumigraph walk INTERIOR --path {argument} -o FRAMES`"
        );
    }
    match error {
        OpenCvError::NotStorage { path, problem } => {
            let remedy = scene::remedy_of_model(&path);
            let remedy = remedy.map_or_else(String::new, |remedy| format!("; {remedy}"));
            anyhow!(
                "{}: no calibration that is known here: {problem}; expected a file of a COLMAP model, OpenCV's \
                 (YAML, XML or JSON, gzip or not), a transforms.json, or Bundler's, VisualSFM's, LLFF's, \
                 Meshroom's or OpenMVG's{remedy}",
                path.display()
            )
        }
        error => error.into(),
    }
}

/// The same of the folder of a COLMAP model.
pub(super) fn of_model(folder: &Path, keys: &Keys, as_json: bool) -> anyhow::Result<()> {
    say_unused_keys(keys, &format!("the COLMAP model in {}", folder.display()));
    let whole = colmap::read_model(folder)?;
    print_info(&of_reconstruction(&whole, Sizes::Known), as_json)
}

/// Says which options for OpenCV's files change nothing of another calibration, called so for people.
pub(super) fn say_unused_keys(keys: &Keys, calibration: &str) {
    if let Some(note) = scene::unused_keys(keys, calibration) {
        say!("note: {note}");
    }
}

fn print_info(info: &Value, as_json: bool) -> anyhow::Result<()> {
    if as_json {
        return print_json(info);
    }
    print(&text(info))
}

fn of_reconstruction(whole: &Reconstruction, sizes: Sizes) -> Value {
    let known = sizes == Sizes::Known;
    let cameras = whole.cameras.iter().map(|(id, camera)| {
        json!({
            "name": id.0.to_string(),
            "model": camera.model.name(),
            "width": known.then_some(camera.width),
            "height": known.then_some(camera.height),
            "params": camera.params,
        })
    });
    let names = whole.images.values().map(|image| &image.name);
    json!({
        "cameras": cameras.collect::<Vec<_>>(),
        "poses": whole.images.len(),
        "photos": names.collect::<Vec<_>>(),
        "points": whole.points.len(),
    })
}

fn gather(calibration: &OpenCvCalibration) -> Value {
    json!({
        "cameras": calibration.cameras.iter().map(camera).collect::<Vec<_>>(),
        "poses": calibration.photo_poses().len(),
        "photos": calibration.image_names,
        "points": calibration.board.as_ref().map_or(0, |board| board.corners.len()),
    })
}

/// In our pixels.
fn camera(camera: &OpenCvCamera) -> Value {
    // Only the names matter, not the size.
    let (width, height) = camera.size.unwrap_or((1, 1));
    let Camera { model, params, .. } = Camera::of(&camera.lens, width, height);
    json!({
        "name": camera.name,
        "model": model.name(),
        "width": camera.size.map(|(width, _)| width),
        "height": camera.size.map(|(_, height)| height),
        "params": params,
    })
}

fn text(info: &Value) -> String {
    let mut text = String::new();
    for camera in info["cameras"].as_array().into_iter().flatten() {
        let name = camera["name"].as_str().unwrap_or_default();
        let size = match (camera["width"].as_u64(), camera["height"].as_u64()) {
            (Some(width), Some(height)) => format!("{width}×{height}"),
            _ => "of unstated size".to_owned(),
        };
        let model = camera["model"].as_str().unwrap_or_default();
        text += &format!("camera   {name}: {model} {size} {}\n", camera["params"]);
    }
    let photos = info["photos"].as_array().map_or(0, Vec::len);
    text += &format!("poses    {}, {photos} photos named\n", info["poses"]);
    text += &format!("points   {}\n", info["points"]);
    text
}
