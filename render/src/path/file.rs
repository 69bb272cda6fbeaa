//! Path files, version 1: JSON with either frames or keyframes. Those of nerfstudio, and screenshots that
//! hold a path, are told by their content.

use super::nerfstudio::{self, NerfstudioFrame};
use super::shot;
use super::{CameraPath, Interpolation, Keyframe, PathError, PathFrame, default_name, settled};
use calibrate::formats::{Format, WITHOUT_NUMBER, detect_content, no_number};
use calibrate::{Camera, ModelKind, Rigid3, opencv};
use capture::{as_argument, without_byte_order_mark};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// What is wrong with a path file.
#[derive(Debug, thiserror::Error)]
pub enum PathFileError {
    /// It cannot be read.
    #[error("{path}: {error}", path = .0.display(), error = .1)]
    Io(PathBuf, std::io::Error),
    /// It cannot be written.
    #[error("{path}: cannot write: {error}", path = .0.display(), error = .1)]
    Write(PathBuf, std::io::Error),
    /// It is not the JSON that was expected.
    #[error(
        "{path}: not a path file: {error}; read are paths of this program (JSON, as `lumigraph path` writes), \
         nerfstudio's camera_path.json, and screenshots of `lumigraph view`; poses that are another text (TUM's, CSV) \
         can be made frames of a transforms.json, which `lumigraph render --views` draws",
        path = .0.display(), error = .1
    )]
    Json(PathBuf, serde_json::Error),
    /// It is JSON but for a number that is none; where that is.
    #[error("{path}: {found}; {remedy}", path = .0.display(), found = .1, remedy = WITHOUT_NUMBER)]
    NoNumber(PathBuf, String),
    /// It is a `transforms.json`.
    #[error(
        "{path}: a calibration, not a path file; `lumigraph render SCENE --views {argument} -o FRAMES` draws the views \
         of its frames",
        path = .0.display(), argument = as_argument(.0)
    )]
    Transforms(PathBuf),
    /// It is another calibration.
    #[error(
        "{path}: a calibration, not a path file; with its photos, `lumigraph import PHOTOS --calibration {argument} \
         -o SCENE` and `lumigraph export SCENE --format colmap -o MODEL` make a model, whose views `render --views \
         MODEL` draws",
        path = .0.display(), argument = as_argument(.0)
    )]
    Calibration(PathBuf),
    /// It is from a later version.
    #[error("{path}: path file version {found}; this program reads version 1", path = .0.display(), found = .1)]
    Version(PathBuf, u64),
    /// It holds neither frames nor keyframes, or both.
    #[error("{path}: a path has either \"frames\" or \"keyframes\"; found {found}", path = .0.display(), found = .1)]
    Content(PathBuf, &'static str),
    /// Its frames do not make a path.
    #[error("{path}: {error}", path = .0.display(), error = .1)]
    Path(PathBuf, PathError),
    /// A path of nerfstudio's, or where its world lies, cannot be read.
    #[error("{path}: nerfstudio's: {reason}", path = .0.display(), reason = .1)]
    Nerfstudio(PathBuf, String),
    /// A screenshot is a damaged PNG, or cannot be made one.
    #[error("{path}: as a PNG: {reason}", path = .0.display(), reason = .1)]
    Png(PathBuf, String),
    /// A PNG from elsewhere.
    #[error("{}: no pose is stored in it; expected a screenshot taken by `lumigraph view`", .0.display())]
    NoPose(PathBuf),
}

