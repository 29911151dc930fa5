//! What parameters and members of a set do to the frames, to first order at a solution: which candidates could do what
//! a member does, and which two could do what two others do.

use super::found::Found;
use super::support::restored;
use crate::diagnose::evidence::blocks::pooled;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::evidence::spread_out;
use crate::diagnose::expect::linear::solve;
use crate::diagnose::expect::model::{P, Theta, candidate_of, free};
use crate::diagnose::fit::cost::{Level, hide};
use crate::diagnose::fit::normal::{assemble, linearise};
use crate::diagnose::search::{Search, probe};
use shutterbug::error::Result;

/// Where slopes are compared: of blocks, whose steps are long enough for what a short exposure does to show beside what
/// few samples a pixel miss.
const LOOK: Level = Level { block: 4, iterations: 0, quality: Quality::Fit, frames: 3 };
/// Share of what a member does to the frames, in squares, that a candidate must be able to do to be fitted in its
/// place: with less it does more that is wrong than right.
const RESEMBLES: f64 = 0.5;
/// Most candidates that are fitted in the place of a member.
const MOST: usize = 3;

impl Search<'_> {
    /// What single parameters, and the set's members, do to the frames beside the set as it is.
    pub(crate) fn doings(&mut self, found: &Found) -> Result<Doings> {
        let others = self.names.iter().copied().filter(|n| self.may_change(n));
        let more = others.flat_map(|n| candidate_of(n).parameters.iter().copied());
        let mut all: Vec<P> = free(&found.set).into_iter().chain(more).collect();
        all.sort();
        all.dedup();
        let frames = spread_out(&self.evidence.fit, LOOK.frames);
        let (target, probe) = (self.target(), probe(&found.fit.theta));
        let e = linearise(self.forward, target, &frames, &probe, &all, &LOOK, None)?;
        let members: Vec<_> = found.set.iter().copied().filter(|n| self.may_change(n)).collect();
        let mut values = e.values;
        for member in &members {
            let without = restored(&found.fit.theta, &self.base, candidate_of(member));
            let done = self.difference(&frames, &found.fit.theta, &without)?;
            values.iter_mut().zip(done).for_each(|(frame, done)| frame.1.push(done));
        }
        let e = assemble(values, all.len() + members.len(), e.weighing);
        Ok(Doings { a: e.a, b: e.b, all, members })
    }

    /// By frame: what is simulated of one point less that of another, ahead of compression, as fits compare it.
    fn difference(&mut self, frames: &[usize], theta: &Theta, other: &Theta) -> Result<Vec<Vec<f32>>> {
        let smooth = [theta, other].map(|t| t.with(P::Quality, 0.0));
        let [a, b] = smooth.each_ref().map(|t| self.forward.pictures(frames, t, LOOK.quality));
        let (a, b, target) = (a?, b?, self.target());
        let one = |i: usize| {
            let pairs = a[i].data.iter().zip(&b[i].data);
            let mut data: Vec<f32> = pairs.map(|(a, b)| a - b).collect();
            hide(target, frames[i], &mut data);
            pooled(&data, a[i].width, a[i].height, LOOK.block)
        };
        Ok((0..frames.len()).map(one).collect())
    }
}

/// What parameters do to the frames, to first order at the solution, and what members of the set do there: products of
/// the derivatives, in units of the parameters' steps, and of the differences that the members make.
pub(crate) struct Doings {
    all: Vec<P>,
    /// Behind the parameters.
    members: Vec<&'static str>,
    a: Vec<Vec<f64>>,
    /// The same with what the solution leaves.
    b: Vec<f64>,
}

/// Members that go, candidates that come, and the steps that the latter and the rest of the set then take.
#[derive(Clone, Debug)]
pub(crate) struct Swap {
    pub(crate) out: Vec<&'static str>,
    pub(crate) by: Vec<&'static str>,
    pub(crate) steps: Vec<(P, f64)>,
    /// What squares, weighted, change by.
    change: f64,
}

