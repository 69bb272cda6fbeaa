//! A JSON value that knows where in which file it is.

use super::build;
use super::error::{FormatError, Problem};
use serde_json::Value;
use std::path::Path;

/// Parses a file's content.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Value, FormatError> {
    let text = build::text(path, bytes)?;
    serde_json::from_str(text).map_err(|error| {
        let place = format!("line {} column {}", error.line(), error.column());
        let said = error.to_string();
        let said = said.strip_suffix(&format!(" at {place}")).unwrap_or(&said);
        let problem = no_number(text).map(|found| Problem::new(found, WITHOUT_NUMBER));
        let problem = problem.unwrap_or_else(|| Problem::broken(format!("not JSON: {said}")));
        problem.at(path, place)
    })
}

/// What Python's json module writes where a number is none.
const NO_NUMBERS: [&str; 3] = ["NaN", "Infinity", "-Infinity"];
/// What they begin with once they are texts, as hardly another text does.
const MARK: char = '\u{1}';

/// What to do about such a word.
pub const WITHOUT_NUMBER: &str =
    "remove what has it, as a frame without a pose, or export it again from the program it is from";

/// What to say of a text that is JSON but for words that Python writes where a number is none: where the first of
/// them is. `None` of any other text.
pub fn no_number(text: &str) -> Option<String> {
    let value: Value = serde_json::from_str(&with_texts(text)).ok()?;
    let (record, word) = marked(&value, String::new())?;
    Some(format!(
        "not JSON: {record} is {word}, expected a finite number"
    ))
}

/// The text with such words as texts, marked.
fn with_texts(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    let (mut is_text, mut is_escaped) = (false, false);
    while let Some(next) = rest.chars().next() {
        let word = NO_NUMBERS.into_iter().find(|word| rest.starts_with(word));
        if let Some(word) = word.filter(|_| !is_text) {
            out += &format!("\"\\u0001{word}\"");
            rest = &rest[word.len()..];
            continue;
        }
        is_text ^= next == '"' && !is_escaped;
        is_escaped = is_text && next == '\\' && !is_escaped;
        out.push(next);
        rest = &rest[next.len_utf8()..];
    }
    out
}

/// The first marked text in a value, without the mark, and the way there: objects are called by
/// their photo's name, or their own, too.
fn marked(value: &Value, record: String) -> Option<(String, String)> {
    match value {
        Value::String(text) => Some((record, text.strip_prefix(MARK)?.to_owned())),
        Value::Array(items) => items
            .iter()
            .enumerate()
            .find_map(|(index, item)| marked(item, format!("{record}[{index}]"))),
        Value::Object(fields) => {
            let dot = if record.is_empty() { "" } else { "." };
            let (found, word) = fields
                .iter()
                .find_map(|(key, item)| marked(item, format!("{record}{dot}{key}")))?;
            let name = fields.get("file_path").or_else(|| fields.get("name"));
            let name = name.and_then(Value::as_str);
            let name = name.and_then(|name| build::name(name).ok());
            let called = name.map(|name| format!("{found} ({name})"));
            Some((called.unwrap_or(found), word))
        }
        _ => None,
    }
}

/// A value, the file it is in, and the way there: `frames[3].transform_matrix`.
#[derive(Clone)]
pub(super) struct Json<'a> {
    path: &'a Path,
    pub(super) record: String,
    value: &'a Value,
}

impl<'a> Json<'a> {
    /// The whole file.
    pub(super) fn root(path: &'a Path, value: &'a Value) -> Self {
        let record = String::new();
        Self {
            path,
            record,
            value,
        }
    }

    /// The same value, called by a further name, such as its photo's.
    pub(super) fn called(mut self, name: &str) -> Self {
        self.record = format!("{} ({name})", self.record);
        self
    }

    /// A problem with this value.
    pub(super) fn error(&self, problem: Problem) -> FormatError {
        let record = if self.record.is_empty() {
            "the file"
        } else {
            &self.record
        };
        problem.at(self.path, record)
    }

    fn expected(&self, what: &str) -> FormatError {
        let found = match self.value {
            Value::Null => "null".to_owned(),
            Value::Bool(value) => value.to_string(),
            Value::Number(value) => value.to_string(),
            Value::String(text) => format!("{text:?}"),
            Value::Array(items) => format!("an array of {}", items.len()),
            Value::Object(_) => "an object".to_owned(),
        };
        self.error(Problem::broken(format!("found {found}, expected {what}")))
    }

    /// A field that must be there.
    pub(super) fn field(&self, name: &str) -> Result<Json<'a>, FormatError> {
        if !self.value.is_object() {
            return Err(self.expected("an object"));
        }
        self.optional(name)
            .ok_or_else(|| self.error(Problem::broken(format!("there is no {name:?} in it"))))
    }

    /// A field that may be missing or null.
    pub(super) fn optional(&self, name: &str) -> Option<Json<'a>> {
        let value = self.value.get(name).filter(|value| !value.is_null())?;
        let dot = if self.record.is_empty() { "" } else { "." };
        Some(Json {
            path: self.path,
            record: format!("{}{dot}{name}", self.record),
            value,
        })
    }

    /// The elements of an array.
    pub(super) fn items(&self) -> Result<impl Iterator<Item = Json<'a>> + use<'a>, FormatError> {
        let items = self
            .value
            .as_array()
            .ok_or_else(|| self.expected("an array"))?;
        let Json { path, record, .. } = self.clone();
        Ok(items.iter().enumerate().map(move |(index, value)| Json {
            path,
            record: format!("{record}[{index}]"),
            value,
        }))
    }

    /// The elements of an array of `N`.
    pub(super) fn exactly<const N: usize>(&self) -> Result<[Json<'a>; N], FormatError> {
        let items: Vec<_> = self.items()?.collect();
        items
            .try_into()
            .map_err(|_| self.expected(&format!("an array of {N}")))
    }

    /// A finite number; AliceVision writes its numbers as strings.
    pub(super) fn number(&self) -> Result<f64, FormatError> {
        let number = match self.value {
            Value::Number(number) => number.as_f64(),
            Value::String(text) => text.trim().parse().ok(),
            _ => None,
        };
        number
            .filter(|number| number.is_finite())
            .ok_or_else(|| self.expected("a finite number"))
    }

    /// `N` finite numbers.
    pub(super) fn numbers<const N: usize>(&self) -> Result<[f64; N], FormatError> {
        let items = self.exactly::<N>()?;
        let mut numbers = [0.0; N];
        for (number, item) in numbers.iter_mut().zip(items) {
            *number = item.number()?;
        }
        Ok(numbers)
    }

    /// A whole number from 0 to 2³² − 1, which may be written as 1080.0.
    pub(super) fn whole(&self) -> Result<u32, FormatError> {
        let number = self.number()?;
        if number.fract() != 0.0 || !(0.0..=f64::from(u32::MAX)).contains(&number) {
            return Err(self.expected("a whole number from 0 to 4294967295"));
        }
        Ok(number as u32)
    }

    /// A string.
    pub(super) fn text(&self) -> Result<&'a str, FormatError> {
        self.value.as_str().ok_or_else(|| self.expected("a string"))
    }

    /// True or false, or 0 or 1.
    pub(super) fn flag(&self) -> Result<bool, FormatError> {
        match self.value {
            Value::Bool(flag) => Ok(*flag),
            _ => Ok(self.number()? != 0.0),
        }
    }
}
