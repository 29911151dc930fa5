//! The searches of a diagnosis: with the description as it stands, with one that may be wrong, and without the places
//! of what the scene does not have.

use super::decide::{Facts, NAMED, decide};
use super::found::{Found, SEARCH};
use super::objects::Objects;
use super::question::{Question, Seen};
use crate::diagnose::evidence::budget::{Stage, in_time};
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::room::is_description;
use crate::diagnose::judge::closed_fraction;
use crate::diagnose::report::Verdict;
use crate::diagnose::search::{Search, Watch};
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
    forward.budget.stage = Stage::Must;
    let seen_elsewhere = question.look(forward, Some(&objects.masks))?;
    let elsewhere = &*elsewhere.insert(Elsewhere { masks: objects.masks.clone(), seen: seen_elsewhere });
    let mut search = question.search(forward, &elsewhere.seen, Some(&elsewhere.masks));
    search.forward.budget.stage = Stage::Search;
    let again = in_time(searched(&mut search, watch))?.map(|again| again.found);
    if let Some(found) = again.filter(|found| !leaves_unknown(&search, found)) {
        return Ok(Outcome { search, found, objects: Some(objects) });
    }
    // What is left elsewhere is left by something that is no object: as if none had been found.
    search.forward.compared -= 1;
    let mut search = question.search(search.forward, seen, masks);
    search.forward.budget.stage = Stage::Search;
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
    let mut exact = search.look(watch, Vec::new())?;
    let early = in_time(search.questioned_early(&exact, &room, watch))?.flatten();
    if let Some(first) = early {
        return Ok(first);
    }
    search.begin_anew(Vec::new());
    search.end(&mut exact, watch)?;
    let left = in_time(search.judge.scores(search.forward, &exact.fit.theta))?;
    if room.is_empty() || left.as_ref().is_some_and(|left| left.beyond_bounds().is_empty()) {
        return Ok(First { found: exact, objects: None, questioned: false });
    }
    search.forward.budget.stage = Stage::Search;
    if left.is_none() || search.late() || !exact.is_whole() {
        return Ok(late(exact, &room));
    }
    let asked = room.contains(&"scene_radiance");
    let Some(objects) = in_time(if asked { search.undescribed(&exact) } else { Ok(None) })? else {
        return Ok(late(exact, &room));
    };
    if objects.is_some() {
        return Ok(First { found: exact, objects, questioned: false });
    }
    questioned(search, exact, &room, watch)
}

/// The finding of a search with a description that may be wrong, if there are signs of that beside what was found with
/// it as it stands; else that.
fn questioned(
    search: &mut Search<'_>,
    exact: Found,
    room: &[&'static str],
    watch: &mut dyn Watch,
) -> Result<First> {
    tracing::info!("{:?} leaves more than the discrepancy: {room:?} may be wrong", exact.set);
    search.begin_anew(room.to_vec());
    let promises = in_time(search.may_be_the_description(&exact.fit.theta))?;
    search.begin_anew(room.to_vec());
    let free = match promises {
        Some(true) => in_time(search.run(watch, exact.alone.clone()))?,
        Some(false) => {
            search.end_as(&exact);
            return Ok(First { found: exact, objects: None, questioned: true });
        }
        None => None,
    };
    let Some(free) = free else {
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

impl Search<'_> {
    /// The finding with a description that may be wrong, where that is asked about before a set is brought to its end:
    /// one that closes too little to be named beside an unknown effect is no finding, and its end takes as long as the
    /// search.
    fn questioned_early(
        &mut self,
        exact: &Found,
        room: &[&'static str],
        watch: &mut dyn Watch,
    ) -> Result<Option<First>> {
        let now = self.judge.scores(self.forward, &exact.fit.theta)?;
        let closed = closed_fraction(exact.before.mean(), now.mean(), now.floor());
        let is_finding = closed >= NAMED[0] || now.beyond_bounds().is_empty();
        if room.is_empty() || is_finding || self.late() || !exact.is_whole() {
            return Ok(None);
        }
        let asked = room.contains(&"scene_radiance");
        if asked && self.undescribed(exact)?.is_some() {
            return Ok(None);
        }
        tracing::info!("{:?} closes {closed:.2}: {room:?} may be wrong", exact.set);
        self.begin_anew(room.to_vec());
        let promises = self.may_be_the_description(&exact.fit.theta)?;
        self.begin_anew(room.to_vec());
        if promises {
            let found = self.run(watch, exact.alone.clone())?;
            if found.set.iter().any(|name| is_description(name)) {
                self.forward.budget.stage = Stage::End;
                let objects = if asked { in_time(self.undescribed(&found))?.flatten() } else { None };
                return Ok(Some(First { found, objects, questioned: true }));
            }
        }
        Ok(None)
    }

    /// The finding of the whole frames, where objects turned out to be none.
    fn without_objects(
        &mut self,
        first: Found,
        has_questioned: bool,
        watch: &mut dyn Watch,
    ) -> Result<Found> {
        if first.fit.theta.room.radiance {
            self.forward.find_covered(&first.fit.theta)?;
        }
        let room = std::mem::take(&mut self.room);
        if has_questioned {
            self.end_as(&first);
            return Ok(first);
        }
        if let Some(First { found, .. }) = in_time(questioned(self, first.clone(), &room, watch))? {
            return Ok(found);
        }
        self.end_as(&first);
        Ok(Found { left_out: vec![SEARCH], ..first })
    }
}

/// The finding with a description that may be wrong, if that names a part of it, else the one with it as it stands.
fn better_of(search: &mut Search<'_>, mut exact: Found, free: Found, room: &[&'static str]) -> Result<First> {
    search.forward.budget.stage = Stage::End;
    let questioned = free.set.iter().any(|name| is_description(name));
    if questioned && (free.is_whole() || in_time(search.explains_more(&free, &exact))? == Some(true)) {
        let asked = room.contains(&"scene_radiance");
        let objects = if asked { in_time(search.undescribed(&free))?.flatten() } else { None };
        return Ok(First { found: free, objects, questioned: true });
    }
    search.end_as(&exact);
    if !free.is_whole() {
        exact.leave_out(SEARCH);
        room.iter().for_each(|n| exact.is_late(n));
    }
    Ok(First { found: exact, objects: None, questioned: true })
}
