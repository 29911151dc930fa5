//! Kalibr's `target.yaml`: the board that a calibration was made with.

use std::path::Path;

use super::yaml::{self, Field};
use shutterbug::error::{Error, Result};
use shutterbug::files::{Limit, read};

/// Most inner corners along a side, and the range of a square's side, m.
const MAX_CORNERS: u32 = 999;
const SIDE_M: (f64, f64) = (1e-6, 1e3);

/// A checkerboard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KalibrTarget {
    /// Columns and rows of inner corners.
    pub inner_corners: [usize; 2],
    /// Side of a square along columns (x) and rows (y), m.
    pub square_m: [f64; 2],
}

/// Reads it.
///
/// # Errors
/// A file that is not YAML, lacks a key, or describes another kind of target, with its line.
pub fn read_target(path: &Path) -> Result<KalibrTarget> {
    let text = String::from_utf8_lossy(&read(path, Limit::SETTINGS)?).into_owned();
    let documents = yaml::parse(path, &text)?;
    let top = Field::top(path, &documents[0]);
    let kind = top.require("target_type", "the kind of target: checkerboard")?;
    let name = kind.text("checkerboard")?;
    if name != "checkerboard" {
        let expected = "checkerboard; the corners of other targets are read from a table (--corners)";
        return Err(Error::input(path, kind.line(), format!("a target of type `{name}`"), expected));
    }
    let corners = |key: &str| -> Result<usize> {
        Ok(top.require(key, "number of inner corners")?.whole(MAX_CORNERS)? as usize)
    };
    let side = |key: &str| top.require(key, "side of a square, m")?.number_in("m", SIDE_M);
    let inner_corners = [corners("targetCols")?, corners("targetRows")?];
    if inner_corners.iter().any(|c| *c < 2) {
        let found = format!("{}x{} inner corners", inner_corners[0], inner_corners[1]);
        return Err(Error::input(path, None, found, "at least 2x2"));
    }
    Ok(KalibrTarget { inner_corners, square_m: [side("colSpacingMeters")?, side("rowSpacingMeters")?] })
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

    #[test]
    fn a_checkerboard_is_read_and_other_targets_are_refused() {
        let text = "target_type: 'checkerboard'\ntargetCols: 6\ntargetRows: 7\nrowSpacingMeters: 0.06\n\
            colSpacingMeters: 0.05\n";
        let read = target(text).expect("a checkerboard");
        assert_eq!(read, KalibrTarget { inner_corners: [6, 7], square_m: [0.05, 0.06] });
        for (text, said) in [
            ("target_type: 'aprilgrid'\ntagCols: 6\n", ":1: found a target of type `aprilgrid`"),
            (&text.replace("targetCols", "targetcols"), "targetCols"),
            (&text.replace("6\n", "1\n"), "inner corners"),
            (&text.replace("0.06", "-1"), "rowSpacingMeters"),
        ] {
            let error = target(text).expect_err(text).to_string();
            assert!(error.contains(said), "{error}");
        }
    }
}
