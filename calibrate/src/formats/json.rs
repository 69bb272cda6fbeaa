//! A JSON value that knows where in which file it is.

use super::build;
use super::error::{FormatError, Problem};
use serde_json::Value;
use std::path::Path;

/// Parses a file's content.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Value, FormatError> {
    serde_json::from_str(build::text(path, bytes)?).map_err(|error| {
        let place = format!("line {} column {}", error.line(), error.column());
        Problem::broken(format!("not JSON: {error}")).at(path, place)
    })
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
