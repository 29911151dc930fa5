//! Noise ahead of a coarse converter. Behind it most values are the nearest step, and quartiles of differences are zero
//! whatever the noise. What tells its width is how often a value goes to another step, given how near the threshold it
//! lies: the likelihood of the steps that are seen, given the simulated place between two of them.

use shutterbug::plane::stats::erf;

/// Bins of the place of a simulated value between two steps.
const PLACES: usize = 32;
/// Steps to either side of the nearest one that are told apart.
const REACH: i32 = 4;
/// Number of steps that are told apart.
const CODES: usize = 2 * REACH as usize + 1;
/// Share of values that may be anywhere: edges out of place, pixels that are stuck.
const ANYWHERE: f64 = 1e-3;
/// Narrowest and widest noise that is looked for, steps.
const WIDTHS: [f64; 2] = [0.01, 4.0];

/// How often which step was seen, by the place of the simulated value.
#[derive(Clone, Default)]
pub(super) struct Steps {
    counts: Vec<[u32; CODES]>,
}

/// What steps tell of the noise ahead of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Told {
    /// Variance, squares of a step.
    pub variance: f64,
    /// As many values whose noise were seen would tell it as well: its relative variance is three over this number.
    pub count: f64,
}

impl Steps {
    /// Adds a value. `simulated`, `seen`: in steps; the latter is whole but for the rounding of what is delivered.
    pub(super) fn add(&mut self, simulated: f32, seen: f32) {
        let nearest = simulated.round();
        self.count(simulated - nearest, seen, nearest);
    }

    /// Adds a value whose simulated one goes to zero, where what goes there reaches further by `wider` steps to either
    /// side, see [`Self::likelihood`].
    pub(super) fn add_at_zero(&mut self, simulated: f32, seen: f32, wider: f32) {
        self.count(simulated / (1.0 + 2.0 * wider), seen, 0.0);
    }

    fn count(&mut self, off: f32, seen: f32, nearest: f32) {
        self.counts.resize(PLACES, [0; CODES]);
        let place = ((off + 0.5) * PLACES as f32) as usize;
        let code = ((seen.round() - nearest) as i32).clamp(-REACH, REACH) + REACH;
        self.counts[place.min(PLACES - 1)][code as usize] += 1;
    }

    pub(super) fn is_empty(&self) -> bool {
        self.counts.is_empty()
    }

    pub(super) fn append(&mut self, other: &Self) {
        self.counts.resize(PLACES.min(self.counts.len().max(other.counts.len())), [0; CODES]);
        for (to, from) in self.counts.iter_mut().zip(&other.counts) {
            to.iter_mut().zip(from).for_each(|(a, b)| *a += b);
        }
    }

    /// The most likely noise; nothing where it lies at an end of what is looked for, or nothing was seen.
    pub(super) fn told(&self) -> Option<Told> {
        if self.counts.is_empty() {
            return None;
        }
        most_likely(WIDTHS, |log_width| self.likelihood(log_width.exp(), 0.0))
    }

    /// Logarithm of the likelihood of noise of a width, steps. `wider`: how much further than half a step what goes to
    /// zero reaches to either side, steps; values from [`Self::add`] have none.
    pub(super) fn likelihood(&self, width: f64, wider: f64) -> f64 {
        // Where in its bin of places a value lies is not known.
        let width = width.hypot(1.0 / (PLACES as f64 * 12f64.sqrt()));
        let below = |t: f64| 0.5 + 0.5 * erf(t / width * std::f64::consts::FRAC_1_SQRT_2);
        let mut sum = 0.0;
        for (place, counts) in self.counts.iter().enumerate() {
            let off = (1.0 + 2.0 * wider) * ((place as f64 + 0.5) / PLACES as f64 - 0.5);
            for (code, &count) in counts.iter().enumerate().filter(|(_, n)| **n > 0) {
                let to = code as f64 - f64::from(REACH);
                let [mut from, mut up] =
                    [to - 0.5, to + 0.5].map(|t: f64| below(t + wider * t.signum() - off));
                // What lies beyond the last step that is told apart counts as that.
                if code == 0 {
                    from = 0.0;
                }
                if code == CODES - 1 {
                    up = 1.0;
                }
                let chance = (1.0 - ANYWHERE) * (up - from).max(0.0) + ANYWHERE / CODES as f64;
                sum += f64::from(count) * chance.ln();
            }
        }
        sum
    }
}

