//! Parameters as data: one list of specs drives `camera.toml`, range checks, reports, fits (`fit`) and blind trials.

use std::collections::BTreeMap;
use std::fmt;

use super::{Effect, Fit};
use crate::error::{Error, Quoted, Result};

/// What values a parameter takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParamKind {
    /// A real number.
    Number {
        /// Smallest allowed value.
        min: f64,
        /// Largest allowed value.
        max: f64,
        /// The value that changes nothing.
        neutral: f64,
    },
    /// A whole number (in [`Settings`] a [`Value::Number`] without a fraction).
    Integer {
        /// Smallest allowed value.
        min: f64,
        /// Largest allowed value.
        max: f64,
        /// The value that changes nothing.
        neutral: f64,
    },
    /// One of a list of names.
    Choice {
        /// The names.
        options: &'static [&'static str],
        /// The one meant when none is given.
        neutral: &'static str,
    },
    /// Three real numbers; neutral is zero.
    Vector3 {
        /// Largest allowed magnitude of each component.
        max: f64,
    },
}

/// Name, unit, range and neutral value of one parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParamSpec {
    /// Name in `camera.toml` and reports, with its SI unit as suffix.
    pub name: &'static str,
    /// Unit in words: "s", "px", "fraction of full scale".
    pub unit: &'static str,
    /// Range and neutral value.
    pub kind: ParamKind,
    /// What it is and where its definition comes from.
    pub about: &'static str,
    /// How a diagnosis finds it; nothing for what no diagnosis looks for.
    pub fit: Option<Fit>,
    /// Other parameters of its effect: while all of them are neutral it changes nothing. Empty: it counts alone.
    pub beside: &'static [&'static str],
}

impl ParamSpec {
    /// The same, which a diagnosis looks for.
    pub const fn fit(self, fit: Fit) -> Self {
        Self { fit: Some(fit), ..self }
    }

    /// The same, which counts only beside one of these parameters of its effect.
    pub const fn beside(self, beside: &'static [&'static str]) -> Self {
        Self { beside, ..self }
    }

    /// A real number from `range.0` to `range.1`.
    pub const fn number(
        name: &'static str,
        unit: &'static str,
        range: (f64, f64),
        neutral: f64,
        about: &'static str,
    ) -> Self {
        Self::of(name, unit, ParamKind::Number { min: range.0, max: range.1, neutral }, about)
    }

    /// A whole number from `range.0` to `range.1`; neutral is `range.0`.
    pub const fn integer(
        name: &'static str,
        unit: &'static str,
        range: (f64, f64),
        about: &'static str,
    ) -> Self {
        Self::of(name, unit, ParamKind::Integer { min: range.0, max: range.1, neutral: range.0 }, about)
    }

    /// One of `options`; the first is neutral.
    pub const fn choice(name: &'static str, options: &'static [&'static str], about: &'static str) -> Self {
        Self::of(name, "", ParamKind::Choice { options, neutral: options[0] }, about)
    }

    /// Three real numbers of at most `max` each.
    pub const fn vector3(name: &'static str, unit: &'static str, max: f64, about: &'static str) -> Self {
        Self::of(name, unit, ParamKind::Vector3 { max }, about)
    }

    const fn of(name: &'static str, unit: &'static str, kind: ParamKind, about: &'static str) -> Self {
        Self { name, unit, kind, about, fit: None, beside: &[] }
    }
}

/// The value of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A real number.
    Number(f64),
    /// One of the spec's options.
    Choice(&'static str),
    /// Three real numbers.
    Vector3([f64; 3]),
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(n) => write!(f, "{}", Quoted(*n)),
            Self::Choice(c) => write!(f, "{c:?}"),
            Self::Vector3([x, y, z]) => write!(f, "[{}, {}, {}]", Quoted(*x), Quoted(*y), Quoted(*z)),
        }
    }
}

/// Which effects are on, and their parameters: a flat table keyed by stem and name, so that nothing that handles
/// settings needs to know any effect's type.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    tables: BTreeMap<&'static str, BTreeMap<&'static str, Value>>,
}

impl Settings {
    /// Switches an effect on with neutral parameters (no change if it is on).
    pub fn enable(&mut self, effect: &dyn Effect) {
        self.tables
            .entry(effect.id())
            .or_insert_with(|| effect.specs().iter().map(|spec| (spec.name, neutral(&spec.kind))).collect());
    }

