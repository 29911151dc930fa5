//! The decision: what was measured goes in, a verdict comes out. Nothing is rendered, fitted or scored here.

use super::found::Found;
use crate::diagnose::expect::description::by_value::ByValue;
use crate::diagnose::expect::model::{P, Theta, candidate_of};
use crate::diagnose::expect::room;
use crate::diagnose::judge::quantile;
use crate::diagnose::report::Verdict;
use crate::diagnose::search::Search;

/// Share of flat places in which single values may be far off.
///
/// Measured: none on captures that hide nothing (d00, d08).
const MOST_OUTLIERS: f64 = 1e-4;
/// Share of the gap that must be closed for what is left to be a second cause, and not what the named ones only
/// resemble.
///
/// Measured: a gain and a white balance close 93 % of a gamma's gap (withheld captures of seeds up to 606).
pub(crate) const RESEMBLED: f64 = 0.97;
/// Share of the gap that must be closed for effects to be named beside an unknown one; less, where a part of the
/// picture is explained altogether.
///
/// Measured: contrast curves and ghosts that are on no list were closed to 28 to 78 % by what resembles them.
pub(crate) const NAMED: [f64; 2] = [0.75, 0.2];
/// That part: share of the gap that lies in blocks in which nearly nothing of it is left.
const SOLVED: f64 = 0.15;
/// Share of the displacement that must be gone for effects to be named that move photographs by a camera at rest.
///
/// Measured: 76 % on thirteen photographs of a board, with the lens of an independent calibration.
const PLACED: f64 = 0.75;

/// Share of the picture that must have been compared for a verdict on the frames as a whole: most of it.
pub(crate) const MOST_COMPARED: f64 = 0.5;

/// What a decision is made of.
pub(crate) struct Facts {
    /// Whether anything is named.
    pub any: bool,
    /// Checks that what is left has not passed, in words.
    pub failed: Vec<&'static str>,
    /// Whether one of them is of the noise. A score counts what spreads as a model says as expected: how much of a gap
    /// is closed says nothing of what kind the noise is.
    pub other_noise: bool,
    /// Share of the gap that is closed.
    pub closed: f64,
    /// Share of the gap that lies where it is closed altogether.
    pub solved: f64,
    /// Whether everything has come to lie where it should, before a camera at rest.
    pub placed: bool,
    /// Whether a fit has run to the end of a parameter's range: it wanted to be something else.
    pub bounded: bool,
    /// Whether the frames show another scene.
    pub elsewhere: bool,
    /// Whether what is left is known to be no more than two correct simulations may differ by: its interval ends below.
    pub within: bool,
    /// Whether factors of surfaces may be an effect on values that is on no list: they follow the described colours,
    /// or nothing else is named and it cannot be told.
    pub like_values: bool,
}

/// A verdict, and whether the effects found are named.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Decision {
    pub verdict: Verdict,
    pub names: bool,
    /// Checks that failed, for the sentence.
    pub failed: Vec<&'static str>,
}

/// The whole of the decision.
pub(crate) fn decide(facts: &Facts) -> Decision {
    let failed = facts.failed.clone();
    let say = |verdict, names| Decision { verdict, names, failed: failed.clone() };
    let beside = facts.closed >= NAMED[1] && (facts.solved >= SOLVED || facts.placed);
    let named = facts.any && (facts.closed >= NAMED[0] || beside);
    if facts.elsewhere {
        say(Verdict::UnknownEffect, false)
    } else if !facts.any {
        let none = if facts.within { Verdict::NoGap } else { Verdict::Undetermined };
        say(if failed.is_empty() { none } else { Verdict::UnknownEffect }, false)
    } else if facts.like_values {
        // Not what is left tells of it, but what is taken for surfaces.
        Decision { verdict: Verdict::UnknownEffect, names: named, failed: Vec::new() }
    } else if failed.is_empty() && !facts.bounded {
        say(Verdict::Explained, true)
    } else if named && (facts.placed || (facts.closed >= RESEMBLED && !facts.bounded && !facts.other_noise)) {
        say(Verdict::PartlyExplained, true)
    } else {
        say(Verdict::UnknownEffect, named && !facts.bounded)
    }
}

