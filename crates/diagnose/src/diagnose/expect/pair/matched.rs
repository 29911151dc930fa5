//! Which simulated frame goes with which real one.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use crate::listing::{self, PICTURES};
use shutterbug::capture::{FrameEntry, is_plain_name, of_period, parse_frames, read_text, spacing_warning};
use shutterbug::error::{Error, Result, one_line};
use shutterbug::files::{Limit, is_there};

/// The file beside the folders, or in one of them.
const MATCH_FILE: &str = "match.csv";

/// A simulated frame and the real one that goes with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Matched {
    /// File name in the folder of the simulated frames.
    pub sim: String,
    /// File name in the folder of the real ones.
    pub real: String,
}

/// Pairs the frames of two folders: by a file of matches, by time where both have a `frames.csv`, else by name.
///
/// # Errors
/// A folder without pictures; a line that names a file that is not there; nothing that matches.
pub(super) fn matched(sim: &Path, real: &Path, given: Option<&Path>) -> Result<Vec<Matched>> {
    let (sims, reals) = (pictures(sim)?, pictures(real)?);
    let beside = [Some(sim), Some(real), sim.parent(), real.parent()];
    let mut found = beside.into_iter().flatten().map(|folder| folder.join(MATCH_FILE));
    if let Some(path) = given.map(Path::to_owned).or_else(|| found.find(|p| is_there(p))) {
        return by_file(&path, (sim, real));
    }
    if let (Some(a), Some(b)) = (times(sim)?, times(real)?) {
        return by_time((sim, &a), (real, &b));
    }
    by_name((sim, &sims), (real, &reals))
}

/// Refuses two pictures of one name: as which of them a frame is meant cannot be told, and one frame would count twice.
pub(crate) fn one_a_name(folder: &Path, sorted: &[String]) -> Result<()> {
    let mut of: HashMap<&str, &String> = HashMap::new();
    for name in sorted {
        if let Some(other) = of.insert(stem(name), name) {
            let found = format!("{other} and {name}");
            return Err(Error::input(
                folder,
                None,
                found,
                "names that differ, endings aside: one picture a frame",
            ));
        }
    }
    Ok(())
}

/// The pictures in a folder, by name.
///
/// # Errors
/// No folder, or none in it.
pub(crate) fn pictures(folder: &Path) -> Result<Vec<String>> {
    if !folder.is_dir() {
        return Err(Error::input(folder, None, "no such folder", "a folder of pictures (PNG or JPEG)"));
    }
    let names = ending_with(folder, &PICTURES)?;
    if names.is_empty() {
        return Err(Error::input(folder, None, "no picture", "frames as PNG or JPEG"));
    }
    Ok(names)
}

/// The files of a folder with one of these endings (in small letters), by name; hidden ones are not asked for.
///
/// # Errors
/// A folder that cannot be listed.
pub(super) fn ending_with(folder: &Path, endings: &[&str]) -> Result<Vec<String>> {
    let names = listing::ending_with(folder, endings)?;
    Ok(names.into_iter().filter_map(|name| name.into_string().ok()).collect())
}

