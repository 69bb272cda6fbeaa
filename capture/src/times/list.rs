//! Times in a file: `name,seconds` a line.

use crate::lines;
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Why a list of times cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TimeListError {
    /// The file cannot be read.
    #[error("{}: cannot read the times: {source}; check the path", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file is no text, or one in another encoding: of some programs UTF-16.
    #[error("{}: the times are not in UTF-8; save the list as UTF-8", .0.display())]
    NotUtf8(PathBuf),
    /// A line is not what it should be.
    #[error("{}, line {line}: {problem}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// From 1.
        line: usize,
        /// What was found, what was expected, and what to do.
        problem: String,
    },
    /// No line names a photo.
    #[error(
        "{}: no photo has a time here; expected lines such as a.jpg,12.5 (name,seconds)",
        .0.display()
    )]
    Empty(PathBuf),
}

/// Reads seconds by photo from a file of lines `name,seconds`. The first line may be a
/// header; empty lines and those that begin with `#` are passed over. Both fields may be
/// in double quotes.
///
/// # Errors
/// A file that cannot be read or holds no time; a line that is not a name and a finite
/// number, a photo for which `is_photo` is false, or one that came before.
pub fn read_times(
    path: &Path,
    is_photo: impl Fn(&str) -> bool,
) -> Result<BTreeMap<String, f64>, TimeListError> {
    let bytes = fs::read(path).map_err(|source| TimeListError::Read {
        path: path.to_owned(),
        source,
    })?;
    let text = String::from_utf8(bytes).map_err(|_| TimeListError::NotUtf8(path.to_owned()))?;
    let mut times: BTreeMap<String, f64> = BTreeMap::new();
    let mut line_of: BTreeMap<String, usize> = BTreeMap::new();
    let mut is_first = true;
    for (line, content) in (1..).zip(lines(text.trim_start_matches('\u{feff}'))) {
        let content = content.trim();
        if content.is_empty() || content.starts_with('#') {
            continue;
        }
        let may_be_header = std::mem::take(&mut is_first);
        let refuse = |problem: String| TimeListError::Line {
            path: path.to_owned(),
            line,
            problem,
        };
        let fields = content.rsplit_once(',');
        let fields = fields.map(|(name, seconds)| (unquoted(name), unquoted(seconds)));
        if !fields.as_ref().is_some_and(|(name, _)| is_photo(name))
            && let Some(separator) = other_separator(content, &is_photo)
        {
            return Err(refuse(format!(
                "name and seconds are separated by a {separator}; expected a comma, and a point in \
                 numbers, as in a.jpg,12.5: save the list anew, or replace them"
            )));
        }
        let Some((name, seconds)) = fields else {
            let problem = format!("found {content:?}; expected name,seconds, as in a.jpg,12.5");
            return Err(refuse(problem));
        };
        let time_s = match seconds.trim().parse::<f64>() {
            Ok(time_s) if time_s.is_finite() => time_s,
            Err(_) if may_be_header && !is_photo(&name) => continue,
            _ => {
                let problem = format!("the time of {name} is {seconds:?}; expected seconds");
                return Err(refuse(problem));
            }
        };
        if !is_photo(&name) {
            return Err(refuse(format!(
                "there is no photo {name}; names are paths within the photo folder"
            )));
        }
        if let Some(before) = line_of.insert(name.clone(), line) {
            let problem = format!("photo {name} has a time on line {before} already; keep one");
            return Err(refuse(problem));
        }
        times.insert(name, time_s);
    }
    if times.is_empty() {
        return Err(TimeListError::Empty(path.to_owned()));
    }
    Ok(times)
}

/// A field without blanks around it and the quotes that it may be in.
fn unquoted(field: &str) -> String {
    let field = field.trim();
    let within = field.strip_prefix('"').and_then(|f| f.strip_suffix('"'));
    within.map_or_else(|| field.to_owned(), |f| f.replace("\"\"", "\""))
}

/// What a line has between a photo's name and the rest if that is no comma: spreadsheets write
/// semicolons where numbers have decimal commas, or tabs.
fn other_separator(line: &str, is_photo: &impl Fn(&str) -> bool) -> Option<&'static str> {
    let others = [(';', "semicolon"), ('\t', "tab")];
    let stands_behind_name = |separator: char| {
        let fields = line.split_once(separator);
        fields.is_some_and(|(name, _)| is_photo(&unquoted(name)))
    };
    let found = others
        .into_iter()
        .find(|(separator, _)| stands_behind_name(*separator));
    found.map(|(_, name)| name)
}
