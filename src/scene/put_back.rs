//! What an import leaves that was killed while its scene's parts took their places, some renames long.

use super::file::{PhotoEntry, SceneFile};
use super::own::remove_left;
use super::parts::{MODEL_FOLDER, PARTS, SCENE_FILE, WORK_PREFIX, scene_file};
use super::store::io;
use super::{Scene, SceneError};
use capture::hold::hold_now;
use std::path::{Path, PathBuf};

/// In the folder that a scene is made in: the new one's parts that have not taken their places.
pub(super) const NEW_FOLDER: &str = "scene";
/// And those that have left theirs.
pub(super) const OLD_FOLDER: &str = "old";

impl Scene {
    /// Where an import was killed as the parts of its scene took their places in a folder, puts those of the scene of
    /// before back, and removes those of the new one. Whether there was one before. Killed meanwhile, it goes on where it
    /// was. Where folders cannot be locked nothing tells such an import from one that is at work, and nothing is done.
    /// Of a scene, removes the proxy that it does not name where `proxy` was killed as one took the place of another.
    ///
    /// # Errors
    /// Something cannot be listed or moved.
    pub fn put_back(folder: &Path) -> Result<bool, SceneError> {
        if !folder.is_dir() {
            return Ok(false);
        }
        if Self::is_scene(folder) {
            remove_left(folder);
            return Ok(false);
        }
        let works = works(folder).map_err(|e| io(folder, "list the folder", e))?;
        for work in works {
            if put_back_from(&work, folder)? {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// Whether a folder holds what an import leaves that was killed, or is still at work, as one scene took the place of
/// another: neither is there.
pub(super) fn is_between_scenes(folder: &Path) -> bool {
    let works = works(folder).unwrap_or_default();
    let is_old = |work: &PathBuf| is_there(&work.join(OLD_FOLDER).join(SCENE_FILE));
    !Scene::is_scene(folder) && works.iter().any(is_old)
}

/// The folders within one that scenes, or proxies, for it are made in, in order.
pub(super) fn works(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut works = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let name = entry?.file_name();
        if name.to_string_lossy().starts_with(WORK_PREFIX) {
            works.push(folder.join(name));
        }
    }
    works.sort();
    Ok(works)
}

/// The same of one folder that a scene was made in.
fn put_back_from(work: &Path, folder: &Path) -> Result<bool, SceneError> {
    // An import that is still at work puts them where they belong. One that has just ended has done so: what lies
    // here says what is left only once it is held.
    let Ok(Some(_held)) = hold_now(work) else {
        return Ok(false);
    };
    if Scene::is_scene(folder) {
        return Ok(false);
    }
    let [new, old] = [NEW_FOLDER, OLD_FOLDER].map(|name| work.join(name));
    // Of the new one this is the last to leave, and of the old one the first to come.
    let Some(file) = scene_file(&new).filter(|_| old.is_dir()) else {
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
    // 3. What is left is no more to be put back, and in nobody's way where it cannot be removed. Nothing of the old one
    // goes with it: a folder that is not empty stays.
    if std::fs::remove_dir(&old).is_ok() {
        let _ = std::fs::remove_dir_all(work);
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
    let of_photos = file.photos.iter().flat_map(PhotoEntry::files);
    let proxy = file.proxy.iter().map(|own| own.file.as_str());
    let mut named = of_photos.chain(proxy).map(Path::new);
    part == MODEL_FOLDER || named.any(|path| path.starts_with(part))
}

#[cfg(all(test, unix))]
mod tests {
    use super::super::undistort::IMAGES_FOLDER;
    use super::*;
    use std::fs;

    /// A folder with a scene's photo and model, as an import that is killed before its file comes leaves it, and the
    /// folder that it was made in.
    fn left(folder: &Path) -> [PathBuf; 2] {
        let place = folder.join("scene");
        let work = place.join(format!("{WORK_PREFIX}abc"));
        for within in [work.join(NEW_FOLDER), work.join(OLD_FOLDER)] {
            fs::create_dir_all(within).unwrap();
        }
        for part in [IMAGES_FOLDER, MODEL_FOLDER] {
            fs::create_dir(place.join(part)).unwrap();
        }
        let text = r#"{"version": 1, "photos": [{"name": "a.png", "path": "images/a.png"}], "model": "model"}"#;
        fs::write(work.join(NEW_FOLDER).join(SCENE_FILE), text).unwrap();
        [place, work]
    }

    #[test]
    fn what_became_a_scene_before_the_work_is_held_stays() {
        let home = tempfile::tempdir().unwrap();
        let [place, work] = left(home.path());
        if !matches!(hold_now(&work), Ok(Some(_))) {
            eprintln!("SKIPPED: no folder can be held here");
            return;
        }
        let has = |part: &str| place.join(part).exists();
        // Another import is still at work.
        let held = hold_now(&work);
        assert!(!put_back_from(&work, &place).unwrap());
        assert!(has(IMAGES_FOLDER) && has(MODEL_FOLDER));
        drop(held);
        // It has ended.
        let file = work.join(NEW_FOLDER).join(SCENE_FILE);
        fs::copy(&file, place.join(SCENE_FILE)).unwrap();
        assert!(!put_back_from(&work, &place).unwrap());
        assert!(has(IMAGES_FOLDER) && has(MODEL_FOLDER));
        // It was killed.
        fs::remove_file(place.join(SCENE_FILE)).unwrap();
        assert!(!put_back_from(&work, &place).unwrap());
        assert!(!has(IMAGES_FOLDER) && !has(MODEL_FOLDER));
        assert!(!work.exists());
    }
}
