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
            stored.proxy(path, || Err(FileError::NoMesh(path.to_owned())))
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
mod tests {
    use super::*;

    #[test]
    fn both_formats_give_back_every_digit() {
        let folder = tempfile::tempdir().unwrap();
        let point = DVec3::new(500_000.123_456_789_1, 5.4e6 + 0.1, 1.0 / 3.0);
        let plane = Plane::new(point, DVec3::new(0.1, -0.7, 0.3)).unwrap();
        let shown = [
            point + DVec3::new(2.0, 1.0, 0.0),
            point - DVec3::new(1.0, 0.0, 3.0),
        ];
        for name in ["p.json", "p.glb"] {
            let path = folder.path().join(name);
            write(&path, &Proxy::Plane(plane), &shown, &[]).unwrap();
            let back = read(&path).unwrap().plane().unwrap();
            assert_eq!(back.point(), plane.point());
            assert!((back.normal() - plane.normal()).length() < 1e-15);
        }
        assert_eq!(
            std::fs::read_dir(folder.path()).unwrap().count(),
            2,
            "nothing left behind"
        );
    }

    #[test]
    fn what_editors_put_before_text_is_passed_over() {
        let text = "\u{feff}{\"version\": 1, \"kind\": \"view-plane\"}";
        let read = parse(Path::new("p.json"), text.as_bytes()).unwrap();
        assert_eq!(read, Proxy::ViewPlane);
    }

