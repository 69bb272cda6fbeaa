//! OpenCV's XML: `<opencv_storage>` with an element a value. An element's text is words
//! with blanks between them, several being a sequence; `<_>` are a sequence's elements.

use super::error::{Problem, excerpt};
use super::matrix;
use super::storage::{Entries, MAX_DEPTH, Node, Value};
use roxmltree::Document;

/// Reads a whole file.
pub(super) fn parse(text: &str) -> Result<Entries, Problem> {
    let start = text.len() - text.trim_start().len();
    let first_line = 1 + text[..start].matches('\n').count();
    let text = &text[start..];
    let document = Document::parse(text).map_err(|error| {
        let line = error.pos().row as usize + first_line - 1;
        Problem::new(line, format!("not XML: {error}"))
    })?;
    let reader = Reader {
        text,
        first_line,
        starts: std::iter::once(0)
            .chain(text.match_indices('\n').map(|(at, _)| at + 1))
            .collect(),
    };
    let root = document.root_element();
    let name = root.tag_name().name();
    if name != "opencv_storage" {
        return Err(Problem::new(
            reader.line(&root),
            format!("the XML begins with <{name}>, expected <opencv_storage>"),
        ));
    }
    reader.children(&root, 0)
}

struct Reader<'a> {
    text: &'a str,
    first_line: usize,
    /// Where each line starts.
    starts: Vec<usize>,
}

type Element<'a, 'input> = roxmltree::Node<'a, 'input>;

impl Reader<'_> {
    fn line(&self, element: &Element<'_, '_>) -> usize {
        let at = element.range().start;
        self.first_line + self.starts.partition_point(|&start| start <= at) - 1
    }

    fn children(&self, parent: &Element<'_, '_>, depth: usize) -> Result<Entries, Problem> {
        let mut entries = Entries::new();
        for element in parent.children().filter(Element::is_element) {
            let name = element.tag_name().name().to_owned();
            entries.push((name, self.node(&element, depth + 1)?));
        }
        Ok(entries)
    }

    fn node(&self, element: &Element<'_, '_>, depth: usize) -> Result<Node, Problem> {
        let line = self.line(element);
        if depth > MAX_DEPTH {
            let problem = format!("expected at most {MAX_DEPTH} levels");
            return Err(Problem::new(line, problem));
        }
        let kind = element.attribute("type_id").unwrap_or_default();
        let has_elements = element.children().any(|child| child.is_element());
        if !has_elements {
            return Ok(Node::new(line, self.words(element, kind == "binary")?));
        }
        let stray = element
            .children()
            .filter(Element::is_text)
            .find_map(|t| t.text().filter(|t| !t.trim().is_empty()));
        if let Some(stray) = stray {
            let problem = format!(
                "found {} beside elements in <{}>, expected one or the other",
                excerpt(stray.trim()),
                element.tag_name().name()
            );
            return Err(Problem::new(line, problem));
        }
        let entries = self.children(element, depth)?;
        if entries.iter().all(|(name, _)| name == "_") {
            let nodes = entries.into_iter().map(|(_, node)| node).collect();
            return Ok(Node::new(line, Value::Sequence(nodes)));
        }
        Ok(Node::new(
            line,
            matrix::map(line, matrix::is_type(kind), entries)?,
        ))
    }

    /// An element's text: nothing, a value, or several.
    fn words(&self, element: &Element<'_, '_>, binary: bool) -> Result<Value, Problem> {
        let mut words = Vec::new();
        for child in element.children().filter(Element::is_text) {
            // The text as written: only there is a quoted &quot; not a quotation mark.
            let raw = &self.text[child.range()];
            if binary {
                return Ok(Value::Text(raw.to_owned()));
            }
            split(raw, self.line(&child), &mut words)?;
        }
        Ok(match words.len() {
            0 => Value::Null,
            1 => words.remove(0).value,
            _ => Value::Sequence(words),
        })
    }
}

/// Splits at blanks outside quotation marks.
fn split(raw: &str, mut line: usize, words: &mut Vec<Node>) -> Result<(), Problem> {
    let mut rest = raw;
    loop {
        let trimmed = rest.trim_start();
        line += rest[..rest.len() - trimmed.len()].matches('\n').count();
        if trimmed.is_empty() {
            return Ok(());
        }
        let (value, length) = if let Some(quoted) = trimmed.strip_prefix('"') {
            let end = quoted
                .find('"')
                .ok_or_else(|| Problem::new(line, "a quotation mark is never closed"))?;
            (Value::Text(unescaped(&quoted[..end])), end + 2)
        } else {
            let end = trimmed.find(char::is_whitespace).unwrap_or(trimmed.len());
            (matrix::plain(&unescaped(&trimmed[..end])), end)
        };
        words.push(Node::new(line, value));
        line += trimmed[..length].matches('\n').count();
        rest = &trimmed[length..];
    }
}

fn unescaped(text: &str) -> String {
    if !text.contains('&') {
        return text.to_owned();
    }
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find('&') {
        out.push_str(&rest[..at]);
        rest = &rest[at..];
        let known = rest.find(';').and_then(|end| {
            let c = match &rest[1..end] {
                "lt" => '<',
                "gt" => '>',
                "amp" => '&',
                "quot" => '"',
                "apos" => '\'',
                name => char::from_u32(match name.strip_prefix("#x") {
                    Some(hex) => u32::from_str_radix(hex, 16).ok()?,
                    None => name.strip_prefix('#')?.parse().ok()?,
                })?,
            };
            Some((c, end + 1))
        });
        let (c, length) = known.unwrap_or(('&', 1));
        out.push(c);
        rest = &rest[length..];
    }
    out + rest
}