/// The most likely noise between two widths, given the logarithm of the likelihood by the logarithm of the width;
/// nothing where it lies at an end. The variance is the square of the width.
pub(super) fn most_likely(widths: [f64; 2], likelihood: impl Fn(f64) -> f64) -> Option<Told> {
    let [mut low, mut high] = widths.map(f64::ln);
    let ends = [low, high];
    // One valley: wider noise takes more values to other steps everywhere.
    const GOLDEN: f64 = 0.618_033_988_749_895;
    for _ in 0..24 {
        let [a, b] = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
        if likelihood(a) > likelihood(b) { high = b } else { low = a }
    }
    let at = 0.5 * (low + high);
    if ends.iter().any(|e| (at - e).abs() < 1e-3) {
        return None;
    }
    const STEP: f64 = 0.05;
    let [below, here, above] = [at - STEP, at, at + STEP].map(likelihood);
    // Of the logarithm of the variance, which is twice that of the width.
    let information = (2.0 * here - below - above) / (STEP * STEP) / 4.0;
    Some(Told { variance: (2.0 * at).exp(), count: 3.0 * information.max(0.0) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::chain::rng::random_uniform;

    /// Steps of values that lie anywhere between two of them, or all at one place, with normal noise of a width.
    fn seen(width: f32, only: Option<f32>) -> Steps {
        let mut steps = Steps::default();
        for i in 0..40_000u32 {
            let u = |k: u32| random_uniform([i, k], 0, 9, [3, 4]);
            let normal = (-2.0 * u(0)[0].max(1e-9).ln()).sqrt() * (std::f32::consts::TAU * u(0)[1]).cos();
            let value = only.unwrap_or(20.0 * u(1)[0]);
            steps.add(value, (value + width * normal).round());
        }
        steps
    }

    #[test]
    fn steps_tell_the_width_of_the_noise_ahead_of_them() {
        for width in [0.05f32, 0.2, 0.5, 1.2] {
            let told = seen(width, None).told().expect("seen");
            let off = told.variance.sqrt() / f64::from(width) - 1.0;
            // Three over the count is the relative variance of the variance: half of its root that of the width.
            let known = 0.5 * (3.0 / told.count).sqrt();
            assert!(off.abs() < 4.0 * known && known < 0.03, "{width}: {off} known to {known}");
        }
        // At one place a third of a step from the threshold.
        let told = seen(0.3, Some(7.2)).told().expect("seen");
        assert!((told.variance.sqrt() / 0.3 - 1.0).abs() < 0.05, "{told:?}");
    }

    #[test]
    fn a_wider_step_at_zero_hides_no_noise() {
        let (width, wider) = (0.4f32, 0.15f32);
        let mut steps = Steps::default();
        for i in 0..40_000u32 {
            let u = |k: u32| random_uniform([i, k], 0, 9, [3, 4]);
            let normal = (-2.0 * u(0)[0].max(1e-9).ln()).sqrt() * (std::f32::consts::TAU * u(0)[1]).cos();
            let value = 1.2 * u(1)[0] - 0.6;
            let noisy = value + width * normal;
            steps.add_at_zero(value, (noisy.signum() * (noisy.abs() - wider).max(0.0)).round(), wider);
        }
        let told = |wider: f64| {
            let told = most_likely(WIDTHS, |log_width| steps.likelihood(log_width.exp(), wider));
            told.expect("seen").variance.sqrt() / f64::from(width) - 1.0
        };
        assert!(told(f64::from(wider)).abs() < 0.03, "{}", told(f64::from(wider)));
        assert!(told(0.0) < -0.1, "control: steps that are all alike: {}", told(0.0));
    }

    #[test]
    fn no_noise_is_told_where_there_is_none_or_where_no_threshold_is_near() {
        assert!(seen(0.0, None).told().is_none_or(|t| t.variance < 1e-3), "control: none");
        let far = seen(0.02, Some(7.0)).told();
        assert!(far.is_none_or(|t| t.count < 10.0), "control: {far:?}");
    }
}
