//! Proxy files: JSON and PLY hold the surface exactly; GLB is for looking at it elsewhere, and
//! says in its `extras` what it shows. Meshes from elsewhere are proxies, too.

use crate::dense::DensePoints;
use crate::mesh::{self, MeshFileError};
use crate::{MeshKind, Plane, PlaneError, Proxy, Solid, SparsePoint, glb};
use calibrate::View;
use capture::without_byte_order_mark;
use glam::DVec3;
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What is wrong with a proxy file.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// It cannot be read.
    #[error("{path}: {error}", path = .0.display(), error = .1)]
    Io(PathBuf, std::io::Error),
    /// It cannot be written.
    #[error("{path}: cannot write: {error}", path = .0.display(), error = .1)]
    Write(PathBuf, std::io::Error),
    /// It is not the JSON that was expected.
    #[error("{path}: not a proxy file: {error}", path = .0.display(), error = .1)]
    Json(PathBuf, serde_json::Error),
    /// It is from a later version.
    #[error("{path}: proxy file version {found}; this program reads version 1", path = .0.display(), found = .1)]
    Version(PathBuf, u64),
    /// Its plane is not one.
    #[error("{path}: {error}", path = .0.display(), error = .1)]
    Plane(PathBuf, PlaneError),
    /// A GLB that this program did not write, or no GLB at all.
    #[error("{path}: {reason}", path = .0.display(), reason = .1)]
    Glb(PathBuf, String),
    /// Its mesh cannot be read or written.
    #[error(transparent)]
    Mesh(#[from] MeshFileError),
    /// Its points, of a kind, or the hull around it contradict themselves.
    #[error("{path}: {reason}; find the points anew with `lumigraph proxy … {kind}`", path = .0.display(), kind = .1, reason = .2)]
    Points(PathBuf, &'static str, String),
    /// JSON is no place for a mesh.
    #[error("{path}: a mesh is written as .ply (exact) or .glb", path = .0.display())]
    NoMesh(PathBuf),
    /// The same of one that is read.
    #[error(
        "{path}: its kind is a mesh's, and JSON holds none; give the .ply or .glb that `lumigraph proxy` wrote of it",
        path = .0.display()
    )]
    MeshInJson(PathBuf),
    /// PLY is for meshes.
    #[error("{path}: a plane is written as .json (exact) or .glb", path = .0.display())]
    NoPlane(PathBuf),
    /// What has no surface apart from a desired view cannot be looked at.
    #[error(
        "{path}: the {kind} proxy is made anew for every view and has no surface of its own \
         to show; write it as .json",
        path = .0.display(), kind = .1
    )]
    NoSurface(PathBuf, &'static str),
    /// None of the formats known.
    #[error(
        "{path}: proxies are read from .json, .glb, .gltf, .ply and .obj, and written as .json or \
         .ply (exact) or .glb",
        path = .0.display()
    )]
    Extension(PathBuf),
}

/// What there is of a proxy without a desired view, which says what files hold it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A plane: .json or .glb.
    Plane,
    /// A mesh: .ply or .glb.
    Mesh,
    /// Nothing, as it is made anew for every view: .json.
    PerView,
}

impl Form {
    /// Of a proxy.
    pub fn of(proxy: &Proxy) -> Self {
        match proxy {
            Proxy::Plane(_) => Self::Plane,
            Proxy::Mesh(_) => Self::Mesh,
            Proxy::ViewPlane | Proxy::Points { .. } | Proxy::Dense(_) => Self::PerView,
        }
    }

    /// The extension of a file that holds it exactly.
    pub fn exact_extension(self) -> &'static str {
        match self {
            Self::Mesh => "ply",
            Self::Plane | Self::PerView => "json",
        }
    }

    /// Whether [`write()`] writes a proxy of this form and kind to a file of that name: to be asked before a long
    /// fit.
    ///
    /// # Errors
    /// It does not; the message says what it writes.
    pub fn check(self, path: &Path, kind: &'static str) -> Result<(), FileError> {
        match (extension(path).as_str(), self) {
            ("json", Self::Mesh) => Err(FileError::NoMesh(path.to_owned())),
            ("ply", Self::Plane) => Err(FileError::NoPlane(path.to_owned())),
            ("glb" | "ply", Self::PerView) => Err(FileError::NoSurface(path.to_owned(), kind)),
            ("json" | "glb" | "ply", _) => Ok(()),
            _ => Err(FileError::Extension(path.to_owned())),
        }
    }
}

/// What is read first: of a later version nothing else need be readable.
#[derive(Deserialize)]
struct Head {
    version: Option<u64>,
    kind: Option<IgnoredAny>,
}

