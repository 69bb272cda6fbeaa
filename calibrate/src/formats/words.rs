//! A text file as a stream of words, each known by its line.

use super::error::{FormatError, Problem};
use crate::excerpt::excerpt;
use std::path::Path;
use std::str::FromStr;

/// How many characters of a word messages show: what is no number may be a whole file.
pub(super) const WORD: usize = 40;
/// And of a line.
pub(super) const LINE: usize = 80;

/// The words that have not been read yet.
#[derive(Clone)]
pub(super) struct Words<'a> {
    path: &'a Path,
    lines: std::iter::Enumerate<capture::Lines<'a>>,
    words: std::str::SplitWhitespace<'a>,
    line_idx: usize,
}

impl<'a> Words<'a> {
    pub(super) fn new(path: &'a Path, text: &'a str) -> Self {
        Self {
            path,
            lines: capture::lines(text).enumerate(),
            words: "".split_whitespace(),
            line_idx: 0,
        }
    }

    /// The next line, whatever is left of the one begun; `None` after the last.
    pub(super) fn line(&mut self) -> Option<&'a str> {
        let (line_idx, line) = self.lines.next()?;
        self.line_idx = line_idx;
        self.words = "".split_whitespace();
        Some(line)
    }

    /// The next word of the file, on whichever line.
    pub(super) fn next(&mut self) -> Option<&'a str> {
        loop {
            if let Some(word) = self.words.next() {
                return Some(word);
            }
            let line = self.line()?;
            self.words = line.split_whitespace();
        }
    }

    /// Where the last word or line was.
    pub(super) fn place(&self, of: &str) -> String {
        format!("line {} ({of})", self.line_idx + 1)
    }

    /// A problem with the last word or line.
    pub(super) fn error(&self, of: &str, problem: Problem) -> FormatError {
        problem.at(self.path, self.place(of))
    }

    /// The next word as a value; `of` and `what` name the record and the value in errors.
    pub(super) fn parse<T: FromStr>(&mut self, of: &str, what: &str) -> Result<T, FormatError> {
        let Some(word) = self.next() else {
            return Err(self.error(
                of,
                Problem::broken(format!("the file ends, expected {what}")),
            ));
        };
        word.parse().map_err(|_| {
            self.error(
                of,
                Problem::broken(format!("found {}, expected {what}", excerpt(word, WORD))),
            )
        })
    }

    /// The next words as finite numbers.
    pub(super) fn numbers<const N: usize>(
        &mut self,
        of: &str,
        what: &str,
    ) -> Result<[f64; N], FormatError> {
        let mut numbers = [0.0_f64; N];
        for number in &mut numbers {
            *number = self.parse(of, what)?;
            if !number.is_finite() {
                let problem = format!("found {number} in {what}, expected finite numbers");
                return Err(self.error(of, Problem::broken(problem)));
            }
        }
        Ok(numbers)
    }

    /// The next three words as a colour, rounded and clamped to bytes.
    pub(super) fn color(&mut self, of: &str) -> Result<[u8; 3], FormatError> {
        let color: [f64; 3] = self.numbers(of, "a colour of three numbers")?;
        Ok(color.map(|value| value.round().clamp(0.0, 255.0) as u8))
    }
}
