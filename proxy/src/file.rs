//! Proxy files: JSON holds the surface exactly; GLB is for looking at it elsewhere, and
//! carries the same JSON in its `extras`.

use crate::{Plane, PlaneError, Proxy, glb};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What is wrong with a proxy file.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// It cannot be read or written.
    #[error("{path}: {error}", path = .0.display(), error = .1)]
    Io(PathBuf, std::io::Error),
    /// It is not the JSON that was expected.
    #[error("{path}: not a proxy file: {error}", path = .0.display(), error = .1)]
    Json(PathBuf, serde_json::Error),
    /// It is from a later version.
    #[error("{path}: proxy file version {found}; this program reads version 1", path = .0.display(), found = .1)]
    Version(PathBuf, u32),
    /// Its plane is not one.
    #[error("{path}: {error}", path = .0.display(), error = .1)]
    Plane(PathBuf, PlaneError),
    /// A GLB that this program did not write, or no GLB at all.
    #[error("{path}: {reason}", path = .0.display(), reason = .1)]
    Glb(PathBuf, String),
    /// What has no surface apart from a desired view cannot be looked at.
    #[error(
        "{path}: the {kind} proxy is made anew for every view and has no surface of its own \
         to show; write it as .json",
        path = .0.display(), kind = .1
    )]
    NoSurface(PathBuf, &'static str),
    /// Neither .json nor .glb.
    #[error("{path}: proxies are read and written as .json (exact) or .glb", path = .0.display())]
    Extension(PathBuf),
}

/// What the files say. Unknown keys are kept out of the way, not refused.
#[derive(Serialize, Deserialize)]
pub(crate) struct Stored {
    version: u32,
    #[serde(flatten)]
    surface: StoredSurface,
}

#[derive(Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum StoredSurface {
    Plane { point: [f64; 3], normal: [f64; 3] },
    Points,
}

impl Stored {
    /// `None` for a mesh, which JSON is no place for.
    fn of(proxy: &Proxy) -> Option<Self> {
        let surface = match proxy {
            Proxy::Plane(plane) => StoredSurface::Plane {
                point: plane.point().to_array(),
                normal: plane.normal().to_array(),
            },
            Proxy::Points => StoredSurface::Points,
            Proxy::Dense(_) | Proxy::Mesh(_) => return None,
        };
        Some(Self {
            version: 1,
            surface,
        })
    }

    fn proxy(&self, path: &Path) -> Result<Proxy, FileError> {
        if self.version != 1 {
            return Err(FileError::Version(path.to_owned(), self.version));
        }
        match self.surface {
            StoredSurface::Plane { point, normal } => {
                Plane::new(DVec3::from_array(point), DVec3::from_array(normal))
                    .map(Proxy::Plane)
                    .map_err(|e| FileError::Plane(path.to_owned(), e))
            }
            StoredSurface::Points => Ok(Proxy::Points),
        }
    }
}

/// Reads a proxy that [`write()`] wrote.
///
/// # Errors
/// The file, and what is wrong with it.
pub fn read(path: &Path) -> Result<Proxy, FileError> {
    if !["json", "glb"].contains(&extension(path).as_str()) {
        return Err(FileError::Extension(path.to_owned()));
    }
    let bytes = std::fs::read(path).map_err(|e| FileError::Io(path.to_owned(), e))?;
    parse(path, &bytes)
}

/// Reads the content of a file, whose name ends in .json or .glb.
///
/// # Errors
/// As for [`read()`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Proxy, FileError> {
    let stored: Stored = match extension(path).as_str() {
        "json" => serde_json::from_slice(bytes).map_err(|e| FileError::Json(path.to_owned(), e))?,
        "glb" => {
            let extras = glb::extras(bytes).map_err(|e| FileError::Glb(path.to_owned(), e))?;
            serde_json::from_str(&extras).map_err(|e| FileError::Json(path.to_owned(), e))?
        }
        _ => return Err(FileError::Extension(path.to_owned())),
    };
    stored.proxy(path)
}

/// Writes a proxy as `.json` or `.glb`. A GLB shows an infinite surface only around
/// `shown_points_in_world` (the sparse points, say).
///
/// The file appears complete or not at all.
///
/// # Errors
/// The file, and what is wrong with it.
pub fn write(path: &Path, proxy: &Proxy, shown_points_in_world: &[DVec3]) -> Result<(), FileError> {
    let json = |pretty: bool| {
        let stored = Stored::of(proxy);
        let stored = stored.ok_or(FileError::NoSurface(path.to_owned(), proxy.kind()))?;
        let text = if pretty {
            serde_json::to_string_pretty(&stored)
        } else {
            serde_json::to_string(&stored)
        };
        text.map_err(|e| FileError::Json(path.to_owned(), e))
    };
    let bytes = match extension(path).as_str() {
        "json" => (json(true)? + "\n").into_bytes(),
        "glb" => {
            let plane = proxy.plane();
            let plane = plane.ok_or(FileError::NoSurface(path.to_owned(), proxy.kind()))?;
            glb::quad(&plane, shown_points_in_world, json(false)?)
                .map_err(|e| FileError::Glb(path.to_owned(), e))?
        }
        _ => return Err(FileError::Extension(path.to_owned())),
    };
    write_whole(path, &bytes).map_err(|e| FileError::Io(path.to_owned(), e))
}

/// Writes a file that appears complete or not at all.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let temporary = path.with_extension("tmp");
    let written =
        std::fs::write(&temporary, bytes).and_then(|()| std::fs::rename(&temporary, path));
    if written.is_err() {
        let _ = std::fs::remove_file(&temporary);
    }
    written
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
            write(&path, &Proxy::Plane(plane), &shown).unwrap();
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
        assert!(
            error.starts_with("DIR/a.glb: this mesh does not say"),
            "{error}"
        );
        assert_eq!(
            message("a.stl", ""),
            "DIR/a.stl: proxies are read and written as .json (exact) or .glb"
        );
    }
}
