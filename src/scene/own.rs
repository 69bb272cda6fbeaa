//! The surface that was made for a scene, and that its folder holds.

use super::file::{Extra, ProxyEntry};
use super::parts::{PROXY_FILE, PROXY_MESH, SCENE_FILE, scene_file};
use super::put_back::works;
use super::store::{hold_above, io, make_within, write_json};
use super::{Scene, SceneError};
use capture::hold::{hold, hold_now};
use capture::{as_argument, without_byte_order_mark};
use proxy::Proxy;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A scene's own proxy.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneProxy {
    /// The surface; where its file is lost or damaged, what is wrong with that.
    pub proxy: Result<Proxy, LostProxy>,
    /// Its file, relative to the scene's folder.
    pub file: String,
    /// For one fitted to the scene's points: the photos that were held out. `None` for one
    /// given by hand.
    pub fitted_without: Option<Vec<String>>,
    /// What `scene.json` says beyond this version's keys.
    pub other: Extra,
}

/// Why a scene's own proxy cannot be read, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{problem}; fit another with `lumigraph proxy {} KIND`",
    as_argument(folder)
)]
pub struct LostProxy {
    /// The file, and what is wrong with it.
    problem: String,
    /// The scene's.
    folder: PathBuf,
}

impl SceneProxy {
    /// Reads what a scene's file names. One that is lost or damaged is told to those that ask for it: much can be done
    /// without.
    pub(super) fn read(entry: ProxyEntry, folder: &Path) -> Self {
        let proxy = proxy::read(&folder.join(&entry.file));
        Self {
            proxy: proxy.map_err(|error| LostProxy {
                problem: error.to_string(),
                folder: folder.to_owned(),
            }),
            file: entry.file,
            fitted_without: entry.fitted_without,
            other: entry.other,
        }
    }

    /// The surface.
    ///
    /// # Errors
    /// Its file is lost or damaged.
    pub fn surface(&self) -> Result<&Proxy, LostProxy> {
        self.proxy.as_ref().map_err(Clone::clone)
    }

    /// As `scene.json` has it.
    pub(super) fn entry(&self) -> Result<ProxyEntry, LostProxy> {
        Ok(ProxyEntry {
            kind: self.surface()?.kind().to_owned(),
            file: self.file.clone(),
            fitted_without: self.fitted_without.clone(),
            other: self.other.clone(),
        })
    }
}

/// The name of the file that holds a proxy.
pub(super) fn proxy_file(proxy: &Proxy) -> &'static str {
    match proxy {
        Proxy::Mesh(_) => PROXY_MESH,
        _ => PROXY_FILE,
    }
}

/// Whether a file in a scene's folder is called as those that hold its proxies.
fn is_proxy_file(name: &str) -> bool {
    [PROXY_FILE, PROXY_MESH].contains(&name)
}

