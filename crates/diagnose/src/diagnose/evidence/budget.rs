//! The time that a diagnosis has. What must come at the end (scores of the frames to report by, pictures, files) is
//! reserved from what the same has cost so far in this run; the search gets the rest. Whatever begins to render, score
//! or fit asks first whether its stage still has time: a stage without it ends with [`Error::OutOfTime`], and whoever
//! began the stage goes without.

use std::time::{Duration, Instant};

use crate::diagnose::evidence::quality::Quality;
use shutterbug::error::{Error, Result};

/// What the end of a diagnosis takes (noise, intervals, shares, pictures of all frames), in times of what it takes to
/// score all its frames once as fits see them.
///
/// Measured: 1.1 to 2.6 times where a search was cut short (d00 with 10 s, d14 with 20 and 60 s).
const END: f64 = 3.0;
/// How far beyond a limit a diagnosis may end: as a part of it, or s, whichever is more. What nothing can be said
/// without may take that.
///
/// Measured: a promise, not a measurement (`shutterbug diagnose --help`).
const BEYOND: [f64; 2] = [0.1, 5.0];
/// Pictures that are written of a frame; measures and the page take as long again.
const WRITTEN: f64 = 2.0 * 5.0;
/// Samples a pixel of the finest frames over those of the ones that fits see: what the former cost until they have been
/// made.
const FINER: f64 = 4.0;

/// What a diagnosis is at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Stage {
    /// What nothing can be said without: frames are read, simulated as given, and scored.
    #[default]
    Begin,
    /// The search.
    Search,
    /// What makes a report better, and can be left out.
    End,
    /// What makes a report. It has been reserved for, and is not broken off.
    Must,
}

/// Frames of each kind.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Count {
    pub all: usize,
    pub report: usize,
}

/// See the module.
#[derive(Clone, Debug, Default)]
pub(crate) struct Budget {
    limit: Option<(Instant, Duration)>,
    stage: Stage,
    pub count: Count,
    /// Seconds and frames that were scored: as fits see them, and finer.
    scored: [(f64, f64); 2],
    /// What writing a picture takes, s.
    picture_s: f64,
}

impl Budget {
    /// Of a diagnosis that began then. A limit that no clock reaches is none.
    pub(crate) fn new(begun: Instant, limit: Option<Duration>) -> Self {
        let limit = limit.filter(|l| begun.checked_add(*l).is_some_and(|end| end.checked_add(*l).is_some()));
        Self { limit: limit.map(|l| (begun, l)), ..Self::default() }
    }

    /// Enters a stage. Returns the one before.
    pub(crate) fn enter(&mut self, stage: Stage) -> Stage {
        std::mem::replace(&mut self.stage, stage)
    }

    /// Whether there is a limit.
    pub(crate) fn is_limited(&self) -> bool {
        self.limit.is_some()
    }

    /// Notes what scoring some frames took.
    pub(crate) fn has_scored(&mut self, frames: usize, quality: Quality, took: Duration) {
        let sum = &mut self.scored[usize::from(quality >= Quality::Fine)];
        (sum.0, sum.1) = (sum.0 + took.as_secs_f64(), sum.1 + frames as f64);
    }

    /// Notes what writing a picture took.
    pub(crate) fn has_written(&mut self, took: Duration) {
        self.picture_s = took.as_secs_f64();
    }

    /// What scoring a frame takes, s, from what it has taken.
    fn score_s(&self, quality: Quality) -> f64 {
        let mean = |(seconds, frames): (f64, f64)| (frames > 0.0).then(|| seconds / frames);
        let coarse = mean(self.scored[0]);
        let fine = || mean(self.scored[1]).or_else(|| coarse.map(|s| FINER * s));
        if quality >= Quality::Fine { fine() } else { coarse }.unwrap_or(0.0)
    }

    /// What scoring so many frames before and after, and writing their pictures, takes, s.
    fn shown_s(&self, frames: usize, quality: Quality) -> f64 {
        frames as f64 * (2.0 * self.score_s(quality) + WRITTEN * self.picture_s)
    }

    /// What is kept free for what comes behind the stage, s.
    fn reserved_s(&self) -> f64 {
        let must_s = self.shown_s(self.count.report, Quality::Fit);
        match self.stage {
            // Half of what is allowed: a step that is under way goes on for a while.
            Stage::Begin => must_s - 0.5 * self.beyond_s(),
            Stage::Search => must_s.max(END * self.count.all as f64 * self.score_s(Quality::Fit)),
            Stage::End => must_s,
            Stage::Must => f64::NEG_INFINITY,
        }
    }

    fn beyond_s(&self) -> f64 {
        self.limit.map_or(0.0, |(_, limit)| (BEYOND[0] * limit.as_secs_f64()).max(BEYOND[1]))
    }

    /// Seconds until the limit; negative behind it.
    pub(crate) fn left_s(&self) -> f64 {
        self.limit.map_or(f64::INFINITY, |(begun, limit)| limit.as_secs_f64() - begun.elapsed().as_secs_f64())
    }

