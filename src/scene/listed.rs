//! Which photos the paths mean that calibrations call them by.

use capture::{PhotoFile, PhotoSet, has_photo_extension, stem_key};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
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

    /// The photo that a path may mean: the one whose name is the longest end of it, or is so without its
    /// extension where the path has none of a photo's. (A mask may be called `a.jpg.png`, and is not
    /// `a.jpg`.)
    pub(super) fn photo(&self, path: &str) -> Option<&'a PhotoFile> {
        let path = path.replace('\\', "/");
        ends(&path).find_map(|at| self.called(&path[at..]))
    }

    /// The photo that an end of a path is the name of.
    fn called(&self, end: &str) -> Option<&'a PhotoFile> {
        let by_stem = || self.by_stem.get(end).copied();
        let is_whole = || has_photo_extension(Path::new(end));
        let found = self.photos.find(end);
        found.or_else(|| by_stem().filter(|_| !is_whole()))
    }

    /// By each of a calibration's paths, the name of the photo that it means. One that is missing is called as the
    /// others are: its path without the folders that theirs lose.
    ///
    /// Photos may have been gathered in one folder from many. But where some keep folders of their own, what
    /// others are found by without theirs is something else: with `cam0/0.jpg` and `cam1/0.jpg`, a `1.jpg` beside
    /// those folders is not `cam0/1.jpg`.
    pub(super) fn names<'p>(
        &self,
        paths: impl Iterator<Item = &'p str>,
    ) -> BTreeMap<String, String> {
        // 1. The longest ends that photos are called by, or nearly so.
        let paths: BTreeMap<&str, String> =
            paths.map(|path| (path, path.replace('\\', "/"))).collect();
        let mut cuts: BTreeMap<&str, usize> = BTreeMap::new();
        for path in paths.values() {
            if let Some(at) = ends(path).find(|at| self.called(&path[*at..]).is_some()) {
                cuts.insert(path, at);
            }
        }
        if cuts.len() < paths.len() {
            let photos = self.photos.photos.iter();
            let keys: HashSet<String> = photos.map(|photo| stem_key(&photo.name)).collect();
            for path in paths.values() {
                let near = || ends(path).find(|at| keys.contains(&stem_key(&path[*at..])));
                if let Some(at) = (!cuts.contains_key(path.as_str())).then(near).flatten() {
                    cuts.insert(path, at);
                }
            }
        }

        // 2. Which of them are those photos.
        let keeps_folder = |path: &str, at: usize| path[at..].contains('/');
        let keeping = cuts.iter().filter(|(path, at)| keeps_folder(path, **at));
        let homes: BTreeSet<&str> = keeping.map(|(path, at)| &path[..*at]).collect();
        cuts.retain(|path, at| {
            let at = *at;
            let mut around = ends(path).take_while(|start| *start < at);
            keeps_folder(path, at) || !around.any(|start| begins_in(&homes, path, start))
        });

        // 3. What they are called, and the others.
        let lost: BTreeSet<&str> = cuts.iter().map(|(path, at)| &path[..*at]).collect();
        let mut taken: HashSet<&str> = cuts.iter().map(|(path, at)| &path[*at..]).collect();
        let shared = shared_folders(paths.values().map(String::as_str));
        let mut names = BTreeMap::new();
        for (path, slashed) in &paths {
            let found = cuts.get(slashed.as_str()).map(|at| &slashed[*at..]);
            let name = found.unwrap_or_else(|| {
                let mut starts = ends(slashed).filter(|at| begins_in(&lost, slashed, *at));
                let at = match starts.next_back() {
                    Some(at) => at,
                    None if lost.is_empty() => shared.len(),
                    None => last_of(slashed),
                };
                // Those of different folders may end alike.
                let name = Some(&slashed[at..]).filter(|name| taken.insert(name));
                name.unwrap_or_else(|| slashed.trim_start_matches('/'))
            });
            let name = self.called(name).map_or(name, |photo| photo.name.as_str());
            names.insert((*path).to_owned(), name.to_owned());
        }
        names
    }
}

/// Where the ends of a path begin, the longest first.
fn ends(path: &str) -> impl DoubleEndedIterator<Item = usize> {
    std::iter::once(0).chain(path.match_indices('/').map(|(at, _)| at + 1))
}

/// Where the last part of a path begins.
fn last_of(path: &str) -> usize {
    path.rfind('/').map_or(0, |at| at + 1)
}