/// What the file says.
#[derive(Deserialize)]
struct Stored {
    version: u64,
    fps: f64,
    frames: Option<Vec<Value>>,
    keyframes: Option<Vec<Value>>,
    #[serde(default)]
    interpolation: Option<StoredInterpolation>,
    #[serde(flatten)]
    extra: Map<String, Value>,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum StoredInterpolation {
    Spline,
    Linear,
}

/// A frame, or a keyframe with `t_s`.
#[derive(Serialize, Deserialize)]
struct StoredFrame {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    t_s: Option<f64>,
    /// Row by row.
    camera_from_world: Vec<f64>,
    width: u32,
    height: u32,
    model: String,
    params: Vec<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    time_s: Option<f64>,
    #[serde(flatten)]
    extra: Map<String, Value>,
}

/// How far RᵀR of a pose may be from the identity in any entry: six printed digits leave up to 2e-6, single
/// precision less; a matrix that scales is far beyond.
pub(super) const ROTATION_TOLERANCE: f64 = 1e-4;

/// Reads a path; keyframes are sampled at its frame rate. Of nerfstudio's, which are told by their
/// content, the frames are read, as if its world were ours. A screenshot, told by its content, too, is a
/// path of one frame that is called as the file.
///
/// Keys that this version does not know are kept in `extra`, except those of keyframes,
/// which end with the sampling.
///
/// # Errors
/// The file, the frame by its index, and what is wrong with it.
pub fn read(path: &Path) -> Result<CameraPath, PathFileError> {
    read_in(path, &NerfstudioFrame::default())
}

/// As [`read`], where nerfstudio's world lies as `frame` says; of other paths that says nothing.
///
/// # Errors
/// As for [`read`].
pub fn read_in(path: &Path, frame: &NerfstudioFrame) -> Result<CameraPath, PathFileError> {
    Ok(read_with_keyframes(path, frame)?.0)
}

/// As [`read_in`], with the keyframes that were sampled, where the path is of some. A screenshot's frame is one.
///
/// # Errors
/// As for [`read`].
pub fn read_with_keyframes(
    path: &Path,
    frame: &NerfstudioFrame,
) -> Result<(CameraPath, Option<KeyframeFile>), PathFileError> {
    parse_in(path, &bytes_of(path)?, frame)
}

/// Whether a file is a path of nerfstudio's, by its content; what cannot be read is none.
pub fn is_nerfstudio(path: &Path) -> bool {
    bytes_of(path).is_ok_and(|bytes| matches!(Form::of(&bytes), Form::Nerfstudio))
}

fn bytes_of(path: &Path) -> Result<Vec<u8>, PathFileError> {
    std::fs::read(path).map_err(|e| PathFileError::Io(path.to_owned(), e))
}

/// What wrote a file, by its content.
enum Form {
    /// This program, or people by its format.
    Own,
    /// nerfstudio.
    Nerfstudio,
    /// The window: a picture that holds a path.
    Shot,
}

impl Form {
    fn of(bytes: &[u8]) -> Self {
        if shot::is_png(bytes) {
            Self::Shot
        } else if nerfstudio::is_nerfstudio(bytes) {
            Self::Nerfstudio
        } else {
            Self::Own
        }
    }
}

/// Reads the content of a file; `path` is only named in errors, and gives a screenshot's frame its name.
///
/// # Errors
/// As for [`read`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<CameraPath, PathFileError> {
    Ok(parse_in(path, bytes, &NerfstudioFrame::default())?.0)
}

fn parse_in(
    path: &Path,
    bytes: &[u8],
    frame: &NerfstudioFrame,
) -> Result<(CameraPath, Option<KeyframeFile>), PathFileError> {
    match Form::of(bytes) {
        Form::Own => parse_own(path, bytes),
        Form::Nerfstudio => Ok((nerfstudio::frames(path, bytes, frame)?, None)),
        Form::Shot => {
            let shot = shot::parse_shot(path, bytes)?;
            let keyframes = shot::keyframes(&shot);
            Ok((shot, Some(keyframes)))
        }
    }
}

