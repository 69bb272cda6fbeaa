//! What a command leaves behind: stdout, pictures, other files.

use anyhow::{Context, anyhow};
use serde::Serialize;
use std::io::{ErrorKind, Write};
use std::path::Path;
use tempfile::TempDir;

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
    let written = stdout.write_all(text.as_bytes());
    let written = written.and_then(|()| stdout.flush());
    written.context("standard output: cannot write")
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

/// Writes a file, complete or not at all; makes its folder where it is missing.
pub(super) fn write_file(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    fill_file(path, |temporary| std::fs::write(temporary, bytes))
}

/// The same with what `fill` writes to a file of another name.
pub(super) fn fill_file(
    path: &Path,
    fill: impl FnOnce(&Path) -> std::io::Result<()>,
) -> anyhow::Result<()> {
    make_parent(path)?;
    let written = capture::write_whole(path, fill);
    written.with_context(|| format!("{}: cannot write", path.display()))
}

/// A folder for what is needed for a while, which goes with what comes back.
pub(super) fn temporary_folder() -> anyhow::Result<TempDir> {
    tempfile::tempdir().map_err(|error| {
        anyhow!(
            "{}: cannot make a folder for what is needed for a while: {error}; have the variable TMPDIR name \
             a folder that can be written to",
            std::env::temp_dir().display()
        )
    })
}

/// Makes the folder that a file is to lie in.
pub(super) fn make_parent(path: &Path) -> anyhow::Result<()> {
    let Some(folder) = path.parent() else {
        return Ok(());
    };
    std::fs::create_dir_all(folder).with_context(|| {
        format!(
            "{}: cannot make the folder; check that files may be written there",
            folder.display()
        )
    })
}
