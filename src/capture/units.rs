//! Times that are in another unit than the file's: what would fit together if they were not.

use super::Capture;
use crate::camera::Trajectory;

/// By how much times are too long or too short, what a file of seconds is in then, and what one of nanoseconds.
const UNITS: [(f64, &str, &str); 3] = [(1e9, "ns", "s"), (1e6, "us", "ms"), (1e3, "ms", "us")];
/// Time between the frames of an ordinary camera, s. Of two times that contradict each other the one that is further
/// from it (in octaves) is the one that is doubted.
const ORDINARY_S: f64 = 1.0 / 30.0;

/// The units in which one time would be another: the power of a thousand that is nearest to their ratio.
fn units_of(ratio: f64) -> Option<[&'static str; 2]> {
    let thousands = (ratio.log10() / 3.0).round();
    UNITS
        .iter()
        .find(|(factor, ..)| factor.log10() / 3.0 == thousands)
        .map(|(_, of_s, of_ns)| [*of_s, *of_ns])
}

/// Frames that are nearer than the period: which of the two is in another unit, if so.
pub(super) fn of_spacing(closest_s: f64, period_s: f64) -> String {
    let Some([period, stamps]) = units_of(period_s / closest_s) else { return String::new() };
    let off = |s: f64| (s / ORDINARY_S).ln().abs();
    if off(period_s) > off(closest_s) {
        return format!("; is the period in {period}?");
    }
    // What was read as ns would be so many times longer.
    format!("; are the timestamps in {stamps}, not in ns?")
}

/// A frame period that no camera has, s, where no times stand beside it.
pub fn of_period(period_s: f64) -> Option<String> {
    let [period, _] = units_of(period_s / ORDINARY_S).filter(|_| period_s > ORDINARY_S)?;
    Some(format!("frame_period_s = {period_s} s; is the period in {period}?"))
}

/// By how much a span must be longer to be covered by poses, and what the two files are in then.
fn fitting(path: &Trajectory, [from_s, to_s]: [f64; 2]) -> Option<(f64, String)> {
    let (factor, poses, frames) = UNITS.into_iter().find(|(f, ..)| path.covers(from_s * f, to_s * f))?;
    Some((
        factor,
        format!("are the timestamps of frames.csv (ns) in {frames}, or these times (s) in {poses}?"),
    ))
}

/// Poses that do not cover a frame: the units in which they would.
pub(super) fn of_poses(path: &Trajectory, span_s: [f64; 2]) -> Option<String> {
    fitting(path, span_s).map(|(_, units)| format!("; {units}"))
}

/// All frames between two poses, where in another unit poses would lie among them.
pub(super) fn unused_poses(capture: &Capture) -> Option<String> {
    let (path, last) = (&capture.trajectory, capture.frames.len().checked_sub(1)?);
    let span_s = [capture.shutter(0).start_s, capture.shutter(last).end_s()];
    if path.poses_within(span_s[0], span_s[1]) > 0 {
        return None;
    }
    let (factor, units) = fitting(path, span_s)?;
    (path.poses_within(span_s[0] * factor, span_s[1] * factor) > 0)
        .then(|| format!("{}: all frames lie between two of its poses; {units}", path.path().display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_times_the_stranger_one_is_doubted() {
        assert_eq!(of_spacing(0.04, 40.0), "; is the period in ms?");
        assert_eq!(of_spacing(4e-11, 0.04), "; are the timestamps in s, not in ns?");
        assert_eq!(of_spacing(4e-5, 0.04), "; are the timestamps in us, not in ns?");
        assert!(of_period(33.3).expect("no camera's").contains("in ms?"));
        assert_eq!([of_period(1.0), of_period(0.0005)], [None, None]);
        // Control: a frame too many.
        assert_eq!(of_spacing(0.02, 0.04), "");
    }
}
