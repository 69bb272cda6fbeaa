//! `frames.txt`: what was taken out of which video. Its first line says where from, each
//! other has a frame's time in seconds and its name.

use super::{FrameCount, VideoError};
use crate::fingerprint;
use std::fs;
use std::path::Path;

/// Beside the frames.
const FILE: &str = "frames.txt";

/// A frame that was written.
#[derive(Clone, Debug, PartialEq)]
pub struct VideoFrame {
    /// Of its file in the folder.
    pub name: String,
    /// When it is shown, in seconds from the video's start.
    pub time_s: f64,
}

/// The first line: the video as it is now, and how many frames are asked for.
pub(super) fn source(video: &Path, count: FrameCount) -> Result<String, VideoError> {
    let now = fingerprint(video).map_err(|source| VideoError::Read {
        path: video.to_owned(),
        source,
    })?;
    let name = video.file_name().unwrap_or_default().to_string_lossy();
    Ok(format!("# {count:?} of {name:?}, {now}"))
}

/// Whether a folder is not there, is empty, or holds the frames of an earlier run.
pub(super) fn may_replace(folder: &Path) -> bool {
    let is_empty = || fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none());
    !folder.exists() || folder.join(FILE).is_file() || is_empty()
}

/// The frames that an earlier run took from the same source, if all are still there.
pub(super) fn read(folder: &Path, source: &str) -> Option<Vec<VideoFrame>> {
    let text = fs::read_to_string(folder.join(FILE)).ok()?;
    let mut lines = text.lines();
    if lines.next() != Some(source) {
        return None;
    }
    let frame = |line: &str| {
        let (time_s, name) = line.split_once(' ')?;
        folder.join(name).is_file().then_some(())?;
        Some(VideoFrame {
            name: name.to_owned(),
            time_s: time_s.parse().ok()?,
        })
    };
    lines.map(frame).collect()
}

pub(super) fn write(folder: &Path, source: &str, frames: &[VideoFrame]) -> Result<(), VideoError> {
    let line = |frame: &VideoFrame| format!("{} {}\n", frame.time_s, frame.name);
    let lines: String = frames.iter().map(line).collect();
    let path = folder.join(FILE);
    fs::write(&path, format!("{source}\n{lines}")).map_err(VideoError::write_at(&path))
}
