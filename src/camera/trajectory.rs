//! A pose over time.

use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

use super::gaps::{Gap, ends_of_gaps};
use super::{Pose, Stamp, StampFault};
use crate::error::{Error, Quoted, Result, counted, shortened};

/// How far outside its span a trajectory still answers, with its first or last pose, s. Stamps are whole nanoseconds;
/// this is the rounding of sums such as `start_s + readout_time_s + exposure_time_s`, not an extrapolation.
pub const TIME_TOLERANCE_S: f64 = 1e-9;

/// Furthest coordinate that is accepted, m: far more than the Earth, and squares of it stay finite in an `f32`.
const MAX_COORDINATE_M: f64 = 1e9;

/// How far the length of a recorded quaternion may be from 1. Four decimals, as in the TUM recordings, give 1e-4.
const QUATERNION_TOLERANCE: f64 = 1e-3;

const LINE_FORMAT: &str = "eight numbers: t tx ty tz qx qy qz qw";

/// Poses at increasing times. Between two, the position is linear and the rotation takes the shorter arc, unless it is
/// [`Self::smoothed`].
#[derive(Clone, Debug)]
pub struct Trajectory {
    path: PathBuf,
    times_s: Vec<f64>,
    poses: Vec<Pose>,
    /// Of each pose in the file; none where the poses come from elsewhere.
    lines: Vec<usize>,
    smooth: bool,
}

impl Trajectory {
    /// A trajectory of `times_s` (strictly increasing, s on the capture's clock) and as many poses. `path` is the file
    /// that errors name.
    ///
    /// # Errors
    /// No pose at all, lists of different length, times that do not increase or are not finite.
    pub fn new(path: &Path, times_s: Vec<f64>, poses: Vec<Pose>) -> Result<Self> {
        if times_s.is_empty() || times_s.len() != poses.len() {
            let found = format!(
                "{} and {}",
                counted(times_s.len(), "time", "times"),
                counted(poses.len(), "pose", "poses")
            );
            return Err(Error::input(path, None, found, "at least one pose, one time each"));
        }
        if let Some(time_s) = times_s.iter().find(|t| !t.is_finite()) {
            return Err(Error::input(path, None, format!("time {time_s} s"), "finite times"));
        }
        if let Some(pair) = times_s.windows(2).find(|pair| pair[1] <= pair[0]) {
            return Err(Error::input(
                path,
                None,
                format!("{} s after {} s", pair[1], pair[0]),
                "times that increase",
            ));
        }
        Ok(Self { path: path.to_owned(), times_s, poses, lines: Vec::new(), smooth: false })
    }

