//! Films out of frames, through `ffmpeg`.

use super::{EXACT, ffmpeg, scan};
use crate::ToolError;
use std::ffi::OsString;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// What the names of films usually end in; ffmpeg may know others.
pub const FILMS: [&str; 5] = ["mp4", "webm", "mkv", "mov", "avi"];

/// Whether a file is called as films usually are.
pub fn is_film(video: &Path) -> bool {
    let end = video.extension().unwrap_or_default();
    FILMS.iter().any(|film| end.eq_ignore_ascii_case(film))
}

/// Why a film could not be made. Which one, whoever asked for it says.
#[derive(Debug, thiserror::Error)]
pub enum FilmError {
    /// The program that makes it is missing or fails, or a frame is not to be had.
    #[error(transparent)]
    Tool(#[from] ToolError),
    /// The program reports success, but left nothing.
    #[error("ffmpeg left no film, or an empty file; check that the disk is not full")]
    Empty,
    /// The program reports success, but cannot read what it made.
    #[error("ffmpeg cannot read the film that it made; check that the disk is not full: {source}")]
    Unreadable {
        /// What it says.
        source: ToolError,
    },
    /// It is made, and cannot be given its name.
    #[error("the film is made, but cannot be given its name: {source}")]
    Rename {
        /// Why.
        source: io::Error,
    },
}

/// Makes a video of frames, each the RGB bytes of a picture of `width` × `height`: H.264 in .mp4, or
/// what else ffmpeg takes the file's name to mean. Films have even sizes: an odd width or
/// height gains one more of its last column or row. The video appears complete or not at all: one that was there
/// stays until then. Of several that are made of one name at once the last to be complete stays.
///
/// # Errors
/// `ffmpeg` is missing or fails, or leaves no film that can be read; a frame cannot be had or has another size.
pub fn encode(
    video: &Path,
    (width, height): (u32, u32),
    frames_per_second: f64,
    frames: impl Iterator<Item = io::Result<Vec<u8>>> + Send,
) -> Result<(), FilmError> {
    let temporary = beside(video);
    let mut arguments: Vec<OsString> = Vec::new();
    let own = [width as usize, height as usize];
    let [even_width, even_height] = own.map(|side| side.next_multiple_of(2));
    let size = format!("{even_width}x{even_height}");
    let rate = frames_per_second.to_string();
    // Without -xerror ffmpeg reports success where a film's end finds no room on the disk, and short ones are
    // written at their end.
    let given = "-y -v error -xerror -f rawvideo -pix_fmt rgb24 -s";
    arguments.extend(given.split(' ').map(OsString::from));
    arguments.push(size.into());
    // The frames are sRGB with full range.
    let (matrix, mark) = matrix_of(video);
    let filter = format!("scale=out_color_matrix={matrix}:out_range=tv:{EXACT}");
    let made = [
        "-r", &rate, "-i", "-", "-vf", &filter, "-pix_fmt", "yuv420p",
    ];
    arguments.extend(made.map(OsString::from));
    let marked = [
        "-colorspace",
        mark,
        "-color_primaries",
        "bt709",
        "-color_trc",
        "bt709",
    ];
    arguments.extend(marked.map(OsString::from));
    arguments.push(scan::file(&temporary));
    let made = ffmpeg().feed(&arguments, move |mut stdin| {
        for frame in frames {
            let frame = frame?;
            if frame.len() != 3 * own[0] * own[1] {
                return Err(io::Error::other("a frame has another size"));
            }
            stdin.write_all(&made_even(frame, own))?;
        }
        Ok(())
    });
    let made = made.map_err(FilmError::from);
    let placed = made.and_then(|()| check(&temporary)).and_then(|()| {
        fs::rename(&temporary, video).map_err(|source| FilmError::Rename { source })
    });
    if placed.is_err() {
        // There is nothing to do about it where this fails, too.
        let _ = fs::remove_file(&temporary);
    }
    placed
}

/// Where a film lies until it is complete: hidden beside its place, with its ending, by which ffmpeg goes, and with a
/// name that no other film in the making has, of this process or another.
fn beside(video: &Path) -> PathBuf {
    static FILMS_BEGUN: AtomicUsize = AtomicUsize::new(0);
    let number = FILMS_BEGUN.fetch_add(1, Ordering::Relaxed);
    let mut name = OsString::from(format!(".partial-{}-{number}", std::process::id()));
    if let Some(end) = video.extension() {
        name.push(".");
        name.push(end);
    }
    video.with_file_name(name)
}

/// Fails of a film that is not there, is empty, or cannot be read, whatever ffmpeg said as it made it.
fn check(made: &Path) -> Result<(), FilmError> {
    if fs::metadata(made).map_or(0, |file| file.len()) == 0 {
        return Err(FilmError::Empty);
    }
    // Others may be such as say nothing of themselves (.yuv).
    if !is_film(made) {
        return Ok(());
    }
    let words = "-v error -xerror -i".split(' ');
    let mut arguments: Vec<OsString> = words.map(Into::into).collect();
    arguments.push(scan::file(made));
    arguments.extend("-frames:v 1 -f null -".split(' ').map(Into::into));
    let read = ffmpeg().stream(&arguments, &mut |_| {}, |_| Ok(()));
    read.map_err(|source| FilmError::Unreadable { source })
}

/// A frame's RGB bytes with one more of its last column and row where these are odd in number.
fn made_even(mut frame: Vec<u8>, [width, height]: [usize; 2]) -> Vec<u8> {
    if width % 2 == 1 {
        let rows = frame.chunks_exact(3 * width);
        frame = rows
            .flat_map(|row| [row, &row[3 * (width - 1)..]])
            .flatten()
            .copied()
            .collect();
    }
    if height % 2 == 1 {
        let last_row = 3 * width.next_multiple_of(2) * (height - 1);
        frame.extend_from_within(last_row..);
    }
    frame
}

/// What a film's colours are written in, and what ffmpeg marks it by: BT.709, which players expect, in files that can
/// say so. Of all that do not (.avi, .wmv), players take BT.601 for granted.
fn matrix_of(video: &Path) -> (&'static str, &'static str) {
    const TOLD: [&str; 5] = ["mp4", "m4v", "mov", "mkv", "webm"];
    let end = video.extension().unwrap_or_default();
    match TOLD.iter().any(|told| end.eq_ignore_ascii_case(told)) {
        true => ("bt709", "bt709"),
        false => ("bt601", "smpte170m"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odd_frames_gain_one_more_of_their_last_column_and_row() {
        let frame = |pixels: &[u8]| -> Vec<u8> { pixels.iter().flat_map(|p| [*p; 3]).collect() };
        let cases: [([usize; 2], &[u8], &[u8]); 5] = [
            ([1, 2], &[1, 2], &[1, 1, 2, 2]),
            ([2, 1], &[1, 2], &[1, 2, 1, 2]),
            ([1, 1], &[1], &[1; 4]),
            ([2, 2], &[1, 2, 3, 4], &[1, 2, 3, 4]),
            (
                [3, 3],
                &[1, 2, 3, 4, 5, 6, 7, 8, 9],
                &[1, 2, 3, 3, 4, 5, 6, 6, 7, 8, 9, 9, 7, 8, 9, 9],
            ),
        ];
        for (size, pixels, even) in cases {
            assert_eq!(made_even(frame(pixels), size), frame(even), "{size:?}");
        }
    }
}
