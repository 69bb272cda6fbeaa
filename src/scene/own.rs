//! The surface that was made for a scene, and that its folder holds.

use super::file::{Extra, ProxyEntry};
use super::parts::{PROXY_FILE, PROXY_MESH, SCENE_FILE};
use super::store::{io, make_within, write_json};
use super::{Scene, SceneError};
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
        let before = self.proxy.as_ref().map(|own| own.file.clone());
        if before.as_deref() != Some(name) && path.symlink_metadata().is_ok() {
            return Err(SceneError::Occupied {
                problem: "the scene does not name it, and it would be replaced; move it away, or give a file with -o"
                    .to_owned(),
                path,
            });
        }

        // 1. Both files, in a folder that goes away on errors.
        let (made, new) = make_within(&folder)?;
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

        // 2. They take their places.
        replace(&path, &file, made, &new).map_err(|e| io(&path, "replace the proxy", e))?;
        self.proxy = Some(own);
        // 3. Under another name the one before is nobody's.
        let before = before.filter(|before| before != name && is_proxy_file(before));
        if let Some(before) = before {
            let _ = std::fs::remove_file(folder.join(before));
        }
        Ok(path)
    }
}

/// Has a new proxy and a new `scene.json`, which lie in `new`, take the places of others, or neither.
///
/// The proxy is the first to leave and the last to come: killed meanwhile, the scene lacks it, but never says of one
/// what holds of another. And there is a `scene.json` at every moment, which [`capture::folder::exchange`] takes away
/// for one.
fn replace(proxy: &Path, scene: &Path, made: TempDir, new: &Path) -> std::io::Result<()> {
    if proxy.is_dir() {
        let text = "a folder is in its place: move it away";
        return Err(std::io::Error::other(text));
    }
    let [old_proxy, old_scene] = ["old-proxy", "old-scene"].map(|name| made.path().join(name));
    std::fs::copy(scene, &old_scene)?;
    let is_replaced = proxy.symlink_metadata().is_ok();
    if is_replaced {
        std::fs::rename(proxy, &old_proxy)?;
    }
    let in_new = |path: &Path| new.join(path.file_name().unwrap_or_default());
    let exchanged =
        std::fs::rename(in_new(scene), scene).and_then(|()| std::fs::rename(in_new(proxy), proxy));
    if exchanged.is_err() {
        // The first error is the one to tell.
        let _ = std::fs::rename(&old_scene, scene);
        if is_replaced && std::fs::rename(&old_proxy, proxy).is_err() {
            // It is all that is left of it.
            let _ = made.keep();
        }
    }
    exchanged
}
