//! Mesh files by their extension.

use super::{Coarse, ExportError, Mesh, MeshFileError, Model, gltf, obj, ply, to_glb, to_ply};
use calibrate::View;
use std::path::{Path, PathBuf};

/// Reads a mesh from a .glb, .gltf, .ply or .obj file. Its coordinates are taken as the file
/// states them, whatever way it calls up; see [`Mesh::transform`].
///
/// # Errors
/// The file, the line or record, and what is wrong there.
pub fn read(path: &Path) -> Result<Mesh, MeshFileError> {
    if !["glb", "gltf", "ply", "obj"].contains(&extension(path).as_str()) {
        return Err(MeshFileError::Extension(path.to_owned()));
    }
    let bytes = std::fs::read(path).map_err(|e| MeshFileError::Io(path.to_owned(), e))?;
    parse(path, &bytes)
}

/// Reads the content of a file by its name's extension; other files are opened only where a
/// glTF file keeps its numbers in them.
///
/// # Errors
/// As for [`read()`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Mesh, MeshFileError> {
    let mesh = match extension(path).as_str() {
        "glb" | "gltf" => return gltf::parse(path, bytes),
        "ply" => ply::parse(path, bytes)?,
        "obj" => obj::parse(path, bytes)?,
        _ => return Err(MeshFileError::Extension(path.to_owned())),
    };
    if mesh.triangles.is_empty() {
        return Err(MeshFileError::NoTriangles(
            path.to_owned(),
            mesh.positions.len(),
        ));
    }
    Ok(mesh)
}

/// Reads a .glb or .gltf file with its looks: textures, colours and the names of its nodes. What
/// could not be had of the looks, and is a plain colour now, is told beside the model; so is what is
/// drawn opaque and is not, and what is left out, as alpha makes it invisible.
///
/// # Errors
/// As for [`read()`]; pictures that take more memory than they may.
pub fn read_model(path: &Path) -> Result<(Model, Vec<String>), MeshFileError> {
    if !["glb", "gltf"].contains(&extension(path).as_str()) {
        return Err(MeshFileError::Looks(path.to_owned()));
    }
    let bytes = std::fs::read(path).map_err(|e| MeshFileError::Io(path.to_owned(), e))?;
    parse_model(path, &bytes)
}

/// Reads the content of a .glb or .gltf file as [`read_model`] does.
///
/// # Errors
/// As for [`read_model`].
pub fn parse_model(path: &Path, bytes: &[u8]) -> Result<(Model, Vec<String>), MeshFileError> {
    let (model, mut warnings) = gltf::parse_model(path, bytes)?;
    let coarse = Coarse::of(&model.mesh);
    warnings.extend(coarse.map(|coarse| format!("{coarse}, with that as a node's translation")));
    Ok((model, warnings))
}

/// The files beside a .glb or .gltf file that it has buffers and pictures in, by their paths, whether or not
/// they are there; none of other files. What lies elsewhere is not read, and not among them.
///
/// # Errors
/// The file cannot be read, or is no glTF file.
pub fn files_beside(path: &Path) -> Result<Vec<PathBuf>, MeshFileError> {
    match extension(path).as_str() {
        "glb" | "gltf" => gltf::files_beside(path),
        _ => Ok(Vec::new()),
    }
}

/// Writes a mesh as .glb, for looking at, with cameras and extras, or as .ply, which keeps
/// every digit and has neither. The file appears complete or not at all.
///
/// # Errors
/// Another extension; what a GLB cannot hold; the file system's.
pub fn write(
    path: &Path,
    mesh: &Mesh,
    cameras: &[(String, View)],
    extras: Option<String>,
) -> Result<(), MeshFileError> {
    let failed = |e: ExportError| MeshFileError::Export(path.to_owned(), e);
    let bytes = match extension(path).as_str() {
        "glb" => to_glb(mesh, cameras, extras).map_err(failed)?,
        "ply" => to_ply(mesh, None, "written by lumigraph"),
        _ => return Err(MeshFileError::Extension(path.to_owned())),
    };
    crate::file::write_whole(path, &bytes).map_err(|e| MeshFileError::Write(path.to_owned(), e))
}

use crate::file::extension;
