//! A scene of a video's frames in its folder, while other frames take their place.

use super::parts::{FRAMES_FOLDER, REPLACED_FRAMES, SCENE_FILE, scene_file};
use super::store::io;
use super::{Scene, SceneError};
use std::fs;
use std::path::{Path, PathBuf};

/// A scene's file and its frames, put aside within its folder: that is no scene's until another is made there, as the old
/// file would speak of other frames. A killed import leaves them so, and the next one goes on with them.
#[derive(Debug)]
pub struct Aside {
    folder: PathBuf,
}

impl Aside {
    /// What an import that was killed has put aside, where the folder is no scene's.
    pub fn left(folder: &Path) -> Option<Self> {
        let aside = Self {
            folder: folder.to_owned(),
        };
        let is_left = !Scene::is_scene(folder) && aside.old().join(SCENE_FILE).is_file();
        is_left.then_some(aside)
    }

    /// Puts a scene aside; `None` where the folder has none, or none whose photos are frames in it.
    ///
    /// # Errors
    /// Something cannot be moved.
    pub fn put(folder: &Path) -> Result<Option<Self>, SceneError> {
        let frames = folder.join(FRAMES_FOLDER);
        let is_frame = |path: &str| Path::new(path).starts_with(FRAMES_FOLDER);
        let is_of_frames = scene_file(folder)
            .is_some_and(|file| file.photos.iter().any(|photo| is_frame(&photo.path)));
        if !is_of_frames {
            return Ok(None);
        }
        let aside = Self {
            folder: folder.to_owned(),
        };
        let old = aside.old();
        // The frames first: killed after that, the scene has none, and here they are.
        if frames.exists() {
            if old.exists() {
                fs::remove_dir_all(&old).map_err(|e| io(&old, "remove the folder", e))?;
            }
            fs::create_dir(&old).map_err(|e| io(&old, "make the folder", e))?;
            rename(&frames, &old.join(FRAMES_FOLDER))?;
        }
        rename(&folder.join(SCENE_FILE), &old.join(SCENE_FILE))?;
        // Those of an import that failed, which may go on with them.
        if aside.failed().exists() {
            rename(&aside.failed(), &frames)?;
        }
        Ok(Some(aside))
    }

    /// Puts it back, where no other was made: that one's frames are kept aside.
    ///
    /// # Errors
    /// Something cannot be moved.
    pub fn put_back(self) -> Result<(), SceneError> {
        let (old, failed) = (self.old(), self.failed());
        let frames = self.folder.join(FRAMES_FOLDER);
        if old.join(FRAMES_FOLDER).exists() {
            if failed.exists() {
                fs::remove_dir_all(&failed).map_err(|e| io(&failed, "remove the folder", e))?;
            }
            if frames.exists() {
                rename(&frames, &failed)?;
            }
            rename(&old.join(FRAMES_FOLDER), &frames)?;
        }
        rename(&old.join(SCENE_FILE), &self.folder.join(SCENE_FILE))?;
        // It is in nobody's way.
        let _ = fs::remove_dir(&old);
        Ok(())
    }

    /// Removes it, as another was made. What cannot be removed is in nobody's way.
    pub fn remove(self) {
        let _ = fs::remove_dir_all(self.old());
    }

    fn old(&self) -> PathBuf {
        self.folder.join(format!("{REPLACED_FRAMES}scene"))
    }

    fn failed(&self) -> PathBuf {
        self.folder.join(format!("{REPLACED_FRAMES}failed"))
    }
}

fn rename(from: &Path, to: &Path) -> Result<(), SceneError> {
    fs::rename(from, to).map_err(|e| io(from, "move", e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// All that is in the folder, by path within it.
    fn files(folder: &Path) -> BTreeMap<PathBuf, String> {
        let mut files = BTreeMap::new();
        let mut open = vec![folder.to_owned()];
        while let Some(within) = open.pop() {
            for entry in fs::read_dir(within).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    open.push(path);
                } else {
                    let name = path.strip_prefix(folder).unwrap().to_owned();
                    files.insert(name, fs::read_to_string(path).unwrap());
                }
            }
        }
        files
    }

    fn frames(folder: &Path, content: &str) {
        fs::create_dir_all(folder.join("photos")).unwrap();
        fs::write(folder.join("photos/000001.000s.jpg"), content).unwrap();
    }

    /// A scene of a frame.
    fn scene(folder: &Path) {
        let path = "photos/000001.000s.jpg";
        let photo = serde_json::json!({"name": "000001.000s.jpg", "path": path});
        let file = serde_json::json!({"version": 1, "photos": [photo], "model": "model"});
        fs::write(folder.join("scene.json"), file.to_string()).unwrap();
        frames(folder, "old");
    }

    #[test]
    fn a_scene_comes_back_where_no_other_was_made() {
        let home = tempfile::tempdir().unwrap();
        let folder = home.path();
        scene(folder);
        let before = files(folder);
        // Nothing was taken yet.
        Aside::put(folder).unwrap().unwrap().put_back().unwrap();
        assert_eq!(files(folder), before);

        let aside = Aside::put(folder).unwrap().unwrap();
        assert!(!Scene::is_scene(folder) && !folder.join("photos").exists());
        frames(folder, "new");
        aside.put_back().unwrap();
        let now = files(folder);
        assert!(before.iter().all(|file| now.get(file.0) == Some(file.1)));
        // What was taken is there to go on with.
        let aside = Aside::put(folder).unwrap().unwrap();
        let frame = folder.join("photos/000001.000s.jpg");
        assert_eq!(fs::read_to_string(&frame).unwrap(), "new");
        // Once another is made it goes.
        fs::write(folder.join("scene.json"), "{}").unwrap();
        aside.remove();
        assert_eq!(files(folder).len(), 2);
    }

    #[test]
    fn what_a_killed_import_has_put_aside_is_found() {
        let home = tempfile::tempdir().unwrap();
        let folder = home.path();
        scene(folder);
        let before = files(folder);
        assert!(Aside::left(folder).is_none());
        // Killed when other frames had come.
        Aside::put(folder).unwrap().unwrap();
        frames(folder, "new");
        let error = Scene::open(folder, false).unwrap_err();
        assert!(matches!(error, SceneError::Aside { .. }), "{error}");
        Aside::left(folder).unwrap().put_back().unwrap();
        let failed = folder.join(".photos.replaced-failed");
        fs::remove_dir_all(&failed).unwrap();
        assert_eq!(files(folder), before);
        // Killed between the frames and the file.
        let old = folder.join(".photos.replaced-scene");
        fs::create_dir(&old).unwrap();
        fs::rename(folder.join("photos"), old.join("photos")).unwrap();
        assert!(Aside::left(folder).is_none());
        Aside::put(folder).unwrap().unwrap().put_back().unwrap();
        assert_eq!(files(folder), before);
    }

    #[test]
    fn scenes_of_other_photos_stay() {
        let home = tempfile::tempdir().unwrap();
        assert!(Aside::put(home.path()).unwrap().is_none());
        scene(home.path());
        let file = home.path().join("scene.json");
        let text = fs::read_to_string(&file).unwrap();
        fs::write(&file, text.replace("photos/000", "../mine/000")).unwrap();
        assert!(Aside::put(home.path()).unwrap().is_none());
        assert!(Scene::is_scene(home.path()));
    }
}
