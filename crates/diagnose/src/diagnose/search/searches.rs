//! The searches of a diagnosis: with the description as it stands, with one that may be wrong, and without the places
//! of what the scene does not have.

use super::candidates::MOST_OF_IT;
use super::decide::{Facts, NAMED, decide};
use super::found::{Found, SEARCH};
use super::objects::Objects;
use super::question::{Question, Seen};
use super::support::restored;
use super::{NEARLY_ALL, finest_of};
use crate::diagnose::evidence::budget::{Budgeted, Stage, in_time};
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::fitted::Fit;
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::{candidate_of, moves};
use crate::diagnose::expect::room::{SURFACES, is_description};
use crate::diagnose::judge::noise::NOISES;
use crate::diagnose::judge::{Scores, closed_fraction};
use crate::diagnose::report::Verdict;
use crate::diagnose::search::{Begun, Search, Watch};
use shutterbug::error::Result;
use shutterbug::plane::Plane;

/// What the searches came to.
pub(crate) struct Outcome<'a> {
    /// The search that found it.
    pub search: Search<'a>,
    pub found: Found,
    /// What the scene does not have; its places are compared nowhere.
    pub objects: Option<Objects>,
}

/// Where frames are compared beside undescribed objects, and what the simulation shows there.
pub(crate) struct Elsewhere {
    masks: Vec<Plane<f32>>,
    seen: Seen,
}

/// What searches of the whole frames came to.
struct First {
    found: Found,
    /// Where the scene lacks something, if the rest is explained without these places.
    objects: Option<Objects>,
    /// Whether the description was questioned for it: else it stands as it was given.
    questioned: bool,
}

/// Searches, and where objects are found that the scene does not have, once more without their places. If something
/// that is in no few places remains then, the objects are given up, and the frames are searched as a whole.
///
/// # Errors
/// Those of the device; an interruption.
pub(crate) fn search_all<'a>(
    question: &Question<'a>,
    forward: &'a mut Forward,
    (seen, masks): (&'a Seen, Option<&'a [Plane<f32>]>),
    elsewhere: &'a mut Option<Elsewhere>,
    watch: &mut dyn Watch,
) -> Result<Outcome<'a>> {
    let mut search = question.search(forward, seen, masks);
    let First { found: first, objects, questioned } = searched(&mut search, watch)?;
    let Some(objects) = objects else { return Ok(Outcome { search, found: first, objects: None }) };
    let forward = search.forward;
    forward.compared += 1;
    let seen_elsewhere =
        forward.within(Stage::Must, |forward| question.look(forward, Some(&objects.masks)))?;
    let elsewhere = &*elsewhere.insert(Elsewhere { masks: objects.masks.clone(), seen: seen_elsewhere });
    let mut search = question.search(forward, &elsewhere.seen, Some(&elsewhere.masks));
    search.forward.budget.enter(Stage::Search);
    let again = in_time(searched(&mut search, watch))?.map(|again| again.found);
    if let Some(found) = again.filter(|found| !leaves_unknown(&search, found)) {
        return Ok(Outcome { search, found, objects: Some(objects) });
    }
    // What is left elsewhere is left by something that is no object: as if none had been found.
    search.forward.compared -= 1;
    let mut search = question.search(search.forward, seen, masks);
    search.forward.budget.enter(Stage::Search);
    let found = search.without_objects(first, questioned, watch)?;
    Ok(Outcome { search, found, objects: None })
}

/// Whether a search that came to its end leaves what no candidate explains.
fn leaves_unknown(search: &Search<'_>, found: &Found) -> bool {
    found.is_whole() && decide(&Facts::of(search, found)).verdict == Verdict::UnknownEffect
}

