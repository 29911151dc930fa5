//! Which effects a case hides, and how strong they are.

use super::draw::Draw;
use shutterbug::camera::{Intrinsics, Lens};
use shutterbug::chain::{Effect, Law, ParamKind, ParamSpec, Settings, Trial, Value, neutral};
use shutterbug::effects::{self, FocalLengthError, LensDistortion};
use shutterbug::error::Result;

/// What a case asks of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Nothing is hidden: anything named is a false alarm.
    None,
    /// One effect.
    Single,
    /// Two to five.
    Several,
    /// One effect, taken out of the candidates: right is `unknown_effect`.
    LeftOut,
}

/// Of every twenty cases: two with nothing, three left out, six with several, nine with one.
const PATTERN: [Kind; 20] = {
    use Kind::{LeftOut, None, Several, Single};
    [
        Single, Several, Single, None, Single, LeftOut, Several, Single, Single, Several, LeftOut, Single,
        Several, None, Single, Several, Single, LeftOut, Several, Single,
    ]
};

/// Strengths are not drawn more often than that; what does not fit then is an error where it is rendered.
const MOST_DRAWS: usize = 100;

/// How many effects a set has: one in three has four or five.
const SET_SIZES: [usize; 9] = [2, 2, 2, 3, 3, 3, 4, 4, 5];

/// What a case hides.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Hidden {
    pub(super) kind: Kind,
    /// In light-path order.
    pub(super) names: Vec<&'static str>,
    /// The true camera's effects: those that the capture's camera.toml has, and the hidden ones.
    pub(super) settings: Settings,
}

/// Effects that a diagnosis can name and the CPU chain can make, in light-path order.
pub(super) fn available(candidates: &[&str]) -> Vec<&'static str> {
    let ids = effects::LIST.iter().map(|e| e.id());
    ids.filter(|id| candidates.contains(id) && effects::by_id(id).is_some_and(|e| trials(e).next().is_some()))
        .collect()
}

/// Effects that other candidates express exactly, so that no picture tells whether they were left out: glare is a gain
/// below 1 with a black level, a black level is glare of level 1, a gain below 1 is glare of level 0, and a white
/// balance is a diagonal matrix of colours. Leaving these out asks nothing.
const EXPRESSIBLE: [&str; 4] = ["glare", "exposure_gain", "black_level", "white_balance"];

/// Whether steps of `a` come to every place of a ring of `b`.
fn is_coprime(a: usize, b: usize) -> bool {
    if b == 0 { a == 1 } else { is_coprime(b, a % b) }
}

/// Whether every pixel of that camera sees something: a lens may fold inside a picture of a shorter focal length.
pub(super) fn has_rays(settings: &Settings, intrinsics: &Intrinsics) -> bool {
    let intrinsics = FocalLengthError::apply(settings, intrinsics);
    Lens::new(intrinsics, LensDistortion::distortion(settings)).is_ok()
}

