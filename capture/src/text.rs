//! Text as editors leave it.

/// What is left of a text file's content without the byte order mark that some editors put first.
pub fn without_byte_order_mark(content: &[u8]) -> &[u8] {
    content.strip_prefix(b"\xef\xbb\xbf").unwrap_or(content)
}

/// What may end a line: a return alone on old Macs, two returns where a line's end was translated twice.
const LINE_ENDS: [&[u8]; 4] = [b"\n", b"\r\n", b"\r\r\n", b"\r"];

/// The lines of a text, as [`str::lines`] has them, that may end as on any computer, in one way here and in another
/// there.
pub fn lines(text: &str) -> Lines<'_> {
    Lines(text)
}

/// What [`lines`] gives.
#[derive(Clone, Debug)]
pub struct Lines<'a>(&'a str);

impl<'a> Iterator for Lines<'a> {
    type Item = &'a str;

    fn next(&mut self) -> Option<&'a str> {
        let (end, next) = line_end(self.0.as_bytes())?;
        let line = &self.0[..end];
        self.0 = &self.0[next..];
        Some(line)
    }
}

/// As [`lines`], of a file that may be in any encoding.
pub fn byte_lines(content: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = content;
    std::iter::from_fn(move || {
        let (end, next) = line_end(rest)?;
        let line = &rest[..end];
        rest = &rest[next..];
        Some(line)
    })
}

/// Where a text's first line ends, and where the next begins; `None` of an empty text.
fn line_end(text: &[u8]) -> Option<(usize, usize)> {
    let is_end = |byte: &u8| matches!(byte, b'\n' | b'\r');
    let end = text.iter().position(is_end).unwrap_or(text.len());
    let line_end = LINE_ENDS.iter().find(|by| text[end..].starts_with(by));
    (!text.is_empty()).then(|| (end, end + line_end.map_or(0, |by| by.len())))
}

#[cfg(test)]
mod tests {
    use super::without_byte_order_mark as without;
    use super::{byte_lines, lines};

    #[test]
    fn a_mark_is_none_of_the_text() {
        assert_eq!(without("\u{feff}{}".as_bytes()), b"{}");
        assert_eq!(without("{}\u{feff}".as_bytes()), "{}\u{feff}".as_bytes());
        assert_eq!(without(b"\xef\xbb"), b"\xef\xbb");
        assert_eq!(without(b""), b"");
    }

    #[test]
    fn lines_end_as_on_any_computer() {
        for text in ["", "a", "a\n", "a\n\nb", "\n", "\r\n", "ä\r\n\r\nb\r\n"] {
            let expected: Vec<&str> = text.lines().collect();
            assert_eq!(lines(text).collect::<Vec<_>>(), expected, "{text:?}");
        }
        for (text, expected) in [
            ("a\rb\r", &["a", "b"][..]),
            ("a\r\rb", &["a", "", "b"][..]),
            ("a\r\r\nb\r\r\n", &["a", "b"][..]),
            ("# ä\na\rb\r\nc", &["# ä", "a", "b", "c"][..]),
        ] {
            assert_eq!(lines(text).collect::<Vec<_>>(), expected, "{text:?}");
            let bytes = byte_lines(text.as_bytes());
            assert!(bytes.eq(expected.iter().map(|line| line.as_bytes())));
        }
    }
}
