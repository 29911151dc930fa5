//! A pose over time.

use std::path::{Path, PathBuf};

use super::Pose;
use crate::error::{Error, Result};

/// Poses at increasing times. Between two, the position is linear and the rotation takes the shorter arc.
#[derive(Clone, Debug)]
pub struct Trajectory {
    path: PathBuf,
    times_s: Vec<f64>,
    poses: Vec<Pose>,
}

impl Trajectory {
    /// A trajectory of `times_s` (strictly increasing, s on the capture's clock) and as many poses. `path` is the file
    /// that errors name.
    ///
    /// # Errors
    /// No pose at all, lists of different length, times that do not increase or are not finite.
    pub fn new(path: &Path, times_s: Vec<f64>, poses: Vec<Pose>) -> Result<Self> {
        if times_s.is_empty() || times_s.len() != poses.len() {
            let found = format!("{} times and {} poses", times_s.len(), poses.len());
            return Err(Error::input(path, None, found, "at least one pose, one time each"));
        }
        if let Some(i) = (1..times_s.len()).find(|&i| !(times_s[i] > times_s[i - 1])) {
            let found = format!("{} s after {} s", times_s[i], times_s[i - 1]);
            return Err(Error::input(path, None, found, "times that increase"));
        }
        Ok(Self { path: path.to_owned(), times_s, poses })
    }

    /// A pose that never changes and covers all time.
    pub fn fixed(pose: Pose) -> Self {
        Self { path: PathBuf::new(), times_s: vec![f64::NEG_INFINITY, f64::INFINITY], poses: vec![pose; 2] }
    }

    /// The file it was read from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// First and last time, s.
    pub fn span_s(&self) -> (f64, f64) {
        (self.times_s[0], self.times_s[self.times_s.len() - 1])
    }

    /// Whether poses exist for all of `[from_s, to_s]`.
    pub fn covers(&self, from_s: f64, to_s: f64) -> bool {
        let (first, last) = self.span_s();
        first <= from_s && to_s <= last
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
    /// Outside the span: poses are never extrapolated.
    pub fn pose_at(&self, time_s: f64) -> Pose {
        let (first, last) = self.span_s();
        assert!(first <= time_s && time_s <= last, "{time_s} s lies outside {first} s to {last} s");
        let after = self.times_s.partition_point(|&t| t <= time_s);
        if after == self.times_s.len() {
            return self.poses[after - 1];
        }
        let (t0, t1) = (self.times_s[after - 1], self.times_s[after]);
        if t0 == time_s || t0.is_infinite() {
            return self.poses[after - 1];
        }
        self.poses[after - 1].interpolate(&self.poses[after], (time_s - t0) / (t1 - t0))
    }
}
