//! Paths relative to a folder.

use super::SceneError;
use std::ffi::{OsStr, OsString};
use std::path::{Component, Path, PathBuf};

/// The way from a folder to a file, `/` between its parts; the whole path where there is
/// none (another drive). Both are made absolute first, so that neither need exist.
///
/// # Errors
/// It is not UTF-8, so that no file could name it.
pub fn relative(folder: &Path, file: &Path) -> Result<String, SceneError> {
    let way = way(folder, file).into_string();
    way.map_err(|_| SceneError::NotUnicode(resolved(file)))
}

/// The same to tell files apart by, not to find them again: what is not UTF-8 is replaced.
pub fn relative_lossy(folder: &Path, file: &Path) -> String {
    way(folder, file).to_string_lossy().into_owned()
}

fn way(folder: &Path, file: &Path) -> OsString {
    let (folder, file) = (resolved(folder), resolved(file));
    let from: Vec<Component<'_>> = folder.components().collect();
    let to: Vec<Component<'_>> = file.components().collect();
    let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    if shared == 0 {
        return file.into_os_string();
    }
    let up = from[shared..].iter().map(|_| OsStr::new(".."));
    let down = to[shared..].iter().map(|part| part.as_os_str());
    let parts: Vec<&OsStr> = up.chain(down).collect();
    if parts.is_empty() {
        return OsString::from(".");
    }
    parts.join(OsStr::new("/"))
}

/// Without symbolic links as far as the path exists: `..` climbs out of what a link
/// points to, not out of the link.
fn resolved(path: &Path) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let mut missing = Vec::new();
    let mut existing = path.as_path();
    loop {
        if let Ok(real) = existing.canonicalize() {
            return missing
                .iter()
                .rev()
                .fold(real, |path, part| path.join(part));
        }
        let (Some(parent), Some(name)) = (existing.parent(), existing.file_name()) else {
            return path;
        };
        missing.push(name.to_owned());
        existing = parent;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_leads_up_and_down() {
        let root = tempfile::tempdir().unwrap();
        let at = |path: &str| root.path().join(path);
        std::fs::create_dir_all(at("capture/images")).unwrap();
        let way = |from: &str, to: &str| relative(&at(from), &at(to)).unwrap();
        assert_eq!(
            way("scene", "capture/images/a.jpg"),
            "../capture/images/a.jpg"
        );
        assert_eq!(
            way("capture/scene", "capture/images/b/a.jpg"),
            "../images/b/a.jpg"
        );
        assert_eq!(way("capture", "capture/a.jpg"), "a.jpg");
        assert_eq!(way("capture", "capture"), ".");
    }

    #[cfg(unix)]
    #[test]
    fn what_is_not_utf_8_is_no_part_of_the_way() {
        use std::os::unix::ffi::OsStrExt;
        let root = Path::new("/none/such");
        let odd = root.join(OsStr::from_bytes(b"b\xff"));
        let error = relative(&root.join("scene"), &odd.join("a.jpg")).unwrap_err();
        let expected = "/none/such/b\u{fffd}/a.jpg: the path is not UTF-8";
        assert!(error.to_string().starts_with(expected), "{error}");
        let way = relative_lossy(&root.join("scene"), &odd.join("a.jpg"));
        assert_eq!(way, "../b\u{fffd}/a.jpg");
        // Within it all is well.
        let way = relative(&odd.join("scene"), &odd.join("a.jpg")).unwrap();
        assert_eq!(way, "../a.jpg");
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_first() {
        let root = tempfile::tempdir().unwrap();
        let at = |path: &str| root.path().join(path);
        std::fs::create_dir_all(at("disk/deep/captures")).unwrap();
        std::os::unix::fs::symlink(at("disk/deep/captures"), at("captures")).unwrap();
        std::fs::write(at("captures/a.jpg"), "").unwrap();
        let way = |from: &str| relative(&at(from), &at("captures/a.jpg")).unwrap();
        assert_eq!(way("captures/scene"), "../a.jpg");
        assert_eq!(way("scene"), "../disk/deep/captures/a.jpg");
    }
}
