//! YAML as calibration tools write it, as a tree that knows its lines. Built on the events of `saphyr-parser`, because
//! every message names a line, and files from strangers must not exhaust memory or stack: depth and size are limited,
//! and anchors (which can multiply without end) are refused, since no calibration tool writes them.

use std::collections::HashSet;
use std::path::Path;

use saphyr_parser::{Event, Parser, ScalarStyle, Span};

use shutterbug::error::{Error, Result};

/// Largest file that is read, bytes: a thousand times a calibration.
const MAX_BYTES: usize = 4 << 20;
/// Deepest nesting. Calibrations have four levels.
const MAX_DEPTH: usize = 32;

/// A value and the line on which it starts, counted from 1.
#[derive(Debug)]
pub(super) struct Node {
    line: usize,
    value: Value,
}

#[derive(Debug)]
enum Value {
    Scalar { text: String, plain: bool },
    List(Vec<Node>),
    Map(Vec<(String, Node)>),
}

/// A value with its file and the name by which errors call it: `cam0.intrinsics`.
#[derive(Clone, Debug)]
pub(super) struct Field<'a> {
    path: &'a Path,
    name: String,
    node: &'a Node,
}

/// The documents of a YAML text. OpenCV's first line `%YAML:1.0`, which no YAML parser accepts, is read over.
///
/// # Errors
/// Text that is not YAML, is too large or too deep, or has anchors; no document at all.
pub(super) fn parse(path: &Path, text: &str) -> Result<Vec<Node>> {
    if text.len() > MAX_BYTES {
        let found = format!("{} bytes", text.len());
        return Err(Error::input(path, None, found, format!("a calibration of at most {MAX_BYTES} bytes")));
    }
    let text = text.trim_start_matches('\u{feff}');
    // A comment of the same length keeps every place.
    let text = match text.strip_prefix("%YAML:") {
        Some(rest) => format!("#YAML:{rest}"),
        None => text.to_owned(),
    };
    let mut builder = Builder { path, open: Vec::new(), documents: Vec::new() };
    for event in Parser::new_from_str(&text) {
        let (event, span) = event.map_err(|e| {
            let found = format!("text that is not YAML ({})", e.info().replace('\n', " "));
            Error::input(path, e.marker().line(), found, "YAML: `key: value` lines")
        })?;
        builder.take(event, span)?;
    }
    if builder.documents.is_empty() {
        return Err(Error::input(path, None, "nothing", "YAML: `key: value` lines"));
    }
    Ok(builder.documents)
}

/// Puts the tree together from events.
struct Builder<'a> {
    path: &'a Path,
    open: Vec<Open>,
    documents: Vec<Node>,
}

/// A list or map that has not ended.
struct Open {
    line: usize,
    kind: OpenKind,
}

enum OpenKind {
    List(Vec<Node>),
    /// Finished entries, their keys, and the key that waits for its value.
    Map(Vec<(String, Node)>, HashSet<String>, Option<(String, usize)>),
}

