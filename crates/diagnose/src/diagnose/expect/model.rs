//! The parameters of all candidates as one flat vector, so that a fit needs to know no effect.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::room::{NAMES, Room};
pub(crate) use super::vector::P;
use super::vector::{PARAMETERS, PLACES};
use crate::diagnose::report::Parameter;
use shutterbug::camera::ScanOrder;
use shutterbug::chain::{Effect, Fit, Held, Moments, ParamKind, Settings, Stage, Value};
use shutterbug::effects;

/// A candidate cause.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CandidateSpec {
    /// Stem of the effect.
    pub name: &'static str,
    /// Its parameters that every fit frees.
    pub parameters: &'static [P],
    /// Those that are freed at the end, if that helps.
    pub more: &'static [P],
    /// Needs motion to be seen.
    pub needs_motion: bool,
    /// Changes the spread of values, not their mean.
    pub noise: bool,
}

impl CandidateSpec {
    /// How many numbers it has, to tell which of two is simpler. Choices of one effect say of what kind it is: together
    /// they count as one.
    pub(crate) fn size(&self) -> usize {
        let (choices, numbers): (Vec<P>, Vec<P>) = self.parameters.iter().partition(|p| p.is_discrete());
        numbers.len() + usize::from(!choices.is_empty())
    }
}

/// All effects that have parameters to fit, in light-path order; set-up errors last.
pub(crate) static CANDIDATES: LazyLock<Vec<CandidateSpec>> = LazyLock::new(|| {
    let is_setup = |e: &&&dyn Effect| e.stage() == Stage::SetUp;
    let camera = effects::LIST.iter().filter(|e| !is_setup(e));
    camera.chain(effects::LIST.iter().filter(is_setup)).filter_map(|e| candidate(*e)).collect()
});

fn candidate(effect: &dyn Effect) -> Option<CandidateSpec> {
    let of = |p: &&P| p.spec().effect == effect.id();
    let first = PLACES.iter().position(|p| of(&p))?;
    let all = &PLACES[first..first + PLACES.iter().filter(of).count()];
    let (parameters, more) = all.split_at(all.iter().filter(|p| !p.spec().fit.last).count());
    Some(CandidateSpec {
        name: effect.id(),
        parameters,
        more,
        needs_motion: all.iter().any(|p| p.is_time()),
        noise: effect.moments().is_noise(),
    })
}

/// What may be wrong with the description: no number that a fit would free.
pub(crate) static OF_DESCRIPTION: [CandidateSpec; 2] = [spec(NAMES[0]), spec(NAMES[1])];

const fn spec(name: &'static str) -> CandidateSpec {
    CandidateSpec { name, parameters: &[], more: &[], needs_motion: false, noise: false }
}

/// The candidate of that name.
///
/// # Panics
/// If there is none.
pub(crate) fn candidate_of(name: &str) -> &'static CandidateSpec {
    let all = CANDIDATES.iter().chain(&OF_DESCRIPTION);
    all.into_iter().find(|c| c.name == name).expect("names come from the list")
}

/// Names of all candidates.
pub(crate) fn all_names() -> Vec<&'static str> {
    CANDIDATES.iter().map(|c| c.name).filter(|n| effects::by_id(n).is_some()).collect()
}

/// Whether all that a candidate has are choices and whole numbers.
pub(crate) fn is_discrete(candidate: &CandidateSpec) -> bool {
    !candidate.parameters.is_empty() && candidate.parameters.iter().all(|p| p.is_discrete())
}

/// Whether a candidate changes where things are seen.
pub(crate) fn moves(candidate: &CandidateSpec) -> bool {
    candidate.parameters.iter().any(|p| p.is_time() || p.is_remap())
}

/// Whether a candidate mixes neighbouring pixels behind the noise: it changes the spread, and how much noise there must
/// be to make the spread that is seen.
pub(crate) fn mixes_pixels(name: &str) -> bool {
    let moments = effects::by_id(name).map(|e| e.moments());
    moments.is_some_and(|m| m.mixes() || matches!(m, Moments::File(_)))
}

