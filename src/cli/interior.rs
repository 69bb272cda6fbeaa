//! `lumigraph interior`

use super::Usage;
use super::output::{print, say};
use anyhow::{Context, bail};
use proxy::interior::{
    Contents, Interior, interior_from_nodes, read_interior, read_rooms, write_interior,
};
use proxy::mesh::{MeshFileError, parse_model};
use std::path::{Path, PathBuf};

/// Make an interior of a model: cells joined by portals
///
/// Where its rooms and openings are is told by --rooms (boxes and outlines), or by the names of
/// the model's nodes: `cell:NAME` for a room and all below it, `portal:A|B` for the flat mesh of
/// an opening between two of them.
///
///     lumigraph interior house.glb --rooms rooms.json -o house
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    /// The model, textured: .glb
    model: PathBuf,
    /// Rooms and openings: {"version": 1, "rooms": [{"name", "min", "max"}], "openings":
    /// [{"name", "between": ["A", "B"], "polygon": [[x, y, z], …]}]}
    #[arg(long, value_name = "FILE")]
    rooms: Option<PathBuf>,
    /// The interior's folder: interior.json, and the model beside it
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    // A .glb is one file, and can be copied as it is.
    let is_glb = args
        .model
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("glb"));
    if !is_glb {
        let found = args.model.display();
        return Err(Usage(format!("{found}: interiors are made of .glb models")).into());
    }
    // The copy is of what was read.
    let unreadable = |e| MeshFileError::Io(args.model.clone(), e);
    let bytes = std::fs::read(&args.model).map_err(unreadable)?;
    let (model, warnings) = parse_model(&args.model, &bytes)?;
    for warning in warnings {
        say!("warning: {}: {warning}", args.model.display());
    }
    let file = args.model.file_name().unwrap_or_default().to_string_lossy();
    let named = || args.model.display().to_string();
    let (interior, warnings) = match &args.rooms {
        Some(rooms) => read_rooms(rooms, &file)?,
        None => interior_from_nodes(&model, &file).with_context(named)?,
    };
    let (contents, more) = Contents::new(&interior, &model).with_context(named)?;
    for warning in warnings.into_iter().chain(more) {
        say!("warning: {warning}");
    }
    write(args, &bytes, &interior)?;
    let mut table = String::new();
    for (cell, triangles) in interior.cells.iter().zip(&contents.triangles) {
        table += &format!("{:>9} triangles  {}\n", triangles.len(), cell.name);
    }
    print(&format!(
        "{table}{}: {} cells, {} portals, {} triangles\n",
        args.output.display(),
        interior.cells.len(),
        interior.portals.len(),
        model.mesh.triangles.len()
    ))
}

/// Fills a folder that takes its name only when it is complete. An interior that is there
/// already is replaced, if it is nothing else.
fn write(args: &Args, model: &[u8], interior: &Interior) -> anyhow::Result<()> {
    let folder = &args.output;
    let cannot = || format!("{}: cannot write", folder.display());
    if folder.exists() && !may_be_replaced(folder)? {
        bail!(
            "{}: the folder is not empty; choose another or remove it first",
            folder.display()
        );
    }
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let partial = folder.with_file_name(format!(".{name}.partial-{}", std::process::id()));
    let filled = || -> anyhow::Result<()> {
        std::fs::create_dir_all(&partial).with_context(cannot)?;
        let beside = partial.join(args.model.file_name().unwrap_or_default());
        std::fs::write(beside, model).with_context(cannot)?;
        write_interior(&partial.join(INTERIOR), interior)?;
        if folder.exists() {
            std::fs::remove_dir_all(folder).with_context(cannot)?;
        }
        std::fs::rename(&partial, folder).with_context(cannot)
    };
    let done = filled();
    if done.is_err() {
        // The first error is the one to tell.
        let _ = std::fs::remove_dir_all(&partial);
    }
    done
}

/// The interior's own file in its folder.
const INTERIOR: &str = "interior.json";

/// Opens an interior, its folder or its file, says what is odd, and where the file is.
pub(super) fn open(given: &Path) -> anyhow::Result<(PathBuf, Interior)> {
    let path = match given.is_dir() {
        true => given.join(INTERIOR),
        false => given.to_owned(),
    };
    let (interior, warnings) = read_interior(&path)?;
    for warning in warnings {
        say!("warning: {warning}");
    }
    Ok((path, interior))
}

/// Whether a folder is empty, or holds an interior and one model.
fn may_be_replaced(folder: &Path) -> anyhow::Result<bool> {
    let failed = || format!("{}: cannot read", folder.display());
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(failed)? {
        names.push(entry.with_context(failed)?.file_name());
    }
    let is_interior = names.iter().any(|name| name == INTERIOR);
    let is_ours = |name: &std::ffi::OsString| {
        name == INTERIOR || Path::new(name).extension().is_some_and(|e| e == "glb")
    };
    Ok(names.is_empty() || is_interior && names.len() <= 2 && names.iter().all(is_ours))
}