impl Builder<'_> {
    fn take(&mut self, event: Event, span: Span) -> Result<()> {
        let line = span.start.line();
        match event {
            Event::Alias(_) => {
                return Err(Error::input(self.path, line, "an alias (`*name`)", "values written out"));
            }
            Event::Scalar(text, style, ..) => {
                let value = Value::Scalar { text: text.into_owned(), plain: style == ScalarStyle::Plain };
                self.add(Node { line, value })?;
            }
            Event::SequenceStart(..) => self.open(line, OpenKind::List(Vec::new()))?,
            Event::MappingStart(..) => self.open(line, OpenKind::Map(Vec::new(), HashSet::new(), None))?,
            Event::SequenceEnd | Event::MappingEnd => {
                if let Some(Open { line, kind }) = self.open.pop() {
                    let value = match kind {
                        OpenKind::List(items) => Value::List(items),
                        OpenKind::Map(entries, ..) => Value::Map(entries),
                    };
                    self.add(Node { line, value })?;
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn open(&mut self, line: usize, kind: OpenKind) -> Result<()> {
        if self.open.len() >= MAX_DEPTH {
            let expected = format!("at most {MAX_DEPTH} levels");
            return Err(Error::input(self.path, line, "lists in lists without end", expected));
        }
        self.open.push(Open { line, kind });
        Ok(())
    }

    fn add(&mut self, node: Node) -> Result<()> {
        let line = node.line;
        match self.open.last_mut().map(|open| &mut open.kind) {
            None => self.documents.push(node),
            Some(OpenKind::List(items)) => items.push(node),
            Some(OpenKind::Map(entries, names, key)) => match (key.take(), node.value) {
                // The key's line: a block starts on the line after.
                (Some((key, line)), value) => entries.push((key, Node { line, value })),
                (None, Value::Scalar { text, .. }) => {
                    if !names.insert(text.clone()) {
                        let found = format!("`{}` again", shortened(&text));
                        return Err(Error::input(self.path, line, found, "each key once"));
                    }
                    *key = Some((text, line));
                }
                (None, _) => {
                    return Err(Error::input(self.path, line, "a list or table as a key", "a name as a key"));
                }
            },
        }
        Ok(())
    }
}

impl<'a> Field<'a> {
    /// The top of a document.
    pub(super) fn top(path: &'a Path, node: &'a Node) -> Self {
        Self { path, name: String::new(), node }
    }

    /// The file.
    pub(super) fn path(&self) -> &'a Path {
        self.path
    }

    /// The line, counted from 1.
    pub(super) fn line(&self) -> usize {
        self.node.line
    }

    /// What errors call it.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// Keys of a map, in the file's order; none for other values.
    pub(super) fn keys(&self) -> Vec<&'a str> {
        match &self.node.value {
            Value::Map(entries) => entries.iter().map(|(key, _)| key.as_str()).collect(),
            _ => Vec::new(),
        }
    }

    /// The value of a key; `None` if there is none or it is null.
    pub(super) fn get(&self, key: &str) -> Option<Field<'a>> {
        let Value::Map(entries) = &self.node.value else { return None };
        let (_, node) = entries.iter().find(|(name, _)| name == key)?;
        let null = matches!(&node.value, Value::Scalar { text, plain: true }
            if matches!(text.as_str(), "" | "~" | "null" | "Null" | "NULL"));
        let name = if self.name.is_empty() { key.to_owned() } else { format!("{}.{key}", self.name) };
        (!null).then_some(Field { path: self.path, name, node })
    }

    /// The value of the first of several spellings of a key.
    pub(super) fn get_any(&self, keys: &[&str]) -> Option<Field<'a>> {
        keys.iter().find_map(|key| self.get(key))
    }

    /// The value of a key that must be there; `expected` describes it. A near miss among the keys is named.
    pub(super) fn require(&self, key: &str, expected: &str) -> Result<Field<'a>> {
        self.get(key).ok_or_else(|| {
            // A misspelt key is the likeliest reason: ask for the nearest among those that stand there.
            let near = Error::unknown_name(self.path, None, "key", key, self.keys());
            let near = match near {
                Error::UnknownName { nearest: Some(nearest), .. } if nearest != key => {
                    format!("; is `{nearest}` meant to be it?")
                }
                _ => String::new(),
            };
            let whole = if self.name.is_empty() { key.to_owned() } else { format!("{}.{key}", self.name) };
            Error::input(self.path, self.line(), format!("no `{whole}`"), format!("{expected}{near}"))
        })
    }

    /// This value is not what was expected.
    pub(super) fn unexpected(&self, expected: impl Into<String>) -> Error {
        Error::input(self.path, self.line(), format!("{} = {}", self.name, self.describe()), expected)
    }

    /// A finite number.
    pub(super) fn number(&self, expected: &str) -> Result<f64> {
        scalar_number(self.node).ok_or_else(|| self.unexpected(expected))
    }

    /// A number in a range.
    pub(super) fn number_in(&self, unit: &str, (min, max): (f64, f64)) -> Result<f64> {
        let expected = format!("a number, {min} to {max} {unit}");
        let value = self.number(&expected)?;
        if (min..=max).contains(&value) { Ok(value) } else { Err(self.unexpected(expected)) }
    }

    /// A whole number from 0 to `max`.
    pub(super) fn whole(&self, max: u32) -> Result<u32> {
        let expected = format!("a whole number, 0 to {max}");
        let number = self.number(&expected)?;
        let fits = number.fract() == 0.0 && (0.0..=f64::from(max)).contains(&number);
        if fits { Ok(number as u32) } else { Err(self.unexpected(expected)) }
    }

    /// A text.
    pub(super) fn text(&self, expected: &str) -> Result<&'a str> {
        match &self.node.value {
            Value::Scalar { text, .. } => Ok(text),
            _ => Err(self.unexpected(expected)),
        }
    }

    /// A list of finite numbers: `[a, b]`, rows of them, or OpenCV's `rows`, `cols`, `data`, row by row.
    pub(super) fn numbers(&self, expected: &str) -> Result<Vec<f64>> {
        if let Value::Map(_) = self.node.value {
            let data = self.require("data", expected)?;
            let numbers = data.numbers(expected)?;
            let side = |key: &str| self.get(key).map(|f| f.whole(10_000)).transpose();
            if let (Some(rows), Some(cols)) = (side("rows")?, side("cols")?)
                && u64::from(rows) * u64::from(cols) != numbers.len() as u64
            {
                let found = format!("{} numbers in {}", numbers.len(), data.name);
                return Err(Error::input(self.path, data.line(), found, format!("{rows} rows of {cols}")));
            }
            return Ok(numbers);
        }
        let Value::List(items) = &self.node.value else { return Err(self.unexpected(expected)) };
        let mut numbers = Vec::new();
        for item in items {
            let field = Field { path: self.path, name: self.name.clone(), node: item };
            match &item.value {
                Value::List(_) => numbers.extend(field.numbers(expected)?),
                _ => numbers.push(field.number(expected)?),
            }
        }
        Ok(numbers)
    }

    /// A list of exactly `N` finite numbers.
    pub(super) fn exactly<const N: usize>(&self, expected: &str) -> Result<[f64; N]> {
        let numbers = self.numbers(expected)?;
        let count = numbers.len();
        numbers.try_into().map_err(|_| {
            Error::input(self.path, self.line(), format!("{} of {count} numbers", self.name), expected)
        })
    }

    fn describe(&self) -> String {
        match &self.node.value {
            Value::Scalar { text, plain: true } => shortened(text),
            Value::Scalar { text, plain: false } => format!("{:?}", shortened(text)),
            Value::List(items) => format!("a list of {}", items.len()),
            Value::Map(_) => "a table".to_owned(),
        }
    }
}

