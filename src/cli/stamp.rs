//! Files as they were when something was made of them, and what became of them since.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, UNIX_EPOCH};

/// A file as it was.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Stamp {
    file: PathBuf,
    bytes: u64,
    /// Nanoseconds after 1970 at which it was last written; below zero before.
    modified_ns: i64,
}

impl Stamp {
    /// `None` of what is no file, as the name of a derived path.
    fn of(file: &Path, name: PathBuf) -> Option<Self> {
        let found = std::fs::metadata(file).ok().filter(|m| m.is_file())?;
        let nanos = |span: Duration| i64::try_from(span.as_nanos()).unwrap_or(i64::MAX);
        let modified_ns = match found.modified().ok()?.duration_since(UNIX_EPOCH) {
            Ok(after) => nanos(after),
            Err(before) => -nanos(before.duration()),
        };
        Some(Self {
            file: name,
            bytes: found.len(),
            modified_ns,
        })
    }
}

/// Files as they are now, in the order of what `name` calls them.
pub(super) fn stamps(files: &[PathBuf], name: impl Fn(&Path) -> PathBuf) -> Vec<Stamp> {
    let stamp = |file: &PathBuf| Stamp::of(file, name(file));
    let mut stamps: Vec<Stamp> = files.iter().filter_map(stamp).collect();
    stamps.sort_by(|a, b| a.file.cmp(&b.file));
    stamps
}

/// A file's path as it can be written as JSON: what is no Unicode is replaced.
pub(super) fn in_unicode(file: &Path) -> PathBuf {
    PathBuf::from(file.to_string_lossy().into_owned())
}

/// More files than these are not named.
const NAMED: usize = 3;

/// What became of files, for people; empty of files as they were.
pub(super) fn changes(before: &[Stamp], now: &[Stamp]) -> String {
    let by_file = |all: &[Stamp]| -> BTreeMap<PathBuf, Stamp> {
        all.iter().map(|s| (s.file.clone(), s.clone())).collect()
    };
    let (was, is) = (by_file(before), by_file(now));
    let gone = before.iter().filter(|s| !is.contains_key(&s.file));
    let gone = gone.map(|s| format!("{} is gone", s.file.display()));
    let other = now.iter().filter_map(|s| match was.get(&s.file) {
        None => Some(format!("{} is new", s.file.display())),
        Some(was) if was.bytes != s.bytes => Some(format!(
            "{} has {} bytes, not {}",
            s.file.display(),
            s.bytes,
            was.bytes
        )),
        Some(was) if was != s => Some(format!("{} was written since", s.file.display())),
        Some(_) => None,
    });
    let all: Vec<String> = gone.chain(other).collect();
    let named = all
        .iter()
        .take(NAMED)
        .cloned()
        .collect::<Vec<_>>()
        .join(", ");
    match all.len().saturating_sub(NAMED) {
        0 => named,
        more => format!("{named}, and {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_before_1970_are_files() {
        let here = tempfile::tempdir().unwrap();
        let path = here.path().join("old.png");
        let stamped = |text: &str, seconds: u64| {
            std::fs::write(&path, text).unwrap();
            let file = std::fs::File::options().append(true).open(&path).unwrap();
            let time = UNIX_EPOCH - Duration::from_secs(seconds);
            file.set_modified(time).unwrap();
            stamps(std::slice::from_ref(&path), |_| PathBuf::from("old.png"))
        };
        let before = stamped("one", 100);
        assert_eq!(before[0].modified_ns, -100_000_000_000);
        assert_eq!(changes(&before, &stamped("one", 100)), "");
        assert_eq!(
            changes(&before, &stamped("one", 99)),
            "old.png was written since"
        );
        assert_eq!(
            changes(&before, &stamped("other", 100)),
            "old.png has 5 bytes, not 3"
        );
    }

    #[test]
    fn what_became_of_files_is_said() {
        let stamp = |name: &str, bytes: u64, modified_ns: i64| Stamp {
            file: PathBuf::from(name),
            bytes,
            modified_ns,
        };
        let before = ["a", "b", "c", "d"].map(|name| stamp(name, 5, 7));
        assert_eq!(changes(&before, &before), "");
        let now = [stamp("b", 5, 8), stamp("c", 6, 9), stamp("d", 5, 7)];
        let expected = "a is gone, b was written since, c has 6 bytes, not 5";
        assert_eq!(changes(&before, &now), expected);
        assert_eq!(
            changes(&[], &before),
            "a is new, b is new, c is new, and 1 more"
        );
    }
}
