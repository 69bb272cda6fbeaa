//! `lumigraph path`

use super::Usage;
use super::frames::{derived, read_path};
use super::output::{make_parent, print, say};
use super::targets::{check_apart, check_file};
use clap::ValueEnum;
use render::path::{self, NerfstudioFrame, is_nerfstudio, read_keyframes, write_nerfstudio};
use std::path::{Path, PathBuf};

/// Turn a camera path into nerfstudio's format, or into this program's
///
/// Of keyframes the frames between them are written; nerfstudio's file keeps the keyframes beside
/// them, for its viewer. It knows pinholes alone, with square pixels and their principal point in
/// the middle: those that `view` and derived paths have. Times of the scene it tells as shares of
/// a span that is not known here (`render_time`): they are neither read nor written, and
/// read again, a frame is of the time at which a film of the file's own frames a second shows it.
///
///     lumigraph path film/path.json --format nerfstudio -o camera_path.json
///     lumigraph path camera_path.json --format lumigraph -o path.json
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    /// The path, in either format, or a screenshot of `view`
    path: PathBuf,
    /// Whose format
    #[arg(long, value_enum)]
    format: Format,
    #[command(flatten)]
    nerfstudio: NerfstudioArgs,
    /// The file
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    /// Of `ns-render camera-path` and nerfstudio's viewer: camera_path.json
    Nerfstudio,
    /// Of `render --path`
    Lumigraph,
}

/// Where nerfstudio's world lies.
#[derive(clap::Args)]
pub(super) struct NerfstudioArgs {
    /// Where camera paths of nerfstudio lie: the dataparser_transforms.json in nerfstudio's
    /// output folder [default: in the scene's own frame]
    #[arg(long, value_name = "FILE")]
    dataparser_transforms: Option<PathBuf>,
}

impl NerfstudioArgs {
    /// The file, if there is one.
    pub(super) fn file(&self) -> Option<&PathBuf> {
        self.dataparser_transforms.as_ref()
    }

    /// What the file says.
    pub(super) fn frame(&self) -> anyhow::Result<NerfstudioFrame> {
        let file = self.dataparser_transforms.as_deref();
        Ok(file
            .map(NerfstudioFrame::read)
            .transpose()?
            .unwrap_or_default())
    }

    /// Whether nobody says where that which was read lies, a path of nerfstudio's.
    pub(super) fn is_unplaced(&self, read: Option<&PathBuf>) -> bool {
        self.dataparser_transforms.is_none() && read.is_some_and(|path| is_nerfstudio(path))
    }

    /// Says so where the file changes nothing, as what was read, if anything, is no path of nerfstudio's.
    pub(super) fn say_unused(&self, read: Option<&PathBuf>) {
        let is_used = || read.is_some_and(|path| is_nerfstudio(path));
        if self.dataparser_transforms.is_some() && !is_used() {
            say!("note: --dataparser-transforms changes nothing: there is no path of nerfstudio's");
        }
    }
}

/// Times nearer than this, in seconds, are the same but for rounding.
const SAME_S: f64 = 1e-6;

/// Whether one of a path's frames, of such times, is of another time than the one at which a film of so many a second
/// shows it.
pub(super) fn has_times(times_s: impl IntoIterator<Item = Option<f64>>, fps: f64) -> bool {
    let frames = times_s.into_iter().enumerate();
    let mut timed = frames.filter_map(|(index, time_s)| Some((index, time_s?)));
    timed.any(|(index, time_s)| (time_s - index as f64 / fps).abs() > SAME_S)
}

/// Fails where what is given is the name of a path that is derived from photos; a remedy is what to do instead.
pub(super) fn check_is_file(path: &Path, remedy: &str) -> Result<(), Usage> {
    match path.to_str() {
        Some(kind) if derived(kind).is_some() && !path.exists() => Err(Usage(format!(
            "{kind}: no file is called so; paths of that name are derived from a scene's photos, as by \
             `lumigraph render SCENE --path {kind} -o FRAMES`; {remedy}"
        ))),
        _ => Ok(()),
    }
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    check_is_file(&args.path, "give a path's file")?;
    check_file(&args.output, "-o")?;
    let inputs = [Some(&args.path), args.nerfstudio.file()].into_iter();
    let inputs: Vec<PathBuf> = inputs.flatten().cloned().collect();
    check_apart("the path is", "-o", [args.output.as_path()], &inputs)?;
    let frame = args.nerfstudio.frame()?;
    let read = read_path(&args.path, &frame)?;
    make_parent(&args.output)?;
    match args.format {
        Format::Nerfstudio => {
            let keyframes = read_keyframes(&args.path, &frame)?;
            let keyframes = keyframes.as_ref();
            write_nerfstudio(&args.output, &args.path, &read, keyframes, &frame)?;
            // Frames between keyframes without times of their own have those of the path.
            let is_timed =
                keyframes.is_none_or(|file| file.keyframes.iter().any(|k| k.time_s.is_some()));
            let times_s = read.frames.iter().map(|frame| frame.time_s);
            if is_timed && has_times(times_s, read.fps) {
                say!(
                    "note: left out: the scene's times; nerfstudio's format has no place for them, and \
                     read again a frame is of the time at which a film of {} frames a second shows it",
                    read.fps
                );
            }
        }
        Format::Lumigraph => {
            args.nerfstudio.say_unused(Some(&args.path));
            path::write(&args.output, &read)?;
        }
    }
    print(&format!(
        "{}: {} frames, {} a second\n",
        args.output.display(),
        read.frames.len(),
        read.fps
    ))
}