fn scalar_number(node: &Node) -> Option<f64> {
    let Value::Scalar { text, plain: true } = &node.value else { return None };
    text.parse().ok().filter(|n: &f64| n.is_finite())
}

/// The start of a text, on one line.
pub(super) fn shortened(text: &str) -> String {
    let short: String = text.chars().take(60).collect();
    short.escape_debug().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn top(text: &str) -> Node {
        parse(Path::new("c.yaml"), text).unwrap_or_else(|e| panic!("{e}")).swap_remove(0)
    }

    #[test]
    fn values_are_found_with_their_lines() {
        let node = top("%YAML:1.0\n# comment\na: 1.5\nm: !!opencv-matrix\n  rows: 2\n  cols: 2\n  dt: d\n  \
                        data: [1., 2,\n    -3e-1, .5]\nrows:\n- [1, 2]\n- [3, 4]\nnone: ~\ntext: 'x: y'\n");
        let field = Field::top(Path::new("c.yaml"), &node);
        assert_eq!(field.get("a").map(|f| (f.line(), f.number("").ok())), Some((3, Some(1.5))));
        assert_eq!(field.get("m").and_then(|f| f.numbers("").ok()), Some(vec![1.0, 2.0, -0.3, 0.5]));
        assert_eq!(field.get("rows").and_then(|f| f.exactly("").ok()), Some([1.0, 2.0, 3.0, 4.0]));
        assert!(field.get("none").is_none() && field.get("absent").is_none());
        assert_eq!(field.get("text").and_then(|f| f.text("").ok()), Some("x: y"));
        // A number in quotes is text.
        assert!(
            Field::top(Path::new("c.yaml"), &top("a: '1'")).get("a").is_some_and(|f| f.number("").is_err())
        );
    }

    #[test]
    fn what_cannot_be_used_is_refused_with_its_line() {
        let refused = |text: &str| match parse(Path::new("c.yaml"), text) {
            Ok(nodes) => panic!("{text:?} accepted: {nodes:?}"),
            Err(e) => e.to_string(),
        };
        assert!(refused("a: 1\nb: [1, 2").starts_with("c.yaml:"), "{}", refused("a: 1\nb: [1, 2"));
        assert_eq!(refused("a: 1\n\na: 2"), "c.yaml:3: found `a` again; expected each key once");
        assert!(refused("a: &x 1\nb: *x").contains("c.yaml:2: found an alias"));
        assert!(refused(&format!("a: {}", "[".repeat(100))).contains("levels"));
        assert!(refused("").contains("found nothing") && refused("# only\n").contains("found nothing"));
        assert!(refused("[1, 2]: 3").contains("as a key"));
        assert!(refused(&" ".repeat(MAX_BYTES + 1)).contains("bytes"));
    }

    #[test]
    fn a_matrix_whose_size_disagrees_is_refused() {
        let node = top("m:\n  rows: 3\n  cols: 3\n  data: [1, 2]\n");
        let field = Field::top(Path::new("c.yaml"), &node).get("m").expect("there");
        let error = field.numbers("nine numbers").expect_err("two").to_string();
        assert_eq!(error, "c.yaml:4: found 2 numbers in m.data; expected 3 rows of 3");
    }

    #[test]
    fn a_missing_key_names_its_nearest() {
        let node = top("intrinsic: [1, 2]\n");
        let error = Field::top(Path::new("c.yaml"), &node).require("intrinsics", "four numbers");
        let error = error.expect_err("missing").to_string();
        assert!(error.contains("no `intrinsics`") && error.contains("is `intrinsic` meant"), "{error}");
    }

    proptest! {
        #[test]
        fn never_panics(text: String) {
            let _ = parse(Path::new("c.yaml"), &text);
        }

        #[test]
        fn never_panics_on_what_looks_like_yaml(text in "[a-c:\\-\\[\\]{},&*!|> 0-9.\n'\"#%]{0,120}") {
            let _ = parse(Path::new("c.yaml"), &text);
        }
    }
}
