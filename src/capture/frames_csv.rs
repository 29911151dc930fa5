//! `frames.csv`: `timestamp in ns,file name`, one line a frame.

use std::collections::HashMap;
use std::path::Path;

use crate::camera::Stamp;
use crate::error::{Error, Result};

/// One line of `frames.csv`.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameEntry {
    /// START of exposure of the first row exposed, as written, ns.
    pub timestamp_ns: i64,
    /// The same, s on the capture's clock.
    pub start_s: f64,
    /// File name, as written: `000000.png`.
    pub filename: String,
}

/// Reads the text of `frames.csv`; `path` is what errors name. A header and comments (`#`) are optional; blank lines,
/// CRLF and a byte order mark are skipped over. Times are on the capture's clock: see
/// [`clock_epoch_ns`].
///
/// # Errors
/// No frame, a timestamp that is not a whole number of ns or does not increase, a file name that stands twice or that
/// is no plain name in a folder; with file and line.
pub fn parse_frames(path: &Path, text: &str) -> Result<Vec<FrameEntry>> {
    let mut frames: Vec<FrameEntry> = Vec::new();
    let mut lines: Vec<usize> = Vec::new();
    // By stem: results for a.png and a.jpg would be written to the same file.
    let mut stems: HashMap<String, usize> = HashMap::new();
    for (index, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let (number, line) = (index + 1, line.trim());
        if line.is_empty() || line.starts_with('#') {
            check_unit(path, number, line)?;
            continue;
        }
        let (timestamp_ns, filename) = parse_line(path, number, line)?;
        if let (Some(last), Some(last_line)) = (frames.last(), lines.last())
            && timestamp_ns <= last.timestamp_ns
        {
            let found =
                format!("timestamp {timestamp_ns} ns after {} ns in line {last_line}", last.timestamp_ns);
            return Err(Error::input(path, number, found, "timestamps that increase"));
        }
        let stem = Path::new(filename).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if let Some(first) = stems.insert(stem, number) {
            let found = format!("file name `{filename}` again, after line {first}");
            return Err(Error::input(path, number, found, "names that differ, leaving the extension aside"));
        }
        let epoch_ns = clock_epoch_ns(frames.first().map_or(timestamp_ns, |f| f.timestamp_ns));
        let start_s = Stamp::from_ns(timestamp_ns).seconds_since(epoch_ns);
        frames.push(FrameEntry { timestamp_ns, start_s, filename: filename.to_owned() });
        lines.push(number);
    }
    if frames.is_empty() {
        return Err(Error::input(path, None, "no frame", "at least one line `timestamp in ns,file name`"));
    }
    Ok(frames)
}

/// Zero of the clock of a capture whose first frame has this timestamp, ns.
///
/// The files' own zero wherever f64 seconds hold their stamps to a ns, so that times read as written and a `flicker`
/// keeps its phase; for larger stamps (unix time) the whole second at or before the first frame, which keeps the phase
/// of every whole number of Hz.
pub fn clock_epoch_ns(first_timestamp_ns: i64) -> i64 {
    const SECOND_NS: i64 = 1_000_000_000;
    // Up to here neighbouring f64 seconds are less than 0.12 ns apart.
    const EXACT_NS: i64 = 1_000_000 * SECOND_NS;
    if (-EXACT_NS..EXACT_NS).contains(&first_timestamp_ns) {
        return 0;
    }
    // The smallest i64 has no whole second before it.
    first_timestamp_ns.saturating_sub(first_timestamp_ns.rem_euclid(SECOND_NS))
}

/// A header that states another unit is believed, not the numbers below it: all of them would be read as ns.
fn check_unit(path: &Path, number: usize, line: &str) -> Result<()> {
    let first = line.split(',').next().unwrap_or_default();
    let unit = first.split_once('[').and_then(|(_, rest)| rest.split_once(']')).map(|(unit, _)| unit.trim());
    match unit.filter(|u| ["s", "ms", "us", "\u{b5}s", "\u{3bc}s"].contains(u)) {
        Some(unit) => {
            Err(Error::input(path, number, format!("timestamps in `[{unit}]`"), "timestamps in [ns]"))
        }
        None => Ok(()),
    }
}

