//! LDIs that are kept as files: how they are called, and which of them there are.

use super::{Library, PortalLdi};
use crate::RenderError;
use crate::interior::neighbourhood;
use crate::ldi::{LdiFileError, read_before};
use proxy::interior::Interior;
use std::fs::Metadata;
use std::io::ErrorKind;
use std::path::Path;
use std::time::SystemTime;

/// Longer names of portals and cells are cut off there.
const LONGEST: usize = 32;

impl Library {
    /// The places of all LDIs that frames may show: those of each side from which one can look
    /// into another cell, from left to right.
    pub fn ldi_places(&self) -> Vec<usize> {
        let count = self.options.ldi_views.unwrap_or(usize::MAX);
        let sides = self.sides.iter();
        let sides = sides.filter(|side| self.places[side.start].from.is_some());
        sides
            .flat_map(|side| neighbourhood::places(side, count))
            .collect()
    }

    /// How the file of a place's LDI is called: by the portal's number, the side (`a` is that of the first of
    /// its two cells), the names of the portal and of the cell beyond, and where a side has several, the
    /// number of the place.
    pub fn file_name(&self, place: usize, interior: &Interior) -> String {
        let view = &self.places[place];
        let portal = interior.portal(view.portal);
        let side = match view.from == portal.cells[0] {
            true => 'a',
            false => 'b',
        };
        let names = [&portal.name, &interior.cell(view.into).name].map(|name| plain(name));
        let names = names.join("-");
        let number = self.options.ldi_views.map_or_else(String::new, |_| {
            format!("-{:02}", place - self.side_of(place).start)
        });
        format!("{:03}{side}-{names}{number}.ldi", view.portal.0)
    }

    /// From now on LDIs that have a file in this folder are read, not made. Which there are is looked up here,
    /// once; they must be those that would be made. What is written there later is of no use.
    pub fn use_files(&mut self, folder: &Path, interior: &Interior) {
        for place in self.ldi_places() {
            let file = folder.join(self.file_name(place, interior));
            self.files[place] = written(&file).map(|when| (file, when));
        }
    }

    /// The LDI of a place out of its file; nothing where there is none, or not the same any more.
    ///
    /// # Errors
    /// A file that cannot be read, or holds something else.
    pub fn read(&self, place: usize) -> Result<Option<PortalLdi>, RenderError> {
        let Some((file, when)) = &self.files[place] else {
            return Ok(None);
        };
        if written(file) != Some(*when) {
            return Ok(None);
        }
        let center = neighbourhood::middle(&self.side_of(place));
        match read_before(file, &self.places[center]) {
            Ok(ldi) => Ok(Some(PortalLdi::new(ldi))),
            Err(LdiFileError::Io { source, .. }) if source.kind() == ErrorKind::NotFound => {
                Ok(None)
            }
            Err(error) => Err(RenderError::LdiFile(error.to_string())),
        }
    }
}

/// When a file was written; nothing where there is none.
fn written(file: &Path) -> Option<SystemTime> {
    let found = file.metadata().ok().filter(Metadata::is_file)?;
    found.modified().ok()
}

/// A name as every file system takes it.
fn plain(name: &str) -> String {
    let letter = |c: char| match c {
        'a'..='z' | 'A'..='Z' | '0'..='9' | '-' | '_' => c,
        _ => '_',
    };
    name.chars().take(LONGEST).map(letter).collect()
}