/// A path, and its keyframes as they are, where it has some.
pub(super) fn parse_own(
    path: &Path,
    bytes: &[u8],
) -> Result<(CameraPath, Option<KeyframeFile>), PathFileError> {
    let json = |e| PathFileError::Json(path.to_owned(), e);
    let bytes = without_byte_order_mark(bytes);
    // The version first: a later one may have other keys.
    #[derive(Deserialize)]
    #[serde(expecting = "an object with version, fps, and frames or keyframes")]
    struct Version {
        version: u64,
    }
    let other = |error| {
        let path = path.to_owned();
        match detect_content(Cursor::new(bytes)) {
            Some(Format::Transforms) => PathFileError::Transforms(path),
            Some(_) => PathFileError::Calibration(path),
            None => match str::from_utf8(bytes).ok().and_then(no_number) {
                Some(found) => PathFileError::NoNumber(path, found),
                None if opencv::is_calibration(bytes) => PathFileError::Calibration(path),
                None => json(error),
            },
        }
    };
    let Version { version } = serde_json::from_slice(bytes).map_err(other)?;
    if version != 1 {
        return Err(PathFileError::Version(path.to_owned(), version));
    }
    let stored: Stored = serde_json::from_slice(bytes).map_err(json)?;
    debug_assert_eq!(stored.version, version);

    let camera_path = match (stored.frames, stored.keyframes) {
        (Some(frames), None) => read_frames(stored.fps, frames).map(|path| (path, None)),
        (None, Some(keyframes)) => keyframes_of(keyframes).and_then(|keyframes| {
            let interpolation = interpolation_of(stored.interpolation);
            let path = CameraPath::from_keyframes(&keyframes, interpolation, stored.fps)?;
            let file = KeyframeFile {
                fps: stored.fps,
                keyframes,
                interpolation,
            };
            Ok((path, Some(file)))
        }),
        (None, None) => return Err(PathFileError::Content(path.to_owned(), "neither")),
        (Some(_), Some(_)) => return Err(PathFileError::Content(path.to_owned(), "both")),
    };
    let (mut camera_path, keyframes) =
        camera_path.map_err(|e| PathFileError::Path(path.to_owned(), e))?;
    camera_path.extra = stored.extra;
    Ok((camera_path, keyframes))
}

/// Writes a path as frames, one a line. What [`read`] makes of it is equal, bit for bit,
/// where the frames come from [`PathFrame::new`].
///
/// The file appears complete or not at all.
///
/// # Errors
/// The file, and what is wrong with it or with the path.
pub fn write(path: &Path, camera_path: &CameraPath) -> Result<(), PathFileError> {
    let text = content(path, camera_path)?;
    write_whole(path, &text)
}

/// What [`write()`] writes, for files of another kind that hold a path, such as a picture that knows
/// where it was taken from.
///
/// # Errors
/// What is wrong with the path.
pub fn text(camera_path: &CameraPath) -> Result<String, PathFileError> {
    content(Path::new("path"), camera_path)
}

/// `path` is only named in errors.
fn content(path: &Path, camera_path: &CameraPath) -> Result<String, PathFileError> {
    // What could not be read is not written.
    CameraPath::new(camera_path.fps, camera_path.frames.clone())
        .map_err(|e| PathFileError::Path(path.to_owned(), e))?;
    let json = |e| PathFileError::Json(path.to_owned(), e);

    let fps = serde_json::to_string(&camera_path.fps).map_err(json)?;
    let mut text = format!("{{\"version\": 1,\n\"fps\": {fps}");
    for (key, value) in &camera_path.extra {
        let key = serde_json::to_string(key).map_err(json)?;
        let value = serde_json::to_string(value).map_err(json)?;
        text += &format!(",\n{key}: {value}");
    }
    text += ",\n\"frames\": [";
    for (index, frame) in camera_path.frames.iter().enumerate() {
        let stored = serde_json::to_string(&StoredFrame::of(frame)).map_err(json)?;
        text += if index == 0 { "\n" } else { ",\n" };
        text += &stored;
    }
    text += "\n]}\n";
    Ok(text)
}

/// Keyframes as a file has them.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyframeFile {
    /// Frames per second of the path that they make.
    pub fps: f64,
    /// In order.
    pub keyframes: Vec<Keyframe>,
    /// What happens between them.
    pub interpolation: Interpolation,
}

impl KeyframeFile {
    /// When the last keyframe is passed, and when the last frame of the path that they make is, in seconds; `None`
    /// where that is within a millisecond of it.
    pub fn cut_short_s(&self, path: &CameraPath) -> Option<[f64; 2]> {
        let (first, last) = (self.keyframes.first()?, self.keyframes.last()?);
        let steps = path.frames.len().saturating_sub(1);
        let shown_s = first.t_s + steps as f64 / path.fps;
        (last.t_s - shown_s >= 1e-3).then_some([last.t_s, shown_s])
    }
}

