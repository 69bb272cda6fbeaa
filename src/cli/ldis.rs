//! `lumigraph ldis`

use super::captured::Opened;
use super::made::{FOLDER, Made, folder_of};
use super::notes::Notes;
use super::output::{print, print_json, say};
use super::references::{ReferenceArgs, before_ldis};
use super::session::progress;
use super::stamp::in_unicode;
use anyhow::Context;
use render::RenderError;
use render::interior::{Painter, Walk, WalkOptions};
use render::ldi::{fault, write};
use serde::{Serialize, Serializer};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Make an interior's layered depth images as files, so that walks need not
///
/// They lie in the interior's folder, in ldi/: one for each side of each portal, several with
/// --ldi-views. `walk` and `view` read those that were made with the same options, of files as
/// they are now, and make the rest; the pictures are the same. Run again, it makes what is
/// missing; after a change, all of them. One run at a time may be at work on an interior.
///
///     lumigraph ldis house
///     lumigraph ldis house --ldi-views 3
///     lumigraph walk house --portals ldi -o walk
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    /// The interior: a folder with interior.json, or that file
    interior: PathBuf,
    #[command(flatten)]
    references: ReferenceArgs,
    /// Print what was made as JSON
    #[arg(long)]
    json: bool,
}

/// What was made.
#[derive(Serialize)]
struct Report {
    #[serde(serialize_with = "as_unicode")]
    folder: PathBuf,
    /// All that there are now, and their size.
    files: usize,
    bytes: u64,
    /// By this run.
    made: usize,
    /// Sides, or places before them, whose images make none.
    none: usize,
    seconds: f64,
    device: String,
}

fn as_unicode<S: Serializer>(path: &Path, to: S) -> Result<S::Ok, S::Error> {
    in_unicode(path).serialize(to)
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let references = &args.references;
    references.check()?;
    let start = Instant::now();
    // 1. What there is.
    let exposure = (!references.no_photos).then_some(&references.exposure);
    let mut opened = Opened::new(&args.interior, exposure, |text| say!("warning: {text}"))?;
    let files = opened.files();
    let mut painter = match &opened.photos {
        Some(photos) => {
            say!("exposure: {}", photos.exposure.text());
            opened.painter(references.device(), references.cpu_memory)?
        }
        // Images of a model are the CPU's.
        None => Painter::cpu(),
    };
    let options = WalkOptions {
        library: references.options(opened.photos.is_some()),
        ..WalkOptions::default()
    };
    references.say_unused_views(&options.library, &painter);
    // 2. What was made before.
    let photos = opened.photos.as_ref();
    let made = Made::new(&opened.file, &files, &options.library, &painter, photos)?;
    let folder = folder_of(&opened.file).join(FOLDER);
    let _held = made.begin(&folder, |text| say!("note: {text}"))?;
    // 3. What is missing.
    let mut notes = Notes::default();
    let note = before_ldis(&options.library, &mut painter);
    notes.say_new(&painter);
    if let Some(note) = note {
        notes.say(note);
    }
    let (interior, contents, model) = (&opened.interior, &opened.contents, &opened.model);
    let mut walk = Walk::with(painter, interior, contents, model, options);
    let mut report = make(&mut walk, &opened, folder, &mut notes)?;
    report.seconds = start.elapsed().as_secs_f64();
    if args.json {
        return print_json(&report);
    }
    print(&text(&report))
}

/// Makes what a folder has no file of, or one that cannot be read, and says what there is to say after each.
fn make(
    walk: &mut Walk<'_>,
    opened: &Opened,
    folder: PathBuf,
    notes: &mut Notes,
) -> anyhow::Result<Report> {
    walk.use_ldi_files(&folder);
    let mut report = Report {
        files: 0,
        bytes: 0,
        made: 0,
        none: 0,
        seconds: 0.0,
        device: walk.painter().description(),
        folder,
    };
    let places = walk.library().ldi_places();
    let bar = progress(places.len(), "LDIs");
    for place in places {
        let name = walk.library().file_name(place, &opened.interior);
        let file = report.folder.join(name);
        let is_there = match walk.library().read(place) {
            Ok(found) => found.is_some(),
            Err(RenderError::LdiFile(why)) => {
                // What is asked for is done.
                say!("note: {}; it is made again", fault(&why));
                false
            }
            Err(error) => return Err(error.into()),
        };
        let is_there = is_there || write_one(walk, place, &file, &mut report)?;
        bar.suspend(|| notes.say_new(walk.painter()));
        match is_there {
            true => {
                let found = std::fs::metadata(&file);
                let found = found.with_context(|| file.display().to_string())?;
                report.bytes += found.len();
                report.files += 1;
            }
            false => report.none += 1,
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(report)
}

/// Makes the LDI of a place, and writes it, if its images make one.
fn write_one(
    walk: &mut Walk<'_>,
    place: usize,
    file: &Path,
    report: &mut Report,
) -> anyhow::Result<bool> {
    let made = walk.make_ldi(place)?;
    let Some(portal) = &*made else {
        return Ok(false);
    };
    write(file, &portal.ldi)?;
    report.made += 1;
    Ok(true)
}

fn text(report: &Report) -> String {
    let before = match report.files - report.made {
        0 => String::new(),
        before => format!(", {before} of them from before"),
    };
    format!(
        "{}: {} LDIs{before}, {:.1} MB, {:.1} s\n",
        report.folder.display(),
        report.files,
        report.bytes as f64 / 1e6,
        report.seconds
    )
}
