//! The parameters of all candidates as one flat vector, so that a fit needs to know no effect.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::report::Parameter;
use crate::camera::ScanOrder;
use crate::chain::{Effect, Fit, Held, ParamKind, ParamSpec, Settings, Stage, Value};
use crate::effects;

/// A number of the flat vector: a parameter, or a component of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ParameterSpec {
    /// Stem of the effect.
    pub effect: &'static str,
    /// Name of the parameter.
    pub name: &'static str,
    /// Which component of a vector; else 0.
    pub component: usize,
    /// Unit in words.
    pub unit: &'static str,
    /// What is held while the effect is off.
    pub neutral: f64,
    /// Step of numeric derivatives.
    pub step: f64,
    /// Allowed range of what is held.
    pub range: [f64; 2],
    /// What the parameter's own line says.
    pub fit: Fit,
    /// What values the parameter takes.
    pub kind: ParamKind,
}

/// How many numbers of the vector a parameter takes.
const fn components(spec: &ParamSpec) -> usize {
    match (spec.fit, spec.kind) {
        (None | Some(Fit { held: Held::Aside, .. }), _) => 0,
        (Some(_), ParamKind::Vector3 { .. }) => 3,
        (Some(_), _) => 1,
    }
}

const fn described(effect: &'static str, spec: &ParamSpec, fit: Fit, component: usize) -> ParameterSpec {
    let (all, neutral) = match spec.kind {
        ParamKind::Number { min, max, neutral } | ParamKind::Integer { min, max, neutral } => {
            ([min, max], neutral)
        }
        ParamKind::Choice { options, .. } => ([0.0, options.len() as f64 - 1.0], 0.0),
        ParamKind::Vector3 { max } => ([-max, max], 0.0),
    };
    let range = match fit.range {
        Some(range) => range,
        None => all,
    };
    let neutral = match fit.rest {
        Some(rest) => rest,
        None => neutral,
    };
    let (name, unit, kind, step) = (spec.name, spec.unit, spec.kind, fit.step[component]);
    ParameterSpec { effect, name, component, unit, neutral, step, range, fit, kind }
}

const COUNT: usize = {
    let (mut count, mut effect) = (0, 0);
    while effect < effects::PARAMETERS.len() {
        let specs = effects::PARAMETERS[effect].1;
        let mut i = 0;
        while i < specs.len() {
            count += components(&specs[i]);
            i += 1;
        }
        effect += 1;
    }
    count
};

/// What stands at each place of the vector: every parameter of the list of effects that has a `fit` line, in the list's order.
pub(super) const PARAMETERS: &[ParameterSpec; COUNT] = &{
    let nothing = described("", &ParamSpec::number("", "", (0.0, 0.0), 0.0, ""), Fit::by(0.0), 0);
    let (mut all, mut count, mut effect) = ([nothing; COUNT], 0, 0);
    while effect < effects::PARAMETERS.len() {
        let (stem, specs) = effects::PARAMETERS[effect];
        let mut i = 0;
        while i < specs.len() {
            let mut component = 0;
            while component < components(&specs[i]) {
                if let Some(fit) = specs[i].fit {
                    all[count] = described(stem, &specs[i], fit, component);
                }
                count += 1;
                component += 1;
            }
            i += 1;
        }
        effect += 1;
    }
    all
};

const fn same(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    let mut i = 0;
    while i < a.len() && i < b.len() && a[i] == b[i] {
        i += 1;
    }
    a.len() == b.len() && i == a.len()
}

/// The place of a parameter; compiling fails where there is none.
const fn place(effect: &str, name: &str, component: usize) -> P {
    let mut i = 0;
    while i < COUNT {
        let p = &PARAMETERS[i];
        if same(p.effect, effect) && same(p.name, name) && p.component == component {
            return P(i as u16);
        }
        i += 1;
    }
    panic!("no such parameter has a fit line")
}

/// A place in the vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub(super) struct P(u16);

/// All places.
static PLACES: [P; COUNT] = {
    let (mut all, mut i) = ([P(0); COUNT], 0);
    while i < COUNT {
        all[i] = P(i as u16);
        i += 1;
    }
    all
};

/// Places that are asked for by name.
#[allow(non_upper_case_globals)]
impl P {
    pub(super) const Offset: P = place("time_offset", "offset_s", 0);
    pub(super) const Readout: P = place("rolling_shutter", "readout_time_s", 0);
    pub(super) const Exposure: P = place("motion_blur", "exposure_time_s", 0);
    pub(super) const RotX: P = place("pose_offset", "rotvec_rad", 0);
    pub(super) const RotY: P = place("pose_offset", "rotvec_rad", 1);
    pub(super) const RotZ: P = place("pose_offset", "rotvec_rad", 2);
    pub(super) const Focal: P = place("focal_length_error", "ratio", 0);
    pub(super) const K1: P = place("lens_distortion", "k1", 0);
    pub(super) const K2: P = place("lens_distortion", "k2", 0);
    pub(super) const P1: P = place("lens_distortion", "p1", 0);
    pub(super) const P2: P = place("lens_distortion", "p2", 0);
    pub(super) const K3: P = place("lens_distortion", "k3", 0);
    pub(super) const ScaleR: P = place("chromatic_aberration", "scale_r", 0);
    pub(super) const ScaleB: P = place("chromatic_aberration", "scale_b", 0);
    pub(super) const Defocus: P = place("defocus", "sigma_px", 0);
    pub(super) const A1: P = place("vignetting", "a1", 0);
    pub(super) const A2: P = place("vignetting", "a2", 0);
    pub(super) const Veil: P = place("glare", "veil", 0);
    pub(super) const Level: P = place("glare", "level", 0);
    pub(super) const Gain: P = place("exposure_gain", "gain", 0);
    pub(super) const FlickerF: P = place("flicker", "frequency_hz", 0);
    pub(super) const FlickerC: P = place("flicker", "depth", 0);
    pub(super) const FlickerS: P = place("flicker", "phase_rad", 0);
    pub(super) const Black: P = place("black_level", "offset", 0);
    pub(super) const WbR: P = place("white_balance", "r", 0);
    pub(super) const WbB: P = place("white_balance", "b", 0);
    pub(super) const Gamma: P = place("gamma", "exponent", 0);
    pub(super) const Sharpen: P = place("sharpening", "amount", 0);
    pub(super) const Radius: P = place("sharpening", "radius_px", 0);
    pub(super) const Shot: P = place("shot_noise", "full_well_e", 0);
    pub(super) const Read: P = place("read_noise", "sigma", 0);
    pub(super) const Row: P = place("row_noise", "sigma", 0);
    pub(super) const Dsnu: P = place("fixed_pattern_noise", "dsnu", 0);
    pub(super) const Prnu: P = place("fixed_pattern_noise", "prnu", 0);
    pub(super) const Hot: P = place("hot_pixels", "fraction", 0);
    pub(super) const Quality: P = place("jpeg", "quality", 0);
    pub(super) const Chroma: P = place("chroma_subsampling", "scheme", 0);
    pub(super) const Mosaic: P = place("bayer_mosaic", "pattern", 0);
}

