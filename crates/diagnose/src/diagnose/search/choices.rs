//! Candidates whose parameter is a choice, or as good as one: patterns, schemes, and the quality of compression.

use std::collections::BTreeMap;

use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::fitted::Fit;
use crate::diagnose::expect::model::{CandidateSpec, P, Theta, candidate_of};
use crate::diagnose::expect::tone::Tone;
use crate::diagnose::fit::Schedule;
use crate::diagnose::fit::cost::Level;
use crate::diagnose::search::Search;
use shutterbug::error::Result;

/// Most turns between values and the quality of compression.
const TURNS: usize = 4;
/// The highest quality that is tried before the steps from the best one.
const FINEST: f64 = 97.0;
/// Where costs of discrete candidates are compared.
const PIXELS: Level = Level { block: 1, iterations: 0, quality: Quality::Fit, frames: 4 };

impl Search<'_> {
    /// Whether there is evidence of an effect besides what it is worth.
    pub(crate) fn is_known(&self, name: &str) -> bool {
        self.shown.has(name)
    }

    /// Fits values and the quality of compression in turns: what sharpening adds, a compression that is taken for
    /// weaker than it is removes, and neither moves without the other.
    pub(crate) fn beside_compression(
        &mut self,
        who: &[&'static str],
        start: Fit,
        schedule: Schedule,
    ) -> Result<Fit> {
        let mut found = start;
        for _ in 0..TURNS {
            let quality = self.add_discrete(candidate_of("jpeg"), &found.theta)?.theta;
            if quality.get(P::Quality) == found.theta.get(P::Quality) {
                break;
            }
            found = self.refit(who, &quality, schedule)?;
        }
        Ok(found)
    }

    /// Tries the values of a choice, or qualities from coarse to fine.
    pub(crate) fn add_discrete(&mut self, candidate: &'static CandidateSpec, theta: &Theta) -> Result<Fit> {
        let p = candidate.parameters[0];
        if let Some(value) = self.shown.value(p) {
            let theta = theta.with(p, value);
            return Ok(Fit { theta, half: BTreeMap::from([(p, 0.5)]) });
        }
        let without = theta.with(p, 0.0);
        let mut coarse = vec![20.0, 40.0, 60.0, 75.0, 85.0, 92.0, FINEST];
        coarse.retain(|q| !self.shown.refutes(p, *q));
        if coarse.is_empty() {
            return Ok(Fit { theta: without, half: BTreeMap::new() });
        }
        let weighing = self.weighing(&without, &PIXELS)?;
        let mut tried: Vec<(f64, f64)> = Vec::new();
        let mut attempt = |search: &mut Self, value: f64| -> Result<f64> {
            let value = value.clamp(1.0, p.spec().range[1]).round();
            if !tried.iter().any(|t| t.0 == value) && !search.shown.refutes(p, value) {
                let cost = search.cost(&theta.with(p, value), &PIXELS, &weighing)?;
                tried.push((value, cost));
            }
            let best = tried.iter().min_by(|a, b| a.1.total_cmp(&b.1)).expect("just tried");
            Ok(best.0)
        };
        let mut at = 1.0;
        if p == P::Quality {
            for value in coarse {
                at = attempt(self, value)?;
            }
            // The finest compression hides little: where that is the best there is none, and none is looked for
            // further.
            let none = at == FINEST
                && self.cost(&without, &PIXELS, &weighing)?
                    <= self.cost(&theta.with(p, at), &PIXELS, &weighing)?;
            for step in [6.0, 3.0, 2.0, 1.0].into_iter().filter(|_| !none) {
                for value in [at - step, at + step] {
                    at = attempt(self, value)?;
                }
            }
        } else {
            for value in 1..=p.spec().range[1] as usize {
                at = attempt(self, value as f64)?;
            }
        }
        // Where there is no noise whose spread it could change, an effect that puts the means further off is none.
        let found = theta.with(p, at);
        let silent = !Tone::new(theta).is_noisy();
        if silent && self.cost(&without, &PIXELS, &weighing)? <= self.cost(&found, &PIXELS, &weighing)? {
            return Ok(Fit { theta: without, half: BTreeMap::new() });
        }
        Ok(Fit { theta: found, half: BTreeMap::from([(p, 1.0)]) })
    }
}