/// What the files say. Unknown keys are kept out of the way, not refused.
#[derive(Serialize, Deserialize)]
struct Stored {
    version: u32,
    #[serde(flatten)]
    surface: StoredSurface,
    /// Of a mesh: whether it hides what lies behind it, where it does not as its kind does.
    #[serde(skip_serializing_if = "Option::is_none")]
    occludes: Option<bool>,
    /// The closed mesh that bounds it, of points or a mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    within: Option<StoredMesh>,
}

#[derive(Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum StoredSurface {
    Plane {
        point: [f64; 3],
        normal: [f64; 3],
    },
    #[serde(rename = "view-plane")]
    ViewPlane,
    Points {},
    Dense {
        views: Vec<String>,
        points: Vec<[f64; 3]>,
        seen_by: Vec<Vec<u32>>,
    },
    // Of a GLB, whose geometry says the rest.
    Tunnel,
    Hull,
    Carved,
    #[serde(rename = "carved-dense")]
    CarvedDense,
    Depth,
    Mesh,
}

/// A closed mesh that bounds a proxy.
#[derive(Serialize, Deserialize)]
struct StoredMesh {
    positions: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl StoredMesh {
    fn of(solid: &Solid) -> Self {
        let mesh = solid.mesh();
        Self {
            positions: mesh.positions.iter().map(|p| p.to_array()).collect(),
            triangles: mesh.triangles.clone(),
        }
    }

    fn solid(self) -> Result<Arc<Solid>, String> {
        let count = self.positions.len();
        let missing = |t: &&[u32; 3]| t.iter().any(|&i| i as usize >= count);
        if let Some(triangle) = self.triangles.iter().find(missing) {
            return Err(format!(
                "the hull around it has {count} corners, and a triangle {triangle:?}"
            ));
        }
        hull_of(mesh::Mesh {
            positions: self.positions.into_iter().map(DVec3::from_array).collect(),
            triangles: self.triangles,
        })
    }
}

/// The closed mesh that bounds a proxy.
///
/// # Errors
/// It is not closed, or its outside is not where it should be.
fn hull_of(mesh: mesh::Mesh) -> Result<Arc<Solid>, String> {
    if let Some([from, to]) = mesh.open_edge() {
        return Err(format!(
            "the hull around it is not closed, or its triangles do not all go the same way round, at its edge from \
             {from} to {to}"
        ));
    }
    if !(mesh.volume() > 0.0) {
        return Err(
            "the hull around it encloses nothing; its triangles are to be counter-clockwise as seen from outside"
                .to_owned(),
        );
    }
    Ok(Arc::new(Solid::new(MeshKind::Hull, mesh)))
}

impl Stored {
    /// Of a file's JSON.
    fn parse(path: &Path, text: &[u8]) -> Result<Self, FileError> {
        let json = |e| FileError::Json(path.to_owned(), e);
        let Head { version, .. } = serde_json::from_slice(text).map_err(json)?;
        if let Some(found) = version.filter(|version| *version != 1) {
            return Err(FileError::Version(path.to_owned(), found));
        }
        serde_json::from_slice(text).map_err(json)
    }

    fn of(proxy: &Proxy) -> Self {
        let surface = match proxy {
            Proxy::Plane(plane) => StoredSurface::Plane {
                point: plane.point().to_array(),
                normal: plane.normal().to_array(),
            },
            Proxy::ViewPlane => StoredSurface::ViewPlane,
            Proxy::Points { .. } => StoredSurface::Points {},
            Proxy::Dense(dense) => {
                let points = dense.points.iter();
                StoredSurface::Dense {
                    views: dense.names.clone(),
                    points: points.clone().map(|p| p.position.to_array()).collect(),
                    seen_by: points.map(|p| p.seen_by.clone()).collect(),
                }
            }
            Proxy::Mesh(solid) => match solid.kind() {
                MeshKind::Tunnel => StoredSurface::Tunnel,
                MeshKind::Hull => StoredSurface::Hull,
                MeshKind::Carved => StoredSurface::Carved,
                MeshKind::CarvedDense => StoredSurface::CarvedDense,
                MeshKind::Depth => StoredSurface::Depth,
                MeshKind::Mesh => StoredSurface::Mesh,
            },
        };
        let transparent = matches!(proxy, Proxy::Mesh(solid) if hides_nothing(solid));
        Self {
            version: 1,
            surface,
            occludes: transparent.then_some(false),
            within: proxy.within().map(StoredMesh::of),
        }
    }

