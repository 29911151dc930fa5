//! How the camera turns, from the rates of a gyro.

use glam::{DQuat, DVec3};

/// Rates that come so many times as late as usual are missing: what is between two was not measured.
const GAP: f64 = 5.0;

/// Rates over time and what they add up to.
pub(super) struct Gyro {
    times_s: Vec<f64>,
    rates: Vec<DVec3>,
    /// World from camera at each time, from an arbitrary start.
    turns: Vec<DQuat>,
    gaps_s: Vec<[f64; 2]>,
}

fn gaps_s(times_s: &[f64]) -> Vec<[f64; 2]> {
    let mut usual: Vec<f64> = times_s.windows(2).map(|w| w[1] - w[0]).collect();
    usual.sort_by(f64::total_cmp);
    let most_s = GAP * usual[usual.len() / 2];
    times_s.windows(2).filter(|w| w[1] - w[0] > most_s).map(|w| [w[0], w[1]]).collect()
}

impl Gyro {
    /// Of at least two times (s, increasing) with rates about the camera's axes, rad/s; linear between.
    pub(super) fn new(times_s: Vec<f64>, rates: Vec<DVec3>) -> Self {
        let mut turns = vec![DQuat::IDENTITY];
        for k in 1..times_s.len() {
            let mean = 0.5 * (rates[k - 1] + rates[k]);
            let step = DQuat::from_scaled_axis(mean * (times_s[k] - times_s[k - 1]));
            turns.push((turns[k - 1] * step).normalize());
        }
        Self { gaps_s: gaps_s(&times_s), times_s, rates, turns }
    }

    /// First and last time, s.
    pub(super) fn span_s(&self) -> [f64; 2] {
        [self.times_s[0], self.times_s[self.times_s.len() - 1]]
    }

    /// Spans without rates, s: from one sample to the next takes many times as long as usual.
    pub(super) fn gaps_s(&self) -> &[[f64; 2]] {
        &self.gaps_s
    }

    /// Whether a gap overlaps the time between two.
    pub(super) fn is_broken(&self, from_s: f64, to_s: f64) -> bool {
        self.gaps_s.iter().any(|[a, b]| *a < to_s && *b > from_s)
    }

    /// The sample before a time, and the time behind it.
    fn before(&self, time_s: f64) -> (usize, f64) {
        let k = self.times_s.partition_point(|t| *t <= time_s).clamp(1, self.times_s.len() - 1) - 1;
        (k, time_s - self.times_s[k])
    }

    /// Rate about the camera's axes, rad/s; beyond the ends as there.
    pub(super) fn rate(&self, time_s: f64) -> DVec3 {
        let (k, past_s) = self.before(time_s);
        let part = (past_s / (self.times_s[k + 1] - self.times_s[k])).clamp(0.0, 1.0);
        self.rates[k].lerp(self.rates[k + 1], part)
    }

    /// World from camera.
    fn turn(&self, time_s: f64) -> DQuat {
        let (k, past_s) = self.before(time_s);
        let mean = 0.5 * (self.rates[k] + self.rate(time_s));
        self.turns[k] * DQuat::from_scaled_axis(mean * past_s)
    }

    /// How the camera turned from one time to another: the later camera's axes in the earlier one's, as axis times
    /// angle.
    pub(super) fn between(&self, from_s: f64, to_s: f64) -> DVec3 {
        (self.turn(from_s).inverse() * self.turn(to_s)).to_scaled_axis()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_add_up_to_turns() {
        let times_s: Vec<f64> = (0..200).map(|k| 0.005 * f64::from(k)).collect();
        let rate = |t: f64| DVec3::new(0.8 * (5.0 * t).cos(), 0.0, 0.0);
        let gyro = Gyro::new(times_s.clone(), times_s.iter().map(|t| rate(*t)).collect());
        let turned = gyro.between(0.1002, 0.5507);
        let should = 0.16 * ((5.0 * 0.5507f64).sin() - (5.0 * 0.1002f64).sin());
        assert!((turned.x - should).abs() < 1e-5 && turned.y.abs() < 1e-12, "{turned}");
        assert!((gyro.rate(0.3) - rate(0.3)).length() < 1e-4);
    }

    #[test]
    fn what_was_not_measured_is_known() {
        let all = (0..200).map(|k| 0.005 * f64::from(k));
        let times_s: Vec<f64> = all.filter(|t| !(0.4..0.46).contains(t)).collect();
        let rates = vec![DVec3::ZERO; times_s.len()];
        let gyro = Gyro::new(times_s, rates);
        assert_eq!(gyro.gaps_s().len(), 1);
        assert!(gyro.is_broken(0.35, 0.42) && gyro.is_broken(0.41, 0.43) && !gyro.is_broken(0.2, 0.39));
        assert!(!gyro.is_broken(0.47, 0.9));
    }
}
