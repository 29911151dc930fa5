//! Between the flat vector of a fit and the effects' settings of a camera.

use super::model::{CANDIDATES, CandidateSpec, P, PATTERNS, SCHEMES, Theta};
use crate::camera::ScanOrder;
use crate::chain::{Effect, ParamKind, Settings, Value};
use crate::effects;
use crate::error::Result;

/// The parameters that a camera already has.
pub(super) fn theta_of(settings: &Settings) -> Theta {
    let mut theta = Theta::neutral();
    for candidate in CANDIDATES.iter().filter(|c| settings.has(c.name)) {
        let number = |name: &str| match settings.get(candidate.name, name) {
            Some(Value::Number(n)) => Some(n),
            _ => None,
        };
        match candidate.name {
            "flicker" => {
                let (depth, phase) = (number("depth").unwrap_or(0.0), number("phase_rad").unwrap_or(0.0));
                theta.set(P::FlickerF, number("frequency_hz").unwrap_or(100.0));
                theta.set(P::FlickerC, depth * phase.cos());
                theta.set(P::FlickerS, depth * phase.sin());
            }
            "shot_noise" => {
                let full_well_e = number("full_well_e").unwrap_or(0.0);
                theta.set(P::Shot, if full_well_e > 0.0 { 1.0 / full_well_e } else { 0.0 });
            }
            "pose_offset" => {
                if let Some(Value::Vector3(v)) = settings.get("pose_offset", "rotvec_rad") {
                    [P::RotX, P::RotY, P::RotZ].into_iter().zip(v).for_each(|(p, v)| theta.set(p, v));
                }
            }
            "chroma_subsampling" | "bayer_mosaic" => {
                let p = candidate.parameters[0];
                let names: &[&str] = if p == P::Chroma { &SCHEMES } else { &PATTERNS };
                let name = settings.choice(candidate.name, p.spec().name);
                let place = names.iter().position(|n| Some(*n) == name).unwrap_or(0);
                theta.set(p, place as f64);
            }
            name => {
                for &p in candidate.parameters.iter().chain(candidate.more) {
                    if let Some(v) = number(p.spec().name) {
                        theta.set(p, v);
                    }
                }
                if name == "rolling_shutter" {
                    let order = settings.choice(name, "scan_order").and_then(ScanOrder::from_name);
                    theta.scan_order = order.unwrap_or_default();
                }
            }
        }
    }
    theta
}

/// Writes the fitted effects of `set` into a camera's settings. Returns the names that this program cannot simulate.
///
/// # Errors
/// A value outside its effect's range.
pub(super) fn apply(
    settings: &mut Settings,
    theta: &Theta,
    set: &[&'static str],
) -> Result<Vec<&'static str>> {
    let mut unknown = Vec::new();
    for name in set {
        let Some(effect) = effects::by_id(name) else {
            unknown.push(*name);
            continue;
        };
        let candidate = super::model::candidate_of(name);
        for (parameter, value) in values(theta, candidate) {
            put(settings, effect, parameter, value)?;
        }
    }
    Ok(unknown)
}

fn values(theta: &Theta, candidate: &CandidateSpec) -> Vec<(&'static str, Value)> {
    let number = |p: P| Value::Number(theta.get(p));
    match candidate.name {
        "flicker" => {
            let (c, s) = (theta.get(P::FlickerC), theta.get(P::FlickerS));
            vec![
                ("frequency_hz", number(P::FlickerF)),
                ("depth", Value::Number(c.hypot(s).min(1.0))),
                ("phase_rad", Value::Number(s.atan2(c))),
            ]
        }
        "shot_noise" => vec![("full_well_e", Value::Number(1.0 / theta.get(P::Shot).max(1e-9)))],
        "pose_offset" => {
            let v = [P::RotX, P::RotY, P::RotZ].map(|p| theta.get(p));
            vec![("rotvec_rad", Value::Vector3(v))]
        }
        "chroma_subsampling" => vec![("scheme", Value::Choice(SCHEMES[theta.get(P::Chroma) as usize]))],
        "bayer_mosaic" => vec![("pattern", Value::Choice(PATTERNS[theta.get(P::Mosaic) as usize]))],
        name => {
            let mut all: Vec<_> = candidate
                .parameters
                .iter()
                .chain(candidate.more)
                .map(|&p| (p.spec().name, number(p)))
                .collect();
            if name == "rolling_shutter" {
                all.push(("scan_order", Value::Choice(theta.scan_order.name())));
            }
            all
        }
    }
}

/// Sets a parameter; a choice is written as the effect's own word for it.
fn put(settings: &mut Settings, effect: &dyn Effect, name: &str, value: Value) -> Result<()> {
    let Some(spec) = effect.specs().iter().find(|s| s.name == name) else { return Ok(()) };
    let value = match (value, spec.kind) {
        (Value::Choice(c), ParamKind::Choice { options, .. }) => {
            let Some(own) = options.iter().find(|o| **o == c) else { return Ok(()) };
            Value::Choice(own)
        }
        (other, _) => other,
    };
    settings.set(effect, name, value)
}

/// The lens of `theta`, which the engine draws through; nothing for an ideal one.
pub(super) fn lens(theta: &Theta) -> Settings {
    let mut settings = Settings::default();
    let Some(effect) = effects::by_id("lens_distortion") else { return settings };
    for p in [P::K1, P::K2, P::P1, P::P2, P::K3] {
        if theta.is_on(p) {
            settings
                .set(effect, p.spec().name, Value::Number(theta.get(p)))
                .expect("in the range of any lens");
        }
    }
    settings
}
