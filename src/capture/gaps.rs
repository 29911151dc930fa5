//! Frames that were exposed while no pose was recorded.

use std::ops::Range;

use super::Capture;
use crate::camera::{Gap, TIME_TOLERANCE_S, Trajectory};
use crate::error::counted;

/// Most gaps that are named one by one.
const MOST_NAMED: usize = 5;

impl Capture {
    /// A sentence on each gap in the poses (the camera's, and of objects that move) that frames fall into: between the
    /// two poses a straight line is taken for the motion, however long it is. `least_s` is how long a frame lasts at
    /// least, where its shutter is yet to be found.
    pub fn gap_warnings(&self, least_s: f64) -> Vec<String> {
        let objects = self.scene.objects.iter().filter_map(|o| o.trajectory.as_deref());
        let all: Vec<(&Trajectory, bool)> = std::iter::once((&self.trajectory, self.camera.static_camera))
            .chain(objects.map(|t| (t, false)))
            .collect();
        let mut said = Vec::new();
        for (i, &(path, rests)) in all.iter().enumerate() {
            // Two `o` lines of one name share their poses.
            if !all[..i].iter().any(|(before, _)| before.path() == path.path()) {
                self.say_gaps(path, if rests { None } else { Some(least_s) }, &mut said);
            }
        }
        said
    }

    /// `least_s`: none where only the pose of the timestamp is asked for.
    fn say_gaps(&self, path: &Trajectory, least_s: Option<f64>, said: &mut Vec<String>) {
        let gaps = path.gaps();
        let all: Vec<usize> = (0..self.frames.len()).collect();
        let bridged = |gap: &Gap| self.frames_in(gap, &all, least_s);
        let found: Vec<(&Gap, Range<usize>)> =
            gaps.iter().map(|gap| (gap, bridged(gap))).filter(|(_, frames)| !frames.is_empty()).collect();
        for (gap, frames) in found.iter().take(MOST_NAMED) {
            said.push(format!(
                "{}:{}: no pose for {:.3} s, where one comes every {:.3} s: the motion of {} is a straight line over \
                 the gap, and may have been another",
                path.path().display(),
                gap.line,
                gap.to_s - gap.from_s,
                gap.usual_s,
                self.named(frames)
            ));
        }
        if let Some((first, _)) = found.get(MOST_NAMED) {
            said.push(format!(
                "{}:{}: {} in the poses that frames fall into, the first here",
                path.path().display(),
                first.line,
                counted(found.len() - MOST_NAMED, "more gap", "more gaps")
            ));
        }
    }

    /// Frames of which a part lies inside a gap, not just at its end. Frames follow one another, so they are sought by
    /// halving: a long capture may have many gaps.
    fn frames_in(&self, gap: &Gap, all: &[usize], least_s: Option<f64>) -> Range<usize> {
        let begins_s = |f: usize| self.shutter(f).start_s;
        let ends_s = |f: usize| {
            least_s.map_or_else(|| begins_s(f), |least_s| self.shutter(f).end_s().max(begins_s(f) + least_s))
        };
        let first = all.partition_point(|&f| ends_s(f) - TIME_TOLERANCE_S <= gap.from_s);
        let end = all.partition_point(|&f| begins_s(f) + TIME_TOLERANCE_S < gap.to_s);
        first..end
    }

    /// Frames by their places in `frames.csv` and their names.
    fn named(&self, frames: &Range<usize>) -> String {
        let (first, last) = (frames.start, frames.end - 1);
        let name = |f: usize| &self.frames[f].filename;
        if first == last {
            return format!("frame {first} ({})", name(first));
        }
        format!("frames {first} to {last} ({} to {})", name(first), name(last))
    }
}
