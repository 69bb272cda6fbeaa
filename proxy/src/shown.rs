//! Names as messages show them.

/// A name out of a file as messages show it: characters that end a line, or command a terminal, are spelled out
/// (`\n`, `\u{1b}`).
pub fn shown_name(name: &str) -> String {
    let mut shown = String::with_capacity(name.len());
    for c in name.chars() {
        match c.is_control() {
            true => shown.extend(c.escape_default()),
            false => shown.push(c),
        }
    }
    shown
}
