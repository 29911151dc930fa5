//! Kalibr's `target.yaml`: the board that a calibration was made with.

use std::path::Path;

use super::yaml::{self, Field};
use shutterbug::error::{Error, Result};
use shutterbug::files::{Limit, read};

/// Most inner corners or tags along a side, the range of a square's or tag's side, m, and of the gap between tags over
/// their side.
const MOST_ALONG: u32 = 999;
const SIDE_M: (f64, f64) = (1e-6, 1e3);
const SPACING: (f64, f64) = (0.05, 1.0);
/// The only family of tags that Kalibr detects.
const FAMILY: &str = "t36h11";

/// A board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KalibrTarget {
    /// Squares.
    Checkerboard {
        /// Columns and rows of inner corners.
        inner_corners: [usize; 2],
        /// Side of a square along columns (x) and rows (y), m.
        square_m: [f64; 2],
    },
    /// Tags of the family t36h11.
    Aprilgrid {
        /// Columns and rows.
        tags: [usize; 2],
        /// Side of a tag, m.
        side_m: f64,
        /// Gap between two tags over the side of one.
        spacing: f64,
    },
}

/// Reads it.
///
/// # Errors
/// A file that is not YAML, lacks a key, or describes another kind of target, with its line.
pub fn read_target(path: &Path) -> Result<KalibrTarget> {
    let text = String::from_utf8_lossy(&read(path, Limit::SETTINGS)?).into_owned();
    let documents = yaml::parse(path, &text)?;
    let top = Field::top(path, &documents[0]);
    let kind = top.require("target_type", "the kind of target: checkerboard or aprilgrid")?;
    match kind.text("checkerboard or aprilgrid")? {
        "checkerboard" => checkerboard(path, &top),
        "aprilgrid" => aprilgrid(path, &top),
        name => {
            let expected = "checkerboard or aprilgrid; corners of others are read from a table (--corners)";
            Err(Error::input(path, kind.line(), format!("a target of type `{name}`"), expected))
        }
    }
}

fn checkerboard(path: &Path, top: &Field<'_>) -> Result<KalibrTarget> {
    let inner_corners = along(path, top, ["targetCols", "targetRows"], "inner corners")?;
    if inner_corners.iter().any(|c| *c < 2) {
        let found = format!("{}x{} inner corners", inner_corners[0], inner_corners[1]);
        return Err(Error::input(path, None, found, "at least 2x2"));
    }
    let side = |key: &str| top.require(key, "side of a square, m")?.number_in("m", SIDE_M);
    Ok(KalibrTarget::Checkerboard {
        inner_corners,
        square_m: [side("colSpacingMeters")?, side("rowSpacingMeters")?],
    })
}

fn aprilgrid(path: &Path, top: &Field<'_>) -> Result<KalibrTarget> {
    if let Some(family) = top.get("tagFamily") {
        let name = family.text(FAMILY)?;
        if !["t36h11", "tag36h11"].contains(&name) {
            return Err(Error::input(path, family.line(), format!("tags of the family `{name}`"), FAMILY));
        }
    }
    let tags = along(path, top, ["tagCols", "tagRows"], "tags")?;
    let side_m = top.require("tagSize", "side of a tag, m")?.number_in("m", SIDE_M)?;
    let what = "gap between two tags over the side of one";
    let spacing = top.require("tagSpacing", what)?.number_in("of a tag's side", SPACING)?;
    Ok(KalibrTarget::Aprilgrid { tags, side_m, spacing })
}

/// Columns and rows, at least one of each.
fn along(path: &Path, top: &Field<'_>, keys: [&str; 2], what: &str) -> Result<[usize; 2]> {
    let count = |key: &str| -> Result<usize> {
        Ok(top.require(key, &format!("number of {what}"))?.whole(MOST_ALONG)? as usize)
    };
    let both = [count(keys[0])?, count(keys[1])?];
    if both.contains(&0) {
        return Err(Error::input(
            path,
            None,
            format!("{}x{} {what}", both[0], both[1]),
            "at least one of each",
        ));
    }
    Ok(both)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target(text: &str) -> Result<KalibrTarget> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("target.yaml");
        std::fs::write(&path, text).expect("written");
        read_target(&path)
    }

    const CHECKERBOARD: &str = "target_type: 'checkerboard'\ntargetCols: 6\ntargetRows: 7\nrowSpacingMeters: 0.06\n\
        colSpacingMeters: 0.05\n";
    const APRILGRID: &str =
        "target_type: 'aprilgrid' #gridtype\ntagCols: 6\ntagRows: 5\ntagSize: 0.088 #[m]\ntagSpacing: 0.3\n";

    #[test]
    fn both_kinds_are_read() {
        let read = target(CHECKERBOARD).expect("a checkerboard");
        let expected = KalibrTarget::Checkerboard { inner_corners: [6, 7], square_m: [0.05, 0.06] };
        assert_eq!(read, expected);
        let read = target(APRILGRID).expect("a grid of tags");
        assert_eq!(read, KalibrTarget::Aprilgrid { tags: [6, 5], side_m: 0.088, spacing: 0.3 });
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, said) in [
            ("target_type: 'circlegrid'\ntargetCols: 6\n", ":1: found a target of type `circlegrid`"),
            (&CHECKERBOARD.replace("targetCols", "targetcols"), "targetCols"),
            (&CHECKERBOARD.replace("6\n", "1\n"), "inner corners"),
            (&CHECKERBOARD.replace("0.06", "-1"), "rowSpacingMeters"),
            (&APRILGRID.replace("tagSpacing", "spacing"), "tagSpacing"),
            (&APRILGRID.replace("0.3", "30"), "tagSpacing"),
            (&APRILGRID.replace("tagRows: 5", "tagRows: 0"), "6x0 tags"),
            (&format!("{APRILGRID}tagFamily: 't25h9'\n"), "t25h9"),
        ] {
            let error = target(text).expect_err(text).to_string();
            assert!(error.contains(said), "{error}");
        }
    }
}
