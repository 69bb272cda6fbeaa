//! OpenCV's YAML, and what people make of it by hand.
//!
//! A reader of its own because such files are often not YAML: `%YAML:1.0` is followed by
//! no `---`, and colons by no blank (`Viewer.PointSize:2`, `data:[ 1, 2 ]`); OpenCV takes
//! both. Read is the first document: maps, sequences, scalars, in block and in flow
//! style, tags; not aliases.

use super::error::{Problem, excerpt};
use super::matrix;
use super::storage::{Entries, MAX_DEPTH, Node, Value};

/// Reads a whole file, which must be a map.
pub(super) fn parse(text: &str) -> Result<Entries, Problem> {
    let mut reader = Reader {
        text,
        at: 0,
        line: 1,
        line_start: 0,
    };
    // 1. The header.
    reader.skip_blanks();
    while reader.peek() == Some('%') {
        reader.skip_line();
        reader.skip_blanks();
    }
    if reader.at_document_mark() && reader.rest().starts_with("---") {
        reader.at += 3;
    }
    // 2. The first document.
    let node = reader.block(0, 0)?;
    reader.skip_blanks();
    if !reader.at_end() {
        return Err(reader.unexpected("a name at the start of a line"));
    }
    match node.value {
        Value::Map(entries) => Ok(entries),
        Value::Null => Err(Problem::new(node.line, "the file holds no values")),
        _ => Err(Problem::new(
            node.line,
            "expected names and values, `name: value`",
        )),
    }
}

#[derive(Clone, Copy)]
struct Reader<'a> {
    text: &'a str,
    at: usize,
    line: usize,
    line_start: usize,
}

