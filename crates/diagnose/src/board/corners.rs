//! Corners as a table, `file,col,row,u_px,v_px`: read where another tool has found them, and written so that another
//! can use them.

use std::collections::{BTreeMap, HashSet};
use std::path::Path;

use glam::DVec2;

use super::input::Picture;
use super::target::{Seen, View};
use shutterbug::error::{Error, Result, counted};
use shutterbug::files::{Limit, read};

const HEADER: &str = "file,col,row,u_px,v_px";
/// Most columns or rows of points that a board may have.
pub(super) const MOST_POINTS: usize = 1000;

/// Reads a table: points by file name, as they stand there (OpenCV counts from the centre of the first pixel).
///
/// # Errors
/// A line that is not five values, a column or row that is no small whole number, a place that is no number, a point
/// that stands there twice for one file; with file and line.
pub fn read_corners(path: &Path) -> Result<BTreeMap<String, Vec<Seen>>> {
    let text = String::from_utf8_lossy(&read(path, Limit::TABLE)?).into_owned();
    let mut all: BTreeMap<String, Vec<Seen>> = BTreeMap::new();
    let mut known = HashSet::new();
    for (index, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let (number, line) = (index + 1, line.trim());
        if line.is_empty() || line.starts_with('#') || line == HEADER {
            continue;
        }
        let (file, seen) = parse(path, number, line)?;
        if !known.insert((file, seen.point)) {
            let found = format!("point {} {} of {file} again", seen.point[0], seen.point[1]);
            return Err(Error::input(path, number, found, "each point of a file once"));
        }
        all.entry(file.to_owned()).or_default().push(seen);
    }
    if all.is_empty() {
        return Err(Error::input(path, None, "no corner", format!("lines of {HEADER}")));
    }
    Ok(all)
}

fn parse<'a>(path: &Path, number: usize, line: &'a str) -> Result<(&'a str, Seen)> {
    let fields: Vec<&str> = line.split(',').map(str::trim).collect();
    let &[file, column, row, u, v] = fields.as_slice() else {
        let found = counted(fields.len(), "value", "values");
        return Err(Error::input(path, number, found, format!("five: {HEADER}")));
    };
    let whole = |name: &str, text: &str| {
        let value = text.parse::<usize>().ok().filter(|v| *v < MOST_POINTS);
        let expected = format!("a whole number from 0 to {}", MOST_POINTS - 1);
        value.ok_or_else(|| Error::input(path, number, format!("{name} = `{text}`"), expected))
    };
    let place = |name: &str, text: &str| {
        let value = text.parse::<f64>().ok().filter(|v| v.is_finite() && v.abs() < 1e6);
        value.ok_or_else(|| Error::input(path, number, format!("{name} = `{text}`"), "a place in px"))
    };
    let point = [whole("col", column)?, whole("row", row)?];
    Ok((file, Seen { point, px: DVec2::new(place("u_px", u)?, place("v_px", v)?) }))
}

/// The table of what was seen; places count from the corner of the first pixel, as everywhere here.
pub fn write_corners(pictures: &[Picture], views: &[View]) -> String {
    let mut text = format!("{HEADER}\n");
    for view in views {
        let name = &pictures[view.picture].name;
        for s in &view.seen {
            text += &format!("{name},{},{},{:.4},{:.4}\n", s.point[0], s.point[1], s.px.x, s.px.y);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Result<BTreeMap<String, Vec<Seen>>> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("corners.csv");
        std::fs::write(&path, text).expect("written");
        read_corners(&path)
    }

    #[test]
    fn a_table_is_read_and_bad_lines_are_named() {
        let all = table("file,col,row,u_px,v_px\n\na.png, 0,1,2.5,-3\nb.png,8,5,1e2,7\n").expect("a table");
        assert_eq!(all["a.png"][0], Seen { point: [0, 1], px: DVec2::new(2.5, -3.0) });
        for (text, said) in [
            ("a.png,0,0,1\n", ":1: found 4 values"),
            ("a.png,0,0,1,2\na.png,x,0,1,2\n", ":2: found col = `x`"),
            ("a.png,0,-1,1,2\n", "row = `-1`"),
            ("a.png,0,0,nan,2\n", "u_px = `nan`"),
            ("a.png,0,0,1,2\na.png,0,0,1,2\n", ":2: found point 0 0 of a.png again"),
            ("# nothing\n", "no corner"),
        ] {
            let error = table(text).expect_err(text).to_string();
            assert!(error.contains(said), "{error}");
        }
    }
}
