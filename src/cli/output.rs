//! What a command leaves behind: stdout, pictures, other files.

use anyhow::{Context, bail};
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::{ErrorKind, Write};
use std::path::{Component, Path, PathBuf};

/// Prints a line to stderr, whether or not anybody still reads it.
macro_rules! say {
    ($($arguments:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($arguments)*);
    }};
}
pub(super) use say;

/// Prints to stdout.
pub(super) fn print(text: &str) -> anyhow::Result<()> {
    let mut stdout = std::io::stdout().lock();
    stdout.write_all(text.as_bytes())?;
    stdout.flush()?;
    Ok(())
}

/// Prints JSON to stdout.
pub(super) fn print_json(value: &impl Serialize) -> anyhow::Result<()> {
    print(&(serde_json::to_string_pretty(value)? + "\n"))
}

/// Whether the error is that whoever read our stdout has gone (`lumigraph … | head`).
pub(super) fn is_closed_pipe(error: &anyhow::Error) -> bool {
    let io = error.downcast_ref::<std::io::Error>();
    io.is_some_and(|e| e.kind() == ErrorKind::BrokenPipe)
}

/// The files of frames with the given names: each name with its extension replaced by
/// `.png`, sub-folders kept.
///
/// # Errors
/// Two names that give one file; a name that leads out of the folder.
pub(super) fn frame_files<'a>(
    names: impl Iterator<Item = &'a str>,
    folder: &Path,
) -> anyhow::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let mut taken: BTreeMap<PathBuf, &str> = BTreeMap::new();
    for name in names {
        let path = Path::new(name);
        let inside = path.components().all(|c| matches!(c, Component::Normal(_)));
        if !inside || path.file_name().is_none() {
            bail!("view {name:?}: the name leads out of the output folder; rename the view");
        }
        let file = folder.join(path.with_extension("png"));
        if let Some(other) = taken.insert(file.clone(), name) {
            bail!(
                "views {other} and {name} would both be written to {}; rename one of them",
                file.display()
            );
        }
        files.push(file);
    }
    Ok(files)
}

/// Writes a file, complete or not at all; makes its folder where it is missing.
pub(super) fn write_file(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    make_parent(path)?;
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".tmp");
    let temporary = path.with_file_name(name);
    let failed = || format!("{}: cannot write", path.display());
    std::fs::write(&temporary, bytes).with_context(failed)?;
    std::fs::rename(&temporary, path).with_context(failed)
}

/// Makes the folder that a file is to lie in.
pub(super) fn make_parent(path: &Path) -> anyhow::Result<()> {
    let Some(folder) = path.parent() else {
        return Ok(());
    };
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot make the folder", folder.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(names: &[&str]) -> Result<Vec<PathBuf>, String> {
        frame_files(names.iter().copied(), Path::new("out")).map_err(|e| e.to_string())
    }

    #[test]
    fn frames_keep_their_sub_folders() {
        let expected = ["out/a.png", "out/left/a.png", "out/x.y.png"].map(PathBuf::from);
        assert_eq!(
            files(&["a.jpg", "left/a.JPG", "x.y.jpeg"]),
            Ok(expected.to_vec())
        );
    }

    #[test]
    fn clashes_and_escapes_are_refused() {
        assert_eq!(
            files(&["b/a.jpg", "b/a.png"]),
            Err(
                "views b/a.jpg and b/a.png would both be written to out/b/a.png; \
                 rename one of them"
                    .to_owned()
            )
        );
        for name in ["../a.jpg", "/etc/a.jpg", "", ".."] {
            assert!(
                files(&[name]).unwrap_err().contains("leads out"),
                "{name:?}"
            );
        }
    }
}
