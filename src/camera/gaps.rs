//! Where a path lacks poses: steps that are no longer the path's own.

/// A stretch of time without a pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Gap {
    /// Line of the pose that ends it, in the file of the poses.
    pub line: usize,
    /// The last pose before, s.
    pub from_s: f64,
    /// The first pose behind, s.
    pub to_s: f64,
    /// The usual step of the path: the median, s.
    pub usual_s: f64,
}

/// Places of the times (increasing) that end a gap, and the usual step.
///
/// Two things make a step a gap. At least one pose is missing: the step holds two of the usual ones. And the path's
/// other steps do not scatter as far: it lies beyond Tukey's outer fence, the upper quartile and three times the
/// distance of the quartiles. So poses of a fixed rate have a gap where one was lost, and poses that somebody set by
/// hand, near and far, have none.
pub(super) fn ends_of_gaps(times_s: &[f64]) -> (Vec<usize>, f64) {
    let steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    let (Some(lower), Some(usual), Some(upper)) =
        (quantile(&sorted, 0.25), quantile(&sorted, 0.5), quantile(&sorted, 0.75))
    else {
        return (Vec::new(), 0.0);
    };
    let fence = upper + 3.0 * (upper - lower);
    // Stamps are rounded: two steps of 0.033 are a missing pose of 30 Hz, 0.0659 s as well.
    let least = 2.0 * usual - (upper - lower).max(ROUNDED_S);
    let is_gap = |step: f64| step >= least && step > fence && step > usual + ROUNDED_S;
    (steps.iter().enumerate().filter(|(_, step)| is_gap(**step)).map(|(i, _)| i + 1).collect(), usual)
}

/// How far times in files are rounded at most: milliseconds.
const ROUNDED_S: f64 = 1e-3;

/// Of sorted values; between two it is linear.
fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let at = share * sorted.len().checked_sub(1)? as f64;
    let (low, high) = (sorted.get(at.floor() as usize)?, sorted.get(at.ceil() as usize)?);
    Some(low + (high - low) * at.fract())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ends(steps: &[f64]) -> Vec<usize> {
        let mut times = vec![100.0];
        times.extend(steps.iter().scan(100.0, |t, step| {
            *t += step;
            Some(*t)
        }));
        ends_of_gaps(&times).0
    }

    #[test]
    fn a_lost_pose_is_a_gap_and_poses_set_by_hand_have_none() {
        let mut steps = [0.04; 20];
        assert_eq!(ends(&steps), [0; 0]);
        steps[7] = 0.08;
        steps[12] = 2.0;
        assert_eq!(ends(&steps), [8, 13]);
        // A clock that is late at times, and stamps of whole milliseconds.
        let jitter: Vec<f64> = (0..40).map(|i| 0.033 + 0.004 * f64::from(i * 7 % 5)).collect();
        assert_eq!(ends(&jitter), [0; 0]);
        let mut rounded: Vec<f64> = (0..30).map(|i| if i % 3 == 0 { 0.034 } else { 0.033 }).collect();
        rounded[4] = 0.066;
        assert_eq!(ends(&rounded), [5]);
        assert_eq!(ends(&[0.2, 1.0, 0.3, 2.0, 0.5, 0.7, 3.0]), [0; 0]);
        for short in [&[][..], &[1.0], &[0.04, 9.0]] {
            assert_eq!(ends(short), [0; 0], "nothing is usual yet");
        }
    }
}
