//! Reads the text files of a capture. Errors say which file is missing and what it is for, or name the line.

use std::io::ErrorKind;
use std::ops::Range;
use std::path::Path;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::error::{Error, Result, shortened};
use crate::files::{Limit, read};

/// The whole of a UTF-8 text file. `purpose` completes "no such file; expected ..." when it is missing.
///
/// # Errors
/// A missing or unreadable file, one of more than `limit` bytes, bytes that are not UTF-8 (with their line).
pub fn read_text(path: &Path, purpose: &str, limit: Limit) -> Result<String> {
    let bytes = read(path, limit).map_err(|e| match e {
        Error::Io { source, .. } if source.kind() == ErrorKind::NotFound => {
            Error::input(path, None, "no such file", purpose)
        }
        other => other,
    })?;
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(Error::input(path, None, "text in UTF-16", "text in UTF-8: save it so"));
    }
    String::from_utf8(bytes).map_err(|e| {
        let valid = &e.as_bytes()[..e.utf8_error().valid_up_to()];
        Error::input(path, line_at(valid, valid.len()), "bytes that are not UTF-8", "text in UTF-8")
    })
}

/// The line, counted from 1, that holds the byte at `offset`.
fn line_at(text: &[u8], offset: usize) -> usize {
    1 + text[..offset.min(text.len())].iter().filter(|&&b| b == b'\n').count()
}

/// A value of a TOML file with its place.
pub(super) type Entry<'a> = Spanned<DeValue<'a>>;

/// The text of a TOML file: turns byte offsets into lines and values into numbers.
pub(super) struct TomlText<'a> {
    path: &'a Path,
    text: &'a str,
    /// Where each line but the first begins: a file of many tables asks for as many lines.
    starts: Vec<usize>,
}

impl<'a> TomlText<'a> {
    /// The text, without its byte order mark if it has one.
    pub(super) fn new(path: &'a Path, text: &'a str) -> Self {
        let text = text.trim_start_matches('\u{feff}');
        let starts = text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(at, _)| at + 1).collect();
        Self { path, text, starts }
    }

    /// The file.
    pub(super) fn path(&self) -> &'a Path {
        self.path
    }

    /// Its top table.
    pub(super) fn parse(&self) -> Result<DeTable<'a>> {
        DeTable::parse(self.text).map(Spanned::into_inner).map_err(|e| {
            let found = format!("text that is not TOML ({})", e.message().replace('\n', " "));
            Error::input(
                self.path,
                e.span().map(|s| self.line(s)),
                found,
                "`key = value` lines and `[effect]` tables",
            )
        })
    }

    /// The line, counted from 1, on which something starts.
    pub(super) fn line(&self, span: Range<usize>) -> usize {
        1 + self.starts.partition_point(|start| *start <= span.start)
    }

    /// `name = value` is not what was expected.
    pub(super) fn unexpected(&self, name: &str, value: &Entry, expected: impl Into<String>) -> Error {
        Error::input(
            self.path,
            self.line(value.span()),
            format!("{name} = {}", describe(value.get_ref())),
            expected,
        )
    }

    /// A finite number; whole numbers are numbers too. `expected` says of what.
    pub(super) fn number(&self, name: &str, value: &Entry, expected: &str) -> Result<f64> {
        let number = match value.get_ref() {
            DeValue::Float(f) => f.as_str().parse().ok(),
            DeValue::Integer(i) => i64::from_str_radix(i.as_str(), i.radix()).ok().map(|i| i as f64),
            _ => None,
        };
        number.filter(|n: &f64| n.is_finite()).ok_or_else(|| self.unexpected(name, value, expected))
    }

    /// Three finite numbers.
    pub(super) fn vector3(&self, name: &str, value: &Entry, expected: &str) -> Result<[f64; 3]> {
        let items = value.get_ref().as_array().filter(|items| items.len() == 3);
        let items = items.ok_or_else(|| self.unexpected(name, value, expected))?;
        let mut vector = [0.0; 3];
        for (component, item) in vector.iter_mut().zip(items.iter()) {
            *component = self.number(name, item, expected)?;
        }
        Ok(vector)
    }
}

/// A value as an error names it: short, and on one line.
fn describe(value: &DeValue) -> String {
    match value {
        DeValue::String(s) => {
            let short: String = s.chars().take(40).collect();
            format!("{short:?}{}", if short.len() < s.len() { "..." } else { "" })
        }
        DeValue::Integer(i) => shortened(&i.to_string()),
        DeValue::Float(f) => shortened(&f.to_string()),
        DeValue::Boolean(b) => b.to_string(),
        DeValue::Datetime(d) => format!("the date {d}"),
        DeValue::Array(a) => format!("a list of {}", a.len()),
        DeValue::Table(_) => "a table".to_owned(),
    }
}
