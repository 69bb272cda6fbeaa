//! `lumigraph generate`

use super::Usage;
use super::options::size;
use super::output::print;
use super::session::spinner;
use datasets::{DatasetError, Options};
use std::path::PathBuf;

/// Write a synthetic scene with exact truth, in users' formats
///
/// Photos, a COLMAP model, depth maps and a split, as a capture of real photos would have.
///
///     lumigraph generate shelf -o shelf
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    /// Which: shelf, wall, helicopter, knick-knacks, hallway or car
    name: String,
    /// Size of the photos in pixels [default: the scene's own]
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<(u32, u32)>,
    /// How many photos [default: the scene's own]
    #[arg(long, value_name = "N")]
    photos: Option<usize>,
    /// The capture's folder
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let options = Options {
        size: args.size,
        views: args.photos,
        ..Options::default()
    };
    let dataset = datasets::by_name(&args.name, &options).map_err(|error| match error {
        // What was typed, not what was found.
        DatasetError::UnknownName { .. } | DatasetError::Option { .. } => {
            Usage(error.to_string()).into()
        }
        error => anyhow::Error::new(error),
    })?;
    let bar = spinner("rendering the photos");
    let written = datasets::write(&dataset, &args.output);
    bar.finish_and_clear();
    let written = written?;
    print(&format!(
        "{}: {} photos ({} to hold out), {} points\n",
        written.folder.display(),
        written.photos,
        written.held_out,
        written.points
    ))
}
