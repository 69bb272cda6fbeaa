//! Flow style: `[ … ]`, `{ … }` and quoted text.

use super::super::error::Problem;
use super::super::matrix;
use super::super::storage::{Entries, Node, Value};
use super::cursor::Reader;

impl<'a> Reader<'a> {
    /// `[ … ]`, `{ … }`, quoted text, or a word within the former.
    pub(super) fn flow(&mut self, marked: bool, depth: usize) -> Result<Node, Problem> {
        self.check_depth(depth)?;
        let line = self.line;
        let value = match self.peek() {
            Some('[') => {
                let mut nodes = Vec::new();
                self.items(']', |reader| {
                    nodes.push(reader.flow(false, depth + 1)?);
                    Ok(())
                })?;
                Value::Sequence(nodes)
            }
            Some('{') => {
                let mut entries = Entries::new();
                self.items('}', |reader| {
                    let key = reader.flow_key()?;
                    reader.skip_blanks();
                    entries.push((key, reader.flow(false, depth + 1)?));
                    Ok(())
                })?;
                matrix::map(line, marked, entries)?
            }
            Some('"') => Value::Text(self.double_quoted()?),
            Some('\'') => Value::Text(self.single_quoted()?),
            _ => {
                let word = self.plain_before([',', ']', '}', '\n']);
                self.at += word.len();
                match word.trim_end() {
                    "" => return Err(self.unexpected("a value")),
                    "~" | "null" => Value::Null,
                    word => matrix::plain(word),
                }
            }
        };
        Ok(Node::new(line, value))
    }

    fn flow_key(&mut self) -> Result<String, Problem> {
        let key = match self.peek() {
            Some('"') => self.double_quoted()?,
            Some('\'') => self.single_quoted()?,
            _ => {
                let word = self.plain_before([':', ',', ']', '}', '\n']);
                self.at += word.len();
                word.trim_end().to_owned()
            }
        };
        self.skip_spaces();
        if self.peek() != Some(':') {
            return Err(self.unexpected(&format!("a colon after the name {key:?}")));
        }
        self.at += 1;
        Ok(key)
    }

    /// What stands before the first of some characters and a comment. Not `rest_of_line`: a matrix
    /// or a map may stand on one long line.
    fn plain_before<const N: usize>(&self, ends: [char; N]) -> &'a str {
        let word = self.rest();
        let word = &word[..word.find(ends).unwrap_or(word.len())];
        word.split(" #").next().unwrap_or_default()
    }

    /// Steps over the bracket, items with commas between them, and the closing bracket.
    fn items(
        &mut self,
        close: char,
        mut item: impl FnMut(&mut Self) -> Result<(), Problem>,
    ) -> Result<(), Problem> {
        self.bump();
        loop {
            self.skip_blanks();
            if self.peek() == Some(close) {
                self.bump();
                return Ok(());
            }
            item(self)?;
            self.skip_blanks();
            match self.peek() {
                Some(',') => self.bump(),
                Some(c) if c == close => None,
                _ => return Err(self.unexpected(&format!("a comma or {close}"))),
            };
        }
    }

    fn double_quoted(&mut self) -> Result<String, Problem> {
        let line = self.line;
        let unfinished = || Problem::new(line, "a quotation mark is never closed");
        self.bump();
        let mut text = String::new();
        loop {
            match self.bump().ok_or_else(unfinished)? {
                '"' => return Ok(text),
                '\\' => match self.bump().ok_or_else(unfinished)? {
                    'n' => text.push('\n'),
                    'r' => text.push('\r'),
                    't' => text.push('\t'),
                    'x' => {
                        let code = self.rest().get(..2);
                        let code = code.and_then(|hex| u8::from_str_radix(hex, 16).ok());
                        let code = code.ok_or_else(|| self.unexpected("two digits after \\x"))?;
                        self.at += 2;
                        text.push(char::from(code));
                    }
                    other => text.push(other),
                },
                c => text.push(c),
            }
        }
    }

    fn single_quoted(&mut self) -> Result<String, Problem> {
        let line = self.line;
        self.bump();
        let mut text = String::new();
        loop {
            match self.bump() {
                Some('\'') if self.peek() == Some('\'') => {
                    self.bump();
                    text.push('\'');
                }
                Some('\'') => return Ok(text),
                Some(c) => text.push(c),
                None => return Err(Problem::new(line, "a quotation mark is never closed")),
            }
        }
    }
}
