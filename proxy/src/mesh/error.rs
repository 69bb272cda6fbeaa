use std::path::PathBuf;

/// What is wrong with a mesh file.
#[derive(Debug, thiserror::Error)]
pub enum MeshFileError {
    /// It cannot be read.
    #[error("{path}: {error}", path = .0.display(), error = .1)]
    Io(PathBuf, std::io::Error),
    /// It cannot be written.
    #[error("{path}: cannot write: {error}", path = .0.display(), error = .1)]
    Write(PathBuf, std::io::Error),
    /// None of the formats known.
    #[error(
        "{path}: meshes are read from .glb, .gltf, .ply and .obj and written as .glb and .ply; \
         convert it, with Blender or MeshLab, say",
        path = .0.display()
    )]
    Extension(PathBuf),
    /// A format that has no looks.
    #[error(
        "{path}: textured models are read from .glb and .gltf; convert it, with Blender, say",
        path = .0.display()
    )]
    Looks(PathBuf),
    /// A line of a text file.
    #[error("{path}, line {line}: {problem}", path = .path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Its line, from 1.
        line: usize,
        /// What was found, and what to try.
        problem: String,
    },
    /// A record of a binary file, or a part of a glTF file.
    #[error("{path}, {record}: {problem}", path = .path.display())]
    Record {
        /// The file.
        path: PathBuf,
        /// The record, as the file numbers it, from 0.
        record: String,
        /// What was found, and what to try.
        problem: String,
    },
    /// The file as a whole.
    #[error("{path}: {problem}", path = .0.display(), problem = .1)]
    File(PathBuf, String),
    /// A file without a triangle.
    #[error(
        "{path}: {found} corners but no triangle; if it is a cloud of points, make a surface of \
         it first, or use the proxy `points`",
        path = .0.display(), found = .1
    )]
    NoTriangles(PathBuf, usize),
    /// A glTF file whose default scene has none.
    #[error(
        "{path}: its default scene has no triangle; if another of its scenes is meant, export that one, and \
         of lines or a cloud of points make a surface first",
        path = .0.display()
    )]
    EmptyScene(PathBuf),
    /// What cannot be written.
    #[error("{path}: {error}", path = .0.display(), error = .1)]
    Export(PathBuf, ExportError),
}

/// What cannot be written as GLB.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// Nothing to show.
    #[error("the mesh has no triangle: there is nothing to write")]
    Empty,
    /// A corner is NaN or infinite, or far beyond what f32 holds.
    #[error("corner {0} of the mesh is {1:?}: its file's numbers cannot hold that")]
    Position(usize, glam::DVec3),
    /// A camera's pose or focal length is not finite.
    #[error("the camera {0} has no finite pose and focal length; leave it out")]
    Camera(String),
    /// More than a GLB holds: at least so many bytes.
    #[error(
        "a GLB holds less than 4 GiB, and this mesh takes at least {0} bytes; simplify it, or write .ply"
    )]
    TooLarge(usize),
    /// The same of a model, which no other file holds.
    #[error(
        "a GLB holds less than 4 GiB, and this model takes at least {0} bytes; it must be of fewer triangles: \
         simplify the mesh that it is made of, in Blender or MeshLab, or ask for fewer"
    )]
    ModelTooLarge(usize),
    /// The extras are no JSON.
    #[error("the extras of a GLB must be JSON: {0}")]
    Extras(serde_json::Error),
    /// A texture could not be encoded.
    #[error("a texture cannot be encoded: {0}")]
    Picture(image::ImageError),
}
