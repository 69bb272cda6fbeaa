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
/// or, where it comes with `true`, with its extension replaced by `.png`. `kind` is what
/// they are, for messages.
///
/// # Errors
/// Two names that give one file; a name that leads out of the folder.
pub fn picture_files<'a>(
    kind: &'static str,
    names: impl Iterator<Item = (&'a str, bool)>,
    folder: &Path,
) -> Result<Vec<PathBuf>, NameError> {
    let mut files = Vec::new();
    let mut taken: BTreeMap<PathBuf, &str> = BTreeMap::new();
    for (name, as_png) in names {
        let path = Path::new(name);
        let inside = path.components().all(|c| matches!(c, Component::Normal(_)));
        if !inside || path.file_name().is_none() {
            return Err(NameError::LeadsOut {
                kind,
                name: name.to_owned(),
            });
        }
        let file = if as_png {
            folder.join(path.with_extension("png"))
        } else {
            folder.join(path)
        };
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
    fn clashes_and_escapes_are_refused() {
        for second_as_png in [true, false] {
            assert_eq!(
                files(&[("b/a.jpg", true), ("b/a.png", second_as_png)]),
                Err(
                    "views b/a.jpg and b/a.png would both be written to out/b/a.png; \
                     rename one of them"
                        .to_owned()
                )
            );
        }
        for name in ["../a.jpg", "/etc/a.jpg", "", ".."] {
            assert!(
                files(&[(name, true)]).unwrap_err().contains("leads out"),
                "{name:?}"
            );
        }
    }
}