    /// Reads the lines `t tx ty tz qx qy qz qw` (s, m, unit quaternion) of a TUM file. Comments (`#`), blank lines,
    /// CRLF and a byte order mark are skipped over. `epoch_ns` is the zero of the capture's clock: it is subtracted
    /// before a time becomes an `f64`. Quaternions are normalised; those further than 1e-3 from length 1 are refused.
    ///
    /// # Errors
    /// No pose, a line that is not eight finite numbers, a time that does not increase, a quaternion that is not a
    /// rotation, and those of [`Trajectory::check_columns`]; with file and line.
    pub fn parse(path: &Path, text: &str, epoch_ns: i64) -> Result<Self> {
        Self::check_columns(path, text)?;
        let (mut times_s, mut poses, mut lines) = (Vec::new(), Vec::new(), Vec::new());
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
                let found = format!(
                    "time {} s after {} s in line {last_number}",
                    shortened(written),
                    shortened(last_written)
                );
                return Err(Error::input(path, number, found, "times that increase"));
            }
            last = Some((number, time, written));
            times_s.push(time_s);
            poses.push(pose);
            lines.push(number);
        }
        if poses.is_empty() {
            return Err(Error::input(path, None, "no pose", format!("lines of {LINE_FORMAT}")));
        }
        Ok(Self { lines, ..Self::new(path, times_s, poses)? })
    }

    /// Refuses a comment that names the columns of the quaternion in another order than TUM's, as `qw qx qy qz`.
    ///
    /// # Errors
    /// The line with such a comment.
    pub fn check_columns(path: &Path, text: &str) -> Result<()> {
        const ORDER: [&str; 4] = ["qx", "qy", "qz", "qw"];
        for (index, line) in text.lines().enumerate().filter(|(_, l)| l.trim_start().starts_with('#')) {
            let words = line.split(|c: char| !c.is_alphanumeric());
            let names: Vec<&str> = words.filter(|name| ORDER.contains(name)).collect();
            if names.len() == ORDER.len() && names != ORDER {
                let found = format!("columns {}", names.join(" "));
                return Err(Error::input(path, index + 1, found, LINE_FORMAT));
            }
        }
        Ok(())
    }

    /// Where poses of the file are missing: a step far longer than the others. Poses that were not read from a file
    /// have no gaps: who made them knows how far apart they are.
    pub fn gaps(&self) -> Vec<Gap> {
        if self.lines.len() != self.times_s.len() {
            return Vec::new();
        }
        let (ends, usual_s) = ends_of_gaps(&self.times_s);
        let gap = |i: usize| Gap {
            line: self.lines[i],
            from_s: self.times_s[i - 1],
            to_s: self.times_s[i],
            usual_s,
        };
        ends.into_iter().map(gap).collect()
    }

    /// Number of poses strictly inside a span.
    pub fn poses_within(&self, from_s: f64, to_s: f64) -> usize {
        let before = |end_s: f64| self.times_s.partition_point(|&t| t < end_s);
        before(to_s).saturating_sub(self.times_s.partition_point(|&t| t <= from_s))
    }

    /// Number of poses.
    pub fn pose_count(&self) -> usize {
        self.poses.len()
    }

    /// The trajectory of a camera that is turned within this one: the same positions, `rotation` within its frame.
    /// Turning the poses and interpolating between them commute.
    pub fn turned(&self, rotation: DQuat) -> Self {
        self.mapped(|pose| Pose { rotation: (pose.rotation * rotation).normalize(), ..*pose })
    }

    /// The same times with other poses.
    pub fn mapped(&self, by: impl Fn(&Pose) -> Pose) -> Self {
        Self { poses: self.poses.iter().map(by).collect(), ..self.clone() }
    }

    /// The trajectory of a camera that is elsewhere by `by` (a time, s, to a pose in this camera's own frame), which
    /// bends at `times_s` (increasing, s) too.
    pub fn adjusted(&self, times_s: &[f64], by: impl Fn(f64) -> Pose) -> Self {
        let inside = times_s.iter().copied().filter(|&t| self.covers(t, t));
        let mut all: Vec<f64> = self.times_s.iter().copied().chain(inside).collect();
        all.sort_by(f64::total_cmp);
        // Files have whole nanoseconds.
        all.dedup_by(|b, a| *b - *a < 1e-7);
        let poses = all.iter().map(|&t| self.pose_at(t).then_from(&by(t))).collect();
        Self { times_s: all, poses, lines: Vec::new(), ..self.clone() }
    }

    /// As the text of a TUM file; `epoch_ns` is the zero of the clock that its times count from.
    pub fn to_tum(&self, epoch_ns: i64) -> String {
        let line = |(t, p): (&f64, &Pose)| {
            let ns = i128::from(epoch_ns) + (t * 1e9).round() as i128;
            let (sign, ns) = (if ns < 0 { "-" } else { "" }, ns.abs());
            let (x, q) = (p.translation_m, p.rotation);
            let (s, rest) = (ns / 1_000_000_000, ns % 1_000_000_000);
            format!(
                "{sign}{s}.{rest:09} {:.9} {:.9} {:.9} {:.12} {:.12} {:.12} {:.12}\n",
                x.x, x.y, x.z, q.x, q.y, q.z, q.w
            )
        };
        self.times_s.iter().zip(&self.poses).map(line).collect()
    }

    /// A pose that never changes and covers all time.
    pub fn fixed(pose: Pose) -> Self {
        let times_s = vec![f64::NEG_INFINITY, f64::INFINITY];
        Self { path: PathBuf::new(), times_s, poses: vec![pose; 2], lines: Vec::new(), smooth: false }
    }

    /// The same poses, with a curve between them that bends as they do: parabolas through three, blended. For poses so
    /// far apart that straight lines between them would be seen.
    pub fn smoothed(self) -> Self {
        Self { smooth: true, ..self }
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
        if self.smooth {
            return super::cubic::pose_within(&self.times_s, &self.poses, after - 1, time_s);
        }
        self.poses[after - 1].interpolate(&self.poses[after], (time_s - t0) / (t1 - t0))
    }
}

