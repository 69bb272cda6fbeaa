//! Pieces of what is read, for messages.

/// The beginning of a text in quotation marks: at most so many characters.
pub(crate) fn excerpt(text: &str, most: usize) -> String {
    let mut shown: String = text.chars().take(most).collect();
    if shown.len() < text.len() {
        shown.push('…');
    }
    format!("{shown:?}")
}
