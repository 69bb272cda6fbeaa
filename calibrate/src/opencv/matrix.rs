//! Numbers and matrices, which the three ways of writing have in common.

use super::error::{Problem, excerpt};
use super::storage::{DataType, Entries, Matrix, Node, Value, get};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// An unquoted word: a number where it begins like one, else text.
pub(super) fn plain(word: &str) -> Value {
    let unsigned = word.strip_prefix(['-', '+']).unwrap_or(word);
    if unsigned.starts_with(|c: char| c.is_ascii_digit()) {
        if let Ok(int) = word.parse() {
            return Value::Int(int);
        }
        if let Some(real) = real(word) {
            return Value::Real(real);
        }
    } else if unsigned.starts_with('.')
        && let Some(real) = real(word)
    {
        return Value::Real(real);
    }
    Value::Text(word.to_owned())
}

/// A real number, also as OpenCV (`.Nan`, `-.Inf`) and older Windows runtimes
/// (`1.#QNAN`) write those that are none.
pub(super) fn real(word: &str) -> Option<f64> {
    if let Ok(value) = word.parse() {
        return Some(value);
    }
    let lower = word.to_ascii_lowercase();
    let (negative, name) = match lower.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, lower.strip_prefix('+').unwrap_or(&lower)),
    };
    let value = match name {
        ".nan" | "nan(ind)" | "1.#qnan" | "1.#ind" | "1.#snan" => f64::NAN,
        ".inf" | "1.#inf" => f64::INFINITY,
        _ => return None,
    };
    Some(if negative { -value } else { value })
}

/// What OpenCV calls matrices: those of rows and columns, and those of other numbers of dimensions, as OpenCV 5 writes
/// plain lists of numbers.
pub(super) const TYPES: [&str; 2] = ["opencv-matrix", "opencv-nd-matrix"];

/// Whether a type's name is that of a matrix.
pub(super) fn is_type(name: &str) -> bool {
    TYPES.contains(&name)
}

/// A map; a matrix where it is marked as one, or has a matrix's keys.
pub(super) fn map(line: usize, marked: bool, entries: Entries) -> Result<Value, Problem> {
    let like_one = || {
        ["rows", "cols", "data"]
            .iter()
            .all(|key| get(&entries, key).is_some())
    };
    if marked || like_one() {
        return matrix(line, &entries).map(Value::Matrix);
    }
    Ok(Value::Map(entries))
}

fn matrix(line: usize, entries: &Entries) -> Result<Matrix, Problem> {
    let problem = |text: String| Problem::new(line, format!("a matrix {text}"));
    let needed = |key: &str| {
        get(entries, key).ok_or_else(|| {
            problem(format!(
                "without {key}, expected rows, cols, dt and data (it may be cut short)"
            ))
        })
    };
    let size = |key: &str| match needed(key)?.value {
        Value::Int(n) => usize::try_from(n)
            .map_err(|_| problem(format!("with {n} {key}, expected zero or more"))),
        ref other => Err(problem(format!(
            "whose {key} is {other:?}, expected a whole number"
        ))),
    };
    // Without a type (calibrations by ROS): double.
    let (channels, dtype) = match get(entries, "dt").map(|node| &node.value) {
        None => (1, DataType::F64),
        Some(Value::Text(dt)) => element(dt).map_err(problem)?,
        Some(other) => return Err(problem(format!("of type {other:?}, expected one like d"))),
    };
    let numbers = |key: &str, channels: usize, dtype: DataType| {
        let node = needed(key)?;
        match &node.value {
            Value::Text(packed) => decode(packed, channels, dtype).map_err(problem),
            Value::Sequence(items) => listed(items),
            Value::Null => Ok(Vec::new()),
            Value::Int(_) | Value::Real(_) => Ok(node.number().into_iter().collect()),
            _ => Err(problem(format!("whose {key} is no list of numbers"))),
        }
    };
    let has = |key: &str| get(entries, key).is_some();
    let (rows, cols) = if has("sizes") && !has("rows") {
        let sizes = numbers("sizes", 1, DataType::I32)?;
        let shape = rows_and_cols(&sizes);
        shape.ok_or_else(|| problem(format!("of the sizes {sizes:?}, expected whole numbers")))?
    } else {
        (size("rows")?, size("cols")?)
    };
    let numbers = numbers("data", channels, dtype)?;
    let expected = rows.checked_mul(cols).and_then(|n| n.checked_mul(channels));
    if expected != Some(numbers.len()) {
        return Err(problem(format!(
            "of {rows} rows, {cols} columns and {channels} channels has {} numbers, expected \
             {}",
            numbers.len(),
            expected.map_or("fewer rows and columns".to_owned(), |n| n.to_string()),
        )));
    }
    Ok(Matrix {
        rows,
        cols,
        channels,
        dtype,
        data: numbers.into_iter().map(|x| rounded(x, dtype)).collect(),
    })
}

