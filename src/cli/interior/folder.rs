//! The folder that an interior lies in: found, opened, and kept clear of what is none of it.

use super::super::made;
use super::super::output::say;
use super::super::targets::holder;
use super::warnings::said;
use anyhow::{Context, bail};
use calibrate::colmap;
use capture::as_argument;
use lumigraph::scene::Scene;
use proxy::interior::{Interior, InteriorFileError, read_interior};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// To check found rooms by.
pub(super) const PLAN_SVG: &str = "floor-plan.svg";
pub(super) const PLAN_PNG: &str = "floor-plan.png";
/// The interior's own file in its folder.
pub(in crate::cli) const INTERIOR: &str = "interior.json";

/// How to come by an interior, for who gave something else.
const REMEDY: &str = "`lumigraph interior CAPTURE_OR_GLB -o DIR` makes one";

/// Opens an interior, its folder or its file, says what is odd, and where the file is.
pub(in crate::cli) fn open(given: &Path) -> anyhow::Result<(PathBuf, Interior)> {
    check_there(given)?;
    let path = file_of(given);
    if !path.exists() {
        bail!(
            "{}: no interior, as it holds no {INTERIOR}; {REMEDY}",
            given.display()
        );
    }
    // Of a file of that name it says where the slip is.
    let is_named = path.file_name().is_some_and(|name| name == INTERIOR);
    let (interior, warnings) = match read_interior(&path) {
        Err(error @ InteriorFileError::Json(..)) if !is_named => bail!("{error}; {REMEDY}"),
        read => read?,
    };
    for warning in said(&warnings) {
        say!("warning: {warning}");
    }
    Ok((path, interior))
}

/// The file of an interior that is given by its folder or its file.
fn file_of(given: &Path) -> PathBuf {
    match given.is_dir() {
        true => given.join(INTERIOR),
        false => given.to_owned(),
    }
}

/// Whether an interior, given by its folder or its file, can be read and has no photos to be drawn from.
pub(in crate::cli) fn is_without_photos(given: &Path) -> bool {
    let read = read_interior(&file_of(given));
    read.is_ok_and(|(interior, _)| interior.cells.iter().all(|c| c.content.scene().is_none()))
}

/// Fails where there is nothing at a path.
pub(in crate::cli) fn check_there(given: &Path) -> anyhow::Result<()> {
    if !given.exists() {
        bail!(
            "{}: there is no such file or folder; check the path",
            given.display()
        );
    }
    Ok(())
}

/// Fails where photos are expected, and an interior is given: its folder, unless that holds photos
/// or a scene as well, or its file.
pub(in crate::cli) fn check_no_interior(given: &Path) -> anyhow::Result<()> {
    let is_file = given.is_file() && given.file_name().is_some_and(|name| name == INTERIOR);
    let holds_photos = || {
        let is_capture = given.join("images").is_dir() || colmap::find_model(given).is_ok();
        is_capture || Scene::is_scene(given)
    };
    if is_file || (given.join(INTERIOR).is_file() && !holds_photos()) {
        let argument = as_argument(given);
        let given = given.display();
        bail!(
            "{given}: this is an interior, not photos; `lumigraph walk {argument} -o FRAMES` is for it"
        );
    }
    Ok(())
}

/// Fails where a folder for something else holds an interior, which could not be replaced beside that.
pub(in crate::cli) fn check_holds_none(folder: &Path) -> anyhow::Result<()> {
    if folder.join(INTERIOR).is_file() {
        bail!(
            "{}: this folder holds an interior, and what else lies there keeps it from being replaced; choose \
             another -o",
            folder.display()
        );
    }
    Ok(())
}

/// Fails where something else, a file or a folder of files, is to be written into the folder of an interior that
/// could be replaced, however far below: it could not be any more. The option names it.
pub(in crate::cli) fn check_outside(path: &Path, option: &str) -> anyhow::Result<()> {
    if let Some(holder) = holder(path, is_ours) {
        bail!(
            "{}: {} holds an interior, and what else lies there keeps it from being replaced; choose another {option}",
            path.display(),
            holder.display()
        );
    }
    Ok(())
}

/// Whether an interior is given to what opens others, too: a folder that holds one, or its file.
pub(in crate::cli) fn is_interior(given: &Path) -> bool {
    given.join(INTERIOR).is_file() || given.file_name().is_some_and(|name| name == INTERIOR)
}

/// Whether a folder holds an interior and nothing else.
pub(super) fn is_ours(folder: &Path) -> bool {
    folder.join(INTERIOR).exists() && matches!(beside_interior(folder), Ok(None))
}

/// What a folder holds besides an interior, one model and perhaps a floor plan, LDIs and what `generate` says of its
/// house: the first thing by name, for people.
pub(super) fn beside_interior(folder: &Path) -> anyhow::Result<Option<String>> {
    let entries = std::fs::read_dir(folder)
        .and_then(|entries| entries.map(|e| e.map(|e| e.file_name())).collect());
    let mut names: Vec<OsString> =
        entries.with_context(|| format!("{}: cannot read", folder.display()))?;
    names.sort();
    let is_known = |name: &OsString, path: &Path| {
        let is_own = name == INTERIOR || name == PLAN_SVG || name == PLAN_PNG;
        is_own || (name == README && is_generated(path))
    };
    let mut models = Vec::new();
    for name in &names {
        let (path, shown) = (folder.join(name), name.to_string_lossy());
        if name == made::FOLDER {
            if let Some(other) = made::beside_ldis(&path) {
                let other = other.strip_prefix(folder).unwrap_or(&other);
                return Ok(Some(other.display().to_string()));
            }
        } else if path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("glb"))
        {
            models.push(shown);
        } else if !is_known(name, &path) {
            return Ok(Some(shown.into_owned()));
        }
    }
    Ok((models.len() > 1).then(|| format!("{} models ({})", models.len(), models.join(", "))))
}

/// What `generate house` says of itself.
const README: &str = "README.md";
const README_BEGINS: &str = "# house\n\n- Source: `lumigraph generate house`, a procedural house.";
const README_LINES: usize = 5;

/// Whether a file is what `generate house` wrote, and nobody has added to it.
fn is_generated(file: &Path) -> bool {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    text.starts_with(README_BEGINS) && text.lines().count() == README_LINES
}
