//! Frames that the camera of the others did not take: of another exposure, with other colours, shifted, soft. What a
//! camera does shows in all its frames. Fits and figures are of a part of them, so one of another part would go unseen.

use super::found::Found;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::judge::quantile;
use crate::diagnose::search::Search;
use shutterbug::error::Result;
use shutterbug::plane::Plane;
use shutterbug::plane::stats::median;

/// Fewest frames among which one can stand apart.
const FEWEST: usize = 4;
/// Share of normal variables that lie less than a standard deviation above the median.
const BELOW_SIGMA: f64 = 0.8413;

/// What a frame is like beside its simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Left {
    /// How far it is beyond what the model expects of itself, DN.
    off: f64,
    /// The same beyond what two correct renderers may differ by, DN.
    beyond: f64,
    /// Share of it that is compared.
    open: f64,
}

/// Frames that stand apart.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Odd {
    /// Their places, and how far each is off, DN; none if most of it was found to be something else.
    pub frames: Vec<(usize, Option<f64>)>,
    /// How far the others are off, median, DN.
    pub usual_dn: f64,
}

/// The frames that stand apart, where most are as the model makes them.
fn odd(left: &[Left]) -> Option<Odd> {
    if left.len() < FEWEST {
        return None;
    }
    let open = median(left.iter().map(|l| l.open));
    let hidden = |l: &Left| 2.0 * l.open < open;
    let seen = || left.iter().filter(|l| !hidden(l));
    let usual = median(seen().map(|l| l.beyond));
    // Among frames that the model does not explain none is known to be the odd one.
    if usual > 0.0 {
        return None;
    }
    // Upwards: frames that move more differ by more, and are as many as they are.
    let spread = at(BELOW_SIGMA, seen().map(|l| l.beyond)) - usual;
    let from = (usual + quantile(left.len()) * spread).min(group_apart(seen().map(|l| l.beyond)));
    let apart = |l: &Left| l.beyond > 0.0 && l.beyond > from;
    let of = |(place, l): (usize, &Left)| match hidden(l) {
        true => Some((place, None)),
        false => apart(l).then_some((place, Some(l.off))),
    };
    let frames: Vec<_> = left.iter().enumerate().filter_map(of).collect();
    let usual_dn = median(seen().filter(|l| !apart(l)).map(|l| l.off));
    (!frames.is_empty()).then_some(Odd { frames, usual_dn })
}

/// Above which value a group of at most a third of all lies: further from the rest than these are from each other, by
/// what chance makes of so many. Several that are off would widen the spread of few.
fn group_apart(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let count = sorted.len();
    let is_apart = |rest: &usize| {
        let [low, high, next] = [sorted[0], sorted[rest - 1], sorted[*rest]];
        next - high > quantile(count) * (high - low)
    };
    let rest = (count - count / 3..count).find(is_apart);
    rest.map_or(f64::INFINITY, |rest| 0.5 * (sorted[rest - 1] + sorted[rest]))
}

impl Search<'_> {
    /// Compares every frame of the evidence with what was found, as finely as the figures of the report are.
    ///
    /// # Errors
    /// Those of rendering, and [`shutterbug::error::Error::OutOfTime`].
    pub(crate) fn odd_frames(&mut self, found: &Found) -> Result<Option<Odd>> {
        (self.judge.quality, self.forward.native) = (found.quality, found.quality == Quality::Fine);
        let mut left = Vec::new();
        for at in 0..self.evidence.frames.len() {
            self.forward.budget.go_on()?;
            // One at a time: the frame behind an odd one changes as much, and is not odd itself.
            let scores = self.judge.scores_on(self.forward, &found.fit.theta, &[at])?;
            let (score, bound) = (scores.mean(), scores.bound());
            let open = self.judge.masks.map_or(1.0, |masks| share(&masks[at]));
            left.push(Left { off: score - scores.floor(), beyond: score - bound, open });
        }
        tracing::debug!("every frame: {left:?}");
        Ok(odd(&left))
    }
}

/// Share of a mask that is open.
fn share(mask: &Plane<f32>) -> f64 {
    mask.data.iter().filter(|v| **v > 0.5).count() as f64 / mask.data.len().max(1) as f64
}

/// The value above a share of the values; 0 of none.
fn at(share: f64, values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let place = (share * values.len().saturating_sub(1) as f64) as usize;
    values.get(place).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(beyond: &[f64]) -> Vec<Left> {
        beyond.iter().map(|b| Left { off: b + 0.5, beyond: *b, open: 0.9 }).collect()
    }

    #[test]
    fn a_frame_apart_is_found_and_frames_that_move_more_are_not() {
        let usual = [-0.41, -0.44, -0.39, -0.42, -0.4, -0.45, -0.38, -0.43];
        assert_eq!(odd(&frames(&usual)), None, "control");
        let with = |values: &[f64]| frames(&[&usual[..], values].concat());
        let found = odd(&with(&[22.0])).expect("one");
        assert_eq!(found.frames, [(8, Some(22.5))]);
        assert!((found.usual_dn - 0.09).abs() < 0.02, "{}", found.usual_dn);
        // As far from the others, but no further than correct renderers are from each other.
        assert_eq!(odd(&with(&[-0.05])), None);
        // Half of the frames move, and differ more by as much as they like.
        assert_eq!(odd(&with(&[0.1, 0.3, -0.1, 0.2, 0.25, 0.0])), None);
        let few = odd(&frames(&[-0.41, 42.0, -0.39, 45.0, -0.42, -0.4])).expect("two of six");
        assert_eq!(few.frames, [(1, Some(42.5)), (3, Some(45.5))]);
        assert_eq!(odd(&frames(&[-0.41, 0.1, -0.2, 0.15, -0.42, -0.3])), None, "two that move more");
        assert_eq!(odd(&frames(&[3.0, 2.0, 4.0, 3.5, 40.0])), None, "the model explains no frame");
        let mut covered = frames(&usual);
        covered[3].open = 0.05;
        assert_eq!(odd(&covered).expect("one").frames, [(3, None)]);
    }
}
