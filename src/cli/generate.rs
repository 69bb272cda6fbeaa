//! `lumigraph generate`

use super::Usage;
use super::captured::Opened;
use super::options::size;
use super::output::{print, say};
use super::session::spinner;
use super::targets::check_new_folder;
use anyhow::Context;
use capture::as_argument;
use datasets::house::{self, HouseOptions};
use datasets::{DEPTH_STEPS_PER_UNIT, DatasetError, Options, Written};
use std::path::{Path, PathBuf};

/// Write a synthetic scene with exact truth, in users' formats
///
/// Photos, a COLMAP model, depth maps and a split, as a capture of real photos would have; of
/// `house`, a textured model of many rooms (.glb) and its cells and portals (interior.json). Of
/// `survey`, photos with depth of all rooms of such an interior, or any other that has a model.
///
///     lumigraph generate shelf -o shelf
///     lumigraph generate house --rooms 19 -o house
///     lumigraph generate survey --of house -o house-survey
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    /// Which: shelf, wall, helicopter, knick-knacks, hallway, car, house or survey
    name: String,
    /// Size of the photos in pixels [default: the scene's own]
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<(u32, u32)>,
    /// How many photos [default: the scene's own]
    #[arg(long, value_name = "N")]
    photos: Option<usize>,
    /// How many rooms a house has [default: 6]
    #[arg(long, value_name = "N")]
    rooms: Option<usize>,
    /// At least so many triangles for a house [default: 12000 for each room]
    #[arg(long, value_name = "N")]
    triangles: Option<usize>,
    /// Another number is another house [default: 1]
    #[arg(long, value_name = "N")]
    seed: Option<u32>,
    /// What a survey is of: an interior's folder, or its interior.json
    #[arg(long, value_name = "INTERIOR")]
    of: Option<PathBuf>,
    /// The capture's folder, or the interior's
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    if args.of.is_some() != (args.name == "survey") {
        let text = match &args.of {
            Some(_) => "--of belongs to `survey`",
            None => "a survey needs --of, the interior that it is of",
        };
        return Err(Usage(text.to_owned()).into());
    }
    check_new_folder(&args.output, |_| false)?;
    if args.name == "house" {
        return house(args);
    }
    if args.rooms.is_some() || args.triangles.is_some() || args.seed.is_some() {
        let text = "--rooms, --triangles and --seed belong to `house`";
        return Err(Usage(text.to_owned()).into());
    }
    let options = Options {
        size: args.size,
        views: args.photos,
        ..Options::default()
    };
    let written = match &args.of {
        Some(interior) => survey(args, interior, &options)?,
        None => {
            let dataset = datasets::by_name(&args.name, &options).map_err(usage)?;
            let bar = spinner("rendering the photos");
            let written = datasets::write(&dataset, &args.output);
            bar.finish_and_clear();
            written?
        }
    };
    print(&format!(
        "{}: {} photos ({} to hold out), {} points\n",
        written.folder.display(),
        written.photos,
        written.held_out,
        written.points
    ))
}

fn survey(args: &Args, interior: &Path, options: &Options) -> anyhow::Result<Written> {
    let opened = Opened::new(interior, None, |text| say!("warning: {text}"))?;
    let named = || interior.display().to_string();
    let bar = spinner("photographing the rooms");
    let survey = datasets::survey(&opened.interior, &opened.model, options).map_err(usage);
    let written = survey.map(|survey| {
        let written = datasets::write_survey(&survey, &args.output);
        (written, survey.depth_steps_per_unit)
    });
    bar.finish_and_clear();
    let (written, depth_steps) = written.with_context(named)?;
    let written = written?;
    if depth_steps != DEPTH_STEPS_PER_UNIT {
        let (step, folder) = (1.0 / depth_steps, as_argument(&args.output));
        say!(
            "note: a step of its depth maps is {step} world units, as eyes are {} over the floor: \
             `lumigraph import {folder} --depth-scale {step}` reads them",
            opened.interior.eye_height
        );
    }
    Ok(written)
}

fn house(args: &Args) -> anyhow::Result<()> {
    if args.size.is_some() || args.photos.is_some() {
        let text = "--size and --photos do not belong to `house`, which has no photos";
        return Err(Usage(text.to_owned()).into());
    }
    let default = HouseOptions::default();
    let options = HouseOptions {
        rooms: args.rooms.unwrap_or(default.rooms),
        triangles: args.triangles,
        seed: args.seed.unwrap_or(default.seed),
    };
    let bar = spinner("building the house");
    let house = house::house(&options).map_err(usage);
    let written = house.and_then(|house| {
        house::write(&house, &args.output)?;
        Ok(house)
    });
    bar.finish_and_clear();
    let house = written?;
    print(&format!(
        "{}: {} cells, {} portals, {} triangles\n",
        args.output.display(),
        house.interior.cells.len(),
        house.interior.portals.len(),
        house.model.mesh.triangles.len()
    ))
}

fn usage(error: DatasetError) -> anyhow::Error {
    match error {
        // What was typed, not what was found.
        DatasetError::UnknownName { .. } | DatasetError::Option { .. } => {
            Usage(error.to_string()).into()
        }
        error => anyhow::Error::new(error),
    }
}
