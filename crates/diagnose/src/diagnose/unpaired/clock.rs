//! The time that a comparison of two folders has. All that takes time is measuring the marks of one folder, again and
//! again, so what that took tells what there is still time for.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::diagnose::evidence::budget::{Budget, Stage};
use shutterbug::error::Result;

/// How often marks are measured for a report, besides once for each effect found: before, after, and those of the real
/// frames; and as long again for pictures.
const FOR_REPORT: usize = 6;

/// See the module.
#[derive(Default)]
pub(super) struct Clock {
    budget: Budget,
    over: Arc<AtomicBool>,
    /// What measuring the marks of one folder takes, s.
    once_s: f64,
}

impl Clock {
    pub(super) fn new(budget: Budget) -> Self {
        Self { budget, ..Self::default() }
    }

    /// Notes what it took to measure the marks of one folder.
    ///
    /// # Errors
    /// No time is left for a report.
    pub(super) fn has_measured(&mut self, took: Duration) -> Result<()> {
        self.once_s = took.as_secs_f64();
        self.budget.enter(Stage::Begin);
        self.budget.go_on_for(FOR_REPORT as f64 * self.once_s)
    }

    /// Whether there is no time for another measurement.
    pub(super) fn is_late(&self) -> bool {
        self.is_late_for(1)
    }

    /// Whether there is no time for so many, beside those of the report.
    pub(super) fn is_late_for(&self, count: usize) -> bool {
        self.over.load(Ordering::Relaxed) || self.budget.left_s() <= (FOR_REPORT + count) as f64 * self.once_s
    }

    /// What makes it late.
    #[cfg(test)]
    pub(super) fn over(&self) -> Arc<AtomicBool> {
        self.over.clone()
    }
}
