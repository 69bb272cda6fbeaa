//! Files that are called like photos or views.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// Why pictures cannot be written under the names of photos or views.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NameError {
    /// A name that is no path within a folder.
    #[error("{kind} {name:?}: the name leads out of the output folder; rename the {kind}")]
    LeadsOut {
        /// `view` or `photo`.
        kind: &'static str,
        /// Its name.
        name: String,
    },
    /// Two names for one file.
    #[error(
        "{kind}s {first} and {second} would both be written to {}; rename one of them",
        file.display()
    )]
    Clash {
        /// `view` or `photo`.
        kind: &'static str,
        /// The one before.
        first: String,
        /// The one after.
        second: String,
        /// What both would be written to.
        file: PathBuf,
    },
}

/// The files in `folder` for pictures of these names, sub-folders kept: each name as it is,
/// or, where it comes with `true`, with its extension replaced by `.png`. Where several would then be
/// one, `a.jpg` and `a.png`, such a name keeps its extension, and the file is `a.jpg.png`, as masks are
/// called. `kind` is what they are, for messages.
///
/// # Errors
/// Two names that give one file even so; a name that leads out of the folder.
pub fn picture_files<'a>(
    kind: &'static str,
    names: impl Iterator<Item = (&'a str, bool)>,
    folder: &Path,
) -> Result<Vec<PathBuf>, NameError> {
    // 1. What each would be called.
    let names: Vec<(&str, bool)> = names.collect();
    let mut short = Vec::new();
    let mut sharing: BTreeMap<PathBuf, usize> = BTreeMap::new();
    for &(name, as_png) in &names {
        let path = Path::new(name);
        let inside = path.components().all(|c| matches!(c, Component::Normal(_)));
        if !inside || path.file_name().is_none() {
            return Err(NameError::LeadsOut {
                kind,
                name: name.to_owned(),
            });
        }
        let file = if as_png {
            path.with_extension("png")
        } else {
            path.to_owned()
        };
        *sharing.entry(file.clone()).or_default() += 1;
        short.push(file);
    }

    // 2. What it is called beside the others.
    let mut files = Vec::new();
    let mut taken: BTreeMap<PathBuf, &str> = BTreeMap::new();
    for ((name, as_png), file) in names.into_iter().zip(short) {
        let keeps_extension = as_png && sharing[&file] > 1 && file != Path::new(name);
        let file = folder.join(if keeps_extension {
            PathBuf::from(format!("{name}.png"))
        } else {
            file
        });
        if let Some(first) = taken.insert(file.clone(), name) {
            return Err(NameError::Clash {
                kind,
                first: first.to_owned(),
                second: name.to_owned(),
                file,
            });
        }
        files.push(file);
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(names: &[(&str, bool)]) -> Result<Vec<PathBuf>, String> {
        picture_files("view", names.iter().copied(), Path::new("out")).map_err(|e| e.to_string())
    }

    #[test]
    fn pictures_keep_their_sub_folders() {
        let expected = ["out/a.png", "out/left/a.png", "out/x.y.png", "out/b.JPG"];
        let names = [
            ("a.jpg", true),
            ("left/a.JPG", true),
            ("x.y.jpeg", true),
            ("b.JPG", false),
        ];
        assert_eq!(files(&names), Ok(expected.map(PathBuf::from).to_vec()));
    }

    #[test]
    fn what_would_be_one_file_keeps_its_extension() {
        for second_as_png in [true, false] {
            let names = [
                ("b/a.jpg", true),
                ("b/a.png", second_as_png),
                ("a.jpg", true),
            ];
            let expected = ["out/b/a.jpg.png", "out/b/a.png", "out/a.png"];
            assert_eq!(files(&names), Ok(expected.map(PathBuf::from).to_vec()));
        }
    }

    #[test]
    fn clashes_and_escapes_are_refused() {
        for third_as_png in [true, false] {
            let names = [
                ("b/a.jpg", true),
                ("b/a.png", true),
                ("b/a.jpg.png", third_as_png),
            ];
            assert_eq!(
                files(&names),
                Err(
                    "views b/a.jpg and b/a.jpg.png would both be written to out/b/a.jpg.png; \
                     rename one of them"
                        .to_owned()
                )
            );
        }
        assert!(files(&[("a.jpg", true), ("a.jpg", true)]).is_err());
        for name in ["../a.jpg", "/etc/a.jpg", "", ".."] {
            assert!(
                files(&[(name, true)]).unwrap_err().contains("leads out"),
                "{name:?}"
            );
        }
    }
}
