//! Recorded motion: EuRoC's `mav0` folder and KITTI's poses, as the `frames.csv` and `trajectory.tum` of a capture.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

use super::common::rigid;
use super::yaml::{self, Field, shortened};
use super::{CameraModel, Imported, euroc};
use shutterbug::camera::{Pose, Stamp};
use shutterbug::capture::{FrameEntry, check_columns, parse_frames, read_text};
use shutterbug::error::{Error, Result, counted};
use shutterbug::files::{Limit, is_there};

/// Length of a recorded quaternion, as in `trajectory.tum`.
const QUATERNION_TOLERANCE: f64 = 1e-3;

/// Frames and the camera's poses on one clock.
#[derive(Clone, Debug)]
pub struct Motion {
    /// The camera, where the recording has one.
    pub camera: Option<CameraModel>,
    /// Frames that the poses cover.
    pub frames: Vec<FrameEntry>,
    /// World from camera at increasing times, ns.
    pub poses: Vec<(i64, Pose)>,
    /// What was left out or assumed.
    pub notes: Vec<String>,
}

impl Motion {
    /// The text of `frames.csv`.
    pub fn frames_csv(&self) -> String {
        let mut text = String::from("#timestamp [ns],filename\n");
        text.extend(self.frames.iter().map(|f| format!("{},{}\n", f.timestamp_ns, f.filename)));
        text
    }

    /// The text of `trajectory.tum`, with every nanosecond.
    pub fn trajectory_tum(&self) -> String {
        let mut text =
            String::from("# t tx ty tz qx qy qz qw, camera (x right, y down, z forward) to world\n");
        for (ns, pose) in &self.poses {
            let (t, q) = (pose.translation_m, pose.rotation);
            let sign = if *ns < 0 { "-" } else { "" };
            let (s, rest) = (ns.unsigned_abs() / 1_000_000_000, ns.unsigned_abs() % 1_000_000_000);
            writeln!(
                text,
                "{sign}{s}.{rest:09} {:?} {:?} {:?} {:?} {:?} {:?} {:?}",
                t.x, t.y, t.z, q.x, q.y, q.z, q.w
            )
            .expect("writing to a String cannot fail");
        }
        text
    }

    /// Leaves out frames whose exposure and readout (taken as one frame period at most) the poses do not cover.
    pub(crate) fn keep_covered(&mut self, path: &Path, period_ns: i64) -> Result<()> {
        let (Some(first), Some(last)) = (self.poses.first(), self.poses.last()) else { return Ok(()) };
        let (from, to) = (first.0, last.0);
        let before = self.frames.len();
        self.frames.retain(|f| f.timestamp_ns >= from && f.timestamp_ns.saturating_add(period_ns) <= to);
        let lost = before - self.frames.len();
        if self.frames.is_empty() {
            let found = format!(
                "poses from {from} ns to {to} ns, and {} outside",
                counted(before, "frame", "frames")
            );
            return Err(Error::input(path, None, found, "poses that cover frames: are both on one clock?"));
        }
        if lost > 0 {
            self.notes.push(format!(
                "{lost} of {} left out: poses reach from {from} ns to {to} ns and are never \
                 extrapolated",
                counted(before, "frame is", "frames are")
            ));
        }
        Ok(())
    }
}

/// Reads a EuRoC / ASL recording: `mav0` or the folder that holds it. The camera's pose is the body's, of
/// `state_groundtruth_estimate0`, times the camera's `T_BS`. `camera` is its folder, `cam0` if not given.
///
/// # Errors
/// What is missing or wrong, with file and line; no frame that the poses cover.
pub fn read_euroc(folder: &Path, camera: Option<&str>) -> Result<Motion> {
    let inner = folder.join("mav0");
    let root = if inner.is_dir() { inner } else { folder.to_owned() };
    let camera_folder = root.join(camera.unwrap_or("cam0"));
    let Imported { camera, notes } =
        super::read_camera(&camera_folder.join("sensor.yaml"), Some(super::Format::Euroc), None)?;
    let path = camera_folder.join("data.csv");
    let frames = parse_frames(
        &path,
        &read_text(&path, "the frames: lines of `timestamp in ns,file name`", Limit::TABLE)?,
    )?;
    let truth = root.join("state_groundtruth_estimate0");
    let path = truth.join("data.csv");
    let purpose = "the body's poses: lines of timestamp [ns], px, py, pz, qw, qx, qy, qz, ...";
    let mut poses = parse_ground_truth(&path, &read_text(&path, purpose, Limit::TABLE)?)?;
    // World from the tracked sensor, sensor to body, body to camera.
    let body_from_camera = camera.body_from_camera.unwrap_or(Pose::IDENTITY);
    let sensor_from_camera = match body_from_truth(&truth.join("sensor.yaml"))? {
        Some(body_from_sensor) => body_from_sensor.inverse().then_from(&body_from_camera),
        None => body_from_camera,
    };
    for (_, pose) in &mut poses {
        *pose = pose.then_from(&sensor_from_camera);
        pose.rotation = pose.rotation.normalize();
    }
    let period_ns = camera.rate_hz.map_or_else(|| median_step_ns(&frames), |rate| (1e9 / rate) as i64);
    let mut motion = Motion { camera: Some(camera), frames, poses, notes };
    if motion.camera.as_ref().is_some_and(|c| c.body_from_camera.is_none()) {
        motion.notes.push("the camera has no T_BS: its poses are taken as the body's".to_owned());
    }
    motion.notes.push(
        "timestamps are taken as the START of exposure of the first row; where the recorder stamps the middle, set \
         [time_offset] offset_s"
            .to_owned(),
    );
    motion.keep_covered(&path, period_ns)?;
    Ok(motion)
}