    #[test]
    fn later_versions_are_told_whatever_else_they_say() {
        let triangle = mesh::Mesh {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            triangles: vec![[0, 1, 2]],
        };
        let glb = |extras: &str| {
            let bytes = mesh::to_glb(&triangle, &[], Some(extras.to_owned())).unwrap();
            parse(Path::new("p.glb"), &bytes)
        };
        for later in [
            r#"{"version": 2, "kind": "later"}"#,
            r#"{"version": 2, "kind": {"of": "plane"}}"#,
            r#"{"version": 2, "kind": "points", "within": [1]}"#,
        ] {
            let said = "proxy file version 2; this program reads version 1";
            let error = parse(Path::new("p.json"), later.as_bytes()).unwrap_err();
            assert_eq!(error.to_string(), format!("p.json: {said}"));
            let error = glb(later).unwrap_err();
            assert_eq!(error.to_string(), format!("p.glb: {said}"));
        }
        // Of a plane that cannot be read the square that only stands for it is no proxy.
        let error = glb(r#"{"version": 1, "kind": "plane", "point": [0, 0, 0]}"#).unwrap_err();
        let said = "p.glb: not a proxy file: missing field `normal`";
        assert!(error.to_string().starts_with(said), "{error}");
        for others in [
            r#"{"version": "2", "kind": "plane"}"#,
            r#"{"version": 2}"#,
            "7",
        ] {
            assert_eq!(glb(others).unwrap().kind(), "mesh", "{others}");
        }
    }

    #[test]
    fn writing_touches_no_other_file() {
        let folder = tempfile::tempdir().unwrap();
        let (others, own) = (
            folder.path().join("room.tmp"),
            folder.path().join("room.json"),
        );
        std::fs::write(&others, "mine").unwrap();
        write(&own, &Proxy::ViewPlane, &[], &[]).unwrap();
        // Where a folder has its name, a file cannot take its place.
        let taken = folder.path().join("taken.json");
        std::fs::create_dir(&taken).unwrap();
        let error = write(&taken, &Proxy::ViewPlane, &[], &[]).unwrap_err();
        let said = "taken.json: cannot write: ";
        assert!(error.to_string().contains(said), "{error}");
        assert_eq!(std::fs::read_to_string(&others).unwrap(), "mine");
        assert!(own.is_file());
        let left = std::fs::read_dir(folder.path()).unwrap();
        assert_eq!(left.count(), 3, "nothing left behind");
    }

    #[test]
    fn bad_files_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let message = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            let error = read(&path).unwrap_err().to_string();
            error.replace(&folder.path().display().to_string(), "DIR")
        };
        assert_eq!(
            message(
                "a.json",
                r#"{"version": 2, "kind": "plane", "point": [0,0,0], "normal": [0,0,1]}"#
            ),
            "DIR/a.json: proxy file version 2; this program reads version 1"
        );
        assert_eq!(
            message(
                "a.json",
                r#"{"version": 1, "kind": "plane", "point": [0,0,0], "normal": [0,0,0]}"#
            ),
            "DIR/a.json: the plane's normal is zero; give a direction such as 0,0,1"
        );
        assert!(message("a.json", "{").starts_with("DIR/a.json: not a proxy file: "));
        assert!(message("a.glb", "x").starts_with("DIR/a.glb: "));
        // Found by fuzzing: gltf takes the header's length off what the header says.
        assert_eq!(
            message("a.glb", "glTF\x02\0\0\0\x0b\0\0\0"),
            "DIR/a.glb: not a glTF file: its header states a length without itself"
        );
        // And so was this: gltf's checks look up an accessor that is not there.
        let nothing = r#"{"asset": {"version": "2.0"},
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]}"#;
        let error = message("a.glb", nothing);
        assert!(error.starts_with("DIR/a.glb"), "{error}");
        assert_eq!(
            message("a.stl", ""),
            "DIR/a.stl: proxies are read from .json, .glb, .gltf, .ply and .obj, and written as \
             .json or .ply (exact) or .glb"
        );
    }

    #[test]
    fn every_kind_comes_back_from_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let corner = |x: f64, y: f64| DVec3::new(5e5 + x / 3.0, 5e6 - y / 7.0, 0.1 * x * y);
        let mesh = mesh::Mesh {
            positions: vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0)],
            triangles: vec![[0, 1, 2]],
        };
        let dense = DensePoints {
            names: vec!["a b.jpg".to_owned(), "ü.jpg".to_owned()],
            points: vec![SparsePoint {
                position: corner(1.0, 2.0),
                seen_by: vec![0, 1],
            }],
            within: None,
        };
        let mut larger = mesh.clone();
        larger.positions.push(corner(0.5, 3.0));
        larger.triangles = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
        let hull = Arc::new(Solid::new(MeshKind::Hull, larger));
        let within = Some(Arc::clone(&hull));
        let bounded = DensePoints {
            within: within.clone(),
            ..dense.clone()
        };
        let mut proxies = vec![
            ("json", Proxy::ViewPlane),
            ("json", Proxy::Points { within: None }),
            ("json", Proxy::Points { within }),
            ("json", Proxy::Dense(Arc::new(dense))),
            ("json", Proxy::Dense(Arc::new(bounded))),
        ];
        for kind in MeshKind::ALL {
            let solid = Proxy::Mesh(Arc::new(Solid::new(kind, mesh.clone())));
            proxies.push(("ply", solid.clone()));
            proxies.push(("glb", solid));
            let mut bounded = Solid::new(kind, mesh.clone());
            bounded.keep_within(Some(Arc::clone(&hull)));
            let bounded = Proxy::Mesh(Arc::new(bounded));
            proxies.push(("ply", bounded.clone()));
            proxies.push(("glb", bounded));
            let mut seen_through = Solid::new(kind, mesh.clone());
            seen_through.hide_nothing();
            let seen_through = Proxy::Mesh(Arc::new(seen_through));
            proxies.push(("ply", seen_through.clone()));
            proxies.push(("glb", seen_through));
        }
        for (extension, proxy) in proxies {
            let path = folder.path().join(format!("p.{extension}"));
            write(&path, &proxy, &[], &[]).unwrap();
            let back = read(&path).unwrap();
            assert_eq!(back.kind(), proxy.kind());
            let occludes = |p: &Proxy| matches!(p, Proxy::Mesh(solid) if solid.occludes());
            assert_eq!(occludes(&back), occludes(&proxy), "{extension}");
            assert_eq!(back.within(), proxy.within());
            if extension != "glb" {
                assert_eq!(back, proxy);
            }
        }
        // What a format cannot hold is told.
        let path = folder.path().join("p.json");
        let solid = Proxy::Mesh(Arc::new(Solid::new(MeshKind::Mesh, mesh)));
        let error = write(&path, &solid, &[], &[]).unwrap_err().to_string();
        assert!(error.contains(".ply"), "{error}");
        let path = folder.path().join("p.ply");
        assert!(write(&path, &Proxy::Points { within: None }, &[], &[]).is_err());
    }

    #[test]
    fn a_hull_that_is_open_or_wound_inwards_is_told() {
        let read = |triangles: &str| {
            let text = format!(
                r#"{{"version": 1, "kind": "points", "within": {{
                    "positions": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -0.0]],
                    "triangles": {triangles}}}}}"#
            );
            let read = parse(Path::new("p.json"), text.as_bytes());
            read.map_err(|error| error.to_string())
        };
        // One corner is there twice.
        for closed in [
            "[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]",
            "[[0, 2, 1], [4, 1, 3], [1, 2, 3], [4, 3, 2]]",
        ] {
            let within = read(closed).unwrap();
            assert_eq!(within.within().unwrap().triangle_count(), 4);
        }
        for (triangles, said) in [
            ("[[0, 2, 1]]", "not closed, or its triangles do not all"),
            (
                "[[0, 2, 1], [0, 1, 3], [1, 3, 2], [0, 3, 2]]",
                "go the same way round, at its edge from [",
            ),
            (
                "[[0, 1, 2], [0, 3, 1], [1, 3, 2], [0, 2, 3]]",
                "counter-clockwise as seen from outside",
            ),
            ("[]", "encloses nothing"),
        ] {
            let error = read(triangles).unwrap_err();
            let is_said = error.starts_with("p.json: the hull around it ") && error.contains(said);
            assert!(is_said, "{error}");
        }
        // So it is where nothing is bounded.
        for surface in [
            r#""kind": "view-plane""#,
            r#""kind": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]"#,
        ] {
            let within =
                r#"{"positions": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "triangles": [[0, 1, 2]]}"#;
            let text = format!(r#"{{"version": 1, {surface}, "within": {within}}}"#);
            let error = parse(Path::new("p.json"), text.as_bytes()).unwrap_err();
            let said = "p.json: the hull around it is not closed";
            assert!(error.to_string().starts_with(said), "{error}");
        }
        // So it is of a mesh's.
        let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\n\
                   property double z\nelement face 1\nproperty list uchar uint vertex_indices\n\
                   element hull_vertex 3\nproperty double x\nproperty double y\nproperty double z\n\
                   element hull_face 1\nproperty list uchar uint vertex_indices\nend_header\n\
                   0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
        let error = parse(Path::new("m.ply"), ply.as_bytes()).unwrap_err();
        let said = "m.ply: the hull around it is not closed";
        assert!(error.to_string().starts_with(said), "{error}");
    }

    #[test]
    fn dense_points_that_contradict_themselves_are_told() {
        let told = |text: &str| {
            parse(Path::new("d.json"), text.as_bytes())
                .unwrap_err()
                .to_string()
        };
        let error = told(
            r#"{"version": 1, "kind": "dense", "views": ["a"], "points": [[0,0,1]], "seen_by": [[1]]}"#,
        );
        assert!(error.contains("point 0 is seen by view 1 of 1"), "{error}");
        let error = told(
            r#"{"version": 1, "kind": "dense", "views": ["a"], "points": [[0,0,1]], "seen_by": []}"#,
        );
        assert!(
            error.contains("1 points, and who sees 0 of them"),
            "{error}"
        );
        let points = |count: usize| vec!["[0,0,1]"; count].join(",");
        for (views, count, seen_by, said) in [
            (r#""a""#, 0, "", "it has no points; find the points anew"),
            (r#""a""#, 2, "[], []", "no view sees any of its 2 points"),
            (r#""a", "b", "a""#, 1, "[0]", "it names the view a twice"),
            (
                r#""a", "b""#,
                2,
                "[0], [1, 0, 1]",
                "point 1 is seen by view 1 twice",
            ),
        ] {
            let points = points(count);
            let error = told(&format!(
                r#"{{"version": 1, "kind": "dense", "views": [{views}], "points": [{points}], "seen_by": [{seen_by}]}}"#
            ));
            assert!(error.contains(said), "{error}");
        }
    }
}
