//! Reading nerfstudio's paths.

use super::{NerfstudioFrame, TRANSITION_S};
use crate::path::file::{KeyframeFile, PathFileError};
use crate::path::{CameraPath, Interpolation, Keyframe, PathError, PathFrame, default_name};
use calibrate::{Camera, Lens, Rigid3};
use capture::without_byte_order_mark;
use glam::{DMat3, DVec2, DVec3};
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::Value;
use std::path::Path;

/// What the file says.
#[derive(Deserialize)]
struct Stored {
    camera_path: Vec<Value>,
    #[serde(default)]
    keyframes: Vec<Value>,
    render_width: f64,
    render_height: f64,
    #[serde(default)]
    camera_type: Option<String>,
    #[serde(default)]
    fps: Option<f64>,
    #[serde(default)]
    seconds: Option<f64>,
    #[serde(default)]
    is_cycle: bool,
    #[serde(default)]
    default_transition_sec: Option<f64>,
}

#[derive(Deserialize)]
struct StoredFrame {
    camera_to_world: Vec<f64>,
    fov: f64,
}

#[derive(Deserialize)]
struct StoredKeyframe {
    matrix: Value,
    fov: f64,
    #[serde(default)]
    override_transition_enabled: Option<bool>,
    #[serde(default)]
    override_transition_sec: Option<f64>,
}

/// Frames a second where the file says neither that nor how long it lasts.
const FPS: f64 = 30.0;

/// Whether a file's content is a path of nerfstudio's.
pub(crate) fn is_nerfstudio(bytes: &[u8]) -> bool {
    #[derive(Deserialize)]
    struct Keys {
        version: Option<IgnoredAny>,
        camera_path: Option<IgnoredAny>,
    }
    let keys: Result<Keys, _> = serde_json::from_slice(without_byte_order_mark(bytes));
    keys.is_ok_and(|keys| keys.camera_path.is_some() && keys.version.is_none())
}

/// The file as it is, the size of its pictures, and frames a second.
fn stored(path: &Path, bytes: &[u8]) -> Result<(Stored, (u32, u32), f64), PathFileError> {
    let bad = |reason: String| PathFileError::Nerfstudio(path.to_owned(), reason);
    let text = without_byte_order_mark(bytes);
    let stored: Stored = serde_json::from_slice(text).map_err(|e| bad(e.to_string()))?;
    if let Some(kind) = &stored.camera_type
        && !kind.eq_ignore_ascii_case("perspective")
    {
        return Err(bad(format!(
            "its camera_type is {kind:?}; only \"perspective\" is read, which the viewer's render \
             tab offers, too"
        )));
    }
    let side = |name: &str, value: f64| {
        let is_count = value.fract() == 0.0 && (1.0..=65536.0).contains(&value);
        let reason = || format!("{name} is {value}; expected a number of pixels up to 65536");
        is_count
            .then_some(value as u32)
            .ok_or_else(|| bad(reason()))
    };
    let width = side("render_width", stored.render_width)?;
    let height = side("render_height", stored.render_height)?;
    // Without frames a duration says nothing of their rate.
    let count = Some(stored.camera_path.len()).filter(|count| *count > 0);
    let by_duration = || Some(count? as f64 / stored.duration_s()?);
    let fps = stored.fps.or_else(by_duration);
    let fps = fps.unwrap_or(FPS);
    Ok((stored, (width, height), fps))
}

impl Stored {
    fn duration_s(&self) -> Option<f64> {
        self.seconds.filter(|s| *s > 0.0)
    }
}

/// The frames of a file that [`is_nerfstudio`].
///
/// # Errors
/// What is wrong with which of them.
pub(crate) fn frames(
    path: &Path,
    bytes: &[u8],
    frame: &NerfstudioFrame,
) -> Result<CameraPath, PathFileError> {
    let kind = "frame";
    let of_path = |e| PathFileError::Path(path.to_owned(), e);
    let (stored, (width, height), fps) = stored(path, bytes)?;
    let frames = stored.camera_path.into_iter().enumerate();
    let frames = frames.map(|(index, value)| {
        let malformed = |reason| PathError::Malformed {
            kind,
            index,
            reason,
        };
        let stored: StoredFrame =
            serde_json::from_value(value).map_err(|e| malformed(e.to_string()))?;
        let camera = camera_of(stored.fov, width, height).map_err(malformed)?;
        let pose = row_by_row(&stored.camera_to_world).and_then(|m| pose_of(m, frame));
        let pose = pose.map_err(|e| malformed(format!("camera_to_world {e}")))?;
        let time_s = Some(index as f64 / fps);
        PathFrame::new(default_name(index), camera, pose, time_s)
            .map_err(|error| PathError::Camera { kind, index, error })
    });
    let frames: Result<Vec<PathFrame>, PathError> = frames.collect();
    CameraPath::new(fps, frames.map_err(of_path)?).map_err(of_path)
}

