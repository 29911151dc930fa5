//! Paint and lamps that are not as described, told from effects on values before these are taken one after another in
//! their place.

use super::candidates::MOST_OF_IT;
use super::found::Found;
use crate::diagnose::evidence::budget::in_time;
use crate::diagnose::expect::description::by_value::ByValue;
use crate::diagnose::expect::room::{SURFACES, bends_values};
use crate::diagnose::judge::Scores;
use crate::diagnose::search::{Search, Tried};
use shutterbug::error::Result;

impl Search<'_> {
    /// Whether the next of some options would be taken for paint or light: factors of surfaces explain most of what
    /// is left, do not follow the surfaces' colours, explain more than all effects on values do together, and nothing
    /// shows that the scene does not have. Asked where the search may go on with a description that is wrong.
    pub(super) fn shows_paint(&mut self, found: &Found, now: &Scores, options: &[Tried]) -> Result<bool> {
        let bends = best_of(options).is_some_and(|best| bends_values(best.0));
        if !self.may_stop || !bends || now.beyond_bounds().is_empty() {
            return Ok(false);
        }
        let asked = self.factors_rather_than_values(found);
        self.begin_anew(Vec::new());
        Ok(in_time(asked)?.unwrap_or(false))
    }

    fn factors_rather_than_values(&mut self, found: &Found) -> Result<bool> {
        let theta = &found.fit.theta;
        let freed = self.freed(theta, (true, false))?;
        if freed.gain <= MOST_OF_IT * freed.left.max(0.0) {
            return Ok(false);
        }
        let by_value = self.forward.by_value(&self.evidence.fit, &freed.theta)?;
        let mut told = by_value == ByValue::NotMost && self.is_no_curve(&found.set, theta, &freed.theta)?;
        self.begin_anew(Vec::new());
        told = told && self.undescribed(found)?.is_none();
        tracing::info!("{SURFACES} rather than effects on values beside {:?}: {told}", found.set);
        Ok(told)
    }
}

/// The option that leaves least.
pub(super) fn best_of(options: &[Tried]) -> Option<&Tried> {
    options.iter().min_by(|a, b| a.2.mean().total_cmp(&b.2.mean()))
}
