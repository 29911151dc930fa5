//! A pose over time.

use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

use super::{Pose, Stamp, StampFault};
use crate::error::{Error, Result};

/// How far outside its span a trajectory still answers, with its first or last pose, s. Stamps are whole nanoseconds;
/// this is the rounding of sums such as `start_s + readout_time_s + exposure_time_s`, not an extrapolation.
pub const TIME_TOLERANCE_S: f64 = 1e-9;

/// Furthest coordinate that is accepted, m: far more than the Earth, and squares of it stay finite in an `f32`.
const MAX_COORDINATE_M: f64 = 1e9;

/// How far the length of a recorded quaternion may be from 1. Four decimals, as in the TUM recordings, give 1e-4.
const QUATERNION_TOLERANCE: f64 = 1e-3;

const LINE_FORMAT: &str = "eight numbers: t tx ty tz qx qy qz qw";

/// Poses at increasing times. Between two, the position is linear and the rotation takes the shorter arc.
#[derive(Clone, Debug)]
pub struct Trajectory {
    path: PathBuf,
    times_s: Vec<f64>,
    poses: Vec<Pose>,
}

impl Trajectory {
    /// A trajectory of `times_s` (strictly increasing, s on the capture's clock) and as many poses. `path` is the file
    /// that errors name.
    ///
    /// # Errors
    /// No pose at all, lists of different length, times that do not increase or are not finite.
    pub fn new(path: &Path, times_s: Vec<f64>, poses: Vec<Pose>) -> Result<Self> {
        if times_s.is_empty() || times_s.len() != poses.len() {
            let found = format!("{} times and {} poses", times_s.len(), poses.len());
            return Err(Error::input(path, None, found, "at least one pose, one time each"));
        }
        if let Some(i) = (1..times_s.len()).find(|&i| !(times_s[i] > times_s[i - 1])) {
            let found = format!("{} s after {} s", times_s[i], times_s[i - 1]);
            return Err(Error::input(path, None, found, "times that increase"));
        }
        Ok(Self { path: path.to_owned(), times_s, poses })
    }

    /// Reads the lines `t tx ty tz qx qy qz qw` (s, m, unit quaternion) of a TUM file. Comments (`#`), blank lines,
    /// CRLF and a byte order mark are skipped over. `epoch_ns` is the zero of the capture's clock: it is subtracted
    /// before a time becomes an `f64`. Quaternions are normalised; those further than 1e-3 from length 1 are refused.
    ///
    /// # Errors
    /// No pose, a line that is not eight finite numbers, a time that does not increase, a quaternion that is not a
    /// rotation; with file and line.
    pub fn parse(path: &Path, text: &str, epoch_ns: i64) -> Result<Self> {
        let (mut times_s, mut poses) = (Vec::new(), Vec::new());
        let mut last: Option<(usize, Stamp, &str)> = None;
        for (index, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
            let (number, line) = (index + 1, line.trim());
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let (time, written, pose) = parse_line(path, number, line)?;
            let time_s = time.seconds_since(epoch_ns);
            if let Some((last_number, last_time, last_written)) = last
                // The second comparison is for steps too small for an f64 at this distance from the epoch.
                && (time <= last_time || times_s.last().is_some_and(|&before| time_s <= before))
            {
                let found = format!("time {written} s after {last_written} s in line {last_number}");
                return Err(Error::input(path, number, found, "times that increase"));
            }
            last = Some((number, time, written));
            times_s.push(time_s);
            poses.push(pose);
        }
        if poses.is_empty() {
            return Err(Error::input(path, None, "no pose", format!("lines of {LINE_FORMAT}")));
        }
        Self::new(path, times_s, poses)
    }

    /// Number of poses.
    pub fn pose_count(&self) -> usize {
        self.poses.len()
    }

    /// A pose that never changes and covers all time.
    pub fn fixed(pose: Pose) -> Self {
        Self { path: PathBuf::new(), times_s: vec![f64::NEG_INFINITY, f64::INFINITY], poses: vec![pose; 2] }
    }

