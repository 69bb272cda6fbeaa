//! What lies in a scene's folder: its parts, which go when it is written again, and what is in the way of that.

use super::beside::{DEPTH_FOLDER, MASKS_FOLDER};
use super::file::{PhotoEntry, SceneFile};
use super::store::io;
use super::undistort::{IMAGES_FOLDER, MATTES_FOLDER, SILHOUETTES_FOLDER, files_of};
use super::{Scene, SceneError};
use capture::without_byte_order_mark;
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The file that makes a folder a scene.
pub(super) const SCENE_FILE: &str = "scene.json";
pub(super) const MODEL_FOLDER: &str = "model";
pub(super) const PROXY_FILE: &str = "proxy.json";
/// The same of one that is a mesh.
pub(super) const PROXY_MESH: &str = "proxy.ply";
/// In the order in which they take their places: a folder without the last is no scene.
pub(super) const PARTS: [&str; 9] = [
    IMAGES_FOLDER,
    MASKS_FOLDER,
    MATTES_FOLDER,
    SILHOUETTES_FOLDER,
    DEPTH_FOLDER,
    MODEL_FOLDER,
    PROXY_FILE,
    PROXY_MESH,
    SCENE_FILE,
];
/// What scenes have in their model's folder.
const MODEL_FILES: [&str; 3] = ["cameras.txt", "images.txt", "points3D.txt"];
/// What systems leave in folders that somebody looks into: nobody's own.
const DROPPINGS: [&str; 3] = [".DS_Store", "Thumbs.db", "desktop.ini"];
/// COLMAP's work, for photos without a calibration. Like the frames it stays when the scene
/// is written again: both took long to make.
pub(super) const COLMAP_FOLDER: &str = "colmap";
/// The photos that were taken out of a video.
pub(super) const FRAMES_FOLDER: &str = "photos";
/// What [`capture::video::extract`] leaves of the latter if it is killed.
const PARTIAL_FRAMES: &str = ".photos.partial";
/// What the name begins with of earlier frames, if it is killed while it replaces them.
pub(super) const REPLACED_FRAMES: &str = ".photos.replaced-";
/// What the name begins with of the folder that a scene is made in, within its own: only that
/// is surely on the same disk.
pub(super) const WORK_PREFIX: &str = ".lumigraph-";

impl Scene {
    /// Whether a scene may be written to a folder.
    ///
    /// # Errors
    /// The folder holds something: an earlier scene, unless `replace`; anything that is no
    /// part of a scene, or that the scene does not name within its parts, always.
    pub fn check_free(folder: &Path, replace: bool) -> Result<(), SceneError> {
        if !folder.exists() {
            return Ok(());
        }
        let occupied = |problem: String| SceneError::Occupied {
            path: folder.to_owned(),
            problem,
        };
        let entries = std::fs::read_dir(folder).map_err(|e| io(folder, "list the folder", e))?;
        let own = own_parts(folder);
        let stay = [COLMAP_FOLDER, FRAMES_FOLDER, PARTIAL_FRAMES];
        let stay = stay.iter().chain(&DROPPINGS);
        for entry in entries {
            let entry = entry.map_err(|e| io(folder, "list the folder", e))?;
            let name = entry.file_name().to_string_lossy().into_owned();
            let is_left = [REPLACED_FRAMES, WORK_PREFIX]
                .iter()
                .any(|prefix| name.starts_with(prefix));
            let mut known = own.iter().chain(stay.clone());
            if !is_left && !known.any(|part| *part == name) {
                return Err(occupied(format!(
                    "holds {name}, which is no part of a scene; choose another folder, or move that away first"
                )));
            }
        }
        if let Some(name) = unnamed_within(folder, &own)? {
            return Err(occupied(format!(
                "holds {}, which the scene does not name and would take along; move it away",
                name.display()
            )));
        }
        if Self::is_scene(folder) && !replace {
            return Err(occupied(
                "holds a scene already; replace it with --force, or choose another folder"
                    .to_owned(),
            ));
        }
        Ok(())
    }

    /// What kind of proxy the scene in a folder has as its own; `None` where it has none, or there is no scene.
    pub fn proxy_kind(folder: &Path) -> Option<String> {
        Some(scene_file(folder)?.proxy?.kind)
    }

    /// Whether a path, there or not, is that of a part of the scene in the folder around it: one that goes when the
    /// scene is written again, with all that lies in it.
    pub fn is_part(path: &Path) -> bool {
        let folder = path.parent().filter(|folder| Self::is_scene(folder));
        let name = path.file_name().and_then(OsStr::to_str);
        folder.is_some_and(|folder| own_parts(folder).iter().any(|part| Some(*part) == name))
    }
}

/// The parts that are the scene's own of what may lie in a folder.
fn own_parts(folder: &Path) -> Vec<&'static str> {
    let is_scene = Scene::is_scene(folder);
    let mut parts = Vec::new();
    // Without its file, only what is left of an import that was killed as its parts took
    // their places: all else is somebody's own.
    if is_scene || is_own_model(&folder.join(MODEL_FOLDER)) {
        parts.extend([MODEL_FOLDER, PROXY_FILE, PROXY_MESH]);
    }
    if is_scene {
        parts.extend([SCENE_FILE, SILHOUETTES_FOLDER]);
    }
    // Other photos are part of a scene only where it says that they are its own.
    if is_scene && scene_file(folder).is_some_and(|file| file.settings.undistorted) {
        parts.extend([IMAGES_FOLDER, MASKS_FOLDER, MATTES_FOLDER, DEPTH_FOLDER]);
    }
    parts
}

