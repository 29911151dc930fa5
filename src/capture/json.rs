//! JSON that a user wrote. `serde_json` keeps the last of two values of one key, and says nothing of the first.

use std::collections::HashSet;
use std::fmt;

use serde_json::Value;

/// What is wrong with a JSON text.
#[derive(Clone, Debug, PartialEq)]
pub struct JsonFault {
    /// The line, counted from 1.
    pub line: usize,
    /// What stands there.
    pub found: String,
}

impl fmt::Display for JsonFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.found)
    }
}

/// The value of a JSON text.
///
/// # Errors
/// Text that is no JSON, or has a key twice in one object.
pub fn parse_json(text: &[u8]) -> Result<Value, JsonFault> {
    let value: Value =
        serde_json::from_slice(text).map_err(|e| JsonFault { line: e.line(), found: e.to_string() })?;
    match twice(text) {
        None => Ok(value),
        Some(fault) => Err(fault),
    }
}

/// The first key that stands a second time in an object; the text is known to be JSON.
fn twice(text: &[u8]) -> Option<JsonFault> {
    // The keys of each object that is open; of a list, none.
    let mut open: Vec<Option<HashSet<String>>> = Vec::new();
    let (mut at, mut line, mut key_next) = (0, 1, false);
    while let Some(&byte) = text.get(at) {
        let begin = at;
        at += 1;
        match byte {
            b'\n' => line += 1,
            b'{' => open.push(Some(HashSet::new())),
            b'[' => open.push(None),
            b'}' | b']' => drop(open.pop()),
            b'"' => {
                at = end_of_string(text, at);
                if let (true, Some(Some(keys))) = (key_next, open.last_mut()) {
                    let key: String = serde_json::from_slice(&text[begin..at]).ok()?;
                    if keys.contains(&key) {
                        let short = crate::error::shortened(&key);
                        return Some(JsonFault { line, found: format!("the key `{short}` a second time") });
                    }
                    keys.insert(key);
                }
            }
            _ => {}
        }
        key_next = match byte {
            b'{' | b',' => true,
            b' ' | b'\t' | b'\r' | b'\n' => key_next,
            _ => false,
        };
    }
    None
}

/// Behind the closing quote of a string whose contents begin at `at`.
fn end_of_string(text: &[u8], mut at: usize) -> usize {
    while let Some(&byte) = text.get(at) {
        at += if byte == b'\\' { 2 } else { 1 };
        if byte == b'"' {
            break;
        }
    }
    at.min(text.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_stands_once_in_an_object_at_any_depth() {
        let text = r#"{"a": [1, "a", "a", {"a": "a"}, {}, true], "\\": "\",\"a\":", "b": {"a": {"b": 2}}, "c": null}"#;
        assert_eq!(parse_json(text.as_bytes()), Ok(serde_json::from_str(text).expect("JSON")), "control");
        for (twice, line) in [
            ("{\"a\": 1,\n\"a\" : 1}", 2),
            ("[{\"b\": {\"c\": [1],\n\n\"\\u0063\": 2}}]", 3),
            ("{\"a\": {\"b\": 1}, \"a\": 2}", 1),
        ] {
            let fault = parse_json(twice.as_bytes()).expect_err(twice);
            assert!(fault.found.ends_with("a second time") && fault.line == line, "{fault:?}");
        }
        assert!(parse_json(b"{\"a\": 1} 2").is_err() && parse_json(&b"[".repeat(100_000)).is_err());
    }
}
