//! Which effects a case hides, and how strong they are.

use super::draw::Draw;
use crate::chain::{ParamKind, Settings, Value};
use crate::effects;
use crate::error::Result;

/// What a case asks of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Nothing is hidden: anything named is a false alarm.
    None,
    /// One effect.
    Single,
    /// Two or three.
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
    ids.filter(|id| candidates.contains(id) && strength(id, &mut Draw::new(0, 0, id)).is_some()).collect()
}

/// Effects that other candidates express exactly, so that no picture tells whether they were left out: glare is a gain
/// below 1 with a black level, a black level is glare of level 1, a gain below 1 is glare of level 0. Leaving these
/// out asks nothing.
const EXPRESSIBLE: [&str; 3] = ["glare", "exposure_gain", "black_level"];

/// Draws what case `case` hides. `known` are the effects that its camera.toml models.
///
/// # Errors
/// None in practice: all strengths lie within their effects' ranges (tested).
pub(super) fn draw(seed: u64, case: usize, available: &[&'static str], known: &Settings) -> Result<Hidden> {
    let mut draw = Draw::new(seed, case, "hidden");
    let mut free: Vec<_> = available.iter().copied().filter(|n| !known.has(n)).collect();
    let kind = if free.is_empty() { Kind::None } else { PATTERN[case % PATTERN.len()] };
    if kind == Kind::LeftOut {
        free.retain(|n| !EXPRESSIBLE.contains(n));
    }
    let count = match kind {
        Kind::None => 0,
        Kind::Single | Kind::LeftOut => 1,
        Kind::Several => (2 + draw.index(2)).min(free.len()),
    };
    let mut chosen: Vec<usize> = Vec::new();
    if count > 0 {
        // The first goes round the list, so that every effect comes up equally often.
        let turn = PATTERN.iter().cycle().take(case).filter(|k| **k == kind).count();
        chosen.push((turn * 7 + (seed % 1000) as usize + kind as usize) % free.len());
    }
    while chosen.len() < count {
        let next = draw.index(free.len());
        if !chosen.contains(&next) {
            chosen.push(next);
        }
    }
    chosen.sort_unstable();
    let names: Vec<_> = chosen.into_iter().map(|i| free[i]).collect();
    let mut settings = known.clone();
    for name in &names {
        let effect = effects::by_id(name).expect("taken from the list");
        for (parameter, value) in strength(name, &mut draw).unwrap_or_default() {
            settings.set(effect, parameter, own_word(effect, parameter, value))?;
        }
    }
    Ok(Hidden { kind, names, settings })
}

/// A choice as the effect's own option of that place.
fn own_word(effect: &dyn crate::chain::Effect, parameter: &str, value: Drawn) -> Value {
    let spec = effect.specs().iter().find(|s| s.name == parameter).expect("checked by the tests");
    match (value, spec.kind) {
        (Drawn::Number(n), _) => Value::Number(n),
        (Drawn::Vector3(v), _) => Value::Vector3(v),
        (Drawn::Choice(part), ParamKind::Choice { options, .. }) => {
            Value::Choice(options[((part * options.len() as f64) as usize).min(options.len() - 1)])
        }
        (Drawn::Choice(_), kind) => panic!("{}.{parameter} is {kind:?}, not a choice", effect.id()),
    }
}

/// A drawn value; a choice is a place, 0..1, in the list of options.
enum Drawn {
    Number(f64),
    Vector3([f64; 3]),
    Choice(f64),
}

type Strength = Vec<(&'static str, Drawn)>;

/// A strength between "an attentive person may see it" and "a bad camera"; nothing for effects that cannot be hidden.
fn strength(name: &str, draw: &mut Draw) -> Option<Strength> {
    use Drawn::{Choice, Number, Vector3};
    Some(match name {
        "rolling_shutter" => {
            let order = if draw.chance(0.6) { 0.0 } else { draw.unit() };
            vec![("readout_time_s", Number(draw.log_between(0.005, 0.031))), ("scan_order", Choice(order))]
        }
        "motion_blur" => vec![("exposure_time_s", Number(draw.log_between(0.004, 0.028)))],
        "time_offset" => vec![("offset_s", Number(draw.sign() * draw.log_between(0.004, 0.06)))],
        "pose_offset" => {
            let axis = [(); 3].map(|()| draw.between(-1.0, 1.0));
            let length = axis.iter().map(|v| v * v).sum::<f64>().sqrt().max(1e-3);
            let angle_rad = draw.log_between(0.004, 0.03);
            vec![("rotvec_rad", Vector3(axis.map(|v| v / length * angle_rad)))]
        }
        "focal_length_error" => vec![("ratio", Number(1.0 + draw.sign() * draw.log_between(0.006, 0.05)))],
        "lens_distortion" => {
            let k1 = draw.sign() * draw.log_between(0.03, 0.25);
            vec![("k1", Number(k1)), ("k2", Number(-0.2 * k1 * draw.unit()))]
        }
        "chromatic_aberration" => {
            let part = draw.log_between(0.001, 0.006);
            vec![("scale_r", Number(1.0 + part)), ("scale_b", Number(1.0 - part * draw.between(0.5, 1.5)))]
        }
        "defocus" => vec![("sigma_px", Number(draw.log_between(0.5, 2.5)))],
        "vignetting" => {
            vec![("a1", Number(-draw.log_between(0.1, 0.6))), ("a2", Number(draw.between(-0.2, 0.1)))]
        }
        "glare" => {
            vec![("veil", Number(draw.log_between(0.03, 0.3))), ("level", Number(draw.between(0.2, 0.9)))]
        }
        "exposure_gain" => vec![("gain", Number((draw.sign() * draw.log_between(0.05, 0.5)).exp()))],
        "flicker" => vec![
            // Not near a multiple of 30 Hz: seen by a global shutter, that is a gain and no flicker.
            ("frequency_hz", Number(draw.between(96.0, 114.0))),
            ("depth", Number(draw.log_between(0.05, 0.3))),
            ("phase_rad", Number(draw.between(-3.0, 3.0))),
        ],
        "shot_noise" => vec![("full_well_e", Number(draw.log_between(200.0, 5000.0)))],
        "fixed_pattern_noise" => {
            vec![
                ("dsnu", Number(draw.log_between(0.004, 0.03))),
                ("prnu", Number(draw.log_between(0.008, 0.05))),
            ]
        }
        "row_noise" => vec![("sigma", Number(draw.log_between(0.003, 0.02)))],
        "read_noise" => vec![("sigma", Number(draw.log_between(0.004, 0.04)))],
        "hot_pixels" => vec![("fraction", Number(draw.log_between(0.0004, 0.005)))],
        "black_level" => vec![("offset", Number(draw.log_between(0.008, 0.1)))],
        "white_balance" => {
            let gain = |draw: &mut Draw| Number((draw.sign() * draw.log_between(0.04, 0.35)).exp());
            vec![("r", gain(draw)), ("b", gain(draw))]
        }
        "gamma" => vec![("exponent", Number((draw.sign() * draw.log_between(0.05, 0.35)).exp()))],
        "sharpening" => {
            vec![
                ("amount", Number(draw.log_between(0.3, 2.0))),
                ("radius_px", Number(draw.between(0.7, 2.0))),
            ]
        }
        "chroma_subsampling" => vec![("scheme", Choice(draw.between(0.4, 1.0)))],
        "bayer_mosaic" => vec![("pattern", Choice(draw.between(0.25, 1.0)))],
        "jpeg" => vec![("quality", Number(draw.between(25.0, 85.0).round()))],
        _ => return None,
    })
}

/// How an effect is graded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grade {
    /// What is graded, with its unit.
    pub(super) measure: &'static str,
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

/// The grades of an effect: from what nobody sees at 160x120 to what anybody does; nothing for effects that are on or off.
pub(super) fn grade(name: &str) -> Option<Grade> {
    let (measure, range) = match name {
        "rolling_shutter" => ("readout_time_s", [2e-4, 2e-2]),
        "motion_blur" => ("exposure_time_s", [5e-4, 2e-2]),
        "time_offset" => ("|offset_s|", [1e-4, 1e-2]),
        "pose_offset" => ("angle, rad", [1e-4, 1e-2]),
        "focal_length_error" => ("|ratio - 1|", [2e-4, 2e-2]),
        "lens_distortion" => ("|k1|", [1e-3, 1e-1]),
        "chromatic_aberration" => ("|scale - 1|", [1e-4, 6e-3]),
        "defocus" => ("sigma_px", [0.1, 2.0]),
        "vignetting" => ("-a1", [4e-3, 4e-1]),
        "glare" => ("veil", [1e-3, 1e-1]),
        "exposure_gain" => ("|ln gain|", [2e-3, 2e-1]),
        "flicker" => ("depth", [3e-3, 3e-1]),
        "shot_noise" => ("1 / sqrt(full_well_e)", [2e-3, 7e-2]),
        "fixed_pattern_noise" => ("dsnu = prnu / 2", [3e-4, 1e-2]),
        "row_noise" => ("sigma", [2e-4, 1e-2]),
        "read_noise" => ("sigma", [3e-4, 1e-2]),
        "hot_pixels" => ("fraction", [5e-5, 5e-3]),
        "black_level" => ("offset", [3e-4, 3e-2]),
        "white_balance" => ("|ln r| = |ln b|", [2e-3, 2e-1]),
        "gamma" => ("|ln exponent|", [2e-3, 2e-1]),
        "sharpening" => ("amount", [2e-2, 2.0]),
        "jpeg" => ("100 - quality", [2.0, 70.0]),
        _ => return None,
    };
    Some(Grade { measure, range })
}

/// Hides one effect at a strength (see [`grade`]); signs, directions and partners are drawn.
///
/// # Errors
/// None in practice: all strengths lie within their effects' ranges (tested).
pub(super) fn graded(seed: u64, case: usize, name: &'static str, s: f64, known: &Settings) -> Result<Hidden> {
    use Drawn::{Number, Vector3};
    let mut draw = Draw::new(seed, case, name);
    let sign = draw.sign();
    let values = match name {
        "rolling_shutter" => vec![("readout_time_s", Number(s))],
        "motion_blur" => vec![("exposure_time_s", Number(s))],
        "time_offset" => vec![("offset_s", Number(sign * s))],
        "pose_offset" => {
            let axis = [(); 3].map(|()| draw.between(-1.0, 1.0));
            let length = axis.iter().map(|v| v * v).sum::<f64>().sqrt().max(1e-3);
            vec![("rotvec_rad", Vector3(axis.map(|v| v / length * s)))]
        }
        "focal_length_error" => vec![("ratio", Number(1.0 + sign * s))],
        "lens_distortion" => vec![("k1", Number(sign * s))],
        "chromatic_aberration" => {
            vec![("scale_r", Number(1.0 + sign * s)), ("scale_b", Number(1.0 - sign * s))]
        }
        "defocus" => vec![("sigma_px", Number(s))],
        "vignetting" => vec![("a1", Number(-s))],
        "glare" => vec![("veil", Number(s)), ("level", Number(draw.between(0.2, 0.9)))],
        "exposure_gain" => vec![("gain", Number((sign * s).exp()))],
        "flicker" => vec![
            ("frequency_hz", Number(draw.between(96.0, 114.0))),
            ("depth", Number(s)),
            ("phase_rad", Number(draw.between(-3.0, 3.0))),
        ],
        "shot_noise" => vec![("full_well_e", Number(1.0 / (s * s)))],
        "fixed_pattern_noise" => vec![("dsnu", Number(s)), ("prnu", Number(2.0 * s))],
        "row_noise" | "read_noise" => vec![("sigma", Number(s))],
        "hot_pixels" => vec![("fraction", Number(s))],
        "black_level" => vec![("offset", Number(s))],
        "white_balance" => vec![("r", Number((sign * s).exp())), ("b", Number((-sign * s).exp()))],
        "gamma" => vec![("exponent", Number((sign * s).exp()))],
        "sharpening" => vec![("amount", Number(s)), ("radius_px", Number(draw.between(0.8, 1.6)))],
        "jpeg" => vec![("quality", Number((100.0 - s).round()))],
        _ => Vec::new(),
    };
    let mut settings = known.clone();
    let effect = effects::by_id(name).expect("taken from the list");
    for (parameter, value) in values {
        settings.set(effect, parameter, own_word(effect, parameter, value))?;
    }
    Ok(Hidden { kind: Kind::Single, names: vec![name], settings })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_strength_is_in_range_and_not_neutral() {
        let ids: Vec<_> = effects::LIST.iter().map(|e| e.id()).collect();
        let available = available(&ids);
        assert!(available.len() >= 15, "{available:?}");
        let mut seen = std::collections::BTreeSet::new();
        for case in 0..400 {
            let hidden =
                super::draw(5, case, &available, &Settings::default()).unwrap_or_else(|e| panic!("{e}"));
            let count = hidden.names.len();
            let fits = match hidden.kind {
                Kind::None => count == 0,
                Kind::Single | Kind::LeftOut => count == 1,
                Kind::Several => (2..=3).contains(&count),
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
        assert_eq!(graded_names.len(), 22, "{graded_names:?}");
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
            let hidden = super::draw(1, case, &["read_noise", "defocus"], &known).expect("in range");
            assert!(!hidden.names.contains(&"read_noise") && hidden.settings.has("read_noise"));
        }
    }
}