impl Scene {
    /// Makes a proxy the scene's own, in its folder, complete or not at all.
    ///
    /// # Errors
    /// The scene has no folder; files that cannot be written: then the scene has the proxy that it had.
    pub fn set_proxy(
        &mut self,
        proxy: Proxy,
        fitted_without: Option<&BTreeSet<String>>,
    ) -> Result<PathBuf, SceneError> {
        let Some(folder) = self.folder.clone() else {
            let capture = self.capture.clone().unwrap_or_default();
            return Err(SceneError::NoFolder(capture.join(SCENE_FILE)));
        };
        let name = proxy_file(&proxy);
        let path = folder.join(name);
        // Of two that do so at once each would find half of the other's.
        let _held = hold_above(&folder);
        remove_left(&folder);
        let named = scene_file(&folder).and_then(|file| file.proxy);
        let before = named.map(|own| own.file);
        if before.as_deref() != Some(name) && path.symlink_metadata().is_ok() {
            return Err(SceneError::Occupied {
                problem: "the scene does not name it, and it would be replaced; move it away, or give a file with -o"
                    .to_owned(),
                path,
            });
        }

        // 1. Both files, in a folder that goes away on errors.
        let (made, new) = make_within(&folder)?;
        // So that no other takes what is there meanwhile for what is left of one that was killed.
        let _alive = hold(made.path());
        proxy::write(&new.join(name), &proxy, &[], &[])?;
        let other = self.proxy.as_ref().map(|own| own.other.clone());
        let own = SceneProxy {
            proxy: Ok(proxy),
            file: name.to_owned(),
            fitted_without: fitted_without.map(|names| names.iter().cloned().collect()),
            other: other.unwrap_or_default(),
        };
        // Only this key changes: photos left out today may be back tomorrow.
        let file = folder.join(SCENE_FILE);
        let json = |source| SceneError::Json {
            path: file.clone(),
            expected: "a scene",
            source,
        };
        let bytes = std::fs::read(&file).map_err(|e| io(&file, "read the scene", e))?;
        let text = without_byte_order_mark(&bytes);
        let mut whole: Extra = serde_json::from_slice(text).map_err(json)?;
        let entry = serde_json::to_value(own.entry()?).map_err(json)?;
        whole.insert("proxy".to_owned(), entry);
        write_json(&new.join(SCENE_FILE), &whole)?;

        // 2. They take their places. Under another name the one before is nobody's then.
        let before = before.filter(|before| before != name && is_proxy_file(before));
        if let Some(before) = &before {
            let text = format!("{name}\n{before}\n");
            let left = made.path().join(LEFT);
            std::fs::write(&left, text).map_err(|e| io(&left, "write", e))?;
        }
        let before = before.map(|before| folder.join(before));
        let replaced = replace(&path, &file, before.as_deref(), made, &new);
        replaced.map_err(|e| io(&path, "replace the proxy", e))?;
        self.proxy = Some(own);
        Ok(path)
    }
}

/// In the folder that a proxy is made in: the names of two, of which the scene names one, and the other goes.
const LEFT: &str = "proxies.txt";

/// Removes a proxy that the scene does not name where one that replaced it, or was to be replaced by it, was killed. Where
/// folders cannot be locked nothing tells that from one at work, and nothing is done.
pub(super) fn remove_left(folder: &Path) {
    for work in works(folder).unwrap_or_default() {
        let Ok(names) = std::fs::read_to_string(work.join(LEFT)) else {
            continue;
        };
        let Ok(Some(_held)) = hold_now(&work) else {
            continue;
        };
        let own = scene_file(folder).and_then(|file| file.proxy);
        let Some(own) = own.filter(|own| folder.join(&own.file).is_file()) else {
            continue;
        };
        for name in names
            .lines()
            .filter(|name| is_proxy_file(name) && *name != own.file)
        {
            let _ = std::fs::remove_file(folder.join(name));
        }
        let _ = std::fs::remove_dir_all(&work);
    }
}

/// Has a new proxy and a new `scene.json`, which lie in `new`, take the places of others, or neither; and removes the proxy of
/// before where that has another name.
///
/// There is a `scene.json` at every moment, which [`capture::folder::exchange`] takes away for one. Where there is no proxy of
/// that name the new one comes first, and the scene always has the one that it names. Else the old one is the first to leave
/// and the new one the last to come: killed meanwhile, the scene lacks it, but never says of one what holds of another.
fn replace(
    proxy: &Path,
    scene: &Path,
    before: Option<&Path>,
    made: TempDir,
    new: &Path,
) -> std::io::Result<()> {
    if proxy.is_dir() {
        let text = "a folder is in its place: move it away";
        return Err(std::io::Error::other(text));
    }
    let [old_proxy, old_scene] = ["old-proxy", "old-scene"].map(|name| made.path().join(name));
    let in_new = |path: &Path| new.join(path.file_name().unwrap_or_default());
    if proxy.symlink_metadata().is_err() {
        std::fs::rename(in_new(proxy), proxy)?;
        std::fs::rename(in_new(scene), scene).inspect_err(|_| {
            // The first error is the one to tell.
            let _ = std::fs::remove_file(proxy);
        })?;
        // While `made` says that it is in nobody's way.
        if let Some(before) = before {
            let _ = std::fs::remove_file(before);
        }
        return Ok(());
    }
    std::fs::copy(scene, &old_scene)?;
    std::fs::rename(proxy, &old_proxy)?;
    let exchanged =
        std::fs::rename(in_new(scene), scene).and_then(|()| std::fs::rename(in_new(proxy), proxy));
    if exchanged.is_err() {
        let _ = std::fs::rename(&old_scene, scene);
        if std::fs::rename(&old_proxy, proxy).is_err() {
            // It is all that is left of it.
            let _ = made.keep();
        }
    }
    exchanged
}

