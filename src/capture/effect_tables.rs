//! The effects' tables in `camera.toml`, driven by [`effects::LIST`] and each effect's specs: no effect is named here.

use std::borrow::Cow;

use toml::Spanned;
use toml::de::DeTable;

use super::text::{Entry, TomlText};
use crate::chain::{Effect, ParamKind, ParamSpec, Settings, Value};
use crate::effects;
use crate::error::{Error, Result};

pub(super) const KEYS: [&str; 11] = [
    "width",
    "height",
    "fx",
    "fy",
    "cx",
    "cy",
    "frame_period_s",
    "background",
    "static",
    "shading",
    "linear",
];

/// One of `options`.
pub(super) fn choose(
    toml: &TomlText,
    name: &str,
    value: &Entry,
    options: &[&'static str],
) -> Result<&'static str> {
    let given = value.get_ref().as_str();
    options.iter().find(|o| Some(**o) == given).copied().ok_or_else(|| {
        let list: Vec<String> = options.iter().map(|o| format!("{o:?}")).collect();
        toml.unexpected(name, value, list.join(" or "))
    })
}

/// The effects' tables, and what their own checks have to say.
pub(super) fn read_effects(
    toml: &TomlText,
    table: &DeTable,
    frame_period_s: f64,
) -> Result<(Settings, Vec<String>)> {
    let mut settings = Settings::default();
    for effect in effects::LIST {
        if let Some(entries) = table.get(effect.id()).and_then(|t| t.get_ref().as_table()) {
            settings.enable(*effect);
            for (key, value) in entries.iter() {
                read_parameter(toml, *effect, key, value, &mut settings)?;
            }
        }
    }
    let mut warnings: Vec<String> =
        effects::LIST.iter().filter_map(|effect| empty(toml, table, *effect, &settings)).collect();
    for effect in effects::LIST.iter().filter(|e| settings.has(e.id())) {
        let line = table.get(effect.id()).map(|t| toml.line(t.span()));
        warnings.extend(
            effect
                .warnings(&settings, frame_period_s)
                .map_err(|problem| at(toml, line, problem, String::new()))?,
        );
    }
    Ok((settings, warnings))
}

/// What is worth saying of a table in which nothing stands and which does nothing so.
fn empty(toml: &TomlText, table: &DeTable, effect: &dyn Effect, settings: &Settings) -> Option<String> {
    let entry = table.get(effect.id())?;
    let is_empty = entry.get_ref().as_table()?.iter().next().is_none();
    (is_empty && settings.is_neutral(effect.id(), effect.specs())).then(|| {
        let line = toml.line(entry.span());
        let names: Vec<&str> = effect.specs().iter().map(|s| s.name).collect();
        format!("line {line}: [{}] is empty and changes nothing; it takes {}", effect.id(), names.join(", "))
    })
}

fn read_parameter(
    toml: &TomlText,
    effect: &'static dyn Effect,
    key: &Spanned<Cow<str>>,
    value: &Entry,
    settings: &mut Settings,
) -> Result<()> {
    let (name, line) = (key.get_ref().as_ref(), toml.line(key.span()));
    let Some(spec) = effect.specs().iter().find(|s| s.name == name) else {
        if KEYS.contains(&name) {
            let found = format!("`{name}` in the table [{}]", effect.id());
            return Err(Error::input(
                toml.path(),
                line,
                found,
                "it above the first table: it belongs to the camera",
            ));
        }
        let known = effect.specs().iter().map(|s| s.name);
        return Err(Error::unknown_name(toml.path(), line, "parameter", name, known));
    };
    let parsed = parameter_value(toml, effect.id(), spec, value)?;
    settings.set(effect, name, parsed).map_err(|problem| {
        let hint = unit_hint(&problem);
        at(toml, Some(line), problem, hint)
    })
}

fn parameter_value(toml: &TomlText, effect: &str, spec: &ParamSpec, value: &Entry) -> Result<Value> {
    let name = format!("{effect}.{}", spec.name);
    let unit = if spec.unit.is_empty() { String::new() } else { format!(" of unit {}", spec.unit) };
    Ok(match spec.kind {
        ParamKind::Number { min, max, .. } => {
            Value::Number(toml.number(&name, value, &format!("a finite number{unit}, {min} to {max}"))?)
        }
        ParamKind::Integer { min, max, .. } => {
            Value::Number(toml.number(&name, value, &format!("a whole number{unit}, {min} to {max}"))?)
        }
        ParamKind::Choice { options, .. } => Value::Choice(choose(toml, &name, value, options)?),
        ParamKind::Vector3 { max } => Value::Vector3(toml.vector3(
            &name,
            value,
            &format!("a list of three finite numbers{unit}, -{max} to {max}"),
        )?),
    })
}

fn at(toml: &TomlText, line: Option<usize>, problem: Error, hint: String) -> Error {
    Error::At { path: toml.path().to_owned(), line, problem: Box::new(problem), hint }
}

/// "; is it in ms?" where seconds are meant and the same number of ms, us or ns would be in range.
fn unit_hint(problem: &Error) -> String {
    let Error::Parameter { value, min, max, unit: "s", .. } = problem else { return String::new() };
    let smaller = [("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];
    let meant = smaller.iter().find(|(_, s)| (*min..=*max).contains(&(value * s)));
    // A negative value is out of range in every unit, unless the range holds negative ones.
    meant.map(|(name, _)| format!("; is it in {name}?")).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn vectors_are_read_and_ranged() {
        let spec = ParamSpec::vector3("rotvec_rad", "rad", 3.2, "");
        let read = |text: &str| {
            let toml = TomlText::new(Path::new("camera.toml"), text);
            let table = toml.parse().expect("TOML");
            parameter_value(&toml, "pose_offset", &spec, table.get("v").expect("there"))
        };
        assert_eq!(read("v = [1, 2.5, -3e-1]").expect("three numbers"), Value::Vector3([1.0, 2.5, -0.3]));
        for (bad, found) in
            [("[1, 2]", "a list of 2"), ("[1, 2, nan]", "nan"), ("3", "3"), ("[1, 2, \"3\"]", "\"3\"")]
        {
            let error = read(&format!("\nv = {bad}")).expect_err(bad).to_string();
            let want = format!(
                "camera.toml:2: found pose_offset.rotvec_rad = {found}; expected a list of three finite numbers of \
                 unit rad"
            );
            assert!(error.starts_with(&want), "{error}");
        }
    }

    #[test]
    fn a_table_without_anything_in_it_is_told() {
        let warnings = |text: &str| {
            let toml = TomlText::new(Path::new("camera.toml"), text);
            read_effects(&toml, &toml.parse().expect("TOML"), 0.04).expect("allowed").1
        };
        let said = warnings("[read_noise]\nsigma = 0.01\n[motion_blur]\n");
        let want = "line 3: [motion_blur] is empty and changes nothing; it takes exposure_time_s";
        assert!(said.len() == 1 && said[0].starts_with(want), "{said:?}");
        assert!(warnings("[motion_blur]\nexposure_time_s = 0.01\n").is_empty(), "control");
        assert!(
            warnings("[motion_blur]\nexposure_time_s = 0\n").is_empty(),
            "somebody has said that it is zero"
        );
    }
}
