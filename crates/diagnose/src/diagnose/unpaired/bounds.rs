//! How strong an effect would have to be for the marks of these folders to show it: what is not found below that is not
//! denied.

use std::collections::BTreeMap;

use super::clock::Clock;
use super::fingerprint::{Fingerprint, Known, apart, squares};
use super::marks::EDGES;
use super::simulated::{EDGES_TELL, NAMES, Simulated, parameters};
use crate::diagnose::expect::model::{P, Theta, candidate_of};
use crate::diagnose::judge::quantile_of_length;
use shutterbug::chain::{Law, Value};

/// How many times a strength is doubled before it is given up.
const DOUBLINGS: i32 = 3;

/// From which strength on an effect would show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ShowsFrom {
    /// Where an attentive person begins to see it.
    Visible,
    /// That value of its first parameter.
    Value(P, f64),
    /// Not at any strength that was tried.
    Nowhere,
}

/// The same for all candidates among `names` that were not found and that there is time for, with what was found on;
/// `made` are the marks then.
pub(super) fn shows_from(
    (real, (simulated, made), clock): (&Fingerprint, (&Simulated, &Fingerprint), &Clock),
    theta: &Theta,
    counted: &[bool],
    names: &[&'static str],
) -> BTreeMap<&'static str, ShowsFrom> {
    let without = known_as(real, made);
    let shows = |name: &'static str, with: &Theta| {
        let off = apart(&known_as(real, &simulated.fingerprint(with)), &without);
        let fewest = candidate_of(name).size();
        let all = squares(&off, counted) > quantile_of_length(NAMES.len(), fewest).powi(2);
        let edges: f64 = EDGES.iter().filter_map(|k| off[*k]).map(|z| z * z).sum();
        all && (!EDGES_TELL.contains(&name) || edges > quantile_of_length(EDGES_TELL.len(), 1).powi(2))
    };
    let one = |&name: &&'static str| {
        if clock.is_late_for(DOUBLINGS as usize + 1) {
            return None;
        }
        let steps = (0..=DOUBLINGS).map(|k| f64::from(2_i32.pow(k as u32)));
        let value = steps.map(|times| at_strength(name, theta, times)).position(|with| shows(name, &with));
        let first = parameters(&[name])[0];
        let from = match value {
            Some(0) => ShowsFrom::Visible,
            Some(k) => match at_strength(name, theta, f64::from(1 << k)).value(first) {
                Value::Number(value) => ShowsFrom::Value(first, value),
                _ => ShowsFrom::Nowhere,
            },
            None => ShowsFrom::Nowhere,
        };
        Some((name, from))
    };
    names.iter().filter_map(one).collect()
}

/// Marks known as well as those of the real frames.
fn known_as(real: &Fingerprint, made: &Fingerprint) -> Fingerprint {
    let one =
        |(made, real): (&Option<Known>, &Option<Known>)| Some(Known { error: (*real)?.error, ..(*made)? });
    Fingerprint(made.0.iter().zip(&real.0).map(one).collect())
}

/// `theta` with an effect so many times as strong as an attentive person may see it.
fn at_strength(name: &'static str, theta: &Theta, times: f64) -> Theta {
    let mut with = theta.clone();
    let mut before = 0.0;
    for &p in candidate_of(name).parameters {
        let (spec, Some(trial)) = (p.spec(), p.spec().fit.trial) else { continue };
        let strength = times * trial.blind[0];
        let value = match trial.law {
            Law::Electrons => strength * strength,
            Law::Option => f64::from(strength >= 0.0),
            Law::Even => spec.neutral.max(trial.blind[0]),
            Law::Follows => spec.neutral - before,
            _ => spec.neutral + strength,
        };
        before = value - spec.neutral;
        with.set(p, value.clamp(spec.range[0], spec.range[1]));
    }
    with
}