/// Searches with the description as it stands, and once more with one that may be wrong where that leaves more on the
/// frames to choose by than the discrepancy can make: a description is questioned only where no camera explains the
/// frames. First of all by what is in few places.
fn searched(search: &mut Search<'_>, watch: &mut dyn Watch) -> Result<First> {
    let room = std::mem::take(&mut search.room);
    let mut exact = search.look(watch, Begun { stops_for: room.clone(), ..Begun::default() })?;
    if exact.shows_paint {
        search.begin_anew(room.clone());
        let free = in_time(search.run_beside(&exact, watch))?;
        if let Some(free) = free.filter(names_description) {
            return search.with_objects(free, &room);
        }
        search.begin_anew(Vec::new());
        let begun = Begun { set: Some((exact.set, exact.fit)), alone: exact.alone, ..Begun::default() };
        exact = search.look(watch, begun)?;
    }
    let free = match in_time(search.freed_early(&exact, &room, watch))?.flatten() {
        Some(free) if names_description(&free) => return search.with_objects(free, &room),
        other => other,
    };
    search.begin_anew(Vec::new());
    search.end(&mut exact, watch)?;
    let left = in_time(search.judge.scores(search.forward, &exact.fit.theta))?;
    if room.is_empty() || left.as_ref().is_some_and(|left| left.beyond_bounds().is_empty()) {
        return Ok(First { found: exact, objects: None, questioned: false });
    }
    search.forward.budget.enter(Stage::Search);
    if left.is_none() || search.late() || !exact.is_whole() {
        return Ok(late(exact, &room));
    }
    let Some(objects) = in_time(search.objects_beside(&exact, &room))? else {
        return Ok(late(exact, &room));
    };
    if objects.is_some() {
        return Ok(First { found: exact, objects, questioned: false });
    }
    questioned(search, exact, (free, &room), watch)
}