/// Whether a folder holds a model as scenes have it, and nothing else.
fn is_own_model(folder: &Path) -> bool {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<_> = entries.map(|entry| entry.file_name()).collect();
    names.sort();
    names == MODEL_FILES
}

/// A file within these parts of a folder that its scene does not name, by its path from there: somebody's own.
/// What a link leads to stays where it is.
fn unnamed_within(folder: &Path, parts: &[&str]) -> Result<Option<PathBuf>, SceneError> {
    let named = named_files(folder);
    let scene = scene_file(folder);
    // Without a scene's file nothing tells whose a proxy is that lies beside such a model.
    let is_own_proxy = |part: &str| match &scene {
        Some(scene) => scene.proxy.as_ref().is_some_and(|own| own.file == part),
        None => true,
    };
    for part in parts {
        let Ok(found) = folder.join(part).symlink_metadata() else {
            continue;
        };
        let is_file = match *part {
            SCENE_FILE => true,
            PROXY_FILE | PROXY_MESH => is_own_proxy(part),
            _ => false,
        };
        if found.is_file() && !is_file {
            return Ok(Some(PathBuf::from(part)));
        }
        if !found.is_dir() {
            continue;
        }
        let other = other_within(&folder.join(part), |file| named.contains(file))?;
        if let Some(other) = other {
            let name = other.strip_prefix(folder).unwrap_or(&other);
            return Ok(Some(name.to_owned()));
        }
    }
    Ok(None)
}

/// A file in a folder, or in those within it, that is none of those that `is_own` knows by their paths: somebody's own.
/// What systems leave there is not, and what a link leads to is not looked at.
///
/// # Errors
/// A folder cannot be listed.
pub fn other_within(
    folder: &Path,
    is_own: impl Fn(&Path) -> bool,
) -> Result<Option<PathBuf>, SceneError> {
    let mut open = vec![folder.to_owned()];
    while let Some(within) = open.pop() {
        let failed = |error| io(&within, "list the folder", error);
        for entry in std::fs::read_dir(&within).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let path = entry.path();
            let is_dropping = DROPPINGS.iter().any(|own| path.ends_with(own));
            if entry.file_type().map_err(failed)?.is_dir() {
                open.push(path);
            } else if !is_dropping && !is_own(&path) {
                return Ok(Some(path));
            }
        }
    }
    Ok(None)
}

/// The files that the scene in a folder names, those of its model, and those that it may have of photos that it left out.
fn named_files(folder: &Path) -> BTreeSet<PathBuf> {
    let of_model = MODEL_FILES.map(|name| Path::new(MODEL_FOLDER).join(name));
    let mut files = BTreeSet::from(of_model);
    if let Some(scene) = scene_file(folder) {
        if scene.settings.undistorted {
            files.extend(scene.left_out.iter().flat_map(|name| left_of(name)));
        }
        let named = scene.photos.iter().flat_map(PhotoEntry::files);
        files.extend(named.map(PathBuf::from));
    }
    files.iter().map(|name| folder.join(name)).collect()
}

/// What earlier versions left of a photo that undistorting left out, which the capture calls so, where what lies beside it was
/// damaged: under each of the names that [`picture_files`](super::picture_files) may have given it.
fn left_of(name: &str) -> impl Iterator<Item = PathBuf> {
    let copied = PathBuf::from(name);
    let names = [
        copied.with_extension("png"),
        PathBuf::from(format!("{name}.png")),
        copied,
    ];
    names.into_iter().flat_map(|name| files_of(&name))
}

/// What makes a folder a scene, if that can be read.
pub(super) fn scene_file(folder: &Path) -> Option<SceneFile> {
    let bytes = std::fs::read(folder.join(SCENE_FILE)).ok()?;
    serde_json::from_slice(without_byte_order_mark(&bytes)).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn what_the_program_or_a_system_left_is_in_nobodys_way() {
        let home = tempfile::tempdir().unwrap();
        let folder = home.path();
        let write = |file: &str, text: &str| {
            let path = folder.join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        let text = r#"{"version": 1, "photos": [], "left_out": ["a.jpg", "in/b.png"], "model": "model",
            "settings": {"undistorted": true}}"#;
        write(SCENE_FILE, text);
        for file in [
            "images/a.jpg",
            "images/a.png",
            "images/a.jpg.png",
            "images/in/b.png",
            "masks/a.png.png",
            "mattes/a.jpg.png.png",
            "silhouettes/in/b.png.png",
            "depth/a.jpg.png",
            ".DS_Store",
            "images/in/.DS_Store",
            "model/Thumbs.db",
            "masks/desktop.ini",
        ] {
            write(file, "");
            let free = Scene::check_free(folder, true);
            assert!(free.is_ok(), "{file}: {free:?}");
        }
        for file in [
            "images/b.png",
            "images/a.png.png",
            "masks/a.png",
            "masks/my.DS_Store",
            "model/a.png",
        ] {
            write(file, "");
            let error = Scene::check_free(folder, true).unwrap_err().to_string();
            assert!(error.contains(&format!("holds {file}")), "{error}");
            fs::remove_file(folder.join(file)).unwrap();
        }
    }
}
