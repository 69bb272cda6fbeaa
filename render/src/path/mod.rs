//! Camera paths: the desired views of a film or a list of pictures, frame by frame.

mod file;
mod nerfstudio;
mod shot;
mod spline;

pub use file::{
    KeyframeFile, PathFileError, is_nerfstudio, parse, read, read_in, read_keyframes,
    read_with_keyframes, text, write, write_keyframes,
};
pub use nerfstudio::{NerfstudioFrame, write_nerfstudio};
pub use shot::{SHOT_KEYWORD, ShotLook, read_shot_look, write_shot};
pub(crate) use spline::{Curve, fitted_rotation, mean_rotation};

use calibrate::{Camera, CameraError, ModelKind, Rigid3, View};
use glam::DQuat;
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// A sequence of desired views.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraPath {
    /// Frames per second.
    pub fps: f64,
    /// In the order of showing, each name once.
    pub frames: Vec<PathFrame>,
    /// What else its file said, kept for writing it again.
    pub extra: Map<String, Value>,
}

/// One desired view of a path.
#[derive(Clone, Debug, PartialEq)]
pub struct PathFrame {
    /// What the picture will be called, `/` between its parts.
    pub name: String,
    /// Pose and lens.
    pub view: View,
    /// The lens' model and parameters, as files store them.
    pub camera: Camera,
    /// Seconds.
    pub time_s: Option<f64>,
    /// What else its file said, kept for writing it again.
    pub extra: Map<String, Value>,
}

/// A pose that a path passes at a given time.
#[derive(Clone, Debug, PartialEq)]
pub struct Keyframe {
    /// When it is passed, in seconds; each later than the one before.
    pub t_s: f64,
    /// Its pose.
    pub camera_from_world: Rigid3,
    /// Its lens: model and size are the same at all keyframes.
    pub camera: Camera,
    /// The scene's own time, in seconds, where that is another: all keyframes of a path have one, or none
    /// has.
    pub time_s: Option<f64>,
}

/// What happens between keyframes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// Position and rotation change smoothly, through every keyframe.
    #[default]
    Spline,
    /// Straight from one to the next, turning evenly about one axis.
    Linear,
}

/// What is wrong with a path, whether in a file or in memory.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PathError {
    /// The frame rate is not a positive number.
    #[error("fps is {0}; it must be a positive number, such as 30")]
    Fps(f64),
    /// There is nothing to render.
    #[error("the path has no frames")]
    Empty,
    /// Two frames would make the same picture file.
    #[error("frames {first} and {second} are both called {name:?}; each needs a name of its own")]
    DuplicateName {
        /// The name.
        name: String,
        /// Index of the first.
        first: usize,
        /// Index of the other.
        second: usize,
    },
    /// A name that is no relative path.
    #[error(
        "frame {index}: the name {name:?} cannot name a picture; give a relative path without .."
    )]
    Name {
        /// Which frame.
        index: usize,
        /// The name.
        name: String,
    },
    /// A camera is unusable.
    #[error("{kind} {index}: {error}")]
    Camera {
        /// "frame" or "keyframe".
        kind: &'static str,
        /// Which.
        index: usize,
        /// What is wrong with it.
        error: CameraError,
    },
    /// A frame's pose or time is NaN or infinite.
    #[error("{kind} {index}: its {what} is not finite")]
    NotFinite {
        /// "frame" or "keyframe".
        kind: &'static str,
        /// Which.
        index: usize,
        /// Which of its values.
        what: &'static str,
    },
    /// A frame cannot be read.
    #[error("{kind} {index}: {reason}")]
    Malformed {
        /// "frame" or "keyframe".
        kind: &'static str,
        /// Which.
        index: usize,
        /// What was found and what was expected.
        reason: String,
    },
    /// Keyframes are out of order.
    #[error("keyframe {index}: t_s is {t_s}, not after the {before} of the one before")]
    TimeOrder {
        /// Which.
        index: usize,
        /// Its time.
        t_s: f64,
        /// The time of the one before.
        before: f64,
    },
    /// Keyframes so soon after one another that the speed between them is none to compute with.
    #[error(
        "keyframe {index}: t_s is {apart_s:?} s after that of the one before; keyframes are a nanosecond \
         apart at least: are the times in seconds?"
    )]
    TooSoon {
        /// Which.
        index: usize,
        /// From the one before to it.
        apart_s: f64,
    },
    /// Nothing lies between two different cameras.
    #[error(
        "keyframe {index}: its camera is {} {} × {}, that of keyframe 0 is {} {} × {}; \
         model and size must agree",
        found.0.name(), found.1, found.2, first.0.name(), first.1, first.2
    )]
    CamerasDiffer {
        /// Which.
        index: usize,
        /// Its model, width and height.
        found: (ModelKind, u32, u32),
        /// Those of the first.
        first: (ModelKind, u32, u32),
    },
    /// Between a keyframe with a time of the scene's and one without nobody knows the time.
    #[error(
        "keyframe {index}: it has no time_s, though keyframe {timed} has one; give one to all \
         keyframes, or to none"
    )]
    TimesDiffer {
        /// The first without.
        index: usize,
        /// The first with one.
        timed: usize,
    },
    /// Far more frames than anyone renders.
    #[error(
        "keyframes {duration_s} s apart make {frames:.0} frames at {fps} per second, more than \
         {MAX_FRAMES}; are the times in seconds?"
    )]
    TooLong {
        /// From the first keyframe to the last.
        duration_s: f64,
        /// Frames per second.
        fps: f64,
        /// Their product.
        frames: f64,
    },
}