/// Whether a path's first `at` bytes are one of the folders. Where nothing is one, it stands for the folder that
/// relative paths begin in.
fn begins_in(folders: &BTreeSet<&str>, path: &str, at: usize) -> bool {
    let is_elsewhere = || path.starts_with(['/', '.']) || path.get(1..2) == Some(":");
    folders.contains(&path[..at]) && (at > 0 || !is_elsewhere())
}

/// The folders that all paths begin with, up to the last `/`.
fn shared_folders<'p>(mut paths: impl Iterator<Item = &'p str>) -> &'p str {
    let first = paths.next().unwrap_or_default();
    paths.fold(&first[..last_of(first)], |shared, path| {
        let mut starts = ends(shared).filter(|at| path.starts_with(&shared[..*at]));
        &shared[..starts.next_back().unwrap_or(0)]
    })
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

    /// Checks what paths, the first of each pair, are called.
    fn check(photos: &PhotoSet, called: &[(&str, &str)]) {
        let names = Listed::of(photos).names(called.iter().map(|(path, _)| *path));
        for (path, name) in called {
            assert_eq!(names[*path], *name, "{path}");
        }
    }

    #[test]
    fn the_longest_end_of_a_path_is_meant() {
        let photos = photos(&["a.jpg", "b/a.jpg", "b/c.png", "c.jpg", "c.png"]);
        check(
            &photos,
            &[
                ("/home/me/b/a.jpg", "b/a.jpg"),
                ("C:\\me\\b\\a.jpg", "b/a.jpg"),
                ("./train/b/c", "b/c.png"),
                ("./train/c", "c.jpg"),
                // What is not there is called as the others are, or keeps its own end.
                ("/home/me/d.jpg", "d.jpg"),
                ("/home/me/b/d.jpg", "b/d.jpg"),
                ("me\\d", "d"),
            ],
        );
        assert!(Listed::of(&photos).photo("d.jpg").is_none());
    }

    #[test]
    fn a_mask_does_not_stand_in_for_a_photo_that_is_missing() {
        let photos = photos(&["a.jpg", "a.jpg.png", "b.JPG.png", "c.tif.png"]);
        assert!(Listed::of(&photos).photo("images/b.JPG").is_none());
        check(
            &photos,
            &[
                ("images/a.jpg", "a.jpg"),
                ("images/b.JPG", "b.JPG"),
                // Those of kinds that are not read here may have been converted.
                ("images/c.tif", "c.tif.png"),
            ],
        );
    }

    #[test]
    fn another_photo_does_not_stand_in_for_one_whose_folder_others_keep() {
        let rig = ["cam0/0.png", "cam0/1.png", "cam1/0.png", "cam1/1.png"];
        let paths = rig.map(|name| format!("images/{name}"));
        let mut called: Vec<(&str, &str)> = paths.iter().map(String::as_str).zip(rig).collect();
        called.push(("images/cam0/2.png", "cam0/2.png"));
        called.push(("images/cam1/3.png", "cam1/3.png"));
        called.push(("images/cam0/3.png", "cam0/3.png"));
        for stray in ["2.png", "2.jpg"] {
            let there = [&rig[..], &[stray]].concat();
            check(&photos(&there), &called);
        }
        // One that lies there is itself.
        called.push(("images/4.png", "4.png"));
        check(&photos(&[&rig[..], &["4.png"]].concat()), &called);
        // Photos that all were converted.
        let converted = rig.map(|name| name.replace("png", "jpg"));
        let mut there: Vec<&str> = converted.iter().map(String::as_str).collect();
        there.push("2.png");
        check(&photos(&there), &called[..5]);
    }

    #[test]
    fn photos_may_be_gathered_in_one_folder() {
        let called = [
            ("/home/me/a/0.jpg", "0.jpg"),
            ("/home/me/1.jpg", "1.jpg"),
            ("/data/b/2.jpg", "2.jpg"),
            ("/data/b/3.png", "3.png"),
        ];
        check(&photos(&["0.jpg", "1.jpg", "2.jpg", "3.jpg"]), &called);
    }

    #[test]
    fn where_no_photo_is_found_names_keep_the_folders_that_tell_them_apart() {
        let called = [
            ("/home/me/c0/0.png", "c0/0.png"),
            ("/home/me/c1/0.png", "c1/0.png"),
        ];
        check(&photos(&["all/c0/0.png", "all/c1/0.png"]), &called);
    }
}
