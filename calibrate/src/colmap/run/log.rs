//! What COLMAP's programs print, as far as we need it: versions 3.8 to 4, the later with
//! the prefix of Google's logging library before each line.

use super::Step;
use std::collections::BTreeSet;

/// The lines of a log without their prefixes, as in
/// `I20260102 10:00:00.000000 123 mapper.cc:45] text`.
pub(super) fn messages(log: &str) -> impl Iterator<Item = &str> {
    log.lines().map(message)
}

fn message(line: &str) -> &str {
    let has_prefix = line.starts_with(['I', 'W', 'E', 'F'])
        && line.as_bytes().get(1).is_some_and(u8::is_ascii_digit);
    match line.split_once("] ") {
        Some((_, message)) if has_prefix => message,
        _ => line,
    }
}

/// How far a step is according to a line, in parts done and parts in all.
pub(super) fn progress(step: Step, line: &str, photos: u64) -> Option<(u64, u64)> {
    let line = message(line);
    if step == Step::Mapping {
        // `Registering image #7 (4)`, or `(num_reg_frames=4)`.
        let (_, count) = line.strip_prefix("Registering image #")?.split_once('(')?;
        let digits = count.trim_start_matches(|c: char| !c.is_ascii_digit());
        return Some((leading_number(digits)?.min(photos), photos));
    }
    // `Processed file [3/11]`, `Matching image [3/11]`, `Matching block [1/2, 2/2]`.
    let verbs = ["Processed", "Processing", "Matching"];
    if !verbs.iter().any(|verb| line.starts_with(verb)) {
        return None;
    }
    let (inside, _) = line.split_once('[')?.1.split_once(']')?;
    let (mut done, mut total) = (1, 1);
    for part in inside.split(", ") {
        let (at, of) = part.split_once('/')?;
        let (at, of): (u64, u64) = (at.parse().ok()?, of.parse().ok()?);
        done = (done.max(1) - 1) * of + at;
        total *= of;
    }
    (done <= total).then_some((done, total))
}

fn leading_number(text: &str) -> Option<u64> {
    let end = text.find(|c: char| !c.is_ascii_digit());
    text[..end.unwrap_or(text.len())].parse().ok()
}

/// What the first step found in a photo.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// So many features.
    Features(usize),
    /// Nothing, for this reason.
    Error(String),
}

/// The photos that the first step looked at, in the order of their ids: COLMAP counts
/// those without error as it comes by them.
pub(super) fn features(log: &str) -> Vec<(String, Found)> {
    let mut photos: Vec<(String, Found)> = Vec::new();
    let mut name = None;
    for line in messages(log) {
        let Some((key, value)) = line.trim_start().split_once(':') else {
            continue;
        };
        let found = match key {
            "Name" => {
                name = Some(value.trim().to_owned());
                continue;
            }
            "Features" => leading_number(value.trim()).map(|n| Found::Features(n as usize)),
            "ERROR" => Some(Found::Error(value.trim().to_owned())),
            _ => None,
        };
        if let Some(found) = found
            && let Some(name) = name.take()
        {
            photos.push((name, found));
        }
    }
    photos
}

/// The ids of the photos that the mapper tried to place.
pub(super) fn tried(log: &str) -> BTreeSet<u32> {
    let id = |text: &str| u32::try_from(leading_number(text)?).ok();
    let mut ids = BTreeSet::new();
    for line in messages(log) {
        if let Some(rest) = line.strip_prefix("Registering image #") {
            ids.extend(id(rest));
        } else if line.starts_with("Initializing with image pair") {
            ids.extend(line.split('#').skip(1).filter_map(id));
        }
    }
    ids
}

/// Whether the mapper gave up for want of two photos to begin with, or of two more where those it
/// began with led nowhere.
pub(super) fn found_no_pair(log: &str) -> bool {
    messages(log).any(|line| line.contains("No good initial image pair found"))
}

/// Whether a line says that another program writes to the database: SQLite's words.
pub(super) fn is_of_lock(line: &str) -> bool {
    line.contains("database is locked")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_is_told_by_each_program() {
        let features = |line| progress(Step::Features, line, 11);
        assert_eq!(features("Processed file [3/11]"), Some((3, 11)));
        assert_eq!(
            features("I20260102 10:00:00.000000 7 feature.cc:4] Processed file [3/11]"),
            Some((3, 11))
        );
        assert_eq!(features("  Name:   Processed file [3/11]"), None);
        let matching = |line| progress(Step::Matching, line, 11);
        assert_eq!(matching("Matching block [1/3, 2/3] in 2.5s"), Some((2, 9)));
        assert_eq!(matching("Processing block [3/3, 3/3]"), Some((9, 9)));
        assert_eq!(matching("Matching image [7/29] in 0.1s"), Some((7, 29)));
        assert_eq!(matching("Matching block [x/3]"), None);
        let mapping = |line| progress(Step::Mapping, line, 11);
        assert_eq!(mapping("Registering image #7 (4)"), Some((4, 11)));
        assert_eq!(
            mapping("I20260102 1 m.cc:4] Registering image #7 (num_reg_frames=40)"),
            Some((11, 11))
        );
        assert_eq!(
            mapping("=> Could not register, trying another image."),
            None
        );
    }

    #[test]
    fn photos_are_listed_with_what_was_found() {
        let log = "Processed file [1/3]\n  Name:            b: 1.jpg\n  \
                   ERROR: Failed to read image file format.\nProcessed file [2/3]\n\
                   I20260102 1 f.cc:4]   Name:            c.png\n  Camera:          #2 - PINHOLE\n\
                   I20260102 1 f.cc:4]   Features:        17 (SIFT)\nERROR: unrelated\n";
        let error = Found::Error("Failed to read image file format.".to_owned());
        assert_eq!(
            features(log),
            [
                ("b: 1.jpg".to_owned(), error),
                ("c.png".to_owned(), Found::Features(17))
            ]
        );
    }

    #[test]
    fn photos_tried_are_those_of_pairs_and_those_registered() {
        let log = "Initializing with image pair #4 and #17\nRegistering image #9 (3)\n\
                   => Could not register\nI20260102 1 m.cc:4] Registering image #2 (3)\n";
        assert_eq!(tried(log), BTreeSet::from([2, 4, 9, 17]));
    }
}