/// Keyframes are so far apart at least, in seconds: how far poses are apart is divided by it.
const LEAST_APART_S: f64 = 1e-9;

/// More frames than this are taken for a slip of units.
pub const MAX_FRAMES: usize = 1_000_000;

impl PathFrame {
    /// A frame. Its rotation may change by 4e-15 radians, so that it reads back from a
    /// file, where it is a matrix, just as it is.
    ///
    /// # Errors
    /// The camera is unusable.
    pub fn new(
        name: String,
        camera: Camera,
        camera_from_world: Rigid3,
        time_s: Option<f64>,
    ) -> Result<Self, CameraError> {
        let rotation = settled(camera_from_world.rotation);
        let translation = if rotation == camera_from_world.rotation {
            camera_from_world.translation
        } else {
            // The centre stays, however far from the world's origin.
            -(rotation * camera_from_world.center())
        };
        let view = View {
            lens: camera.lens()?,
            width: camera.width,
            height: camera.height,
            camera_from_world: Rigid3 {
                rotation,
                translation,
            },
        };
        Ok(Self {
            name,
            view,
            camera,
            time_s,
            extra: Map::new(),
        })
    }

    /// A frame of a view, as [`Self::new`] makes it.
    ///
    /// # Errors
    /// The lens is no camera's.
    pub fn of_view(name: String, view: &View) -> Result<Self, CameraError> {
        let camera = Camera::of(&view.lens, view.width, view.height);
        Self::new(name, camera, view.camera_from_world, None)
    }
}

/// The name of a frame that was given none, as of all frames of derived paths.
pub fn default_name(index: usize) -> String {
    format!("frame_{index:04}")
}

/// The same rotation to 4e-15 radians, as a quaternion that comes back from its own matrix
/// when that is settled again.
///
/// Three components lie on a grid that is coarser than the rounding errors on the way to
/// the matrix and back; the fourth, which is not small, completes the unit length.
pub(crate) fn settled(rotation: DQuat) -> DQuat {
    const GRID: f64 = (1_u64 << 48) as f64;
    // One component of a unit quaternion is at least a half. Not the largest is taken:
    // ties, such as in a right angle, would be broken by rounding errors.
    let mut q = rotation.to_array();
    let free = (0..4).find(|&i| q[i].abs() >= 0.45).unwrap_or(3);
    let sign = q[free].signum();
    let mut squares = 0.0;
    for i in (0..4).filter(|&i| i != free) {
        // Plus zero: a zero has one sign.
        q[i] = (q[i] * sign * GRID).round() / GRID + 0.0;
        squares += q[i] * q[i];
    }
    q[free] = (1.0 - squares).max(0.0).sqrt();
    DQuat::from_array(q)
}

impl CameraPath {
    /// A path of given frames.
    ///
    /// # Errors
    /// A frame rate that is not positive, no frames, values that are not finite, names
    /// that are used twice or lead out of a folder.
    pub fn new(fps: f64, frames: Vec<PathFrame>) -> Result<Self, PathError> {
        if !(fps > 0.0 && fps.is_finite()) {
            return Err(PathError::Fps(fps));
        }
        if frames.is_empty() {
            return Err(PathError::Empty);
        }
        let mut index_of_name = BTreeMap::new();
        for (index, frame) in frames.iter().enumerate() {
            check_finite("frame", index, &frame.view.camera_from_world, frame.time_s)?;
            let name = &frame.name;
            let bad = |part: &str| matches!(part, "" | "." | "..") || part.contains(['\\', '\0']);
            if name.split('/').any(bad) || name.as_bytes().get(1) == Some(&b':') {
                let name = name.clone();
                return Err(PathError::Name { index, name });
            }
            if let Some(first) = index_of_name.insert(name, index) {
                return Err(PathError::DuplicateName {
                    name: name.clone(),
                    first,
                    second: index,
                });
            }
        }
        Ok(Self {
            fps,
            frames,
            extra: Map::new(),
        })
    }

