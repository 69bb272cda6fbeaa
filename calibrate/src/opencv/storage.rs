//! What a storage file holds, whichever way it is written.

use super::error::{OpenCvError, Problem};
use super::{json, xml, yaml};
use capture::without_byte_order_mark;
use std::io::Read;
use std::path::Path;

/// The content of a file that OpenCV's `FileStorage` writes.
#[derive(Clone, Debug, PartialEq)]
pub struct FileStorage {
    /// The values by name, in the file's order.
    pub entries: Entries,
}

/// Named values in the file's order. A name may be there twice.
pub type Entries = Vec<(String, Node)>;

/// A value and where it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// The value.
    pub value: Value,
    /// The line where it begins, the first being 1.
    pub line: usize,
}

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Nothing.
    Null,
    /// A number written without a point or an exponent.
    Int(i64),
    /// Any other number; NaN and infinities too.
    Real(f64),
    /// Text.
    Text(String),
    /// Values without names.
    Sequence(Vec<Node>),
    /// Values with names.
    Map(Entries),
    /// A matrix.
    Matrix(Matrix),
}

/// A dense matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct Matrix {
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub cols: usize,
    /// Numbers an element.
    pub channels: usize,
    /// What the numbers were stored as.
    pub dtype: DataType,
    /// Row by row, an element's channels together: `rows · cols · channels` numbers, each
    /// rounded to what `dtype` can hold.
    pub data: Vec<f64>,
}

/// What a matrix's numbers are stored as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DataType {
    /// 8 bits, `u`.
    U8,
    /// 8 bits, `c`.
    I8,
    /// 16 bits, `w`.
    U16,
    /// 16 bits, `s`.
    I16,
    /// 32 bits, `i`.
    I32,
    /// 32 bits, `f`.
    F32,
    /// 64 bits, `d`.
    F64,
}

/// Deeper nesting is refused: no calibration needs it, and it would exhaust the stack.
pub(super) const MAX_DEPTH: usize = 64;

/// How much larger than its gzip file a text may be, times and bytes: digits pack to a
/// third; only what is made to fill memory packs to a hundredth.
const MAX_UNPACKED: (u64, u64) = (100, 1 << 16);

impl FileStorage {
    /// Reads a file. Its content says whether it is YAML, XML or JSON, and whether it is
    /// packed with gzip; its name does not matter.
    ///
    /// # Errors
    /// The file cannot be read, is none of these, or is damaged.
    pub fn read(path: &Path) -> Result<Self, OpenCvError> {
        let bytes = std::fs::read(path).map_err(|source| OpenCvError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(path, &bytes)
    }

    /// Reads a file's content; `path` is only named in errors.
    ///
    /// # Errors
    /// As for [`FileStorage::read`].
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, OpenCvError> {
        let not_storage = |problem: String| OpenCvError::NotStorage {
            path: path.to_owned(),
            problem,
        };
        let unpacked;
        let bytes = if bytes.starts_with(&[0x1f, 0x8b]) {
            unpacked = unpack(bytes).map_err(not_storage)?;
            &unpacked
        } else {
            bytes
        };
        if bytes.contains(&0) {
            return Err(not_storage("the file is binary".to_owned()));
        }
        // Dates and comments come in the encoding of whoever's computer it was. What we
        // look for is ASCII.
        let text = String::from_utf8_lossy(without_byte_order_mark(bytes));
        let parsed = match text.trim_start().chars().next() {
            None => return Err(not_storage("the file is empty".to_owned())),
            Some('<') => xml::parse(&text),
            Some('{') => json::parse(&text),
            Some(_) => yaml::parse(&text),
        };
        let entries = parsed.map_err(|Problem { line, problem }| OpenCvError::Malformed {
            path: path.to_owned(),
            line,
            problem,
        })?;
        Ok(Self { entries })
    }

    /// The first value of a name.
    pub fn get(&self, key: &str) -> Option<&Node> {
        get(&self.entries, key)
    }
}

/// The first value of a name.
pub(super) fn get<'a>(entries: &'a Entries, key: &str) -> Option<&'a Node> {
    entries.iter().find(|(k, _)| k == key).map(|(_, node)| node)
}

fn unpack(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let limit = (bytes.len() as u64) * MAX_UNPACKED.0 + MAX_UNPACKED.1;
    let mut unpacked = Vec::new();
    let mut reader = flate2::read::MultiGzDecoder::new(bytes).take(limit + 1);
    match reader.read_to_end(&mut unpacked) {
        Err(error) => Err(format!("the gzip data is damaged: {error}")),
        Ok(n) if n as u64 > limit => Err(format!(
            "the gzip data unpacks to more than {} times its size",
            MAX_UNPACKED.0
        )),
        Ok(_) => Ok(unpacked),
    }
}

impl Node {
    pub(super) fn new(line: usize, value: Value) -> Self {
        Self { value, line }
    }

    /// A number, however it is written.
    pub fn number(&self) -> Option<f64> {
        match self.value {
            Value::Int(value) => Some(value as f64),
            Value::Real(value) => Some(value),
            _ => None,
        }
    }

    /// A text.
    pub fn text(&self) -> Option<&str> {
        match &self.value {
            Value::Text(text) => Some(text),
            _ => None,
        }
    }

    /// A matrix; sequences of numbers, and of sequences of as many numbers each, are one
    /// too.
    pub fn matrix(&self) -> Option<Matrix> {
        let of = |rows: usize, cols: usize, data: Vec<f64>| Matrix {
            rows,
            cols,
            channels: 1,
            dtype: DataType::F64,
            data,
        };
        let Value::Sequence(items) = &self.value else {
            let Value::Matrix(matrix) = &self.value else {
                return None;
            };
            return Some(matrix.clone());
        };
        if items.is_empty() {
            return Some(of(0, 0, Vec::new()));
        }
        let numbers = |nodes: &[Node]| nodes.iter().map(Node::number).collect::<Option<Vec<_>>>();
        if let Some(row) = numbers(items) {
            return Some(of(1, row.len(), row));
        }
        let mut data = Vec::new();
        let mut cols = None;
        for item in items {
            let Value::Sequence(row) = &item.value else {
                return None;
            };
            if *cols.get_or_insert(row.len()) != row.len() {
                return None;
            }
            data.extend(numbers(row)?);
        }
        Some(of(items.len(), cols?, data))
    }
}

impl Matrix {
    /// The shape, for people: `3 × 3`, `13 × 54 of 2`.
    pub fn shape(&self) -> String {
        let Self { rows, cols, .. } = self;
        match self.channels {
            1 => format!("{rows} × {cols}"),
            channels => format!("{rows} × {cols} of {channels}"),
        }
    }
}