/// `T_BS` of the ground truth's own sensor, if it says one.
fn body_from_truth(path: &Path) -> Result<Option<Pose>> {
    if is_there(path) { body_from_sensor(path) } else { Ok(None) }
}

/// `T_BS` of a sensor's `sensor.yaml`, if it says one.
///
/// # Errors
/// A file that is missing or holds something else; with file and line.
pub fn body_from_sensor(path: &Path) -> Result<Option<Pose>> {
    let documents = yaml::parse(path, &read_text(path, "a sensor.yaml", Limit::SETTINGS)?)?;
    euroc::body_from_sensor(&Field::top(path, &documents[0]))
}

fn median_step_ns(frames: &[FrameEntry]) -> i64 {
    let mut steps: Vec<i64> =
        frames.windows(2).map(|w| w[1].timestamp_ns.saturating_sub(w[0].timestamp_ns)).collect();
    steps.sort_unstable();
    steps.get(steps.len() / 2).copied().unwrap_or(0)
}

/// What EuRoC's ground truth may say of the columns that are read.
const TRUTH_COLUMNS: [(&str, &str); 8] = [
    ("timestamp", "ns"),
    ("p_RS_R_x", "m"),
    ("p_RS_R_y", "m"),
    ("p_RS_R_z", "m"),
    ("q_RS_w", ""),
    ("q_RS_x", ""),
    ("q_RS_y", ""),
    ("q_RS_z", ""),
];

/// Lines `timestamp [ns], px, py, pz, qw, qx, qy, qz, ...` (scalar first); further columns are velocities and biases.
pub(super) fn parse_ground_truth(path: &Path, text: &str) -> Result<Vec<(i64, Pose)>> {
    let expected = "timestamp [ns], px, py, pz [m], qw, qx, qy, qz, ...";
    check_columns(path, text, &TRUTH_COLUMNS)?;
    let mut poses: Vec<(i64, Pose)> = Vec::new();
    for (number, line) in content_lines(text) {
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        if fields.len() < 8 {
            return Err(Error::input(path, number, counted(fields.len(), "value", "values"), expected));
        }
        let ns: i64 = fields[0].parse().map_err(|_| {
            let found = format!("timestamp `{}`", shortened(fields[0]));
            Error::input(path, number, found, "a whole number of ns that fits in 64 bits")
        })?;
        if let Some((last, _)) = poses.last().filter(|(last, _)| ns <= *last) {
            return Err(Error::input(
                path,
                number,
                format!("time {ns} ns after {last} ns"),
                "times that increase",
            ));
        }
        let [px, py, pz, qw, qx, qy, qz] = numbers(path, number, &fields[1..8])?;
        let rotation = DQuat::from_xyzw(qx, qy, qz, qw);
        // Components are at most 1e9, so the length is finite.
        if (rotation.length() - 1.0).abs() > QUATERNION_TOLERANCE {
            let found = format!("a quaternion of length {:.6}", rotation.length());
            return Err(Error::input(path, number, found, "a unit quaternion qw, qx, qy, qz"));
        }
        poses.push((ns, Pose { rotation: rotation.normalize(), translation_m: DVec3::new(px, py, pz) }));
    }
    if poses.is_empty() {
        return Err(Error::input(path, None, "no pose", expected));
    }
    Ok(poses)
}