impl Facts {
    /// Of a finished search.
    pub(crate) fn of(search: &Search<'_>, found: &Found) -> Self {
        let moves = found.set.iter().any(|n| crate::diagnose::expect::model::moves(candidate_of(n)));
        let (before, after, floor) = (found.before.mean(), found.after.mean(), found.after.floor());
        Self {
            any: !found.set.is_empty(),
            other_noise: !failed_of_noise(found).is_empty(),
            failed: failed(search, found),
            closed: crate::diagnose::judge::closed_fraction(before, after, floor),
            solved: found.residue.solved,
            placed: search.forward.static_camera && moves && found.residue.placed >= PLACED,
            bounded: !found.at_an_end().is_empty(),
            elsewhere: found.residue.shows_another_scene(),
            within: found.after.estimate().interval()[1] <= found.after.bound(),
            like_values: match found.residue.by_value {
                ByValue::Most => true,
                ByValue::NotMost => false,
                ByValue::Untold => !found.set.is_empty() && found.set.iter().all(|n| room::is_of_surfaces(n)),
            },
        }
    }
}

/// Checks of what the model leaves: each asks for more than chance and the discrepancy can make.
fn failed(search: &Search<'_>, found: &Found) -> Vec<&'static str> {
    let left = &found.residue;
    let mut failed = found.after.beyond_bounds();
    // A few places that are far off are noise to each family, and may be clear of it all together.
    if found.set.is_empty() && failed.is_empty() && found.after.is_beyond_bound() {
        failed.push("a few places");
    }
    if left.smear.is_clear() {
        failed.push("slopes along the motion");
    }
    if are_far_off(left.outliers, &found.fit.theta) {
        failed.push("single values far off");
    }
    failed.extend(failed_of_noise(found));
    tracing::info!("checks that failed: {failed:?} of {} candidates' set {:?}", search.tests(), found.set);
    failed
}

/// Whether so many single values (share, see [`crate::diagnose::judge::outliers`]) lie far from what `theta` simulates
/// that something is missing.
pub(crate) fn are_far_off(outliers: f64, theta: &Theta) -> bool {
    outliers > MOST_OUTLIERS + 0.2 * theta.get(P::Hot)
}

/// Checks of the noise that the model does not pass.
fn failed_of_noise(found: &Found) -> Vec<&'static str> {
    let kinds = ["the spread of single values", "noise of rows", "a fixed pattern"];
    let beyond = |(z, words): (&f64, &'static str)| (*z > quantile(kinds.len())).then_some(words);
    found.residue.noise.iter().zip(kinds).filter_map(beyond).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facts() -> Facts {
        let (closed, solved) = (1.0, 1.0);
        Facts {
            any: true,
            failed: Vec::new(),
            other_noise: false,
            closed,
            solved,
            placed: false,
            bounded: false,
            elsewhere: false,
            within: true,
            like_values: false,
        }
    }

    #[test]
    fn a_set_explains_if_nothing_is_left_and_not_otherwise() {
        assert_eq!(decide(&facts()).verdict, Verdict::Explained);
        let left = |closed: f64| decide(&Facts { failed: vec!["rows"], closed, ..facts() });
        assert_eq!(left(0.99).verdict, Verdict::PartlyExplained);
        assert_eq!(left(0.93).verdict, Verdict::UnknownEffect);
        assert!(
            left(0.93).names
                && !decide(&Facts { solved: 0.0, ..Facts { failed: vec!["rows"], closed: 0.5, ..facts() } })
                    .names
        );
        let noisy = Facts { other_noise: true, failed: vec!["a fixed pattern"], ..facts() };
        assert_eq!(
            decide(&noisy).verdict,
            Verdict::UnknownEffect,
            "another noise closes all of a gap as well"
        );
        let board = decide(&Facts { placed: true, ..noisy });
        assert_eq!(board.verdict, Verdict::PartlyExplained, "what lies in its place is no noise");
        assert_eq!(decide(&Facts { bounded: true, ..facts() }).verdict, Verdict::UnknownEffect);
        let surfaces = decide(&Facts { like_values: true, ..facts() });
        assert!(surfaces.verdict == Verdict::UnknownEffect && surfaces.names, "{surfaces:?}");
    }

    #[test]
    fn nothing_named_is_no_gap_only_if_every_check_passes() {
        let empty = |failed: Vec<&'static str>| decide(&Facts { any: false, failed, closed: 0.0, ..facts() });
        assert_eq!(empty(Vec::new()).verdict, Verdict::NoGap);
        assert_eq!(empty(vec!["pixels"]).verdict, Verdict::UnknownEffect);
        let unclear = Facts { any: false, within: false, closed: 0.0, ..facts() };
        assert_eq!(decide(&unclear).verdict, Verdict::Undetermined, "not known to be within the margin");
        assert_eq!(decide(&Facts { elsewhere: true, ..facts() }).verdict, Verdict::UnknownEffect);
    }
}
