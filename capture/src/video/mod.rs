//! Photos out of a video: of each stretch of time the sharpest frame, through `ffmpeg`; and films out of frames.
//!
//! The video is decoded twice: once small and grey, to score how sharp every frame is, and
//! once at full size for the chosen ones alone. Times are those of presentation, so a
//! variable frame rate is no matter; frames come turned as the video asks for, and with square pixels.
//!
//! ```no_run
//! use capture::video::{self, FrameCount, FrameShape};
//! use std::path::Path;
//!
//! let ffmpeg = video::ffmpeg();
//! let (video, folder) = (Path::new("desk.mp4"), Path::new("photos"));
//! let (count, shape) = (FrameCount::Auto, FrameShape::Square);
//! let frames = video::extract(&ffmpeg, video, count, shape, folder, &mut |_| {})?;
//! println!("{} at {} s", frames[0].name, frames[0].time_s);
//! # Ok::<(), video::VideoError>(())
//! ```

mod choose;
mod damage;
mod error;
mod film;
mod list;
mod range;
mod scan;
mod shape;

pub use choose::{FrameCount, ScoredFrame, choose};
pub use damage::Damage;
pub use error::VideoError;
pub use film::{FILMS, FilmError, encode, is_film};
pub use list::VideoFrame;
pub use range::Curve;
pub use scan::{scan, sharpness};
pub use shape::FrameShape;

use crate::Tool;
use crate::folder::{beside, place_of, take_place};
use range::HighRange;
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

/// A step of an extraction, for progress.
#[derive(Clone, Debug, PartialEq)]
pub enum VideoProgress {
    /// So many frames were scored, up to this time.
    Scored {
        /// Frames so far.
        frames: usize,
        /// Of the last one.
        time_s: f64,
    },
    /// Not all of the video could be decoded; frames that are damaged are passed over.
    Damaged(Damage),
    /// Its pixels are not square: frames are drawn out to the width and height at which players show them.
    Stretched {
        /// As they are stored.
        from: (u32, u32),
        /// As they are written.
        to: (u32, u32),
    },
    /// Its frames are interlaced, and are made whole ones.
    Deinterlaced,
    /// Its colours are of a high dynamic range, stored by this curve, and are brought to that of photos.
    HighDynamicRange(Curve),
    /// So many of the chosen frames are being written.
    Writing {
        /// How many in all.
        frames: usize,
    },
    /// An earlier run had written them already.
    Done {
        /// How many.
        frames: usize,
    },
}

/// The program that decodes videos.
pub fn ffmpeg() -> Tool {
    Tool {
        program: PathBuf::from("ffmpeg"),
        install: "install ffmpeg: `apt-get install ffmpeg` on Debian and Ubuntu, `brew install \
                  ffmpeg` on macOS, elsewhere from https://ffmpeg.org/download.html",
    }
}

/// How colours are converted: else ffmpeg rounds them down, by a level and more where the matrix changes.
const EXACT: &str = "flags=bicubic+accurate_rnd+full_chroma_int+full_chroma_inp";

