//! How the camera turns, from the rates of a gyro.

use glam::{DQuat, DVec3};

/// Rates over time and what they add up to.
pub(super) struct Gyro {
    times_s: Vec<f64>,
    rates: Vec<DVec3>,
    /// World from camera at each time, from an arbitrary start.
    turns: Vec<DQuat>,
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
        Self { times_s, rates, turns }
    }

    /// First and last time, s.
    pub(super) fn span_s(&self) -> [f64; 2] {
        [self.times_s[0], self.times_s[self.times_s.len() - 1]]
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
}
