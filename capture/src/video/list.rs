//! `frames.txt`: what was taken out of which video. Its first line says where from and how, each
//! other has a frame's time in seconds and its name.

use super::shape::{Oblong, size};
use super::{FrameCount, FrameShape, VideoError};
use crate::{fingerprint, write_whole};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::Path;

/// Beside the frames.
const FILE: &str = "frames.txt";

/// Said of how frames are made, so that they are made anew once that makes others of the same video: of the first
/// version nothing is said. In version 2 colours are exact, and pixels square.
const VERSION: &str = ", version 2";
/// Said of frames whose pixels are not square as they are stored: of those with square ones, and of others.
const DRAWN_OUT: &str = "drawn out";
const AS_STORED: &str = "as stored";

/// A frame that was written.
#[derive(Clone, Debug, PartialEq)]
pub struct VideoFrame {
    /// Of its file in the folder.
    pub name: String,
    /// When it is shown, in seconds from the video's start.
    pub time_s: f64,
}

/// How the first line begins: the video as it is now, and how many frames are asked for.
pub(super) fn source(video: &Path, count: FrameCount) -> Result<String, VideoError> {
    let now = fingerprint(video).map_err(|source| VideoError::Read {
        path: video.to_owned(),
        source,
    })?;
    let name = video.file_name().unwrap_or_default().to_string_lossy();
    Ok(format!("# {count:?} of {name:?}, {now}"))
}

/// How it ends: how frames are made, which is the same for all shapes if pixels are square.
fn how(oblong: Option<Oblong>, wanted: FrameShape) -> String {
    let shape = oblong.map(|oblong| {
        let shape = match oblong.drawn_out(wanted) {
            Some(_) => DRAWN_OUT,
            None => AS_STORED,
        };
        format!(", {oblong}, {shape}")
    });
    format!("{VERSION}{}", shape.unwrap_or_default())
}

/// Whether a line that begins with its source ends with how frames would be made now.
fn is_made_so(ending: &str, wanted: FrameShape) -> bool {
    let shape = ending.strip_prefix(VERSION).unwrap_or_default();
    let sizes = shape.strip_prefix(", ").and_then(|s| s.rsplit_once(", "));
    let oblong = sizes.and_then(|(sizes, _)| Oblong::parse(sizes));
    ending == how(oblong, wanted)
}

/// Whether a line is a first one, of any video and version.
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
    let is_how = |part: &str| {
        let version = part.strip_prefix("version ");
        // In place of a version, for a while.
        let calibrated = part.strip_prefix("for ");
        [DRAWN_OUT, AS_STORED].contains(&part)
            || version.is_some_and(|n| n.parse::<u32>().is_ok())
            || calibrated.is_some_and(|text| size(text).is_some())
            || Oblong::parse(part).is_some()
    };
    let is_fingerprint = |text: &str| {
        let numbers = text
            .split_once(" bytes of ")
            .and_then(|(bytes, time)| Some([bytes, time.strip_suffix(" ns")?]));
        numbers.is_some_and(|numbers| numbers.iter().all(|n| n.parse::<u128>().is_ok()))
    };
    let is_made = |text: &str| {
        let mut parts = text.split(", ");
        parts.next().is_some_and(is_fingerprint) && parts.all(is_how)
    };
    // A video's name may hold anything; it ends with the last quotation mark.
    let parts = line.strip_prefix("# ").and_then(|line| {
        let (count, named) = line.split_once(" of \"")?;
        let (_, made) = named.rsplit_once("\", ")?;
        Some((count, made))
    });
    parts.is_some_and(|(count, made)| is_count(count) && is_made(made))
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

/// The frames that an earlier run took from the same source in the same way, if all are still there.
pub(super) fn read(folder: &Path, source: &str, wanted: FrameShape) -> Option<Vec<VideoFrame>> {
    let is_made_so = |ending: &str| is_made_so(ending, wanted);
    read_where(folder, |line| {
        line.strip_prefix(source).is_some_and(is_made_so)
    })
}

/// The same of those that the first version took.
pub(super) fn read_first_version(folder: &Path, source: &str) -> Option<Vec<VideoFrame>> {
    read_where(folder, |line| line == source)
}

