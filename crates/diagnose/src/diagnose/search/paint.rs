//! Paint and lamps that are not as described, told from effects on values before these are taken one after another in
//! their place.

use super::candidates::Freed;
use super::found::Found;
use crate::diagnose::evidence::budget::in_time;
use crate::diagnose::expect::description::by_value::{ByValue, MOST};
use crate::diagnose::expect::room::{POSES, SURFACES, bends_values, is_constant_factor};
use crate::diagnose::judge::Scores;
use crate::diagnose::search::Search;
use shutterbug::error::Result;

impl Search<'_> {
    /// Whether paint or light rather than an effect on values is to be taken next (`next`: the set with it, and what
    /// that scores): factors of surfaces explain more than it does (twice as
    /// much as a gain, which they are too), do not follow the surfaces' colours, explain more
    /// than all effects on values do together, and nothing shows that the scene does not have. `room`: what of the
    /// description may be wrong, if the search may go on with it so. Steps of a converter are not asked about: where
    /// colours are solid, factors do what these do to each.
    pub(super) fn shows_paint(
        &mut self,
        found: &Found,
        now: &Scores,
        (next, scores): (&[&'static str], &Scores),
        room: &[&'static str],
    ) -> Result<bool> {
        let bends = next.iter().any(|name| !found.set.contains(name) && bends_values(name));
        let explained = now.mean() - scores.mean();
        // Nothing explains more than all that is left.
        let is_all = explained >= now.mean() - now.bound();
        if !bends || is_all || !room.contains(&SURFACES) || now.beyond_bounds().is_empty() {
            return Ok(false);
        }
        // One factor a colour for all surfaces is a gain: of factors that explain more, more than half must be paint.
        let is_gain = next.iter().any(|name| !found.set.contains(name) && is_constant_factor(name));
        let least = if is_gain { explained / MOST } else { explained };
        let asked = self.factors_rather_than_values(found, least, room.contains(&POSES));
        self.begin_anew(Vec::new());
        Ok(in_time(asked)?.unwrap_or(false))
    }

    /// `least`: what factors must explain more than, DN.
    fn factors_rather_than_values(&mut self, found: &Found, least: f64, asks_of_poses: bool) -> Result<bool> {
        let is_more = |freed: &Freed| freed.gain > least;
        let mut freed = self.freed(&found.fit.theta, (true, false))?;
        if !is_more(&freed) && asks_of_poses {
            freed = self.freed(&found.fit.theta, (true, true))?;
        }
        if !is_more(&freed) {
            return Ok(false);
        }
        let by_value = self.forward.by_value(&self.evidence.fit, &freed.theta)?;
        // Effects on values are given the same poses.
        let mut without = found.fit.theta.clone();
        without.room.poses.clone_from(&freed.theta.room.poses);
        let mut told =
            by_value == ByValue::NotMost && self.is_no_curve(&found.set, &without, &freed.theta)?;
        self.begin_anew(Vec::new());
        told = told && self.undescribed(found)?.is_none();
        tracing::info!("{SURFACES} rather than effects on values beside {:?}: {told}", found.set);
        Ok(told)
    }
}
