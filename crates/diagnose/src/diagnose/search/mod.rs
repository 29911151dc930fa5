//! Which candidates explain the gap: each alone, then sets by forward selection with pruning, refitted jointly.

pub(super) mod alone;
pub(super) mod apart;
pub(super) mod candidates;
pub(super) mod choices;
pub(super) mod comb;
pub(super) mod decide;
pub(super) mod doings;
pub(super) mod ending;
pub(super) mod exchange;
pub(super) mod fits;
pub(super) mod found;
mod level;
pub(super) mod levels;
pub(super) mod objects;
pub(super) mod odd;
pub(super) mod paint;
pub(super) mod pairs;
pub(super) mod question;
pub(super) mod round;
pub(super) mod searches;
pub(super) mod shown;
mod sites;
pub(super) mod support;
pub(super) mod tracked;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use crate::diagnose::evidence::Evidence;
use crate::diagnose::evidence::budget::{Budget, Budgeted, Stage, in_time};
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::fitted::Fit;
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::{
    CandidateSpec, P, Theta, candidate_of, free, is_discrete, mixes_pixels, moves,
};
use crate::diagnose::expect::tone::Tone;
use crate::diagnose::fit::cost::Target;
use crate::diagnose::fit::flicker::{LEVEL, is_periodic};
use crate::diagnose::fit::{COARSE, DETAILS, FINE, LAST, LAST_OF_LENS, Schedule, VALUES, fit};
use crate::diagnose::judge::noise::{NOISES, NoiseData, ahead_of_steps};
use crate::diagnose::judge::{Judge, Scores, gain};
use fits::Size;
use found::{Alone, Found, SEARCH};
use shown::Shown;
use shutterbug::error::Result;
use shutterbug::plane::Plane;
use support::restored;

/// Most effects of a set that change the mean.
const MOST_EFFECTS: usize = 6;
/// What share of a gap, counted from the floor, is nearly all of it.
const NEARLY_ALL: f64 = 0.85;

/// Where the search stands, for people who wait.
pub(crate) trait Watch {
    /// A stage began: its name, and how many steps it has.
    fn stage(&mut self, name: &str, steps: usize);
    /// A step of the stage is about to be taken.
    fn step(&mut self, what: &str);
}