    /// The proxy, its geometry from `mesh` where the file has one.
    fn proxy(
        self,
        path: &Path,
        mesh: impl FnOnce() -> Result<mesh::Mesh, FileError>,
    ) -> Result<Proxy, FileError> {
        let within = self.within.map(StoredMesh::solid).transpose();
        let bad = |kind| move |reason| FileError::Points(path.to_owned(), kind, reason);
        let kind = match self.surface {
            StoredSurface::Plane { point, normal } => {
                within.map_err(bad("plane"))?;
                return Plane::new(DVec3::from_array(point), DVec3::from_array(normal))
                    .map(Proxy::Plane)
                    .map_err(|e| FileError::Plane(path.to_owned(), e));
            }
            StoredSurface::ViewPlane => {
                within.map_err(bad("view-plane"))?;
                return Ok(Proxy::ViewPlane);
            }
            StoredSurface::Points {} => {
                let within = within.map_err(bad("points"))?;
                return Ok(Proxy::Points { within });
            }
            StoredSurface::Dense {
                views,
                points,
                seen_by,
            } => {
                let within = within.map_err(bad("dense"))?;
                return dense(views, &points, seen_by, within).map_err(bad("dense"));
            }
            StoredSurface::Tunnel => MeshKind::Tunnel,
            StoredSurface::Hull => MeshKind::Hull,
            StoredSurface::Carved => MeshKind::Carved,
            StoredSurface::CarvedDense => MeshKind::CarvedDense,
            StoredSurface::Depth => MeshKind::Depth,
            StoredSurface::Mesh => MeshKind::Mesh,
        };
        let within = within.map_err(bad(kind.name()))?;
        Ok(solid(kind, mesh()?, self.occludes != Some(false), within))
    }
}

fn solid(kind: MeshKind, mesh: mesh::Mesh, occludes: bool, within: Option<Arc<Solid>>) -> Proxy {
    let mut solid = Solid::new(kind, mesh);
    solid.keep_within(within);
    if !occludes {
        solid.hide_nothing();
    }
    Proxy::Mesh(Arc::new(solid))
}

/// Whether a mesh could hide parts of itself, and is not to.
fn hides_nothing(solid: &Solid) -> bool {
    solid.kind().can_occlude_itself() && !solid.occludes()
}

fn dense(
    names: Vec<String>,
    points: &[[f64; 3]],
    seen_by: Vec<Vec<u32>>,
    within: Option<Arc<Solid>>,
) -> Result<Proxy, String> {
    if points.len() != seen_by.len() {
        let (points, seen) = (points.len(), seen_by.len());
        return Err(format!("{points} points, and who sees {seen} of them"));
    }
    if points.is_empty() {
        return Err("it has no points".to_owned());
    }
    if seen_by.iter().all(Vec::is_empty) {
        return Err(format!("no view sees any of its {} points", points.len()));
    }
    let mut named = BTreeSet::new();
    if let Some(name) = names.iter().find(|name| !named.insert(name.as_str())) {
        return Err(format!("it names the view {name} twice"));
    }
    let point = |(i, (position, seen_by)): (usize, (&[f64; 3], Vec<u32>))| {
        if let Some(view) = seen_by.iter().find(|&&view| view as usize >= names.len()) {
            let views = names.len();
            return Err(format!("point {i} is seen by view {view} of {views}"));
        }
        let mut seen = BTreeSet::new();
        if let Some(view) = seen_by.iter().find(|view| !seen.insert(**view)) {
            return Err(format!("point {i} is seen by view {view} twice"));
        }
        let position = DVec3::from_array(*position);
        Ok(SparsePoint { position, seen_by })
    };
    let points = points.iter().zip(seen_by).enumerate().map(point);
    let points = points.collect::<Result<_, String>>()?;
    Ok(Proxy::Dense(Arc::new(DensePoints {
        names,
        points,
        within,
    })))
}

/// Reads a proxy that [`write()`] wrote, or a mesh from elsewhere: .glb, .gltf, .ply or .obj.
///
/// # Errors
/// The file, and what is wrong with it.
pub fn read(path: &Path) -> Result<Proxy, FileError> {
    if !["json", "glb", "gltf", "ply", "obj"].contains(&extension(path).as_str()) {
        return Err(FileError::Extension(path.to_owned()));
    }
    let bytes = std::fs::read(path).map_err(|e| FileError::Io(path.to_owned(), e))?;
    parse(path, &bytes)
}

/// Reads the content of a file by its name's extension.
///
/// # Errors
/// As for [`read()`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Proxy, FileError> {
    let mesh = || Ok(mesh::parse(path, bytes)?);
    match extension(path).as_str() {
        "json" => {
            let stored = Stored::parse(path, without_byte_order_mark(bytes))?;
            stored.proxy(path, || Err(FileError::MeshInJson(path.to_owned())))
        }
        "glb" => {
            let extras = glb::extras(bytes).map_err(|e| FileError::Glb(path.to_owned(), e))?;
            // Extras of somebody else's are none of ours.
            let is_ours = |text: &String| {
                let head = serde_json::from_str::<Head>(text);
                head.is_ok_and(|head| head.version.is_some() && head.kind.is_some())
            };
            match extras.filter(is_ours) {
                Some(text) => Stored::parse(path, text.as_bytes())?.proxy(path, mesh),
                None => Ok(solid(MeshKind::Mesh, mesh()?, true, None)),
            }
        }
        "ply" => {
            let (kind, occludes) = kind_of_ply(bytes);
            // Both, before either is made ready for rays.
            let (own, hull) = (mesh()?, mesh::ply_hull(path, bytes)?);
            let bad = |reason| FileError::Points(path.to_owned(), kind.name(), reason);
            let hull = hull.map(hull_of).transpose().map_err(bad)?;
            Ok(solid(kind, own, occludes, hull))
        }
        "gltf" | "obj" => Ok(solid(MeshKind::Mesh, mesh()?, true, None)),
        _ => Err(FileError::Extension(path.to_owned())),
    }
}

