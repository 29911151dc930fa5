//! Between the flat vector of a fit and the effects' settings of a camera.

use super::model::{CANDIDATES, CandidateSpec, Theta, candidate_of};
use shutterbug::camera::ScanOrder;
use shutterbug::chain::{Held, ParamKind, Settings, Value};
use shutterbug::effects;
use shutterbug::error::Result;
use shutterbug::reference::moments::is_pointwise;

/// The parameters that a camera already has.
pub(crate) fn theta_of(settings: &Settings) -> Theta {
    let mut theta = Theta::neutral();
    for candidate in CANDIDATES.iter().filter(|c| settings.has(c.name)) {
        candidate.parameters.iter().chain(candidate.more).for_each(|&p| theta.take(p, settings));
    }
    let order = settings.choice("rolling_shutter", "scan_order").and_then(ScanOrder::from_name);
    theta.scan_order = order.unwrap_or_default();
    theta
}

/// Writes the fitted effects of `set` into a camera's settings. Returns the names that this program cannot simulate.
///
/// # Errors
/// A value outside its effect's range.
pub(crate) fn apply(
    settings: &mut Settings,
    theta: &Theta,
    set: &[&'static str],
) -> Result<Vec<&'static str>> {
    let mut unknown = Vec::new();
    for name in set.iter().filter(|n| !super::room::is_description(n)) {
        let Some(effect) = effects::by_id(name) else {
            unknown.push(*name);
            continue;
        };
        let candidate = candidate_of(name);
        let all = candidate.parameters.iter().chain(candidate.more);
        for &p in all.filter(|p| p.spec().component == 0) {
            settings.set(effect, p.spec().name, theta.value(p))?;
        }
        for spec in effect.specs().iter().filter(|s| s.fit.is_some_and(|f| f.held == Held::Aside)) {
            let ParamKind::Choice { options, .. } = spec.kind else { continue };
            let own = options.iter().find(|o| **o == theta.scan_order.name());
            settings.set(effect, spec.name, Value::Choice(own.expect("every order has a word")))?;
        }
    }
    Ok(unknown)
}

/// The effects of `theta` that are on.
pub(crate) fn settings_of(theta: &Theta) -> Settings {
    let is_on = |c: &&CandidateSpec| c.parameters.iter().chain(c.more).any(|&p| theta.is_on(p));
    let names: Vec<&'static str> = CANDIDATES.iter().filter(is_on).map(|c| c.name).collect();
    let mut settings = Settings::default();
    apply(&mut settings, theta, &names).expect("fits look where effects have values");
    settings
}

/// `theta` without what mixes neighbouring pixels.
pub(crate) fn without_neighbours(theta: &Theta) -> Theta {
    let mixes = |c: &&CandidateSpec| {
        let mut settings = Settings::default();
        apply(&mut settings, theta, &[c.name]).expect("fits look where effects have values");
        !is_pointwise(&settings)
    };
    let on = |c: &&CandidateSpec| c.parameters.iter().chain(c.more).any(|&p| theta.is_on(p));
    CANDIDATES.iter().filter(on).filter(mixes).fold(theta.clone(), |theta, c| theta.without(c))
}

/// The lens of `theta`, which the engine draws through; nothing for an ideal one.
pub(crate) fn lens(theta: &Theta) -> Settings {
    let mut settings = Settings::default();
    let lens = candidate_of("lens_distortion");
    if lens.parameters.iter().chain(lens.more).any(|&p| theta.is_on(p)) {
        apply(&mut settings, theta, &[lens.name]).expect("in the range of any lens");
    }
    settings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::expect::model::P;

    #[test]
    fn what_mixes_neighbours_goes_and_what_does_not_stays() {
        let single = Theta::neutral().with(P::Focal, 1.02).with(P::Bits, 5.0);
        assert_eq!(without_neighbours(&single), single);
        let mixing = single.with(P::Defocus, 1.0).with(P::Sharpen, 0.8).with(P::Quality, 80.0);
        assert!(!is_pointwise(&settings_of(&mixing)), "control");
        assert!(is_pointwise(&settings_of(&without_neighbours(&mixing))));
        let still = [P::Focal, P::Bits].map(|p| without_neighbours(&mixing).get(p));
        assert_eq!(still, [1.02, 5.0]);
    }
}
