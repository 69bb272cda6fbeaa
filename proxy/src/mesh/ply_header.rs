//! The header of a PLY file.

use super::obj::shown;

/// How the numbers after the header are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Ascii,
    Little,
    Big,
}

/// A number's type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// A property of an element: a number, or a list with its length before it.
#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) length: Option<Scalar>,
    pub(super) scalar: Scalar,
}

/// A kind of record, and how many there are.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

/// What comes before the numbers.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) format: Format,
    pub(super) elements: Vec<Element>,
    /// Where the numbers begin.
    pub(super) length: usize,
    /// Lines up to there.
    pub(super) lines: usize,
    /// The last byte of each.
    pub(super) line_end: u8,
}

/// Reads a header; an error is a line, from 1, and what is wrong with it.
pub(super) fn parse(bytes: &[u8]) -> Result<Header, (usize, String)> {
    let mut format = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut at = 0;
    let mut lines = 0;
    let line_end = line_end(bytes);
    loop {
        lines += 1;
        let failed = |problem: &str| Err((lines, problem.to_owned()));
        let rest = &bytes[at..];
        let Some(end) = rest.iter().position(|b| *b == line_end) else {
            return failed("the header has no end; is this a whole PLY file?");
        };
        let line = rest[..end].trim_ascii();
        at += end + 1;
        if lines == 1 {
            if line != b"ply" {
                return failed("a PLY file begins with the line `ply`");
            }
            continue;
        }
        // Comments may be in any encoding.
        let text = String::from_utf8_lossy(line);
        let words: Vec<&str> = text.split_ascii_whitespace().take(6).collect();
        match words[..] {
            ["comment" | "obj_info", ..] | [] => (),
            ["format", name, "1.0"] => {
                format = match name {
                    "ascii" => Some(Format::Ascii),
                    "binary_little_endian" => Some(Format::Little),
                    "binary_big_endian" => Some(Format::Big),
                    _ => return Err((lines, format!("unknown format `{}`", shown(name)))),
                }
            }
            ["element", name, count] => match count.parse() {
                Ok(count) => elements.push(Element {
                    name: name.to_owned(),
                    count,
                    properties: Vec::new(),
                }),
                Err(_) => return Err((lines, format!("`{}` is no count", shown(count)))),
            },
            ["property", ref rest @ ..] => {
                let scalar = |name: &str| {
                    let unknown = || (lines, format!("unknown type `{}`", shown(name)));
                    Scalar::of(name).ok_or_else(unknown)
                };
                let (length, kind, name) = match rest {
                    ["list", length, kind, name] => (Some(scalar(length)?), kind, name),
                    [kind, name] => (None, kind, name),
                    _ => return failed("expected `property TYPE NAME`"),
                };
                if matches!(length, Some(Scalar::F32 | Scalar::F64)) {
                    return failed("a list's length must be of a whole number's type");
                }
                let Some(element) = elements.last_mut() else {
                    return failed("a property before the first element");
                };
                element.properties.push(Property {
                    name: (*name).to_owned(),
                    length,
                    scalar: scalar(kind)?,
                });
            }
            ["end_header"] => break,
            _ => return Err((lines, format!("unknown header line `{}`", shown(&text)))),
        }
    }
    let Some(format) = format else {
        return Err((lines, "the header has no `format … 1.0`".to_owned()));
    };
    Ok(Header {
        format,
        elements,
        length: at,
        lines,
        line_end,
    })
}

/// What all lines of a header end in, as its first does: a return alone, as in the format's first description, or
/// a new line. Numbers that look like another line's end may follow its last line.
fn line_end(bytes: &[u8]) -> u8 {
    let first = bytes.iter().position(|b| matches!(b, b'\n' | b'\r'));
    let is_return = |at: usize| bytes[at] == b'\r' && bytes.get(at + 1) != Some(&b'\n');
    if first.is_some_and(is_return) {
        b'\r'
    } else {
        b'\n'
    }
}