    /// Whether the stage has no more time.
    pub(crate) fn is_over(&self) -> bool {
        // The search gets half of the time at least: without one there is nothing to be exact about.
        let half_s = self.limit.map_or(0.0, |(_, limit)| 0.5 * limit.as_secs_f64());
        let reserved_s = if self.stage == Stage::Search {
            self.reserved_s().min(half_s.max(self.shown_s(self.count.report, Quality::Fit)))
        } else {
            self.reserved_s()
        };
        self.is_limited() && self.left_s() <= reserved_s
    }

    /// Nothing, as long as the stage has time.
    ///
    /// # Errors
    /// [`Error::OutOfTime`].
    pub(crate) fn go_on(&self) -> Result<()> {
        match self.limit {
            Some((_, limit)) if self.is_over() => Err(Error::OutOfTime { limit_s: limit.as_secs_f64() }),
            _ => Ok(()),
        }
    }

    /// The same if so many seconds more are needed.
    ///
    /// # Errors
    /// [`Error::OutOfTime`].
    pub(crate) fn go_on_for(&self, seconds: f64) -> Result<()> {
        let over = self.left_s() + 0.5 * self.beyond_s() <= seconds;
        match self.limit {
            Some((_, limit)) if over => Err(Error::OutOfTime { limit_s: limit.as_secs_f64() }),
            _ => Ok(()),
        }
    }

    /// Whether so many frames can be scored and shown as well as that.
    pub(crate) fn affords(&self, frames: usize, quality: Quality) -> bool {
        !self.is_limited() || self.left_s() > self.shown_s(frames, quality)
    }

    /// For the log: how long the end took in scorings of all frames.
    pub(crate) fn tell(&self, end_s: f64) {
        let one_s = self.count.all as f64 * self.score_s(Quality::Fit);
        tracing::info!(
            "the end took {end_s:.2} s, {:.1} times a score of all frames",
            end_s / one_s.max(1e-9)
        );
    }
}

/// What keeps to a budget.
pub(crate) trait Budgeted {
    fn budget(&mut self) -> &mut Budget;

    /// Does a piece of work in another stage. Behind it the stage is the one before, whatever came of the work.
    fn within<T>(&mut self, stage: Stage, work: impl FnOnce(&mut Self) -> T) -> T {
        let before = self.budget().enter(stage);
        let done = work(self);
        self.budget().enter(before);
        done
    }
}

/// What came of a stage; nothing where its time was over before.
///
/// # Errors
/// All others.
pub(crate) fn in_time<T>(result: Result<T>) -> Result<Option<T>> {
    match result {
        Err(Error::OutOfTime { .. }) => Ok(None),
        other => other.map(Some),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Budgeted for Budget {
        fn budget(&mut self) -> &mut Budget {
            self
        }
    }

    #[test]
    fn each_stage_leaves_what_comes_behind_it_its_time() {
        let ago = |s: u64| {
            Instant::now().checked_sub(Duration::from_secs(s)).expect("the clock has run for so long")
        };
        let at = |spent_s: u64, stage: Stage| {
            let mut budget = Budget::new(ago(spent_s), Some(Duration::from_secs(100)));
            (budget.stage, budget.count) = (stage, Count { all: 10, report: 4 });
            // 0.5 s a frame: what must come takes 4 s, the end 15 s.
            budget.has_scored(10, Quality::Fit, Duration::from_secs(5));
            budget.is_over()
        };
        assert!(!at(80, Stage::Search) && at(90, Stage::Search));
        assert!(!at(90, Stage::End) && at(97, Stage::End));
        assert!(!at(100, Stage::Begin) && at(102, Stage::Begin), "half of 10 % beyond");
        assert!(!at(200, Stage::Must));
        let unlimited = Budget { stage: Stage::Search, ..Budget::new(ago(50), None) };
        assert!(!unlimited.is_over() && unlimited.go_on().is_ok() && unlimited.affords(1000, Quality::Fine));
        assert!(!Budget::new(ago(0), Some(Duration::MAX)).is_limited(), "a limit that no clock reaches");
    }

    #[test]
    fn the_end_takes_at_most_half_of_a_short_limit() {
        let begun =
            Instant::now().checked_sub(Duration::from_secs(4)).expect("the clock has run for so long");
        let mut budget = Budget::new(begun, Some(Duration::from_secs(10)));
        (budget.stage, budget.count) = (Stage::Search, Count { all: 10, report: 1 });
        budget.has_scored(1, Quality::Fit, Duration::from_secs(1));
        assert!(!budget.is_over());
        budget.enter(Stage::End);
        assert!(!budget.is_over());
        budget.count.report = 4;
        assert!(budget.is_over(), "control: what must come takes 8 s");
        let failed: Result<()> = budget.within(Stage::Must, |budget| {
            budget.go_on()?;
            Err(Error::OutOfTime { limit_s: 0.0 })
        });
        assert!(failed.is_err() && budget.is_over(), "the stage of before, though the work failed");
    }
}