/// What the comment in a PLY's header says of its kind, before it.
const KIND_COMMENT: &str = "lumigraph proxy ";
/// And after it, where a mesh is taken to hide nothing.
const HIDES_NOTHING: &str = " without occlusion";

/// Its kind, and whether it hides what lies behind it.
fn kind_of_ply(bytes: &[u8]) -> (MeshKind, bool) {
    // Within the first few lines, or nowhere.
    let header = String::from_utf8_lossy(&bytes[..bytes.len().min(256)]);
    let mut lines = capture::lines(&header);
    let name = lines.find_map(|line| line.strip_prefix("comment ")?.strip_prefix(KIND_COMMENT));
    let Some(name) = name else {
        return (MeshKind::Mesh, true);
    };
    let (name, occludes) = match name.strip_suffix(HIDES_NOTHING) {
        Some(name) => (name, false),
        None => (name, true),
    };
    let kind = MeshKind::ALL.into_iter().find(|k| k.name() == name);
    (kind.unwrap_or(MeshKind::Mesh), occludes)
}

/// Writes a proxy as `.json`, a mesh as `.ply`, or what can be shown as `.glb`, with cameras.
/// A GLB shows an infinite plane only around `shown_points_in_world` (the sparse points, say).
///
/// The file appears complete or not at all.
///
/// # Errors
/// The file, and what is wrong with it.
pub fn write(
    path: &Path,
    proxy: &Proxy,
    shown_points_in_world: &[DVec3],
    cameras: &[(String, View)],
) -> Result<(), FileError> {
    Form::of(proxy).check(path, proxy.kind())?;
    let json = |e| FileError::Json(path.to_owned(), e);
    let glb = |shown: &mesh::Mesh| {
        let extras = serde_json::to_string(&Stored::of(proxy)).map_err(json)?;
        mesh::to_glb(shown, cameras, Some(extras))
            .map_err(|e| FileError::Glb(path.to_owned(), e.to_string()))
    };
    let bytes = match (extension(path).as_str(), proxy) {
        ("glb", Proxy::Plane(plane)) => glb(&glb::quad(plane, shown_points_in_world))?,
        ("glb", Proxy::Mesh(solid)) => glb(solid.mesh())?,
        (_, Proxy::Mesh(solid)) => {
            let kind = solid.kind().name();
            let how = if hides_nothing(solid) {
                HIDES_NOTHING
            } else {
                ""
            };
            let comment = format!("{KIND_COMMENT}{kind}{how}");
            mesh::to_ply(solid.mesh(), solid.within().map(Solid::mesh), &comment)
        }
        (_, Proxy::Dense(_) | Proxy::Points { within: Some(_) }) => {
            serde_json::to_vec(&Stored::of(proxy)).map_err(json)?
        }
        _ => {
            let text = serde_json::to_string_pretty(&Stored::of(proxy)).map_err(json)?;
            (text + "\n").into_bytes()
        }
    };
    write_whole(path, &bytes).map_err(|e| FileError::Write(path.to_owned(), e))
}

/// Writes a file that appears complete or not at all.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    capture::write_whole(path, |temporary| std::fs::write(temporary, bytes))
}

/// In lower case.
pub(crate) fn extension(path: &Path) -> String {
    path.extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase()
}

#[cfg(test)]
mod tests;
