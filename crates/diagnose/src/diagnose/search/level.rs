//! A flicker and the level about which brightness goes up and down, taken together: of frames whose level is off for
//! another reason, a flicker alone explains nothing.

use super::exchange::is_as_given;
use super::{Search, Tried};
use crate::diagnose::expect::model::Theta;
use crate::diagnose::fit::VALUES;
use crate::diagnose::fit::flicker::LEVEL;
use crate::diagnose::judge::gain;
use shutterbug::error::Result;

/// The effect that has a level.
const FLICKER: &str = "flicker";

impl Search<'_> {
    /// The flicker among some options with a level of its own beside it, if that explains more.
    pub(super) fn flicker_and_level(
        &mut self,
        set: &[&'static str],
        options: &[Tried],
    ) -> Result<Option<Tried>> {
        let asked = self.names.contains(&LEVEL) && !set.contains(&LEVEL) && !self.late();
        let flicker =
            options.iter().find(|o| o.0 == FLICKER && !is_as_given(FLICKER, &o.1.theta, &self.base));
        let Some((_, alone, seen)) = flicker.filter(|o| asked && !o.1.theta.room.radiance) else {
            return Ok(None);
        };
        let both: Vec<&'static str> = set.iter().copied().chain([LEVEL, FLICKER]).collect();
        let fit = self.refit(&both, &alone.theta, VALUES)?;
        let scores = self.judge.scores(self.forward, &fit.theta)?;
        tracing::info!("{FLICKER} with {LEVEL}: {:.3} DN, {:.3} without", scores.mean(), seen.mean());
        let needed = gain(seen, &scores).value > 0.0 && self.prefers(&alone.theta, &fit.theta)?;
        Ok(needed.then_some((FLICKER, fit, scores)))
    }

    /// What joins a set with an option: the level of a flicker too, where it has one. The option itself is the last.
    pub(super) fn members_of(
        &self,
        name: &'static str,
        theta: &Theta,
        set: &[&'static str],
    ) -> Vec<&'static str> {
        let levelled = name == FLICKER && !set.contains(&LEVEL) && !is_as_given(LEVEL, theta, &self.base);
        if levelled { vec![LEVEL, name] } else { vec![name] }
    }
}
