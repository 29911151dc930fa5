//! Text as exporters leave it: any of the usual encodings and line ends, lines joined by backslashes. Gives logical
//! lines with the number of the line on which each begins.

use std::borrow::Cow;
use std::path::Path;

use crate::error::Result;
use crate::files::{Limit, read_as};

/// Reads a text file.
///
/// The encoding is told by the byte order mark (UTF-8, UTF-16 of either order); without one it is UTF-8 or, where that
/// fails, Latin-1. NUL bytes are dropped: they pad blocks, and UTF-16 without a mark becomes readable.
///
/// # Errors
/// A file that cannot be read or is larger than `limit`.
pub(super) fn read_text(path: &Path, shown: &Path, limit: Limit) -> Result<String> {
    read_as(path, shown, limit).map(decode)
}

fn decode(bytes: Vec<u8>) -> String {
    let wide = |bytes: &[u8], unit: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]])).collect();
        String::from_utf16_lossy(&units)
    };
    let mut text = match bytes.as_slice() {
        [0xff, 0xfe, rest @ ..] => wide(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => wide(rest, u16::from_be_bytes),
        _ => String::from_utf8(bytes)
            .unwrap_or_else(|e| e.into_bytes().into_iter().map(char::from).collect::<String>()),
    };
    text.retain(|c| c != '\0' && c != '\u{feff}');
    text
}

/// The lines of `text` that hold anything but comments and blanks, trimmed, with the number (from 1) of the line on
/// which each begins. A backslash at the end joins the next line, with a blank between; in a comment it does not.
pub(super) fn logical_lines(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut physical = PhysicalLines { rest: text, number: 0 };
    std::iter::from_fn(move || {
        loop {
            let (number, line) = physical.next()?;
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let Some(head) = line.strip_suffix('\\') else { return Some((number, Cow::Borrowed(line))) };
            let mut joined = head.trim_end().to_owned();
            for (_, next) in physical.by_ref() {
                let next = next.trim();
                joined.push(' ');
                joined.push_str(next.strip_suffix('\\').unwrap_or(next).trim());
                if !next.ends_with('\\') {
                    break;
                }
            }
            return Some((number, Cow::Owned(joined)));
        }
    })
}

/// Lines ended by `\n`, `\r\n` or `\r` alone.
struct PhysicalLines<'a> {
    rest: &'a str,
    number: usize,
}

impl<'a> Iterator for PhysicalLines<'a> {
    type Item = (usize, &'a str);

    fn next(&mut self) -> Option<Self::Item> {
        if self.rest.is_empty() {
            return None;
        }
        self.number += 1;
        let end = self.rest.find(['\n', '\r']).unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(end);
        self.rest = rest.strip_prefix("\r\n").or_else(|| rest.get(1..)).unwrap_or("");
        Some((self.number, line))
    }
}

/// The first word of a line and what follows it, trimmed.
pub(super) fn split_keyword(line: &str) -> (&str, &str) {
    line.split_once(char::is_whitespace).map_or((line, ""), |(word, rest)| (word, rest.trim()))
}

/// The words before a trailing comment.
pub(super) fn words(rest: &str) -> impl Iterator<Item = &str> {
    rest.split_whitespace().take_while(|word| !word.starts_with('#'))
}

/// A number as C and Rust programs print it, and `1.#QNAN`, `-1.#IND`, `1.#INF`, `nan(ind)` as Microsoft's library
/// does; `None`: not a number's spelling at all. The result may be NaN or infinite.
pub(super) fn number(word: &str) -> Option<f32> {
    word.parse().ok().or_else(|| {
        let lower = word.to_ascii_lowercase();
        let bare = lower.trim_start_matches(['+', '-']);
        if bare.starts_with("1.#inf") {
            return Some(f32::INFINITY);
        }
        (bare.starts_with("1.#") || bare.starts_with("nan(")).then_some(f32::NAN)
    })
}

/// At most 60 characters of a line, for an error message.
pub(super) fn excerpt(line: &str) -> String {
    let short: String = line.chars().take(60).filter(|c| !c.is_control()).collect();
    if short.len() < line.len() { format!("`{short}...`") } else { format!("`{short}`") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &str) -> Vec<(usize, String)> {
        logical_lines(text).map(|(n, l)| (n, l.into_owned())).collect()
    }

    #[test]
    fn line_ends_and_numbers() {
        let expected = [(1, "a"), (2, "b"), (4, "c"), (5, "d")].map(|(n, l)| (n, l.to_owned()));
        assert_eq!(lines("a\r\nb\r\rc\n  d  "), expected);
        assert_ne!(lines("a\n\nb\n\nc\nd"), expected, "control: other line ends give other numbers");
    }

    #[test]
    fn a_backslash_joins_lines_but_not_in_comments() {
        assert_eq!(lines("f 1 \\\n 2\\\n3\nv 1"), [(1, "f 1 2 3".to_owned()), (4, "v 1".to_owned())]);
        assert_eq!(lines("# a \\\nv 1"), [(2, "v 1".to_owned())]);
        assert_eq!(lines("f 1 \\"), [(1, "f 1".to_owned())]);
    }

    #[test]
    fn encodings_give_the_same_text() {
        let text = "o K\u{e4}fig\nv 1 2 3\n";
        let utf16: Vec<u16> = text.encode_utf16().collect();
        let mut be = vec![0xfe, 0xff];
        be.extend(utf16.iter().flat_map(|u| u.to_be_bytes()));
        let mut le = vec![0xff, 0xfe];
        le.extend(utf16.iter().flat_map(|u| u.to_le_bytes()));
        let latin1: Vec<u8> = text.chars().map(|c| c as u8).collect();
        for bytes in [text.into(), be, le.clone(), latin1, [&[0xef, 0xbb, 0xbf], text.as_bytes()].concat()] {
            assert_eq!(decode(bytes), text);
        }
        le[2] ^= 1;
        assert_ne!(decode(le), text);
    }

    #[test]
    fn numbers_of_several_libraries() {
        assert_eq!(number("-.5e+01"), Some(-5.0));
        assert!(
            ["nan", "-nan", "NaN", "-1.#IND", "1.#QNAN", "nan(ind)"]
                .iter()
                .all(|w| number(w).is_some_and(f32::is_nan))
        );
        assert!(["inf", "1.#INF", "1e39"].iter().all(|w| number(w).is_some_and(f32::is_infinite)));
        assert!(["", "3.1+e2", "0x10", "1,5", "abc", "1.x"].iter().all(|w| number(w).is_none()));
    }
}