/// Reads a path's keyframes as they are, not sampled; `None` of a path that has frames instead. A
/// screenshot's frame is one. `frame` is for nerfstudio's paths.
///
/// # Errors
/// As for [`read`].
pub fn read_keyframes(
    path: &Path,
    frame: &NerfstudioFrame,
) -> Result<Option<KeyframeFile>, PathFileError> {
    let bytes = bytes_of(path)?;
    match Form::of(&bytes) {
        Form::Own => Ok(parse_own(path, &bytes)?.1),
        Form::Nerfstudio => nerfstudio::keyframes(path, &bytes, frame),
        Form::Shot => Ok(Some(shot::keyframes(&shot::parse_shot(path, &bytes)?))),
    }
}

/// Writes keyframes, one a line, in the way of [`write()`]. What [`read`] makes of them is what
/// [`CameraPath::from_keyframes`] makes of these, bit for bit where their poses are those of
/// frames (see [`PathFrame::new`]).
///
/// # Errors
/// The file, and what is wrong with it or with the keyframes.
pub fn write_keyframes(path: &Path, file: &KeyframeFile) -> Result<(), PathFileError> {
    CameraPath::from_keyframes(&file.keyframes, file.interpolation, file.fps)
        .map_err(|e| PathFileError::Path(path.to_owned(), e))?;
    let json = |e| PathFileError::Json(path.to_owned(), e);
    let fps = serde_json::to_string(&file.fps).map_err(json)?;
    let interpolation = match file.interpolation {
        Interpolation::Spline => "spline",
        Interpolation::Linear => "linear",
    };
    let mut lines = Vec::new();
    for keyframe in &file.keyframes {
        let stored = StoredFrame {
            name: None,
            t_s: Some(keyframe.t_s),
            camera_from_world: rows_of(&keyframe.camera_from_world),
            width: keyframe.camera.width,
            height: keyframe.camera.height,
            model: keyframe.camera.model.name().to_owned(),
            params: keyframe.camera.params.clone(),
            time_s: keyframe.time_s,
            extra: Map::new(),
        };
        lines.push(serde_json::to_string(&stored).map_err(json)?);
    }
    let text = format!(
        "{{\"version\": 1,\n\"fps\": {fps},\n\"interpolation\": \"{interpolation}\",\n\
         \"keyframes\": [\n{}\n]}}\n",
        lines.join(",\n")
    );
    write_whole(path, &text)
}

pub(super) fn write_whole(path: &Path, text: &str) -> Result<(), PathFileError> {
    let failed = |e| PathFileError::Write(path.to_owned(), e);
    capture::write_whole(path, |temporary| std::fs::write(temporary, text)).map_err(failed)
}

fn interpolation_of(stored: Option<StoredInterpolation>) -> Interpolation {
    match stored {
        Some(StoredInterpolation::Linear) => Interpolation::Linear,
        Some(StoredInterpolation::Spline) | None => Interpolation::Spline,
    }
}

/// A pose as a 4 × 4 matrix, row by row.
fn rows_of(pose: &Rigid3) -> Vec<f64> {
    let [x, y, z] = pose.matrix().transpose().to_cols_array_2d();
    let t = pose.translation;
    let rows = [
        [x[0], x[1], x[2], t.x],
        [y[0], y[1], y[2], t.y],
        [z[0], z[1], z[2], t.z],
        [0.0, 0.0, 0.0, 1.0],
    ];
    rows.concat()
}

fn read_frames(fps: f64, frames: Vec<Value>) -> Result<CameraPath, PathError> {
    let kind = "frame";
    let frame = |(index, value): (usize, Value)| {
        let stored = StoredFrame::from_value(kind, index, value)?;
        let camera = stored.camera(kind, index)?;
        let camera_from_world = stored.camera_from_world(kind, index)?;
        let name = stored.name.unwrap_or_else(|| default_name(index));
        let mut frame = PathFrame::new(name, camera, camera_from_world, stored.time_s)
            .map_err(|error| PathError::Camera { kind, index, error })?;
        frame.extra = stored.extra;
        if let Some(t_s) = stored.t_s {
            frame.extra.insert("t_s".to_owned(), t_s.into());
        }
        Ok(frame)
    };
    let frames: Result<Vec<PathFrame>, PathError> =
        frames.into_iter().enumerate().map(frame).collect();
    CameraPath::new(fps, frames?)
}