pub(super) fn stem(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

fn by_name((sim, sims): (&Path, &[String]), (real, reals): (&Path, &[String])) -> Result<Vec<Matched>> {
    one_a_name(sim, sims)?;
    one_a_name(real, reals)?;
    let of: HashMap<&str, &String> = reals.iter().map(|r| (stem(r), r)).collect();
    let pair = |s: &String| Some(Matched { sim: s.clone(), real: (*of.get(stem(s))?).clone() });
    let all: Vec<Matched> = sims.iter().filter_map(pair).collect();
    if all.is_empty() {
        let found = format!(
            "{} in {} and {} in {}: no name in both",
            sims[0],
            sim.display(),
            reals[0],
            real.display()
        );
        let expected =
            "equal names, a match.csv with lines `sim,real`, frames.csv in both folders, or --unpaired";
        return Err(Error::input(real, None, found, expected));
    }
    Ok(all)
}

fn by_file(path: &Path, (sim, real): (&Path, &Path)) -> Result<Vec<Matched>> {
    let text = read_text(path, "lines `sim,real` of file names", Limit::TABLE)?;
    let mut all: BTreeMap<String, String> = BTreeMap::new();
    for (index, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let (number, line) = (index + 1, line.trim());
        if line.is_empty() || line.starts_with('#') || line.replace(' ', "") == "sim,real" {
            continue;
        }
        let Some((a, b)) = line.split_once(',').map(|(a, b)| (a.trim(), b.trim())) else {
            return Err(Error::input(path, number, format!("`{line}`"), "`sim,real`: two file names"));
        };
        for (folder, name) in [(sim, a), (real, b)] {
            if !is_plain_name(name) {
                let found = format!("`{}`", one_line(name));
                return Err(Error::input(path, number, found, "a plain file name, without folders"));
            }
            if !folder.join(name).is_file() {
                let found = format!("`{name}`, which is not in {}", folder.display());
                return Err(Error::input(path, number, found, "names of files that are there"));
            }
        }
        if all.insert(a.to_owned(), b.to_owned()).is_some() {
            return Err(Error::input(path, number, format!("`{a}` again"), "each simulated frame once"));
        }
    }
    if all.is_empty() {
        return Err(Error::input(path, None, "no match", "at least one line `sim,real`"));
    }
    Ok(all.into_iter().map(|(sim, real)| Matched { sim, real }).collect())
}

/// `frames.csv` of a folder, if there is one.
fn times(folder: &Path) -> Result<Option<Vec<FrameEntry>>> {
    let path = folder.join("frames.csv");
    if !is_there(&path) {
        return Ok(None);
    }
    let text = read_text(&path, "lines `timestamp in ns,file name`", Limit::TABLE)?;
    parse_frames(&path, &text).map(Some)
}

/// Each simulated frame with the real one that is nearest in time, not further than half the time to the next.
fn by_time((sim, a): (&Path, &[FrameEntry]), (real, b): (&Path, &[FrameEntry])) -> Result<Vec<Matched>> {
    let steps = b.windows(2).map(|w| w[1].timestamp_ns - w[0].timestamp_ns);
    let half_ns = steps.min().unwrap_or(1_000_000_000) / 2;
    let mut all = Vec::new();
    for s in a {
        let near = b.iter().min_by_key(|r| r.timestamp_ns.abs_diff(s.timestamp_ns));
        let Some(r) = near.filter(|r| r.timestamp_ns.abs_diff(s.timestamp_ns) <= half_ns.unsigned_abs())
        else {
            continue;
        };
        let there = sim.join(&s.filename).is_file() && real.join(&r.filename).is_file();
        if there && all.last().is_none_or(|m: &Matched| m.real != r.filename) {
            all.push(Matched { sim: s.filename.clone(), real: r.filename.clone() });
        }
    }
    if all.is_empty() {
        let found = format!(
            "times from {} ns, and from {} ns in {}",
            b[0].timestamp_ns,
            a[0].timestamp_ns,
            sim.display()
        );
        return Err(Error::input(
            &real.join("frames.csv"),
            None,
            found,
            "times of one clock: no two frames go together",
        ));
    }
    Ok(all)
}

/// When each simulated frame was taken, s: from `frames.csv`, else its number times the period.
///
/// # Errors
/// Those of reading; a frame that is not listed.
pub(super) fn times_s(sim: &Path, matched: &[Matched], period_s: f64) -> Result<Vec<f64>> {
    if let Some(entries) = times(sim)? {
        let of: HashMap<&str, f64> = entries.iter().map(|e| (e.filename.as_str(), e.start_s)).collect();
        let time = |m: &Matched| {
            of.get(m.sim.as_str()).copied().ok_or_else(|| {
                Error::input(
                    &sim.join("frames.csv"),
                    None,
                    format!("no line for {}", m.sim),
                    "every frame with its time",
                )
            })
        };
        return matched.iter().map(time).collect();
    }
    let numbers: Option<Vec<u64>> = matched.iter().map(|m| stem(&m.sim).parse().ok()).collect();
    let rising = numbers.filter(|n| n.windows(2).all(|w| w[0] < w[1]));
    let first = rising.as_ref().map_or(0, |n| n[0]);
    let number = |i: usize| rising.as_ref().map_or(i as u64, |n| n[i] - first);
    Ok((0..matched.len()).map(|i| number(i) as f64 * period_s).collect())
}

/// What is wrong with the period that camera.toml has, by the times that stand beside the frames.
///
/// # Errors
/// A list that cannot be read.
pub(super) fn doubt_of_period(sim: &Path, real: &Path, period_s: f64) -> Result<Option<String>> {
    for folder in [sim, real] {
        if let Some(entries) = times(folder)? {
            let doubt = spacing_warning(&entries, period_s);
            return Ok(doubt.map(|d| format!("{}: {d}", folder.join("frames.csv").display())));
        }
    }
    Ok(of_period(period_s).map(|d| format!("camera.toml: {d}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn folder(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        names.iter().for_each(|n| fs::write(folder.path().join(n), "x").expect("written"));
        folder
    }

    #[test]
    fn a_period_in_milliseconds_is_doubted() {
        let (sim, real) = (folder(&["a.png", "b.png"]), folder(&["a.png", "b.png"]));
        let doubt = |period_s| doubt_of_period(sim.path(), real.path(), period_s).expect("read");
        assert!(doubt(33.3).expect("no times").contains("in ms?"));
        assert_eq!(doubt(0.0333), None);
        fs::write(real.path().join("frames.csv"), "1000000000,a.png\n1033300000,b.png\n").expect("written");
        assert!(doubt(33.3).expect("with times").contains("frames.csv: frames are as near"));
        assert_eq!(doubt(0.0333), None);
    }

    #[test]
    fn frames_are_paired_by_name_by_file_and_by_time() {
        let (sim, real) = (folder(&["a.png", "b.png", "notes.txt"]), folder(&["b.jpg", "c.jpg"]));
        let pair = |a: &str, b: &str| Matched { sim: a.to_owned(), real: b.to_owned() };
        assert_eq!(matched(sim.path(), real.path(), None).expect("one"), [pair("b.png", "b.jpg")]);
        fs::write(real.path().join("match.csv"), "sim,real\na.png, c.jpg\n").expect("written");
        assert_eq!(matched(sim.path(), real.path(), None).expect("one"), [pair("a.png", "c.jpg")]);
        fs::remove_file(real.path().join("match.csv")).expect("removed");
        fs::write(sim.path().join("frames.csv"), "1000,a.png\n2000,b.png\n").expect("written");
        fs::write(real.path().join("frames.csv"), "1100,b.jpg\n2100,c.jpg\n").expect("written");
        let by_time = matched(sim.path(), real.path(), None).expect("two");
        assert_eq!(by_time, [pair("a.png", "b.jpg"), pair("b.png", "c.jpg")]);
    }

    fn name_of(folder: &Path) -> String {
        folder.file_name().expect("a name").to_string_lossy().into_owned()
    }

    #[test]
    fn what_does_not_match_is_said_with_its_line() {
        let (sim, real) = (folder(&["a.png"]), folder(&["z.png"]));
        let said = |r: Result<Vec<Matched>>| r.expect_err("refused").to_string();
        let names = said(matched(sim.path(), real.path(), None));
        assert!(
            names.contains("a.png") && names.contains("z.png") && names.contains("--unpaired"),
            "{names}"
        );
        let list = sim.path().join("m.csv");
        fs::write(&list, "sim,real\na.png,q.png\n").expect("written");
        let line = said(matched(sim.path(), real.path(), Some(&list)));
        assert!(line.contains("m.csv:2") && line.contains("q.png"), "{line}");
        // A file elsewhere is no frame of the folder, whether it is there or not.
        fs::write(&list, format!("a.png,../{}/z.png\n", name_of(real.path()))).expect("written");
        let line = said(matched(sim.path(), real.path(), Some(&list)));
        assert!(line.contains("m.csv:1") && line.contains("without folders"), "{line}");
        let twice = folder(&["a.jpg", "a.png", "b.png"]);
        let two = said(matched(twice.path(), sim.path(), None));
        assert!(two.contains("a.jpg and a.png"), "{two}");
        let empty = folder(&[]);
        assert!(said(matched(empty.path(), real.path(), None)).contains("no picture"));
    }
}