/// Time, time as written, pose.
fn parse_line<'a>(path: &Path, number: usize, line: &'a str) -> Result<(Stamp, &'a str, Pose)> {
    let fields: Vec<&str> = line.split_whitespace().collect();
    if fields.len() != 8 {
        let found = counted(fields.len(), "value", "values");
        return Err(Error::input(path, number, found, LINE_FORMAT));
    }
    let time = Stamp::parse_seconds(fields[0]).map_err(|fault| {
        let (found, expected) = match fault {
            StampFault::NotANumber => {
                (format!("time `{}`", shortened(fields[0])), "a finite number of seconds")
            }
            StampFault::TooFar => {
                (format!("time {} s", shortened(fields[0])), "seconds within 292 years of zero; is it in ns?")
            }
        };
        Error::input(path, number, found, expected)
    })?;
    let mut values = [0.0; 7];
    for (value, (name, field)) in
        values.iter_mut().zip(["tx", "ty", "tz", "qx", "qy", "qz", "qw"].iter().zip(&fields[1..]))
    {
        *value = field.parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| {
            Error::input(path, number, format!("{name} = `{}`", shortened(field)), "a finite number")
        })?;
    }
    let [tx, ty, tz, qx, qy, qz, qw] = values;
    if let Some(far) = values[..3].iter().find(|v| v.abs() > MAX_COORDINATE_M) {
        let expected = format!("metres, at most {MAX_COORDINATE_M:e}");
        return Err(Error::input(path, number, format!("a coordinate of {} m", Quoted(*far)), expected));
    }
    let rotation = DQuat::from_xyzw(qx, qy, qz, qw);
    let length = rotation.length();
    // Asked so that a length that overflowed to infinity or NaN is refused.
    let is_unit = (length - 1.0).abs() <= QUATERNION_TOLERANCE;
    if !is_unit {
        let expected = format!("a unit quaternion qx qy qz qw (length 1 within {QUATERNION_TOLERANCE})");
        let found = format!("a quaternion of length {:.6}", Quoted(length));
        return Err(Error::input(path, number, found, expected));
    }
    Ok((time, fields[0], Pose { rotation: rotation.normalize(), translation_m: DVec3::new(tx, ty, tz) }))
}

#[cfg(test)]
mod tests {
    use super::*;

    const EPOCH_NS: i64 = 1_700_000_000_000_000_000;

    fn parse(text: &str) -> Trajectory {
        Trajectory::parse(Path::new("t.tum"), text, EPOCH_NS).unwrap_or_else(|e| panic!("{e}"))
    }

    #[test]
    fn stamps_of_nineteen_digits_keep_their_nanoseconds() {
        let t = parse("1700000000.000000001 0 0 0 0 0 0 1\n1.700000000000000004e9 3 0 0 0 0 0 1\n");
        assert_eq!(t.span_s(), (1e-9, 4e-9));
        assert!((t.pose_at(2e-9).translation_m.x - 1.0).abs() < 1e-9);
        // Control: as f64 seconds since 1970 the two lines are the same instant.
        let seconds =
            ["1700000000.000000001", "1700000000.000000004"].map(|s| s.parse::<f64>().expect("a number"));
        assert_eq!(seconds[0], seconds[1]);
    }

    #[test]
    fn quaternions_in_another_order_are_refused() {
        let read = |names: &str| {
            let text = format!("# timestamp tx ty tz {names}\n1.0 0 0 0 0.5 0.5 0.5 0.5\n");
            Trajectory::parse(Path::new("t.tum"), &text, 0)
        };
        let error = read("qw qx qy qz").expect_err("w is first").to_string();
        assert!(error.contains("t.tum:1") && error.contains("qw qx qy qz"), "{error}");
        assert!(read("qx qy qz qw").is_ok(), "control");
    }

    #[test]
    fn a_path_that_is_corrected_is_elsewhere_by_so_much_and_comes_back_from_its_text() {
        let t = parse("1700000000.0 0 0 0 0 0 0 1\n1700000001.0 2 0 0 0 0 0.5 0.8660254\n");
        let by = |time_s: f64| Pose {
            rotation: DQuat::from_rotation_x(0.01 * time_s),
            translation_m: DVec3::new(0.0, 0.1, 0.0),
        };
        let moved = t.adjusted(&[0.25, 0.5], by);
        assert_eq!(moved.pose_count(), 4);
        for time_s in [0.0, 0.25, 0.5, 1.0] {
            let (is, should) = (moved.pose_at(time_s), t.pose_at(time_s).then_from(&by(time_s)));
            assert!((is.translation_m - should.translation_m).length() < 1e-9, "{time_s}");
            assert!(is.rotation.angle_between(should.rotation) < 1e-6, "{time_s}");
        }
        let again = parse(&moved.to_tum(EPOCH_NS));
        for time_s in [0.0, 0.3, 0.9] {
            let (is, should) = (again.pose_at(time_s), moved.pose_at(time_s));
            assert!((is.translation_m - should.translation_m).length() < 1e-8, "{time_s}");
            assert!(is.rotation.angle_between(should.rotation) < 1e-6, "{time_s}");
        }
        // Control: the path as it was lies a tenth of a meter off.
        assert!((moved.pose_at(0.3).translation_m - t.pose_at(0.3).translation_m).length() > 0.09);
    }

