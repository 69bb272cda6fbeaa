//! Rooms and openings that the command line names files of.

use super::super::Usage;
use super::{Args, MODEL, open};
use anyhow::Context;
use proxy::interior::{GivenRooms, Interior, InteriorFileError, read_rooms};
use std::io::ErrorKind;
use std::path::Path;

/// What there is to read before any work.
pub(super) struct Told {
    /// The rooms that are asked for (`--rooms`); without them they are found, or named by nodes.
    pub(super) rooms: Option<GivenRooms>,
    /// Those to compare with (`--compare`).
    pub(super) known: Option<Interior>,
}

impl Told {
    /// Reads what the command line names.
    ///
    /// # Errors
    /// A file cannot be read, or holds something else.
    pub(super) fn read(args: &Args) -> anyhow::Result<Self> {
        let model = model_name(args);
        let rooms = args.rooms.as_ref().map(|file| {
            let expected =
                "expected a file of rooms and openings: `lumigraph interior --help` has its form";
            rooms_of("--rooms", file, &model, args.meter, expected)
        });
        let known = args.compare.as_ref().map(|given| match given.is_dir() {
            true => anyhow::Ok(open(given).context("--compare")?.1),
            false => {
                let expected = "expected such a file as --rooms has, or an interior's folder";
                Ok(rooms_of("--compare", given, &model, args.meter, expected)?.interior)
            }
        });
        Ok(Self {
            rooms: rooms.transpose()?,
            known: known.transpose()?,
        })
    }
}

/// What the model beside the interior will be called.
pub(super) fn model_name(args: &Args) -> String {
    if args.model.is_dir() {
        return MODEL.to_owned();
    }
    let file = args.model.file_name().unwrap_or_default();
    file.to_string_lossy().into_owned()
}

/// Reads the file that an option names.
fn rooms_of(
    option: &str,
    file: &Path,
    model: &str,
    meter: f64,
    expected: &str,
) -> anyhow::Result<GivenRooms> {
    read_rooms(file, model, meter).map_err(|error| match error {
        InteriorFileError::Io(file, error) => {
            let found = match error.kind() {
                ErrorKind::NotFound => "there is no such file".to_owned(),
                _ => format!("cannot read it: {error}"),
            };
            Usage(format!("{option} {}: {found}; {expected}", file.display())).into()
        }
        error => error.into(),
    })
}
