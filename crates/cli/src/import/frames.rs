//! When frames were taken, in order.

use super::gather::Shot;
use shutterbug::error::counted;

/// Times of frames, and which frame each message is.
pub(super) struct Timed {
    /// Increasing, ns.
    pub(super) times_ns: Vec<i64>,
    /// One a message; nothing for those that are left out.
    pub(super) frame_of: Vec<Option<usize>>,
}

/// Orders pictures by their stamps; where these say nothing, by when they were recorded.
pub(super) fn timed(shots: &[Option<Shot>], topic: &str, notes: &mut Vec<String>) -> Timed {
    let known: Vec<(usize, Shot)> = shots.iter().enumerate().filter_map(|(i, s)| Some((i, (*s)?))).collect();
    let unset = known.iter().all(|(_, s)| s.stamp_ns == 0)
        || (known.len() > 1 && known.iter().all(|(_, s)| s.stamp_ns == known[0].1.stamp_ns));
    let time = |s: &Shot| if unset { s.recorded_ns } else { s.stamp_ns };
    if unset {
        notes.push(format!("`{topic}` has no stamps: its times are those of recording, which waver"));
    } else {
        notes.push(
            "stamps are taken as the START of exposure of the first row; where the driver stamps the middle or the \
             arrival, set [time_offset] offset_s"
                .to_owned(),
        );
    }
    let late = known.windows(2).filter(|w| time(&w[1].1) < time(&w[0].1)).count();
    if late > 0 {
        notes.push(format!(
            "{} of `{topic}` after a later one: sorted by time",
            counted(late, "picture", "pictures")
        ));
    }
    let mut order = known;
    order.sort_by_key(|(_, s)| time(s));
    let before = order.len();
    order.dedup_by_key(|(_, s)| time(s));
    if order.len() < before {
        let lost = before - order.len();
        notes.push(format!(
            "{} of `{topic}` with the stamp of another: left out",
            counted(lost, "picture", "pictures")
        ));
    }
    let mut result = Timed { times_ns: Vec::new(), frame_of: vec![None; shots.len()] };
    for (message, shot) in order {
        result.frame_of[message] = Some(result.times_ns.len());
        result.times_ns.push(time(&shot));
    }
    result
}

impl Timed {
    /// Keeps every so many-th frame.
    pub(super) fn thin(&mut self, every: usize) {
        self.times_ns = self.times_ns.iter().copied().step_by(every).collect();
        for place in &mut self.frame_of {
            *place = place.filter(|p| p % every == 0).map(|p| p / every);
        }
    }
}

/// The median time between frames, ns; 0 for one frame.
pub(super) fn periods_ns(times_ns: &[i64]) -> i64 {
    let mut steps: Vec<i64> = times_ns.windows(2).map(|w| w[1].saturating_sub(w[0])).collect();
    steps.sort_unstable();
    steps.get(steps.len() / 2).copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shot(stamp_ns: i64, recorded_ns: i64) -> Option<Shot> {
        Some(Shot { stamp_ns, recorded_ns })
    }

    #[test]
    fn pictures_are_sorted_and_said_to_be() {
        let shots = [shot(30, 1), shot(10, 2), None, shot(20, 3), shot(20, 4)];
        let mut notes = Vec::new();
        let mut all = timed(&shots, "/c", &mut notes);
        assert_eq!(all.times_ns, [10, 20, 30]);
        assert_eq!(all.frame_of, [Some(2), Some(0), None, Some(1), None]);
        assert!(notes.iter().any(|n| n.starts_with("1 picture of `/c` after a later")), "{notes:?}");
        assert!(notes.iter().any(|n| n.starts_with("1 picture of `/c` with the stamp")), "{notes:?}");
        assert_eq!((periods_ns(&all.times_ns), periods_ns(&[7])), (10, 0));
        all.thin(2);
        assert_eq!((all.times_ns, all.frame_of), (vec![10, 30], vec![Some(1), Some(0), None, None, None]));
    }

    #[test]
    fn without_stamps_the_time_of_recording_counts() {
        for stamp in [0, 77] {
            let mut notes = Vec::new();
            let all = timed(&[shot(stamp, 5), shot(stamp, 9)], "/c", &mut notes);
            assert_eq!(all.times_ns, [5, 9]);
            assert!(notes[0].contains("no stamps"), "{notes:?}");
        }
    }
}