fn keyframes_of(keyframes: Vec<Value>) -> Result<Vec<Keyframe>, PathError> {
    let kind = "keyframe";
    let keyframe = |(index, value): (usize, Value)| {
        let stored = StoredFrame::from_value(kind, index, value)?;
        Ok(Keyframe {
            t_s: stored.t_s.ok_or_else(|| PathError::Malformed {
                kind,
                index,
                reason: "missing field `t_s`, its time in seconds".to_owned(),
            })?,
            camera_from_world: stored.camera_from_world(kind, index)?,
            camera: stored.camera(kind, index)?,
            time_s: stored.time_s,
        })
    };
    keyframes.into_iter().enumerate().map(keyframe).collect()
}

impl StoredFrame {
    fn of(frame: &PathFrame) -> Self {
        Self {
            name: Some(frame.name.clone()),
            t_s: None,
            camera_from_world: rows_of(&frame.view.camera_from_world),
            width: frame.camera.width,
            height: frame.camera.height,
            model: frame.camera.model.name().to_owned(),
            params: frame.camera.params.clone(),
            time_s: frame.time_s,
            extra: frame.extra.clone(),
        }
    }

    fn from_value(kind: &'static str, index: usize, value: Value) -> Result<Self, PathError> {
        serde_json::from_value(value).map_err(|e| PathError::Malformed {
            kind,
            index,
            reason: e.to_string(),
        })
    }

    fn camera(&self, kind: &'static str, index: usize) -> Result<Camera, PathError> {
        let Some(model) = ModelKind::from_name(&self.model) else {
            let known: Vec<&str> = ModelKind::ALL.iter().map(|m| m.name()).collect();
            return Err(PathError::Malformed {
                kind,
                index,
                reason: format!(
                    "unknown camera model {:?}; known are {}",
                    self.model,
                    known.join(", ")
                ),
            });
        };
        let camera = Camera {
            model,
            width: self.width,
            height: self.height,
            params: self.params.clone(),
        };
        match camera.lens() {
            Ok(_) => Ok(camera),
            Err(error) => Err(PathError::Camera { kind, index, error }),
        }
    }

    fn camera_from_world(&self, kind: &'static str, index: usize) -> Result<Rigid3, PathError> {
        let malformed = |reason: String| PathError::Malformed {
            kind,
            index,
            reason,
        };
        let Ok(m) = <[f64; 16]>::try_from(self.camera_from_world.as_slice()) else {
            return Err(malformed(format!(
                "camera_from_world has {} numbers; 16 are expected, row by row",
                self.camera_from_world.len()
            )));
        };
        if m[12..] != [0.0, 0.0, 0.0, 1.0] {
            return Err(malformed(format!(
                "the last row of camera_from_world is {:?}, not [0, 0, 0, 1]; is the matrix \
                 written column by column?",
                &m[12..]
            )));
        }
        let row = |r: usize| DVec3::new(m[4 * r], m[4 * r + 1], m[4 * r + 2]);
        let rotation = DMat3::from_cols(row(0), row(1), row(2)).transpose();
        let translation = DVec3::new(m[3], m[7], m[11]);
        pose_of_matrix(rotation, translation).ok_or_else(|| malformed(not_a_rotation(rotation)))
    }
}

/// What is wrong with a matrix that is no rotation, and what to do about it.
fn not_a_rotation(matrix: DMat3) -> String {
    let deviation = Rigid3::deviation(matrix);
    let found = if deviation > ROTATION_TOLERANCE {
        format!(
            "RᵀR differs from the identity by up to {deviation:.3e}; take the scale or shear out of it, or write \
             more digits"
        )
    } else {
        "it mirrors (its determinant is −1); check that no axis was negated on the way".to_owned()
    };
    format!(
        "camera_from_world does not begin with a rotation: its rows must be of length 1, at right angles and \
         right-handed, but {found}"
    )
}

/// A pose of a rotation matrix, as [`Rigid3::from_matrix`] makes it; a matrix that we wrote gives back
/// the very quaternion. `None` of what is farther from a rotation than [`ROTATION_TOLERANCE`].
pub(super) fn pose_of_matrix(rotation: DMat3, translation: DVec3) -> Option<Rigid3> {
    let pose = Rigid3::from_matrix(rotation, translation, ROTATION_TOLERANCE)?;
    let written = Rigid3 {
        rotation: settled(pose.rotation),
        translation,
    };
    Some(if written.matrix() == rotation {
        written
    } else {
        pose
    })
}