    /// Samples keyframes `fps` times a second, from the first up to the last.
    ///
    /// Camera centres and rotations are interpolated (not translations, which would swing
    /// about the world's origin); focal lengths and all other lens parameters linearly. A
    /// frame's `time_s` is interpolated where the keyframes have one, and is the time on
    /// the path otherwise. A frame at a keyframe's time has its pose (see [`PathFrame::new`]).
    ///
    /// # Errors
    /// No keyframes; times not increasing, or by less than a nanosecond; cameras unusable or of different model or
    /// size; some with a time of the scene's and some without; more than [`MAX_FRAMES`].
    pub fn from_keyframes(
        keyframes: &[Keyframe],
        interpolation: Interpolation,
        fps: f64,
    ) -> Result<Self, PathError> {
        // 1. Checks.
        if !(fps > 0.0 && fps.is_finite()) {
            return Err(PathError::Fps(fps));
        }
        check_keyframes(keyframes)?;
        let (first, last) = (&keyframes[0], &keyframes[keyframes.len() - 1]);
        let duration_s = last.t_s - first.t_s;
        // Where the last keyframe falls on a frame but for rounding, it is one.
        let intervals = (duration_s * fps * (1.0 + 1e-12) + 1e-9).floor();
        if !(intervals < MAX_FRAMES as f64) {
            return Err(PathError::TooLong {
                duration_s,
                fps,
                frames: intervals + 1.0,
            });
        }

        // 2. Samples.
        let poses = keyframes.iter().map(|k| (k.t_s, k.camera_from_world));
        let curve = Curve::new(poses.collect(), interpolation);
        let sample = |index: usize| {
            let t_s = (first.t_s + index as f64 / fps).min(last.t_s);
            let (before, share) = curve.locate(t_s);
            let after = (before + 1).min(keyframes.len() - 1);
            let (a, b) = (&keyframes[before], &keyframes[after]);
            let between = |a: f64, b: f64| {
                if share == 0.0 { a } else { a + share * (b - a) }
            };
            let params = a.camera.params.iter().zip(&b.camera.params);
            let camera = Camera {
                params: params.map(|(&a, &b)| between(a, b)).collect(),
                ..a.camera.clone()
            };
            let time_s = match (a.time_s, b.time_s) {
                (Some(a), Some(b)) => between(a, b),
                _ => t_s,
            };
            PathFrame::new(default_name(index), camera, curve.at(t_s), Some(time_s)).map_err(
                |error| PathError::Camera {
                    kind: "frame",
                    index,
                    error,
                },
            )
        };
        let frames = (0..=intervals as usize).map(sample);
        Self::new(fps, frames.collect::<Result<_, _>>()?)
    }
}

fn check_keyframes(keyframes: &[Keyframe]) -> Result<(), PathError> {
    let kind = "keyframe";
    let Some(first) = keyframes.first() else {
        return Err(PathError::Empty);
    };
    let model_and_size = |c: &Camera| (c.model, c.width, c.height);
    for (index, keyframe) in keyframes.iter().enumerate() {
        keyframe
            .camera
            .lens()
            .map_err(|error| PathError::Camera { kind, index, error })?;
        let pose = &keyframe.camera_from_world;
        check_finite(kind, index, pose, Some(keyframe.t_s))?;
        check_finite(kind, index, pose, keyframe.time_s)?;
        let before = index
            .checked_sub(1)
            .map_or(f64::NEG_INFINITY, |i| keyframes[i].t_s);
        if keyframe.t_s <= before {
            return Err(PathError::TimeOrder {
                index,
                t_s: keyframe.t_s,
                before,
            });
        }
        let apart_s = keyframe.t_s - before;
        if apart_s < LEAST_APART_S {
            return Err(PathError::TooSoon { index, apart_s });
        }
        let (found, first) = (
            model_and_size(&keyframe.camera),
            model_and_size(&first.camera),
        );
        if found != first {
            return Err(PathError::CamerasDiffer {
                index,
                found,
                first,
            });
        }
    }
    let first_of = |is_timed: bool| {
        keyframes
            .iter()
            .position(|k| k.time_s.is_some() == is_timed)
    };
    match (first_of(false), first_of(true)) {
        (Some(index), Some(timed)) => Err(PathError::TimesDiffer { index, timed }),
        _ => Ok(()),
    }
}

fn check_finite(
    kind: &'static str,
    index: usize,
    pose: &Rigid3,
    time_s: Option<f64>,
) -> Result<(), PathError> {
    let what = match (pose.is_finite(), time_s.is_none_or(f64::is_finite)) {
        (true, true) => return Ok(()),
        (false, _) => "pose",
        (true, false) => "time",
    };
    Err(PathError::NotFinite { kind, index, what })
}

#[cfg(test)]
mod tests;