/// Writes a video's sharpest frames into `folder`, as JPEG files of high quality that are
/// named by their time in seconds, and a list of them. A folder that holds anything else is
/// left alone. Where an earlier run did the same
/// with the same video, nothing is done; another video's frames are replaced, and those of an earlier version where
/// they would be others now. An
/// interrupted run leaves no folder, or the earlier one. Frames that ffmpeg says are corrupt, and
/// an MJPEG's in which it reports errors, are passed over, with those up to the next key frame, which
/// are predicted from them. Where that leaves one photo of several, they are taken of the time of the
/// whole frames ([`choose()`]). Two extractions at once into one folder take each other's frames away: whoever starts
/// them keeps them apart ([`hold_now`](crate::hold::hold_now)). Frames whose pixels are not square are drawn out as `shape` says.
/// Interlaced ones are deinterlaced before they are scored, and those of a high dynamic range brought to that of photos, but for
/// those of an earlier run, which stay as they are.
///
/// # Errors
/// `ffmpeg` is missing or fails; a file that is no video or has but one whole frame, or whose pictures change in size on
/// the way; a count of frames that takes one; a folder that
/// holds anything but an earlier run's frames; files that cannot be read or written.
pub fn extract(
    ffmpeg: &Tool,
    video: &Path,
    count: FrameCount,
    shape: FrameShape,
    folder: &Path,
    report: &mut dyn FnMut(VideoProgress),
) -> Result<Vec<VideoFrame>, VideoError> {
    let source = list::source(video, count)?;
    if let Some(frames) = list::read(folder, &source, shape) {
        report(VideoProgress::Done {
            frames: frames.len(),
        });
        return Ok(frames);
    }

    if !list::may_replace(folder) {
        return Err(VideoError::Occupied {
            folder: folder.to_owned(),
        });
    }

    // 1. Which frames.
    let spelling = scan::spelling(ffmpeg)?;
    let mut scanned = scan::scan_with(ffmpeg, spelling, video, report)?;
    let scored = std::mem::take(&mut scanned.frames);
    if scored.len() < 2 {
        return Err(VideoError::NoVideo {
            path: video.to_owned(),
            frames: scored.len(),
        });
    }
    if let Some(damage) = scanned.damage.take() {
        let whole = scored.len() - damage.frames;
        if whole < 2 {
            return Err(VideoError::Damaged {
                path: video.to_owned(),
                frames: scored.len(),
                whole,
                damage,
            });
        }
        report(VideoProgress::Damaged(damage));
    }
    let oblong = scanned.shape.and_then(|stored| stored.oblong());
    let stretched = oblong.and_then(|oblong| Some((oblong.stored, oblong.drawn_out(shape)?)));
    if let Some((from, to)) = stretched {
        report(VideoProgress::Stretched { from, to });
    }
    if scanned.is_interlaced {
        report(VideoProgress::Deinterlaced);
    }
    if let Some(range) = &scanned.range {
        report(VideoProgress::HighDynamicRange(range.curve));
    }
    let chosen = choose(&scored, count);
    if chosen.len() < 2 {
        return Err(VideoError::OneFrame {
            path: video.to_owned(),
            seconds: scored.last().map_or(0.0, |frame| frame.time_s),
        });
    }
    let times_s: Vec<f64> = chosen.iter().map(|&i| scored[i].time_s).collect();
    // The first version took the same ones if nothing of them was to be changed.
    let first = list::read_first_version(folder, &source).filter(|frames| {
        let times = frames.iter().map(|frame| frame.time_s);
        stretched.is_none() && scanned.is_as_in_first_version() && times.eq(times_s.iter().copied())
    });
    if let Some(frames) = first {
        list::write(folder, &source, oblong, shape, &frames)?;
        report(VideoProgress::Done {
            frames: frames.len(),
        });
        return Ok(frames);
    }
    report(VideoProgress::Writing {
        frames: chosen.len(),
    });

    // 2. Their pixels, into a folder beside the final one.
    let failed = VideoError::write_at;
    let place = place_of(folder).map_err(failed(folder))?;
    let partial = beside(&place, "partial");
    if partial.exists() {
        fs::remove_dir_all(&partial).map_err(failed(&partial))?;
    }
    fs::create_dir_all(&partial).map_err(failed(&partial))?;
    let from = scan::input(video, scanned.decoding);
    let drawing = Drawing {
        chosen: &chosen,
        whole: scanned.deinterlaced(),
        range: scanned.range.as_ref(),
        size: stretched.map(|(_, to)| to),
    };
    let written = write_frames(ffmpeg, spelling, from, &drawing, &partial);
    if written.is_err() {
        // It would keep a full disk full.
        let _ = fs::remove_dir_all(&partial);
    }
    written?;
    let mut frames = Vec::new();
    for (i, (&frame_idx, name)) in chosen.iter().zip(names(&times_s)).enumerate() {
        let time_s = times_s[i];
        let written = partial.join(format!("{}.jpg", i + 1));
        if !written.is_file() {
            return Err(VideoError::Changed {
                path: video.to_owned(),
                frame: frame_idx,
            });
        }
        fs::rename(&written, partial.join(&name)).map_err(failed(&written))?;
        frames.push(VideoFrame { name, time_s });
    }
    list::write(&partial, &source, oblong, shape, &frames)?;

    // 3. It takes its place.
    take_place(&partial, &place).map_err(failed(folder))?;
    Ok(frames)
}

/// Whether [`extract`] would find that an earlier run took the same frames, or would not replace what the folder holds.
///
/// # Errors
/// The video cannot be read.
pub fn would_stay(
    video: &Path,
    count: FrameCount,
    shape: FrameShape,
    folder: &Path,
) -> Result<bool, VideoError> {
    let source = list::source(video, count)?;
    Ok(list::read(folder, &source, shape).is_some() || !list::may_replace(folder))
}

/// Which frames are written, and how.
struct Drawing<'a> {
    /// Their indices, which rise.
    chosen: &'a [usize],
    /// Begins the filter: see [`scan::Scan::deinterlaced`].
    whole: &'a str,
    range: Option<&'a HighRange>,
    /// To draw them out to.
    size: Option<(u32, u32)>,
}

