//! `lumigraph info` of a calibration's file without photos.

use super::output::{print, print_json, say};
use calibrate::Camera;
use calibrate::opencv::{self, Keys, OpenCvCalibration, OpenCvCamera};
use serde_json::{Value, json};
use std::path::Path;

pub(super) fn run(path: &Path, keys: &Keys, as_json: bool) -> anyhow::Result<()> {
    let calibration = opencv::read_calibration(path, keys)?;
    for note in &calibration.notes {
        say!("note: {note}");
    }
    let info = gather(&calibration);
    if as_json {
        return print_json(&info);
    }
    print(&text(&info))
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