    /// The file it was read from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// First and last time, s.
    pub fn span_s(&self) -> (f64, f64) {
        (self.times_s[0], self.times_s[self.times_s.len() - 1])
    }

    /// Whether poses exist for all of `[from_s, to_s]`, to within [`TIME_TOLERANCE_S`].
    pub fn covers(&self, from_s: f64, to_s: f64) -> bool {
        let (first, last) = self.span_s();
        first - TIME_TOLERANCE_S <= from_s && to_s <= last + TIME_TOLERANCE_S
    }

    /// The check that a caller makes once, before it asks for poses.
    ///
    /// # Errors
    /// [`Error::TrajectoryTooShort`] naming the missing span; `what` says whose time it is.
    pub fn require(&self, from_s: f64, to_s: f64, what: &str) -> Result<()> {
        if self.covers(from_s, to_s) {
            return Ok(());
        }
        let (covered_from_s, covered_to_s) = self.span_s();
        Err(Error::TrajectoryTooShort {
            path: self.path.clone(),
            what: what.to_owned(),
            needed_from_s: from_s,
            needed_to_s: to_s,
            covered_from_s,
            covered_to_s,
        })
    }

    /// The pose at a time inside the span (see [`Self::require`]).
    ///
    /// # Panics
    /// More than [`TIME_TOLERANCE_S`] outside the span: poses are never extrapolated.
    pub fn pose_at(&self, time_s: f64) -> Pose {
        let (first, last) = self.span_s();
        assert!(self.covers(time_s, time_s), "{time_s} s lies outside {first} s to {last} s");
        let time_s = time_s.clamp(first, last);
        let after = self.times_s.partition_point(|&t| t <= time_s);
        if after == self.times_s.len() {
            return self.poses[after - 1];
        }
        let (t0, t1) = (self.times_s[after - 1], self.times_s[after]);
        if t0 == time_s || t0.is_infinite() {
            return self.poses[after - 1];
        }
        self.poses[after - 1].interpolate(&self.poses[after], (time_s - t0) / (t1 - t0))
    }
}

/// Time, time as written, pose.
fn parse_line<'a>(path: &Path, number: usize, line: &'a str) -> Result<(Stamp, &'a str, Pose)> {
    let fields: Vec<&str> = line.split_whitespace().collect();
    if fields.len() != 8 {
        let found = format!("{} {}", fields.len(), if fields.len() == 1 { "value" } else { "values" });
        return Err(Error::input(path, number, found, LINE_FORMAT));
    }
    let time = Stamp::parse_seconds(fields[0]).map_err(|fault| {
        let (found, expected) = match fault {
            StampFault::NotANumber => (format!("time `{}`", fields[0]), "a finite number of seconds"),
            StampFault::TooFar => {
                (format!("time {} s", fields[0]), "seconds within 292 years of zero; is it in ns?")
            }
        };
        Error::input(path, number, found, expected)
    })?;
    let mut values = [0.0; 7];
    for (value, (name, field)) in
        values.iter_mut().zip(["tx", "ty", "tz", "qx", "qy", "qz", "qw"].iter().zip(&fields[1..]))
    {
        *value =
            field.parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| {
                Error::input(path, number, format!("{name} = `{field}`"), "a finite number")
            })?;
    }
    let [tx, ty, tz, qx, qy, qz, qw] = values;
    if let Some(far) = values[..3].iter().find(|v| v.abs() > MAX_COORDINATE_M) {
        let expected = format!("metres, at most {MAX_COORDINATE_M:e}");
        return Err(Error::input(path, number, format!("a coordinate of {far} m"), expected));
    }
    let rotation = DQuat::from_xyzw(qx, qy, qz, qw);
    let length = rotation.length();
    // Written so that an overflow to infinity or NaN is refused.
    if !((length - 1.0).abs() <= QUATERNION_TOLERANCE) {
        let expected = format!("a unit quaternion qx qy qz qw (length 1 within {QUATERNION_TOLERANCE})");
        return Err(Error::input(path, number, format!("a quaternion of length {length:.6}"), expected));
    }
    Ok((time, fields[0], Pose { rotation: rotation.normalize(), translation_m: DVec3::new(tx, ty, tz) }))
}
