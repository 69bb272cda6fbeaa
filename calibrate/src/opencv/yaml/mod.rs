//! OpenCV's YAML, and what people make of it by hand.
//!
//! A reader of its own because such files are often not YAML: `%YAML:1.0` is followed by
//! no `---`, and colons by no blank (`Viewer.PointSize:2`, `data:[ 1, 2 ]`); OpenCV takes
//! both. Read is the first document: maps, sequences, scalars, in block and in flow
//! style, tags; not aliases.

mod cursor;
mod flow;

use super::error::Problem;
use super::matrix;
use super::storage::{Entries, Node, Value};
use cursor::Reader;

/// Reads a whole file, which must be a map.
pub(super) fn parse(text: &str) -> Result<Entries, Problem> {
    let mut reader = Reader::new(text);
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

/// Block style.
impl Reader<'_> {
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
            marked |= tag.strip_prefix("!!").is_some_and(matrix::is_type);
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
}
