//! `lumigraph interior`

use super::Usage;
use super::output::{print, say};
use anyhow::Context;
use datasets::in_new_folder;
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

/// Writes the model and what was made of it. An interior that is there already is replaced, if it
/// is nothing else.
fn write(args: &Args, model: &[u8], interior: &Interior) -> anyhow::Result<()> {
    in_new_folder(&args.output, is_ours, |folder| {
        let beside = folder.join(args.model.file_name().unwrap_or_default());
        std::fs::write(&beside, model)
            .with_context(|| format!("{}: cannot write", beside.display()))?;
        Ok(write_interior(&folder.join(INTERIOR), interior)?)
    })
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

/// Whether a folder holds an interior and one model, and nothing else.
fn is_ours(folder: &Path) -> bool {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return false;
    };
    let names: Vec<_> = entries.map(|e| e.map(|e| e.file_name())).collect();
    let is_interior = |name: &std::ffi::OsString| name == INTERIOR;
    let is_model = |name: &std::ffi::OsString| Path::new(name).extension() == Some("glb".as_ref());
    let has_interior = names.iter().flatten().any(is_interior);
    let is_known = |name: &std::ffi::OsString| is_interior(name) || is_model(name);
    has_interior && names.len() <= 2 && names.iter().all(|n| n.as_ref().is_ok_and(is_known))
}
