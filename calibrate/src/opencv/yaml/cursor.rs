//! Where a reader of YAML is in its text: lines, columns, blanks, and what is wrong there.

use super::super::error::{Problem, excerpt};
use super::super::storage::MAX_DEPTH;

#[derive(Clone, Copy)]
pub(super) struct Reader<'a> {
    text: &'a str,
    pub(super) at: usize,
    pub(super) line: usize,
    line_start: usize,
}

impl<'a> Reader<'a> {
    /// At the start of a text.
    pub(super) fn new(text: &'a str) -> Self {
        Self {
            text,
            at: 0,
            line: 1,
            line_start: 0,
        }
    }

    pub(super) fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    pub(super) fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    pub(super) fn column(&self) -> usize {
        self.at - self.line_start
    }

    /// What is left of this line, without its end and a comment.
    pub(super) fn rest_of_line(&self) -> &'a str {
        let rest = self.rest();
        let line = &rest[..rest.find('\n').unwrap_or(rest.len())];
        let comment = line
            .match_indices('#')
            .map(|(at, _)| at)
            .find(|&at| at == 0 || line[..at].ends_with([' ', '\t']));
        line[..comment.unwrap_or(line.len())].trim_end()
    }

    pub(super) fn bump(&mut self) -> Option<char> {
        let c = self.peek()?;
        self.at += c.len_utf8();
        if c == '\n' {
            self.line += 1;
            self.line_start = self.at;
        }
        Some(c)
    }

    /// Skips to the next line.
    pub(super) fn skip_line(&mut self) {
        while self.bump().is_some_and(|c| c != '\n') {}
    }

    /// Skips blanks within the line.
    pub(super) fn skip_spaces(&mut self) {
        while self.rest().starts_with([' ', '\t']) {
            self.at += 1;
        }
    }

    /// Skips blanks, line ends and comments.
    pub(super) fn skip_blanks(&mut self) {
        while let Some(c) = self.peek() {
            if c == '#' {
                self.skip_line();
            } else if c.is_whitespace() {
                self.bump();
            } else {
                return;
            }
        }
    }

    /// At `---` or `...` at the start of a line.
    pub(super) fn at_document_mark(&self) -> bool {
        let mark = self.rest().get(..3);
        self.column() == 0
            && matches!(mark, Some("---" | "..."))
            && self.rest()[3..]
                .chars()
                .next()
                .is_none_or(char::is_whitespace)
    }

    /// At the end of the document.
    pub(super) fn at_end(&self) -> bool {
        self.peek().is_none() || self.at_document_mark()
    }

    pub(super) fn at_dash(&self) -> bool {
        let mut chars = self.rest().chars();
        chars.next() == Some('-') && chars.next().is_none_or(char::is_whitespace)
    }

    pub(super) fn unexpected(&self, expected: &str) -> Problem {
        let found = match self.rest().trim() {
            "" => "the file ends".to_owned(),
            rest => format!("found {}", excerpt(rest)),
        };
        Problem::new(self.line, format!("{found}, expected {expected}"))
    }

    pub(super) fn check_depth(&self, depth: usize) -> Result<(), Problem> {
        if depth > MAX_DEPTH {
            return Err(self.unexpected(&format!("at most {MAX_DEPTH} levels")));
        }
        Ok(())
    }
}