/// Draws what case `case` hides. `known` are the effects that its camera.toml models. Strengths are drawn anew until
/// they fit.
///
/// # Errors
/// None in practice: all strengths lie within their effects' ranges (tested).
pub(super) fn draw(
    seed: u64,
    case: usize,
    available: &[&'static str],
    known: &Settings,
    fits: &dyn Fn(&Settings) -> bool,
) -> Result<Hidden> {
    let mut draw = Draw::new(seed, case, "hidden");
    let mut free: Vec<_> = available.iter().copied().filter(|n| !known.has(n)).collect();
    let kind = if free.is_empty() { Kind::None } else { PATTERN[case % PATTERN.len()] };
    if kind == Kind::LeftOut {
        free.retain(|n| !EXPRESSIBLE.contains(n));
    }
    let count = match kind {
        Kind::None => 0,
        Kind::Single | Kind::LeftOut => 1,
        Kind::Several => SET_SIZES[draw.index(SET_SIZES.len())].min(free.len()),
    };
    let mut chosen: Vec<usize> = Vec::new();
    if count > 0 {
        // The first goes round the list, so that every effect comes up equally often.
        let turn = PATTERN.iter().cycle().take(case).filter(|k| **k == kind).count();
        let stride = (7..).find(|&s| is_coprime(s, free.len())).expect("primes do not end");
        chosen.push((turn * stride + (seed % 1000) as usize + kind as usize) % free.len());
    }
    while chosen.len() < count {
        let next = draw.index(free.len());
        if !chosen.contains(&next) {
            chosen.push(next);
        }
    }
    chosen.sort_unstable();
    let names: Vec<_> = chosen.into_iter().map(|i| free[i]).collect();
    let mut settings = strengths(&names, known, &mut draw)?;
    for _ in 0..MOST_DRAWS {
        if fits(&settings) {
            break;
        }
        settings = strengths(&names, known, &mut draw)?;
    }
    Ok(Hidden { kind, names, settings })
}

/// The camera with these effects, of drawn strengths.
fn strengths(names: &[&'static str], known: &Settings, draw: &mut Draw) -> Result<Settings> {
    let mut settings = known.clone();
    for name in names {
        let effect = effects::by_id(name).expect("taken from the list");
        let mut drawn = 0.0;
        for (spec, trial) in trials(effect) {
            let strength = blind(trial, draw);
            drawn = put(&mut settings, effect, spec, (trial.law, strength, drawn), draw)?;
        }
    }
    Ok(settings)
}

/// Parameters of an effect that blind trials hide, in the order of its specs.
fn trials(effect: &dyn Effect) -> impl Iterator<Item = (&'static ParamSpec, Trial)> {
    effect.specs().iter().filter_map(|spec| Some((spec, spec.fit?.trial?)))
}

/// A strength of a blind trial.
fn blind(trial: Trial, draw: &mut Draw) -> f64 {
    let [from, to] = trial.blind;
    match trial.law {
        Law::Either | Law::Factor => draw.sign() * draw.log_between(from, to),
        Law::Up | Law::Down | Law::Electrons | Law::Direction => draw.log_between(from, to),
        Law::Even | Law::Coarser | Law::Option | Law::Follows => draw.between(from, to),
    }
}

/// Sets a parameter to what a strength is; returns how far that is off neutral. `before`: the same of the parameter
/// before it.
fn put(
    settings: &mut Settings,
    effect: &dyn Effect,
    spec: &ParamSpec,
    (law, strength, before): (Law, f64, f64),
    draw: &mut Draw,
) -> Result<f64> {
    let neutral = match neutral(&spec.kind) {
        Value::Number(neutral) => neutral,
        _ => 0.0,
    };
    let value = match (law, spec.kind) {
        (Law::Option, ParamKind::Choice { options, .. }) => {
            let place = (strength.max(0.0) * options.len() as f64) as usize;
            Value::Choice(options[place.min(options.len() - 1)])
        }
        (Law::Direction, _) => {
            let axis = [(); 3].map(|()| draw.between(-1.0, 1.0));
            let length = axis.iter().map(|v| v * v).sum::<f64>().sqrt().max(1e-3);
            Value::Vector3(axis.map(|v| v / length * strength))
        }
        (Law::Up | Law::Either, _) => Value::Number(neutral + strength),
        (Law::Down, _) => Value::Number(neutral - strength),
        (Law::Factor, _) => Value::Number(strength.exp()),
        (Law::Electrons, _) => Value::Number(1.0 / (strength * strength)),
        (Law::Coarser, _) => Value::Number(strength.round()),
        (Law::Follows, _) => Value::Number(neutral + strength * before),
        (Law::Even | Law::Option, _) => Value::Number(strength),
    };
    settings.set(effect, spec.name, value)?;
    Ok(if let Value::Number(v) = value { v - neutral } else { 0.0 })
}

/// How an effect is graded.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Grade {
    /// What is graded, with its unit.
    pub(super) measure: String,
    /// Weakest and strongest.
    pub(super) range: [f64; 2],
}

impl Grade {
    /// One of `points` strengths in equal ratios.
    pub(super) fn strength(&self, point: usize, points: usize) -> f64 {
        let part = point as f64 / (points.max(2) - 1) as f64;
        (self.range[0].ln() * (1.0 - part) + self.range[1].ln() * part).exp()
    }
}

/// The grades of an effect, those of its first graded parameter; nothing for effects that are on or off.
pub(super) fn grade(name: &str) -> Option<Grade> {
    let graded = trials(effects::by_id(name)?).find_map(|(spec, t)| Some((spec, t.law, t.graded?)));
    let (spec, law, range) = graded?;
    let of = match (law, neutral(&spec.kind)) {
        (Law::Either | Law::Up, Value::Number(neutral)) if neutral != 0.0 => {
            format!("|{} - {neutral}|", spec.name)
        }
        (Law::Either, _) => format!("|{}|", spec.name),
        (Law::Down, _) => format!("-{}", spec.name),
        (Law::Factor, _) => format!("|ln {}|", spec.name),
        (Law::Electrons, _) => format!("1 / sqrt({})", spec.name),
        (Law::Coarser, _) => format!("100 - {}", spec.name),
        (Law::Direction, _) => "angle, rad".to_owned(),
        _ => spec.name.to_owned(),
    };
    Some(Grade { measure: of, range })
}

/// Hides one effect at a strength (see [`grade`]); signs, directions and partners are drawn.
///
/// # Errors
/// None in practice: all strengths lie within their effects' ranges (tested).
pub(super) fn graded(seed: u64, case: usize, name: &'static str, s: f64, known: &Settings) -> Result<Hidden> {
    let mut draw = Draw::new(seed, case, name);
    let mut sign = draw.sign();
    let effect = effects::by_id(name).expect("taken from the list");
    let range = grade(name).expect("graded").range;
    let (mut settings, mut before) = (known.clone(), 0.0);
    for (spec, trial) in trials(effect) {
        // Of several, each goes through its own range in as many steps.
        let strength = match (trial.graded, trial.law) {
            (Some(own), law) => {
                let strength = s * own[0] / range[0];
                let signed =
                    if matches!(law, Law::Either | Law::Factor) { sign * strength } else { strength };
                sign = -sign;
                if law == Law::Coarser { 100.0 - signed } else { signed }
            }
            (None, Law::Follows) => 0.5 * (trial.blind[0] + trial.blind[1]),
            (None, Law::Option) => continue,
            (None, _) => blind(trial, &mut draw),
        };
        before = put(&mut settings, effect, spec, (trial.law, strength, before), &mut draw)?;
    }
    Ok(Hidden { kind: Kind::Single, names: vec![name], settings })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With the shortest focal length that a camera of these trials may have. Seed 82006, case 15, had such a lens.
    #[test]
    fn a_lens_that_folds_inside_the_picture_is_drawn_anew() {
        let intrinsics = Intrinsics { width: 320, height: 240, fx: 224.0, fy: 224.0, cx: 162.0, cy: 119.0 };
        let (mut anew, none) = (0, Settings::default());
        for case in (1..2000).step_by(20) {
            let draw = |fits: &dyn Fn(&Settings) -> bool| {
                super::draw(7, case, &["focal_length_error", "lens_distortion"], &none, fits)
                    .expect("in range")
            };
            let fits = |settings: &Settings| has_rays(settings, &intrinsics);
            let (first, hidden) = (draw(&|_| true), draw(&fits));
            assert!(fits(&hidden.settings) && hidden.names == first.names, "case {case}");
            assert!(hidden == first || !fits(&first.settings), "case {case}: what fits stays");
            anew += usize::from(hidden != first);
        }
        assert!(anew > 0, "control: none of them folded");
    }

    #[test]
    fn every_strength_is_in_range_and_not_neutral() {
        let ids: Vec<_> = effects::LIST.iter().map(|e| e.id()).collect();
        let available = available(&ids);
        assert!(available.len() >= 15, "{available:?}");
        let mut seen = std::collections::BTreeSet::new();
        for case in 0..400 {
            let hidden = super::draw(5, case, &available, &Settings::default(), &|_| true)
                .unwrap_or_else(|e| panic!("{e}"));
            let count = hidden.names.len();
            let fits = match hidden.kind {
                Kind::None => count == 0,
                Kind::Single | Kind::LeftOut => count == 1,
                Kind::Several => (2..=5).contains(&count),
            };
            assert!(fits, "{hidden:?}");
            for name in &hidden.names {
                let effect = effects::by_id(name).expect("an effect");
                assert!(!hidden.settings.is_neutral(name, effect.specs()), "case {case}: {name} is neutral");
            }
            assert!(hidden.kind != Kind::LeftOut || !EXPRESSIBLE.contains(&hidden.names[0]), "{hidden:?}");
            if hidden.kind == Kind::Single {
                seen.extend(hidden.names);
            }
        }
        assert_eq!(seen.len(), available.len(), "only {seen:?} ever come up alone");
    }

    #[test]
    fn grades_are_in_range_rise_and_are_not_neutral() {
        let graded_names: Vec<_> =
            effects::LIST.iter().map(|e| e.id()).filter(|id| grade(id).is_some()).collect();
        assert_eq!(graded_names.len(), 25, "{graded_names:?}");
        for name in graded_names {
            let grade = grade(name).expect("filtered");
            let strengths: Vec<f64> = (0..6).map(|i| grade.strength(i, 6)).collect();
            assert!(strengths.windows(2).all(|w| w[0] < w[1]), "{name}");
            assert!((strengths[5] / grade.range[1] - 1.0).abs() < 1e-12, "{name}");
            let mut last = Settings::default();
            for (case, s) in strengths.into_iter().enumerate() {
                let hidden = graded(1, case, name, s, &Settings::default()).unwrap_or_else(|e| panic!("{e}"));
                let effect = effects::by_id(name).expect("an effect");
                assert!(!hidden.settings.is_neutral(name, effect.specs()), "{name} {s} is neutral");
                assert_ne!(hidden.settings, last, "{name} {s}");
                last = hidden.settings;
            }
        }
    }

    #[test]
    fn what_the_camera_knows_is_not_hidden() {
        let mut known = Settings::default();
        let read_noise = effects::by_id("read_noise").expect("an effect");
        known.set(read_noise, "sigma", Value::Number(0.01)).expect("in range");
        for case in 0..60 {
            let hidden =
                super::draw(1, case, &["read_noise", "defocus"], &known, &|_| true).expect("in range");
            assert!(!hidden.names.contains(&"read_noise") && hidden.settings.has("read_noise"));
        }
    }
}