/// A candidate cause.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CandidateSpec {
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

/// All effects that have parameters to fit, in light-path order; set-up errors last.
pub(super) static CANDIDATES: LazyLock<Vec<CandidateSpec>> = LazyLock::new(|| {
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
        noise: effect.is_noise(),
    })
}

/// The candidate of that name.
///
/// # Panics
/// If there is none.
pub(super) fn candidate_of(name: &str) -> &'static CandidateSpec {
    CANDIDATES.iter().find(|c| c.name == name).expect("names come from the list")
}

impl P {
    pub(super) fn spec(self) -> &'static ParameterSpec {
        &PARAMETERS[usize::from(self.0)]
    }

    /// Where its effect acts.
    fn stage(self) -> Stage {
        effects::by_id(self.spec().effect).expect("from the list").stage()
    }

    /// Whether its values are tried one by one: it has no derivative.
    pub(super) fn is_discrete(self) -> bool {
        matches!(self.spec().kind, ParamKind::Choice { .. } | ParamKind::Integer { .. })
    }

    /// Whether a new render is needed when it changes.
    pub(super) fn is_time(self) -> bool {
        self.spec().unit == "s" && !matches!(self.stage(), Stage::Pixel(..))
    }

    /// Whether it moves pixels without a new render.
    pub(super) fn is_remap(self) -> bool {
        !self.is_time() && matches!(self.stage(), Stage::SetUp | Stage::Geometry)
    }
}

/// A point in the space of all parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Theta {
    values: Vec<f64>,
    /// Which line is read first.
    pub scan_order: ScanOrder,
}

impl Theta {
    /// Everything neutral.
    pub(super) fn neutral() -> Self {
        Self { values: PARAMETERS.iter().map(|p| p.neutral).collect(), scan_order: ScanOrder::TopToBottom }
    }

    pub(super) fn get(&self, p: P) -> f64 {
        self.values[usize::from(p.0)]
    }

    /// Sets a value, kept inside its range.
    pub(super) fn set(&mut self, p: P, value: f64) {
        let [lo, hi] = p.spec().range;
        self.values[usize::from(p.0)] = value.clamp(lo, hi);
    }

    /// The same with one value changed.
    pub(super) fn with(&self, p: P, value: f64) -> Self {
        let mut changed = self.clone();
        changed.set(p, value);
        changed
    }

    /// Whether a parameter differs from neutral.
    pub(super) fn is_on(&self, p: P) -> bool {
        self.get(p) != p.spec().neutral
    }

    /// The same with an effect taken out.
    pub(super) fn without(&self, candidate: &CandidateSpec) -> Self {
        let mut changed = self.clone();
        for &p in candidate.parameters.iter().chain(candidate.more) {
            changed.values[usize::from(p.0)] = p.spec().neutral;
        }
        changed
    }

    /// The value of a parameter whose first place is `p`.
    pub(super) fn value(&self, p: P) -> Value {
        let (at, held) = (p.spec(), self.get(p));
        let next = || self.get(P(p.0 + 1));
        Value::Number(match (at.fit.held, at.kind) {
            (_, ParamKind::Choice { options, .. }) => return Value::Choice(options[held as usize]),
            (_, ParamKind::Vector3 { .. }) => {
                return Value::Vector3([0, 1, 2].map(|i| self.get(P(p.0 + i))));
            }
            (Held::Inverse, _) => 1.0 / held.max(1e-9),
            (Held::Cosine, _) => held.hypot(next()).min(1.0),
            (Held::Sine, _) => held.atan2(self.get(P(p.0 - 1))),
            _ => held,
        })
    }

    /// Takes over the value of a parameter whose first place is `p`; `settings` has its effect.
    pub(super) fn take(&mut self, p: P, settings: &Settings) {
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
    pub(super) fn report(
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

fn word(name: &str) -> Parameter {
    Parameter { value: json!(name), ci95: None, unit: String::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a hand-written second list would break: every fitted number is a parameter of the list of effects, in its range.
    #[test]
    fn candidates_are_the_effects_that_have_a_fit_line_and_nothing_is_stated_twice() {
        for effect in effects::LIST {
            let fitted = effect.specs().iter().any(|s| components(s) > 0);
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
            super::super::settings::apply(&mut settings, &theta, &[candidate.name]).expect("in range");
            let back = super::super::settings::theta_of(&settings);
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
