//! `frames.txt`: what was taken out of which video. Its first line says where from, each
//! other has a frame's time in seconds and its name.

use super::{FrameCount, FrameShape, VideoError};
use crate::fingerprint;
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::Path;

/// Beside the frames.
const FILE: &str = "frames.txt";

/// Said of frames that are not drawn out to square pixels.
const AS_STORED: &str = "as stored";

/// A frame that was written.
#[derive(Clone, Debug, PartialEq)]
pub struct VideoFrame {
    /// Of its file in the folder.
    pub name: String,
    /// When it is shown, in seconds from the video's start.
    pub time_s: f64,
}

/// The first line: the video as it is now, and how many frames are asked for, of which shape.
pub(super) fn source(
    video: &Path,
    count: FrameCount,
    shape: FrameShape,
) -> Result<String, VideoError> {
    let now = fingerprint(video).map_err(|source| VideoError::Read {
        path: video.to_owned(),
        source,
    })?;
    let name = video.file_name().unwrap_or_default().to_string_lossy();
    let shape = match shape {
        FrameShape::Square => String::new(),
        FrameShape::Calibrated(width, height) => format!(", for {width}x{height}"),
        FrameShape::Stored => format!(", {AS_STORED}"),
    };
    Ok(format!("# {count:?} of {name:?}, {now}{shape}"))
}

/// Whether a line is one that [`source`] makes, of any video.
fn is_source(line: &str) -> bool {
    let is_count = |count: &str| {
        let number = |kind: &str| {
            let inner = count.strip_prefix(kind)?.strip_prefix('(')?;
            inner.strip_suffix(')')
        };
        count == "Auto"
            || number("Frames").is_some_and(|n| n.parse::<usize>().is_ok())
            || number("PerSecond").is_some_and(|n| n.parse::<f64>().is_ok())
    };
    let is_size = |text: &str| {
        let sides = text.split_once('x').map(|(width, height)| [width, height]);
        sides.is_some_and(|sides| sides.iter().all(|n| n.parse::<u32>().is_ok()))
    };
    let is_fingerprint = |text: &str| {
        let (text, shape) = text.split_once(", ").unwrap_or((text, AS_STORED));
        if shape != AS_STORED && !shape.strip_prefix("for ").is_some_and(is_size) {
            return false;
        }
        let numbers = text
            .split_once(" bytes of ")
            .and_then(|(bytes, time)| Some([bytes, time.strip_suffix(" ns")?]));
        numbers.is_some_and(|numbers| numbers.iter().all(|n| n.parse::<u128>().is_ok()))
    };
    // A video's name may hold anything; it ends with the last quotation mark.
    let parts = line.strip_prefix("# ").and_then(|line| {
        let (count, named) = line.split_once(" of \"")?;
        let (_, fingerprint) = named.rsplit_once("\", ")?;
        Some((count, fingerprint))
    });
    parts.is_some_and(|(count, fingerprint)| is_count(count) && is_fingerprint(fingerprint))
}

/// Whether a folder is not there, is empty, or holds the frames of an earlier run and nothing
/// else: what is in it will be removed.
pub(super) fn may_replace(folder: &Path) -> bool {
    if !folder.exists() {
        return true;
    }
    let entries = fs::read_dir(folder);
    let names: io::Result<Vec<OsString>> =
        entries.and_then(|all| all.map(|entry| Ok(entry?.file_name())).collect());
    let Ok(names) = names else { return false };
    let listed = listed(folder);
    let is_listed = |name: &OsString| {
        let name = name.to_str();
        name.is_some_and(|name| name == FILE || listed.iter().any(|all| all.contains(name)))
    };
    names.is_empty() || listed.is_some() && names.iter().all(is_listed)
}

/// What an earlier run listed, of whatever video.
fn listed(folder: &Path) -> Option<BTreeSet<String>> {
    let text = fs::read_to_string(folder.join(FILE)).ok()?;
    let mut lines = text.lines();
    lines.next().filter(|line| is_source(line))?;
    lines.map(|line| Some(frame(line)?.name)).collect()
}

/// A frame from its line.
fn frame(line: &str) -> Option<VideoFrame> {
    let (time_s, name) = line.split_once(' ')?;
    Some(VideoFrame {
        name: name.to_owned(),
        time_s: time_s.parse().ok()?,
    })
}

/// The frames that an earlier run took from the same source, if all are still there.
pub(super) fn read(folder: &Path, source: &str) -> Option<Vec<VideoFrame>> {
    let text = fs::read_to_string(folder.join(FILE)).ok()?;
    let mut lines = text.lines();
    if lines.next() != Some(source) {
        return None;
    }
    let there = |line: &str| frame(line).filter(|frame| folder.join(&frame.name).is_file());
    lines.map(there).collect()
}

pub(super) fn write(folder: &Path, source: &str, frames: &[VideoFrame]) -> Result<(), VideoError> {
    let line = |frame: &VideoFrame| format!("{} {}\n", frame.time_s, frame.name);
    let lines: String = frames.iter().map(line).collect();
    let path = folder.join(FILE);
    fs::write(&path, format!("{source}\n{lines}")).map_err(VideoError::write_at(&path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_known_by_its_first_line() {
        let here = tempfile::tempdir().unwrap();
        // A name that looks like the rest of the line.
        let video = here.path().join("# Auto of b, 1 bytes of 2 ns.mp4");
        fs::write(&video, "video").unwrap();
        for (count, shape) in [
            (FrameCount::Auto, FrameShape::Square),
            (FrameCount::Frames(7), FrameShape::Stored),
            (FrameCount::PerSecond(0.5), FrameShape::Calibrated(640, 480)),
        ] {
            let line = source(&video, count, shape).unwrap();
            assert!(is_source(&line), "{line}");
        }
        for line in [
            "",
            "# frames of my film",
            "# Auto of \"a.mp4\"",
            "# Auto of \"a.mp4\", 5 bytes of long ago",
            "# Auto of \"a.mp4\", 5 bytes of 6 ns, for people",
            "# Frames(some) of \"a.mp4\", 5 bytes of 6 ns",
            "Auto of \"a.mp4\", 5 bytes of 6 ns",
        ] {
            assert!(!is_source(line), "{line}");
        }
    }

    #[test]
    fn only_what_a_list_names_is_replaced() {
        let here = tempfile::tempdir().unwrap();
        let folder = here.path().join("photos");
        assert!(may_replace(&folder));
        fs::create_dir(&folder).unwrap();
        assert!(may_replace(&folder));

        let first = "# Auto of \"a.mp4\", 5 bytes of 6 ns";
        let frames = ["000000.250s.jpg", "000001.500s.jpg"].map(|name| VideoFrame {
            name: name.to_owned(),
            time_s: 1.0,
        });
        write(&folder, first, &frames).unwrap();
        fs::write(folder.join(&frames[0].name), "").unwrap();
        assert!(may_replace(&folder), "though a frame is gone");
        fs::write(folder.join("precious.png"), "").unwrap();
        assert!(!may_replace(&folder));
        fs::remove_file(folder.join("precious.png")).unwrap();
        assert!(may_replace(&folder));

        // A list of somebody's own.
        for text in ["", "000000.250s.jpg\n", "# Auto\n1 000000.250s.jpg\n"] {
            fs::write(folder.join(FILE), text).unwrap();
            assert!(!may_replace(&folder), "{text}");
        }
        assert!(!may_replace(&folder.join(FILE)), "no folder");
    }
}
