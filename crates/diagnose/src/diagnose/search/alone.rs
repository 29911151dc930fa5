//! What each candidate does alone.

use std::collections::BTreeMap;
use std::time::Instant;

use crate::diagnose::evidence::budget::in_time;
use crate::diagnose::expect::fitted::Fit;
use crate::diagnose::expect::model::{Theta, candidate_of, moves};
use crate::diagnose::fit::starts::lowered;
use crate::diagnose::search::found::Alone;
use crate::diagnose::search::support::restored;
use crate::diagnose::search::{Search, Watch};
use shutterbug::error::Result;

impl Search<'_> {
    /// Parameters of the candidates that move the picture and, alone, close at least this share of the gap and half of
    /// what the best of them closes; the best first.
    pub(crate) fn promising(&mut self, watch: &mut dyn Watch, share: f64) -> Result<Vec<Theta>> {
        let before = self.judge.scores(self.forward, &self.base.clone())?;
        let start = self.with_noise(&self.base.clone())?;
        let all = std::mem::take(&mut self.names);
        self.names = all.iter().copied().filter(|n| moves(candidate_of(n))).collect();
        let mut tried = Vec::new();
        let looked = self.each_alone(watch, "where to compare", &start, &mut tried, &mut Vec::new());
        self.names = all;
        let gain = |a: &Alone| a.against.mean() - a.scores.mean();
        looked?;
        let best = tried.iter().map(gain).fold(0.0, f64::max);
        let least = f64::max(share * before.mean(), 0.5 * best);
        let mut promising: Vec<_> = tried.into_iter().filter(|a| gain(a) >= least).collect();
        promising.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
        Ok(promising.into_iter().map(|a| a.fit.theta).collect())
    }

    /// Keeps what candidates that move the picture came to alone, and which of all explained nothing.
    pub(super) fn remember(&mut self, alone: &[Alone]) {
        let idle = alone.iter().filter(|a| a.scores.mean() >= a.against.mean());
        self.idle = idle.map(|a| a.name).collect();
        let moved = alone.iter().filter(|a| moves(candidate_of(a.name)) && a.fit.theta != self.base);
        self.moved_alone = moved.map(|a| (a.name, a.fit.theta.clone())).collect();
    }

    /// `theta` with a candidate as it was fitted alone, where surfaces have factors: those follow what small steps of
    /// a lens or a readout do, so slopes tell little of a large one. Where edges lie was seen without factors too.
    pub(super) fn as_alone(&self, name: &str, theta: &Theta) -> Option<Theta> {
        let known = self.moved_alone.iter().find(|(alone, _)| *alone == name && theta.room.radiance);
        known.map(|(_, alone)| restored(theta, alone, candidate_of(name)))
    }

    /// Raises what candidates promise to what they take off the cost as they were fitted alone.
    pub(super) fn rank_as_alone(
        &mut self,
        ranked: &mut Vec<(&'static str, f64)>,
        theta: &Theta,
        of: &[&'static str],
    ) -> Result<()> {
        let known: Vec<_> = of.iter().filter_map(|n| Some((*n, self.as_alone(n, theta)?))).collect();
        if known.is_empty() {
            return Ok(());
        }
        let (names, thetas): (Vec<_>, Vec<_>) = known.into_iter().unzip();
        let shares = lowered(self.forward, self.target(), self.evidence, theta, &thetas)?;
        tracing::info!("as they were alone: {:?}", names.iter().zip(&shares).collect::<Vec<_>>());
        let helps: Vec<_> = names.into_iter().zip(shares).filter(|(_, share)| *share > 0.0).collect();
        self.moved_alone.retain(|(name, _)| helps.iter().any(|(other, _)| other == name));
        for (name, share) in helps {
            match ranked.iter_mut().find(|(other, _)| *other == name) {
                Some((_, promised)) => *promised = promised.max(share),
                None => ranked.push((name, share)),
            }
        }
        Ok(())
    }

    pub(super) fn each_alone(
        &mut self,
        watch: &mut dyn Watch,
        stage: &str,
        start: &Theta,
        alone: &mut Vec<Alone>,
        late: &mut Vec<&'static str>,
    ) -> Result<()> {
        watch.stage(stage, self.names.len());
        for name in self.names.clone() {
            watch.step(name);
            match in_time(self.one_alone(name, start))? {
                Some(one) => alone.push(one),
                None => late.push(name),
            }
        }
        Ok(())
    }

    fn one_alone(&mut self, name: &'static str, start: &Theta) -> Result<Alone> {
        self.forward.budget.go_on()?;
        let clock = Instant::now();
        let candidate = candidate_of(name);
        let fit = if candidate.noise {
            let data = self.noise_data(&self.base.clone(), self.fit_frames())?;
            let theta = self.noisy(&data, &self.base, &[name]);
            Fit { theta, half: BTreeMap::new() }
        } else {
            self.add(candidate, &[], start)?
        };
        let scores = self.judge.scores(self.forward, &fit.theta)?;
        self.log(name, &fit, &scores, clock);
        let against = match name {
            _ if candidate.noise => self.base.clone(),
            _ if self.is_known(name) => self.with_noise(&self.base.clone())?,
            _ => start.clone(),
        };
        let against = self.judge.scores(self.forward, &against)?;
        Ok(Alone { name, fit, scores, against })
    }
}
