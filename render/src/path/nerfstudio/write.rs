//! Writing nerfstudio's paths.

use super::{NerfstudioFrame, TRANSITION_S};
use crate::path::file::{KeyframeFile, PathFileError, write_whole};
use crate::path::{CameraPath, PathError};
use calibrate::{Camera, Lens, ModelKind};
use glam::DVec2;
use serde_json::{Value, json};
use std::path::Path;

/// The vertical field of view, in degrees, of a camera that nerfstudio's paths can say: a pinhole with
/// square pixels and its principal point in the middle, of a size.
///
/// # Errors
/// What else it is.
fn fov_of(camera: &Camera, (width, height): (u32, u32)) -> Result<f64, String> {
    if (camera.width, camera.height) != (width, height) {
        return Err(format!(
            "it is {} × {}, the first frame {width} × {height}; nerfstudio's paths have one size",
            camera.width, camera.height
        ));
    }
    let focal = camera.lens().map_err(|e| e.to_string())?.mean_focal();
    let middle = 0.5 * DVec2::new(f64::from(width), f64::from(height));
    let expected = Camera::of(&Lens::pinhole(DVec2::splat(focal), middle), width, height).params;
    // A simple pinhole has one focal length: from the end they agree.
    let mut pairs = camera.params.iter().rev().zip(expected.iter().rev());
    let is_pinhole = matches!(camera.model, ModelKind::Pinhole | ModelKind::SimplePinhole);
    if !(is_pinhole && pairs.all(|(a, b)| (a - b).abs() <= 1e-6 * focal)) {
        return Err(format!(
            "its camera is {} {:?}; nerfstudio's paths have pinholes alone, with square pixels and \
             their principal point in the middle",
            camera.model.name(),
            camera.params
        ));
    }
    Ok(2.0 * middle.y.atan2(focal).to_degrees())
}

/// Writes a path as nerfstudio's: its frames, and the keyframes that they were made of, if any. Where these
/// are what is wrong, errors name the file that they were `read_from`.
///
/// The file appears complete or not at all. Names and times of frames are lost.
///
/// # Errors
/// The file cannot be written; a camera is no pinhole with square pixels and its principal point in
/// the middle; frames differ in size.
pub fn write_nerfstudio(
    path: &Path,
    read_from: &Path,
    camera_path: &CameraPath,
    keyframes: Option<&KeyframeFile>,
    frame: &NerfstudioFrame,
) -> Result<(), PathFileError> {
    let of_path = |e| PathFileError::Path(read_from.to_owned(), e);
    let Some(first) = camera_path.frames.first().map(|f| &f.camera) else {
        return Err(of_path(PathError::Empty));
    };
    let size = (first.width, first.height);
    let aspect = f64::from(size.0) / f64::from(size.1);
    let fov = |kind: &'static str, index: usize, camera: &Camera| {
        fov_of(camera, size).map_err(|reason| {
            of_path(PathError::Malformed {
                kind,
                index,
                reason,
            })
        })
    };
    let frames = camera_path.frames.iter().enumerate();
    let frames = frames.map(|(i, f)| {
        Ok(json!({
            "camera_to_world": frame.camera_to_world(&f.view.camera_from_world),
            "fov": fov("frame", i, &f.camera)?,
            "aspect": aspect,
        }))
    });
    let frames: Vec<Value> = frames.collect::<Result<_, PathFileError>>()?;
    let given = keyframes.map_or(&[][..], |file| &file.keyframes);
    let mut stored: Vec<Value> = Vec::new();
    for (i, keyframe) in given.iter().enumerate() {
        let before = i.checked_sub(1).map(|i| given[i].t_s);
        let way_s = before.map(|before| keyframe.t_s - before);
        stored.push(json!({
            "matrix": frame.camera_to_world(&keyframe.camera_from_world),
            "fov": fov("keyframe", i, &keyframe.camera)?,
            "aspect": aspect,
            "override_transition_enabled": way_s.is_some(),
            "override_transition_sec": way_s,
        }));
    }
    let content = json!({
        "default_fov": frames[0]["fov"],
        "default_transition_sec": TRANSITION_S,
        "keyframes": stored,
        "camera_type": "perspective",
        "render_height": size.1,
        "render_width": size.0,
        "fps": camera_path.fps,
        "seconds": frames.len() as f64 / camera_path.fps,
        "is_cycle": false,
        "smoothness_value": 0.5,
        "camera_path": frames,
    });
    let json = |e| PathFileError::Json(path.to_owned(), e);
    let text = serde_json::to_string(&content).map_err(json)?;
    write_whole(path, &(text + "\n"))
}