    #[test]
    fn comments_blank_lines_crlf_tabs_and_a_byte_order_mark_are_skipped_over() {
        let lines = "1700000000 1 2 3 0 0 0 1\n1700000001 4 5 6 0 0 1 0\n";
        let dressed = "\u{feff}# t tx ty\r\n\r\n  1700000000\t1 2 3  0 0 0 1  \r\n   # more\r\n\
                       1700000001 4 5 6 0 0 1 0";
        let (plain, dressed) = (parse(lines), parse(dressed));
        for at in [0.0, 0.3, 1.0] {
            assert_eq!(plain.pose_at(at), dressed.pose_at(at));
        }
        assert_eq!(plain.pose_at(1.0).translation_m, DVec3::new(4.0, 5.0, 6.0));
    }

    #[test]
    fn a_flipped_sign_of_a_quaternion_changes_nothing() {
        let (half, c) = (0.2f64, 0.2f64.cos());
        let s = half.sin();
        let same = parse(&format!("1700000000 0 0 0 0 0 0 1\n1700000001 0 0 0 0 0 {s} {c}\n"));
        let flipped = parse(&format!("1700000000 0 0 0 0 0 0 1\n1700000001 0 0 0 0 0 -{s} -{c}\n"));
        let point = DVec3::new(1.0, 2.0, 3.0);
        for at in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let want = DQuat::from_rotation_z(2.0 * half * at) * point;
            for trajectory in [&same, &flipped] {
                assert!((trajectory.pose_at(at).transform(point) - want).length() < 1e-12, "at {at}");
            }
        }
        // Control: the longer arc passes elsewhere.
        let longer = DQuat::from_rotation_z((2.0 * half - std::f64::consts::TAU) * 0.5) * point;
        assert!((same.pose_at(0.5).transform(point) - longer).length() > 1.0);
    }

    #[test]
    fn quaternions_of_four_decimals_are_normalised_and_worse_ones_refused() {
        // A line of the TUM recording freiburg1_xyz.
        let t = parse("1700000000 1.3563 0.6305 1.6380 0.6132 0.5962 -0.3311 -0.3986\n");
        assert!((t.pose_at(0.0).rotation.length() - 1.0).abs() < 1e-15);
        for (w, accepted) in
            [("1.0009", true), ("0.9991", true), ("1.0011", false), ("0.9989", false), ("0", false)]
        {
            let line = format!("1700000000 0 0 0 0 0 0 {w}");
            assert_eq!(Trajectory::parse(Path::new("t.tum"), &line, EPOCH_NS).is_ok(), accepted, "{w}");
        }
    }

    #[test]
    fn rounding_of_sums_is_no_extrapolation() {
        let t = parse("1700000000.1 0 0 0 0 0 0 1\n1700000000.3 2 0 0 0 0 0 1\n");
        // 0.1 + 0.2 is above 0.3 by the rounding of binary fractions.
        assert!(0.1 + 0.2 > t.span_s().1);
        assert!(t.require(0.1, 0.1 + 0.2, "frame 0").is_ok());
        assert_eq!(t.pose_at(0.1 + 0.2).translation_m.x, 2.0);
        let error = t.require(0.1, 0.300_000_002, "frame 0").expect_err("2 ns more").to_string();
        assert!(error.contains("missing 0.300000000 s to 0.300000002 s"), "{error}");
    }

    #[test]
    #[should_panic(expected = "lies outside")]
    fn poses_are_never_extrapolated() {
        parse("1700000000 0 0 0 0 0 0 1\n1700000001 1 0 0 0 0 0 1\n").pose_at(1.000_000_01);
    }

    #[test]
    fn lists_that_are_no_trajectory_are_refused() {
        let new = |times: &[f64], poses: usize| {
            Trajectory::new(Path::new("t.tum"), times.to_vec(), vec![Pose::IDENTITY; poses])
                .map_err(|e| e.to_string())
        };
        assert!(new(&[0.0, 1.0], 2).is_ok());
        for (times, poses, error) in [
            (&[][..], 0, "t.tum: found 0 times and 0 poses; expected at least one pose, one time each"),
            (&[0.0, 1.0], 1, "t.tum: found 2 times and 1 pose; expected at least one pose, one time each"),
            (&[1.0, 1.0], 2, "t.tum: found 1 s after 1 s; expected times that increase"),
            (&[f64::NAN], 1, "t.tum: found time NaN s; expected finite times"),
            (&[0.0, f64::INFINITY], 2, "t.tum: found time inf s; expected finite times"),
        ] {
            assert_eq!(new(times, poses).expect_err(error), error);
        }
    }

    #[test]
    fn a_fixed_pose_covers_all_time() {
        let pose = Pose { rotation: DQuat::from_rotation_x(0.3), translation_m: DVec3::X };
        let t = Trajectory::fixed(pose);
        assert!(t.covers(-1e12, 1e12));
        assert_eq!(t.pose_at(17.0), pose);
    }
}