/// A point in the space of all parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Theta {
    #[serde(deserialize_with = "in_their_ranges")]
    values: Vec<f64>,
    /// Which line is read first.
    #[serde(with = "order_by_name")]
    pub scan_order: ScanOrder,
    /// What of the description is taken to be wrong.
    pub room: Room,
}

/// Numbers of a file: one for each parameter, in its range, or they are not what this program wrote.
fn in_their_ranges<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
    let values: Vec<f64> = Vec::deserialize(from)?;
    let belongs = |(p, v): (&P, &f64)| {
        let [lo, hi] = p.spec().range;
        (lo..=hi).contains(v) || *v == p.spec().neutral
    };
    if values.len() == PARAMETERS.len() && PLACES.iter().zip(&values).all(belongs) {
        return Ok(values);
    }
    Err(serde::de::Error::custom(format!("found {values:?}; expected {} numbers in range", PARAMETERS.len())))
}

impl Theta {
    /// Everything neutral.
    pub(crate) fn neutral() -> Self {
        let values = PARAMETERS.iter().map(|p| p.neutral).collect();
        Self { values, scan_order: ScanOrder::TopToBottom, room: Room::default() }
    }

    /// All that it holds, to look up by.
    pub(crate) fn bits(&self) -> Vec<u64> {
        let order = ScanOrder::ALL.iter().position(|o| *o == self.scan_order).unwrap_or(0);
        let room = self.room.poses.iter().flatten().map(|v| v.to_bits());
        let values = self.values.iter().map(|v| v.to_bits()).chain([order as u64]);
        values.chain([u64::from(self.room.radiance)]).chain(room).collect()
    }

    pub(crate) fn get(&self, p: P) -> f64 {
        self.values[usize::from(p.0)]
    }

    /// Sets a value, kept inside its range.
    pub(crate) fn set(&mut self, p: P, value: f64) {
        let [lo, hi] = p.spec().range;
        self.values[usize::from(p.0)] = value.clamp(lo, hi);
    }

    /// The same with one value changed.
    pub(crate) fn with(&self, p: P, value: f64) -> Self {
        let mut changed = self.clone();
        changed.set(p, value);
        changed
    }

    /// Whether a parameter differs from neutral.
    pub(crate) fn is_on(&self, p: P) -> bool {
        self.get(p) != p.spec().neutral
    }

    /// Quality of the file that the frames come from, if it loses anything.
    pub(crate) fn file(&self) -> Option<u8> {
        self.is_on(P::Quality).then(|| self.get(P::Quality) as u8)
    }

