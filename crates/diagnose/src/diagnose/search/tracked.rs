//! Whether errors of poses shrink beside an effect by more than chance lets them.
//!
//! A tracker errs smoothly: what it is off by in one frame it is nearly off by in the next. Few of its errors are
//! independent, and so a delay, whose effect is smooth too, takes a part of them away by chance. How long errors last
//! is not known; it is what makes them most likely (Uhlenbeck and Ornstein, Phys. Rev. 36, 1930, whose process is the
//! plainest that forgets).

/// How long errors may last, median steps between frames; 0: each frame has its own.
const LASTS: [f64; 6] = [0.0, 0.5, 1.0, 2.0, 4.0, 8.0];
/// Least variance, rad^2: no tracker is known better.
const LEAST: f64 = 1e-18;

/// Errors of the turns of a path, rad, by time.
pub(super) struct Turns {
    errors: Vec<[f64; 3]>,
    /// Steps from one to the next, over the median step.
    steps: Vec<f64>,
}

impl Turns {
    /// `errors`: by frame, with the times of the frames, s, in any order.
    pub(super) fn new(mut errors: Vec<(f64, [f64; 3])>) -> Self {
        errors.sort_by(|a, b| a.0.total_cmp(&b.0));
        let steps_s: Vec<f64> = errors.windows(2).map(|w| w[1].0 - w[0].0).collect();
        let usual_s = shutterbug::plane::stats::median(steps_s.iter().copied()).max(1e-9);
        Self {
            errors: errors.into_iter().map(|e| e.1).collect(),
            steps: steps_s.iter().map(|s| s / usual_s).collect(),
        }
    }

    /// By how much likelier errors beside an effect are than those without it: twice the logarithm of the ratio.
    pub(super) fn likelier_than(&self, without: &Self) -> f64 {
        without.surprise() - self.surprise()
    }

    /// Twice the negative logarithm of how likely such errors are, but for a constant.
    fn surprise(&self) -> f64 {
        LASTS.map(|lasts| self.surprise_if(lasts)).into_iter().fold(f64::INFINITY, f64::min)
    }

    fn surprise_if(&self, lasts: f64) -> f64 {
        let kept = |step: f64| if lasts > 0.0 { (-step / lasts).exp() } else { 0.0 };
        let (mut squares, mut sum) = (0.0, 0.0);
        for (i, error) in self.errors.iter().enumerate() {
            let (kept, last) = match i {
                0 => (0.0, [0.0; 3]),
                _ => (kept(self.steps[i - 1]), self.errors[i - 1]),
            };
            let new = 1.0 - kept * kept;
            squares += (0..3).map(|k| (error[k] - kept * last[k]).powi(2)).sum::<f64>() / new;
            sum += 3.0 * new.ln();
        }
        let count = 3.0 * self.errors.len() as f64;
        count * (squares / count).max(LEAST).ln() + sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::judge::quantile_of_length;
    use shutterbug::chain::rng::random_normal;

    /// Frames that a fit sees, and effects that are looked at.
    const FRAMES: usize = 6;
    const TESTS: usize = 28;

    /// Three numbers by frame that change smoothly: neighbours are alike by 0.8.
    fn smooth(seed: u32) -> Vec<[f64; 3]> {
        let white = |i: usize, k: u32| f64::from(random_normal([i as u32, seed], 0, k, [3, 1])[0]);
        let at = |i: usize, k: u32| {
            (0..61).map(|j| white(10 * i + j, k) * (-((j as f64 - 30.0) / 15.0).powi(2)).exp()).sum()
        };
        (0..FRAMES).map(|i| [0, 1, 2].map(|k| at(i, k))).collect()
    }

    fn turns(errors: &[[f64; 3]]) -> Turns {
        Turns::new(errors.iter().enumerate().map(|(i, e)| (i as f64, *e)).collect())
    }

    /// Errors without the part that goes with a speed.
    fn beside(errors: &[[f64; 3]], speed: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let dot = |a: &[[f64; 3]], b: &[[f64; 3]]| -> f64 {
            a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a * b).sum()
        };
        let part = dot(errors, speed) / dot(speed, speed);
        errors.iter().zip(speed).map(|(e, s)| [0, 1, 2].map(|k| e[k] - part * s[k])).collect()
    }

    #[test]
    fn smooth_errors_are_no_delay_and_a_delay_is_one() {
        let needed = quantile_of_length(TESTS, 1).powi(2);
        let (mut false_alarms, mut as_independent, mut found) = (0, 0, 0);
        for seed in 0..400 {
            let (errors, speed) = (smooth(seed), smooth(1000 + seed));
            let [without, with] = [&errors, &beside(&errors, &speed)].map(|e| turns(e));
            false_alarms += usize::from(with.likelier_than(&without) > needed);
            as_independent += usize::from(without.surprise_if(0.0) - with.surprise_if(0.0) > needed);
            // A delay that moves the picture by three times what the tracker errs.
            let delayed: Vec<_> =
                errors.iter().zip(&speed).map(|(e, s)| [0, 1, 2].map(|k| e[k] + 3.0 * s[k])).collect();
            let [without, with] = [&delayed, &beside(&delayed, &speed)].map(|e| turns(e));
            found += usize::from(with.likelier_than(&without) > needed);
        }
        assert!(false_alarms <= 8, "{false_alarms} of 400");
        assert!(as_independent > 2 * false_alarms, "control: as independent errors {as_independent} of 400");
        assert!(found >= 200, "{found} of 400");
    }
}
