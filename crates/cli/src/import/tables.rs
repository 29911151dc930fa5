//! Tables in data sets: lines of numbers.

use std::fmt::Write as _;
use std::path::Path;

use glam::{DQuat, DVec3};

use super::contents::checked_pose;
use super::poses::IMU_HEADER;
use shutterbug::camera::{Pose, Stamp, Trajectory};
use shutterbug::capture::{IMU_COLUMNS, check_columns, check_rates, read_text};
use shutterbug::error::{Error, Result};
use shutterbug::files::Limit;

/// Line numbers from 1 and lines with content.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.trim_start_matches('\u{feff}').lines().enumerate();
    lines.map(|(i, l)| (i + 1, l.trim())).filter(|(_, l)| !l.is_empty() && !l.starts_with('#'))
}

fn seconds(path: &Path, line: usize, text: &str) -> Result<i64> {
    let stamp = Stamp::parse_seconds(text).map_err(|_| {
        let found = format!("time `{}`", super::shortened(text));
        Error::input(path, line, found, "a number of s within 292 years of zero")
    })?;
    // Half a ns is below what a frame's timestamp can hold.
    Ok(stamp.ns.saturating_add(stamp.fraction_ns.round() as i64))
}

fn increasing(path: &Path, line: usize, ns: i64, last: Option<i64>) -> Result<()> {
    match last {
        Some(last) if ns <= last => {
            Err(Error::input(path, line, format!("time {ns} ns after {last} ns"), "times that increase"))
        }
        _ => Ok(()),
    }
}

/// TUM's `rgb.txt`: `seconds folder/name.png` a line.
pub(super) fn tum_list(path: &Path) -> Result<Vec<(i64, String)>> {
    let expected = "lines of `seconds rgb/name.png`";
    let text = read_text(path, expected, Limit::TABLE)?;
    let mut files: Vec<(i64, String)> = Vec::new();
    for (line, content) in lines(&text) {
        let Some((time, name)) = content.split_once(char::is_whitespace) else {
            return Err(Error::input(path, line, format!("`{}`", super::shortened(content)), expected));
        };
        let (ns, name) = (seconds(path, line, time)?, name.trim());
        increasing(path, line, ns, files.last().map(|f| f.0))?;
        let folder = |n: &str| n.rsplit_once('/').map_or(String::new(), |(f, _)| f.to_owned());
        let out = name.starts_with('/') || name.split('/').any(|part| part == ".." || part.is_empty());
        if out || files.first().is_some_and(|(_, first)| folder(first) != folder(name)) {
            let found = format!("file `{}`", super::shortened(name));
            return Err(Error::input(path, line, found, "files of one folder below this one"));
        }
        files.push((ns, name.to_owned()));
    }
    if files.is_empty() { Err(Error::input(path, None, "no picture", expected)) } else { Ok(files) }
}

/// TUM's `groundtruth.txt`: `seconds tx ty tz qx qy qz qw` a line, camera to world.
pub(super) fn tum_poses(path: &Path) -> Result<Vec<(i64, Pose)>> {
    let expected = "eight numbers: t tx ty tz qx qy qz qw";
    let text = read_text(path, expected, Limit::TABLE)?;
    Trajectory::check_columns(path, &text)?;
    let mut poses: Vec<(i64, Pose)> = Vec::new();
    for (line, content) in lines(&text) {
        let fields: Vec<&str> = content.split_whitespace().collect();
        let numbers: Vec<f64> = fields.iter().skip(1).filter_map(|f| f.parse().ok()).collect();
        let [x, y, z, qx, qy, qz, qw] = numbers[..] else {
            return Err(Error::input(path, line, format!("`{}`", super::shortened(content)), expected));
        };
        let ns = seconds(path, line, fields[0])?;
        increasing(path, line, ns, poses.last().map(|p| p.0))?;
        let pose = checked_pose([x, y, z], [qx, qy, qz, qw]);
        poses.push((ns, pose.map_err(|f| Error::input(path, line, f.found, f.expected))?));
    }
    if poses.is_empty() { Err(Error::input(path, None, "no pose", expected)) } else { Ok(poses) }
}

/// EuRoC's `imu0/data.csv` with its axes turned.
pub(super) fn imu_table(path: &Path, text: &str, turn: DQuat, axes: &str) -> Result<String> {
    let expected = "timestamp [ns] and six numbers: rates [rad/s], accelerations [m/s^2]";
    check_columns(path, text, &IMU_COLUMNS)?;
    let mut out = format!("# axes {axes}\n{IMU_HEADER}\n");
    let mut last = None;
    let mut rates = Vec::new();
    for (line, content) in lines(text) {
        let fields: Vec<&str> = content.split(',').map(str::trim).collect();
        let numbers: Vec<f64> =
            fields.iter().skip(1).filter_map(|f| f.parse().ok()).filter(|n: &f64| n.is_finite()).collect();
        let (Ok(ns), [wx, wy, wz, ax, ay, az]) = (fields[0].parse::<i64>(), &numbers[..]) else {
            return Err(Error::input(path, line, format!("`{}`", super::shortened(content)), expected));
        };
        increasing(path, line, ns, last)?;
        last = Some(ns);
        rates.push([*wx, *wy, *wz]);
        let (w, a) = (turn * DVec3::new(*wx, *wy, *wz), turn * DVec3::new(*ax, *ay, *az));
        writeln!(out, "{ns},{:?},{:?},{:?},{:?},{:?},{:?}", w.x, w.y, w.z, a.x, a.y, a.z)
            .expect("writing to a String cannot fail");
    }
    check_rates(path, rates)?;
    if last.is_none() { Err(Error::input(path, None, "no sample", expected)) } else { Ok(out) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quaternions_in_another_order_are_not_taken_for_tums() {
        let read = |names: &str| {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("groundtruth.txt");
            std::fs::write(&path, format!("# timestamp tx ty tz {names}\n1.0 0 0 0 0.5 0.5 0.5 0.5\n"))
                .unwrap();
            tum_poses(&path)
        };
        let error = read("qw qx qy qz").unwrap_err().to_string();
        assert!(error.contains("groundtruth.txt:1") && error.contains("qw qx qy qz"), "{error}");
        assert!(read("qx qy qz qw").is_ok(), "control");
    }

    #[test]
    fn rates_in_degrees_are_not_taken_for_radians() {
        let table = |unit: &str| format!("#timestamp [ns],w_RS_S_x [{unit}]\n1,0.1,0.2,0.3,0,0,9.8\n");
        let read = |unit: &str| imu_table(Path::new("data.csv"), &table(unit), DQuat::IDENTITY, "of a test");
        let error = read("deg s^-1").expect_err("another unit").to_string();
        assert!(error.contains("data.csv:1") && error.contains("[deg s^-1]"), "{error}");
        assert!(read("rad s^-1").is_ok(), "control");
    }
}
