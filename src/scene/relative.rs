//! Paths relative to a folder.

use std::path::{Component, Path, PathBuf};

/// The way from a folder to a file, `/` between its parts; the whole path where there is
/// none (another drive). Both are made absolute first, so that neither need exist.
pub fn relative(folder: &Path, file: &Path) -> String {
    let (folder, file) = (resolved(folder), resolved(file));
    let from: Vec<Component<'_>> = folder.components().collect();
    let to: Vec<Component<'_>> = file.components().collect();
    let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    if shared == 0 {
        return file.display().to_string();
    }
    let up = from[shared..].iter().map(|_| "..".to_owned());
    let down = to[shared..].iter();
    let down = down.map(|part| part.as_os_str().to_string_lossy().into_owned());
    let parts: Vec<String> = up.chain(down).collect();
    if parts.is_empty() {
        return ".".to_owned();
    }
    parts.join("/")
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
        let way = |from: &str, to: &str| relative(&at(from), &at(to));
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
    fn links_are_followed_first() {
        let root = tempfile::tempdir().unwrap();
        let at = |path: &str| root.path().join(path);
        std::fs::create_dir_all(at("disk/deep/captures")).unwrap();
        std::os::unix::fs::symlink(at("disk/deep/captures"), at("captures")).unwrap();
        std::fs::write(at("captures/a.jpg"), "").unwrap();
        let way = relative(&at("captures/scene"), &at("captures/a.jpg"));
        assert_eq!(way, "../a.jpg");
        let out = relative(&at("scene"), &at("captures/a.jpg"));
        assert_eq!(out, "../disk/deep/captures/a.jpg");
    }
}