/// The finding of a search with a description that may be wrong, if there are signs of that beside what was found with
/// it as it stands; else that. `free`: what such a search has found already.
fn questioned(
    search: &mut Search<'_>,
    exact: Found,
    (free, room): (Option<Found>, &[&'static str]),
    watch: &mut dyn Watch,
) -> Result<First> {
    tracing::info!("{:?} leaves more than the discrepancy: {room:?} may be wrong", exact.set);
    let freed = match in_time(search.promises(&exact, room, MOST_OF_IT))? {
        Some(true) => match free {
            Some(free) => Some(free),
            None => in_time(search.run_beside(&exact, watch))?,
        },
        Some(false) => {
            search.end_as(&exact);
            return Ok(First { found: exact, objects: None, questioned: true });
        }
        None => None,
    };
    let Some(free) = freed else {
        search.end_as(&exact);
        return Ok(late(exact, room));
    };
    better_of(search, exact, free, room)
}

/// A finding whose description there was no time to question.
fn late(mut found: Found, room: &[&'static str]) -> First {
    room.iter().for_each(|n| found.is_late(n));
    First { found, objects: None, questioned: true }
}

fn names_description(found: &Found) -> bool {
    found.set.iter().any(|name| is_description(name))
}

impl Search<'_> {
    /// The finding of a search with a description that may be wrong, where that is asked about before a set is brought
    /// to its end, which takes as long as the search: a set that closes too little to be named beside an unknown effect
    /// is no finding, and of one that closes more the last fit shows what it leaves.
    fn freed_early(
        &mut self,
        exact: &Found,
        room: &[&'static str],
        watch: &mut dyn Watch,
    ) -> Result<Option<Found>> {
        let mut now = self.judge.scores(self.forward, &exact.fit.theta)?;
        if room.is_empty() || now.beyond_bounds().is_empty() || self.late() || !exact.is_whole() {
            return Ok(None);
        }
        let closed = closed_fraction(exact.before.mean(), now.mean(), now.floor());
        let most = if closed < NAMED[0] { MOST_OF_IT } else { NEARLY_ALL };
        // What comes of the last fit is for this question alone: the end may put other effects in the place of these.
        let mut fitted = exact.clone();
        if closed >= NAMED[0] {
            now = self.finely(&fitted)?;
            if !now.beyond_bounds().is_empty() {
                self.free_more(&mut fitted)?;
                self.refit_to_the_end(&mut fitted)?;
                now = self.finely(&fitted)?;
            }
        }
        if now.beyond_bounds().is_empty() || self.objects_beside(&fitted, room)?.is_some() {
            return Ok(None);
        }
        tracing::info!("{:?} closes {closed:.2}: {room:?} may be wrong", exact.set);
        if self.promises(&fitted, room, most)? {
            return self.run_beside(&fitted, watch).map(Some);
        }
        Ok(None)
    }

    /// Scores of a finding at the end's samples a pixel: few are off by themselves.
    fn finely(&mut self, found: &Found) -> Result<Scores> {
        (self.judge.quality, self.forward.native) = (finest_of(&found.fit.theta), true);
        let scores = self.judge.scores(self.forward, &found.fit.theta);
        (self.judge.quality, self.forward.native) = (Quality::Fit, false);
        scores
    }

    /// A search with a description that may be wrong, beside what the one with it as it stands has found: as a rule
    /// what moves the picture is right, and what changes its values stood for factors of surfaces.
    fn run_beside(&mut self, exact: &Found, watch: &mut dyn Watch) -> Result<Found> {
        let set = in_time(self.moved_and_lit(exact))?.flatten();
        self.run(watch, Begun { alone: exact.alone.clone(), set, ..Begun::default() })
    }

    /// What moves the picture in a finding, what the frames themselves show, and factors of surfaces, fitted together,
    /// if these explain more so than they do alone.
    fn moved_and_lit(&mut self, exact: &Found) -> Result<Option<(Vec<&'static str>, Fit)>> {
        let does_move = |n: &str| moves(candidate_of(n));
        if !exact.set.iter().any(|n| does_move(n)) || !self.room.contains(&SURFACES) {
            return Ok(None);
        }
        let stays = |n: &&'static str| does_move(n) || self.is_known(n);
        let members: Vec<_> = exact.set.iter().copied().filter(stays).collect();
        let rest = exact.set.iter().filter(|n| !members.contains(n)).chain(&NOISES);
        let start = rest.fold(exact.fit.theta.clone(), |t, n| restored(&t, &self.base, candidate_of(n)));
        let start = self.with_noise(&start)?;
        let Some((name, fit, scores)) = self.one_beside(SURFACES, &members, &start)? else { return Ok(None) };
        let (bare, known) = self.shown.put(&self.base);
        let bare = self.with_noise(&bare)?;
        let alone = self.one_beside(SURFACES, &known, &bare)?;
        let explains_more = alone.is_none_or(|alone| scores.mean() < alone.2.mean());
        Ok(explains_more.then(|| (members.into_iter().chain([name]).collect(), fit)))
    }

    /// Whether the description may be the cause of what a finding leaves; behind it a search with it free can begin.
    fn promises(&mut self, exact: &Found, room: &[&'static str], most: f64) -> Result<bool> {
        self.begin_anew(room.to_vec());
        let promises = self.may_be_the_description(&exact.fit.theta, most);
        self.begin_anew(room.to_vec());
        promises
    }

    /// Where the scene lacks something, if that is why a finding leaves more than the discrepancy; asked where the
    /// scene may be wrong.
    fn objects_beside(&mut self, found: &Found, room: &[&'static str]) -> Result<Option<Objects>> {
        if room.contains(&SURFACES) { self.undescribed(found) } else { Ok(None) }
    }

    /// A finding with the description free, and where the scene lacks something beside it.
    fn with_objects(&mut self, found: Found, room: &[&'static str]) -> Result<First> {
        self.forward.budget.enter(Stage::End);
        let mut objects = in_time(self.objects_beside(&found, room))?.flatten();
        if objects.is_none() && found.set.contains(&SURFACES) {
            objects = in_time(self.objects_painted(&found))?.flatten();
        }
        Ok(First { found, objects, questioned: true })
    }

    /// Where the scene lacks something that factors of surfaces were taken for: they make a thing of what lies behind
    /// it, and leave its outline, which no surface has. Without them and without those places all else is explained.
    fn objects_painted(&mut self, found: &Found) -> Result<Option<Objects>> {
        let painted = self.judge.scores(self.forward, &found.fit.theta)?;
        if painted.beyond_bounds().is_empty() {
            return Ok(None);
        }
        let mut plain = found.clone();
        plain.fit.theta = restored(&found.fit.theta, &self.base, candidate_of(SURFACES));
        self.undescribed(&plain)
    }

    /// The finding of the whole frames, where objects turned out to be none.
    fn without_objects(
        &mut self,
        first: Found,
        has_questioned: bool,
        watch: &mut dyn Watch,
    ) -> Result<Found> {
        let room = std::mem::take(&mut self.room);
        if !has_questioned {
            return Ok(questioned(self, first, (None, &room), watch)?.found);
        }
        // What other frames saw was found for the search elsewhere since. The report needs it, however late it is.
        if first.fit.theta.room.radiance {
            self.forward.within(Stage::Must, |forward| forward.find_covered(&first.fit.theta))?;
        }
        self.end_as(&first);
        Ok(first)
    }
}

/// The finding with a description that may be wrong, if that names a part of it, else the one with it as it stands.
fn better_of(search: &mut Search<'_>, mut exact: Found, free: Found, room: &[&'static str]) -> Result<First> {
    search.forward.budget.enter(Stage::End);
    let is_better = |search: &mut Search<'_>| in_time(search.explains_more(&free, &exact));
    if names_description(&free) && (free.is_whole() || is_better(search)? == Some(true)) {
        return search.with_objects(free, room);
    }
    search.end_as(&exact);
    if !free.is_whole() {
        exact.leave_out(SEARCH);
        room.iter().for_each(|n| exact.is_late(n));
    }
    Ok(First { found: exact, objects: None, questioned: true })
}
