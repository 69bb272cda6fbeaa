//! OpenCV's JSON: with comments (`//`, `/* */`) and unquoted `.Nan` and `.Inf`.

use super::error::{Problem, excerpt};
use super::matrix;
use super::storage::{Entries, MAX_DEPTH, Node, Value};

/// Reads a whole file, which must be one object.
pub(super) fn parse(text: &str) -> Result<Entries, Problem> {
    let mut reader = Reader {
        text,
        at: 0,
        line: 1,
    };
    reader.skip_blanks()?;
    let node = reader.value(0)?;
    reader.skip_blanks()?;
    if reader.peek().is_some() {
        return Err(reader.unexpected("the end of the file"));
    }
    match node.value {
        Value::Map(entries) => Ok(entries),
        _ => Err(Problem::new(
            node.line,
            "expected names and values, {\"name\": …}",
        )),
    }
}

struct Reader<'a> {
    text: &'a str,
    at: usize,
    line: usize,
}

impl<'a> Reader<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    fn bump(&mut self) -> Option<char> {
        let c = self.peek()?;
        self.at += c.len_utf8();
        self.line += usize::from(c == '\n');
        Some(c)
    }

    fn unexpected(&self, expected: &str) -> Problem {
        let found = match self.rest().trim() {
            "" => "the file ends".to_owned(),
            rest => format!("found {}", excerpt(rest)),
        };
        Problem::new(self.line, format!("{found}, expected {expected}"))
    }

    /// Skips blanks and comments.
    fn skip_blanks(&mut self) -> Result<(), Problem> {
        loop {
            let rest = self.rest();
            if rest.starts_with("//") {
                self.at += rest.find('\n').unwrap_or(rest.len());
            } else if let Some(inner) = rest.strip_prefix("/*") {
                let Some(length) = inner.find("*/") else {
                    return Err(self.unexpected("the comment's end, */"));
                };
                let comment = &rest[..length + 4];
                self.line += comment.matches('\n').count();
                self.at += comment.len();
            } else if rest.starts_with(char::is_whitespace) {
                self.bump();
            } else {
                return Ok(());
            }
        }
    }

    fn value(&mut self, depth: usize) -> Result<Node, Problem> {
        let line = self.line;
        if depth > MAX_DEPTH {
            return Err(self.unexpected(&format!("at most {MAX_DEPTH} levels")));
        }
        let value = match self.peek() {
            Some('{') => self.object(depth)?,
            Some('[') => self.array(depth)?,
            Some('"') => Value::Text(self.string()?),
            _ => {
                let end = |c: char| ",]}:/\"[{".contains(c) || c.is_whitespace();
                let word = self.rest();
                let word = &word[..word.find(end).unwrap_or(word.len())];
                let value = match word {
                    "true" => Value::Int(1),
                    "false" => Value::Int(0),
                    "null" => Value::Null,
                    _ => matrix::plain(word),
                };
                if matches!(value, Value::Text(_)) {
                    return Err(self.unexpected("a value"));
                }
                self.at += word.len();
                value
            }
        };
        Ok(Node::new(line, value))
    }

    fn object(&mut self, depth: usize) -> Result<Value, Problem> {
        let line = self.line;
        let mut entries = Entries::new();
        let mut marked = false;
        self.items('}', |reader| {
            if reader.peek() != Some('"') {
                return Err(reader.unexpected("a name in quotation marks, or }"));
            }
            let key = reader.string()?;
            reader.skip_blanks()?;
            if reader.peek() != Some(':') {
                return Err(reader.unexpected(&format!("a colon after the name {key:?}")));
            }
            reader.bump();
            reader.skip_blanks()?;
            let node = reader.value(depth + 1)?;
            if key == "type_id" {
                marked |= node.text().is_some_and(matrix::is_type);
            } else {
                entries.push((key, node));
            }
            Ok(())
        })?;
        matrix::map(line, marked, entries)
    }

    fn array(&mut self, depth: usize) -> Result<Value, Problem> {
        let mut nodes = Vec::new();
        self.items(']', |reader| {
            nodes.push(reader.value(depth + 1)?);
            Ok(())
        })?;
        Ok(Value::Sequence(nodes))
    }

    /// Steps over the bracket, items with commas between them, and the closing bracket.
    fn items(
        &mut self,
        close: char,
        mut item: impl FnMut(&mut Self) -> Result<(), Problem>,
    ) -> Result<(), Problem> {
        self.bump();
        loop {
            self.skip_blanks()?;
            if self.peek() == Some(close) {
                self.bump();
                return Ok(());
            }
            item(self)?;
            self.skip_blanks()?;
            match self.peek() {
                Some(',') => self.bump(),
                Some(c) if c == close => None,
                _ => return Err(self.unexpected(&format!("a comma or {close}"))),
            };
        }
    }

    fn string(&mut self) -> Result<String, Problem> {
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
                    'b' => text.push('\u{8}'),
                    'f' => text.push('\u{c}'),
                    'u' => {
                        let code = self.rest().get(..4);
                        let code = code.and_then(|hex| u32::from_str_radix(hex, 16).ok());
                        let code = code.ok_or_else(|| self.unexpected("four digits after \\u"))?;
                        self.at += 4;
                        text.push(char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER));
                    }
                    other => text.push(other),
                },
                c => text.push(c),
            }
        }
    }
}