    /// The parameters in which two points differ.
    pub(crate) fn differing<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = P> + 'a {
        PLACES.iter().copied().filter(|&p| self.get(p) != other.get(p))
    }

    /// The same with an effect taken out.
    pub(crate) fn without(&self, candidate: &CandidateSpec) -> Self {
        let mut changed = self.clone();
        for &p in candidate.parameters.iter().chain(candidate.more) {
            changed.values[usize::from(p.0)] = p.spec().neutral;
        }
        changed
    }

    /// The value of a parameter whose first place is `p`.
    pub(crate) fn value(&self, p: P) -> Value {
        let (at, held) = (p.spec(), self.get(p));
        let next = || self.get(P(p.0 + 1));
        let number = match (at.fit.held, at.kind) {
            (_, ParamKind::Choice { options, .. }) => return Value::Choice(options[held as usize]),
            (_, ParamKind::Vector3 { .. }) => {
                return Value::Vector3([0, 1, 2].map(|i| self.get(P(p.0 + i))));
            }
            (Held::Inverse, _) => 1.0 / held.max(1e-9),
            (Held::Cosine, _) => held.hypot(next()),
            (Held::Sine, _) => held.atan2(self.get(P(p.0 - 1))),
            _ => held,
        };
        match at.kind {
            ParamKind::Number { min, max, .. } => Value::Number(number.clamp(min, max)),
            _ => Value::Number(number),
        }
    }

    /// Takes over the value of a parameter whose first place is `p`; `settings` has its effect.
    pub(crate) fn take(&mut self, p: P, settings: &Settings) {
        let at = p.spec();
        let number = |name: &str| settings.number(at.effect, name, 0.0);
        match (settings.get(at.effect, at.name), at.fit.held) {
            (Some(Value::Vector3(v)), _) => (0..3).for_each(|i| self.set(P(p.0 + i), v[usize::from(i)])),
            (Some(Value::Choice(name)), _) => {
                let ParamKind::Choice { options, .. } = at.kind else { return };
                self.set(p, options.iter().position(|o| *o == name).unwrap_or(0) as f64);
            }
            (Some(Value::Number(v)), Held::Inverse) => self.set(p, if v > 0.0 { 1.0 / v } else { 0.0 }),
            (Some(Value::Number(v)), Held::Cosine) => {
                self.set(p, v * number(P(p.0 + 1).spec().name).cos());
            }
            (Some(Value::Number(v)), Held::Sine) => {
                self.set(p, number(P(p.0 - 1).spec().name) * v.sin());
            }
            (Some(Value::Number(v)), _) => self.set(p, v),
            (None, _) => {}
        }
    }

    /// The parameters of an effect as the report has them. `half` gives the half widths of 95 % intervals.
    pub(crate) fn report(
        &self,
        candidate: &CandidateSpec,
        half: &BTreeMap<P, f64>,
    ) -> BTreeMap<String, Parameter> {
        let more = candidate.more.iter().filter(|&&p| self.is_on(p));
        let numbers = candidate.parameters.iter().chain(more).filter(|p| p.spec().component == 0);
        let mut out: BTreeMap<String, Parameter> =
            numbers.map(|&p| (p.spec().name.to_owned(), self.reported(p, half))).collect();
        // Choices beside the numbers, and those that go with a fitted one.
        let specs = effects::by_id(candidate.name).expect("from the list").specs();
        let chosen = candidate.parameters.iter().any(|p| matches!(p.spec().kind, ParamKind::Choice { .. }));
        for spec in specs {
            let ParamKind::Choice { neutral, .. } = spec.kind else { continue };
            match spec.fit {
                Some(Fit { held: Held::Aside, .. }) => {
                    drop(out.insert(spec.name.to_owned(), word(self.scan_order.name())))
                }
                None if chosen => drop(out.insert(spec.name.to_owned(), word(neutral))),
                _ => {}
            }
        }
        out
    }

    fn reported(&self, p: P, half: &BTreeMap<P, f64>) -> Parameter {
        let (at, held) = (p.spec(), self.get(p));
        let width = |p: P| half.get(&p).copied();
        let around = |p: P| width(p).map(|h| json!([self.get(p) - h, self.get(p) + h]));
        let (value, ci95) = match self.value(p) {
            Value::Choice(name) => return word(name),
            Value::Vector3(v) => {
                let ci: Option<Vec<_>> = (0..3).map(|i| around(P(p.0 + i))).collect();
                (json!(v), ci.map(|ci| json!(ci)))
            }
            Value::Number(v) => {
                let ci = match at.fit.held {
                    Held::Inverse => width(p).map(|h| json!([1.0 / (held + h), 1.0 / (held - h).max(1e-7)])),
                    Held::Cosine => width(p).map(|h| json!([(v - h).max(0.0), v + h])),
                    Held::Sine => {
                        let depth = held.hypot(self.get(P(p.0 - 1))).max(1e-9);
                        width(p).map(|h| json!([v - h / depth, v + h / depth]))
                    }
                    Held::Itself | Held::Aside => around(p),
                };
                (json!(v), ci)
            }
        };
        // An interval about one of many aliases would say more than is known.
        let known = !at.fit.by_lines || self.is_on(P::Readout);
        Parameter { value, ci95: ci95.filter(|_| known), unit: at.unit.to_owned() }
    }
}