/// All that a search works on.
pub(crate) struct Search<'a> {
    pub forward: &'a mut Forward,
    pub judge: Judge<'a>,
    pub evidence: &'a Evidence,
    /// Where fits compare: as the judge does, but for stuck pixels.
    pub masks: &'a [Plane<f32>],
    /// The camera as given.
    pub base: Theta,
    /// Candidates that are considered.
    pub names: Vec<&'static str>,
    /// What of the description may be wrong.
    pub room: Vec<&'static str>,
    /// What the frames themselves show.
    pub shown: Shown,
    /// What candidates that move the picture came to alone.
    pub moved_alone: Vec<(&'static str, Theta)>,
    /// Candidates that explained nothing when they were asked last.
    pub idle: Vec<&'static str>,
    /// Sets that were exchanged for another one, each sorted: none is grown into again.
    pub outdone: Vec<Vec<&'static str>>,
    /// Candidates that move the picture, each with one that explained more than it beside the same set.
    pub rivals: Vec<[&'static str; 2]>,
}

/// What another search of the same frames has found out.
#[derive(Default)]
pub(crate) struct Begun {
    /// What each candidate does alone.
    pub alone: Vec<Alone>,
    /// A set to go on from.
    pub set: Option<(Vec<&'static str>, Fit)>,
    /// What of the description may be wrong, if the search stops where paint or light shows (see [`paint`]).
    pub stops_for: Vec<&'static str>,
}

impl Budgeted for Search<'_> {
    fn budget(&mut self) -> &mut Budget {
        &mut self.forward.budget
    }
}

/// A candidate, its fit, and what that scored.
pub(crate) type Tried = (&'static str, Fit, Scores);

impl<'a> Search<'a> {
    /// What fits compare with.
    pub(crate) fn target(&self) -> Target<'a> {
        Target { evidence: self.evidence, masks: Some(self.masks) }
    }

    /// Numbers of the frames that are fitted to.
    pub(crate) fn fit_frames(&self) -> &'a [usize] {
        &self.evidence.fit
    }

    /// Whether the stage has no more time.
    pub(crate) fn late(&self) -> bool {
        self.forward.budget.is_over()
    }

    /// Fits a set jointly from a start.
    pub(crate) fn refit(&mut self, set: &[&'static str], start: &Theta, schedule: Schedule) -> Result<Fit> {
        if free(set).is_empty() {
            return self.refit_poses(start);
        }
        self.at(Size::Whole).refit(set, start, schedule)
    }

    /// The last fit of a set, with what was freed besides.
    pub(crate) fn refit_to_the_end(&mut self, found: &mut Found) -> Result<()> {
        let free = found.free();
        if !free.is_empty() {
            let (target, frames) = (self.target(), self.fit_frames());
            let fit = fit(self.forward, target, frames, &found.fit.theta, &free, last_of(&free))?;
            found.fit.theta = fit.theta;
        }
        Ok(())
    }

    /// What the differences that `theta` leaves tell of the noise.
    pub(crate) fn noise_data(&mut self, theta: &Theta, frames: &[usize]) -> Result<NoiseData> {
        // At the end as well as what is reported: what few samples a pixel make of fine texture looks like noise.
        let means = self.forward.pictures(frames, theta, self.judge.quality)?;
        let masks = self.forward.masked(Some(self.masks), theta.room.kind());
        let ahead = self.ahead_of_steps(frames, theta)?;
        Ok(NoiseData::measure(self.evidence, frames, &means, ahead.as_deref(), theta, masks.as_deref()))
    }

    /// What is simulated ahead of a coarse converter or a file, where their steps are seen one by one.
    pub(crate) fn ahead_of_steps(
        &mut self,
        frames: &[usize],
        theta: &Theta,
    ) -> Result<Option<Vec<Arc<Plane<f32>>>>> {
        let pictures = |plain| self.forward.pictures(frames, &plain, self.judge.quality);
        ahead_of_steps(theta).map(pictures).transpose()
    }

    /// `theta` with all noise that can be seen: values are judged against the spread that they have.
    pub(crate) fn with_noise(&mut self, theta: &Theta) -> Result<Theta> {
        let names: Vec<&str> = NOISES.into_iter().filter(|n| self.names.contains(n)).collect();
        let data = self.noise_data(theta, self.fit_frames())?;
        let noisy = self.noisy(&data, theta, &names);
        // What renderers differ by, or two compressions of nearly the same picture, looks like a pattern or like noise
        // that compression has weakened: it is some only if the score says so.
        let silent = data.fit(theta, &self.base, &[]);
        // Stuck pixels are seen one by one: they stay where what the spread was taken for is none.
        let stuck = noisy.is_on(P::Hot).then(|| silent.with(P::Hot, noisy.get(P::Hot)));
        let mut best = (self.judge.scores(self.forward, &silent)?.mean(), silent);
        for theta in stuck.into_iter().chain([noisy]) {
            let score = self.judge.scores(self.forward, &theta)?.mean();
            if score < best.0 {
                best = (score, theta);
            }
        }
        Ok(best.1)
    }

    /// Fits a candidate beside a set; once, if there is a journal.
    pub(crate) fn add(
        &mut self,
        candidate: &'static CandidateSpec,
        set: &[&'static str],
        theta: &Theta,
    ) -> Result<Fit> {
        let key = format!("{} {set:?} {theta:?}", candidate.name);
        let work = |search: &mut Self| {
            let mut fit = search.add_anew(candidate, set, theta)?;
            // A compression that can be read from the frames is there from the start, and noise is seen through it. How
            // much sharpening lifts it has changed with the rest of the set. What bends or mixes values does so to
            // their noise.
            let lifted = set.contains(&"sharpening") && (moves(candidate) || candidate.name == "defocus");
            let is_noisy = Tone::new(theta).is_noisy();
            let mixes = mixes_pixels(candidate.name) || (is_noisy && !moves(candidate));
            if lifted || (mixes && candidate.name != "jpeg" && fit.theta != *theta) {
                fit.theta = search.with_noise(&fit.theta)?;
            }
            Ok(fit)
        };
        Forward::tried(self, |search| search.forward, ("candidate", &key), work)
    }

    fn add_anew(
        &mut self,
        candidate: &'static CandidateSpec,
        set: &[&'static str],
        theta: &Theta,
    ) -> Result<Fit> {
        let mut joint = set.to_vec();
        joint.push(candidate.name);
        if is_discrete(candidate) {
            return self.add_discrete(candidate, set, theta);
        }
        let size = self.size_for(candidate, theta);
        let known = self.as_alone(candidate.name, theta);
        let starts = self.at(size).starts(theta, candidate, known)?;
        let schedule = schedule_of(candidate, set);
        let last = schedule[schedule.len() - 1];
        let weighing = self.at(size).weighing(theta, &last)?;
        // Values are looked for with the geometry held, whose renders are kept, but together with the set's other
        // values: a gain beside a white balance helps only if both move.
        let mut who: Vec<_> =
            joint.iter().copied().filter(|n| moves(candidate) || !moves(candidate_of(n))).collect();
        let level = self.level_beside(candidate, &joint, theta);
        who.extend(level);
        let mut best: Option<(f64, Theta)> = None;
        let mut valleys: Vec<Theta> = Vec::new();
        for start in &starts {
            let mut found = self.at(size).refit(&who, start, &schedule[..1])?;
            if valleys.iter().any(|v| is_near(v, &found.theta, &free(&who))) {
                continue;
            }
            valleys.push(found.theta.clone());
            found = self.at(size).refit(&who, &found.theta, &schedule[1..])?;
            if set.contains(&"jpeg") {
                found = self.beside_compression(&who, found, schedule)?;
            }
            if let Some(level) = level {
                found.theta = restored(&found.theta, theta, candidate_of(level));
            }
            let cost = self.at(size).cost(&found.theta, &last, &weighing)?;
            if best.as_ref().is_none_or(|b| cost < b.0) {
                best = Some((cost, found.theta));
            }
        }
        let (cost, start) = best.expect("there is always a start");
        if candidate.name == "flicker" && !is_periodic(self.forward, self.evidence, Some(self.masks), &start)?
        {
            tracing::info!("flicker: brightness goes up and down, but not as a sine");
            return Ok(Fit { theta: theta.clone(), half: BTreeMap::new() });
        }
        let was = self.at(size).cost(theta, &last, &weighing)?;
        // Values are fitted with the geometry held; the one that is taken is fitted jointly then.
        if cost >= was || !moves(candidate) {
            return Ok(Fit { theta: start, half: BTreeMap::new() });
        }
        self.at(size).refit(&joint, &start, FINE)
    }

    /// What is fitted beside a candidate, and then taken back: brightness goes up and down about a level, and a
    /// frequency that has to explain a gain too is another one.
    fn level_beside(
        &self,
        candidate: &CandidateSpec,
        set: &[&'static str],
        theta: &Theta,
    ) -> Option<&'static str> {
        let open = candidate.name == "flicker" && !set.contains(&LEVEL) && !theta.room.radiance;
        open.then_some(LEVEL)
    }

    /// Runs the search, for as long as there is time; what it had found by then is kept.
    pub(crate) fn run(&mut self, watch: &mut dyn Watch, begun: Begun) -> Result<Found> {
        let mut found = self.look(watch, begun)?;
        self.end(&mut found, watch)?;
        Ok(found)
    }

    /// [`Search::run`] as far as the set is found.
    pub(crate) fn look(&mut self, watch: &mut dyn Watch, begun: Begun) -> Result<Found> {
        let before = self.judge.scores(self.forward, &self.base.clone())?;
        self.forward.budget.go_on()?;
        self.forward.budget.enter(Stage::Search);
        let Begun { alone, set, stops_for } = begun;
        let mut found = Found { alone, ..Found::nothing(&self.base, before) };
        let ended = self.look_for(&mut found, (set, stops_for), watch);
        if in_time(ended)?.is_none() {
            let tried = |n: &&str| found.set.is_empty() && found.alone.iter().any(|a| a.name == *n);
            let late: Vec<_> = self.left_beside(&found.set).into_iter().filter(|n| !tried(n)).collect();
            late.into_iter().for_each(|n| found.is_late(n));
            found.leave_out(SEARCH);
        }
        Ok(found)
    }

    /// The rest of [`Search::run`].
    pub(crate) fn end(&mut self, found: &mut Found, watch: &mut dyn Watch) -> Result<()> {
        watch.stage("the set to the end", 4);
        watch.step("all parameters together");
        let clock = Instant::now();
        self.finish(found, watch)?;
        self.forward.budget.tell(clock.elapsed().as_secs_f64());
        Ok(())
    }

    fn look_for(
        &mut self,
        found: &mut Found,
        (begun, stops_for): (Option<(Vec<&'static str>, Fit)>, Vec<&'static str>),
        watch: &mut dyn Watch,
    ) -> Result<()> {
        let (packed, set) = self.shown.put(&self.base);
        found.set = set;
        found.fit.theta = packed.clone();
        let start = self.with_noise(&packed)?;
        found.fit.theta = start.clone();
        let mut scores = self.judge.scores(self.forward, &start)?;
        if found.alone.is_empty() {
            self.each_alone(watch, "each candidate alone", &start, &mut found.alone, &mut found.late)?;
        }
        self.remember(&found.alone);
        let first = begun.as_ref().map_or(0, |(set, _)| set.len());
        if let Some((set, fit)) = begun {
            tracing::info!("begins with {set:?}");
            (found.set, found.fit) = (set, fit);
            found.fit.theta = self.with_noise(&found.fit.theta)?;
            scores = self.judge.scores(self.forward, &found.fit.theta)?;
            self.prune(&mut found.set, &mut found.fit, &mut scores)?;
        }
        self.grow(found, (first, scores), &stops_for, watch)
    }

    /// Adds effects to a set, one a round from that one on, until none explains more.
    pub(crate) fn grow(
        &mut self,
        found: &mut Found,
        (first, mut scores): (usize, Scores),
        stops_for: &[&'static str],
        watch: &mut dyn Watch,
    ) -> Result<()> {
        for round in first..MOST_EFFECTS {
            let current = found.fit.clone();
            let mut options: Vec<Tried> = if round == 0 {
                let mut alone = of_alone(found);
                alone.extend(self.described(watch, (&found.set, &current), &scores, &alone)?);
                alone
            } else if self.late() {
                self.left_beside(&found.set).into_iter().for_each(|n| found.is_late(n));
                break;
            } else {
                self.round(watch, &found.set, &current, &scores, &mut found.late)?
            };
            options.extend(in_time(self.flicker_and_level(&found.set, &options))?.flatten());
            self.remember_rivals(&scores, &options);
            let late = self.late();
            if late {
                let unseen = self.room.iter().filter(|n| !found.set.contains(n)).copied();
                unseen.collect::<Vec<_>>().into_iter().for_each(|n| found.is_late(n));
                // What has been tried is taken in the time of the end.
                self.forward.budget.enter(Stage::End);
            }
            let Some((set, fit, better)) = self.taken(watch, found, &scores, options, late)? else { break };
            if !late && self.shows_paint(found, &scores, (&set, &better), stops_for)? {
                found.shows_paint = true;
                break;
            }
            (found.set, found.fit, scores) = (set, fit, better);
            if late {
                self.left_beside(&found.set).into_iter().for_each(|n| found.is_late(n));
                break;
            }
            self.prune(&mut found.set, &mut found.fit, &mut scores)?;
        }
        Ok(())
    }

    /// The set with the best option in it, fitted jointly, under the noise that shows beside it. An option that
    /// explains no more then, for the noise explains as much, gives way to the next.
    fn taken(
        &mut self,
        watch: &mut dyn Watch,
        found: &Found,
        now: &Scores,
        mut options: Vec<Tried>,
        late: bool,
    ) -> Result<Option<(Vec<&'static str>, Fit, Scores)>> {
        let mut by_another = !late && self.holds_to_description();
        loop {
            let (mut set, mut chosen) =
                (found.set.clone(), self.choose(&found.fit.theta, now, options.clone())?);
            if chosen.is_none() && std::mem::take(&mut by_another) {
                (set, chosen) = self.by_way_of_another(watch, found, now, options.clone())?;
            }
            let Some((name, fit, _)) = chosen else { return Ok(None) };
            set.extend(self.members_of(name, &fit.theta, &set));
            let is_fitted = moves(candidate_of(name))
                || self.level_beside(candidate_of(name), &set, &fit.theta).is_some();
            let fit = if late || is_fitted { fit } else { self.refit(&set, &fit.theta, FINE)? };
            // The noise shows better now.
            let theta = self.with_noise(&fit.theta)?;
            let better = self.judge.scores(self.forward, &theta)?;
            // Beside another description other places are compared.
            if !self.holds_to_description() || gain(now, &better).value > 0.0 {
                tracing::info!("most is explained by {name}: {:.3} to {:.3} DN", now.mean(), better.mean());
                return Ok(Some((set, Fit { theta, half: fit.half }, better)));
            }
            tracing::info!("{name} explains no more: {:.3} for {:.3} DN", better.mean(), now.mean());
            by_another = false;
            options.retain(|o| o.0 != name);
        }
    }

    /// As before a search, of which that much of the description may be wrong.
    pub(crate) fn begin_anew(&mut self, room: Vec<&'static str>) {
        self.room = room;
        (self.judge.quality, self.forward.native) = (Quality::Fit, false);
        self.judge.kind = self.base.room.kind();
    }

    /// Whether one finding leaves less on the frames to choose by than another, both where both can be scored.
    pub(crate) fn explains_more(&mut self, one: &Found, other: &Found) -> Result<bool> {
        self.judge.kind = one.fit.theta.room.kind().and(other.fit.theta.room.kind());
        let [one, other] = [one, other].map(|f| self.judge.scores(self.forward, &f.fit.theta));
        Ok(one?.mean() < other?.mean())
    }

    /// As behind the search that found this.
    pub(crate) fn end_as(&mut self, found: &Found) {
        self.room.clear();
        (self.judge.quality, self.forward.native) = (Quality::Fine, true);
        self.judge.kind = found.fit.theta.room.kind();
    }
}

/// What each candidate that changes the mean does alone, as options of the first round.
fn of_alone(found: &Found) -> Vec<Tried> {
    let open = |a: &&Alone| !candidate_of(a.name).noise && !found.set.contains(&a.name);
    found.alone.iter().filter(open).map(|a| (a.name, a.fit.clone(), a.scores.clone())).collect()
}

/// The stages of the fit of a candidate beside a set.
fn schedule_of(candidate: &CandidateSpec, set: &[&str]) -> Schedule {
    match candidate.name {
        // Means over blocks know nothing of a px more or less of sharpness.
        "sharpening" => DETAILS,
        "defocus" if set.contains(&"sharpening") => DETAILS,
        _ if moves(candidate) => COARSE,
        _ => VALUES,
    }
}

/// The last stages of a fit. Through a lens pictures are read from ones of twice the size, which have four samples a
/// pixel as it is.
pub(crate) fn last_of(free: &[P]) -> Schedule {
    if free.contains(&P::K1) { LAST_OF_LENS } else { LAST }
}

/// How well frames are rendered where sets are told apart that differ by little: what sixteen samples of a long
/// exposure miss may be more than a filter changes.
pub(crate) fn finest_of(theta: &Theta) -> Quality {
    if theta.is_on(P::Exposure) { Quality::Finest } else { Quality::Fine }
}

/// Whether fits that began at different places have come to the same one, within a part of the steps of their
/// derivatives.
fn is_near(a: &Theta, b: &Theta, free: &[P]) -> bool {
    a.scan_order == b.scan_order && free.iter().all(|&p| (a.get(p) - b.get(p)).abs() < 0.25 * p.spec().step)
}

/// `theta` moved off the places where a parameter has no slope because its partner is neutral.
pub(crate) fn probe(theta: &Theta) -> Theta {
    let mut probe = theta.clone();
    if !theta.is_on(P::Sharpen) {
        probe.set(P::Radius, 1.0);
    }
    probe
}
