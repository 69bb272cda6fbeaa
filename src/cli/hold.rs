//! A scene's folder in which one import at a time has COLMAP work, or takes frames out of a video.

use anyhow::{Context, bail};
use capture::hold::{Taken, hold_now};
use std::fs::{self, File};
use std::path::{Path, PathBuf};

/// A folder that this import works in, alone among those that [`hold`] theirs.
pub(super) struct Held {
    _made: Made,
    /// `None` where folders cannot be locked: then all go on, as if each were alone.
    _lock: Option<File>,
}

/// Folders that were made to be held, the innermost first.
struct Made(Vec<PathBuf>);

impl Drop for Made {
    fn drop(&mut self) {
        for folder in &self.0 {
            // One that is not empty stays.
            let _ = fs::remove_dir(folder);
        }
    }
}

/// Holds a scene's folder, which is made where it is missing and goes again if nothing comes to lie in it, until what
/// comes back is dropped or the process ends.
///
/// # Errors
/// Another import holds it; it cannot be made.
pub(super) fn hold(scene: &Path) -> anyhow::Result<Held> {
    let is_missing = |path: &&Path| !path.as_os_str().is_empty() && !path.exists();
    let missing = scene.ancestors().take_while(is_missing);
    let mut made = Made(missing.map(Path::to_owned).collect());
    fs::create_dir_all(scene)
        .with_context(|| format!("{}: cannot make the folder", scene.display()))?;
    let lock = match hold_now(scene) {
        Ok(lock) => lock,
        Err(Taken) => {
            // It may be empty yet, and is the other's.
            made.0.clear();
            bail!(
                "{}: another import is at work here; wait until it has ended, or choose another -o",
                scene.display()
            );
        }
    };
    Ok(Held {
        _made: made,
        _lock: lock,
    })
}