/// Writes frames as 1.jpg, 2.jpg, …; `arguments` say of which video.
fn write_frames(
    ffmpeg: &Tool,
    spelling: scan::Spelling,
    mut arguments: Vec<OsString>,
    drawing: &Drawing<'_>,
    folder: &Path,
) -> Result<(), VideoError> {
    // 1. The filter, in a file: an argument must not be as long as many frames make it.
    let [filter_file, table_file] = ["filter.txt", "table.cube"].map(|name| folder.join(name));
    let write =
        |file: &Path, content: &[u8]| fs::write(file, content).map_err(VideoError::write_at(file));
    let mut filter =
        format!("{}select='{}',", drawing.whole, is_any_of(drawing.chosen)).into_bytes();
    if let Some(range) = drawing.range {
        write(&table_file, range.table().as_bytes())?;
        filter.extend(range.filter(&in_filter(&table_file), EXACT));
    }
    // JPEG's colours are BT.601 in full range whatever the video's are.
    let (size, square) = match drawing.size {
        Some((width, height)) => (format!("w={width}:h={height}:"), ",setsar=1"),
        None => (String::new(), ""),
    };
    let scale = format!("scale={size}out_color_matrix=bt601:out_range=full:{EXACT}{square}");
    filter.extend(format!("{scale},format=yuvj420p").as_bytes());
    write(&filter_file, &filter)?;

    // 2. The frames.
    arguments.extend([spelling.filter_file.into(), scan::file(&filter_file)]);
    arguments.extend(spelling.passthrough.map(Into::into));
    let quality = "-c:v mjpeg -q:v 1 -qmin 1 -bitexact -f image2";
    arguments.extend(quality.split(' ').map(Into::into));
    arguments.push(scan::file(&literal(folder).join("%d.jpg")));
    ffmpeg.stream(&arguments, &mut |_| {}, |_| Ok(()))?;
    for file in [&filter_file, &table_file]
        .into_iter()
        .filter(|file| file.exists())
    {
        fs::remove_file(file).map_err(VideoError::write_at(file))?;
    }
    Ok(())
}

/// A file's path as a filter's option takes it: what means something to options, and then what does to filters, is marked.
fn in_filter(path: &Path) -> Vec<u8> {
    // What begins a value, were it white, would be cut off.
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let marked = |bytes: &[u8], special: &[u8]| {
        let mut text = Vec::with_capacity(bytes.len());
        for byte in bytes {
            if special.contains(byte) {
                text.push(b'\\');
            }
            text.push(*byte);
        }
        text
    };
    let option = marked(path.as_os_str().as_encoded_bytes(), br"\':");
    marked(&option, br"\'[],;")
}

/// What frames' files are called: by their times in seconds, to the millisecond, or to as many
/// digits as tell them all apart. Times differ, and names sort as they do.
fn names(times_s: &[f64]) -> Vec<String> {
    // ffmpeg prints no more.
    const MOST_DIGITS: usize = 17;
    let with = |digits: usize| -> Vec<String> {
        let width = 7 + digits;
        let name = |time_s: &f64| format!("{time_s:0width$.digits$}s.jpg");
        times_s.iter().map(name).collect()
    };
    let differ = |names: &Vec<String>| names.iter().collect::<BTreeSet<_>>().len() == names.len();
    let fewest = (3..MOST_DIGITS).map(with).find(differ);
    fewest.unwrap_or_else(|| with(MOST_DIGITS))
}

/// ffmpeg's expression that is not zero for the frames of these indices, which rise. It
/// halves them again and again: ffmpeg refuses what is nested a hundred deep, as a plain sum is.
fn is_any_of(frames: &[usize]) -> String {
    match frames {
        [] => "0".to_owned(),
        [only] => format!("eq(n,{only})"),
        _ => {
            let (before, from) = frames.split_at(frames.len() / 2);
            format!(
                "if(lt(n,{}),{},{})",
                from[0],
                is_any_of(before),
                is_any_of(from)
            )
        }
    }
}

/// A folder as it must stand before a pattern for files' names, where `%` begins a number.
fn literal(folder: &Path) -> PathBuf {
    // What is no Unicode can only be handed on as it is.
    folder.to_str().map_or_else(
        || folder.to_owned(),
        |name| PathBuf::from(name.replace('%', "%%")),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_a_fraction_of_a_millisecond_apart_have_names_of_their_own() {
        assert_eq!(names(&[]), [""; 0]);
        assert_eq!(
            names(&[0.25, 12.0, 3600.062]),
            ["000000.250s.jpg", "000012.000s.jpg", "003600.062s.jpg"]
        );
        // 2,400 frames a second.
        let fast: Vec<f64> = (0..2400).map(|i| f64::from(i) / 2400.0).collect();
        let named = names(&fast);
        assert_eq!(named[..2], ["000000.0000s.jpg", "000000.0004s.jpg"]);
        assert!(named.is_sorted());
        assert_eq!(names(&[1.0, 1.0000001])[1], "000001.0000001s.jpg");
    }
}
