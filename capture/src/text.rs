//! Text as editors leave it.

/// What is left of a text file's content without the byte order mark that some editors put first.
pub fn without_byte_order_mark(content: &[u8]) -> &[u8] {
    content.strip_prefix(b"\xef\xbb\xbf").unwrap_or(content)
}

#[cfg(test)]
mod tests {
    use super::without_byte_order_mark as without;

    #[test]
    fn a_mark_is_none_of_the_text() {
        assert_eq!(without("\u{feff}{}".as_bytes()), b"{}");
        assert_eq!(without("{}\u{feff}".as_bytes()), "{}\u{feff}".as_bytes());
        assert_eq!(without(b"\xef\xbb"), b"\xef\xbb");
        assert_eq!(without(b""), b"");
    }
}
