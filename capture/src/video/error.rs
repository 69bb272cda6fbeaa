use super::Damage;
use crate::ToolError;
use std::io;
use std::path::{Path, PathBuf};

/// Why no photos could be taken out of a video.
#[derive(Debug, thiserror::Error)]
pub enum VideoError {
    /// The program that decodes it is missing or fails.
    #[error(transparent)]
    Tool(#[from] ToolError),
    /// The file cannot be read.
    #[error("{}: cannot read the video: {source}; check that it is there", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// What the program says of the file is not what was expected.
    #[error(
        "{}: ffmpeg cannot decode this as a video; give a video, or a folder of photos: {source}",
        path.display()
    )]
    Decode {
        /// The file.
        path: PathBuf,
        /// What it says.
        source: ToolError,
    },
    /// A text, which ffmpeg would draw letter by letter.
    #[error(
        "{}: a text, not a video; give a video, or a folder of photos",
        path.display()
    )]
    Text {
        /// The file.
        path: PathBuf,
    },
    /// A file with too few frames.
    #[error(
        "{}: {frames} frames found, expected a video of two or more; for photos give their folder",
        path.display()
    )]
    NoVideo {
        /// The file.
        path: PathBuf,
        /// How many it has.
        frames: usize,
    },
    /// So few are asked for that one is taken.
    #[error(
        "{}: one frame would be taken of {seconds:.1} s, and photos are two or more; ask for more, by --fps or --frames",
        path.display()
    )]
    OneFrame {
        /// The file.
        path: PathBuf,
        /// How long it is.
        seconds: f64,
    },
    /// A video that goes on as another one.
    #[error(
        "{}: its pictures change in size or kind at {at_s:.2} s, as where recordings are joined; make them alike first, for one \
         by `ffmpeg -i VIDEO -vf scale=1280:720,setsar=1,format=yuv420p ALIKE.mp4`",
        path.display()
    )]
    Changes {
        /// The file.
        path: PathBuf,
        /// When, in seconds.
        at_s: f64,
    },
    /// A video with too few frames that are whole.
    #[error(
        "{}: {whole} of its {frames} frames can be decoded undamaged, expected two or more: {damage}; \
         copy the file again, or give a folder of photos",
        path.display()
    )]
    Damaged {
        /// The file.
        path: PathBuf,
        /// How many frames it has.
        frames: usize,
        /// How many of them are whole.
        whole: usize,
        /// What is wrong.
        damage: Damage,
    },
    /// The folder for the frames holds something else.
    #[error(
        "{}: holds something other than an earlier import's frames; remove or rename it, or \
         choose another folder", folder.display()
    )]
    Occupied {
        /// The folder.
        folder: PathBuf,
    },
    /// The second time the video was decoded it was another.
    #[error(
        "{}: frame {frame} was there when the frames were scored, but not when they were written; \
         has the file changed meanwhile? import it again",
        path.display()
    )]
    Changed {
        /// The file.
        path: PathBuf,
        /// The first being 0.
        frame: usize,
    },
    /// A file or folder cannot be written.
    #[error("{}: cannot write: {source}", path.display())]
    Write {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

impl VideoError {
    pub(super) fn write_at(path: &Path) -> impl Fn(io::Error) -> Self + use<> {
        let path = path.to_owned();
        move |source| Self::Write {
            path: path.clone(),
            source,
        }
    }
}