/// Reads KITTI odometry: twelve numbers a line (a 3x4 matrix, row by row: camera 0 to its first position), and
/// `times.txt` (seconds, a line a pose), by default beside it or one folder up. Images are `NNNNNN.png`.
///
/// # Errors
/// What is missing or wrong, with file and line; files of different length.
pub fn read_kitti(poses_path: &Path, times: Option<&Path>) -> Result<Motion> {
    let text = read_text(poses_path, "KITTI poses: lines of twelve numbers, a 3x4 matrix", Limit::TABLE)?;
    let poses = parse_kitti_poses(poses_path, &text)?;
    let times_path = times.map_or_else(|| times_beside(poses_path), Path::to_owned);
    let times = read_times(&times_path)?;
    if times.len() != poses.len() {
        let found = format!(
            "{} for {} of {}",
            counted(times.len(), "time", "times"),
            counted(poses.len(), "pose", "poses"),
            poses_path.display()
        );
        return Err(Error::input(&times_path, None, found, "one time a pose"));
    }
    let epoch_ns = times[0];
    let frame = |(i, &ns): (usize, &i64)| FrameEntry {
        timestamp_ns: ns,
        start_s: Stamp::from_ns(ns).seconds_since(epoch_ns),
        filename: format!("{i:06}.png"),
    };
    let frames: Vec<_> = times.iter().enumerate().map(frame).collect();
    let period_ns = median_step_ns(&frames);
    let notes = vec![
        "KITTI's world is the first camera (y down): turn the scene, not the poses, where z must be up"
            .to_owned(),
        "KITTI's poses hold no camera: write camera.toml from the rectified P of calib.txt".to_owned(),
    ];
    let poses = times.iter().copied().zip(poses).collect();
    let mut motion = Motion { camera: None, frames, poses, notes };
    motion.keep_covered(poses_path, period_ns)?;
    Ok(motion)
}

/// `times.txt` beside the poses, or `sequences/NN/times.txt` for `poses/NN.txt`, as KITTI lays it out.
fn times_beside(poses: &Path) -> PathBuf {
    let beside = poses.with_file_name("times.txt");
    let stem = poses.file_stem().unwrap_or_default();
    let laid_out =
        poses.parent().and_then(Path::parent).map(|p| p.join("sequences").join(stem).join("times.txt"));
    match laid_out {
        Some(path) if !is_there(&beside) && is_there(&path) => path,
        _ => beside,
    }
}

/// KITTI's `times.txt`: increasing times, ns.
///
/// # Errors
/// What is missing or wrong, with file and line.
pub fn read_times(path: &Path) -> Result<Vec<i64>> {
    parse_times(path, &read_text(path, "the poses' times: one number of s a line (--times)", Limit::TABLE)?)
}

/// One pose a line.
pub(super) fn parse_kitti_poses(path: &Path, text: &str) -> Result<Vec<Pose>> {
    let expected = "twelve numbers: a 3x4 matrix, row by row";
    let mut poses = Vec::new();
    for (number, line) in content_lines(text) {
        let fields: Vec<&str> = line.split_whitespace().collect();
        if fields.len() != 12 {
            return Err(Error::input(path, number, counted(fields.len(), "value", "values"), expected));
        }
        let pose = rigid(numbers(path, number, &fields)?);
        poses.push(pose.map_err(|found| {
            Error::input(path, number, format!("a matrix {found}"), "a rotation and a translation")
        })?);
    }
    if poses.is_empty() {
        return Err(Error::input(path, None, "no pose", expected));
    }
    Ok(poses)
}

/// Furthest that frames of a recording are thought to be apart, ns: a frame in a quarter of an hour.
const LONGEST_STEP_NS: f64 = 900e9;

/// Increasing times, s, as ns.
pub(super) fn parse_times(path: &Path, text: &str) -> Result<Vec<i64>> {
    let mut times: Vec<i64> = Vec::new();
    for (number, line) in content_lines(text) {
        let stamp = Stamp::parse_seconds(line).map_err(|_| {
            Error::input(
                path,
                number,
                format!("time `{}`", shortened(line)),
                "a number of s within 292 years of zero",
            )
        })?;
        // Half a ns is below what a frame's timestamp can hold.
        let ns = stamp.ns.saturating_add(stamp.fraction_ns.round() as i64);
        if let Some(last) = times.last().filter(|last| ns <= **last) {
            return Err(Error::input(
                path,
                number,
                format!("time {ns} ns after {last} ns"),
                "times that increase",
            ));
        }
        times.push(ns);
    }
    if times.is_empty() {
        return Err(Error::input(path, None, "no time", "one number of s a line"));
    }
    let step_ns = shutterbug::plane::stats::median(times.windows(2).map(|t| (t[1] - t[0]) as f64));
    if step_ns > LONGEST_STEP_NS {
        let found = format!("times that are {:.0} s apart", 1e-9 * step_ns);
        return Err(Error::input(path, None, found, "times of frames in s: are they in ns?"));
    }
    Ok(times)
}

/// Line numbers from 1 and lines with content: comments (`#`), blank lines, CRLF and a byte order mark are skipped.
fn content_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.trim_start_matches('\u{feff}').lines().enumerate();
    lines.map(|(i, line)| (i + 1, line.trim())).filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

fn numbers<const N: usize>(path: &Path, line: usize, fields: &[&str]) -> Result<[f64; N]> {
    let mut values = [0.0; N];
    for (value, field) in values.iter_mut().zip(fields) {
        *value = field.parse().ok().filter(|v: &f64| v.is_finite() && v.abs() <= 1e9).ok_or_else(|| {
            Error::input(path, line, format!("`{}`", shortened(field)), "a finite number, 1e9 at most")
        })?;
    }
    Ok(values)
}
