//! Whether the report itself says that these frames do not tell a set from the hidden one.

use std::collections::BTreeSet;

use crate::diagnose::EffectFound;

/// Whether `found` (of the camera) is `hidden`, but for effects that stand for others: an effect that was not hidden
/// must have one that was, and is not named, among its alternatives, or do the same as hidden ones together.
pub(super) fn is_alike(hidden: &[String], found: &[&EffectFound]) -> bool {
    let named: BTreeSet<&str> = found.iter().map(|e| e.name.as_str()).collect();
    let asked: BTreeSet<&str> = hidden.iter().map(String::as_str).collect();
    let mut missing: BTreeSet<&str> = asked.difference(&named).copied().collect();
    // Those that stand for several first: what they stand for is known.
    let (together, single): (Vec<&&EffectFound>, Vec<_>) =
        found.iter().filter(|e| !asked.contains(e.name.as_str())).partition(|e| {
            !e.same_together.is_empty() && e.same_together.keys().all(|k| missing.contains(k.as_str()))
        });
    for effect in together {
        missing.retain(|m| !effect.same_together.contains_key(*m));
    }
    single.len() == missing.len() && each_stands_for_one(&single, &missing)
}

/// Whether every effect can be given one of the missing that is among its alternatives.
fn each_stands_for_one(effects: &[&&EffectFound], missing: &BTreeSet<&str>) -> bool {
    let Some((first, rest)) = effects.split_first() else { return true };
    missing.iter().filter(|m| first.alternatives.iter().any(|a| a == *m)).any(|taken| {
        let left: BTreeSet<&str> = missing.iter().copied().filter(|m| m != taken).collect();
        each_stands_for_one(rest, &left)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn effect(name: &str, alternatives: &[&str], together: &[&str]) -> EffectFound {
        let together =
            together.iter().map(|t| ((*t).to_owned(), [("gain".to_owned(), 1.0)].into())).collect();
        EffectFound {
            name: name.to_owned(),
            share: 1.0,
            parameters: Default::default(),
            camera: true,
            gap_without: 1.0,
            gap_with: 0.0,
            gap_alone: 0.0,
            gain_ci95: [1.0; 2],
            alternatives: alternatives.iter().map(|a| (*a).to_owned()).collect(),
            same_together: together,
            footage: String::new(),
        }
    }

    fn alike(hidden: &[&str], found: &[EffectFound]) -> bool {
        let hidden: Vec<String> = hidden.iter().map(|h| (*h).to_owned()).collect();
        is_alike(&hidden, &found.iter().collect::<Vec<_>>())
    }

    #[test]
    fn an_effect_stands_for_the_hidden_one_that_it_names_and_for_no_other() {
        let blur = || effect("motion_blur", &["rolling_shutter", "time_offset"], &[]);
        assert!(alike(&["motion_blur"], &[blur()]) && alike(&["rolling_shutter"], &[blur()]));
        assert!(!alike(&["gamma"], &[blur()]), "control");
        assert!(!alike(&["rolling_shutter", "gamma"], &[blur()]), "one that is missing");
        assert!(!alike(&["rolling_shutter"], &[blur(), effect("gamma", &[], &[])]), "one too many");
        assert!(!alike(&["rolling_shutter", "time_offset"], &[blur()]), "it stands for one");
        assert!(!alike(&["rolling_shutter", "motion_blur"], &[blur()]), "it is there itself");
    }

    #[test]
    fn two_effects_stand_for_two_whichever_comes_first() {
        let found = [effect("a", &["x", "y"], &[]), effect("b", &["x"], &[])];
        assert!(alike(&["x", "y"], &found));
        assert!(!alike(&["y", "z"], &found));
    }

    #[test]
    fn an_effect_stands_for_two_that_do_the_same_together() {
        let glare = || effect("glare", &[], &["exposure_gain", "black_level"]);
        let jpeg = || effect("jpeg", &[], &[]);
        assert!(alike(&["exposure_gain", "black_level", "jpeg"], &[glare(), jpeg()]));
        assert!(!alike(&["exposure_gain", "jpeg"], &[glare(), jpeg()]), "one of them alone does not");
    }
}