fn parse_line<'a>(path: &Path, number: usize, line: &'a str) -> Result<(i64, &'a str)> {
    let Some((timestamp, filename)) = line.split_once(',') else {
        return Err(Error::input(
            path,
            number,
            format!("`{}`", shortened(line)),
            "`timestamp in ns,file name`",
        ));
    };
    let (timestamp, filename) = (timestamp.trim(), filename.trim());
    let timestamp_ns = timestamp.parse::<i64>().map_err(|_| {
        let hint = if timestamp.parse::<f64>().is_ok_and(f64::is_finite) { "; is it in s?" } else { "" };
        let found = format!("timestamp `{}`", shortened(timestamp));
        Error::input(path, number, found, format!("a whole number of ns that fits in 64 bits{hint}"))
    })?;
    if !is_plain_name(filename) {
        let found = format!("file name `{}`", shortened(filename).escape_debug());
        return Err(Error::input(path, number, found, "a plain name such as 000000.png, without folders"));
    }
    Ok((timestamp_ns, filename))
}

/// Whether this is the name of a file in a folder, not a way to one elsewhere.
pub fn is_plain_name(name: &str) -> bool {
    let elsewhere = |c: char| "/\\,:".contains(c) || c.is_control();
    !name.is_empty() && !name.starts_with('.') && !name.contains(elsewhere)
}

/// The start of what was found, so that an error stays one line.
fn shortened(text: &str) -> String {
    text.chars().take(60).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn header_comments_and_line_ends_do_not_matter() {
        let plain = parse_frames(Path::new("f.csv"), "1700000000000000001,a.png\n1700000000033333334,b.jpg")
            .expect("valid");
        let text = "\u{feff}#timestamp [ns],filename\r\n1700000000000000001, a.png \r\n\r\n# more\r\n\
            1700000000033333334,b.jpg\r\n";
        assert_eq!(parse_frames(Path::new("f.csv"), text).expect("valid"), plain);
        assert_eq!(plain.len(), 2);
        assert_eq!((plain[0].timestamp_ns, plain[0].start_s), (1_700_000_000_000_000_001, 1e-9));
        assert_eq!((plain[1].start_s, plain[1].filename.as_str()), (0.033_333_334, "b.jpg"));
    }

    #[test]
    fn a_header_with_another_unit_is_no_header_of_ns() {
        for unit in ["s", "ms", "us", "\u{b5}s"] {
            let text = format!("# frames\n#timestamp [{unit}],filename\n10000000,a.png\n");
            let said = parse_frames(Path::new("f.csv"), &text).expect_err("refused").to_string();
            assert!(said.contains(&format!("f.csv:2: found timestamps in `[{unit}]`")), "{said}");
        }
        let text = "#timestamp [ns],filename [s]\n# of [my] camera\n1,a.png\n";
        assert!(parse_frames(Path::new("f.csv"), text).is_ok(), "control");
    }

    #[test]
    fn small_stamps_read_as_written_and_large_ones_keep_whole_seconds() {
        let start_s = |text: &str| parse_frames(Path::new("f.csv"), text).expect("valid")[0].start_s;
        assert_eq!(start_s("12681566140,a.png"), 12.681_566_14);
        assert_eq!(start_s("-5,a.png"), -5e-9);
        assert_eq!(start_s("1700000000250000000,a.png"), 0.25);
    }

    #[test]
    fn stamps_may_be_negative_and_far_apart() {
        let text = format!("{},a.png\n{},b.png", i64::MIN, i64::MAX);
        let frames = parse_frames(Path::new("f.csv"), &text).expect("valid");
        assert_eq!(frames[1].start_s, (u64::MAX as f64) / 1e9);
    }
}
