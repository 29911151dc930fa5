//! What each candidate does alone.

use std::collections::BTreeMap;
use std::time::Instant;

use crate::diagnose::evidence::budget::in_time;
use crate::diagnose::expect::fitted::Fit;
use crate::diagnose::expect::model::{Theta, candidate_of, moves};
use crate::diagnose::search::found::Alone;
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
