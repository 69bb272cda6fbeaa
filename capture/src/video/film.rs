//! Films out of frames, through `ffmpeg`.

use super::{EXACT, ffmpeg, scan};
use crate::ToolError;
use crate::folder::{beside, left_beside};
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

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
    /// The program reports success, but cannot read even the first frame of what it made.
    #[error(
        "ffmpeg cannot read the film that it made; check that the disk is not full, and that this ffmpeg has a decoder \
         for such films, not only an encoder: {source}"
    )]
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
/// stays until then. Of several that are made of one name at once the last to be complete stays. What a process that is
/// killed leaves is removed by the next that makes a film of this name.
///
/// # Errors
/// `ffmpeg` is missing or fails, or leaves no film that can be read; a frame cannot be had or has another size.
pub fn encode(
    video: &Path,
    (width, height): (u32, u32),
    frames_per_second: f64,
    frames: impl Iterator<Item = io::Result<Vec<u8>>> + Send,
) -> Result<(), FilmError> {
    let temporary = begin(video);
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

/// Begins the file in which a film lies until it is complete: hidden beside its place, called as the film and with its
/// ending, by which ffmpeg goes, and one that no other film in the making has, of this process or another. Those that
/// processes which were killed left of a film of this name are removed: nobody else would find them.
fn begin(video: &Path) -> PathBuf {
    for (left, end) in left_beside(video) {
        let is_file = fs::symlink_metadata(&left).is_ok_and(|left| left.is_file());
        if is_file && end.starts_with('-') {
            // What may not be removed is in nobody's way.
            let _ = fs::remove_file(left);
        }
    }
    let mut number = 0_u32;
    loop {
        let hidden = beside(video, &format!("partial-{}-{number}", std::process::id()));
        let mut path = hidden.into_os_string();
        if let Some(end) = video.extension() {
            path.push(".");
            path.push(end);
        }
        match File::create_new(&path) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => number += 1,
            // Where it cannot be made, ffmpeg says why.
            _ => return path.into(),
        }
    }
}

/// Fails of a film that is not there, is empty, or of which not even the first frame can be read, whatever ffmpeg said as
/// it made it. Of a film that lacks its end this finds those that cannot be read without (.mp4, .mov); others (.mkv, .webm,
/// .avi) begin as they should, and that ffmpeg tells of their end, by -xerror, is all there is.
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
    fn what_killed_runs_left_of_a_film_goes_as_it_is_made_again() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        // Beyond the numbers that Linux gives.
        let gone = u32::MAX;
        let own = std::process::id();
        let left = at(&format!(".film.mp4.partial-{gone}-0.mp4"));
        let stays = [
            format!(".other.mp4.partial-{gone}-0.mp4"),
            format!(".film.mp4.partial-{gone}.mp4"),
            format!(".film.mp4.partial-{own}-0.mp4"),
            "film.mp4".to_owned(),
        ];
        for path in stays.iter().map(|name| at(name)).chain([left.clone()]) {
            fs::write(path, "of before").unwrap();
        }
        let film = at("film.mp4");
        let begun = [begin(&film), begin(&film)];
        let expected = [1, 2].map(|number| at(&format!(".film.mp4.partial-{own}-{number}.mp4")));
        assert_eq!(begun, expected);
        assert!(begun.iter().all(|path| path.is_file()));
        for name in stays {
            assert_eq!(fs::read(at(&name)).unwrap(), b"of before", "{name}");
        }
        let tells = cfg!(target_os = "linux") && Path::new("/proc/self").exists();
        assert_eq!(left.exists(), !tells);
        // A name as long as disks take leaves room.
        let long = begin(&at(&format!("{}.mp4", "n".repeat(251))));
        assert!(long.is_file() && is_film(&long));
    }

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