#[cfg(test)]
mod tests {
    use super::super::tests::wall;
    use super::*;
    use glam::DVec3;
    use proxy::Plane;
    use std::fs;

    fn plane() -> Proxy {
        Proxy::Plane(Plane::new(DVec3::Z, DVec3::NEG_Z).unwrap())
    }

    /// Of two that lie in a scene's folder it names one.
    #[test]
    fn what_a_killed_one_has_left_is_in_nobodys_way() {
        let (home, capture) = wall(2, 1);
        let folder = home.path().join("scene");
        let (mut scene, _) = Scene::open(&capture, false).unwrap();
        scene.save(&folder, false).unwrap();
        scene.set_proxy(plane(), None).unwrap();
        let names = || -> BTreeSet<String> {
            let entries = fs::read_dir(&folder).unwrap();
            let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
            names.collect()
        };
        let whole = names();
        let work = folder.join(".lumigraph-abc");
        let kill = || {
            fs::create_dir(&work).unwrap();
            fs::write(work.join(LEFT), "proxy.ply\nproxy.json\n").unwrap();
        };

        // 1. Killed before the scene named the new one, which is then gone; but not while it is at work.
        let mesh = folder.join(PROXY_MESH);
        fs::write(&mesh, "new").unwrap();
        assert!(matches!(
            Scene::check_free(&folder, true),
            Err(SceneError::Occupied { .. })
        ));
        kill();
        let held = hold_now(&work);
        if !matches!(held, Ok(Some(_))) {
            eprintln!("SKIPPED: no folder can be held here");
            return;
        }
        Scene::put_back(&folder).unwrap();
        assert!(mesh.exists());
        drop(held);
        Scene::put_back(&folder).unwrap();
        assert_eq!(names(), whole);

        // 2. Killed before the old one was gone.
        let file = folder.join(SCENE_FILE);
        let text = fs::read_to_string(&file).unwrap();
        fs::write(&file, text.replace(PROXY_FILE, PROXY_MESH)).unwrap();
        fs::write(&mesh, "new").unwrap();
        kill();
        let (mut scene, _) = Scene::open(&folder, false).unwrap();
        scene.set_proxy(plane(), None).unwrap();
        assert_eq!(names(), whole);
        assert_eq!(fs::read_to_string(&file).unwrap(), text);

        // 3. What nobody was at work with is somebody's own.
        fs::write(&mesh, "mine").unwrap();
        scene.set_proxy(plane(), None).unwrap();
        assert_eq!(fs::read_to_string(&mesh).unwrap(), "mine");
    }

    #[test]
    fn scenes_that_are_saved_at_once_are_one_of_them() {
        let (home, capture) = wall(3, 1);
        for round in 0..8 {
            let folder = home.path().join(format!("scene-{round}"));
            let save = || {
                let (mut scene, _) = Scene::open(&capture, false).unwrap();
                let saved = scene.save_undistorted(&folder, false, false, false, &|| {});
                saved.map(|_| ()).map_err(|error| error.to_string())
            };
            let saved = std::thread::scope(|scope| {
                let threads = [scope.spawn(save), scope.spawn(save)];
                threads.map(|thread| thread.join().unwrap())
            });
            assert_eq!(
                saved.iter().filter(|saved| saved.is_ok()).count(),
                1,
                "{saved:?}"
            );
            let (scene, _) = Scene::open(&folder, true).unwrap();
            assert!(scene.photos.iter().all(|photo| photo.path.is_file()));
        }
    }
}
