//! Percepts over the pictures of a page: dots for corners, strokes for lines, circles for blobs, as paths of SVG.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Component, Path};

use serde::{Deserialize, Serialize};

use shutterbug::error::{Error, Result};
use shutterbug::files::{self, Limit};

/// Paths of one frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct Overlay {
    /// All percepts of the real frame.
    pub real: String,
    /// Those of the frame simulated with the given camera that the real frame has too, and those that it has not.
    pub simulated: [String; 2],
    /// The same with the effects found.
    pub diagnosed: [String; 2],
}

#[derive(Deserialize)]
struct File {
    frames: Vec<Frame>,
}

#[derive(Deserialize)]
struct Frame {
    index: usize,
    real: Kinds,
    simulated: Kinds,
    diagnosed: Kinds,
}

#[derive(Deserialize)]
struct Kinds {
    corners: Places<2>,
    lines: Places<4>,
    blobs: Places<3>,
}

#[derive(Deserialize)]
struct Places<const N: usize>
where
    [f64; N]: for<'a> Deserialize<'a>,
{
    at: Vec<[f64; N]>,
    #[serde(default)]
    matched: Vec<bool>,
}

/// Reads the file of percepts that a report names; nothing where it names none. By the frames' index.
///
/// # Errors
/// A name that leads out of the folder, a file that cannot be read or holds something else.
pub(super) fn read(folder: &Path, name: &str) -> Result<BTreeMap<usize, Overlay>> {
    if name.is_empty() {
        return Ok(BTreeMap::new());
    }
    let path = folder.join(name);
    if Path::new(name).components().any(|c| !matches!(c, Component::Normal(_) | Component::CurDir)) {
        return Err(Error::input(&path, None, format!("the file `{name}`"), "a name inside the folder"));
    }
    let bytes = files::read(&path, Limit::OWN)?;
    let file: File = serde_json::from_slice(&bytes)
        .map_err(|e| Error::input(&path, e.line(), e.to_string(), "percepts as `diagnose` writes them"))?;
    let overlay = |f: &Frame| Overlay {
        real: format!("{}{}", paths(&f.real, true), paths(&f.real, false)),
        simulated: [true, false].map(|matched| paths(&f.simulated, matched)),
        diagnosed: [true, false].map(|matched| paths(&f.diagnosed, matched)),
    };
    Ok(file.frames.iter().map(|f| (f.index, overlay(f))).collect())
}

/// The percepts that are matched, or those that are not (all of a real frame's are not).
fn paths(kinds: &Kinds, matched: bool) -> String {
    let mut path = String::new();
    let put = |out: &mut String, text: std::fmt::Arguments<'_>| {
        out.write_fmt(text).expect("a String takes any text");
    };
    for [x, y] in chosen(&kinds.corners.at, &kinds.corners.matched, matched) {
        // A stroke of no length with round ends is a dot.
        put(&mut path, format_args!("M{x} {y}h0"));
    }
    for [x0, y0, x1, y1] in chosen(&kinds.lines.at, &kinds.lines.matched, matched) {
        put(&mut path, format_args!("M{x0} {y0}L{x1} {y1}"));
    }
    for [x, y, r] in chosen(&kinds.blobs.at, &kinds.blobs.matched, matched) {
        let (left, d) = (x - r, 2.0 * r);
        put(&mut path, format_args!("M{left:.1} {y}a{r} {r} 0 1 0 {d:.1} 0a{r} {r} 0 1 0 -{d:.1} 0"));
    }
    path
}

fn chosen<'a, T>(all: &'a [T], flags: &'a [bool], matched: bool) -> impl Iterator<Item = &'a T> {
    let flag = move |i: usize| flags.get(i).copied().unwrap_or(false);
    all.iter().enumerate().filter(move |(i, _)| flag(*i) == matched).map(|(_, t)| t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percepts_become_paths_and_strangers_files_are_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let kinds = r#"{"corners":{"at":[[1.5,2]],"matched":[true]},"lines":{"at":[[0,0,3,4]],"matched":[false]},
            "blobs":{"at":[[10,10,2]],"matched":[true]}}"#;
        let text = format!(
            r#"{{"frames":[{{"index":3,"real":{},"simulated":{kinds},"diagnosed":{kinds}}}]}}"#,
            kinds.replace(r#","matched":[true]"#, "").replace(r#","matched":[false]"#, "")
        );
        std::fs::write(folder.path().join("p.json"), &text).expect("written");
        let all = read(folder.path(), "p.json").expect("percepts");
        let frame = &all[&3];
        assert_eq!(frame.simulated[0], "M1.5 2h0M8.0 10a2 2 0 1 0 4.0 0a2 2 0 1 0 -4.0 0");
        assert_eq!(frame.simulated[1], "M0 0L3 4");
        assert_eq!(frame.real, "M1.5 2h0M0 0L3 4M8.0 10a2 2 0 1 0 4.0 0a2 2 0 1 0 -4.0 0");
        assert!(read(folder.path(), "").expect("none").is_empty());
        std::fs::write(folder.path().join("bad.json"), text.replace("[0,0,3,4]", "[\"><script>\"]"))
            .expect("written");
        for name in ["bad.json", "none.json", "../p.json", "/etc/hostname"] {
            assert!(read(folder.path(), name).is_err(), "{name}");
        }
    }
}