/// The frames of a list whose first line is wanted, if all are there.
fn read_where(folder: &Path, is_wanted: impl Fn(&str) -> bool) -> Option<Vec<VideoFrame>> {
    let text = fs::read_to_string(folder.join(FILE)).ok()?;
    let mut lines = text.lines();
    lines.next().filter(|line| is_wanted(line))?;
    let there = |line: &str| frame(line).filter(|frame| folder.join(&frame.name).is_file());
    lines.map(there).collect()
}

/// Lists frames. `oblong` are those of the video whose pixels are not square.
pub(super) fn write(
    folder: &Path,
    source: &str,
    oblong: Option<Oblong>,
    wanted: FrameShape,
    frames: &[VideoFrame],
) -> Result<(), VideoError> {
    let line = |frame: &VideoFrame| format!("{} {}\n", frame.time_s, frame.name);
    let lines: String = frames.iter().map(line).collect();
    let text = format!("{source}{}\n{lines}", how(oblong, wanted));
    let path = folder.join(FILE);
    write_whole(&path, |temporary| fs::write(temporary, text)).map_err(VideoError::write_at(&path))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HDV: Oblong = Oblong {
        stored: (1440, 1080),
        shown: (1920, 1080),
    };

    #[test]
    fn a_list_is_known_by_its_first_line() {
        let here = tempfile::tempdir().unwrap();
        // A name that looks like the rest of the line.
        let video = here.path().join("# Auto of b, 1 bytes of 2 ns.mp4");
        fs::write(&video, "video").unwrap();
        for count in [
            FrameCount::Auto,
            FrameCount::Frames(7),
            FrameCount::PerSecond(0.5),
        ] {
            let source = source(&video, count).unwrap();
            let endings = [
                how(None, FrameShape::Stored),
                how(Some(HDV), FrameShape::Square),
                how(Some(HDV), FrameShape::Stored),
            ];
            // Of earlier versions.
            let earlier = ["", ", as stored", ", for 640x480"].map(str::to_owned);
            for ending in endings.into_iter().chain(earlier) {
                let line = format!("{source}{ending}");
                assert!(is_source(&line), "{line}");
            }
        }
        for line in [
            "",
            "# frames of my film",
            "# Auto of \"a.mp4\"",
            "# Auto of \"a.mp4\", 5 bytes of long ago",
            "# Auto of \"a.mp4\", 5 bytes of 6 ns, for people",
            "# Auto of \"a.mp4\", 5 bytes of 6 ns, version of mine",
            "# Auto of \"a.mp4\", version 2",
            "# Frames(some) of \"a.mp4\", 5 bytes of 6 ns",
            "Auto of \"a.mp4\", 5 bytes of 6 ns",
        ] {
            assert!(!is_source(line), "{line}");
        }
    }

    #[test]
    fn frames_are_read_again_where_they_would_be_made_the_same() {
        let here = tempfile::tempdir().unwrap();
        let source = "# Auto of \"a.mp4\", 5 bytes of 6 ns";
        let frames = [VideoFrame {
            name: "000000.250s.jpg".to_owned(),
            time_s: 0.25,
        }];
        fs::write(here.path().join(&frames[0].name), "").unwrap();
        let of_stored = FrameShape::Calibrated(1440, 1080);
        let of_shown = FrameShape::Calibrated(1920, 1080);
        let all = [FrameShape::Square, of_shown, FrameShape::Stored, of_stored];
        // Which of them are there once one was taken.
        let there = |oblong, wanted| {
            write(here.path(), source, oblong, wanted, &frames).unwrap();
            assert_eq!(read_first_version(here.path(), source), None);
            all.map(|shape| read(here.path(), source, shape).is_some())
        };
        for shape in all {
            assert_eq!(there(None, shape), [true; 4], "{shape:?}");
        }
        for (shape, expected) in [
            (FrameShape::Square, [true, true, false, false]),
            (of_shown, [true, true, false, false]),
            (FrameShape::Stored, [false, false, true, true]),
            (of_stored, [false, false, true, true]),
        ] {
            assert_eq!(there(Some(HDV), shape), expected, "{shape:?}");
        }
        // Earlier ones may be others.
        for (ending, is_first) in [("", true), (", as stored", false), (", version 1", false)] {
            let list = format!("{source}{ending}\n0.25 000000.250s.jpg\n");
            fs::write(here.path().join(FILE), list).unwrap();
            assert_eq!(read(here.path(), source, FrameShape::Stored), None);
            let first = read_first_version(here.path(), source);
            assert_eq!(first.is_some(), is_first, "{ending}");
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
        write(&folder, first, None, FrameShape::Square, &frames).unwrap();
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
