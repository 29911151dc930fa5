//! Handles of parameters, made from an effect's specs when the crate is compiled: a name that the specs do not have, or
//! of another kind, does not compile, and no neutral value is written twice.

use super::params::{ParamKind, ParamSpec, Settings};

/// A number of an effect.
#[derive(Clone, Copy, Debug)]
pub struct Number {
    effect: &'static str,
    name: &'static str,
    neutral: f64,
}

/// A choice of an effect.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    effect: &'static str,
    name: &'static str,
}

impl Number {
    /// The parameter `name` of `specs`, which are those of `effect`.
    ///
    /// # Panics
    /// If there is none, or it is no number; in a constant: does not compile.
    pub const fn of(effect: &'static str, specs: &[ParamSpec], name: &str) -> Self {
        let spec = &specs[place(specs, name)];
        match spec.kind {
            ParamKind::Number { neutral, .. } | ParamKind::Integer { neutral, .. } => {
                Self { effect, name: spec.name, neutral }
            }
            _ => panic!("the parameter is no number"),
        }
    }

    /// Its name in `camera.toml`.
    pub const fn name(self) -> &'static str {
        self.name
    }
}

impl Choice {
    /// The parameter `name` of `specs`, which are those of `effect`.
    ///
    /// # Panics
    /// If there is none, or it is no choice; in a constant: does not compile.
    pub const fn of(effect: &'static str, specs: &[ParamSpec], name: &str) -> Self {
        let spec = &specs[place(specs, name)];
        assert!(matches!(spec.kind, ParamKind::Choice { .. }), "the parameter is no choice");
        Self { effect, name: spec.name }
    }
}

impl Settings {
    /// A number; what changes nothing where its effect is off.
    pub fn value(&self, of: Number) -> f64 {
        self.number(of.effect, of.name, of.neutral)
    }

    /// A choice; `None` where its effect is off.
    pub fn chosen(&self, of: Choice) -> Option<&'static str> {
        self.choice(of.effect, of.name)
    }
}

/// Where a name stands.
const fn place(specs: &[ParamSpec], name: &str) -> usize {
    let mut i = 0;
    while i < specs.len() {
        if is_same(specs[i].name.as_bytes(), name.as_bytes()) {
            return i;
        }
        i += 1;
    }
    panic!("the specs have no parameter of that name")
}

const fn is_same(a: &[u8], b: &[u8]) -> bool {
    if a.len() != b.len() {
        return false;
    }
    let mut i = 0;
    while i < a.len() {
        if a[i] != b[i] {
            return false;
        }
        i += 1;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPECS: &[ParamSpec] = &[
        ParamSpec::number("gain", "", (0.0, 8.0), 1.0, "a number"),
        ParamSpec::choice("shape", &["round", "square"], "a choice"),
    ];

    #[test]
    fn a_handle_reads_the_neutral_value_of_its_spec() {
        const GAIN: Number = Number::of("lamp", SPECS, "gain");
        const SHAPE: Choice = Choice::of("lamp", SPECS, "shape");
        let off = Settings::default();
        assert_eq!((off.value(GAIN), off.chosen(SHAPE), GAIN.name()), (1.0, None, "gain"));
        // Control: what would not compile in a constant.
        assert!(std::panic::catch_unwind(|| Number::of("lamp", SPECS, "gian")).is_err());
        assert!(std::panic::catch_unwind(|| Number::of("lamp", SPECS, "shape")).is_err());
        assert!(std::panic::catch_unwind(|| Choice::of("lamp", SPECS, "gain")).is_err());
    }
}
