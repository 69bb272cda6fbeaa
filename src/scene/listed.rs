//! Which photos the paths mean that calibrations call them by.

use capture::{PhotoFile, PhotoSet, has_photo_extension};
use std::collections::HashMap;
use std::path::Path;

/// Photos, to be found by the paths of whoever calibrated.
pub(super) struct Listed<'a> {
    photos: &'a PhotoSet,
    /// By the name without what it ends in; of photos that are called so alike, the first.
    by_stem: HashMap<&'a str, &'a PhotoFile>,
}

impl<'a> Listed<'a> {
    pub(super) fn of(photos: &'a PhotoSet) -> Self {
        let mut by_stem = HashMap::new();
        for photo in &photos.photos {
            if let Some((stem, _)) = photo.name.rsplit_once('.') {
                by_stem.entry(stem).or_insert(photo);
            }
        }
        Self { photos, by_stem }
    }

    /// The photo that a path means: the one whose name is the longest end of it, or is so without its
    /// extension where the path has none of a photo's. (A mask may be called `a.jpg.png`, and is not
    /// `a.jpg`.)
    pub(super) fn photo(&self, path: &str) -> Option<&'a PhotoFile> {
        let path = path.replace('\\', "/");
        let is_whole = has_photo_extension(Path::new(&path));
        let mut rest = path.as_str();
        loop {
            let by_stem = || self.by_stem.get(rest).copied().filter(|_| !is_whole);
            if let Some(photo) = self.photos.find(rest).or_else(by_stem) {
                return Some(photo);
            }
            (_, rest) = rest.split_once('/')?;
        }
    }

    /// Its name; where there is no such photo, the path's own end.
    pub(super) fn name(&self, path: &str) -> String {
        match self.photo(path) {
            Some(photo) => photo.name.clone(),
            None => path.rsplit(['/', '\\']).next().unwrap_or(path).to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    fn photos(names: &[&str]) -> PhotoSet {
        let root = PathBuf::from("images");
        let photo = |name: &&str| PhotoFile {
            name: (*name).to_owned(),
            path: root.join(name),
        };
        let mut photos: Vec<PhotoFile> = names.iter().map(photo).collect();
        photos.sort_by(|a, b| a.name.cmp(&b.name));
        PhotoSet { root, photos }
    }

    #[test]
    fn the_longest_end_of_a_path_is_meant() {
        let photos = photos(&["a.jpg", "b/a.jpg", "b/c.png", "c.jpg", "c.png"]);
        let listed = Listed::of(&photos);
        for (path, name) in [
            ("/home/me/b/a.jpg", "b/a.jpg"),
            ("C:\\me\\b\\a.jpg", "b/a.jpg"),
            ("./train/b/c", "b/c.png"),
            ("./train/c", "c.jpg"),
            // What is not there keeps its own end.
            ("/home/me/d.jpg", "d.jpg"),
            ("me\\d", "d"),
        ] {
            assert_eq!(listed.name(path), name, "{path}");
        }
        assert!(listed.photo("d.jpg").is_none());
    }

    #[test]
    fn a_mask_does_not_stand_in_for_a_photo_that_is_missing() {
        let photos = photos(&["a.jpg", "a.jpg.png", "b.JPG.png", "c.tif.png"]);
        let listed = Listed::of(&photos);
        assert_eq!(listed.name("images/a.jpg"), "a.jpg");
        assert!(listed.photo("images/b.JPG").is_none());
        assert_eq!(listed.name("images/b.JPG"), "b.JPG");
        // Those of kinds that are not read here may have been converted.
        assert_eq!(listed.name("images/c.tif"), "c.tif.png");
    }
}