    /// Sets one parameter and switches its effect on.
    ///
    /// # Errors
    /// A value outside the spec's range, or not a number.
    ///
    /// # Panics
    /// If the effect has no such parameter or it takes another kind of value.
    pub fn set(&mut self, effect: &dyn Effect, name: &str, value: Value) -> Result<()> {
        let spec = effect.specs().iter().find(|s| s.name == name);
        let spec = spec.unwrap_or_else(|| panic!("{} has no parameter {name}", effect.id()));
        check_range(effect.id(), spec, value)?;
        self.enable(effect);
        self.tables.get_mut(effect.id()).expect("just enabled").insert(spec.name, value);
        Ok(())
    }

    /// Switches an effect off.
    pub fn disable(&mut self, effect: &str) {
        self.tables.remove(effect);
    }

    /// Whether an effect is on.
    pub fn has(&self, effect: &str) -> bool {
        self.tables.contains_key(effect)
    }

    /// A parameter's value; `None` when its effect is off.
    pub fn get(&self, effect: &str, name: &str) -> Option<Value> {
        self.tables.get(effect)?.get(name).copied()
    }

    /// A number, or `neutral` when the effect is off.
    ///
    /// # Panics
    /// If the parameter is not a number.
    pub fn number(&self, effect: &str, name: &str, neutral: f64) -> f64 {
        match self.get(effect, name) {
            None => neutral,
            Some(Value::Number(n)) => n,
            Some(other) => panic!("{effect}.{name} is {other:?}, not a number"),
        }
    }

    /// A choice; `None` when the effect is off.
    pub fn choice(&self, effect: &str, name: &str) -> Option<&'static str> {
        match self.get(effect, name)? {
            Value::Choice(c) => Some(c),
            other => panic!("{effect}.{name} is {other:?}, not a choice"),
        }
    }

    /// Whether an effect is off or all its parameters are neutral.
    pub fn is_neutral(&self, effect: &str, specs: &[ParamSpec]) -> bool {
        specs.iter().all(|s| self.get(effect, s.name).is_none_or(|v| v == neutral(&s.kind)))
    }

    /// A sentence for each parameter of an effect that was set and changes nothing beside the others.
    pub fn idle(&self, effect: &str, specs: &[ParamSpec]) -> Vec<String> {
        let set = |name: &str| {
            let spec = specs.iter().find(|s| s.name == name)?;
            self.get(effect, name).filter(|v| *v != neutral(&spec.kind))
        };
        let said = |s: &ParamSpec| {
            let value = set(s.name)?;
            let idle = !s.beside.is_empty() && s.beside.iter().all(|b| set(b).is_none());
            let others = s.beside.join(" or ");
            idle.then(|| format!("{effect}.{} = {value} changes nothing without {others}", s.name))
        };
        specs.iter().filter_map(said).collect()
    }

    /// Effects that are on, with their parameters.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &BTreeMap<&'static str, Value>)> {
        self.tables.iter().map(|(k, v)| (*k, v))
    }
}

/// The value that changes nothing.
pub fn neutral(kind: &ParamKind) -> Value {
    match *kind {
        ParamKind::Number { neutral, .. } | ParamKind::Integer { neutral, .. } => Value::Number(neutral),
        ParamKind::Choice { neutral, .. } => Value::Choice(neutral),
        ParamKind::Vector3 { .. } => Value::Vector3([0.0; 3]),
    }
}

fn check_range(effect: &'static str, spec: &ParamSpec, value: Value) -> Result<()> {
    let outside = |value: f64, min: f64, max: f64| {
        Err(Error::Parameter { effect, name: spec.name, value, min, max, unit: spec.unit })
    };
    match (spec.kind, value) {
        // Written so that NaN, which is in no range, is refused.
        (ParamKind::Number { min, max, .. } | ParamKind::Integer { min, max, .. }, Value::Number(v))
            if !(min <= v && v <= max) =>
        {
            outside(v, min, max)
        }
        (ParamKind::Integer { .. }, Value::Number(v)) if v.fract() != 0.0 => {
            Err(Error::NotWhole { effect, name: spec.name, value: v })
        }
        (ParamKind::Vector3 { max }, Value::Vector3(v)) => match v.into_iter().find(|c| !(c.abs() <= max)) {
            Some(component) => outside(component, -max, max),
            None => Ok(()),
        },
        (ParamKind::Number { .. } | ParamKind::Integer { .. }, Value::Number(_)) => Ok(()),
        (ParamKind::Choice { options, .. }, Value::Choice(c)) if options.contains(&c) => Ok(()),
        (kind, value) => panic!("{effect}.{} takes {kind:?}, not {value:?}", spec.name),
    }
}