/// The keyframes of a file that [`is_nerfstudio`], where it has some. What is between them is ours:
/// nerfstudio's splines differ a little.
///
/// # Errors
/// What is wrong with which of them.
pub(crate) fn keyframes(
    path: &Path,
    bytes: &[u8],
    frame: &NerfstudioFrame,
) -> Result<Option<KeyframeFile>, PathFileError> {
    let kind = "keyframe";
    let of_path = |e| PathFileError::Path(path.to_owned(), e);
    let (stored, (width, height), fps) = stored(path, bytes)?;
    if stored.keyframes.is_empty() {
        return Ok(None);
    }
    let steps = stored.keyframes.len() - usize::from(!stored.is_cycle);
    let even_s = stored.duration_s().filter(|_| steps > 0);
    let even_s = even_s.map(|s| s / steps as f64);
    let default_s = stored.default_transition_sec.or(even_s);
    let default_s = default_s.unwrap_or(TRANSITION_S);
    let mut t_s = 0.0;
    // Of a cycle, how long the way back to the first takes.
    let mut back_s = default_s;
    let mut keyframes: Vec<Keyframe> = Vec::new();
    for (index, value) in stored.keyframes.into_iter().enumerate() {
        let malformed = |reason| {
            of_path(PathError::Malformed {
                kind,
                index,
                reason,
            })
        };
        let stored: StoredKeyframe =
            serde_json::from_value(value).map_err(|e| malformed(e.to_string()))?;
        let pose = keyframe_matrix(&stored.matrix).and_then(|m| pose_of(m, frame));
        // How long the way to it takes.
        let own_s = stored.override_transition_sec;
        let own_s = own_s.filter(|_| stored.override_transition_enabled == Some(true));
        let way_s = own_s.unwrap_or(default_s);
        match index {
            0 => back_s = way_s,
            _ => t_s += way_s,
        }
        keyframes.push(Keyframe {
            t_s,
            camera_from_world: pose.map_err(|e| malformed(format!("matrix {e}")))?,
            camera: camera_of(stored.fov, width, height).map_err(malformed)?,
            time_s: None,
        });
    }
    if let (true, Some(first)) = (stored.is_cycle, keyframes.first().cloned()) {
        t_s += back_s;
        keyframes.push(Keyframe { t_s, ..first });
    }
    let file = KeyframeFile {
        fps,
        keyframes,
        interpolation: Interpolation::Spline,
    };
    CameraPath::from_keyframes(&file.keyframes, file.interpolation, fps).map_err(of_path)?;
    Ok(Some(file))
}

fn pose_of((c2w, center): (DMat3, DVec3), frame: &NerfstudioFrame) -> Result<Rigid3, String> {
    let pose = frame.camera_from_world(c2w, center);
    pose.ok_or_else(|| {
        "does not begin with a rotation: its columns must be of length 1 and at right angles"
            .to_owned()
    })
}

/// The rotation and the translation of 16 numbers.
fn row_by_row(m: &[f64]) -> Result<(DMat3, DVec3), String> {
    let Ok(m) = <[f64; 16]>::try_from(m) else {
        return Err(format!("has {} numbers; 16 are expected", m.len()));
    };
    if m[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(format!("ends with {:?}, not with 0, 0, 0, 1", &m[12..]));
    }
    let row = |r: usize| DVec3::new(m[4 * r], m[4 * r + 1], m[4 * r + 2]);
    let rotation = DMat3::from_cols(row(0), row(1), row(2)).transpose();
    Ok((rotation, DVec3::new(m[3], m[7], m[11])))
}

/// The first viewer wrote three.js' 16 numbers, column by column, as a text; the second writes a
/// list, row by row.
fn keyframe_matrix(value: &Value) -> Result<(DMat3, DVec3), String> {
    let numbers = match value {
        Value::String(text) => serde_json::from_str(text),
        list => serde_json::from_value(list.clone()),
    };
    let mut m: Vec<f64> = numbers.map_err(|e| format!("is no list of numbers: {e}"))?;
    if let (Value::String(_), 16) = (value, m.len()) {
        m = (0..16).map(|i| m[4 * (i % 4) + i / 4]).collect();
    }
    row_by_row(&m)
}

/// A pinhole with a vertical field of view in degrees.
fn camera_of(fov: f64, width: u32, height: u32) -> Result<Camera, String> {
    if !(fov > 0.0 && fov < 180.0) {
        return Err(format!("fov is {fov}; expected degrees between 0 and 180"));
    }
    let size = DVec2::new(f64::from(width), f64::from(height));
    let focal = 0.5 * size.y / (0.5 * fov.to_radians()).tan();
    let lens = Lens::pinhole(DVec2::splat(focal), 0.5 * size);
    Ok(Camera::of(&lens, width, height))
}