/// The rows and columns of a matrix of any number of dimensions: the last is the columns, and those before it together
/// the rows.
fn rows_and_cols(sizes: &[f64]) -> Option<(usize, usize)> {
    let whole = |size: &f64| {
        let is_whole = size.fract() == 0.0 && (0.0..=f64::from(i32::MAX)).contains(size);
        is_whole.then_some(*size as usize)
    };
    let mut sizes: Vec<usize> = sizes.iter().map(whole).collect::<Option<_>>()?;
    let cols = sizes.pop().unwrap_or(1);
    let rows = sizes.into_iter().try_fold(1_usize, usize::checked_mul)?;
    Some((rows, cols))
}

fn listed(items: &[Node]) -> Result<Vec<f64>, Problem> {
    let number = |node: &Node| {
        let real = node.number().or_else(|| real(node.text()?));
        real.ok_or_else(|| {
            let found = match &node.value {
                Value::Text(text) => excerpt(text),
                _ => "a list".to_owned(),
            };
            Problem::new(node.line, format!("{found} in a matrix, expected a number"))
        })
    };
    items.iter().map(number).collect()
}

/// Channels and type of `d`, `2f` and their like.
fn element(dt: &str) -> Result<(usize, DataType), String> {
    let letter = dt.trim_start_matches(|c: char| c.is_ascii_digit());
    let dtype = match letter {
        "u" => DataType::U8,
        "c" => DataType::I8,
        "w" => DataType::U16,
        "s" => DataType::I16,
        "i" => DataType::I32,
        "f" => DataType::F32,
        "d" => DataType::F64,
        _ => {
            return Err(format!(
                "of type {}, expected u, c, w, s, i, f or d with the number of channels \
                 before it",
                excerpt(dt)
            ));
        }
    };
    let count = &dt[..dt.len() - letter.len()];
    // OpenCV has no more than 512 channels.
    let channels = match count {
        "" => Some(1),
        count => count.parse().ok().filter(|n| (1..=512).contains(n)),
    };
    let channels = channels.ok_or_else(|| format!("with {count} channels, expected 1 to 512"))?;
    Ok((channels, dtype))
}

/// What remains of a number in a type, as OpenCV converts it.
fn rounded(x: f64, dtype: DataType) -> f64 {
    let whole = |low: f64, high: f64| x.round_ties_even().clamp(low, high);
    match dtype {
        DataType::F64 => x,
        DataType::F32 => f64::from(x as f32),
        DataType::U8 => whole(0.0, 255.0),
        DataType::I8 => whole(-128.0, 127.0),
        DataType::U16 => whole(0.0, 65535.0),
        DataType::I16 => whole(-32768.0, 32767.0),
        DataType::I32 => whole(f64::from(i32::MIN), f64::from(i32::MAX)),
    }
}

/// Base64 data begin with their element type, filled up with blanks to this length.
const HEADER: usize = 24;

/// The numbers of base64 data, little-endian.
fn decode(packed: &str, channels: usize, dtype: DataType) -> Result<Vec<f64>, String> {
    let packed = packed.trim().strip_prefix("$base64$").unwrap_or(packed);
    let packed: String = packed.split_whitespace().collect();
    let bytes = STANDARD
        .decode(packed)
        .map_err(|error| format!("whose base64 data are damaged: {error}"))?;
    let (header, bytes) = bytes
        .split_at_checked(HEADER)
        .ok_or("whose base64 data end before their header does")?;
    let header = String::from_utf8_lossy(header);
    let stored = element(header.trim()).map_err(|e| format!("whose base64 data are {e}"))?;
    if stored != (channels, dtype) {
        return Err(format!(
            "of {channels} × {dtype:?}, whose base64 data are {}",
            header.trim()
        ));
    }
    macro_rules! numbers {
        ($type:ty) => {{
            let (numbers, rest) = bytes.as_chunks::<{ size_of::<$type>() }>();
            if !rest.is_empty() {
                return Err("whose base64 data end within a number".to_owned());
            }
            numbers
                .iter()
                .map(|n| f64::from(<$type>::from_le_bytes(*n)))
                .collect()
        }};
    }
    Ok(match dtype {
        DataType::U8 => numbers!(u8),
        DataType::I8 => numbers!(i8),
        DataType::U16 => numbers!(u16),
        DataType::I16 => numbers!(i16),
        DataType::I32 => numbers!(i32),
        DataType::F32 => numbers!(f32),
        DataType::F64 => numbers!(f64),
    })
}
