//! What an import leaves that was killed while its scene's parts took their places, some renames long.

use super::file::SceneFile;
use super::parts::{MODEL_FOLDER, PARTS, SCENE_FILE, WORK_PREFIX, scene_file};
use super::store::io;
use super::{Scene, SceneError};
use capture::hold::hold_now;
use std::path::Path;

/// In the folder that a scene is made in: the new one's parts that have not taken their places.
pub(super) const NEW_FOLDER: &str = "scene";
/// And those that have left theirs.
pub(super) const OLD_FOLDER: &str = "old";

impl Scene {
    /// Where an import was killed as the parts of its scene took their places in a folder, puts those of the scene of
    /// before back, and those of the new one away. Whether there was one before. Killed meanwhile, it goes on where it
    /// was.
    ///
    /// # Errors
    /// Something cannot be listed or moved.
    pub fn put_back(folder: &Path) -> Result<bool, SceneError> {
        if !folder.is_dir() || Self::is_scene(folder) {
            return Ok(false);
        }
        let list = |error| io(folder, "list the folder", error);
        let mut works = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(list)? {
            let name = entry.map_err(list)?.file_name();
            if name.to_string_lossy().starts_with(WORK_PREFIX) {
                works.push(folder.join(name));
            }
        }
        works.sort();
        for work in works {
            if put_back_from(&work, folder)? {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// The same of one folder that a scene was made in.
fn put_back_from(work: &Path, folder: &Path) -> Result<bool, SceneError> {
    let [new, old] = [NEW_FOLDER, OLD_FOLDER].map(|name| work.join(name));
    // Of the new one this is the last to leave, and of the old one the first to come.
    let Some(file) = scene_file(&new).filter(|_| old.is_dir()) else {
        return Ok(false);
    };
    // An import that is still at work puts them where they belong.
    let Ok(_held) = hold_now(work) else {
        return Ok(false);
    };
    // 1. What has come of the new one: a part that it names and that is not with its others.
    for part in PARTS {
        if is_there(&folder.join(part)) && !is_there(&new.join(part)) && names(&file, part) {
            move_part(&folder.join(part), &new.join(part))?;
        }
    }
    // 2. What has left of the old one; its file, which makes it a scene, is the last.
    let is_before = is_there(&old.join(SCENE_FILE));
    for part in PARTS {
        if is_there(&old.join(part)) {
            move_part(&old.join(part), &folder.join(part))?;
        }
    }
    Ok(is_before)
}

fn is_there(path: &Path) -> bool {
    path.symlink_metadata().is_ok()
}

fn move_part(from: &Path, to: &Path) -> Result<(), SceneError> {
    std::fs::rename(from, to).map_err(|e| io(from, "put a part of the scene back", e))
}

/// Whether a scene has a part, by its file.
fn names(file: &SceneFile, part: &str) -> bool {
    let of_photos = file.photos.iter().flat_map(|photo| {
        let beside = [
            &photo.ignore_mask,
            &photo.object_matte,
            &photo.silhouette,
            &photo.depth_map,
        ];
        beside.into_iter().flatten().chain([&photo.path])
    });
    let proxy = file.proxy.iter().map(|own| &own.file);
    let mut named = of_photos.chain(proxy).map(Path::new);
    part == MODEL_FOLDER || named.any(|path| path.starts_with(part))
}
