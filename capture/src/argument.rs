//! Paths as command lines take them.

use std::path::{MAIN_SEPARATOR, Path};

/// A path as a shell takes it for one argument, for commands that messages suggest: between single quotes where
/// white space is in it, or what shells do not read as it is.
pub fn as_argument(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| match c.is_ascii() {
        true => c.is_ascii_alphanumeric() || c == MAIN_SEPARATOR || "/._-+=:,@%".contains(c),
        false => !c.is_whitespace(),
    };
    match !text.is_empty() && text.chars().all(is_plain) {
        true => text,
        false => format!("'{}'", text.replace('\'', r"'\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_shells_read_otherwise_is_quoted() {
        for (path, expected) in [
            ("wall/images", "wall/images"),
            ("../Süd_4-b.d", "../Süd_4-b.d"),
            ("images/cam 1", "'images/cam 1'"),
            ("a\u{a0}b", "'a\u{a0}b'"),
            ("$HOME", "'$HOME'"),
            ("~a", "'~a'"),
            ("Anna's", r"'Anna'\''s'"),
            ("", "''"),
        ] {
            assert_eq!(as_argument(Path::new(path)), expected);
        }
    }
}