/// `theta` with every combination of these choices.
pub(crate) fn combinations(choices: &[P], theta: &Theta) -> Vec<Theta> {
    choices.iter().fold(vec![theta.clone()], |all, &p| {
        let options = 0..=p.spec().range[1] as usize;
        let with = |theta: &Theta| options.clone().map(|o| theta.with(p, o as f64)).collect::<Vec<_>>();
        all.iter().flat_map(with).collect()
    })
}

/// Continuous parameters of a set that change the mean.
pub(crate) fn free(set: &[&'static str]) -> Vec<P> {
    let fitted = set.iter().map(|n| candidate_of(n)).filter(|c| !c.noise);
    fitted.flat_map(|c| c.parameters.iter().copied()).filter(|p| !p.is_discrete()).collect()
}

fn word(name: &str) -> Parameter {
    Parameter { value: json!(name), ci95: None, unit: String::new() }
}

/// [`ScanOrder`] in files: by its name in `camera.toml`.
mod order_by_name {
    use serde::{Deserialize as _, Deserializer, Serializer, de::Error as _};
    use shutterbug::camera::ScanOrder;

    pub(crate) fn serialize<S: Serializer>(order: &ScanOrder, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(order.name())
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<ScanOrder, D::Error> {
        let name = String::deserialize(from)?;
        ScanOrder::from_name(&name).ok_or_else(|| D::Error::custom(format!("`{name}` is no scan order")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::expect::vector::components;

    /// What a hand-written second list would break: every fitted number is a parameter of the list of effects, in its
    /// range.
    #[test]
    fn candidates_are_the_effects_that_have_a_fit_line_and_nothing_is_stated_twice() {
        for effect in effects::LIST {
            let fitted = effect.specs().iter().any(|s| components(s) > 0);
            assert_eq!(
                fitted,
                effect.undiagnosed().is_none(),
                "{} says neither how nor why not",
                effect.id()
            );
            assert_eq!(fitted, CANDIDATES.iter().any(|c| c.name == effect.id()), "{}", effect.id());
        }
        for (i, at) in PARAMETERS.iter().enumerate() {
            let effect = effects::by_id(at.effect).expect("an effect");
            let spec = effect.specs().iter().find(|s| s.name == at.name).expect("its parameter");
            assert_eq!((spec.unit, Some(at.fit)), (at.unit, spec.fit), "{}.{}", at.effect, at.name);
            let (lo, hi) = (at.range[0], at.range[1]);
            assert!(lo <= at.neutral && at.neutral <= hi && at.step > 0.0, "{at:?}");
            if let (Held::Itself, ParamKind::Number { min, max, .. }) = (at.fit.held, at.kind) {
                assert!(min <= lo && hi <= max, "{at:?} looks where the effect has no values");
            }
            let all = CANDIDATES
                .iter()
                .filter(|c| c.parameters.contains(&P(i as u16)) || c.more.contains(&P(i as u16)));
            assert_eq!(all.count(), 1, "{at:?}");
        }
    }

    #[test]
    fn values_go_to_settings_and_back() {
        for candidate in CANDIDATES.iter() {
            let mut theta = Theta::neutral();
            for &p in candidate.parameters.iter().chain(candidate.more) {
                let [lo, hi] = p.spec().range;
                let whole = matches!(p.spec().kind, ParamKind::Choice { .. } | ParamKind::Integer { .. });
                theta.set(
                    p,
                    if whole {
                        hi.min(2.0)
                    } else {
                        p.spec().neutral
                            + 0.1 * (hi - p.spec().neutral).min(1.0)
                            + 0.01 * lo.signum().max(0.0)
                    },
                );
            }
            let mut settings = Settings::default();
            crate::diagnose::expect::settings::apply(&mut settings, &theta, &[candidate.name])
                .expect("in range");
            let back = crate::diagnose::expect::settings::theta_of(&settings);
            for &p in candidate.parameters.iter().chain(candidate.more) {
                assert!(
                    (back.get(p) - theta.get(p)).abs() < 1e-9,
                    "{:?}: {} {}",
                    p.spec(),
                    back.get(p),
                    theta.get(p)
                );
                assert!(theta.is_on(p), "control: {:?} is neutral", p.spec());
            }
        }
    }
}