impl Doings {
    /// How much of what the members `out` do is left that the parameters `by` cannot do: squares, weighted.
    fn left(&self, out: &[&str], by: &[P]) -> f64 {
        let moved = self.places_of(out);
        let with = |i: usize| moved.iter().map(|&j| self.a[i][j]).sum::<f64>();
        let whole: f64 = moved.iter().map(|&i| with(i)).sum();
        (whole - self.solved(by, with).map_or(0.0, |(_, done)| done)).max(0.0)
    }

    /// The steps of the parameters `of` that explain most of a difference whose products with all columns are `with`,
    /// and how much of it that is, in squares.
    fn solved(&self, of: &[P], with: impl Fn(usize) -> f64) -> Option<(Vec<(P, f64)>, f64)> {
        let at: Vec<usize> =
            (0..self.all.len()).filter(|&i| of.contains(&self.all[i]) && self.a[i][i] > 0.0).collect();
        let a: Vec<Vec<f64>> = at.iter().map(|&i| at.iter().map(|&j| self.a[i][j]).collect()).collect();
        let b: Vec<f64> = at.iter().map(|&i| with(i)).collect();
        let steps = solve(&a, &b, 1e-6)?;
        let done = steps.iter().zip(&b).map(|(x, b)| x * b).sum();
        Some((at.iter().map(|&i| self.all[i]).zip(steps).collect(), done))
    }

    /// Of the candidates `others` those that do, beside `rest`, most of what the members `out` do; the most like first.
    pub(crate) fn alike(
        &self,
        out: &[&str],
        rest: &[&'static str],
        others: &[&'static str],
    ) -> Vec<&'static str> {
        let held = free(rest);
        let without = self.left(out, &held);
        let like = |name: &&'static str| {
            let by: Vec<P> = held.iter().chain(candidate_of(name).parameters).copied().collect();
            (*name, 1.0 - self.left(out, &by) / without.max(1e-12))
        };
        let all: Vec<_> = others.iter().map(like).collect();
        tracing::debug!("all like {out:?} beside {rest:?}: {all:?}");
        let mut alike: Vec<_> = all.into_iter().filter(|a| a.1 > RESEMBLES).collect();
        alike.sort_by(|a, b| b.1.total_cmp(&a.1));
        tracing::info!("like {out:?} beside {rest:?}: {alike:?}");
        alike.into_iter().take(MOST).map(|a| a.0).collect()
    }

    /// The exchanges, one of `outs` for one of `bys` each, that to first order leave least of the frames unexplained;
    /// the best first. Those that come must be able to do most of what goes does.
    pub(crate) fn swaps(
        &self,
        outs: &[Vec<&'static str>],
        bys: &[Vec<&'static str>],
        set: &[&'static str],
    ) -> Vec<Swap> {
        let with = |out: &Vec<&'static str>| -> Vec<Swap> {
            let rest: Vec<_> = set.iter().copied().filter(|n| !out.contains(n)).collect();
            bys.iter().filter_map(|by| self.swap(out, &rest, by)).collect()
        };
        let mut all: Vec<Swap> = outs.iter().flat_map(with).collect();
        all.sort_by(|a, b| a.change.total_cmp(&b.change));
        all.truncate(MOST);
        all
    }

    fn swap(&self, out: &[&'static str], rest: &[&'static str], by: &[&'static str]) -> Option<Swap> {
        let moved: Vec<usize> = self.places_of(out);
        let left = |i: usize| self.b[i] + moved.iter().map(|&j| self.a[i][j]).sum::<f64>();
        let (steps, done) = self.solved(&free(&rest.iter().chain(by).copied().collect::<Vec<_>>()), left)?;
        // Squares of what is left without the members, less those of what is left with them.
        let change = moved.iter().map(|&i| self.b[i] + left(i)).sum::<f64>() - done;
        let most = (1.0 - RESEMBLES) * self.left(out, &free(rest));
        (change < most).then(|| Swap { out: out.to_vec(), by: by.to_vec(), steps, change })
    }

    /// Where what some members do stands behind the parameters.
    fn places_of(&self, out: &[&str]) -> Vec<usize> {
        let members = self.members.iter().enumerate().filter(|(_, m)| out.contains(m));
        members.map(|(k, _)| self.all.len() + k).collect()
    }
}