impl<'a> Reader<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    fn column(&self) -> usize {
        self.at - self.line_start
    }

    /// What is left of this line, without its end and a comment.
    fn rest_of_line(&self) -> &'a str {
        let rest = self.rest();
        let line = &rest[..rest.find('\n').unwrap_or(rest.len())];
        let comment = line
            .match_indices('#')
            .map(|(at, _)| at)
            .find(|&at| at == 0 || line[..at].ends_with([' ', '\t']));
        line[..comment.unwrap_or(line.len())].trim_end()
    }

    fn bump(&mut self) -> Option<char> {
        let c = self.peek()?;
        self.at += c.len_utf8();
        if c == '\n' {
            self.line += 1;
            self.line_start = self.at;
        }
        Some(c)
    }

    /// Skips to the next line.
    fn skip_line(&mut self) {
        while self.bump().is_some_and(|c| c != '\n') {}
    }

    /// Skips blanks within the line.
    fn skip_spaces(&mut self) {
        while self.rest().starts_with([' ', '\t']) {
            self.at += 1;
        }
    }

    /// Skips blanks, line ends and comments.
    fn skip_blanks(&mut self) {
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
    fn at_document_mark(&self) -> bool {
        let mark = self.rest().get(..3);
        self.column() == 0
            && matches!(mark, Some("---" | "..."))
            && self.rest()[3..]
                .chars()
                .next()
                .is_none_or(char::is_whitespace)
    }

    /// At the end of the document.
    fn at_end(&self) -> bool {
        self.peek().is_none() || self.at_document_mark()
    }

    fn at_dash(&self) -> bool {
        let mut chars = self.rest().chars();
        chars.next() == Some('-') && chars.next().is_none_or(char::is_whitespace)
    }

    fn unexpected(&self, expected: &str) -> Problem {
        let found = match self.rest().trim() {
            "" => "the file ends".to_owned(),
            rest => format!("found {}", excerpt(rest)),
        };
        Problem::new(self.line, format!("{found}, expected {expected}"))
    }

    fn check_depth(&self, depth: usize) -> Result<(), Problem> {
        if depth > MAX_DEPTH {
            return Err(self.unexpected(&format!("at most {MAX_DEPTH} levels")));
        }
        Ok(())
    }

    /// A value that begins on a line of its own at `least` columns or more; nothing where
    /// the next line is less indented.
    fn block(&mut self, least: usize, depth: usize) -> Result<Node, Problem> {
        self.skip_blanks();
        let line = self.line;
        if self.at_end() || self.column() < least {
            return Ok(Node::new(line, Value::Null));
        }
        self.check_depth(depth)?;
        if self.at_dash() {
            return self.sequence(self.column(), depth);
        }
        if self.key(true).is_some() {
            let entries = self.map(self.column(), depth)?;
            return Ok(Node::new(line, matrix::map(line, false, entries)?));
        }
        self.value(least.saturating_sub(1), false, depth)
    }

    /// The items of a block sequence whose dashes stand in a column.
    fn sequence(&mut self, column: usize, depth: usize) -> Result<Node, Problem> {
        let line = self.line;
        let mut nodes = Vec::new();
        loop {
            self.skip_blanks();
            if self.at_end() || self.column() < column || !self.at_dash() {
                return Ok(Node::new(line, Value::Sequence(nodes)));
            }
            if self.column() > column {
                return Err(self.unexpected("a dash below the one above"));
            }
            self.at += 1;
            nodes.push(self.value(column, true, depth + 1)?);
        }
    }

    /// The entries of a block map whose names begin in a column.
    fn map(&mut self, column: usize, depth: usize) -> Result<Entries, Problem> {
        let mut entries = Entries::new();
        loop {
            self.skip_blanks();
            if self.at_end() || self.column() < column {
                return Ok(entries);
            }
            if self.column() > column {
                return Err(self.unexpected("a name below the one above (check the indentation)"));
            }
            let Some((key, length)) = self.key(true) else {
                return Err(self.unexpected("a name and a colon"));
            };
            self.at += length;
            entries.push((key, self.value(column, false, depth + 1)?));
        }
    }

    /// The name here and its length up to and with the colon. A colon with a blank or a
    /// bracket behind it is a name's; any other only where a name must be (`loose`).
    fn key(&self, loose: bool) -> Option<(String, usize)> {
        let line = self.rest_of_line();
        if let Some(quote) = line.chars().next().filter(|c| matches!(c, '"' | '\'')) {
            let end = 1 + line[1..].find(quote)?;
            let behind = &line[end + 1..];
            let gap = behind.len() - behind.trim_start().len();
            let colon = behind[gap..].starts_with(':');
            return colon.then(|| (line[1..end].to_owned(), end + 1 + gap + 1));
        }
        if line.starts_with(['[', '{', '|', '>', '!']) {
            return None;
        }
        let clear = |&(at, _): &(usize, &str)| {
            line[at + 1..].is_empty()
                || line[at + 1..].starts_with([' ', '\t', '[', '{', '"', '\''])
        };
        let mut colons = line.match_indices(':');
        let colon = colons.clone().find(clear);
        let (at, _) = colon.or_else(|| colons.next().filter(|_| loose))?;
        Some((line[..at].trim_end().to_owned(), at + 1))
    }

    /// The value behind a name's colon or a dash, whose own column is `parent`.
    fn value(&mut self, parent: usize, in_sequence: bool, depth: usize) -> Result<Node, Problem> {
        self.check_depth(depth)?;
        let line = self.line;
        // 1. Tags, of which only the matrix' matters, and anchors.
        let mut marked = false;
        self.skip_spaces();
        while let Some('!' | '&') = self.peek() {
            let rest = self.rest();
            let tag = &rest[..rest.find(char::is_whitespace).unwrap_or(rest.len())];
            marked |= tag == "!!opencv-matrix";
            self.at += tag.len();
            self.skip_spaces();
        }
        // 2. On the lines below.
        if self.rest_of_line().is_empty() {
            self.skip_blanks();
            // A sequence may stand right below the name it belongs to.
            let below = !in_sequence && self.at_dash() && self.column() == parent;
            let least = if below { parent } else { parent + 1 };
            if marked {
                let entries = if self.at_end() || self.column() < least {
                    Entries::new()
                } else {
                    self.map(self.column(), depth)?
                };
                return Ok(Node::new(line, matrix::map(line, true, entries)?));
            }
            return self.block(least, depth + 1);
        }
        // 3. Here.
        if in_sequence && self.at_dash() {
            return self.sequence(self.column(), depth);
        }
        if in_sequence && self.key(false).is_some() {
            let entries = self.map(self.column(), depth)?;
            return Ok(Node::new(line, matrix::map(line, marked, entries)?));
        }
        let value = match self.peek() {
            Some('|' | '>') => return Ok(Node::new(line, self.block_text(parent))),
            Some('[' | '{' | '"' | '\'') => self.flow(marked, depth)?.value,
            Some('*') => return Err(self.unexpected("a value (aliases are not read)")),
            _ => return Ok(Node::new(line, self.plain(parent))),
        };
        if !self.rest_of_line().is_empty() {
            return Err(self.unexpected("the end of the line"));
        }
        Ok(Node::new(line, value))
    }

    /// An unquoted scalar. Its text goes on in lines that are indented more and are no
    /// names.
    fn plain(&mut self, parent: usize) -> Value {
        let first = self.rest_of_line();
        self.at += first.len();
        let mut text = first.to_owned();
        loop {
            let mut ahead = *self;
            ahead.skip_blanks();
            if ahead.at_end()
                || ahead.column() <= parent
                || ahead.at_dash()
                || ahead.key(true).is_some()
            {
                break;
            }
            *self = ahead;
            let more = self.rest_of_line();
            self.at += more.len();
            text.push(' ');
            text.push_str(more);
        }
        match text.as_str() {
            "~" | "null" => Value::Null,
            word => matrix::plain(word),
        }
    }

    /// The lines behind `|` or `>`, as long as they are indented more than `parent`.
    fn block_text(&mut self, parent: usize) -> Value {
        self.skip_line();
        let mut text = String::new();
        while self.peek().is_some() {
            let rest = self.rest();
            let line = &rest[..rest.find('\n').unwrap_or(rest.len())];
            let content = line.trim();
            let indent = line.len() - line.trim_start().len();
            if !content.is_empty() && indent <= parent {
                break;
            }
            text.push_str(content);
            text.push('\n');
            self.skip_line();
        }
        Value::Text(text.trim_end().to_owned())
    }

    /// `[ … ]`, `{ … }`, quoted text, or a word within the former.
    fn flow(&mut self, marked: bool, depth: usize) -> Result<Node, Problem> {
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
                // Not `rest_of_line`: a matrix may stand on one long line.
                let word = self.rest();
                let word = &word[..word.find([',', ']', '}', '\n']).unwrap_or(word.len())];
                let word = word.split(" #").next().unwrap_or_default();
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
                let line = self.rest_of_line();
                let word = &line[..line.find([':', ',', ']', '}']).unwrap_or(line.len())];
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
