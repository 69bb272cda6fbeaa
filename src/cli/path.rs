//! `lumigraph path`

use super::output::{make_parent, print, say};
use super::targets::check_apart;
use clap::ValueEnum;
use render::path::{
    self, NerfstudioFrame, is_nerfstudio, read_in, read_keyframes, write_nerfstudio,
};
use std::path::PathBuf;

/// Turn a camera path into nerfstudio's format, or into this program's
///
/// Of keyframes the frames between them are written; nerfstudio's file keeps the keyframes beside
/// them, for its viewer. It knows pinholes alone, with square pixels and their principal point in
/// the middle: those that `view` and derived paths have.
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

    /// Says so where the file changes nothing, as what was read, if anything, is no path of nerfstudio's.
    pub(super) fn say_unused(&self, read: Option<&PathBuf>) {
        let is_used = || read.is_some_and(|path| is_nerfstudio(path));
        if self.dataparser_transforms.is_some() && !is_used() {
            say!("note: --dataparser-transforms changes nothing: there is no path of nerfstudio's");
        }
    }
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let inputs = [Some(&args.path), args.nerfstudio.file()].into_iter();
    let inputs: Vec<PathBuf> = inputs.flatten().cloned().collect();
    check_apart("the path is", [args.output.as_path()], &inputs)?;
    let frame = args.nerfstudio.frame()?;
    let read = read_in(&args.path, &frame)?;
    make_parent(&args.output)?;
    match args.format {
        Format::Nerfstudio => {
            let keyframes = read_keyframes(&args.path, &frame)?;
            write_nerfstudio(&args.output, &read, keyframes.as_ref(), &frame)?;
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
